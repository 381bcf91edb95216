//! The map as Markdown.

use std::fmt::Write;

use super::Sheet;
use super::claims;
use super::crossing::Wins;
use crate::PAPER;
use crate::study::counts::{Distribution, Kinds, ratio};
use crate::study::interval::Median;
use crate::study::journal::Journal;
use crate::study::timed::{STRATEGIES, Timed, names};

/// What is shown of a cell.
type Figure = (&'static str, fn(&Timed, usize) -> f64);

const COHERENCE: Figure =
    ("percent coherent", |timed, strategy| timed.strategies[strategy].counts.percent_coherent());
const WORK: Figure = ("ratio of work", Timed::ratio_of_work);
const TIME: Figure = ("ratio of times (wall clock, inside the strategy's calls)", Timed::ratio_of_time);

pub(super) fn markdown(sheets: &[Sheet], journal: &Journal<Timed>) -> String {
    let mut text = String::from(
        "Medians over seeds; work and times are over those of `standard`.\nTimes are of one thread with scalar lanes, the strategies in turn, the median of three.\n",
    );
    for sheet in sheets {
        let cells = sheet.spheres.len() * sheet.resolutions.len() * usize::try_from(sheet.seeds).unwrap_or(0);
        let finished: usize = sheet
            .spheres
            .iter()
            .flat_map(|&n| sheet.resolutions.iter().map(move |&side| sheet.timed(journal, n, side).len()))
            .sum();
        text += &format!("\n#### {}\n\n{finished} of {cells} cells are finished.\n", sheet.title);
        if finished == 0 {
            continue;
        }
        for (strategy, name) in names().enumerate().skip(1) {
            text += &format!("\n<details><summary>Tables of {name}</summary>\n");
            let is_coherent = strategy < STRATEGIES.len();
            let figures = [COHERENCE, WORK, TIME].into_iter().skip(usize::from(!is_coherent));
            for figure in figures {
                text += &table(sheet, journal, strategy, name, figure);
            }
            text += "\n</details>\n";
        }
        text += &crossings(sheet, journal);
        if !sheet.tiles {
            text += &shrinking(sheet, journal);
            text += &claims::markdown(sheet, journal);
        }
    }
    text
}

/// A figure over the plane.
fn table(
    sheet: &Sheet,
    journal: &Journal<Timed>,
    strategy: usize,
    strategy_name: &str,
    (name, figure): Figure,
) -> String {
    let mut text = format!("\n`{strategy_name}`, {name}:\n\n| n |");
    for side in &sheet.resolutions {
        text += &format!(" {side} |");
    }
    text += &format!("\n|---:|{}\n", "---:|".repeat(sheet.resolutions.len()));
    for &n in &sheet.spheres {
        text += &format!("| {n} |");
        for &side in &sheet.resolutions {
            let values: Vec<_> =
                sheet.timed(journal, n, side).iter().map(|timed| figure(timed, strategy)).collect();
            let median = Median::of(&values).value;
            text += &match () {
                () if values.is_empty() => " |".to_owned(),
                () if name == COHERENCE.0 => format!(" {median:.1} |"),
                // Two digits of what other methods leave over.
                () if median < 0.1 => format!(" {median:.3} |"),
                () => format!(" {median:.2} |"),
            };
        }
        text.push('\n');
        if let Some(row) = PAPER.iter().find(|row| row.spheres == n && strategy < 3) {
            let value = match name {
                name if name == COHERENCE.0 => format!("{:.1}", row.percent_coherent),
                _ if name == TIME.0 => format!("{:.3}", row.ratio_recomputed),
                _ => continue,
            };
            let line = format!(
                "| {n}, paper | {value} at a resolution it does not say |{}",
                " |".repeat(sheet.resolutions.len() - 1)
            );
            writeln!(text, "{line}").expect("a string takes everything");
        }
    }
    text
}

/// Where work and time win, with intervals over seeds.
fn crossings(sheet: &Sheet, journal: &Journal<Timed>) -> String {
    let mut text = String::from(
        "\nWhere the ratio is below 1: from n, to n, interpolated seed by seed; medians with intervals over seeds.\n\n| strategy | of | resolution | from | to | seeds that never win |\n|---|---|---:|---|---|---:|\n",
    );
    for (strategy, strategy_name) in names().enumerate().skip(1) {
        for (name, figure) in [("work", WORK.1), ("time", TIME.1)] {
            for &side in &sheet.resolutions {
                let curves: Vec<Vec<(f64, f64)>> = (1..=sheet.seeds)
                    .map(|seed| {
                        let cells = sheet.spheres.iter().filter_map(|&n| {
                            let timed = journal.get(&super::Experiment::key(&sheet.cell(n, side, seed)))?;
                            Some((f64::from(n), figure(timed, strategy)))
                        });
                        cells.collect()
                    })
                    .filter(|curve: &Vec<_>| !curve.is_empty())
                    .collect();
                let wins: Vec<_> = curves.iter().filter_map(|curve| Wins::of(curve)).collect();
                let ends = |end: fn(&Wins) -> f64| interval(&wins.iter().map(end).collect::<Vec<_>>());
                let line = format!(
                    "| `{strategy_name}` | {name} | {side} | {} | {} | {} of {} |",
                    ends(|wins| wins.from),
                    ends(|wins| wins.to),
                    curves.len() - wins.len(),
                    curves.len()
                );
                writeln!(text, "{line}").expect("a string takes everything");
            }
        }
    }
    text
}

/// Numbers of spheres; infinite ones are beyond the map.
fn interval(values: &[f64]) -> String {
    let show = |value: f64| if value == f64::INFINITY { "beyond".to_owned() } else { format!("{value:.1}") };
    match Median::of(values) {
        median if median.value.is_nan() => "-".to_owned(),
        Median { value, low, high, .. } => format!("{} ({} to {})", show(value), show(low), show(high)),
    }
}

/// Radii, lengths and why rays were not coherent, against n.
fn shrinking(sheet: &Sheet, journal: &Journal<Timed>) -> String {
    let mut text = String::new();
    let Some(side) = sheet.usual_resolution() else { return text };
    for (strategy, strategy_name) in STRATEGIES.iter().enumerate().take(3).skip(1) {
        text += &format!(
            "\n`{strategy_name}` at {side} x {side}: cylinders, in units of the scene's extent, and what became of all rays.\n\n| n | median radius | without bound | median length | coherent | no guide | missed the prediction | pierced | of these intercepted |\n|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n"
        );
        for &n in &sheet.spheres {
            let cells = sheet.timed(journal, n, side);
            let of = |figure: &dyn Fn(&Timed) -> f64| {
                Median::of(&cells.iter().map(|timed| figure(timed)).collect::<Vec<_>>()).value
            };
            let share = |part: fn(&crate::study::Counts) -> &Kinds| {
                100.0
                    * of(&|timed| {
                        let counts = &timed.strategies[strategy].counts;
                        ratio(part(counts).iter().sum(), counts.rays())
                    })
            };
            // An infinite median counts as larger than any other.
            let size = |part: fn(&Timed, usize) -> Distribution| {
                let value = of(&|timed| part(timed, strategy).median.unwrap_or(f64::INFINITY));
                if value == f64::INFINITY { "unbounded".to_owned() } else { format!("{value:.3}") }
            };
            let unbounded = of(&|timed| {
                let radii = timed.strategies[strategy].radii;
                ratio(radii.infinite, radii.count)
            });
            let line = format!(
                "| {n} | {} | {:.1} % | {} | {:.1} % | {:.1} % | {:.1} % | {:.1} % | {:.1} % |",
                size(|timed, strategy| timed.strategies[strategy].radii),
                100.0 * unbounded,
                size(|timed, strategy| timed.strategies[strategy].lengths),
                share(|counts| &counts.coherent),
                100.0 - share(|counts| &counts.guided),
                share(|counts| &counts.missed),
                share(|counts| &counts.pierced),
                share(|counts| &counts.intercepted),
            );
            writeln!(text, "{line}").expect("a string takes everything");
        }
    }
    text
}
