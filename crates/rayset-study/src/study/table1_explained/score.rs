//! How near a setting comes to the paper.

use std::cmp::Ordering;

use super::factors::Setting;
use crate::measures::{Near, POINTS, RATIO};
use crate::study::counts::ratio;
use crate::{Cost, Counting, Median, PAPER, Pair};

/// The trials of a setting: for each row of the paper, one for every seed.
#[derive(Clone, Debug)]
pub(crate) struct Tried {
    pub(crate) setting: Setting,
    pub(crate) rows: [Vec<Pair>; 4],
}

/// A setting with the measures in which it comes nearest.
#[derive(Clone, Debug)]
pub(crate) struct Score {
    pub(crate) setting: Setting,
    /// The meaning of the percentage in which it is nearest.
    pub(crate) coherence: Near<Counting>,
    /// In each of [`Cost::FIXED`].
    pub(crate) fixed: [Near<Cost>; 2],
    /// The measure of the grid in which it is nearest.
    pub(crate) fitted: Near<Cost>,
    /// Times of the standard algorithm over that for one sphere, in the fitted measure: the paper's are 1.95, 4.77, 12.0.
    pub(crate) growth: [f64; 3],
    /// Wrong pixels, as a fraction, in the worst row.
    pub(crate) wrong: f64,
}

impl Score {
    pub(crate) fn of(tried: &Tried) -> Option<Self> {
        let reading = tried.setting.conditions().reading;
        let coherence = Counting::all().filter_map(|counting| counting.near(&reading, &tried.rows));
        let fitted = Cost::grid().filter_map(|cost| cost.near(&tried.rows)).min_by(least)?;
        let fixed = |i: usize| Cost::FIXED[i].near(&tried.rows);
        let worst = |row: &Vec<Pair>| {
            let (wrong, all) =
                row.iter().fold((0, 0), |(a, b), pair| (a + pair.wrong_pixels, b + pair.pixels));
            ratio(wrong, all)
        };
        Some(Self {
            setting: tried.setting,
            coherence: coherence.min_by(least)?,
            fixed: [fixed(0)?, fixed(1)?],
            growth: growth(tried, &fitted.measure),
            fitted,
            wrong: tried.rows.iter().map(worst).fold(0.0, f64::max),
        })
    }

    /// The greater of both distances, in units of what is allowed, with the fitted measure.
    pub(crate) fn joint(&self) -> f64 {
        (self.coherence.error / POINTS).max(self.fitted.error / RATIO)
    }

    /// The same with the better of the fixed measures.
    pub(crate) fn joint_fixed(&self) -> f64 {
        (self.coherence.error / POINTS).max(self.fixed_error() / RATIO)
    }

    /// The distances of other trials of the same setting, in the same counting and the same fitted measure.
    pub(crate) fn on_others(&self, tried: &Tried) -> Option<(f64, f64)> {
        let reading = self.setting.conditions().reading;
        let points = self.coherence.measure.near(&reading, &tried.rows)?.error;
        Some((points, self.fitted.measure.near(&tried.rows)?.error))
    }

    /// The greatest error of growth, as a fraction of the paper's.
    pub(crate) fn growth_error(&self) -> f64 {
        let paper = [1, 2, 3].map(|row: usize| PAPER[row].hours_standard / PAPER[0].hours_standard);
        self.growth.iter().zip(paper).map(|(ours, paper)| (ours / paper - 1.0).abs()).fold(0.0, f64::max)
    }

    /// The distance in the better of the fixed measures.
    pub(crate) fn fixed_error(&self) -> f64 {
        self.fixed[0].error.min(self.fixed[1].error)
    }
}

fn least<M>(a: &Near<M>, b: &Near<M>) -> Ordering {
    a.error.total_cmp(&b.error)
}

fn growth(tried: &Tried, cost: &Cost) -> [f64; 3] {
    let standard = |row: usize| {
        let costs: Vec<_> = tried.rows[row].iter().map(|pair| cost.of(&pair.standard)).collect();
        Median::of(&costs).value
    };
    [1, 2, 3].map(|row| standard(row) / standard(0))
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use rayset_engine::Work;

    use super::*;
    use crate::Counts;

    /// One seed whose counts are the paper's own figures.
    fn like_the_paper() -> Tried {
        let rows = PAPER.map(|row| {
            let thousandth =
                |value: f64| serde_json::from_str::<u64>(&format!("{:.0}", value * 1000.0)).unwrap();
            let of = |primitive_tests| Work { primitive_tests, ..Work::default() };
            let standard = Counts { cast: [100_000, 0, 0, 0], work: of(1_000_000), ..Counts::default() };
            let coherent = [thousandth(row.percent_coherent), 0, 0, 0];
            let speer =
                Counts { coherent, work: of(1000 * thousandth(row.ratio_recomputed)), ..standard.clone() };
            vec![Pair { standard, speer, wrong_pixels: 1, pixels: 100 }]
        });
        Tried { setting: Setting::default(), rows }
    }

    #[test]
    fn the_papers_own_figures_are_near() {
        let score = Score::of(&like_the_paper()).unwrap();
        assert!(score.coherence.error < 1e-9 && score.fixed_error() < 1e-3, "{score:?}");
        assert!(score.joint() <= score.joint_fixed() && score.joint_fixed() < 0.02);
        assert_abs_diff_eq!(score.wrong, 0.01, epsilon = 1e-12);
        let (points, ratio) = score.on_others(&like_the_paper()).unwrap();
        assert!(points < 1e-9 && ratio < 1e-3);
        // One cost for all numbers of spheres does not grow at all: twelve times too little.
        assert_abs_diff_eq!(score.growth_error(), 1.0 - 0.283 / 3.396, epsilon = 1e-9);
    }

    #[test]
    fn one_row_that_is_off_is_the_error() {
        let mut tried = like_the_paper();
        tried.rows[2][0].speer.coherent[0] -= 20_000;
        let score = Score::of(&tried).unwrap();
        assert_abs_diff_eq!(score.coherence.error, 20.0, epsilon = 1e-9);
    }
}
