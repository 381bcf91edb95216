//! The partition of space by a ray: bounding plane, half-spaces, and the sets B, N and I.

use glam::DVec3;
use rayset_simd::{LaneMask, Lanes, MAX_LANES, Simd};

use crate::{BoundingSphere, Ray, RayLanes};

/// How much farther a bounding volume reaches in a partition than its radius, relative to the coordinates involved.
///
/// A volume counts as intersected when the ray passes within `radius + slack`, with `slack = PARTITION_MARGIN *
/// (the origin's largest coordinate + the scene's)`. It covers the rounding of the partition and of the hits inside
/// the volume: no computed hit is ever outside a volume that is not intersected. 2^-46 is 128 roundings; derived in
/// `docs/numerics.md`.
pub const PARTITION_MARGIN: f64 = 1.0 / (1_u64 << 46) as f64;

/// Which part of a partition a volume falls into.
///
/// Source: Speer et al. 1985, section 2.1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VolumeSet {
    /// B: entirely in the rear half-space.
    Behind,
    /// N: in front, but not intersected.
    NotIntersected,
    /// I: in front and intersected.
    Intersected,
}

/// The plane through a ray's anchor with the ray's direction as its normal.
///
/// Source: Speer et al. 1985, section 2.1 and Figure 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingPlane {
    /// A point of the plane: the ray's anchor.
    pub anchor: DVec3,
    /// The unit normal, into the front half-space.
    pub normal: DVec3,
}

impl BoundingPlane {
    /// The bounding plane of a ray.
    #[must_use]
    pub fn of(ray: &Ray) -> Self {
        Self { anchor: ray.origin(), normal: ray.direction() }
    }

    /// The signed distance of a point, in world units: positive in the front half-space.
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        (point - self.anchor).dot(self.normal)
    }
}

impl VolumeSet {
    /// The set that a volume belongs to in the partition of a ray; its radius counts as larger by `slack`.
    ///
    /// One volume of what [`VolumeColumns`] classifies in lanes.
    #[must_use]
    pub fn of(ray: &Ray, volume: &BoundingSphere, slack: f64) -> Self {
        let mut columns = VolumeColumns::default();
        columns.push(volume);
        let lanes =
            columns.classify(rayset_simd::Scalar, &RayLanes::splat(rayset_simd::Scalar, ray), slack, 0);
        match lanes {
            VolumeLanes { intersected: 1, .. } => Self::Intersected,
            VolumeLanes { not_intersected: 1, .. } => Self::NotIntersected,
            _ => Self::Behind,
        }
    }
}

/// Bounding volumes as columns, padded for loads in lanes.
#[derive(Clone, Debug)]
pub struct VolumeColumns {
    columns: [Vec<f64>; 4],
    len: usize,
}

/// The classification of as many volumes as there are lanes.
#[derive(Clone, Copy, Debug)]
pub struct VolumeLanes<V> {
    /// Bit `i`: volume `i` of these lanes is in I.
    pub intersected: u32,
    /// Bit `i`: volume `i` of these lanes is in N.
    pub not_intersected: u32,
    /// The signed distance of each centre from the bounding plane, in world units.
    pub along: V,
    /// The squared distance of each centre from the ray's line, in world units squared.
    pub lateral_squared: V,
}

impl Default for VolumeColumns {
    fn default() -> Self {
        Self { columns: std::array::from_fn(|_| vec![0.0; MAX_LANES]), len: 0 }
    }
}

impl VolumeColumns {
    /// Appends a volume.
    pub fn push(&mut self, volume: &BoundingSphere) {
        let [x, y, z] = volume.center.to_array();
        for (column, value) in self.columns.iter_mut().zip([x, y, z, volume.radius]) {
            column[self.len] = value;
            column.push(0.0);
        }
        self.len += 1;
    }

    /// How many volumes there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// A volume.
    ///
    /// # Panics
    ///
    /// If there is no such volume.
    #[must_use]
    #[inline]
    pub fn sphere(&self, index: usize) -> BoundingSphere {
        let [x, y, z, radius] = &self.columns;
        let center = DVec3::new(x[..self.len][index], y[index], z[index]);
        BoundingSphere { center, radius: radius[index] }
    }

    /// The radius of a volume, in world units.
    ///
    /// # Panics
    ///
    /// If there is no such volume.
    #[must_use]
    #[inline]
    pub fn radius(&self, index: usize) -> f64 {
        self.columns[3][..self.len][index]
    }

    /// The centres and radii of the volumes `i`, `i + 1`, ... as many as there are lanes; past the end they are zero.
    #[inline(always)]
    pub(crate) fn load<S: Simd>(&self, simd: S, i: usize) -> ([S::F64; 3], S::F64) {
        let [x, y, z, radius] = &self.columns;
        let center = [simd.load_f64(&x[i..]), simd.load_f64(&y[i..]), simd.load_f64(&z[i..])];
        (center, simd.load_f64(&radius[i..]))
    }

    /// A bit for each of `lanes` volumes from `i` on that there is.
    #[inline(always)]
    pub(crate) fn real(&self, lanes: usize, i: usize) -> u32 {
        (1_u32 << lanes.min(self.len - i)) - 1
    }

    /// Classifies the volumes `i`, `i + 1`, ... as many as there are lanes; those past the end are in no set.
    ///
    /// With `b = (c - o) . d` and `l = (c - o) - b d`: in B when `b < -r`, in I when the half-line passes within `r`
    /// of the centre, that is `l . l <= r^2` and either `b >= 0` or the origin is inside, and in N otherwise; `r` is
    /// the radius plus `slack`.
    #[must_use]
    #[inline(always)]
    pub fn classify<S: Simd>(&self, simd: S, ray: &RayLanes<S>, slack: f64, i: usize) -> VolumeLanes<S::F64> {
        let (o, d) = (&ray.origin, &ray.direction);
        let ([x, y, z], radius) = self.load(simd, i);
        let oc = [x - o[0], y - o[1], z - o[2]];
        let along = oc[0] * d[0] + oc[1] * d[1] + oc[2] * d[2];
        let l = [oc[0] - along * d[0], oc[1] - along * d[1], oc[2] - along * d[2]];
        let lateral_squared = l[0] * l[0] + l[1] * l[1] + l[2] * l[2];
        let reach = radius + simd.splat_f64(slack);
        let reach_squared = reach * reach;
        let zero = simd.splat_f64(0.0);
        let holds_origin = (oc[0] * oc[0] + oc[1] * oc[1] + oc[2] * oc[2]).le(reach_squared);
        let intersected = lateral_squared.le(reach_squared) & (along.ge(zero) | holds_origin);
        let behind = along.lt(-reach);
        let real = self.real(S::F64::LANES, i);
        VolumeLanes {
            intersected: (intersected & !behind).bits() & real,
            not_intersected: (!(intersected | behind)).bits() & real,
            along,
            lateral_squared,
        }
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "the values are exact, worked out by hand")]
mod tests {
    use glam::dvec3;

    use super::*;

    fn set_of(center: DVec3, radius: f64) -> VolumeSet {
        VolumeSet::of(&Ray::new(DVec3::ZERO, DVec3::Z), &BoundingSphere { center, radius }, 0.0)
    }

    #[test]
    fn volumes_fall_into_exactly_one_set() {
        assert_eq!(set_of(dvec3(0.0, 0.0, 5.0), 1.0), VolumeSet::Intersected);
        assert_eq!(set_of(dvec3(3.0, 0.0, 5.0), 1.0), VolumeSet::NotIntersected);
        assert_eq!(set_of(dvec3(0.0, 0.0, -5.0), 1.0), VolumeSet::Behind);
    }

    #[test]
    fn straddling_volume_is_in_front() {
        // Beside the origin, reaching over the plane from behind.
        assert_eq!(set_of(dvec3(3.0, 0.0, -0.5), 1.0), VolumeSet::NotIntersected);
        // On the line, reaching over the plane from behind, but not as far as the half-line.
        assert_eq!(set_of(dvec3(0.9, 0.0, -0.5), 1.0), VolumeSet::NotIntersected);
    }

    #[test]
    fn volume_around_the_origin_is_intersected() {
        assert_eq!(set_of(dvec3(0.0, 0.0, -0.5), 1.0), VolumeSet::Intersected);
        assert_eq!(set_of(DVec3::ZERO, 1.0), VolumeSet::Intersected);
    }

    #[test]
    fn touching_counts_as_intersected_and_as_in_front() {
        assert_eq!(set_of(dvec3(1.0, 0.0, 5.0), 1.0), VolumeSet::Intersected);
        assert_eq!(set_of(dvec3(0.5, 0.0, -1.0), 1.0), VolumeSet::NotIntersected);
    }

    #[test]
    fn slack_widens_the_volume() {
        let ray = Ray::new(DVec3::ZERO, DVec3::Z);
        let volume = BoundingSphere { center: dvec3(1.0, 0.0, 5.0), radius: 0.75 };
        assert_eq!(VolumeSet::of(&ray, &volume, 0.0), VolumeSet::NotIntersected);
        assert_eq!(VolumeSet::of(&ray, &volume, 0.25), VolumeSet::Intersected);
    }

    #[test]
    fn bounding_plane_divides_space_at_the_anchor() {
        let plane = BoundingPlane::of(&Ray::new(dvec3(0.0, 0.0, 1.0), DVec3::Z));
        assert_eq!(plane.distance(dvec3(7.0, 8.0, 3.0)), 2.0);
        assert_eq!(plane.distance(dvec3(7.0, 8.0, -3.0)), -4.0);
    }
}
