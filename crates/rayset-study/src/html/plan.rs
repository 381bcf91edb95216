//! What a report is made from.

use std::path::PathBuf;

use crate::{Scale, Table1Plan};

/// What a report is made from, and how much is run where nothing is recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct ReportPlan {
    /// The command that makes it, as the reader would give it.
    pub command: String,
    /// The folder of the studies' journals.
    pub study: PathBuf,
    /// The folder of Table 1's results.
    pub table1: PathBuf,
    /// What to run if that folder has none.
    pub missing_table1: Table1Plan,
    /// The most seeds of Table 1 for strategies that its results lack.
    pub other_seeds: usize,
    /// How often each of their frames is rendered.
    pub other_repetitions: usize,
    /// How much of the studies is shown. What is missing of [`Scale::Quick`] and [`Scale::Tiny`] is run; of
    /// [`Scale::Full`] what is there is shown, or, where nothing is, the quick form is run.
    pub scale: Scale,
    /// The folder of fixtures, for the mesh.
    pub fixtures: PathBuf,
    /// The sides of the pictures of spheres and of the mesh, in pixels.
    pub sides: [u32; 2],
}

impl ReportPlan {
    /// Everything that is recorded, in the folders of a command.
    #[must_use]
    pub fn full(command: String, study: PathBuf, table1: PathBuf, fixtures: PathBuf) -> Self {
        Self {
            command,
            study,
            table1,
            missing_table1: Table1Plan::quick(fixtures.clone()),
            other_seeds: usize::MAX,
            other_repetitions: 3,
            scale: Scale::Full,
            fixtures,
            sides: [480, 360],
        }
    }

    /// Small pictures, and the quick forms of the studies.
    #[must_use]
    pub fn quick(command: String, study: PathBuf, table1: PathBuf, fixtures: PathBuf) -> Self {
        Self {
            other_seeds: 4,
            other_repetitions: 1,
            scale: Scale::Quick,
            sides: [240, 160],
            ..Self::full(command, study, table1, fixtures)
        }
    }

    /// The least that has every part, for tests: seconds.
    #[must_use]
    pub fn tiny(command: String, study: PathBuf, table1: PathBuf, fixtures: PathBuf) -> Self {
        Self {
            missing_table1: Table1Plan {
                spheres: vec![1, 2, 4, 8],
                seeds: vec![1, 2],
                repetitions: 1,
                resolution: 24,
                mesh_resolutions: [12, 0, 0, 0],
                mesh_repetitions: 1,
                ..Table1Plan::quick(fixtures.clone())
            },
            scale: Scale::Tiny,
            sides: [48, 24],
            ..Self::quick(command, study, table1, fixtures)
        }
    }
}
