//! Medians over seeds, with intervals that assume nothing about the distribution.

use std::fmt;

/// The median of a sample, and an interval that holds the median of what it was drawn from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Median {
    /// The median.
    pub value: f64,
    /// The lower end of the interval.
    pub low: f64,
    /// The upper end.
    pub high: f64,
    /// With which probability the interval holds it: 0.9 or more, if there are five values or more.
    pub confidence: f64,
}

impl Median {
    /// Of some values; all NaN if there are none.
    ///
    /// The interval lies between order statistics: `values[j]` is above the median of the distribution when at most `j`
    /// values are below it, which has the probability of at most `j` heads in so many tosses. The innermost interval of
    /// 0.9 is taken, or the extremes where that cannot be had.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let count = sorted.len();
        if count == 0 {
            return Self { value: f64::NAN, low: f64::NAN, high: f64::NAN, confidence: 0.0 };
        }
        let value = f64::midpoint(sorted[(count - 1) / 2], sorted[count / 2]);
        let (mut rank, mut confidence) = (0, 1.0 - 2.0 * at_most(0, count));
        for j in 1..count / 2 {
            let inner = 1.0 - 2.0 * at_most(j, count);
            if inner < 0.9 {
                break;
            }
            (rank, confidence) = (j, inner);
        }
        Self { value, low: sorted[rank], high: sorted[count - 1 - rank], confidence: confidence.max(0.0) }
    }
}

/// The probability of at most `j` heads in `count` tosses.
fn at_most(j: usize, count: usize) -> f64 {
    // Term by term, each from the one before: (count choose i) / 2^count.
    let mut term = 1.0;
    for _ in 0..count {
        term *= 0.5;
    }
    let mut sum = 0.0;
    for i in 0..=j {
        sum += term;
        term *= small(count - i) / small(i + 1);
    }
    sum
}

fn small(count: usize) -> f64 {
    f64::from(u32::try_from(count).expect("a sample has fewer than 2^32 values"))
}

/// With three digits; the interval in brackets.
impl fmt::Display for Median {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} ({:.3} to {:.3})", self.value, self.low, self.high)
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "the values are exact")]
mod tests {
    use super::*;
    use approx::abs_diff_eq;

    #[test]
    fn tosses_add_up() {
        assert_eq!(at_most(0, 3), 0.125);
        assert_eq!(at_most(1, 3), 0.5);
        assert_eq!(at_most(3, 3), 1.0);
    }

    #[test]
    fn five_values_give_their_extremes() {
        let median = Median::of(&[5.0, 1.0, 4.0, 2.0, 3.0]);
        assert_eq!((median.value, median.low, median.high, median.confidence), (3.0, 1.0, 5.0, 0.9375));
    }

    #[test]
    fn eight_values_give_the_second_and_the_seventh() {
        let values: Vec<f64> = (1..=8).map(f64::from).collect();
        let median = Median::of(&values);
        assert_eq!((median.value, median.low, median.high), (4.5, 2.0, 7.0));
        assert!(abs_diff_eq!(median.confidence, 0.9297, epsilon = 1e-4), "{median:?}");
    }

    #[test]
    fn one_value_has_no_confidence_and_none_no_median() {
        assert_eq!(Median::of(&[7.0]), Median { value: 7.0, low: 7.0, high: 7.0, confidence: 0.0 });
        assert!(Median::of(&[]).value.is_nan());
    }

    #[test]
    fn intervals_hold_the_median_as_often_as_they_say() {
        // A sequence that fills the unit interval evenly stands for the uniform distribution, whose median is 1/2.
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f64::from(u32::try_from(state >> 32).unwrap()) / f64::from(u32::MAX)
        };
        let n_held = (0..4000)
            .filter(|_| {
                let median = Median::of(&[(); 8].map(|()| next()));
                (median.low..=median.high).contains(&0.5)
            })
            .count();
        assert!((3600..3850).contains(&n_held), "{n_held}");
    }
}
