//! Runs the experiment.

use std::collections::BTreeMap;

use rayset_engine::{
    ByKind, CoherenceCounts, Frame, IntersectionStrategy, Layer, Layers, RayCounts, RayKind, RenderOptions,
    Speer1985, Speer1985Options, Stats, StrategyKind, render,
};

use super::paper::PAPER;
use super::plan::{Reading, Table1Plan};
use super::results::{
    KindRow, ModelReport, OptionsReport, Pictures, Row, StrategyRow, Table1, float, percent,
};
use crate::{NamedScene, Spread, StudyError, mesh_scenes, sphere_scene};

impl Table1 {
    /// Runs the experiment; `step` is called before each of [`Table1Plan::n_steps`] steps with its scene.
    ///
    /// Every frame is one sweep, and therefore on one thread; the strategies take turns.
    ///
    /// # Errors
    ///
    /// [`StudyError`] if a scene cannot be loaded or the options make no sense.
    pub fn run(plan: &Table1Plan, step: &mut dyn FnMut(&str)) -> Result<Self, StudyError> {
        // A mesh that cannot be loaded is found out before the minutes are spent.
        let wants_meshes = plan.mesh_resolutions.iter().any(|&side| side > 0);
        let meshes = if wants_meshes { mesh_scenes(&plan.fixtures)? } else { Vec::new() };
        let (mut ours, mut pictures) = (Vec::new(), Vec::new());
        for &count in &plan.spheres {
            let scenes =
                plan.seeds.iter().map(|&seed| sphere_scene(count, seed)).collect::<Result<Vec<_>, _>>()?;
            let options = plan.options(plan.resolution);
            ours.push(row(plan, &scenes, &options, plan.repetitions, step)?);
            pictures.push(pictures_of(plan, &scenes[0], &options)?);
        }
        for (scene, &side) in meshes.into_iter().zip(&plan.mesh_resolutions).filter(|(_, side)| **side > 0) {
            let (scene, options) = ([scene], plan.options(side));
            ours.push(row(plan, &scene, &options, plan.mesh_repetitions, step)?);
            pictures.push(pictures_of(plan, &scene[0], &options)?);
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
    let options =
        RenderOptions { layers: Layers::BEAUTY.with(Layer::Rays).with(Layer::Coherent), ..*options };
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
    rays: RayCounts,
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
            radii: radii.bins().collect(),
            lengths: self.stats.lengths.bins().collect(),
        }
    }
}
