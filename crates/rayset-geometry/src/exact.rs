//! Exact comparison where rounding leaves the sign in doubt.

use std::cmp::Ordering;

/// Compares the exact products `a b` and `c d`.
///
/// Rounding is monotonic, so `fl(a b) < fl(c d)` already proves `a b < c d`; only equal roundings leave the
/// order in doubt. Exact for all finite values, subnormal ones too: the mantissas are multiplied as integers.
/// Costs tens of nanoseconds; call it only in doubt.
///
/// # Panics
///
/// In debug builds, if a value is not finite.
#[must_use]
#[cold]
pub fn compare_products(a: f64, b: f64, c: f64, d: f64) -> Ordering {
    debug_assert!([a, b, c, d].iter().all(|value| value.is_finite()), "{a} * {b} <=> {c} * {d}");
    let (left, right) = (Product::of(a, b), Product::of(c, d));
    match left.sign.cmp(&right.sign) {
        Ordering::Equal if left.sign == 0 => Ordering::Equal,
        Ordering::Equal if left.sign < 0 => right.compare_magnitude(&left),
        Ordering::Equal => left.compare_magnitude(&right),
        different => different,
    }
}

/// `sign * mantissa * 2^exponent`, with the highest bit of the mantissa set unless the product is zero.
struct Product {
    sign: i32,
    mantissa: u128,
    exponent: i32,
}

impl Product {
    fn of(a: f64, b: f64) -> Self {
        let ((a_mantissa, a_exponent), (b_mantissa, b_exponent)) = (decompose(a), decompose(b));
        let product = u128::from(a_mantissa) * u128::from(b_mantissa);
        if product == 0 {
            return Self { sign: 0, mantissa: 0, exponent: 0 };
        }
        let shift = product.leading_zeros();
        let sign = if a.is_sign_negative() == b.is_sign_negative() { 1 } else { -1 };
        Self { sign, mantissa: product << shift, exponent: a_exponent + b_exponent - shift.cast_signed() }
    }

    fn compare_magnitude(&self, other: &Self) -> Ordering {
        (self.exponent, self.mantissa).cmp(&(other.exponent, other.mantissa))
    }
}

/// The mantissa and exponent of a finite number: `|value| = mantissa * 2^exponent`.
fn decompose(value: f64) -> (u64, i32) {
    let bits = value.to_bits();
    let biased = i32::from(u16::try_from(bits >> 52 & 0x7ff).expect("eleven bits"));
    let fraction = bits & ((1 << 52) - 1);
    if biased == 0 { (fraction, -1074) } else { (fraction | 1 << 52, biased - 1075) }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "the values are exact, worked out by hand")]
mod tests {
    use super::*;

    #[test]
    fn products_that_round_alike_are_told_apart() {
        let e = f64::EPSILON;
        // (1 + e)(1 - e) = 1 - e^2 rounds to 1.
        assert_eq!((1.0 + e) * (1.0 - e), 1.0);
        assert_eq!(compare_products(1.0 + e, 1.0 - e, 1.0, 1.0), Ordering::Less);
        assert_eq!(compare_products(1.0, 1.0, 1.0 + e, 1.0 - e), Ordering::Greater);
        assert_eq!(compare_products(-1.0 - e, 1.0 - e, 1.0, -1.0), Ordering::Greater);
    }

    #[test]
    fn products_below_the_smallest_number_are_told_apart() {
        let tiny = f64::from_bits(1);
        assert_eq!(compare_products(tiny, tiny, 0.0, 1.0), Ordering::Greater);
        assert_eq!(compare_products(-tiny, tiny, 0.0, 1.0), Ordering::Less);
        assert_eq!(compare_products(tiny, 3.0 * tiny, tiny, 2.0 * tiny), Ordering::Greater);
        assert_eq!(compare_products(tiny, 6.0, 2.0 * tiny, 3.0), Ordering::Equal);
    }

    #[test]
    fn zeros_of_either_sign_are_equal() {
        assert_eq!(compare_products(-0.0, 5.0, 0.0, -7.0), Ordering::Equal);
        assert_eq!(compare_products(-0.0, 5.0, 1.0, 1.0), Ordering::Less);
        assert_eq!(compare_products(0.0, 5.0, -1.0, 1.0), Ordering::Greater);
    }
}
