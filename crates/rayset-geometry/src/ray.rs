//! Rays.

use std::ops::Range;

use glam::DVec3;

/// A half-line: the paper's anchor and direction vector.
///
/// The direction is a unit vector, so a ray parameter `t` is a distance in world units.
///
/// Source: Speer et al. 1985, section 2.1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    origin: DVec3,
    direction: DVec3,
}

impl Ray {
    /// A ray from `origin`, in world space, along the unit vector `direction`.
    ///
    /// Any component of the direction may be zero of either sign, or subnormal.
    /// That the direction has unit length, to within `1e-9`, is checked in debug builds only.
    #[must_use]
    #[inline]
    pub fn new(origin: DVec3, direction: DVec3) -> Self {
        debug_assert!(
            (direction.length_squared() - 1.0).abs() < 1e-9,
            "direction {direction} is no unit vector"
        );
        Self { origin, direction }
    }

    /// The ray from `origin` through `target`; `None` if they coincide or either is not finite.
    #[must_use]
    pub fn between(origin: DVec3, target: DVec3) -> Option<Self> {
        unit(target - origin).map(|direction| Self { origin, direction })
    }

    /// Where the ray starts, in world space.
    #[must_use]
    #[inline]
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The unit vector along the ray.
    #[must_use]
    #[inline]
    pub fn direction(&self) -> DVec3 {
        self.direction
    }

    /// The point at distance `t`: `o + t d`.
    #[must_use]
    #[inline]
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }
}

/// The squares of lengths that neither overflow nor lose bits.
pub(crate) const UNIT_RANGE: Range<f64> = 1e-200..1e200;

/// The vector scaled to unit length; `None` for the zero vector and for one that is not finite.
///
/// Neither overflows nor underflows: a vector out of the middle range is scaled by its largest component first.
#[must_use]
#[inline]
pub fn unit(vector: DVec3) -> Option<DVec3> {
    let squared = vector.length_squared();
    if UNIT_RANGE.contains(&squared) {
        return Some(vector / squared.sqrt());
    }
    let largest = vector.abs().max_element();
    if !(largest > 0.0 && largest.is_finite() && vector.is_finite()) {
        return None;
    }
    // Twice, since the reciprocal of a subnormal number overflows.
    let scaled = if largest < 1e-300 { vector * 1e300 } else { vector };
    let scaled = scaled / scaled.abs().max_element();
    Some(scaled / scaled.length())
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::abs_diff_eq;

    #[test]
    fn unit_vectors_come_from_vectors_of_any_length() {
        for scale in [1.0, 1e-160, 1e160, 1e-308, 5e-324, 1e307] {
            let vector = unit(DVec3::new(3.0, 0.0, -4.0) * scale).unwrap();
            assert!(abs_diff_eq!(vector.length(), 1.0, epsilon = 1e-15), "{scale}: {vector}");
        }
        assert_eq!(unit(DVec3::ZERO), None);
        assert_eq!(unit(DVec3::new(1.0, f64::NAN, 0.0)), None);
        assert_eq!(unit(DVec3::new(1.0, f64::INFINITY, 0.0)), None);
    }
}
