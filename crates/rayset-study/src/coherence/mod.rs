//! What coherence gains: `coherent` beside `standard`, in time and in work, over n, resolution and lanes.

mod report;
mod run;

pub(crate) use run::processor;

use rayset_engine::Backend;
use serde::Serialize;

use crate::Spread;

/// What is to be measured.
#[derive(Clone, Debug)]
pub struct CoherencePlan {
    /// The combinations, in the order of the run.
    pub cells: Vec<CoherenceCell>,
    /// How often each is rendered with each strategy.
    pub repetitions: usize,
}

/// One scene at one resolution, on some lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CoherenceCell {
    /// The number of spheres.
    pub spheres: u32,
    /// The side of the square image, in pixels.
    pub resolution: u32,
    /// The lanes of both strategies.
    pub backend: Backend,
}

/// What was measured, and on which machine.
#[derive(Clone, Debug, Serialize)]
pub struct Coherence {
    /// The processor: its name, family and model.
    pub processor: String,
    /// How many threads the machine runs at a time; one was used.
    pub cores: usize,
    /// How often each cell was rendered with each strategy.
    pub repetitions: usize,
    /// The cells.
    pub rows: Vec<CoherenceRow>,
}

/// A cell with what was measured.
#[derive(Clone, Debug, Serialize)]
pub struct CoherenceRow {
    /// The number of spheres.
    pub spheres: u32,
    /// The side of the square image, in pixels.
    pub resolution: u32,
    /// The lanes of both strategies.
    pub backend: String,
    /// Rows of pixels that were rendered: all, or bands spread evenly.
    pub pixel_rows: u32,
    /// Rays cast.
    pub rays: u64,
    /// Nanoseconds a ray inside the calls of `standard`.
    pub standard: Spread,
    /// The same of `coherent`.
    pub coherent: Spread,
    /// Time of `coherent` over that of `standard`, pair by pair.
    pub time: Spread,
    /// Tests of `coherent` over those of `standard`: exact.
    pub work: f64,
    /// Rays answered without a partition, in percent.
    pub percent_coherent: f64,
}

/// The numbers of spheres.
const SPHERES: [u32; 12] = [1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 4096];

/// Larger images are measured up to this number of spheres.
const MOST_SPHERES_AT_1024: u32 = 64;

impl CoherencePlan {
    /// Three resolutions and two backends: done within six minutes.
    #[must_use]
    pub fn full() -> Self {
        Self { cells: cells(&[64, 512, 1024]), repetitions: 13 }
    }

    /// The small image: done within half a minute.
    #[must_use]
    pub fn quick() -> Self {
        Self { cells: cells(&[64]), repetitions: 15 }
    }
}

fn cells(resolutions: &[u32]) -> Vec<CoherenceCell> {
    let backends = [Backend::Scalar, Backend::widest()];
    let combinations = backends.into_iter().flat_map(|backend| {
        resolutions.iter().flat_map(move |&resolution| {
            SPHERES.map(|spheres| CoherenceCell { spheres, resolution, backend })
        })
    });
    combinations.filter(|cell| cell.resolution < 1024 || cell.spheres <= MOST_SPHERES_AT_1024).collect()
}
