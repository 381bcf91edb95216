//! A trial: one setting, one number of spheres, one seed.

use super::factors::Setting;
use crate::study::runner::{Experiment, version_of_1985};
use crate::{Pair, StudyError};

/// One setting, one number of spheres, one seed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Trial {
    pub(super) setting: Setting,
    pub(super) spheres: u32,
    pub(super) seed: u64,
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
        self.setting.conditions().pair(self.spheres, self.seed)
    }
}
