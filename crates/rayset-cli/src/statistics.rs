//! What a render took, as JSON: `docs/statistics.md` describes every field.

use std::time::Duration;

use rayset::engine::{Frame, RayKind, StageCounts, Work};
use serde::{Serialize, Serializer};
use sha2::{Digest, Sha256};

use crate::audit::Audit;

/// The statistics of one render.
#[derive(Debug, Serialize)]
pub(crate) struct Statistics {
    pub(crate) scene: String,
    pub(crate) strategy: &'static str,
    pub(crate) resolution: [u32; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) crop: Option<[u32; 4]>,
    pub(crate) threads: usize,
    pub(crate) simd: &'static str,
    pub(crate) seconds: Seconds,
    pub(crate) rays: Rays,
    pub(crate) work: WorkCounts,
    pub(crate) image_bits: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) audit: Option<Audit>,
}

/// Durations in seconds.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Seconds {
    pub(crate) load: f64,
    pub(crate) prepare: f64,
    pub(crate) trace: f64,
    pub(crate) strategy: f64,
    pub(crate) write: f64,
}

#[derive(Debug, Serialize)]
pub(crate) struct Rays {
    initial: RayStatistics,
    reflected: RayStatistics,
    refracted: RayStatistics,
    shadow: RayStatistics,
}

#[derive(Debug, Serialize)]
struct RayStatistics {
    cast: u64,
    hit: u64,
    coherent: u64,
    /// Of strategies that trace bundles in stages.
    #[serde(skip_serializing_if = "Option::is_none")]
    stages: Option<Stages>,
}

#[derive(Debug, Serialize)]
struct Stages {
    tiles: u64,
    packets: u64,
    blockers: u64,
    alone: u64,
}

/// [`Work`] as an object with a key for each count.
#[derive(Debug)]
pub(crate) struct WorkCounts(Work);

impl Rays {
    pub(crate) fn of(frame: &Frame) -> Self {
        let of = |kind: RayKind| {
            let stages = frame.stats.stages[kind];
            RayStatistics {
                cast: frame.counts[kind].cast,
                hit: frame.counts[kind].hit,
                coherent: frame.stats.coherence[kind].coherent,
                stages: (stages != StageCounts::default()).then_some(Stages {
                    tiles: stages.tiles,
                    packets: stages.packets,
                    blockers: stages.blockers,
                    alone: stages.alone,
                }),
            }
        };
        Self {
            initial: of(RayKind::Initial),
            reflected: of(RayKind::Reflected),
            refracted: of(RayKind::Refracted),
            shadow: of(RayKind::Shadow),
        }
    }
}

impl From<Work> for WorkCounts {
    fn from(work: Work) -> Self {
        Self(work)
    }
}

impl Serialize for WorkCounts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.counts())
    }
}

/// SHA-256 of the colours: `f32`, little-endian, red, green and blue of each pixel, rows from the top.
pub(crate) fn image_bits(frame: &Frame) -> String {
    let mut hash = Sha256::new();
    let [red, green, blue] = &frame.beauty;
    for ((red, green), blue) in red.iter().zip(green).zip(blue) {
        for sample in [red, green, blue] {
            hash.update(sample.to_le_bytes());
        }
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Seconds of a duration.
pub(crate) fn seconds(duration: Duration) -> f64 {
    duration.as_secs_f64()
}
