//! The map as Markdown.

use std::fmt::Write;

use super::Sheet;
use super::claims;
use super::crossing::Wins;
use crate::PAPER;
use crate::study::counts::{Distribution, Kinds, ratio};
use crate::study::interval::Median;
use crate::study::journal::Journal;
use crate::study::timed::{COHERENT, STRATEGIES, Timed, names};

/// What is shown of a cell.
type Figure = (&'static str, fn(&Timed, usize, usize) -> f64);

const COHERENCE: Figure =
    ("percent coherent", |timed, strategy, _| timed.strategies[strategy].counts.percent_coherent());
const WORK: Figure = ("ratio of work", Timed::ratio_of_work);
const TIME: Figure = ("ratio of times (wall clock, inside the strategy's calls)", Timed::ratio_of_time);

pub(super) fn markdown(sheets: &[Sheet], journal: &Journal<Timed>) -> String {
    let mut text = String::from(
        "Medians over seeds; work and times are over those of `standard`, where nothing else is said.\nTimes are of one thread with scalar lanes, the strategies in turn, the median of three.\nCoherent rays of `bundle` are those answered under the shaft of a packet or a tile.\n",
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
            if COHERENT.iter().any(|&(coherent, _)| coherent == strategy) {
                text += &table(sheet, journal, (strategy, 0), COHERENCE);
            }
            for ratio in ratios().filter(|&(ours, _)| ours == strategy) {
                text += &table(sheet, journal, ratio, WORK);
                text += &table(sheet, journal, ratio, TIME);
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

/// Every strategy over `standard`, and over what it would be without coherence where that is another.
fn ratios() -> impl Iterator<Item = (usize, usize)> {
    let over_standard = (1..names().count()).map(|strategy| (strategy, 0));
    over_standard.chain(COHERENT.into_iter().filter(|&(_, over)| over > 0))
}

/// A strategy, and what it is compared with if that is not `standard`.
fn named((strategy, over): (usize, usize)) -> String {
    let name = |i| names().nth(i).unwrap_or_default();
    if over == 0 {
        format!("`{}`", name(strategy))
    } else {
        format!("`{}` over `{}`", name(strategy), name(over))
    }
}

/// A figure over the plane.
fn table(
    sheet: &Sheet,
    journal: &Journal<Timed>,
    (strategy, over): (usize, usize),
    (name, figure): Figure,
) -> String {
    let mut text = format!("\n{}, {name}:\n\n| n |", named((strategy, over)));
    for side in &sheet.resolutions {
        text += &format!(" {side} |");
    }
    text += &format!("\n|---:|{}\n", "---:|".repeat(sheet.resolutions.len()));
    for &n in &sheet.spheres {
        text += &format!("| {n} |");
        for &side in &sheet.resolutions {
            let values: Vec<_> =
                sheet.timed(journal, n, side).iter().map(|timed| figure(timed, strategy, over)).collect();
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
    for (strategy, over) in ratios() {
        let compared = named((strategy, over));
        for (name, figure) in [("work", WORK.1), ("time", TIME.1)] {
            for &side in &sheet.resolutions {
                let curves: Vec<Vec<(f64, f64)>> = (1..=sheet.seeds)
                    .map(|seed| {
                        let cells = sheet.spheres.iter().filter_map(|&n| {
                            let timed = journal.get(&super::Experiment::key(&sheet.cell(n, side, seed)))?;
                            Some((f64::from(n), figure(timed, strategy, over)))
                        });
                        cells.collect()
                    })
                    .filter(|curve: &Vec<_>| !curve.is_empty())
                    .collect();
                let wins: Vec<_> = curves.iter().filter_map(|curve| Wins::of(curve)).collect();
                let ends = |end: fn(&Wins) -> f64| interval(&wins.iter().map(end).collect::<Vec<_>>());
                let line = format!(
                    "| {compared} | {name} | {side} | {} | {} | {} of {} |",
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
