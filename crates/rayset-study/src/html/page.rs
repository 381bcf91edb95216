//! The page around the sections.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::{ReportPlan, Section};

const STYLE: &str = include_str!("style.css");
const TITLE: &str = "Coherent ray tracing of 1985, reproduced";

/// Nothing but what is inside the file may be loaded; and there is no script to run.
const POLICY: &str = "default-src 'none'; img-src data:; style-src 'unsafe-inline'";

/// More views than a gallery ever has: two for each strategy.
const MOST_VIEWS: usize = 32;

pub(super) fn page(plan: &ReportPlan, sections: &[Section]) -> String {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="color-scheme" content="light dark";
                meta name="generator" content={ "rayset " (env!("CARGO_PKG_VERSION")) };
                title { (TITLE) " - rayset" }
                // An icon of its own, or the browser would ask for one.
                link rel="icon" href="data:,";
                style { (PreEscaped(style())) }
            }
            body {
                a.skip href="#main" { "Skip to the content" }
                header {
                    h1 { (TITLE) }
                    p.lead {
                        "Speer, DeRose and Barsky (1985) kept the intersection tree of one pixel to guess the next one's, and reported that it does not pay. "
                        "This page shows what " strong { "rayset" } " finds: their Table 1, the plane around it, their cost model, and the pixels that their algorithm gets wrong."
                    }
                    nav aria-label="Contents" {
                        ol { @for section in sections { li { a href={ "#" (section.id) } { (section.title) } } } }
                    }
                }
                main id="main" tabindex="-1" {
                    (words())
                    @for section in sections {
                        section aria-labelledby={ (section.id) } {
                            h2 id=(section.id) { (section.title) }
                            (section.body)
                        }
                    }
                }
                footer {
                    p {
                        "Written by " code { (plan.command) } " of rayset " (env!("CARGO_PKG_VERSION")) ". "
                        "Counts are exact and the same on every machine; times are of the machine that the records were made on, and only their ratios mean something."
                    }
                }
            }
        }
    }
    .into_string()
}

/// The style, with a rule for each view that a switch can show.
fn style() -> String {
    let rule = |i: usize| {
        format!("  .gallery:has(input[value=\"{i}\"]:checked) .view[data-view=\"{i}\"] {{ display: block; }}")
    };
    STYLE.replace("VIEWS", &(0..MOST_VIEWS).map(rule).collect::<Vec<_>>().join("\n"))
}

/// What figures speak of.
fn words() -> Markup {
    html! {
        section aria-labelledby="words" {
            h2 id="words" { "Words" }
            dl.words {
                div { dt { code { "standard" } } dd { "tests every bounding volume for every ray (section 2.2 of the paper). All ratios are over it." } }
                div { dt { code { "speer-1985" } } dd { "the paper's algorithm, as literally as its text allows; names that begin like this are other readings of the text. Not exact: its wrong pixels are counted." } }
                div { dt { "other names" } dd { "exact strategies: their images are those of " code { "standard" } ", bit by bit." } }
                div { dt { "coherent ray" } dd { "a ray that was answered from what the ray before it had left or, where rays are traced in bundles, under one shaft with its neighbours." } }
                div { dt { "ratio of work" } dd { "tests of primitives, volumes and boxes, pierce checks (two each), comparisons and cells, over those of " code { "standard" } "; exact." } }
                div { dt { "ratio of times" } dd { "seconds inside the strategy's calls, over those of " code { "standard" } "; one thread." } }
            }
        }
    }
}
