//! Vectors, one a lane.

use glam::DVec3;
use rayset_simd::{LaneMask, Lanes, MAX_LANES, Part, Simd};

use crate::ray::{UNIT_RANGE, unit};

/// Dot products of vectors, a pair a lane, in the order of operations of [`DVec3::dot`].
#[must_use]
#[inline(always)]
pub fn dot_lanes<L: Lanes>([ax, ay, az]: [L; 3], [bx, by, bz]: [L; 3]) -> L {
    ax * bx + ay * by + az * bz
}

/// Vectors scaled to unit length, one a lane, with the bits of [`unit`](crate::unit()), and how long they were; what has
/// no direction becomes zero.
#[must_use]
#[inline(always)]
pub fn unit_lanes<S: Simd>(simd: S, [x, y, z]: [S::F64; 3]) -> ([S::F64; 3], S::F64) {
    let (least, most) = (simd.splat_f64(UNIT_RANGE.start), simd.splat_f64(UNIT_RANGE.end));
    let squared = dot_lanes([x, y, z], [x, y, z]);
    let length = squared.sqrt();
    let scaled = [x / length, y / length, z / length];
    let others = !(squared.ge(least) & squared.lt(most));
    if others.any() {
        return (simd.outline(UnitOneByOne { vectors: [x, y, z], scaled, others: others.bits() }), length);
    }
    (scaled, length)
}

/// Scales those of some lanes one by one.
struct UnitOneByOne<S: Simd> {
    vectors: [S::F64; 3],
    scaled: [S::F64; 3],
    others: u32,
}

impl<S: Simd> Part<S> for UnitOneByOne<S> {
    type Output = [S::F64; 3];

    #[inline(always)]
    fn run(self, simd: S) -> [S::F64; 3] {
        let Self { vectors: [x, y, z], scaled, mut others } = self;
        let mut stored = [[0.0; MAX_LANES]; 3];
        for (lanes, stored) in scaled.into_iter().zip(&mut stored) {
            lanes.store(stored);
        }
        while others != 0 {
            let i = others.trailing_zeros() as usize;
            others &= others - 1;
            let vector = unit(DVec3::new(x.lane(i), y.lane(i), z.lane(i))).unwrap_or(DVec3::ZERO);
            for (stored, coordinate) in stored.iter_mut().zip(vector.to_array()) {
                stored[i] = coordinate;
            }
        }
        [simd.load_f64(&stored[0]), simd.load_f64(&stored[1]), simd.load_f64(&stored[2])]
    }
}

#[cfg(test)]
mod tests {
    use rayset_simd::{Backend, Kernel};

    use super::*;

    /// Vectors and their lengths, scaled several at a time.
    struct Units<'a>(&'a [DVec3]);

    impl Kernel for Units<'_> {
        type Output = Vec<(DVec3, f64)>;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Self::Output {
            let mut units = Vec::new();
            for vectors in self.0.chunks(S::F64::LANES) {
                let column = |k: usize| simd.collect_f64(|lane| vectors[lane % vectors.len()][k]);
                let ([x, y, z], length) = unit_lanes(simd, [column(0), column(1), column(2)]);
                let of_lane =
                    |lane| (DVec3::new(x.lane(lane), y.lane(lane), z.lane(lane)), length.lane(lane));
                units.extend((0..vectors.len()).map(of_lane));
            }
            units
        }
    }

    #[test]
    fn lanes_have_the_bits_of_one_vector_at_a_time_on_every_backend() {
        let mut all = Vec::new();
        for scale in [1.0, 1e-3, 1e-99, 1e-100, 1e-101, 1e99, 1e100, 1e101, 1e-308, 5e-324, 1e307] {
            for i in 0..7_i32 {
                let i = f64::from(i);
                all.push(scale * DVec3::new(0.3 - i, i / 7.0, 1.0 / (i + 0.1)));
            }
        }
        let nowhere = [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY, DVec3::new(1.0, f64::NEG_INFINITY, 0.0)];
        all.extend(nowhere);
        for &backend in Backend::available() {
            for n in 0..all.len() {
                let units = backend.run(Units(&all[n..]));
                assert_eq!(units.len(), all.len() - n);
                for ((scaled, length), vector) in units.into_iter().zip(&all[n..]) {
                    let expected = unit(*vector).unwrap_or(DVec3::ZERO);
                    let bits = |v: DVec3| v.to_array().map(f64::to_bits);
                    assert_eq!(bits(scaled), bits(expected), "{backend}, {vector}");
                    let expected = vector.length();
                    assert!(length.to_bits() == expected.to_bits() || length.is_nan() && expected.is_nan());
                }
            }
        }
    }
}
