//! Pencils: rays that stay near one ray, and what such rays cannot touch.

use glam::DVec3;
use rayset_simd::{LaneMask, Lanes, Scalar, Simd};

use crate::probe::map3;
use crate::{BoundingSphere, Ray, VolumeColumns};

/// The rays that start within `spread` of an axis, differ from its direction by at most `divergence`, and end within
/// `length`.
///
/// Such a ray is never farther than `spread + divergence s` from the axis at distance `s` from its start: they fill a
/// truncated cone with rounded ends. A pencil is what makes a safety zone sound: whatever the cone does not touch, none
/// of its rays can hit.
///
/// Directions are unit vectors, so `divergence` is nearly the angle in radians. All other values are in world units.
///
/// Source: the pencils of Shinya, Takahashi, Naito 1987, "Principles and applications of pencil tracing", with bounds
/// in place of paraxial matrices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pencil {
    /// The formative ray.
    pub axis: Ray,
    /// How far apart the starts may be, in world units.
    pub spread: f64,
    /// How far apart the tips of the unit directions may be; below 1.
    pub divergence: f64,
    /// Up to what distance along its rays the pencil says anything, in world units; may be infinite.
    pub length: f64,
}

/// How much a pencil's cone is widened for rounding, relative to the coordinates involved.
///
/// The distance of a volume from the axis is off by less than 55 roundings of the largest coordinate, and a hit point
/// lies outside the bounding sphere of its primitive by less than [`PARTITION_MARGIN`](crate::PARTITION_MARGIN), 128
/// roundings; 2^-44 is 512. Derived in `docs/certificates.md`.
pub const PENCIL_MARGIN: f64 = 1.0 / (1_u64 << 44) as f64;

/// How much tighter than its bounds a ray is checked, relatively: the rounding of squared differences.
const CONTAINMENT_SLACK: f64 = 1.0 - 1.0 / (1_u64 << 46) as f64;

/// A pencil as far as rays are held against it: its bounds squared, and tighter by their rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PencilGate {
    axis: Ray,
    spread_squared: f64,
    divergence_squared: f64,
}

impl PencilGate {
    /// Whether a ray belongs to the pencil, whatever its length.
    #[must_use]
    #[inline(always)]
    pub fn admits(&self, ray: &Ray) -> bool {
        let apart = ray.direction() - self.axis.direction();
        let beside = ray.origin() - self.axis.origin();
        // Both, always: two comparisons cost less than a branch between them.
        (apart.length_squared() <= self.divergence_squared) & (beside.length_squared() <= self.spread_squared)
    }
}

impl Pencil {
    /// What a ray must pass to belong to the pencil.
    #[must_use]
    pub fn gate(&self) -> PencilGate {
        PencilGate {
            axis: self.axis,
            spread_squared: self.spread * self.spread * CONTAINMENT_SLACK,
            divergence_squared: self.divergence * self.divergence * CONTAINMENT_SLACK,
        }
    }

    /// Whether a ray belongs to the pencil, whatever its length.
    #[must_use]
    pub fn contains(&self, ray: &Ray) -> bool {
        self.gate().admits(ray)
    }

    /// Whether no ray of the pencil touches a volume, or comes within `slack` of it.
    ///
    /// `slack` is [`PENCIL_MARGIN`] times the largest coordinate of the axis and of the scene.
    #[must_use]
    pub fn clears(&self, volume: &BoundingSphere, slack: f64) -> bool {
        PencilLanes::splat(Scalar, self, slack).clears(volume)
    }
}

/// A pencil spread over the lanes of a backend.
#[derive(Clone, Copy, Debug)]
pub struct PencilLanes<S: Simd> {
    simd: S,
    origin: [S::F64; 3],
    direction: [S::F64; 3],
    start: S::F64,
    divergence: S::F64,
    /// `1 / (1 - b^2)`.
    factor: S::F64,
    length: S::F64,
}

impl<S: Simd> PencilLanes<S> {
    /// The same pencil in every lane; `slack` as in [`Pencil::clears`].
    #[must_use]
    #[inline(always)]
    pub fn splat(simd: S, pencil: &Pencil, slack: f64) -> Self {
        let splat = |v: DVec3| [simd.splat_f64(v.x), simd.splat_f64(v.y), simd.splat_f64(v.z)];
        let b = pencil.divergence;
        Self {
            simd,
            origin: splat(pencil.axis.origin()),
            direction: splat(pencil.axis.direction()),
            start: simd.splat_f64(pencil.spread + slack),
            divergence: simd.splat_f64(b),
            factor: simd.splat_f64(1.0 / (1.0 - b * b)),
            length: simd.splat_f64(pencil.length),
        }
    }

    /// The volumes among `i`, `i + 1`, ... that a ray of the pencil might touch, one bit a lane; those past the end do
    /// not count.
    ///
    /// With `A = (c - o) . d`, `l = (c - o) - A d` and `w = r + spread`, the cone reaches nearest to the volume at
    /// `s = (A + w b) / (1 - b^2)`, cut to the length; the volume is clear when `(s - A)^2 + l . l > (w + b s)^2`
    /// there. A sum of squares on the left: nothing cancels.
    #[must_use]
    #[inline(always)]
    pub fn touched(&self, volumes: &VolumeColumns, i: usize) -> u32 {
        let (center, radius) = volumes.load(self.simd, i);
        !self.clear(center, radius).bits() & volumes.real(S::F64::LANES, i)
    }

    /// [`Pencil::clears`] for the pencil and slack these lanes were made from.
    #[must_use]
    #[inline(always)]
    pub fn clears(&self, volume: &BoundingSphere) -> bool {
        let center = map3(volume.center.to_array(), |x| self.simd.splat_f64(x));
        self.clear(center, self.simd.splat_f64(volume.radius)).bits() & 1 != 0
    }

    #[inline(always)]
    fn clear(&self, [x, y, z]: [S::F64; 3], radius: S::F64) -> <S::F64 as Lanes>::Mask {
        let (o, d) = (&self.origin, &self.direction);
        let oc = [x - o[0], y - o[1], z - o[2]];
        let along = oc[0] * d[0] + oc[1] * d[1] + oc[2] * d[2];
        let l = [oc[0] - along * d[0], oc[1] - along * d[1], oc[2] - along * d[2]];
        let lateral_squared = l[0] * l[0] + l[1] * l[1] + l[2] * l[2];
        let width = radius + self.start;
        let nearest = (along + width * self.divergence) * self.factor;
        let s = nearest.max(self.simd.splat_f64(0.0)).min(self.length);
        let e = s - along;
        let reach = width + self.divergence * s;
        (e * e + lateral_squared).gt(reach * reach)
    }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;

    fn pencil(spread: f64, divergence: f64, length: f64) -> Pencil {
        Pencil { axis: Ray::new(DVec3::ZERO, DVec3::Z), spread, divergence, length }
    }

    fn clears(pencil: &Pencil, center: DVec3) -> bool {
        pencil.clears(&BoundingSphere { center, radius: 1.0 }, 0.0)
    }

    #[test]
    fn cylinder_clears_what_is_beside_it() {
        let tube = pencil(0.5, 0.0, 10.0);
        assert!(clears(&tube, dvec3(1.51, 0.0, 5.0)));
        assert!(!clears(&tube, dvec3(1.49, 0.0, 5.0)));
        // Rounded ends: at (1, 0, z) the distance from the end must exceed 1.5.
        assert!(clears(&tube, dvec3(1.0, 0.0, 11.2)) && !clears(&tube, dvec3(1.0, 0.0, 11.0)));
        assert!(clears(&tube, dvec3(1.0, 0.0, -1.2)) && !clears(&tube, dvec3(1.0, 0.0, -1.0)));
    }

    #[test]
    fn cone_widens_with_the_distance() {
        // At s = 10 the radius is 2: the sphere at x = 3.2 is out of reach of the slanted side, at 2.9 it is not.
        let cone = pencil(0.0, 0.2, 100.0);
        assert!(clears(&cone, dvec3(3.2, 0.0, 10.0)));
        assert!(!clears(&cone, dvec3(2.9, 0.0, 10.0)));
        assert!(clears(&pencil(0.0, 0.2, 5.0), dvec3(2.9, 0.0, 10.0)), "the cone ends before it");
        assert!(!clears(&pencil(0.0, 0.2, f64::INFINITY), dvec3(0.0, 100.0, 600.0)));
        assert!(clears(&pencil(0.0, 0.2, f64::INFINITY), dvec3(0.0, 100.0, -600.0)));
    }

    #[test]
    fn volume_round_the_start_is_never_clear() {
        assert!(!clears(&pencil(0.0, 0.0, 0.1), dvec3(0.0, 0.0, -0.9)));
        assert!(!clears(&pencil(0.0, 0.0, f64::INFINITY), DVec3::ZERO));
    }

    #[test]
    fn rays_belong_by_start_and_direction() {
        let tube = pencil(0.5, 0.1, 1.0);
        let ray = |x: f64, slope: f64| Ray::new(dvec3(x, 0.0, 0.0), dvec3(slope, 0.0, 1.0).normalize());
        assert!(tube.contains(&ray(0.49, 0.09)));
        assert!(!tube.contains(&ray(0.51, 0.09)) && !tube.contains(&ray(0.49, 0.11)));
        let exact = pencil(0.0, 0.1, 1.0);
        assert!(
            exact.contains(&ray(0.0, 0.05)) && !exact.contains(&ray(1e-300, 0.05))
                || !exact.contains(&ray(1e-9, 0.05))
        );
    }
}
