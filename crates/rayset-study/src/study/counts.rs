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
    /// Rays answered together with others: under the shaft of a packet or a tile, or by what blocked others; not written
    /// where there are none, as in older journals.
    #[serde(default, skip_serializing_if = "are_none")]
    pub under_shafts: Kinds,
    /// The work.
    #[serde(flatten, with = "journal_work")]
    pub work: Work,
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
        let coherence = &stats.coherence;
        Self {
            cast: kinds(rays, |tally| tally.cast),
            hit: kinds(rays, |tally| tally.hit),
            guided: kinds(coherence, |counts| counts.guided),
            missed: kinds(coherence, |counts| counts.predicted_missed),
            pierced: kinds(coherence, |counts| counts.pierced),
            intercepted: kinds(coherence, |counts| counts.false_coherence),
            coherent: kinds(coherence, |counts| counts.coherent),
            under_shafts: kinds(&stats.stages, |counts| counts.together()),
            work: stats.work,
        }
    }

    /// [`Work::in_tests`].
    #[must_use]
    pub fn in_tests(&self) -> u64 {
        self.work.in_tests()
    }

    /// Rays cast, of all kinds.
    #[must_use]
    pub fn rays(&self) -> u64 {
        self.cast.iter().sum()
    }

    /// Coherent rays and those answered under shafts; a strategy has one or the other.
    #[must_use]
    pub fn coherent_rays(&self) -> u64 {
        self.coherent.iter().chain(&self.under_shafts).sum()
    }

    /// The same in percent of all rays cast.
    #[must_use]
    pub fn percent_coherent(&self) -> f64 {
        100.0 * ratio(self.coherent_rays(), self.rays())
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

fn are_none(rays: &Kinds) -> bool {
    rays.iter().all(|&count| count == 0)
}

fn kinds<T>(by_kind: &ByKind<T>, count: impl Fn(&T) -> u64) -> Kinds {
    RayKind::ALL.map(|kind| count(&by_kind[kind]))
}

/// Work as the journal has it: a key for each count, some with shorter names than [`Work::counts`] gives them.
///
/// A count that a journal lacks is zero. Only a count that every journal has is written where it is zero: so journals
/// from before a count was added still hold the same experiments.
mod journal_work {
    use std::collections::BTreeMap;

    use rayset_engine::Work;
    use serde::{Deserialize, Deserializer, Serializer};

    /// Counts that are as old as the journal.
    const ALWAYS: usize = 6;

    fn key(name: &str) -> &str {
        match name {
            "volumes_classified" => "volumes",
            "primitive_tests" => "tests",
            "cylinders_built" => "cylinders",
            "radius_comparisons" => "comparisons",
            name => name,
        }
    }

    pub(super) fn serialize<S: Serializer>(work: &Work, serializer: S) -> Result<S::Ok, S::Error> {
        let counts = work.counts().enumerate().filter(|&(i, (_, count))| i < ALWAYS || count > 0);
        serializer.collect_map(counts.map(|(_, (name, count))| (key(name), count)))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Work, D::Error> {
        let counts = BTreeMap::<String, u64>::deserialize(deserializer)?;
        let mut work = Work::default();
        for (name, count) in work.counts_mut() {
            *count = counts.get(key(name)).copied().unwrap_or(0);
        }
        Ok(work)
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn journals_from_before_cells_and_shafts_were_counted_hold_the_same_counts() {
        let work = Work {
            partitions: 1,
            volumes_classified: 2,
            primitive_tests: 3,
            pierce_checks: 4,
            cylinders_built: 5,
            radius_comparisons: 0,
            cells_visited: 0,
            boxes_tested: 0,
        };
        let counts = Counts { cast: [1, 2, 3, 4], work, ..Counts::default() };
        let kinds = r#""hit":[0,0,0,0],"guided":[0,0,0,0],"missed":[0,0,0,0],"pierced":[0,0,0,0]"#;
        let line = format!(
            r#"{{"cast":[1,2,3,4],{kinds},"intercepted":[0,0,0,0],"coherent":[0,0,0,0],{}}}"#,
            r#""partitions":1,"volumes":2,"tests":3,"pierce_checks":4,"cylinders":5,"comparisons":0"#
        );
        assert_eq!(serde_json::to_string(&counts).unwrap(), line);
        assert_eq!(serde_json::from_str::<Counts>(&line).unwrap(), counts);
        let cells = Counts { work: Work { cells_visited: 6, ..work }, ..counts };
        let text = serde_json::to_string(&cells).unwrap();
        assert!(text.ends_with(r#""comparisons":0,"cells_visited":6}"#), "{text}");
        assert_eq!(serde_json::from_str::<Counts>(&text).unwrap(), cells);
        let shafts = Counts { under_shafts: [0, 1, 2, 3], ..cells };
        let text = serde_json::to_string(&shafts).unwrap();
        assert!(text.contains(r#""under_shafts":[0,1,2,3],"partitions""#), "{text}");
        assert_eq!(serde_json::from_str::<Counts>(&text).unwrap(), shafts);
        assert_abs_diff_eq!(shafts.percent_coherent(), 60.0, epsilon = 1e-12);
    }
}
