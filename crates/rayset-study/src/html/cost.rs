//! The cost model: what is predicted, against what is measured.

use maud::{Markup, PreEscaped, html};

use super::draw::{Dot, Scatter};
use super::provenance::made;
use super::{ReportPlan, Section, Step};
use crate::study::{Fit, Fits, Median, Prediction, fits};
use crate::{Scale, StudyError, StudyName};

pub(super) fn section(plan: &ReportPlan, step: Step<'_>) -> Result<Section, StudyError> {
    let (fits, note) = recorded(plan, step)?;
    let ((n_fit, fitted), (n_test, tested)) = (fits.n_fitted, fits.n_tested);
    let body = html! {
        p {
            "Does section 3 of the paper predict times, and do counts of rays and tests? "
            "Each model is fitted to some scenes (rings) and tried on others with other seeds, resolution and materials (triangles). "
            "A point on the diagonal is predicted rightly; thick lines are a ratio of 1."
        }
        @if let Some(note) = note { p.note { (note) } }
        @if fitted < n_fit || tested < n_test {
            p.note { (fitted) " of " (n_fit) " scenes to fit, and " (tested) " of " (n_test) " others, are finished." }
        }
        @if fits.models.is_empty() { p { "Nothing can be fitted yet." } } @else {
            (figures(&fits)?)
            (table(&fits))
        }
        (made(&[
            ("command", "cargo xtask study cost-model".to_owned()),
            ("drawn by", plan.command.clone()),
            ("fitted", fits.scenes[0].clone()),
            ("others", fits.scenes[1].clone()),
            ("times", "the least of all repetitions, one thread, scalar lanes, scanlines".to_owned()),
            ("noise", format!("the ratios of a scene are {:.0} % apart in the median", 100.0 * fits.noise)),
            ("record", "cost-model.jsonl".to_owned()),
            ("version", fits.version.clone()),
        ]))
    };
    Ok(Section { id: "cost-model", title: "The cost model", body })
}

/// What is recorded, or else the quick form; and what the reader should know of that.
fn recorded(plan: &ReportPlan, step: Step<'_>) -> Result<(Fits, Option<String>), StudyError> {
    let name = StudyName::CostModel;
    if plan.scale == Scale::Full {
        let fits = fits(&plan.study, Scale::Full)?;
        if !fits.models.is_empty() {
            return Ok((fits, None));
        }
    }
    let scale = if plan.scale == Scale::Full { Scale::Quick } else { plan.scale };
    name.run(&plan.study, scale, 1, &|done, all| step(name.name(), done, all))?;
    let note =
        "Nothing is recorded of the full study: this is its quick form, which was run for this report. ";
    let note = if plan.scale == Scale::Full { note } else { "This is the quick form of the study. " };
    Ok((fits(&plan.study, scale)?, Some(format!("{note}`cargo xtask study cost-model` runs all of it."))))
}

/// A row of panels for each strategy.
fn figures(fits: &Fits) -> Result<Markup, StudyError> {
    let all = || fits.models.iter().flat_map(|fit| fit.fitted.iter().chain(&fit.tested));
    let values = || all().flat_map(|p| [p.measured, p.predicted]).filter(|value| *value > 0.0);
    // Whole octaves that hold every point, and 1.
    #[expect(clippy::cast_possible_truncation, reason = "few octaves; an odd one is drawn at the edge")]
    let octaves = values().fold((-1, 1), |(low, high): (i32, i32), value| {
        let octave = value.log2().clamp(-6.0, 6.0);
        (low.min(octave.floor() as i32), high.max(octave.ceil() as i32))
    });
    let panel = |fit: &Fit| -> Result<Markup, StudyError> {
        let dot =
            |is_fitted| move |p: &Prediction| Dot { measured: p.measured, predicted: p.predicted, is_fitted };
        let dots: Vec<_> =
            fit.fitted.iter().map(dot(true)).chain(fit.tested.iter().map(dot(false))).collect();
        let [median, worst] = errors(&fit.tested);
        let caption = format!("{}. Other scenes: median error {median:.1} %, worst {worst:.1} %", fit.model);
        let label = format!("{}, {caption}. The numbers are in the table below.", fit.strategy);
        let svg = Scatter { label, dots: &dots, octaves }.svg()?;
        Ok(html! { figure { (PreEscaped(svg)) figcaption { code { (fit.strategy) } ": " (caption) } } })
    };
    let mut rows = Vec::new();
    for row in fits.models.chunk_by(|a, b| a.strategy == b.strategy) {
        rows.push((row[0].strategy, row.iter().map(panel).collect::<Result<Vec<_>, _>>()?));
    }
    Ok(html! {
        @for (strategy, panels) in rows {
            h3 { code { (strategy) } }
            div.panels { @for panel in panels { (panel) } }
        }
    })
}

/// The median and the worst error, in percent.
fn errors(predictions: &[Prediction]) -> [f64; 2] {
    let errors: Vec<_> = predictions.iter().map(Prediction::error).collect();
    let worst = errors.iter().copied().fold(0.0, f64::max);
    [100.0 * Median::of(&errors).value, 100.0 * worst]
}

fn table(fits: &Fits) -> Markup {
    html! {
        div.scroll role="region" tabindex="0" aria-labelledby="cost-caption" {
            table {
                caption id="cost-caption" {
                    "Errors of the predicted ratio of times, as a fraction of the measured one. Section 3 has three constants, the models of counts eight."
                }
                thead { tr {
                    th.text scope="col" { "strategy" }
                    th.text scope="col" { "model" }
                    th.text scope="col" { "constants" }
                    th scope="col" { "fitted scenes: median" }
                    th scope="col" { "worst" }
                    th scope="col" { "others: median" }
                    th scope="col" { "worst" }
                    th scope="col" { "winner told rightly" }
                } }
                tbody {
                    @for fit in &fits.models {
                        tr {
                            th.source scope="row" { (fit.strategy) }
                            td.text { (fit.model) }
                            td.text {
                                @if let Some(section) = &fit.constants {
                                    (format!("k = {:.1} ns, λ = {:.1} ns, α = {:.1} ns", 1e9 * section.k, 1e9 * section.lambda, 1e9 * section.alpha))
                                }
                            }
                            @for error in [&fit.fitted, &fit.tested].into_iter().flat_map(|part| errors(part)) {
                                td { (format!("{error:.1} %")) }
                            }
                            td { (fit.tested.iter().filter(|p| p.is_right()).count()) " of " (fit.tested.len()) }
                        }
                    }
                }
            }
        }
    }
}
