//! What the experiment finds, and section 3's model of it.

use std::collections::BTreeMap;

use rayset_engine::{Frame, RenderOptions};
use serde::Serialize;

use super::paper::{PAPER, PaperRow, fit_of_the_paper};
use super::plan::Table1Plan;
use crate::measures::{POINTS, RATIO};
use crate::study::float;
use crate::{Cost, CostModel, Measurement, Spread};

/// The experiment's results.
#[derive(Clone, Debug, Serialize)]
pub struct Table1 {
    /// The paper's rows.
    pub paper: Vec<PaperRow>,
    /// Our rows: spheres, then meshes.
    pub ours: Vec<Row>,
    /// What each preset gave, on scenes of its own.
    pub presets: Vec<PresetReport>,
    /// Section 3's model, fitted to the literal reading.
    pub model: ModelReport,
    /// The same, fitted to each reading and preset by itself.
    pub models: BTreeMap<String, ModelReport>,
    /// How it was run.
    pub options: OptionsReport,
    /// Frames of the first seed, for pictures.
    #[serde(skip)]
    pub pictures: Vec<Pictures>,
}

/// One scene, over all seeds.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The name of the scene.
    pub scene: String,
    /// The number of spheres; `None` for a mesh.
    pub spheres: Option<u32>,
    /// The number of bounding volumes: the paper's n.
    pub volumes: usize,
    /// The number of primitives.
    pub primitives: usize,
    /// The number of seeds.
    pub seeds: usize,
    /// The side of the image, in pixels.
    pub resolution: u32,
    /// Rays cast by `standard`, of all kinds, over all seeds.
    pub rays: u64,
    /// What each strategy took, by name.
    pub strategies: BTreeMap<String, StrategyRow>,
    /// What exact strategies took, by name.
    pub exact: BTreeMap<&'static str, ExactRow>,
}

/// What an exact strategy took for a scene, over all seeds; each figure as that of a [`StrategyRow`].
#[derive(Clone, Debug, Serialize)]
pub struct ExactRow {
    /// Time inside the strategy's calls, in seconds.
    pub seconds: f64,
    /// Coherent rays in percent of the rays cast: see [`Counts::percent_coherent`](crate::Counts::percent_coherent).
    pub percent_coherent: f64,
    /// Its spread over seeds, in percent.
    pub percent_coherent_spread: Spread,
    /// Time over that of `standard`, over all pairs.
    pub ratio_time: Spread,
    /// The same of whole frames.
    pub ratio_time_frame: Spread,
    /// Work over that of `standard`.
    pub ratio_work: f64,
    /// Pixels that differ from those of `standard`, over all seeds: none.
    pub wrong_pixels: u64,
}

/// What a strategy took for a scene, over all seeds.
#[derive(Clone, Debug, Serialize)]
pub struct StrategyRow {
    /// Time inside the strategy's calls, in seconds: the mean over seeds of the median over repetitions.
    pub seconds: f64,
    /// Time of whole frames, shading included, in seconds, in the same way.
    pub seconds_frame: f64,
    /// Work in tests, over all seeds: see `Work::in_tests`.
    pub work: u64,
    /// Partitions, over all seeds.
    pub partitions: u64,
    /// Coherent rays in percent of the rays cast.
    pub percent_coherent: f64,
    /// Its spread over seeds, in percent.
    pub percent_coherent_spread: Spread,
    /// Time over that of `standard`: the median of all pairs.
    pub ratio_time: f64,
    /// Its spread over all pairs.
    pub ratio_time_spread: Spread,
    /// The same of whole frames.
    pub ratio_time_frame: f64,
    /// Work over that of `standard`.
    pub ratio_work: f64,
    /// The ratio in the fitted cost, in the rows of a preset.
    pub fitted: Option<Fitted>,
    /// Pixels that differ from those of `standard`, over all seeds.
    pub wrong_pixels: u64,
    /// Rays that took part, by kind.
    pub kinds: BTreeMap<&'static str, KindRow>,
    /// The median radius of the cylinders built, in units of the scene's extent; `None` if none was, or it is infinite.
    pub median_radius: Option<f64>,
    /// The fraction of cylinders without bound in radius.
    pub unbounded_radii: f64,
    /// The median length of the cylinders built, in the same units.
    pub median_length: Option<f64>,
    /// The histogram of finite radii: lower edge, upper edge and count of each bin that is not empty.
    pub radii: Vec<(f64, f64, u64)>,
    /// The histogram of finite lengths, in the same way.
    pub lengths: Vec<(f64, f64, u64)>,
}

/// A ratio of work in a cost whose constants were fitted to the paper's ratios.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Fitted {
    /// Cost over that of `standard`, over all seeds.
    pub ratio: f64,
    /// Its spread over seeds.
    pub spread: Spread,
}

/// A preset beside the paper.
#[derive(Clone, Debug, Serialize)]
pub struct PresetReport {
    /// The name.
    pub name: String,
    /// Everything that the paper leaves open, by name, as text.
    pub conditions: BTreeMap<&'static str, String>,
    /// Those that are not at their defaults, as text.
    pub differences: String,
    /// What its percentages count.
    pub counting: String,
    /// What work costs in its fitted ratios.
    pub cost: Cost,
    /// How far it is from the paper: with the seeds it was chosen by, then with others; those that were run.
    pub misses: Vec<Misses>,
    /// Its rows, one for every number of spheres.
    pub rows: Vec<Row>,
}

/// By how much medians over some seeds miss the paper's four rows, at most.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Misses {
    /// The seeds.
    pub seeds: Vec<u64>,
    /// Whether the preset was chosen by them.
    pub chosen: bool,
    /// Coherence, in points.
    pub points: f64,
    /// The recomputed ratio, in the fitted cost.
    pub ratio_fitted: f64,
    /// The recomputed ratio, in tests.
    pub ratio_tests: f64,
}

impl Misses {
    /// Whether this is within the bounds of the study: 5 points and, in the fitted cost, 0.05 of the ratio.
    #[must_use]
    pub fn are_within_bounds(&self) -> [bool; 2] {
        [self.points <= POINTS, self.ratio_fitted <= RATIO]
    }
}

/// The rays of one kind, over all seeds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct KindRow {
    /// Cast.
    pub cast: u64,
    /// Hit something; for light rays: blocked.
    pub hit: u64,
    /// Had a guide.
    pub guided: u64,
    /// Missed the predicted object.
    pub predicted_missed: u64,
    /// Pierced the cylinder.
    pub pierced: u64,
    /// Pierced, and were intercepted indeed.
    pub false_coherence: u64,
    /// Were coherent.
    pub coherent: u64,
    /// Were coherent and wrong.
    pub wrong: u64,
}

/// Section 3's model, fitted to the sphere rows.
#[derive(Clone, Debug, Serialize)]
pub struct ModelReport {
    /// Seconds a ray and volume for a partition.
    pub k: f64,
    /// Seconds a ray and volume for a cylinder.
    pub lambda: f64,
    /// Seconds a ray besides.
    pub alpha: f64,
    /// `C_T` of these constants.
    pub threshold: f64,
    /// The ratio predicted for each sphere row.
    pub predicted_ratio: Vec<f64>,
    /// The ratio measured for each sphere row.
    pub measured_ratio: Vec<f64>,
    /// The root mean square of their difference.
    pub rms_error: f64,
    /// Whether every predicted ratio lies between the quartiles of the measured ones.
    pub predicts: bool,
    /// Whether `C_T` alone tells, for every row, which algorithm wins.
    pub threshold_decides: bool,
    /// `alpha / k` that fits the paper's own table best.
    pub paper_alpha_over_k: f64,
    /// `lambda / k` that fits the paper's own table best.
    pub paper_lambda_over_k: f64,
    /// The root mean square error of that fit.
    pub paper_rms_error: f64,
    /// The root mean square distance of the paper's ratios, recomputed, from 1: what the model should explain.
    pub paper_rms_effect: f64,
    /// `k / lambda` as the paper derives it from its last row.
    pub paper_k_over_lambda: f64,
}

/// How the experiment was run.
#[derive(Clone, Debug, Serialize)]
pub struct OptionsReport {
    /// The side of the sphere images, in pixels.
    pub resolution: u32,
    /// The seeds.
    pub seeds: Vec<u64>,
    /// Repetitions of each sphere frame.
    pub repetitions: usize,
    /// Repetitions of each mesh frame.
    pub mesh_repetitions: usize,
    /// The greatest depth of a tree.
    pub max_depth: u32,
    /// The adaptive cut-off.
    pub cutoff: Option<f64>,
    /// The lanes of both strategies.
    pub backend: &'static str,
    /// The pixel order.
    pub order: &'static str,
    /// The readings of section 2.3: option and choice.
    pub readings: BTreeMap<String, BTreeMap<&'static str, &'static str>>,
    /// The version of this program.
    pub version: &'static str,
}

/// Recorded frames of a scene.
#[derive(Clone, Debug)]
pub struct Pictures {
    /// The name of the scene.
    pub scene: String,
    /// How it was rendered.
    pub options: RenderOptions,
    /// A frame for each strategy, by name.
    pub frames: Vec<(String, Frame)>,
}

impl ModelReport {
    pub(super) fn of(rows: &[Row], reading: &str) -> Self {
        let is_measured = |row: &&Row| row.spheres.is_some() && row.strategies.contains_key(reading);
        let rows: Vec<_> = rows.iter().filter(is_measured).collect();
        let measurements: Vec<_> = rows
            .iter()
            .map(|row| {
                let (standard, speer) = (&row.strategies["standard"], &row.strategies[reading]);
                let rays = float(row.rays) / float(row.seeds as u64);
                Measurement {
                    n: float(row.volumes as u64),
                    coherence: speer.percent_coherent / 100.0,
                    standard: standard.seconds / rays,
                    coherent: speer.seconds / rays,
                }
            })
            .collect();
        let model = CostModel::fit(&measurements);
        let predicted: Vec<_> = measurements.iter().map(|m| model.ratio(m.n, m.coherence)).collect();
        let measured: Vec<_> = rows.iter().map(|row| row.strategies[reading].ratio_time_spread).collect();
        let predicts =
            predicted.iter().zip(&measured).all(|(p, m)| (m.lower_quartile..=m.upper_quartile).contains(p));
        let wins = |m: &Measurement| (m.coherence > model.threshold()) == (m.coherent < m.standard);
        let (paper, paper_rms_error) = fit_of_the_paper();
        Self {
            k: model.k,
            lambda: model.lambda,
            alpha: model.alpha,
            threshold: model.threshold(),
            rms_error: root_mean_square(predicted.iter().zip(&measured).map(|(p, m)| p - m.median)),
            predicted_ratio: predicted,
            measured_ratio: measured.iter().map(|spread| spread.median).collect(),
            predicts,
            threshold_decides: measurements.iter().all(wins),
            paper_alpha_over_k: paper.alpha / paper.k,
            paper_lambda_over_k: paper.lambda / paper.k,
            paper_rms_error,
            paper_rms_effect: root_mean_square(PAPER.iter().map(|row| row.ratio_recomputed - 1.0)),
            paper_k_over_lambda: PAPER[3].k_over_lambda(),
        }
    }
}

impl OptionsReport {
    pub(super) fn of(plan: &Table1Plan) -> Self {
        Self {
            resolution: plan.resolution,
            seeds: plan.seeds.clone(),
            repetitions: plan.repetitions,
            mesh_repetitions: plan.mesh_repetitions,
            max_depth: plan.max_depth,
            cutoff: plan.cutoff,
            backend: plan.backend.name(),
            order: "scanline",
            readings: plan
                .readings
                .iter()
                .map(|reading| (reading.name.clone(), reading.options.choices().into_iter().collect()))
                .collect(),
            version: env!("CARGO_PKG_VERSION"),
        }
    }
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0, 0.0), |(count, sum), value| (count + 1, sum + value * value));
    (sum / float(count.max(1))).sqrt()
}
