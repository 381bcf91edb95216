//! Spheres.

use glam::DVec3;
use rayset_simd::{LaneMask, Lanes, Scalar, Simd};

use crate::departure::Allowed;
use crate::{BoundingSphere, Probe, Ray, RayLanes, Side, Sides, Span};

/// A sphere, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    center: DVec3,
    radius: f64,
}

impl Sphere {
    /// A sphere; a radius of zero is a point that only a ray through its exact centre hits.
    ///
    /// # Panics
    ///
    /// If the radius is negative, or anything is not finite.
    #[must_use]
    pub fn new(center: DVec3, radius: f64) -> Self {
        assert!(center.is_finite(), "center {center} is not finite");
        assert!(radius >= 0.0 && radius.is_finite(), "radius {radius} is negative or not finite");
        Self { center, radius }
    }

    /// The centre, in world space.
    #[must_use]
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// The radius, in world units.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The outward unit normal at a point on the sphere; along +z at the centre, where none is defined.
    #[must_use]
    pub fn normal_at(&self, point: DVec3) -> DVec3 {
        Self::outward(self.center, point)
    }

    #[inline]
    pub(crate) fn outward(center: DVec3, point: DVec3) -> DVec3 {
        crate::unit(point - center).unwrap_or(DVec3::Z)
    }

    /// [`Primitive::intersect`](crate::Primitive::intersect) of a sphere: for loops that know what they test.
    #[must_use]
    #[inline(always)]
    pub fn intersect(&self, ray: &Ray, span: Span, sides: Sides, departure: Option<Side>) -> Option<f64> {
        let probe = Probe::new(Scalar, ray, span, false);
        // As `Allowed::of` has it for a sphere: who leaves outwards meets nothing, who leaves inwards the back alone.
        let allowed = Allowed {
            front: departure.is_none() && sides.include(Side::Front),
            back: departure != Some(Side::Front) && sides.include(Side::Back),
        };
        let (is_hit, t) = intersect(&probe, self.center.to_array(), self.radius, allowed);
        is_hit.then_some(t)
    }

    /// The sphere itself.
    #[must_use]
    pub fn bounding_sphere(&self) -> BoundingSphere {
        BoundingSphere { center: self.center, radius: self.radius }
    }
}

/// Where a ray meets spheres, a lane each: the lanes that are hit, and `t`.
///
/// With `b = (c - o) . d` and `l = (c - o) - b d`, the roots of `|o + t d - c|^2 = r^2` are
/// `t = b -+ sqrt(r^2 - l . l)`. `l` is the perpendicular from the centre to the ray, so nothing of the size of
/// the distance to the sphere cancels: from 10^6 units away a unit sphere keeps ten digits of its outline.
/// A tangent ray hits once. The first root is the front, the second the back.
///
/// Source: Haines et al. 2019, "Precision improvements for ray/sphere intersection" (Ray Tracing Gems, 7).
#[inline(always)]
pub(crate) fn intersect<S: Simd>(
    probe: &Probe<S>,
    center: [S::F64; 3],
    radius: S::F64,
    allowed: Allowed<S>,
) -> (<S::F64 as Lanes>::Mask, S::F64) {
    let span = [probe.simd.splat_f64(probe.span.start), probe.simd.splat_f64(probe.span.end)];
    let Allowed { front, back } = allowed;
    Sphere::intersect_pairs(probe.simd, &probe.lanes, span, (center, radius), (front, back))
}

impl Sphere {
    /// Where rays meet spheres, a pair a lane: the lanes that are hit, and `t`; of the rays, where their spans start and
    /// end, and the lanes whose front and back may be hit.
    ///
    /// The arithmetic of [`Sphere::intersect`], and its bits.
    #[must_use]
    #[inline(always)]
    pub fn intersect_pairs<S: Simd>(
        simd: S,
        rays: &RayLanes<S>,
        [start, end]: [S::F64; 2],
        (center, radius): ([S::F64; 3], S::F64),
        (front, back): (<S::F64 as Lanes>::Mask, <S::F64 as Lanes>::Mask),
    ) -> (<S::F64 as Lanes>::Mask, S::F64) {
        let (o, d) = (&rays.origin, &rays.direction);
        let oc = [center[0] - o[0], center[1] - o[1], center[2] - o[2]];
        let b = oc[0] * d[0] + oc[1] * d[1] + oc[2] * d[2];
        let l = [oc[0] - b * d[0], oc[1] - b * d[1], oc[2] - b * d[2]];
        let discriminant = radius * radius - (l[0] * l[0] + l[1] * l[1] + l[2] * l[2]);
        let real = discriminant.ge(simd.splat_f64(0.0));
        if !real.any() {
            // The root is what costs most.
            return (real, b);
        }
        let half = discriminant.sqrt();
        let (near, far) = (b - half, b + half);
        let near_hit = real & front & near.gt(start) & near.lt(end);
        let far_hit = real & back & far.gt(start) & far.lt(end);
        (near_hit | far_hit, near.select(near_hit, far))
    }
}

#[cfg(test)]
mod tests {
    use approx::abs_diff_eq;
    use glam::dvec3;

    use super::*;
    use crate::{Primitive, Ray, Span};

    fn sphere() -> Primitive {
        Sphere::new(dvec3(0.0, 0.0, 5.0), 1.0).into()
    }

    fn hit(origin: DVec3, direction: DVec3, sides: Sides, departure: Option<Side>) -> Option<f64> {
        sphere().intersect(&Ray::new(origin, direction), Span::FORWARD, sides, departure)
    }

    #[test]
    fn ray_through_the_centre_hits_where_it_enters() {
        assert_eq!(hit(DVec3::ZERO, DVec3::Z, Sides::Both, None), Some(4.0));
        assert_eq!(hit(DVec3::ZERO, -DVec3::Z, Sides::Both, None), None);
    }

    #[test]
    fn tangent_ray_hits_once() {
        assert_eq!(hit(dvec3(1.0, 0.0, 0.0), DVec3::Z, Sides::Both, None), Some(5.0));
        assert_eq!(hit(dvec3(1.0, 0.0, 0.0), DVec3::Z, Sides::Front, None), Some(5.0));
        let outside = 1.0 + f64::EPSILON;
        assert_eq!(hit(dvec3(outside, 0.0, 0.0), DVec3::Z, Sides::Both, None), None);
    }

    #[test]
    fn ray_from_inside_hits_the_back() {
        assert_eq!(hit(dvec3(0.0, 0.0, 5.0), DVec3::X, Sides::Both, None), Some(1.0));
        assert_eq!(hit(dvec3(0.0, 0.0, 5.0), DVec3::X, Sides::Back, None), Some(1.0));
        assert_eq!(hit(dvec3(0.0, 0.0, 5.0), DVec3::X, Sides::Front, None), None);
    }

    #[test]
    fn ray_that_leaves_outwards_never_meets_its_sphere_again() {
        let origin = dvec3(0.0, 0.0, 4.0);
        // A direction that rounding has turned slightly inwards is still one that leaves.
        let direction = crate::unit(dvec3(1.0, 0.0, 1e-16)).unwrap();
        assert_eq!(hit(origin, direction, Sides::Both, Some(Side::Front)), None);
    }

    #[test]
    fn ray_that_leaves_inwards_meets_the_far_side_only() {
        let origin = dvec3(0.0, 0.0, 4.0 - 1e-15);
        assert_eq!(hit(origin, DVec3::Z, Sides::Both, Some(Side::Back)), Some(6.0 - origin.z));
    }

    #[test]
    fn directions_with_negative_zeros_and_subnormals_hit_alike() {
        for tiny in [0.0, -0.0, f64::from_bits(1), -f64::MIN_POSITIVE / 2.0] {
            let ray = Ray::new(DVec3::ZERO, dvec3(tiny, -tiny, 1.0));
            assert_eq!(sphere().intersect(&ray, Span::FORWARD, Sides::Both, None), Some(4.0), "{tiny:e}");
        }
    }

    #[test]
    fn far_away_origin_keeps_ten_digits() {
        let far = dvec3(0.0, 0.0, -1e6);
        for offset in [0.0, 0.5, 0.999_999] {
            let origin = far + dvec3(offset, 0.0, 0.0);
            let t =
                sphere().intersect(&Ray::new(origin, DVec3::Z), Span::FORWARD, Sides::Both, None).unwrap();
            let expected = 1e6 + 5.0 - f64::sqrt(1.0 - offset * offset);
            assert!(abs_diff_eq!(t, expected, epsilon = 1e-9), "{offset}: {t} against {expected}");
        }
    }

    #[test]
    fn zero_radius_is_hit_only_through_the_centre() {
        let point = Primitive::from(Sphere::new(dvec3(0.0, 0.0, 5.0), 0.0));
        let through = Ray::new(DVec3::ZERO, DVec3::Z);
        assert_eq!(point.intersect(&through, Span::FORWARD, Sides::Both, None), Some(5.0));
        let beside = Ray::new(dvec3(1e-9, 0.0, 0.0), DVec3::Z);
        assert_eq!(point.intersect(&beside, Span::FORWARD, Sides::Both, None), None);
    }
}
