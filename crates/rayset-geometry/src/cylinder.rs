//! The container of the paper: a cylinder around a ray.

use glam::DVec3;

use crate::Ray;

/// A safety zone around a formative ray: it starts at the ray's anchor, has its axis along the ray, and ends at
/// the plane through the nearest intersection point.
///
/// The zone is open: a point on its surface counts as outside. An infinite length stands for a ray that met
/// nothing, an infinite radius for one that nothing else came near.
///
/// Source: Speer et al. 1985, sections 2.3.1 and 2.3.2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// The anchor of the formative ray, in world space.
    pub anchor: DVec3,
    /// The unit direction of the formative ray.
    pub axis: DVec3,
    /// The distance between the two planes, in world units; not negative.
    pub length: f64,
    /// The radial distance of the nearest volume, in world units; a zone of radius zero or less holds nothing.
    pub radius: f64,
}

impl Cylinder {
    /// Whether a point is inside the side of the cylinder, anywhere along its infinite axis.
    ///
    /// Strictly: a point at the radius is outside, and so is one with a NaN coordinate.
    #[must_use]
    #[inline]
    pub fn contains_radially(&self, point: DVec3) -> bool {
        let from_anchor = point - self.anchor;
        let lateral = from_anchor - from_anchor.dot(self.axis) * self.axis;
        self.radius > 0.0 && lateral.length_squared() < self.radius * self.radius
    }

    /// Whether a point lies strictly between the two end planes.
    #[must_use]
    #[inline]
    pub fn contains_axially(&self, point: DVec3) -> bool {
        let along = (point - self.anchor).dot(self.axis);
        0.0 < along && along < self.length
    }

    /// Whether the segment from `from` to `to` leaves the cylinder through its side.
    ///
    /// Both points are in world space. The side is convex, so the segment leaves it exactly when one of its ends is
    /// outside. The end planes are not looked at: the paper speaks of the side only. Costs two point tests, which
    /// matches the estimate in section 4 of the paper.
    ///
    /// Source: Speer et al. 1985, section 2.3.1 (pierce-checking).
    #[must_use]
    #[inline]
    pub fn is_pierced_by(&self, from: DVec3, to: DVec3) -> bool {
        !(self.contains_radially(from) && self.contains_radially(to))
    }

    /// How far along a ray the end plane is, in world units; infinite if the ray does not run towards it, or the
    /// cylinder has no end.
    #[must_use]
    #[inline]
    pub fn distance_to_end(&self, ray: &Ray) -> f64 {
        let towards = ray.direction().dot(self.axis);
        if towards > 0.0 {
            (self.length - (ray.origin() - self.anchor).dot(self.axis)) / towards
        } else {
            f64::INFINITY
        }
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "the values are exact, worked out by hand")]
mod tests {
    use glam::dvec3;

    use super::*;

    fn cylinder() -> Cylinder {
        Cylinder { anchor: dvec3(1.0, 0.0, 0.0), axis: DVec3::Z, length: 4.0, radius: 0.5 }
    }

    #[test]
    fn segment_inside_does_not_pierce() {
        assert!(!cylinder().is_pierced_by(dvec3(1.25, 0.0, 0.0), dvec3(0.75, 0.25, 4.0)));
    }

    #[test]
    fn segment_that_leaves_at_either_end_pierces() {
        let (inside, outside) = (dvec3(1.0, 0.0, 1.0), dvec3(1.0, 0.75, 3.0));
        assert!(cylinder().is_pierced_by(inside, outside));
        assert!(cylinder().is_pierced_by(outside, inside));
    }

    #[test]
    fn surface_counts_as_outside() {
        assert!(!cylinder().contains_radially(dvec3(1.5, 0.0, 1.0)));
        assert!(!cylinder().contains_axially(dvec3(1.0, 0.0, 0.0)));
        assert!(!cylinder().contains_axially(dvec3(1.0, 0.0, 4.0)));
        assert!(cylinder().contains_axially(dvec3(9.0, 0.0, 2.0)));
    }

    #[test]
    fn end_planes_do_not_count_as_the_side() {
        assert!(!cylinder().is_pierced_by(dvec3(1.0, 0.0, -5.0), dvec3(1.0, 0.0, 50.0)));
    }

    #[test]
    fn zero_radius_is_always_pierced() {
        for radius in [0.0, -1.0, f64::NAN] {
            let zone = Cylinder { radius, ..cylinder() };
            assert!(zone.is_pierced_by(zone.anchor, zone.anchor + zone.axis), "{radius}");
        }
    }

    #[test]
    fn infinite_radius_is_never_pierced() {
        let zone = Cylinder { radius: f64::INFINITY, ..cylinder() };
        assert!(!zone.is_pierced_by(dvec3(1e9, 0.0, 0.0), dvec3(0.0, -1e9, 4.0)));
    }

    #[test]
    fn end_plane_is_met_by_rays_that_run_towards_it() {
        let zone = cylinder();
        assert_eq!(zone.distance_to_end(&Ray::new(dvec3(5.0, 5.0, 1.0), DVec3::Z)), 3.0);
        assert_eq!(zone.distance_to_end(&Ray::new(zone.anchor, DVec3::X)), f64::INFINITY);
        assert_eq!(zone.distance_to_end(&Ray::new(zone.anchor, -DVec3::Z)), f64::INFINITY);
        let endless = Cylinder { length: f64::INFINITY, ..zone };
        assert_eq!(endless.distance_to_end(&Ray::new(zone.anchor, DVec3::Z)), f64::INFINITY);
    }
}
