//! What to run.

use std::path::PathBuf;

use rayset_engine::{Backend, MissRule, RenderOptions, Speer1985Options, StrategyKind, SweepLength};

use crate::Preset;

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
    /// The sides of the images of the mesh scenes, in the order of [`mesh_scenes`](crate::mesh_scenes); zero leaves a
    /// scene out.
    pub mesh_resolutions: [u32; 4],
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
    /// The exact strategies that take their turns on the same scenes.
    pub exact: Vec<StrategyKind>,
    /// Settings with scenes and images of their own; of what is above, they take the numbers of spheres, the seeds, the
    /// repetitions of spheres, and the lanes.
    pub presets: Vec<Preset>,
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
            mesh_resolutions: [384, 160, 96, 96],
            mesh_repetitions: 5,
            fixtures,
            backend: Backend::Scalar,
            max_depth: RenderOptions::default().max_depth,
            cutoff: RenderOptions::default().cutoff,
            readings: vec![Reading::literal(), Reading::with_misses()],
            exact: vec![StrategyKind::Coherent, StrategyKind::Hierarchical, StrategyKind::Bundle],
            presets: vec![Preset::nearest()],
        }
    }

    /// A run of less than a minute, to see that all is well.
    #[must_use]
    pub fn quick(fixtures: PathBuf) -> Self {
        Self {
            seeds: (1..=4).collect(),
            repetitions: 3,
            resolution: 192,
            mesh_resolutions: [128, 64, 40, 40],
            mesh_repetitions: 3,
            ..Self::full(fixtures)
        }
    }

    /// How many steps a run has, for a progress bar.
    #[must_use]
    pub fn n_steps(&self) -> usize {
        let meshes = self.mesh_resolutions.iter().filter(|&&side| side > 0).count();
        let spheres = (1 + self.presets.len()) * self.spheres.len() * self.seeds.len();
        spheres * (self.repetitions + 1) + meshes * (self.mesh_repetitions + 1)
    }

    pub(super) fn options(&self, side: u32) -> RenderOptions {
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
