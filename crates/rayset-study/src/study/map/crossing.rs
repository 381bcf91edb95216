//! Where a ratio crosses 1.

/// The range of n in which a ratio is below 1, interpolated in the logarithms of n.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wins {
    /// Where it falls below 1; the least n if it is below there.
    pub(super) from: f64,
    /// Where it rises above 1 for good; infinite if it is below 1 at the largest n.
    pub(super) to: f64,
}

impl Wins {
    /// Of points `(n, ratio)` in increasing order; `None` if the ratio is nowhere below 1.
    pub(super) fn of(points: &[(f64, f64)]) -> Option<Self> {
        let is_below = |point: &(f64, f64)| point.1 < 1.0;
        let first = points.iter().position(is_below)?;
        let last = points.iter().rposition(is_below)?;
        let from = if first == 0 { points[0].0 } else { crossing(points[first - 1], points[first]) };
        let to = points.get(last + 1).map_or(f64::INFINITY, |&next| crossing(points[last], next));
        Some(Self { from, to })
    }
}

/// Where a line through two points, over the logarithm of n, is 1.
fn crossing((n, ratio): (f64, f64), (next_n, next_ratio): (f64, f64)) -> f64 {
    (n.log2() + share(ratio, next_ratio) * (next_n.log2() - n.log2())).exp2()
}

/// Which part of the way from one ratio to the next it is to 1.
pub(super) fn share(ratio: f64, next_ratio: f64) -> f64 {
    (1.0 - ratio) / (next_ratio - ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_are_interpolated_in_logarithms() {
        let wins = Wins::of(&[(1.0, 1.5), (4.0, 0.5), (16.0, 0.9), (64.0, 1.1)]).unwrap();
        assert!((wins.from - 2.0).abs() < 1e-12 && (wins.to - 32.0).abs() < 1e-9, "{wins:?}");
    }

    #[test]
    fn a_ratio_may_win_from_the_start_for_ever_or_never() {
        assert_eq!(Wins::of(&[(2.0, 0.5), (4.0, 0.9)]), Some(Wins { from: 2.0, to: f64::INFINITY }));
        assert_eq!(Wins::of(&[(2.0, 1.5), (4.0, 1.0)]), None);
    }
}
