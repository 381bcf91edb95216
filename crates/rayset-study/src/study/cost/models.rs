//! Section 3's model and ours, fitted to some scenes and tried on others.

use super::fit::{fit_relative, predict};
use crate::study::counts::{Counts, float};
use crate::study::interval::Median;
use crate::study::journal::Journal;
use crate::study::runner::Experiment;
use crate::study::timed::{Cell, STRATEGIES, Timed, values};
use crate::{CostModel, Measurement};

/// What the journal says of every model.
#[derive(Debug, Default)]
pub(crate) struct Fits {
    /// How many scenes are fitted, and how many of them are finished.
    pub(crate) n_fitted: (usize, usize),
    /// How many others there are, and how many of them are finished.
    pub(crate) n_tested: (usize, usize),
    /// How far repetitions are apart, in the median; NaN if none is finished.
    pub(crate) noise: f64,
    /// Strategy by strategy, model by model; empty if too little is finished.
    pub(crate) models: Vec<Fit>,
    /// The coefficients of [`FEATURES`] in seconds: for each strategy by itself, and for all together.
    pub(super) coefficients: Vec<(&'static str, Vec<f64>)>,
    /// The scenes to fit to and the others in words.
    pub(crate) scenes: [String; 2],
    /// The program's version, as journals know it.
    pub(crate) version: String,
}

/// A model of a strategy, with what it predicts.
#[derive(Debug)]
pub(crate) struct Fit {
    /// The strategy.
    pub(crate) strategy: &'static str,
    /// The model.
    pub(crate) model: &'static str,
    /// The constants of section 3; none for a model of counts.
    pub(crate) constants: Option<CostModel>,
    /// For the scenes it was fitted to.
    pub(crate) fitted: Vec<Prediction>,
    /// For the others.
    pub(crate) tested: Vec<Prediction>,
}

/// A ratio of times of a scene: of the strategy over `standard`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prediction {
    /// What was measured.
    pub(crate) measured: f64,
    /// What the model predicts.
    pub(crate) predicted: f64,
}

/// A scene with what was measured.
struct Point<'j> {
    cell: Cell,
    timed: &'j Timed,
}

/// Our features, with the unit of their coefficients.
pub(super) const FEATURES: [&str; 9] = [
    "initial, reflected or refracted ray",
    "light ray",
    "ray served by what is retained",
    "partition",
    "volume classified",
    "primitive test",
    "pierce check",
    "member of N, or two for each volume of a certificate",
    "cylinder built",
];

fn features(counts: &Counts) -> Vec<f64> {
    let [initial, reflected, refracted, shadow] = counts.cast;
    [
        initial + reflected + refracted,
        shadow,
        counts.coherent.iter().sum(),
        counts.work.partitions,
        counts.work.volumes_classified,
        counts.work.primitive_tests,
        counts.work.pierce_checks,
        counts.work.radius_comparisons,
        counts.work.cylinders_built,
    ]
    .map(float)
    .to_vec()
}

impl Prediction {
    /// How far the prediction is off, as a fraction of what was measured.
    pub(crate) fn error(&self) -> f64 {
        (self.predicted / self.measured - 1.0).abs()
    }

    /// Whether it tells rightly who wins.
    pub(crate) fn is_right(&self) -> bool {
        (self.predicted < 1.0) == (self.measured < 1.0)
    }
}

impl Fits {
    /// Of scenes to fit to and others, as far as the journal has them.
    pub(super) fn of(fit: &[Cell], test: &[Cell], journal: &Journal<Timed>) -> Self {
        let points = |cells: &[Cell]| -> Vec<Point<'_>> {
            let of = |cell: &Cell| journal.get(&cell.key()).map(|timed| Point { cell: *cell, timed });
            cells.iter().filter_map(of).collect()
        };
        let (n_fit, n_test) = (fit.len(), test.len());
        let version = fit.first().map_or_else(String::new, |cell| cell.version().to_owned());
        let scenes = [fit, test].map(described);
        let (fit, test) = (points(fit), points(test));
        let (n_fitted, n_tested) = ((n_fit, fit.len()), (n_test, test.len()));
        if fit.is_empty() || test.is_empty() {
            return Self { n_fitted, n_tested, noise: f64::NAN, scenes, version, ..Self::default() };
        }
        let noise = (1..STRATEGIES.len()).flat_map(|i| test.iter().map(move |point| point.timed.noise(i)));
        let noise = Median::of(&noise.collect::<Vec<_>>()).value;
        let all: Vec<_> = (0..STRATEGIES.len()).collect();
        let shared = coefficients(&fit, &all);
        let standard = coefficients(&fit, &[0]);
        let mut models = Vec::new();
        let mut constants = vec![(STRATEGIES[0], standard.clone())];
        for (strategy, &name) in STRATEGIES.iter().enumerate().skip(1) {
            let ours = coefficients(&fit, &[strategy]);
            let section = section_3(&fit, strategy);
            let by_section = |point: &Point<'_>| {
                let counts = &point.timed.strategies[strategy].counts;
                section.ratio(f64::from(point.cell.spheres), counts.percent_coherent() / 100.0)
            };
            let by_counts = |standard: &[f64], ours: &[f64], point: &Point<'_>| {
                let cost = |coefficients: &[f64], strategy: usize| {
                    predict(coefficients, &features(&point.timed.strategies[strategy].counts))
                };
                cost(ours, strategy) / cost(standard, 0)
            };
            let fit_of = |model, constants, predicted: &dyn Fn(&Point<'_>) -> f64| Fit {
                strategy: name,
                model,
                constants,
                fitted: predictions(&fit, strategy, predicted),
                tested: predictions(&test, strategy, predicted),
            };
            models.push(fit_of("section 3", Some(section), &by_section));
            models.push(fit_of("counts, each strategy by itself", None, &|point| {
                by_counts(&standard, &ours, point)
            }));
            models.push(fit_of("counts, one set for all", None, &|point| by_counts(&shared, &shared, point)));
            constants.push((name, ours));
        }
        constants.push(("all four", shared));
        Self { n_fitted, n_tested, noise, models, coefficients: constants, scenes, version }
    }
}

/// The parameters of some cells in words.
fn described(cells: &[Cell]) -> String {
    let parameter = |name: &str| format!("{name} {}", values(cells, name).join(", "));
    let names = ["n", "size", "reflectance", "seed", "resolution", "repetitions"];
    names.map(parameter).join("; ")
}

fn predictions(
    points: &[Point<'_>],
    strategy: usize,
    predicted: &dyn Fn(&Point<'_>) -> f64,
) -> Vec<Prediction> {
    let of = |point: &Point<'_>| Prediction {
        measured: point.timed.seconds(strategy) / point.timed.seconds(0),
        predicted: predicted(point),
    };
    points.iter().map(of).collect()
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
