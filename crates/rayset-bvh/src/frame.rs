//! The space in which boxes are culled: the scene moved to the origin and scaled to about unit size.

use rayset_geometry::BoundingBox;
use rayset_geometry::glam::DVec3;

/// What is smaller is culled as if it were as large: squares that underflow displace a hit by up to `2^-537`, which is
/// far below the margins only above that; see `docs/numerics.md`.
const LEAST_HALF: f64 = f64::from_bits((1023 - 480) << 52);

/// What is smaller in culling space counts as this large.
const LEAST_REACH: f32 = 0.25;

/// World space to culling space: `x' = (x - center) scale`, the scale a power of two.
///
/// Everything that can be hit has coordinates of at most 1 there, so single precision neither overflows nor
/// underflows, whatever the size of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    pub(crate) center: DVec3,
    pub(crate) scale: f64,
    /// The centre's largest coordinate, in units of culling space.
    pub(crate) remoteness: f64,
    /// The largest coordinate of anything in culling space, or more.
    pub(crate) reach: f32,
}

/// A box in culling space, in single precision, never smaller than what it was made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CullBox {
    pub(crate) low: [f32; 3],
    pub(crate) high: [f32; 3],
}

impl CullBox {
    /// Half the surface; zero for the empty box.
    #[inline]
    pub(crate) fn half_area(&self) -> f32 {
        let [x, y, z] = std::array::from_fn(|k| side(self.low[k], self.high[k]));
        x * y + y * z + z * x
    }
}

/// What a side of a box counts as, if it has no length: rays meet what lies along an axis too, and the longer, the more often.
const FINEST: f32 = 1.0 / 4_194_304.0;

/// The length of a side of a box, from one plane to the other, and a little more; zero if the box is empty.
#[inline(always)]
pub(crate) fn side(low: f32, high: f32) -> f32 {
    let side = high - low;
    if side >= 0.0 { side + FINEST } else { 0.0 }
}

impl Frame {
    /// The frame of a scene with these bounds.
    pub(crate) fn of(bounds: &BoundingBox) -> Self {
        if bounds.is_empty() {
            return Self { center: DVec3::ZERO, scale: 1.0, remoteness: 0.0, reach: 1.0 };
        }
        let half = 0.5 * bounds.diagonal().max_element();
        // The next power of two, so that scaling rounds nothing; kept in the range where its inverse is finite.
        let exponent = (half.max(LEAST_HALF).to_bits() >> 52).min(2044);
        let scale = f64::from_bits((2045 - exponent) << 52);
        let center = bounds.center();
        let remoteness = center.abs().max_element() * scale;
        let frame = Self { center, scale, remoteness, reach: 1.0 };
        let [low, high] = [bounds.min, bounds.max].map(|corner| frame.point(corner).abs().max_element());
        // What lies in smaller scenes is rounded as in one of this size.
        Self { reach: round_up(low.max(high)).max(LEAST_REACH), ..frame }
    }

    /// A point in culling space.
    #[inline(always)]
    pub(crate) fn point(&self, point: DVec3) -> DVec3 {
        (point - self.center) * self.scale
    }

    /// A box in culling space, rounded outwards.
    pub(crate) fn cull_box(&self, bounds: &BoundingBox) -> CullBox {
        let (low, high) = (self.point(bounds.min).to_array(), self.point(bounds.max).to_array());
        CullBox { low: low.map(|value| -at_least(-value)), high: high.map(at_least) }
    }
}

/// The least number in single precision that is not below `value`: the same, if there is such a number.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "made up for")]
fn at_least(value: f64) -> f32 {
    let rounded = value as f32;
    if f64::from(rounded) < value { rounded.next_up() } else { rounded }
}

/// A number in single precision that is not above `value`, whose own rounding is allowed for.
#[inline(always)]
pub(crate) fn round_down(value: f64) -> f32 {
    -round_up(-value)
}

/// A number in single precision that is not below `value`, whose own rounding is allowed for.
///
/// Without a branch, unlike `next_up`: the conversion is off by `2^-24` of the value at most, and so is the sum; what is
/// added is `2^-22` of it.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "what is added makes up for the rounding")]
pub(crate) fn round_up(value: f64) -> f32 {
    let rounded = value as f32;
    rounded + (rounded.abs() * (1.0 / 4_194_304.0) + f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_of_any_size_fits_the_unit_cube() {
        for size in [1e-300, 1e-160, 1e-3, 1.0, 1.5, 2.0, 1e10, 1e60, 1e300] {
            let bounds = BoundingBox { min: DVec3::splat(-size), max: DVec3::splat(size) };
            let frame = Frame::of(&bounds);
            let half = size * frame.scale;
            assert!((0.25..=1.0).contains(&half) || size < LEAST_HALF, "{size:e}: {half}");
            let culled = frame.cull_box(&bounds);
            assert!(culled.high[0] <= 1.000_001 && f64::from(culled.high[0]) >= half);
        }
        let flat = BoundingBox { min: DVec3::ONE, max: DVec3::ONE };
        assert!(Frame::of(&flat).scale.is_finite());
    }

    #[test]
    fn boxes_keep_planes_that_single_precision_has() {
        let one_third = 1.0 / 3.0;
        for value in [0.375_f32, -0.375, 0.0] {
            assert_eq!(at_least(value.into()).to_bits(), value.to_bits());
        }
        for value in [one_third, -one_third, 0.1, -0.1, 1.0 + 1e-9, -1.0 - 1e-9, 1e-50, -1e-50] {
            let rounded = at_least(value);
            assert!(f64::from(rounded) > value && f64::from(rounded.next_down()) < value, "{value}");
        }
        let bounds = BoundingBox { min: DVec3::splat(-1.0), max: DVec3::new(1.0, 0.5, 1.0 - 1e-12) };
        let frame = Frame::of(&BoundingBox { min: -DVec3::ONE, max: DVec3::ONE });
        // Scaled by a half.
        let expected = CullBox { low: [-0.5; 3], high: [0.5, 0.25, 0.5] };
        assert_eq!(frame.cull_box(&bounds), expected);
        let [short, long] = [0.5, 1.0].map(|x| CullBox { low: [0.0; 3], high: [x, 0.0, 0.0] }.half_area());
        assert!(0.0 < short && short < long, "of two lines the longer counts more");
        let empty = CullBox { low: [1.0; 3], high: [0.0; 3] };
        assert!(empty.half_area() <= 0.0);
    }

    #[test]
    fn rounding_goes_outwards() {
        for value in [0.1, -0.1, 0.0, 1.0 + 1e-9, 0.5] {
            assert!(f64::from(round_up(value)) > value && f64::from(round_down(value)) < value, "{value}");
        }
    }
}
