//! Powers of numbers, one a lane.
//!
//! Of sums, products and one quotient alone, so that every backend has the same bits; `libm` takes one number at a time.

use std::f64::consts::{LN_2, LOG2_E};

use rayset_simd::{Lanes, MAX_LANES, Simd};

/// Exponents that are whole numbers up to this are multiplied out.
const LARGEST_WHOLE: f64 = 1024.0;

/// Powers of numbers that are above zero and finite, by a finite exponent that is not negative.
///
/// By squaring where the exponent is a small whole number, as most are: each of fewer than twice as many products is off by
/// half a unit in the last place. Else as `2^y`, `y` being the exponent times the binary logarithm: off by at most
/// `4 + 2 |y|` units in the last place. What is below the least normal number becomes zero or a number below it.
#[inline(always)]
pub(crate) fn powers<S: Simd>(simd: S, base: S::F64, exponent: f64) -> S::F64 {
    if exponent > LARGEST_WHOLE || exponent.fract() != 0.0 {
        return exp2(simd, simd.splat_f64(exponent) * log2(simd, base));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole, and small")]
    let mut rest = exponent as u32;
    let (mut power, mut square) = (simd.splat_f64(1.0), base);
    while rest != 0 {
        if rest & 1 == 1 {
            power = power * square;
        }
        square = square * square;
        rest >>= 1;
    }
    power
}

/// A sum of powers of a number, by coefficients, the first that of the number's zeroth power.
#[inline(always)]
fn polynomial<S: Simd, const N: usize>(simd: S, x: S::F64, coefficients: [f64; N]) -> S::F64 {
    let mut sum = simd.splat_f64(0.0);
    for coefficient in coefficients.into_iter().rev() {
        sum = sum * x + simd.splat_f64(coefficient);
    }
    sum
}

/// Of a number to which this was added, the lowest bits are its nearest whole number: 1.5 times 2^52.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// Bits of a number's fraction.
const FRACTION: u32 = 52;

/// Binary logarithms of numbers above zero.
///
/// `log2(2^e m) = e + 2 / ln 2 * atanh((m - 1) / (m + 1))`, with `m` from the root of a half to the root of two.
#[inline(always)]
fn log2<S: Simd>(simd: S, x: S::F64) -> S::F64 {
    /// The bits of the root of a half.
    const LEAST: u64 = 0x3fe6_a09e_667f_3bcd;
    /// What the numbers are multiplied by that are not normal, and what that adds to their logarithms.
    const LARGE: f64 = (1_u64 << LIFT) as f64;
    const LIFT: u32 = 60;
    // The series of atanh z / z in z^2, which is at most 0.0295: what is left out is below 2^-56.
    const COEFFICIENTS: [f64; 11] = {
        let (mut coefficients, mut k) = ([0.0; 11], 0);
        while k < 11 {
            coefficients[k] = 2.0 * LOG2_E / (2 * k + 1) as f64;
            k += 1;
        }
        coefficients
    };

    let (zero, one) = (simd.splat_f64(0.0), simd.splat_f64(1.0));
    let is_small = x.lt(simd.splat_f64(f64::MIN_POSITIVE));
    let x = (x * simd.splat_f64(LARGE)).select(is_small, x);
    let lifted = simd.splat_f64(f64::from(LIFT)).select(is_small, zero);
    let (mut fractions, mut exponents) = ([1.0; MAX_LANES], [WHOLE; MAX_LANES]);
    x.store(&mut fractions);
    for (fraction, exponent) in fractions.iter_mut().zip(&mut exponents).take(S::F64::LANES) {
        let bits = fraction.to_bits();
        let above = bits.wrapping_sub(LEAST).cast_signed() >> FRACTION;
        *exponent = f64::from_bits(WHOLE.to_bits().wrapping_add_signed(above));
        *fraction = f64::from_bits(bits.wrapping_sub((above << FRACTION).cast_unsigned()));
    }
    let (fraction, exponent) = (simd.load_f64(&fractions), simd.load_f64(&exponents));
    let z = (fraction - one) / (fraction + one);
    let whole = exponent - simd.splat_f64(WHOLE) - lifted;
    whole + z * polynomial(simd, z * z, COEFFICIENTS)
}

/// Two to the powers of numbers.
///
/// `2^(k + f) = 2^k exp(f ln 2)`, with `f` of half at most. Below the least normal number it is zero, and from 2^1023 on
/// that.
#[inline(always)]
fn exp2<S: Simd>(simd: S, y: S::F64) -> S::F64 {
    const BIAS: u64 = 1023;
    const LEAST: f64 = -1022.0;
    const LARGEST: f64 = 1023.0;
    // The series of exp(f ln 2): what is left out is below 2^-57.
    const COEFFICIENTS: [f64; 14] = {
        let (mut coefficients, mut n) = ([1.0; 14], 1);
        while n < 14 {
            coefficients[n] = coefficients[n - 1] * LN_2 / n as f64;
            n += 1;
        }
        coefficients
    };

    let (least, largest) = (simd.splat_f64(LEAST), simd.splat_f64(LARGEST));
    let is_lost = y.lt(least);
    let y = y.max(least).min(largest);
    let whole = y + simd.splat_f64(WHOLE);
    let mut scales = [0.0; MAX_LANES];
    whole.store(&mut scales);
    for scale in scales.iter_mut().take(S::F64::LANES) {
        *scale = f64::from_bits(scale.to_bits().wrapping_add(BIAS) << FRACTION);
    }
    let rest = y - (whole - simd.splat_f64(WHOLE));
    let power = polynomial(simd, rest, COEFFICIENTS) * simd.load_f64(&scales);
    simd.splat_f64(0.0).select(is_lost, power)
}

#[cfg(test)]
mod tests {
    use approx::abs_diff_eq;
    use rayset_simd::{Backend, Kernel};

    use super::*;

    /// Of a number by several exponents.
    struct Powers<'a>(f64, &'a [f64]);

    impl Kernel for Powers<'_> {
        type Output = Vec<f64>;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Vec<f64> {
            let Self(base, exponents) = self;
            // Another number in the other lanes.
            let bases = simd.collect_f64(|lane| if lane + 1 == S::F64::LANES { base } else { 0.3 });
            exponents.iter().map(|&exponent| powers(simd, bases, exponent).lane(S::F64::LANES - 1)).collect()
        }
    }

    const EXPONENTS: [f64; 18] = [
        0.0, 1.0, 2.0, 5.0, 20.0, 63.0, 100.0, 1000.0, 1024.0, 1025.0, 1e5, 1e9, 1e300, 5e-324, 0.5, 3.0827,
        17.9, 101.148,
    ];

    fn bases() -> Vec<f64> {
        let mut bases: Vec<f64> = (1..=1000).map(|i| f64::from(i) * 1e-3).collect();
        let one = 1.0_f64;
        bases.extend([
            one.next_down(),
            one.next_up(),
            1.0 + 1e-15,
            0.5_f64.sqrt(),
            0.5_f64.sqrt().next_down(),
        ]);
        bases.extend([f64::MIN_POSITIVE, f64::MIN_POSITIVE.next_down(), 5e-324, 1e-320, 1e-100, 0.5, 0.25]);
        bases
    }

    #[test]
    fn powers_are_near_those_of_one_number_at_a_time() {
        for base in bases() {
            let found = Backend::Scalar.run(Powers(base, &EXPONENTS));
            for (found, exponent) in found.into_iter().zip(EXPONENTS) {
                let expected = libm::pow(base, exponent);
                let y = exponent * libm::log2(base);
                let units = if exponent <= LARGEST_WHOLE && exponent.fract() == 0.0 {
                    2.0 * exponent.max(1.0)
                } else {
                    4.0 + 2.0 * y.abs()
                };
                if y >= 1023.0 {
                    assert!(found > 1e307, "{base:e}^{exponent}: {found:e}");
                    continue;
                }
                let bound = units * f64::EPSILON * expected + f64::MIN_POSITIVE;
                assert!(
                    abs_diff_eq!(found, expected, epsilon = bound),
                    "{base:e}^{exponent}: {found:e}, {expected:e}"
                );
            }
        }
    }

    #[test]
    fn every_backend_has_the_same_bits() {
        for base in bases() {
            let expected = Backend::Scalar.run(Powers(base, &EXPONENTS)).into_iter().map(f64::to_bits);
            let expected: Vec<u64> = expected.collect();
            for &backend in Backend::available() {
                let found = backend.run(Powers(base, &EXPONENTS)).into_iter().map(f64::to_bits);
                assert!(found.eq(expected.iter().copied()), "{backend}, {base:e}");
            }
        }
    }
}
