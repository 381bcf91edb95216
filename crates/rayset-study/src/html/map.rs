//! The map: coherence, work and time over n and resolution.

use maud::{Markup, PreEscaped, html};

use super::draw::{HeatMap, Scale as Colours};
use super::provenance::{made, numbers};
use super::{ReportPlan, Section, Step};
use crate::study::{Figures, Plane, planes};
use crate::{PAPER, PaperRow, Scale, StudyError, StudyName};

type Grid = [Vec<Option<f64>>];

pub(super) fn section(plan: &ReportPlan, step: Step<'_>) -> Result<Section, StudyError> {
    let (planes, note) = recorded(plan, step)?;
    let body = html! {
        p {
            "Coherence, work and time over the number of spheres and the resolution: medians over seeds. "
            "Black notches are where the ratio crosses 1, interpolated in the logarithm of n. "
            "The row below is the paper's, at a resolution it does not say; for times its ratios are recomputed from its own times, and of work it says nothing."
        }
        @if let Some(note) = note { p.note { (note) } }
        @for (i, plane) in planes.iter().enumerate() { (sheet(plan, i, plane)?) }
    };
    Ok(Section { id: "map", title: "The map over n and resolution", body })
}

/// The planes of what is recorded, or else of the quick form; and what the reader should know of that.
fn recorded(plan: &ReportPlan, step: Step<'_>) -> Result<(Vec<Plane>, Option<String>), StudyError> {
    let name = StudyName::Map;
    if plan.scale == Scale::Full {
        let planes = planes(&plan.study, Scale::Full)?;
        if planes.iter().any(|plane| plane.n_experiments.1 > 0) {
            return Ok((planes, None));
        }
    }
    let scale = if plan.scale == Scale::Full { Scale::Quick } else { plan.scale };
    name.run(&plan.study, scale, 1, &|done, all| step(name.name(), done, all))?;
    let note = "This version has recorded nothing of the full study: this is its quick form, which was run for this report. ";
    let note = if plan.scale == Scale::Full { note } else { "This is the quick form of the study. " };
    Ok((planes(&plan.study, scale)?, Some(format!("{note}`cargo xtask study map` runs all of it."))))
}

fn sheet(plan: &ReportPlan, number: usize, plane: &Plane) -> Result<Markup, StudyError> {
    let (all, finished) = plane.n_experiments;
    let id = format!("map-{number}");
    let panels = plane
        .strategies
        .iter()
        .map(|(name, figures)| strategy(plane, name, figures))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(html! {
        section aria-labelledby=(id) {
            h3 id=(id) { (plane.title) }
            @if finished < all { p.note { (finished) " of " (all) " experiments are finished." } }
            @if finished > 0 {
                @for panel in panels { (panel) }
                (provenance(plan, plane))
            }
        }
    })
}

fn provenance(plan: &ReportPlan, plane: &Plane) -> Markup {
    let (all, finished) = plane.n_experiments;
    let mut entries = vec![
        ("command", "cargo xtask study map".to_owned()),
        ("drawn by", plan.command.clone()),
        ("scenes", "random spheres; large images by strips of whole rows".to_owned()),
        ("seeds", numbers(&(1..=plane.seeds).collect::<Vec<_>>())),
    ];
    entries.extend(plane.shared.iter().cloned());
    entries.extend([
        ("times", "one thread, scalar lanes, the strategies in turn".to_owned()),
        ("record", format!("{finished} of {all} experiments in map.jsonl")),
        ("version", plane.version.clone()),
    ]);
    made(&entries)
}

/// One row of panels.
fn strategy(plane: &Plane, name: &str, figures: &Figures) -> Result<Markup, StudyError> {
    let of_paper = |value: &dyn Fn(&PaperRow) -> f64| -> Option<Vec<Option<f64>>> {
        let cell = |n: &u32| PAPER.iter().find(|row| row.spheres == *n).map(value);
        let row: Vec<_> = plane.spheres.iter().map(cell).collect();
        row.iter().any(Option::is_some).then_some(row)
    };
    // One scale for work and time of all strategies of the sheet, so that colours mean the same in each panel.
    let ratios = plane.strategies.iter().flat_map(|(_, figures)| [&figures.work, &figures.time]);
    let colours =
        Colours::of_ratios(ratios.flat_map(|ratios| ratios.values.iter().flatten().flatten().copied()));
    // Of work the paper says nothing; the row stays, so that panels are alike.
    let silent = of_paper(&|_| 0.0).map(|row| vec![None; row.len()]);
    let none = vec![Vec::new(); plane.resolutions.len()];
    let coherence = figures.coherence.as_ref().map(|values| {
        (
            "coherent rays",
            values,
            &none,
            of_paper(&|row| row.percent_coherent),
            Colours::Percent,
            "percent of rays cast",
        )
    });
    let ratios = [
        (
            "ratio of work",
            &figures.work.values,
            &figures.work.crossings,
            silent,
            colours,
            "work over standard: blue is less",
        ),
        (
            "ratio of times",
            &figures.time.values,
            &figures.time.crossings,
            of_paper(&|row| row.ratio_recomputed),
            colours,
            "time over standard: blue is less",
        ),
    ];
    let mut drawn = Vec::new();
    for (what, values, crossings, paper, scale, unit) in coherence.into_iter().chain(ratios) {
        let heat = HeatMap {
            label: format!("{name}, {what}: {}", summary(plane, values, scale)),
            columns: &plane.spheres,
            rows: &plane.resolutions,
            values,
            crossings,
            paper,
            scale,
            unit,
        };
        drawn.push((what, heat.svg()?, values, scale));
    }
    Ok(html! {
        h4 { code { (name) } }
        div.panels {
            @for (what, svg, values, scale) in &drawn {
                figure { (PreEscaped(svg)) figcaption { code { (name) } ": " (what) ". " (summary(plane, values, *scale)) } }
            }
        }
        details {
            summary { "Numbers of " code { (name) } }
            @for (what, _, values, _) in &drawn { (table(plane, name, what, values)) }
        }
    })
}

/// The least and the greatest, and in how many cells a ratio is below 1.
fn summary(plane: &Plane, values: &Grid, scale: Colours) -> String {
    let cells = values.iter().zip(&plane.resolutions).flat_map(|(row, side)| {
        row.iter().zip(&plane.spheres).filter_map(move |(value, n)| Some(((*value)?, *n, *side)))
    });
    let cells: Vec<_> = cells.collect();
    let of = |(value, n, side): &(f64, u32, u32)| {
        format!("{} at n = {n}, {side} x {side} pixels", scale.text(*value))
    };
    let least = cells.iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let greatest = cells.iter().max_by(|a, b| a.0.total_cmp(&b.0));
    let (Some(least), Some(greatest)) = (least, greatest) else {
        return "nothing is finished.".to_owned();
    };
    let range = format!("From {} to {}.", of(least), of(greatest));
    match scale {
        Colours::Percent => range,
        Colours::Ratio { .. } => {
            let below = cells.iter().filter(|cell| cell.0 < 1.0).count();
            format!("{range} Below 1 in {below} of {} cells.", cells.len())
        }
    }
}

/// The numbers of a panel.
fn table(plane: &Plane, name: &str, what: &str, values: &Grid) -> Markup {
    let digits = if what.starts_with("ratio") { 3 } else { 1 };
    html! {
        div.scroll role="region" tabindex="0" aria-label={ (name) ", " (what) } {
            table {
                caption { code { (name) } ": " (what) ", by resolution (rows) and n (columns)" }
                thead { tr {
                    th scope="col" { "pixels a side" }
                    @for n in &plane.spheres { th scope="col" { (n) } }
                } }
                tbody {
                    @for (side, row) in plane.resolutions.iter().zip(values) {
                        tr {
                            th scope="row" { (side) }
                            @for value in row {
                                td { @if let Some(value) = value { (format!("{value:.digits$}")) } }
                            }
                        }
                    }
                }
            }
        }
    }
}
