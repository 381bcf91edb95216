//! A trial: one setting, one number of spheres, one seed.

use rayset_engine::{Backend, RenderOptions, Speer1985, StrategyKind, SweepLength, render};
use serde::{Deserialize, Serialize};

use super::factors::Setting;
use crate::StudyError;
use crate::study::counts::Counts;
use crate::study::runner::{Experiment, version_of_1985};

/// One setting, one number of spheres, one seed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Trial {
    pub(super) setting: Setting,
    pub(super) spheres: u32,
    pub(super) seed: u64,
}

/// What both algorithms counted, and where they differ.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Pair {
    pub(crate) standard: Counts,
    pub(crate) speer: Counts,
    /// Pixels that differ.
    pub(crate) wrong_pixels: u64,
    /// Pixels.
    pub(crate) pixels: u64,
}

impl Experiment for Trial {
    type Record = Pair;

    fn parameters(&self) -> Vec<(&'static str, String)> {
        let levels = self.setting.levels().map(|(name, level)| (name, level.to_owned()));
        levels.chain([("n", self.spheres.to_string()), ("seed", self.seed.to_string())]).collect()
    }

    fn version(&self) -> &'static str {
        version_of_1985()
    }

    fn run(&self) -> Result<Pair, StudyError> {
        let scene = self.setting.scene(self.spheres, self.seed)?;
        let side = self.setting.resolution();
        let options = RenderOptions {
            width: side,
            height: side,
            cutoff: self.setting.cutoff(),
            order: self.setting.order(),
            sweep: SweepLength::WholeImage,
            ..RenderOptions::default()
        };
        let standard = render(StrategyKind::Standard.bind_on(&scene, Backend::Scalar).as_ref(), &options)?;
        let speer = render(&Speer1985::on(&scene, Backend::Scalar, self.setting.reading()), &options)?;
        Ok(Pair {
            wrong_pixels: speer.differing_pixels(&standard) as u64,
            pixels: u64::from(side) * u64::from(side),
            standard: Counts::of(&standard.counts, &standard.stats),
            speer: Counts::of(&speer.counts, &speer.stats),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trial_gives_the_same_counts_each_time() {
        let trial = Trial { setting: Setting::default().with("resolution", "48"), spheres: 4, seed: 2 };
        let pair = trial.run().unwrap();
        assert_eq!(pair, trial.run().unwrap());
        assert_eq!((pair.pixels, pair.speer.cast[0]), (48 * 48, 48 * 48));
        assert!(pair.speer.coherent[0] > 0 && pair.standard.work.cylinders_built == 0);
    }
}
