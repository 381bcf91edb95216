//! Exact histograms of positive numbers.

use std::ops::AddAssign;

/// How many bins an octave is divided into.
const BINS_PER_OCTAVE: i32 = 4;

/// The exponent of the lowest bin: smaller numbers are counted there too.
const LOWEST_EXPONENT: i32 = -32;

/// The exponent above the highest bin: larger numbers are counted in it too.
const HIGHEST_EXPONENT: i32 = 32;

const N_BINS: usize = ((HIGHEST_EXPONENT - LOWEST_EXPONENT) * BINS_PER_OCTAVE) as usize;

/// Counts of positive numbers in bins of a quarter octave; a quarter is linear in its octave.
///
/// Counts are integers, so histograms of sweeps add up to the same sums in any order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Histogram {
    bins: Vec<u64>,
    infinite: u64,
    not_positive: u64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { bins: vec![0; N_BINS], infinite: 0, not_positive: 0 }
    }
}

impl Histogram {
    /// Counts a number; NaN counts as not positive.
    pub fn record(&mut self, value: f64) {
        if value == f64::INFINITY {
            self.infinite += 1;
        } else if value > 0.0 {
            self.bins[bin_of(value)] += 1;
        } else {
            self.not_positive += 1;
        }
    }

    /// How many numbers were counted.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.bins.iter().sum::<u64>() + self.infinite + self.not_positive
    }

    /// How many were infinite.
    #[must_use]
    pub fn infinite(&self) -> u64 {
        self.infinite
    }

    /// How many were zero, negative or NaN.
    #[must_use]
    pub fn not_positive(&self) -> u64 {
        self.not_positive
    }

    /// The lower edge, upper edge and count of every bin that is not empty.
    pub fn bins(&self) -> impl Iterator<Item = (f64, f64, u64)> {
        let edges = (0..N_BINS).map(|i| (lower_edge(i), lower_edge(i + 1)));
        edges.zip(&self.bins).filter(|(_, count)| **count > 0).map(|((low, high), count)| (low, high, *count))
    }

    /// The middle of the bin of the number below which a fraction of all numbers lies; `None` if there are none.
    ///
    /// Infinite numbers are the largest, those not positive the smallest, reported as zero.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "a rank within 2^53 of a count is no different")]
    pub fn quantile(&self, fraction: f64) -> Option<f64> {
        let count = self.count();
        if count == 0 {
            return None;
        }
        let rank = fraction * count as f64;
        let mut below = self.not_positive;
        if below as f64 > rank || below == count {
            return Some(0.0);
        }
        for (low, high, count) in self.bins() {
            below += count;
            if below as f64 > rank {
                return Some(f64::midpoint(low, high));
            }
        }
        match self.infinite {
            0 => self.bins().last().map(|(low, high, _)| f64::midpoint(low, high)),
            _ => Some(f64::INFINITY),
        }
    }
}

impl AddAssign<&Self> for Histogram {
    fn add_assign(&mut self, other: &Self) {
        for (bin, more) in self.bins.iter_mut().zip(&other.bins) {
            *bin += more;
        }
        self.infinite += other.infinite;
        self.not_positive += other.not_positive;
    }
}

/// The bin of a positive finite number: its exponent and the first two bits of its fraction.
fn bin_of(value: f64) -> usize {
    let bits = value.to_bits();
    let exponent =
        i32::from(u16::try_from(bits >> 52).expect("a positive number has eleven bits here")) - 1023;
    let quarter = i32::from(u8::try_from(bits >> 50 & 3).expect("two bits"));
    let bin = (exponent - LOWEST_EXPONENT) * BINS_PER_OCTAVE + quarter;
    usize::try_from(bin.max(0)).expect("not negative").min(N_BINS - 1)
}

/// The least number of bin `i`.
fn lower_edge(i: usize) -> f64 {
    let i = i32::try_from(i).expect("few bins");
    let exponent = LOWEST_EXPONENT + i / BINS_PER_OCTAVE;
    let power = f64::from_bits(u64::try_from(exponent + 1023).expect("a normal number") << 52);
    power * (1.0 + f64::from(i % BINS_PER_OCTAVE) / f64::from(BINS_PER_OCTAVE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_fall_between_the_edges_of_their_bin() {
        for value in [1.0, 1.25, 1.249_999, 0.3, 7.9, 1e-9, 4e9] {
            let bin = bin_of(value);
            assert!(lower_edge(bin) <= value && value < lower_edge(bin + 1), "{value}");
        }
        assert_eq!(bin_of(1e-300), 0);
        assert_eq!(bin_of(f64::from_bits(1)), 0);
        assert_eq!(bin_of(1e300), N_BINS - 1);
    }

    #[test]
    fn quantiles_count_from_the_smallest() {
        let mut histogram = Histogram::default();
        for value in [0.0, 1.0, 1.0, 4.0, f64::INFINITY] {
            histogram.record(value);
        }
        assert_eq!(histogram.count(), 5);
        assert_eq!(histogram.quantile(0.0), Some(0.0));
        assert_eq!(histogram.quantile(0.5), Some(1.125));
        assert_eq!(histogram.quantile(0.7), Some(4.5));
        assert_eq!(histogram.quantile(1.0), Some(f64::INFINITY));
        assert_eq!(Histogram::default().quantile(0.5), None);
    }

    #[test]
    fn histograms_add_up() {
        let (mut a, mut b, mut both) = (Histogram::default(), Histogram::default(), Histogram::default());
        for (i, value) in [0.5, 2.0, f64::NAN, f64::INFINITY, 0.5].into_iter().enumerate() {
            if i % 2 == 0 {
                a.record(value)
            } else {
                b.record(value)
            }
            both.record(value);
        }
        a += &b;
        assert_eq!(a, both);
    }
}
