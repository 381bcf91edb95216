//! A cell: one scene at one resolution, rendered by all strategies in turn, counted and timed.

use rayset_engine::{
    Backend, Crop, IntersectionStrategy, PixelOrder, RayCounts, RenderOptions, Speer1985, Stats,
    StrategyKind, SweepLength, render,
};
use rayset_scene::RandomSpheres;
use serde::{Deserialize, Serialize};

use super::counts::{Counts, Distribution, float};
use super::interval::Median;
use super::runner::{Experiment, version_of_all, version_with_others};
use super::table1_explained::size;
use crate::{Reading, StudyError};

/// One scene at one resolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    pub(super) spheres: u32,
    /// See the levels of the factor `size`.
    pub(super) size: &'static str,
    pub(super) reflectance: &'static str,
    pub(super) seed: u64,
    /// The side of the square image, in pixels.
    pub(super) resolution: u32,
    /// Whether pixels are visited in tiles of 8 by 8 instead of scanlines.
    pub(super) tiles: bool,
    /// About how many pixels to render: strips of whole rows, evenly over the image.
    pub(super) pixels: u32,
    /// How often each strategy renders it.
    pub(super) repetitions: usize,
    /// Whether the methods of [`OTHERS`] render it too.
    pub(super) others: bool,
}

/// The strategies of a cell: `standard`, and those that use coherence.
pub(super) const STRATEGIES: [&str; 4] = ["standard", "speer-1985", "speer-1985-misses", "coherent"];

/// The paper's "other algorithmic methods", and coherence over one of them.
pub(super) const OTHERS: [StrategyKind; 3] =
    [StrategyKind::Cellular, StrategyKind::Hierarchical, StrategyKind::Bundle];

/// Which of [`names`] have coherent rays, and which each would be without them: `bundle` over `hierarchical`, the rest
/// over `standard`.
pub(super) const COHERENT: [(usize, usize); 4] = [(1, 0), (2, 0), (3, 0), (6, 5)];

/// The names of all of them, in the order in which [`Timed`] holds them.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    STRATEGIES.into_iter().chain(OTHERS.into_iter().map(StrategyKind::name))
}

/// What the strategies took, in the order of [`STRATEGIES`] and then of [`OTHERS`], if they were asked.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Timed {
    pub(super) strategies: Vec<Measured>,
}

/// What a strategy took.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Measured {
    pub(super) counts: Counts,
    pub(super) radii: Distribution,
    pub(super) lengths: Distribution,
    /// Seconds inside the strategy's calls, for each repetition.
    pub(super) seconds: Vec<f64>,
}

impl Timed {
    /// Work over that of another strategy.
    pub(super) fn ratio_of_work(&self, strategy: usize, over: usize) -> f64 {
        float(self.strategies[strategy].counts.in_tests()) / float(self.strategies[over].counts.in_tests())
    }

    /// Time over that of another strategy: the median of the repetitions, each of which has both.
    pub(super) fn ratio_of_time(&self, strategy: usize, over: usize) -> f64 {
        let pairs = self.strategies[strategy].seconds.iter().zip(&self.strategies[over].seconds);
        Median::of(&pairs.map(|(ours, theirs)| ours / theirs).collect::<Vec<_>>()).value
    }

    /// The least of the repetitions: what else runs on the machine only adds.
    pub(super) fn seconds(&self, strategy: usize) -> f64 {
        self.strategies[strategy].seconds.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// How far the repetitions of a ratio of times are apart, as a fraction of the median.
    pub(super) fn noise(&self, strategy: usize) -> f64 {
        let pairs = self.strategies[strategy].seconds.iter().zip(&self.strategies[0].seconds);
        let ratios: Vec<_> = pairs.map(|(ours, standard)| ours / standard).collect();
        let (least, greatest) = ratios
            .iter()
            .fold((f64::INFINITY, 0.0), |(a, b): (f64, f64), &ratio| (a.min(ratio), b.max(ratio)));
        (greatest - least) / self.ratio_of_time(strategy, 0)
    }
}

impl Cell {
    /// Whole rows, so that scanlines are as long as in the whole image; rows of whole tiles, where there are tiles.
    fn strips(&self) -> Vec<Crop> {
        let side = self.resolution;
        let unit = if self.tiles { 8 } else { 1 };
        let units = (self.pixels / side / unit).max(1);
        if units * unit >= side {
            return vec![Crop { x: 0, y: 0, width: side, height: side }];
        }
        let n_strips = units.min(4);
        let height = units / n_strips * unit;
        let strip = |i: u32| {
            let middle = (2 * i + 1) * side / (2 * n_strips);
            Crop { x: 0, y: middle - height / 2, width: side, height }
        };
        (0..n_strips).map(strip).collect()
    }
}

/// The parameters that some cells share, by name; those in which they differ are left out.
pub(super) fn shared(cells: &[Cell]) -> Vec<(&'static str, String)> {
    let mut parameters = cells.first().map(Cell::parameters).unwrap_or_default();
    for cell in cells {
        let others = cell.parameters();
        parameters.retain(|parameter| others.contains(parameter));
    }
    parameters
}

/// Every value that a parameter of some cells takes, in order of appearance.
pub(super) fn values(cells: &[Cell], parameter: &str) -> Vec<String> {
    let mut values = Vec::new();
    for (name, value) in cells.iter().flat_map(Cell::parameters) {
        if name == parameter && !values.contains(&value) {
            values.push(value);
        }
    }
    values
}

impl Experiment for Cell {
    type Record = Timed;

    fn parameters(&self) -> Vec<(&'static str, String)> {
        let mut parameters = vec![
            ("n", self.spheres.to_string()),
            ("size", self.size.to_owned()),
            ("reflectance", self.reflectance.to_owned()),
            ("seed", self.seed.to_string()),
            ("resolution", self.resolution.to_string()),
            ("order", if self.tiles { "tiles-8" } else { "scanline" }.to_owned()),
            ("pixels", self.pixels.to_string()),
            ("repetitions", self.repetitions.to_string()),
        ];
        if self.others {
            parameters.push(("others", OTHERS.map(StrategyKind::name).join(" ")));
        }
        parameters
    }

    fn version(&self) -> &'static str {
        if self.others { version_with_others() } else { version_of_all() }
    }

    fn run(&self) -> Result<Timed, StudyError> {
        let spheres = RandomSpheres {
            count: self.spheres,
            seed: self.seed,
            size: size(self.size),
            reflectance: self.reflectance.parse().unwrap_or(0.3),
            ..RandomSpheres::default()
        };
        let scene = spheres.scene()?;
        let bound = |reading: Reading| Box::new(Speer1985::on(&scene, Backend::Scalar, reading.options));
        let mut strategies: Vec<Box<dyn IntersectionStrategy + '_>> = vec![
            StrategyKind::Standard.bind_on(&scene, Backend::Scalar),
            bound(Reading::literal()),
            bound(Reading::with_misses()),
            StrategyKind::Coherent.bind_on(&scene, Backend::Scalar),
        ];
        if self.others {
            strategies.extend(OTHERS.map(|kind| kind.bind_on(&scene, Backend::Scalar)));
        }
        let mut rays = vec![RayCounts::default(); strategies.len()];
        let mut stats = vec![Stats::default(); strategies.len()];
        let mut seconds = vec![vec![0.0; strategies.len()]; self.repetitions];
        for crop in self.strips() {
            let options = RenderOptions {
                width: self.resolution,
                height: self.resolution,
                crop: Some(crop),
                order: Some(if self.tiles { PixelOrder::Tiles(8) } else { PixelOrder::Scanline }),
                sweep: SweepLength::WholeImage,
                ..RenderOptions::default()
            };
            for (repetition, seconds) in seconds.iter_mut().enumerate() {
                // The one that goes first changes, so that none always finds the warmer machine.
                for turn in 0..strategies.len() {
                    let i = (turn + repetition) % strategies.len();
                    let frame = render(strategies[i].as_ref(), &options)?;
                    seconds[i] += frame.times.strategy.as_secs_f64();
                    if repetition == 0 {
                        rays[i] += frame.counts;
                        stats[i] += &frame.stats;
                    }
                }
            }
        }
        let strategies = rays.iter().zip(&stats).enumerate().map(|(i, (rays, stats))| Measured {
            counts: Counts::of(rays, stats),
            radii: Distribution::of(&stats.radii),
            lengths: Distribution::of(&stats.lengths),
            seconds: seconds.iter().map(|seconds| seconds[i]).collect(),
        });
        Ok(Timed { strategies: strategies.collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::journal::Journal;
    use crate::study::runner::run_missing;
    use approx::assert_abs_diff_eq;

    const CELL: Cell = Cell {
        spheres: 8,
        size: "cover-0.5",
        reflectance: "0.3",
        seed: 1,
        resolution: 64,
        tiles: false,
        pixels: 1024,
        repetitions: 2,
        others: false,
    };

    #[test]
    fn strips_are_whole_rows_inside_the_image() {
        for resolution in [64, 100, 512, 4096] {
            for pixels in [1, 4096, 65_536] {
                for tiles in [false, true] {
                    let cell = Cell { resolution, pixels, tiles, ..CELL };
                    let strips = cell.strips();
                    let mut end = 0;
                    for strip in &strips {
                        assert!(strip.y >= end && strip.height > 0 && strip.width == resolution, "{cell:?}");
                        end = strip.y + strip.height;
                    }
                    assert!(end <= resolution, "{cell:?}: {strips:?}");
                }
            }
        }
        assert_eq!(Cell { pixels: 4096, ..CELL }.strips().len(), 1);
    }

    #[test]
    fn a_cell_measures_all_strategies() {
        let timed = CELL.run().unwrap();
        assert_eq!(timed.strategies.len(), STRATEGIES.len());
        assert!(timed.strategies.iter().all(|s| s.counts.cast[0] == 1024 && s.seconds.len() == 2));
        assert!(timed.ratio_of_work(3, 0) < 1.0 && timed.ratio_of_time(1, 0) > 0.0 && timed.seconds(0) > 0.0);
    }

    #[test]
    fn other_methods_are_measured_beside_and_make_another_experiment() {
        // More spheres than are tested without shafts.
        let cell = Cell { spheres: 16, others: true, ..CELL };
        assert_ne!(cell.key(), Cell { others: false, ..cell }.key());
        let timed = cell.run().unwrap();
        assert_eq!(timed.strategies.len(), STRATEGIES.len() + OTHERS.len());
        let cellular = &timed.strategies[4].counts;
        assert!(cellular.work.cells_visited > 0 && cellular.cast == timed.strategies[0].counts.cast);
        // What is coherent, and what the same would be without.
        let names: Vec<_> = names().collect();
        assert_eq!(COHERENT.map(|(i, _)| names[i])[2..], ["coherent", "bundle"]);
        assert_eq!(COHERENT.map(|(_, over)| names[over])[2..], ["standard", "hierarchical"]);
        for (i, strategy) in timed.strategies.iter().enumerate() {
            let is_coherent = strategy.counts.percent_coherent() > 0.0;
            assert_eq!(is_coherent, COHERENT.iter().any(|&(coherent, _)| coherent == i), "{}", names[i]);
        }
        let [hierarchical, bundle] = [5, 6].map(|i| &timed.strategies[i].counts);
        assert!(bundle.percent_coherent() > 50.0 && bundle.coherent == [0; 4], "{bundle:?}");
        assert_eq!((bundle.cast, hierarchical.cast), (cellular.cast, cellular.cast));
        let over_standard = timed.ratio_of_work(6, 0) / timed.ratio_of_work(5, 0);
        assert_abs_diff_eq!(timed.ratio_of_work(6, 5) / over_standard, 1.0, epsilon = 1e-12);
        assert!(timed.ratio_of_time(6, 5) > 0.0);
    }

    #[test]
    fn a_cell_that_was_measured_with_fewer_methods_is_another_experiment() {
        let cell = Cell { others: true, ..CELL };
        let mut earlier = cell.key();
        let others = earlier.experiment.get_mut("others").unwrap();
        assert_eq!(others, "cellular hierarchical bundle");
        *others = "cellular hierarchical".to_owned();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.jsonl");
        let mut journal = Journal::open(&path).unwrap();
        journal.append(earlier, Timed { strategies: Vec::new() }).unwrap();
        assert!(journal.get(&cell.key()).is_none());
        run_missing(&mut journal, &[cell], 1, &|_, _| ()).unwrap();
        drop(journal);
        let journal = Journal::<Timed>::read(&path).unwrap();
        assert_eq!(journal.len(), 2);
        assert_eq!(journal.get(&cell.key()).unwrap().strategies.len(), names().count());
    }
}
