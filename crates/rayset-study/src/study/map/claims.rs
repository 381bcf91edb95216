//! What the paper claims of costs, held against every cell of a sheet.

use std::fmt::Write;

use super::Sheet;
use crate::study::counts::{Counts, float, ratio};
use crate::study::interval::Median;
use crate::study::journal::Journal;
use crate::study::timed::{COHERENT, Timed, names};

/// Sections 3 and 4, in counts.
pub(super) fn markdown(sheet: &Sheet, journal: &Journal<Timed>) -> String {
    let mut text = String::from(
        "\nWhat section 3 says of savings, cell by cell and seed by seed; C is the fraction of coherent rays, the ratio that of work over the same without coherence.\n\n| strategy | over | cells | ratio below 1 - C | least ratio - (1 - C) | pairs of n where more coherence goes with less work |\n|---|---|---:|---:|---:|---:|\n",
    );
    let names: Vec<_> = names().collect();
    for (strategy, over) in COHERENT {
        let slacks: Vec<_> = sheet
            .cells()
            .filter_map(|cell| journal.get(&super::Experiment::key(&cell)))
            .map(|timed| {
                let incoherent = 1.0 - timed.strategies[strategy].counts.percent_coherent() / 100.0;
                timed.ratio_of_work(strategy, over) - incoherent
            })
            .collect();
        let (concordant, pairs) = concordance(sheet, journal, (strategy, over));
        let line = format!(
            "| `{}` | `{}` | {} | {} | {:.3} | {:.0} % of {pairs} |",
            names[strategy],
            names[over],
            slacks.len(),
            slacks.iter().filter(|&&slack| slack < 0.0).count(),
            slacks.iter().copied().fold(f64::INFINITY, f64::min),
            100.0 * ratio(concordant, pairs)
        );
        writeln!(text, "{line}").expect("a string takes everything");
    }
    text += &terms(sheet, journal);
    text
}

/// At each resolution, pairs of numbers of spheres: in how many of all does the one with more coherence have less work?
fn concordance(sheet: &Sheet, journal: &Journal<Timed>, (strategy, over): (usize, usize)) -> (u64, u64) {
    let (mut concordant, mut pairs) = (0, 0);
    for &side in &sheet.resolutions {
        let medians: Vec<_> = sheet
            .spheres
            .iter()
            .map(|&n| {
                let timed = sheet.timed(journal, n, side);
                let median = |figure: &dyn Fn(&Timed) -> f64| {
                    Median::of(&timed.iter().map(|timed| figure(timed)).collect::<Vec<_>>()).value
                };
                (
                    median(&|timed| timed.strategies[strategy].counts.percent_coherent()),
                    median(&|timed| timed.ratio_of_work(strategy, over)),
                )
            })
            .filter(|(coherence, ratio)| coherence.is_finite() && ratio.is_finite())
            .collect();
        for (i, a) in medians.iter().enumerate() {
            for b in &medians[..i] {
                pairs += 1;
                concordant += u64::from((a.0 - b.0) * (a.1 - b.1) < 0.0);
            }
        }
    }
    (concordant, pairs)
}

/// The terms of the model, counted.
fn terms(sheet: &Sheet, journal: &Journal<Timed>) -> String {
    let Some(side) = sheet.usual_resolution() else { return String::new() };
    let mut text = format!(
        "\nThe terms of section 3 at {side} x {side}: what it takes for constant or proportional to n, and what `speer-1985-misses` spends, over the work of `standard`.\n\n| n | rays per initial ray | primitive tests per ray, `standard` | members of N per cylinder / n | building / standard | checking / standard | cylinders that serve no ray |\n|---:|---:|---:|---:|---:|---:|---:|\n"
    );
    for &n in &sheet.spheres {
        let cells = sheet.timed(journal, n, side);
        let of = |figure: &dyn Fn(&Counts, &Counts) -> f64| {
            let values: Vec<_> = cells
                .iter()
                .map(|timed| figure(&timed.strategies[0].counts, &timed.strategies[2].counts))
                .collect();
            Median::of(&values).value
        };
        let line = format!(
            "| {n} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | at least {:.0} % |",
            of(&|standard, _| ratio(standard.rays(), standard.cast[0])),
            of(&|standard, _| ratio(standard.work.primitive_tests, standard.rays())),
            of(&|_, speer| ratio(speer.work.radius_comparisons, speer.work.cylinders_built) / f64::from(n)),
            of(&|standard, speer| ratio(speer.work.radius_comparisons, standard.in_tests())),
            of(&|standard, speer| ratio(2 * speer.work.pierce_checks, standard.in_tests())),
            // Each of those that serve, serves one ray at least.
            of(&|_, speer| {
                let served = float(speer.coherent.iter().sum()) / float(speer.work.cylinders_built);
                100.0 * (1.0 - served).max(0.0)
            }),
        );
        writeln!(text, "{line}").expect("a string takes everything");
    }
    text
}
