//! Medians and spreads of repeated measurements.

use serde::{Deserialize, Serialize};

/// The median of repeated measurements with their quartiles and extremes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// The least value.
    pub least: f64,
    /// A quarter of the values are below.
    pub lower_quartile: f64,
    /// Half of the values are below.
    pub median: f64,
    /// Three quarters of the values are below.
    pub upper_quartile: f64,
    /// The greatest value.
    pub greatest: f64,
}

impl Spread {
    /// The spread of some values; all NaN if there are none.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |quarters: usize| {
            if sorted.is_empty() {
                return f64::NAN;
            }
            // Linear between the two nearest ranks.
            let place = (sorted.len() - 1) * quarters;
            let (low, rest) = (place / 4, place % 4);
            let high = (low + 1).min(sorted.len() - 1);
            sorted[low] + (sorted[high] - sorted[low]) * [0.0, 0.25, 0.5, 0.75][rest]
        };
        Self { least: at(0), lower_quartile: at(1), median: at(2), upper_quartile: at(3), greatest: at(4) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::float_cmp, reason = "the values are exact")]
    fn quartiles_lie_between_ranks() {
        let spread = Spread::of(&[4.0, 1.0, 3.0, 2.0]);
        assert_eq!((spread.least, spread.greatest), (1.0, 4.0));
        assert_eq!((spread.lower_quartile, spread.median, spread.upper_quartile), (1.75, 2.5, 3.25));
        assert_eq!(Spread::of(&[7.0]).median, 7.0);
        assert!(Spread::of(&[]).median.is_nan());
    }
}
