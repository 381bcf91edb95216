//! The models and their errors, as Markdown.

use std::fmt::Write;

use super::fit::{fit_relative, predict};
use crate::study::counts::{Counts, float};
use crate::study::interval::Median;
use crate::study::journal::Journal;
use crate::study::runner::Experiment;
use crate::study::timed::{Cell, STRATEGIES, Timed};
use crate::{CostModel, Measurement};

/// A scene with what was measured.
struct Point<'j> {
    cell: Cell,
    timed: &'j Timed,
}

/// Our features, with the unit of their coefficients.
const FEATURES: [&str; 8] = [
    "initial ray",
    "reflected or refracted ray",
    "light ray",
    "volume classified",
    "primitive test",
    "pierce check",
    "member of N, or two for each volume of a certificate",
    "cylinder built",
];

fn features(counts: &Counts) -> Vec<f64> {
    let [initial, reflected, refracted, shadow] = counts.cast;
    [
        initial,
        reflected + refracted,
        shadow,
        counts.work.volumes_classified,
        counts.work.primitive_tests,
        counts.work.pierce_checks,
        counts.work.radius_comparisons,
        counts.work.cylinders_built,
    ]
    .map(float)
    .to_vec()
}

pub(super) fn markdown(fit: &[Cell], test: &[Cell], journal: &Journal<Timed>) -> String {
    let points = |cells: &[Cell]| -> Vec<Point<'_>> {
        let of = |cell: &Cell| journal.get(&cell.key()).map(|timed| Point { cell: *cell, timed });
        cells.iter().filter_map(of).collect()
    };
    let (n_fit, n_test) = (fit.len(), test.len());
    let (fit, test) = (points(fit), points(test));
    let mut text = format!(
        "Fitted on {} of {n_fit} scenes, tested on {} of {n_test} others; times are of one thread with scalar lanes, inside the strategy's calls.\nErrors are of the predicted ratio of times, coherent over standard, as a fraction of the measured one.\n",
        fit.len(),
        test.len()
    );
    if fit.is_empty() || test.is_empty() {
        return text;
    }
    let noise = (1..STRATEGIES.len()).flat_map(|i| test.iter().map(move |point| point.timed.noise(i)));
    let noise = Median::of(&noise.collect::<Vec<_>>()).value;
    text += &format!(
        "A time is the least of nine; the nine ratios of a scene are {:.0} % apart in the median, so that much is noise of the machine.\n",
        100.0 * noise
    );
    text += "\n| strategy | model | constants | fitted scenes: median error | worst | other scenes: median error | worst | who wins, told rightly |\n|---|---|---|---:|---:|---:|---:|---:|\n";
    let shared = coefficients(&fit, &[0, 1, 2, 3]);
    let mut constants = row(STRATEGIES[0], &coefficients(&fit, &[0]));
    for (strategy, name) in STRATEGIES.iter().enumerate().skip(1) {
        let section = section_3(&fit, strategy);
        let predicted = |point: &Point<'_>| {
            let counts = &point.timed.strategies[strategy].counts;
            section.ratio(f64::from(point.cell.spheres), counts.percent_coherent() / 100.0)
        };
        let shown = format!(
            "k = {:.1} ns, lambda = {:.1} ns, alpha = {:.1} ns",
            1e9 * section.k,
            1e9 * section.lambda,
            1e9 * section.alpha
        );
        text += &line(name, "section 3", &shown, &fit, &test, strategy, &predicted);
        let (standard, ours) = (coefficients(&fit, &[0]), coefficients(&fit, &[strategy]));
        for (model, standard, ours) in [
            ("counts, each strategy by itself", &standard, &ours),
            ("counts, one set for all", &shared, &shared),
        ] {
            let predicted = |point: &Point<'_>| {
                let cost = |coefficients: &[f64], strategy: usize| {
                    predict(coefficients, &features(&point.timed.strategies[strategy].counts))
                };
                cost(ours, strategy) / cost(standard, 0)
            };
            text += &line(name, model, "below", &fit, &test, strategy, &predicted);
        }
        constants += &row(name, &ours);
    }
    let heads: Vec<_> = FEATURES.iter().map(|name| format!(" {name} |")).collect();
    text += &format!(
        "\nThe model of counts is a sum with these coefficients, in nanoseconds:\n\n| strategy |{}\n|---|{}\n{constants}{}",
        heads.concat(),
        "---:|".repeat(FEATURES.len()),
        row("all four", &shared)
    );
    text
}

/// Section 3's constants, fitted to seconds a ray.
fn section_3(points: &[Point<'_>], strategy: usize) -> CostModel {
    let measurements: Vec<_> = points
        .iter()
        .map(|point| {
            let seconds = |strategy: usize| {
                point.timed.seconds(strategy) / float(point.timed.strategies[strategy].counts.rays())
            };
            Measurement {
                n: f64::from(point.cell.spheres),
                coherence: point.timed.strategies[strategy].counts.percent_coherent() / 100.0,
                standard: seconds(0),
                coherent: seconds(strategy),
            }
        })
        .collect();
    CostModel::fit(&measurements)
}

/// Of the scenes rendered with some strategies.
fn coefficients(points: &[Point<'_>], strategies: &[usize]) -> Vec<f64> {
    let frames =
        || strategies.iter().flat_map(|&strategy| points.iter().map(move |point| (point.timed, strategy)));
    let rows: Vec<_> =
        frames().map(|(timed, strategy)| features(&timed.strategies[strategy].counts)).collect();
    let seconds: Vec<_> = frames().map(|(timed, strategy)| timed.seconds(strategy)).collect();
    fit_relative(&rows, &seconds)
}

fn row(name: &str, coefficients: &[f64]) -> String {
    let cells: Vec<_> = coefficients.iter().map(|seconds| format!(" {:.1} |", 1e9 * seconds)).collect();
    format!("| {name} |{}\n", cells.concat())
}

fn line(
    name: &str,
    model: &str,
    constants: &str,
    fit: &[Point<'_>],
    test: &[Point<'_>],
    strategy: usize,
    predicted: &dyn Fn(&Point<'_>) -> f64,
) -> String {
    let measured = |point: &Point<'_>| point.timed.seconds(strategy) / point.timed.seconds(0);
    let errors = |points: &[Point<'_>]| -> (f64, f64) {
        let errors: Vec<_> =
            points.iter().map(|point| (predicted(point) / measured(point) - 1.0).abs()).collect();
        (Median::of(&errors).value, errors.iter().copied().fold(0.0, f64::max))
    };
    let right = test.iter().filter(|point| (predicted(point) < 1.0) == (measured(point) < 1.0)).count();
    let ((fit_median, fit_worst), (median, worst)) = (errors(fit), errors(test));
    let mut text = String::new();
    writeln!(
        text,
        "| `{name}` | {model} | {constants} | {:.1} % | {:.1} % | {:.1} % | {:.1} % | {right} of {} |",
        100.0 * fit_median,
        100.0 * fit_worst,
        100.0 * median,
        100.0 * worst,
        test.len()
    )
    .expect("a string takes everything");
    text
}
