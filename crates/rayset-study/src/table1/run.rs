//! Runs the experiment.

use std::collections::BTreeMap;

use rayset_engine::{
    Backend, ByKind, CoherenceCounts, Frame, IntersectionStrategy, Layer, Layers, RayCounts, RayKind,
    RenderOptions, Speer1985, Speer1985Options, Stats, StrategyKind, render,
};

use super::paper::PAPER;
use super::plan::{Reading, Table1Plan};
use super::results::{
    ExactRow, Fitted, KindRow, Misses, ModelReport, OptionsReport, Pictures, PresetReport, Row, StrategyRow,
    Table1,
};
use crate::conditions::name_of_size;
use crate::study::float;
use crate::{
    Cost, Counting, Counts, NamedScene, Pair, Preset, Spread, StudyError, mesh_scenes, sphere_scene,
};

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
        let match_of = |side, repetitions| Match {
            readings: plan.readings.clone(),
            exact: plan.exact.clone(),
            counting: Counting::ALL_CAST,
            cost: None,
            backend: plan.backend,
            options: plan.options(side),
            repetitions,
        };
        for &count in &plan.spheres {
            let scenes =
                plan.seeds.iter().map(|&seed| sphere_scene(count, seed)).collect::<Result<Vec<_>, _>>()?;
            let rules = match_of(plan.resolution, plan.repetitions);
            ours.push(rules.row(&scenes, step)?.0);
            pictures.push(rules.pictures(&scenes[0])?);
        }
        for (scene, &side) in meshes.into_iter().zip(&plan.mesh_resolutions).filter(|(_, side)| **side > 0) {
            let (scene, rules) = ([scene], match_of(side, plan.mesh_repetitions));
            ours.push(rules.row(&scene, step)?.0);
            pictures.push(rules.pictures(&scene[0])?);
        }
        let mut presets = Vec::new();
        for preset in &plan.presets {
            presets.push(run_preset(plan, preset, &mut pictures, step)?);
        }
        let model = ModelReport::of(&ours, &Reading::literal().name);
        let (models, options) = (BTreeMap::new(), OptionsReport::of(plan));
        let mut table = Self { paper: PAPER.to_vec(), ours, presets, model, models, options, pictures };
        let model_of =
            |column: super::Column<'_>| (column.name.to_owned(), ModelReport::of(column.rows, column.name));
        table.models = table.columns().into_iter().map(model_of).collect();
        Ok(table)
    }
}

/// Runs a preset on scenes of its own.
fn run_preset(
    plan: &Table1Plan,
    preset: &Preset,
    pictures: &mut Vec<Pictures>,
    step: &mut dyn FnMut(&str),
) -> Result<PresetReport, StudyError> {
    let conditions = &preset.conditions;
    let rules = Match {
        readings: vec![Reading { name: preset.name.to_owned(), options: conditions.reading }],
        exact: Vec::new(),
        counting: preset.counting,
        cost: Some(preset.cost),
        backend: plan.backend,
        options: conditions.render_options(),
        repetitions: plan.repetitions,
    };
    let (mut rows, mut pairs) = (Vec::new(), [const { Vec::new() }; 4]);
    for &count in &plan.spheres {
        let name = format!("spheres-{count}-{}", name_of_size(conditions.size));
        let scene = |&seed: &u64| -> Result<NamedScene, StudyError> {
            let scene = conditions.scene(count, seed)?;
            Ok(NamedScene { name: name.clone(), scene, spheres: Some(count) })
        };
        let scenes = plan.seeds.iter().map(scene).collect::<Result<Vec<_>, _>>()?;
        let (row, counted) = rules.row(&scenes, step)?;
        rows.push(row);
        pictures.push(rules.pictures(&scenes[0])?);
        if let Some(place) = PAPER.iter().position(|row| row.spheres == count) {
            pairs[place] = counted;
        }
    }
    let misses = [true, false].map(|chosen| misses(plan, preset, &pairs, chosen));
    Ok(PresetReport {
        name: preset.name.to_owned(),
        conditions: conditions.levels().into_iter().collect(),
        differences: conditions.differences(),
        counting: preset.counting.to_string(),
        cost: preset.cost,
        misses: misses.into_iter().flatten().collect(),
        rows,
    })
}

/// How far medians over the seeds by which a preset was chosen, or over the others, are from the paper, as the study of
/// the readings has it; `None` without such seeds, or without all of the paper's rows.
fn misses(plan: &Table1Plan, preset: &Preset, pairs: &[Vec<Pair>; 4], chosen: bool) -> Option<Misses> {
    let belongs = |seed: &u64| preset.chosen_by.contains(seed) == chosen;
    let pairs = pairs.each_ref().map(|pairs| {
        let both = pairs.iter().zip(&plan.seeds).filter(|(_, seed)| belongs(seed));
        both.map(|(pair, _)| pair.clone()).collect::<Vec<_>>()
    });
    Some(Misses {
        seeds: plan.seeds.iter().copied().filter(belongs).collect(),
        chosen,
        points: preset.counting.near(&preset.conditions.reading, &pairs)?.error,
        ratio_fitted: preset.cost.near(&pairs)?.error,
        ratio_tests: Cost::TESTS.near(&pairs)?.error,
    })
}

/// Readings against `standard`: what takes part, and by which rules.
struct Match {
    readings: Vec<Reading>,
    exact: Vec<StrategyKind>,
    counting: Counting,
    cost: Option<Cost>,
    backend: Backend,
    options: RenderOptions,
    repetitions: usize,
}

/// What is gathered of a strategy while its row is run.
#[derive(Default)]
struct Gathered {
    seconds: Vec<f64>,
    seconds_frame: Vec<f64>,
    ratios: Vec<f64>,
    ratios_frame: Vec<f64>,
    /// Of each seed.
    counts: Vec<Counts>,
    /// Of each seed.
    wrong_pixels: Vec<u64>,
    stats: Stats,
    kinds: ByKind<CoherenceCounts>,
    rays: RayCounts,
}

impl Match {
    /// The strategies with their names, bound to a scene: `standard` is the first.
    fn strategies<'s>(&'s self, scene: &'s NamedScene) -> Vec<(&'s str, Box<dyn IntersectionStrategy + 's>)> {
        let standard = StrategyKind::Standard;
        let mut strategies = vec![(standard.name(), standard.bind_on(&scene.scene, self.backend))];
        for Reading { name, options } in &self.readings {
            strategies.push((name, Box::new(Speer1985::on(&scene.scene, self.backend, *options))));
        }
        strategies
    }

    fn pictures(&self, scene: &NamedScene) -> Result<Pictures, StudyError> {
        let layers = Layers::BEAUTY.with(Layer::Rays).with(Layer::Coherent);
        let options = RenderOptions { layers, ..self.options };
        let mut frames = Vec::new();
        for (name, strategy) in self.strategies(scene) {
            frames.push((name.to_owned(), render(strategy.as_ref(), &options)?));
        }
        Ok(Pictures { scene: scene.name.clone(), options, frames })
    }

    /// A row, and what `standard` and the first reading counted for each scene.
    fn row(&self, scenes: &[NamedScene], step: &mut dyn FnMut(&str)) -> Result<(Row, Vec<Pair>), StudyError> {
        let n_readings = self.readings.len();
        let n_strategies = 1 + n_readings + self.exact.len();
        let mut gathered: Vec<Gathered> = (0..n_strategies).map(|_| Gathered::default()).collect();
        for scene in scenes {
            let mut strategies = self.strategies(scene);
            for kind in &self.exact {
                strategies.push((kind.name(), kind.bind_on(&scene.scene, self.backend)));
            }
            let mut seconds = vec![Vec::new(); n_strategies];
            let mut seconds_frame = vec![Vec::new(); n_strategies];
            for repetition in 0..self.repetitions {
                step(&scene.name);
                let mut frames: Vec<Option<Frame>> = vec![None; n_strategies];
                // The one that goes first changes, so that none always finds the warmer machine.
                for turn in 0..n_strategies {
                    let i = (turn + repetition) % n_strategies;
                    frames[i] = Some(render(strategies[i].1.as_ref(), &self.options)?);
                }
                let frames: Vec<Frame> = frames.into_iter().flatten().collect();
                let standard = &frames[0];
                for (i, frame) in frames.iter().enumerate() {
                    let (inside, whole) =
                        (frame.times.strategy.as_secs_f64(), frame.times.trace.as_secs_f64());
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
            for (gathered, reading) in gathered[1..].iter_mut().zip(&self.readings) {
                let audited = Speer1985Options { audit: true, ..reading.options };
                let audit = render(&Speer1985::on(&scene.scene, self.backend, audited), &self.options)?;
                gathered.kinds += audit.stats.coherence;
            }
            for (i, gathered) in gathered.iter_mut().enumerate() {
                gathered.seconds.push(Spread::of(&seconds[i]).median);
                gathered.seconds_frame.push(Spread::of(&seconds_frame[i]).median);
            }
        }
        let first = &scenes[0];
        let standard = &gathered[0];
        let names = self.strategies(first).into_iter().map(|(name, _)| name.to_owned());
        let literal = Speer1985Options::default();
        let readings = std::iter::once(&literal).chain(self.readings.iter().map(|reading| &reading.options));
        let measured =
            gathered.iter().zip(readings).map(|(it, reading)| self.measured(it, standard, reading));
        let exact = gathered[1 + n_readings..].iter().map(|gathered| gathered.exact(standard));
        let row = Row {
            scene: first.name.clone(),
            spheres: first.spheres,
            volumes: first.scene.volumes().len(),
            primitives: first.scene.n_primitives(),
            seeds: scenes.len(),
            resolution: self.options.width,
            rays: standard.rays.total().cast,
            strategies: names.zip(measured).collect(),
            exact: self.exact.iter().map(|kind| kind.name()).zip(exact).collect(),
        };
        let pixels = u64::from(self.options.width) * u64::from(self.options.height);
        let pairs = gathered.get(1).map_or_else(Vec::new, |speer| speer.pairs(standard, pixels));
        Ok((row, pairs))
    }

    fn measured(&self, gathered: &Gathered, standard: &Gathered, reading: &Speer1985Options) -> StrategyRow {
        let all = Counts::of(&gathered.rays, &gathered.stats);
        let all_standard = Counts::of(&standard.rays, &standard.stats);
        let percents: Vec<_> =
            gathered.counts.iter().filter_map(|counts| self.counting.percent(counts, reading)).collect();
        let ratio_time_spread = Spread::of(&gathered.ratios);
        let fitted = self.cost.map(|cost| {
            let pairs = gathered.counts.iter().zip(&standard.counts);
            let ratios: Vec<_> = pairs.map(|(ours, standard)| cost.of(ours) / cost.of(standard)).collect();
            Fitted { ratio: cost.of(&all) / cost.of(&all_standard), spread: Spread::of(&ratios) }
        });
        let (radii, lengths) = (&gathered.stats.radii, &gathered.stats.lengths);
        StrategyRow {
            seconds: mean(&gathered.seconds),
            seconds_frame: mean(&gathered.seconds_frame),
            work: all.in_tests(),
            partitions: all.work.partitions,
            percent_coherent: self.counting.percent(&all, reading).unwrap_or_default(),
            percent_coherent_spread: Spread::of(&percents),
            ratio_time: ratio_time_spread.median,
            ratio_time_spread,
            ratio_time_frame: Spread::of(&gathered.ratios_frame).median,
            ratio_work: float(all.in_tests()) / float(all_standard.in_tests()),
            fitted,
            wrong_pixels: gathered.wrong_pixels.iter().sum(),
            kinds: RayKind::ALL.into_iter().map(|kind| (kind.name(), gathered.kind(kind))).collect(),
            median_radius: radii.quantile(0.5).filter(|radius| radius.is_finite()),
            unbounded_radii: float(radii.infinite()) / float(radii.count().max(1)),
            median_length: lengths.quantile(0.5).filter(|length| length.is_finite()),
            radii: radii.bins().collect(),
            lengths: lengths.bins().collect(),
        }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |sum, value| sum + value) / float(values.len() as u64)
}

impl Gathered {
    fn exact(&self, standard: &Self) -> ExactRow {
        let [all, all_standard] = [self, standard].map(|it| Counts::of(&it.rays, &it.stats));
        let percents: Vec<_> = self.counts.iter().map(Counts::percent_coherent).collect();
        ExactRow {
            seconds: mean(&self.seconds),
            percent_coherent: all.percent_coherent(),
            percent_coherent_spread: Spread::of(&percents),
            ratio_time: Spread::of(&self.ratios),
            ratio_time_frame: Spread::of(&self.ratios_frame),
            ratio_work: float(all.in_tests()) / float(all_standard.in_tests()),
            wrong_pixels: self.wrong_pixels.iter().sum(),
        }
    }

    fn count(&mut self, frame: &Frame, standard: &Frame) {
        self.counts.push(Counts::of(&frame.counts, &frame.stats));
        self.wrong_pixels.push(frame.differing_pixels(standard) as u64);
        self.stats += &frame.stats;
        self.rays += frame.counts;
    }

    fn kind(&self, kind: RayKind) -> KindRow {
        let (counts, tally) = (self.stats.coherence[kind], self.rays[kind]);
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
    }

    fn pairs(&self, standard: &Self, pixels: u64) -> Vec<Pair> {
        let counts = standard.counts.iter().zip(&self.counts).zip(&self.wrong_pixels);
        let pair = |((standard, speer), wrong_pixels): ((&Counts, &Counts), &u64)| Pair {
            standard: standard.clone(),
            speer: speer.clone(),
            wrong_pixels: *wrong_pixels,
            pixels,
        };
        counts.map(pair).collect()
    }
}
