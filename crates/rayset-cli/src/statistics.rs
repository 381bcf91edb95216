//! What a render took, as JSON: `docs/statistics.md` describes every field.

use std::time::Duration;

use rayset::engine::{Frame, RayKind, Work};
use serde::Serialize;
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
}

#[derive(Debug, Serialize)]
pub(crate) struct WorkCounts {
    partitions: u64,
    volumes_classified: u64,
    primitive_tests: u64,
    pierce_checks: u64,
    cylinders_built: u64,
    radius_comparisons: u64,
}

impl Rays {
    pub(crate) fn of(frame: &Frame) -> Self {
        let of = |kind: RayKind| RayStatistics {
            cast: frame.counts[kind].cast,
            hit: frame.counts[kind].hit,
            coherent: frame.stats.coherence[kind].coherent,
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
        let Work {
            partitions,
            volumes_classified,
            primitive_tests,
            pierce_checks,
            cylinders_built,
            radius_comparisons,
        } = work;
        Self {
            partitions,
            volumes_classified,
            primitive_tests,
            pierce_checks,
            cylinders_built,
            radius_comparisons,
        }
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
