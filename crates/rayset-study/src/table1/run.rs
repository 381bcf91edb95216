//! Runs the experiment.

use std::collections::BTreeMap;
use std::path::PathBuf;

use rayset_engine::{
    Backend, ByKind, CoherenceCounts, Frame, IntersectionStrategy, MissRule, RayKind, Recording,
    RenderOptions, Speer1985, Speer1985Options, Stats, StrategyKind, SweepLength, render,
};
use serde::Serialize;

use super::paper::{PAPER, PaperRow, fit_of_the_paper};
use crate::{CostModel, Measurement, NamedScene, Spread, StudyError, mesh_scenes, sphere_scene};

/// What to run.
#[derive(Clone, Debug, PartialEq)]
pub struct Table1Plan {
    /// The numbers of spheres.
    pub spheres: Vec<u32>,
    /// The seeds, each a scene for every number of spheres.
    pub seeds: Vec<u64>,
    /// How often each frame is rendered with each strategy, in turn.
    pub repetitions: usize,
    /// The side of the square images of spheres, in pixels.
    pub resolution: u32,
    /// The sides of the images of the three mesh scenes; zero leaves a scene out.
    pub mesh_resolutions: [u32; 3],
    /// How often each mesh frame is rendered with each strategy.
    pub mesh_repetitions: usize,
    /// The folder of fixtures, for the meshes.
    pub fixtures: PathBuf,
    /// The lanes of both strategies: `scalar` is the paper's setting.
    pub backend: Backend,
    /// The greatest depth of a tree.
    pub max_depth: u32,
    /// The adaptive cut-off.
    pub cutoff: Option<f64>,
    /// The readings of section 2.3 to compare with `standard`.
    pub readings: Vec<Reading>,
}

/// A reading of section 2.3, with the name that reports give it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reading {
    /// The name.
    pub name: String,
    /// The choices.
    pub options: Speer1985Options,
}

impl Reading {
    /// The default: each place that the text leaves open read as literally as it allows.
    #[must_use]
    pub fn literal() -> Self {
        Self { name: StrategyKind::Speer1985.name().to_owned(), options: Speer1985Options::default() }
    }

    /// The same, but rays that hit nothing leave cylinders too: what comes nearest to the coherence the paper prints.
    #[must_use]
    pub fn with_misses() -> Self {
        let options = Speer1985Options { misses: MissRule::Cylinder, ..Speer1985Options::default() };
        Self { name: "speer-1985-misses".to_owned(), options }
    }
}

impl Table1Plan {
    /// The run that the documentation quotes: some minutes.
    #[must_use]
    pub fn full(fixtures: PathBuf) -> Self {
        Self {
            spheres: vec![1, 2, 4, 8],
            seeds: (1..=16).collect(),
            repetitions: 5,
            resolution: 512,
            mesh_resolutions: [384, 160, 96],
            mesh_repetitions: 5,
            fixtures,
            backend: Backend::Scalar,
            max_depth: RenderOptions::default().max_depth,
            cutoff: RenderOptions::default().cutoff,
            readings: vec![Reading::literal(), Reading::with_misses()],
        }
    }

    /// A run of less than a minute, to see that all is well.
    #[must_use]
    pub fn quick(fixtures: PathBuf) -> Self {
        Self {
            seeds: (1..=4).collect(),
            repetitions: 3,
            resolution: 192,
            mesh_resolutions: [128, 64, 40],
            mesh_repetitions: 3,
            ..Self::full(fixtures)
        }
    }

    /// How many steps a run has, for a progress bar.
    #[must_use]
    pub fn n_steps(&self) -> usize {
        let meshes = self.mesh_resolutions.iter().filter(|&&side| side > 0).count();
        self.spheres.len() * self.seeds.len() * (self.repetitions + 1) + meshes * (self.mesh_repetitions + 1)
    }

    fn options(&self, side: u32) -> RenderOptions {
        RenderOptions {
            width: side,
            height: side,
            max_depth: self.max_depth,
            cutoff: self.cutoff,
            sweep: SweepLength::WholeImage,
            ..RenderOptions::default()
        }
    }
}

/// The experiment's results.
#[derive(Clone, Debug, Serialize)]
pub struct Table1 {
    /// The paper's rows.
    pub paper: Vec<PaperRow>,
    /// Our rows: spheres, then meshes.
    pub ours: Vec<Row>,
    /// Section 3's model, fitted to the literal reading.
    pub model: ModelReport,
    /// The same, fitted to each reading by itself.
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
    /// A frame for each strategy, by name.
    pub frames: Vec<(String, Frame)>,
}

impl Table1 {
    /// Runs the experiment; `step` is called after each of [`Table1Plan::n_steps`] steps with what comes next.
    ///
    /// Every frame is one sweep, and therefore on one thread; the two strategies take turns.
    ///
    /// # Errors
    ///
    /// [`StudyError`] if a scene cannot be loaded or the options make no sense.
    pub fn run(plan: &Table1Plan, step: &mut dyn FnMut(&str)) -> Result<Self, StudyError> {
        let (mut ours, mut pictures) = (Vec::new(), Vec::new());
        for &count in &plan.spheres {
            let scenes =
                plan.seeds.iter().map(|&seed| sphere_scene(count, seed)).collect::<Result<Vec<_>, _>>()?;
            let options = plan.options(plan.resolution);
            ours.push(row(plan, &scenes, &options, plan.repetitions, step)?);
            pictures.push(pictures_of(plan, &scenes[0], &options)?);
        }
        if plan.mesh_resolutions.iter().any(|&side| side > 0) {
            for (scene, &side) in mesh_scenes(&plan.fixtures)?.into_iter().zip(&plan.mesh_resolutions) {
                if side > 0 {
                    let options = plan.options(side);
                    let scene = [scene];
                    ours.push(row(plan, &scene, &options, plan.mesh_repetitions, step)?);
                    pictures.push(pictures_of(plan, &scene[0], &options)?);
                }
            }
        }
        let model_of = |reading: &Reading| (reading.name.clone(), ModelReport::of(&ours, &reading.name));
        let models: BTreeMap<_, _> = plan.readings.iter().map(model_of).collect();
        let model = ModelReport::of(&ours, &Reading::literal().name);
        Ok(Self { paper: PAPER.to_vec(), ours, model, models, options: OptionsReport::of(plan), pictures })
    }
}

/// The strategies of the experiment with their names, bound to a scene: `standard` is the first.
fn strategies<'s>(
    plan: &'s Table1Plan,
    scene: &'s NamedScene,
) -> Vec<(&'s str, Box<dyn IntersectionStrategy + 's>)> {
    let standard = StrategyKind::Standard;
    let mut strategies = vec![(standard.name(), standard.bind_on(&scene.scene, plan.backend))];
    for Reading { name, options } in &plan.readings {
        strategies.push((name, Box::new(Speer1985::on(&scene.scene, plan.backend, *options))));
    }
    strategies
}

fn pictures_of(
    plan: &Table1Plan,
    scene: &NamedScene,
    options: &RenderOptions,
) -> Result<Pictures, StudyError> {
    let options = RenderOptions { recording: Recording::PerQuery, ..*options };
    let mut frames = Vec::new();
    for (name, strategy) in strategies(plan, scene) {
        frames.push((name.to_owned(), render(strategy.as_ref(), &options)?));
    }
    Ok(Pictures { scene: scene.name.clone(), frames })
}

/// What is gathered of a strategy while its row is run.
#[derive(Default)]
struct Gathered {
    seconds: Vec<f64>,
    seconds_frame: Vec<f64>,
    ratios: Vec<f64>,
    ratios_frame: Vec<f64>,
    percents: Vec<f64>,
    stats: Stats,
    kinds: ByKind<CoherenceCounts>,
    rays: rayset_engine::RayCounts,
    wrong_pixels: u64,
}

fn row(
    plan: &Table1Plan,
    scenes: &[NamedScene],
    options: &RenderOptions,
    repetitions: usize,
    step: &mut dyn FnMut(&str),
) -> Result<Row, StudyError> {
    let n_strategies = 1 + plan.readings.len();
    let mut gathered: Vec<Gathered> = (0..n_strategies).map(|_| Gathered::default()).collect();
    for scene in scenes {
        let strategies = strategies(plan, scene);
        let mut seconds = vec![Vec::new(); n_strategies];
        let mut seconds_frame = vec![Vec::new(); n_strategies];
        for repetition in 0..repetitions {
            step(&scene.name);
            let mut frames: Vec<Option<Frame>> = vec![None; n_strategies];
            // The one that goes first changes, so that none always finds the warmer machine.
            for turn in 0..n_strategies {
                let i = (turn + repetition) % n_strategies;
                frames[i] = Some(render(strategies[i].1.as_ref(), options)?);
            }
            let frames: Vec<Frame> = frames.into_iter().flatten().collect();
            let standard = &frames[0];
            for (i, frame) in frames.iter().enumerate() {
                let (inside, whole) = (frame.times.strategy.as_secs_f64(), frame.times.trace.as_secs_f64());
                seconds[i].push(inside);
                seconds_frame[i].push(whole);
                gathered[i].ratios.push(inside / standard.times.strategy.as_secs_f64());
                gathered[i].ratios_frame.push(whole / standard.times.trace.as_secs_f64());
                if repetition == 0 {
                    gathered[i].count(frame, standard);
                }
            }
        }
        step(&scene.name);
        for (i, reading) in plan.readings.iter().enumerate() {
            let audited = Speer1985Options { audit: true, ..reading.options };
            let audit = render(&Speer1985::on(&scene.scene, plan.backend, audited), options)?;
            gathered[i + 1].kinds += audit.stats.coherence;
        }
        for (i, gathered) in gathered.iter_mut().enumerate() {
            gathered.seconds.push(Spread::of(&seconds[i]).median);
            gathered.seconds_frame.push(Spread::of(&seconds_frame[i]).median);
        }
    }
    let first = &scenes[0];
    let work = gathered[0].stats.work.in_tests();
    let names = strategies(plan, first).into_iter().map(|(name, _)| name.to_owned());
    Ok(Row {
        scene: first.name.clone(),
        spheres: first.spheres,
        volumes: first.scene.volumes().len(),
        primitives: first.scene.n_primitives(),
        seeds: scenes.len(),
        resolution: options.width,
        rays: gathered[0].rays.total().cast,
        strategies: names.zip(gathered.iter().map(|gathered| gathered.row(work))).collect(),
    })
}

impl Gathered {
    fn count(&mut self, frame: &Frame, standard: &Frame) {
        let coherent = frame.stats.coherence.total().coherent;
        self.percents.push(percent(coherent, frame.counts.total().cast));
        self.stats += &frame.stats;
        self.rays += frame.counts;
        self.wrong_pixels += frame.differing_pixels(standard) as u64;
    }

    fn row(&self, standard_work: u64) -> StrategyRow {
        let mean =
            |values: &[f64]| values.iter().fold(0.0, |sum, value| sum + value) / float(values.len() as u64);
        let coherence = |kind: RayKind| {
            let counts = self.stats.coherence[kind];
            let tally = self.rays[kind];
            KindRow {
                cast: tally.cast,
                hit: tally.hit,
                guided: counts.guided,
                predicted_missed: counts.predicted_missed,
                pierced: counts.pierced,
                false_coherence: counts.false_coherence,
                coherent: counts.coherent,
                wrong: self.kinds[kind].wrong,
            }
        };
        let work = self.stats.work.in_tests();
        let radii = &self.stats.radii;
        let ratio_time_spread = Spread::of(&self.ratios);
        StrategyRow {
            seconds: mean(&self.seconds),
            seconds_frame: mean(&self.seconds_frame),
            work,
            partitions: self.stats.work.partitions,
            percent_coherent: percent(self.stats.coherence.total().coherent, self.rays.total().cast),
            percent_coherent_spread: Spread::of(&self.percents),
            ratio_time: ratio_time_spread.median,
            ratio_time_spread,
            ratio_time_frame: Spread::of(&self.ratios_frame).median,
            ratio_work: float(work) / float(standard_work),
            wrong_pixels: self.wrong_pixels,
            kinds: RayKind::ALL.into_iter().map(|kind| (kind.name(), coherence(kind))).collect(),
            median_radius: radii.quantile(0.5).filter(|radius| radius.is_finite()),
            unbounded_radii: float(radii.infinite()) / float(radii.count().max(1)),
            median_length: self.stats.lengths.quantile(0.5).filter(|length| length.is_finite()),
        }
    }
}

#[expect(clippy::cast_precision_loss, reason = "counts stay far below 2^53")]
fn float(count: u64) -> f64 {
    count as f64
}

fn root_mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0, 0.0), |(count, sum), value| (count + 1, sum + value * value));
    (sum / float(count.max(1))).sqrt()
}

fn percent(part: u64, whole: u64) -> f64 {
    100.0 * float(part) / float(whole.max(1))
}

impl ModelReport {
    fn of(rows: &[Row], reading: &str) -> Self {
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
    fn of(plan: &Table1Plan) -> Self {
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
