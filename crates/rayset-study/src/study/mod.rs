//! Studies of many experiments, with journals that a run goes on from.

mod cost;
mod counts;
mod interval;
mod journal;
mod map;
mod runner;
mod table1_explained;
mod table1_others;
mod timed;

use std::path::{Path, PathBuf};

pub(crate) use self::cost::{Fit, Fits, Prediction, fits};
pub use self::counts::{Counts, Distribution, Kinds};
pub(crate) use self::counts::{float, ratio};
pub use self::interval::Median;
pub use self::journal::{Journal, Key};
pub(crate) use self::map::{Figures, Plane, planes};
pub(crate) use self::table1_others::{OtherRow, OtherScenes};
use crate::StudyError;

/// A study by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum StudyName {
    /// Which reading of the paper, on which scenes, gives its Table 1?
    Table1Explained,
    /// Coherence, work and time over the plane of n and resolution.
    Map,
    /// Does section 3 predict times, and do counts of rays by kind?
    CostModel,
}

/// How much of a study to run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Scale {
    /// All of it: minutes.
    #[default]
    Full,
    /// Enough to see that it works: seconds. What it finds counts for the full study too, where that asks for the same.
    Quick,
    /// A few scenes of a few pixels, for tests of what reads journals.
    Tiny,
}

impl StudyName {
    /// Every study.
    pub const ALL: [Self; 3] = [Self::Table1Explained, Self::Map, Self::CostModel];

    /// The name by which commands and journals know it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Table1Explained => "table1-explained",
            Self::Map => "map",
            Self::CostModel => "cost-model",
        }
    }

    /// Its journal in a folder.
    #[must_use]
    pub fn path(self, folder: &Path) -> PathBuf {
        folder.join(format!("{}.jsonl", self.name()))
    }

    /// Runs the experiments that its journal lacks; `step` is told how many of a batch are finished, and how many there
    /// are.
    ///
    /// Studies that measure times use one thread, whatever is asked for.
    ///
    /// # Errors
    ///
    /// [`StudyError`] if the journal cannot be read or written, or another run has it open.
    pub fn run(
        self,
        folder: &Path,
        scale: Scale,
        threads: usize,
        step: &(dyn Fn(usize, usize) + Sync),
    ) -> Result<(), StudyError> {
        match self {
            Self::Table1Explained => table1_explained::run(folder, scale, threads.max(1), step),
            Self::Map => map::run(folder, scale, step),
            Self::CostModel => cost::run(folder, scale, step),
        }
    }

    /// What its journal says, as Markdown; what is not finished is left out.
    ///
    /// # Errors
    ///
    /// [`StudyError`] if the journal cannot be read.
    pub fn report(self, folder: &Path, scale: Scale) -> Result<String, StudyError> {
        match self {
            Self::Table1Explained => table1_explained::report(folder, scale),
            Self::Map => map::report(folder, scale),
            Self::CostModel => cost::report(folder, scale),
        }
    }
}
