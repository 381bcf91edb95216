//! The scenes of Table 1, rendered by strategies that its results lack.

use std::path::Path;

use rayset_engine::{Backend, RenderOptions, StrategyKind, SweepLength, render};
use serde::{Deserialize, Serialize};

use super::counts::{Counts, float, ratio};
use super::journal::Journal;
use super::runner::{Experiment, Step, run_missing, version_with};
use crate::{Spread, StudyError, sphere_scene};

/// The scenes of a table, and how to render them.
#[derive(Clone, Debug)]
pub(crate) struct OtherScenes {
    /// The numbers of spheres.
    pub(crate) spheres: Vec<u32>,
    /// The seeds, each a scene for every number of spheres.
    pub(crate) seeds: Vec<u64>,
    /// The side of the square images, in pixels.
    pub(crate) resolution: u32,
    /// The greatest depth of a tree.
    pub(crate) max_depth: u32,
    /// The adaptive cut-off.
    pub(crate) cutoff: Option<f64>,
    /// The lanes of both strategies.
    pub(crate) backend: Backend,
    /// How often each frame is rendered with each strategy, in turn.
    pub(crate) repetitions: usize,
}

/// What a strategy took for a number of spheres, over all seeds that are finished.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OtherRow {
    /// Coherent rays in percent of the rays cast, of all seeds together.
    pub(crate) percent_coherent: f64,
    /// Its spread over seeds.
    pub(crate) percent_coherent_spread: Spread,
    /// Time over that of `standard`, of all pairs.
    pub(crate) ratio_time: Spread,
    /// Work over that of `standard`.
    pub(crate) ratio_work: f64,
    /// Pixels that differ from those of `standard`, over all seeds.
    pub(crate) wrong_pixels: u64,
    /// Seconds inside the calls of `standard`: the mean over seeds of the median.
    pub(crate) seconds_standard: f64,
    /// The same of the strategy.
    pub(crate) seconds: f64,
}

/// A strategy on one scene.
struct Trial<'a> {
    kind: StrategyKind,
    spheres: u32,
    seed: u64,
    scenes: &'a OtherScenes,
    version: &'a str,
}

/// What it took; `standard` first.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Record {
    counts: [Counts; 2],
    seconds: Vec<[f64; 2]>,
    wrong_pixels: u64,
}

impl Experiment for Trial<'_> {
    type Record = Record;

    fn parameters(&self) -> Vec<(&'static str, String)> {
        let OtherScenes { resolution, max_depth, cutoff, backend, repetitions, .. } = self.scenes;
        vec![
            ("strategy", self.kind.name().to_owned()),
            ("n", self.spheres.to_string()),
            ("seed", self.seed.to_string()),
            ("resolution", resolution.to_string()),
            ("depth", max_depth.to_string()),
            ("cutoff", cutoff.map_or_else(|| "off".to_owned(), |cutoff| cutoff.to_string())),
            ("backend", backend.name().to_owned()),
            ("repetitions", repetitions.to_string()),
        ]
    }

    fn version(&self) -> &str {
        self.version
    }

    fn run(&self) -> Result<Record, StudyError> {
        let OtherScenes { resolution, max_depth, cutoff, backend, repetitions, .. } = *self.scenes;
        let scene = sphere_scene(self.spheres, self.seed)?.scene;
        let options = RenderOptions {
            width: resolution,
            height: resolution,
            max_depth,
            cutoff,
            sweep: SweepLength::WholeImage,
            ..RenderOptions::default()
        };
        let strategies = [StrategyKind::Standard, self.kind].map(|kind| kind.bind_on(&scene, backend));
        let mut seconds = Vec::new();
        let mut counted = None;
        for _ in 0..repetitions.max(1) {
            let standard = render(strategies[0].as_ref(), &options)?;
            let ours = render(strategies[1].as_ref(), &options)?;
            seconds.push([&standard, &ours].map(|frame| frame.times.strategy.as_secs_f64()));
            counted.get_or_insert_with(|| {
                let counts = [&standard, &ours].map(|frame| Counts::of(&frame.counts, &frame.stats));
                (counts, ours.differing_pixels(&standard) as u64)
            });
        }
        let (counts, wrong_pixels) = counted.expect("rendered once at least");
        Ok(Record { counts, seconds, wrong_pixels })
    }
}

impl OtherScenes {
    fn trials<'a>(&'a self, kind: StrategyKind, version: &'a str) -> Vec<Trial<'a>> {
        let of = |&spheres: &u32| {
            self.seeds.iter().map(move |&seed| Trial { kind, spheres, seed, scenes: self, version })
        };
        self.spheres.iter().flat_map(of).collect()
    }

    /// Renders what the journal lacks, with a strategy; one row for each number of spheres.
    pub(crate) fn rows(
        &self,
        kind: StrategyKind,
        path: &Path,
        step: Step<'_>,
    ) -> Result<Vec<OtherRow>, StudyError> {
        let version = version_with(&[kind]);
        let mut journal = Journal::open(path)?;
        let trials = self.trials(kind, &version);
        run_missing(&mut journal, &trials, 1, step)?;
        let row = |trials: &[Trial<'_>]| {
            OtherRow::of(&trials.iter().filter_map(|trial| journal.get(&trial.key())).collect::<Vec<_>>())
        };
        Ok(trials.chunks(self.seeds.len().max(1)).map(row).collect())
    }
}

impl OtherRow {
    fn of(records: &[&Record]) -> Self {
        let ratios = records.iter().flat_map(|r| r.seconds.iter().map(|[standard, ours]| ours / standard));
        let seconds = |i: usize| {
            let medians = records
                .iter()
                .map(|r| Spread::of(&r.seconds.iter().map(|pair| pair[i]).collect::<Vec<_>>()).median);
            medians.fold(0.0, |sum, median| sum + median) / float(records.len() as u64)
        };
        let work = |i: usize| records.iter().map(|record| record.counts[i].in_tests()).sum::<u64>();
        let percents = records.iter().map(|record| record.counts[1].percent_coherent());
        let sum = |part: fn(&Counts) -> u64| records.iter().map(|record| part(&record.counts[1])).sum();
        Self {
            percent_coherent: 100.0 * ratio(sum(Counts::coherent_rays), sum(Counts::rays)),
            percent_coherent_spread: Spread::of(&percents.collect::<Vec<_>>()),
            ratio_time: Spread::of(&ratios.collect::<Vec<_>>()),
            ratio_work: float(work(1)) / float(work(0)),
            wrong_pixels: records.iter().map(|record| record.wrong_pixels).sum(),
            seconds_standard: seconds(0),
            seconds: seconds(1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Table1, Table1Plan};
    use approx::{abs_diff_eq, assert_abs_diff_eq};

    /// `speer-1985` and exact strategies are in the table too, so both ways must count the same.
    #[test]
    fn a_strategy_counts_the_same_here_as_in_the_table() {
        let plan = Table1Plan {
            spheres: vec![2, 16],
            seeds: vec![1, 2],
            repetitions: 1,
            resolution: 24,
            mesh_resolutions: [0; 4],
            ..Table1Plan::full("none".into())
        };
        let table = Table1::run(&plan, &mut |_| ()).unwrap();
        let scenes = OtherScenes {
            spheres: plan.spheres.clone(),
            seeds: plan.seeds.clone(),
            resolution: plan.resolution,
            max_depth: plan.max_depth,
            cutoff: plan.cutoff,
            backend: plan.backend,
            repetitions: 1,
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("others.jsonl");
        let bundles = scenes.rows(StrategyKind::Bundle, &path, &|_, _| ()).unwrap();
        for (row, ours) in bundles.iter().zip(&table.ours) {
            let expected = &ours.exact["bundle"];
            // One or two spheres need no container.
            assert_eq!(row.percent_coherent > 0.0, ours.spheres > Some(2));
            assert_abs_diff_eq!(row.percent_coherent, expected.percent_coherent, epsilon = 1e-9);
            assert_eq!(row.ratio_work.to_bits(), expected.ratio_work.to_bits());
        }
        let rows = scenes.rows(StrategyKind::Speer1985, &path, &|_, _| ()).unwrap();
        assert_eq!((rows.len(), bundles.len()), (table.ours.len(), table.ours.len()));
        for (row, ours) in rows.iter().zip(&table.ours) {
            let expected = &ours.strategies["speer-1985"];
            // The two round at other places.
            let median = |spread: Spread| spread.median;
            assert_abs_diff_eq!(row.percent_coherent, expected.percent_coherent, epsilon = 1e-9);
            let medians = [row.percent_coherent_spread, expected.percent_coherent_spread].map(median);
            assert!(abs_diff_eq!(medians[0], medians[1], epsilon = 1e-9), "{medians:?}");
            assert_eq!(row.ratio_work.to_bits(), expected.ratio_work.to_bits());
            assert_eq!(row.wrong_pixels, expected.wrong_pixels);
        }
    }
}
