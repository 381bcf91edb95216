//! What a percentage can mean, and what work can cost.

use std::fmt;

use rayset_engine::{LightRule, MissRule, Speer1985Options};
use serde::Serialize;

use crate::study::{float, ratio};
use crate::{Counts, Median, PAPER, Pair};

/// How far a percentage may be off, in points.
pub(crate) const POINTS: f64 = 5.0;

/// How far a ratio may be off.
pub(crate) const RATIO: f64 = 0.05;

/// Which kinds of rays the percentage is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// Initial rays.
    Initial,
    /// Initial, reflected and refracted rays.
    WithoutLight,
    /// Light rays too.
    All,
}

/// Which of those are counted as rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Among {
    /// All that are cast.
    Cast,
    /// Those that hit something; only where misses and unblocked light rays leave no cylinder, or coherent hits and
    /// misses could not be told apart.
    Hits,
    /// Those with a corresponding ray that has a cylinder.
    Guided,
}

/// Four figures, one a row of the paper, and the greatest distance from the paper's.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Near<M> {
    pub(crate) measure: M,
    pub(crate) rows: [Median; 4],
    pub(crate) error: f64,
}

/// What "percent rays coherent" counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counting {
    /// The kinds.
    pub which: Which,
    /// Those of them that are the whole.
    pub among: Among,
}

impl Counting {
    /// Every meaning that is tried.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        let whiches = [Which::All, Which::WithoutLight, Which::Initial];
        whiches
            .into_iter()
            .flat_map(|which| [Among::Cast, Among::Hits, Among::Guided].map(|among| Self { which, among }))
    }

    /// Coherent rays of all rays cast.
    pub const ALL_CAST: Self = Self { which: Which::All, among: Among::Cast };

    /// The percentage; `None` where it cannot be told or there is no ray.
    #[must_use]
    pub fn percent(self, counts: &Counts, reading: &Speer1985Options) -> Option<f64> {
        let has_unblocked = self.which == Which::All && reading.light_rays == LightRule::All;
        let kinds = match self.which {
            Which::Initial => 0..1,
            Which::WithoutLight => 0..3,
            Which::All => 0..4,
        };
        let whole = match self.among {
            Among::Cast => &counts.cast,
            Among::Hits if reading.misses == MissRule::Cylinder || has_unblocked => return None,
            Among::Hits => &counts.hit,
            Among::Guided => &counts.guided,
        };
        let whole: u64 = whole[kinds.clone()].iter().sum();
        (whole > 0).then(|| 100.0 * ratio(counts.coherent[kinds].iter().sum(), whole))
    }
}

impl Counting {
    /// The percentages beside the paper's, medians over seeds; `None` where a row has none.
    pub(crate) fn near(self, reading: &Speer1985Options, rows: &[Vec<Pair>; 4]) -> Option<Near<Self>> {
        // A seed whose sphere is not seen has no such ray.
        let median = |pairs: &Vec<Pair>| {
            let percents: Vec<_> =
                pairs.iter().filter_map(|pair| self.percent(&pair.speer, reading)).collect();
            Median::of(&percents)
        };
        near(self, rows.each_ref().map(median), PAPER.map(|row| row.percent_coherent))
    }
}

impl fmt::Display for Counting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let which = match self.which {
            Which::Initial => "initial rays",
            Which::WithoutLight => "rays but light rays",
            Which::All => "all rays",
        };
        let among = match self.among {
            Among::Cast => "",
            Among::Hits => " that hit",
            Among::Guided => " with a guide",
        };
        write!(f, "{which}{among}")
    }
}

/// What work costs, in tests of one primitive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// Of classifying a volume: the paper's k.
    pub k: f64,
    /// Of looking at a member of N for the radius, over `k`.
    pub lambda_over_k: f64,
    /// Of a pierce check: 2 in the paper.
    pub pierce: f64,
    /// Of a ray besides, in both algorithms: the paper's alpha.
    pub alpha: f64,
}

impl Cost {
    /// `Work::in_tests`: every test and comparison the same, two for a pierce check.
    pub const TESTS: Self = Self { k: 1.0, lambda_over_k: 1.0, pierce: 2.0, alpha: 0.0 };
    /// The same with the paper's own lambda, from its last row.
    pub const PAPER_LAMBDA: Self = Self { lambda_over_k: PAPER_LAMBDA, ..Self::TESTS };

    /// The measures that are fixed beforehand.
    pub(crate) const FIXED: [Self; 2] = [Self::TESTS, Self::PAPER_LAMBDA];

    /// The measures of the search: a pierce check costs the paper's two tests; `k`, lambda and alpha are free.
    pub(crate) fn grid() -> impl Iterator<Item = Self> {
        let lambdas = [0.25, 0.5, 1.0, 1.5, PAPER_LAMBDA, 2.5, 3.0, 4.0];
        let alphas = [0.0, 1.0, 2.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0];
        [0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0].into_iter().flat_map(move |k| {
            lambdas.into_iter().flat_map(move |lambda_over_k| {
                alphas.map(|alpha| Self { k, lambda_over_k, pierce: 2.0, alpha })
            })
        })
    }

    /// The cost of a frame.
    #[must_use]
    pub fn of(&self, counts: &Counts) -> f64 {
        let work = &counts.work;
        float(work.primitive_tests)
            + self.k * (float(work.volumes_classified) + self.lambda_over_k * float(work.radius_comparisons))
            + self.pierce * float(work.pierce_checks)
            + self.alpha * float(counts.rays())
    }

    /// Coherent over standard.
    #[must_use]
    pub fn ratio(&self, pair: &Pair) -> f64 {
        self.of(&pair.speer) / self.of(&pair.standard)
    }
}

impl Cost {
    /// The ratios beside the paper's, medians over seeds; `None` where a row has none.
    pub(crate) fn near(self, rows: &[Vec<Pair>; 4]) -> Option<Near<Self>> {
        let median = |pairs: &Vec<Pair>| {
            let ratios: Vec<_> = pairs.iter().map(|pair| self.ratio(pair)).collect();
            Median::of(&ratios)
        };
        near(self, rows.each_ref().map(median), PAPER.map(|row| row.ratio_recomputed))
    }
}

fn near<M>(measure: M, rows: [Median; 4], paper: [f64; 4]) -> Option<Near<M>> {
    let errors = rows.iter().zip(paper).map(|(row, paper)| (row.value - paper).abs());
    let error = errors.fold(0.0, |worst, error| if error.is_nan() || worst > error { worst } else { error });
    rows.iter().all(|row| row.value.is_finite()).then_some(Near { measure, rows, error })
}

/// lambda / k when the paper's last row is the threshold: 1 / 0.511.
const PAPER_LAMBDA: f64 = 0.662 / 0.338;

impl fmt::Display for Cost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { k, lambda_over_k, pierce, alpha } = self;
        write!(f, "k = {k}, lambda = {lambda_over_k:.2} k, pierce check {pierce}, alpha = {alpha}")
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use rayset_engine::Work;

    use super::*;

    fn counts() -> Counts {
        Counts {
            cast: [10, 4, 2, 8],
            hit: [6, 2, 2, 4],
            guided: [5, 1, 1, 2],
            coherent: [4, 1, 0, 2],
            work: Work {
                volumes_classified: 100,
                primitive_tests: 30,
                pierce_checks: 5,
                radius_comparisons: 40,
                ..Work::default()
            },
            ..Counts::default()
        }
    }

    #[test]
    fn percentages_are_of_the_rays_named() {
        let percent = |which, among| {
            Counting { which, among }.percent(&counts(), &Speer1985Options::default()).unwrap()
        };
        let close = |a: f64, b: f64| assert_abs_diff_eq!(a, b, epsilon = 1e-9);
        close(percent(Which::Initial, Among::Cast), 40.0);
        close(percent(Which::Initial, Among::Hits), 400.0 / 6.0);
        close(percent(Which::WithoutLight, Among::Cast), 500.0 / 16.0);
        close(percent(Which::All, Among::Guided), 700.0 / 9.0);
        for (option, choice) in [("misses", "cylinder"), ("light_rays", "all")] {
            let mut reading = Speer1985Options::default();
            reading.choose(option, choice).unwrap();
            assert_eq!(Counting { which: Which::All, among: Among::Hits }.percent(&counts(), &reading), None);
        }
        assert_eq!(Counting::all().count(), 9);
    }

    #[test]
    fn the_first_measure_is_that_of_the_engine() {
        let counts = counts();
        assert_abs_diff_eq!(Cost::TESTS.of(&counts), float(counts.in_tests()), epsilon = 1e-9);
        let cost = Cost { k: 2.0, lambda_over_k: 0.5, pierce: 3.0, alpha: 1.0 };
        assert_abs_diff_eq!(cost.of(&counts), 30.0 + 2.0 * 120.0 + 15.0 + 24.0, epsilon = 1e-9);
    }

    #[test]
    fn the_fixed_measures_are_in_the_grid() {
        assert!(Cost::FIXED.iter().all(|fixed| Cost::grid().any(|cost| cost == *fixed)));
    }
}
