//! What a strategy counted for a frame, as the journal keeps it.

use rayset_engine::{ByKind, Histogram, RayCounts, RayKind, Stats, Work};
use serde::{Deserialize, Serialize};

/// Rays of the four kinds: initial, reflected, refracted and shadow.
pub type Kinds = [u64; 4];

/// Exact counts of one or more frames.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Rays cast.
    pub cast: Kinds,
    /// Rays that hit; light rays that were blocked.
    pub hit: Kinds,
    /// Rays with a guide.
    pub guided: Kinds,
    /// Guided rays that missed the predicted object.
    pub missed: Kinds,
    /// Rays that pierced the cylinder.
    pub pierced: Kinds,
    /// Those that a nearer object intercepted indeed.
    pub intercepted: Kinds,
    /// Coherent rays.
    pub coherent: Kinds,
    /// Partitions.
    pub partitions: u64,
    /// Volumes classified.
    pub volumes: u64,
    /// Primitives tested.
    pub tests: u64,
    /// Pierce checks.
    pub pierce_checks: u64,
    /// Cylinders or certificates built.
    pub cylinders: u64,
    /// Members of N looked at.
    pub comparisons: u64,
}

/// A distribution of radii or lengths, in units of the scene's extent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Distribution {
    /// How many.
    pub count: u64,
    /// How many of them are infinite.
    pub infinite: u64,
    /// The lower quartile; none if infinite.
    pub lower_quartile: Option<f64>,
    /// The median; none if infinite.
    pub median: Option<f64>,
    /// The upper quartile; none if infinite.
    pub upper_quartile: Option<f64>,
}

impl Counts {
    /// Of frames whose rays and stats were added up.
    #[must_use]
    pub fn of(rays: &RayCounts, stats: &Stats) -> Self {
        let Work {
            partitions,
            volumes_classified,
            primitive_tests,
            pierce_checks,
            cylinders_built,
            radius_comparisons,
        } = stats.work;
        let coherence = &stats.coherence;
        Self {
            cast: kinds(rays, |tally| tally.cast),
            hit: kinds(rays, |tally| tally.hit),
            guided: kinds(coherence, |counts| counts.guided),
            missed: kinds(coherence, |counts| counts.predicted_missed),
            pierced: kinds(coherence, |counts| counts.pierced),
            intercepted: kinds(coherence, |counts| counts.false_coherence),
            coherent: kinds(coherence, |counts| counts.coherent),
            partitions,
            volumes: volumes_classified,
            tests: primitive_tests,
            pierce_checks,
            cylinders: cylinders_built,
            comparisons: radius_comparisons,
        }
    }

    /// [`Work::in_tests`].
    #[must_use]
    pub fn in_tests(&self) -> u64 {
        self.tests + self.volumes + 2 * self.pierce_checks + self.comparisons
    }

    /// Rays cast, of all kinds.
    #[must_use]
    pub fn rays(&self) -> u64 {
        self.cast.iter().sum()
    }

    /// Coherent rays in percent of all cast.
    #[must_use]
    pub fn percent_coherent(&self) -> f64 {
        100.0 * ratio(self.coherent.iter().sum(), self.rays())
    }
}

impl Distribution {
    /// Of a histogram.
    #[must_use]
    pub fn of(histogram: &Histogram) -> Self {
        let quantile = |fraction| histogram.quantile(fraction).filter(|value| value.is_finite());
        Self {
            count: histogram.count(),
            infinite: histogram.infinite(),
            lower_quartile: quantile(0.25),
            median: quantile(0.5),
            upper_quartile: quantile(0.75),
        }
    }
}

fn kinds<T>(by_kind: &ByKind<T>, count: impl Fn(&T) -> u64) -> Kinds {
    RayKind::ALL.map(|kind| count(&by_kind[kind]))
}

/// A part of a whole; NaN of nothing.
#[must_use]
pub(crate) fn ratio(part: u64, whole: u64) -> f64 {
    float(part) / float(whole)
}

#[expect(clippy::cast_precision_loss, reason = "counts stay far below 2^53")]
pub(crate) fn float(count: u64) -> f64 {
    count as f64
}
