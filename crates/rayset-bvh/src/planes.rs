//! The planes of polygons in single precision: where rays meet them, and how far off that may be.

use rayset_geometry::glam::DVec3;
use rayset_simd::{CullLanes, Lanes, Simd};

use crate::frame::round_up;
use crate::packet::Mask;
use crate::shear::{Shearing, Shears};
use crate::triangles::Rounding;

/// How far along a ray the place where it meets a plane may be off, but for its own rounding: in errors of a sheared vertex,
/// times how much distance a depth makes, over how much the plane rises along the ray.
pub const PLANE_MARGIN: f32 = 5.0;

/// Where planes rise less than this along rays, nothing is said of where they are met.
const LEAST_RISE: f32 = 1.0 / 64.0;

/// The plane of a polygon: `normal . p = offset`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    pub(crate) normal: [f32; 3],
    pub(crate) offset: f32,
    /// How far vertices lie off it, at most.
    pub(crate) off: f32,
}

/// Planes, and rays that meet them, a pair a lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Planes<S: Simd> {
    /// In the order of each ray's shear.
    pub(crate) normal: [S::F32; 3],
    pub(crate) offset: S::F32,
    pub(crate) off: S::F32,
}

/// `W` planes.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct PlaneBlock<const W: usize> {
    normal: [[f32; W]; 3],
    offset: [f32; W],
    off: [f32; W],
}

/// Where rays meet planes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Meeting<S: Simd> {
    /// How deep along the axis of the shear.
    pub(crate) z: S::F32,
    /// How much the planes rise along that axis, if a ray goes along it.
    pub(crate) rise: S::F32,
    /// Between which distances what lies in the plane is hit.
    pub(crate) low: S::F32,
    pub(crate) high: S::F32,
}

impl Plane {
    /// The plane across a normal, in the middle of points of culling space.
    #[expect(clippy::cast_possible_truncation, reason = "the margins make up for the rounding")]
    pub(crate) fn through(points: &[DVec3], normal: DVec3) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for point in points {
            let place = normal.dot(*point);
            (low, high) = (low.min(place), high.max(place));
        }
        let normal = normal.to_array().map(|x| x as f32);
        Self { normal, offset: (0.5 * (low + high)) as f32, off: round_up(0.5 * (high - low)) }
    }

    /// The same in every lane, for rays that are sheared.
    #[inline(always)]
    pub(crate) fn splat<S: Simd>(&self, simd: S, rays: &impl Shearing<S>) -> Planes<S> {
        let (offset, off) = (simd.splat_f32(self.offset), simd.splat_f32(self.off));
        Planes { normal: rays.in_order(simd, self.normal), offset, off }
    }
}

impl<const W: usize> PlaneBlock<W> {
    pub(crate) const EMPTY: Self = Self { normal: [[0.0; W]; 3], offset: [0.0; W], off: [0.0; W] };

    pub(crate) fn set(&mut self, lane: usize, plane: &Plane) {
        for (column, coordinate) in self.normal.iter_mut().zip(plane.normal) {
            column[lane] = coordinate;
        }
        (self.offset[lane], self.off[lane]) = (plane.offset, plane.off);
    }

    /// The plane of a lane.
    #[inline(always)]
    pub(crate) fn at(&self, lane: usize) -> Plane {
        let ([x, y, z], lane) = (&self.normal, lane % W);
        Plane { normal: [x[lane], y[lane], z[lane]], offset: self.offset[lane], off: self.off[lane] }
    }

    /// All of them, for a ray that is sheared along the last of some axes.
    #[inline(always)]
    pub(crate) fn load<S: Simd>(&self, simd: S, [x, y, z]: [usize; 3]) -> Planes<S> {
        let normal = [&self.normal[x], &self.normal[y], &self.normal[z]];
        Planes {
            normal: [simd.load_f32(normal[0]), simd.load_f32(normal[1]), simd.load_f32(normal[2])],
            offset: simd.load_f32(&self.offset),
            off: simd.load_f32(&self.off),
        }
    }
}

impl<S: Simd> Planes<S> {
    #[inline(always)]
    pub(crate) fn meet(&self, simd: S, shears: &Shears<S>, rounding: Rounding) -> Meeting<S> {
        let ([nx, ny, nz], [sx, sy, inverse], [x, y, _]) = (self.normal, shears.factors, shears.crossings);
        let ahead = self.offset - nx.mul_add(x, ny * y);
        let rise = nz - nx.mul_add(sx, ny * sy);
        let per_rise = simd.splat_f32(1.0) / rise;
        let z = ahead * per_rise;
        let t = shears.distance(z);
        let off = simd.splat_f32(PLANE_MARGIN * rounding.vertex) + self.off;
        let slack = (inverse * per_rise).abs().mul_add(off, rounding.of_distances(simd, [t, t]));
        Meeting { z, rise, low: t - slack, high: t + slack }
    }
}

impl<S: Simd> Meeting<S> {
    /// The pairs of which the distances mean anything.
    #[inline(always)]
    pub(crate) fn is_steep(&self, simd: S) -> Mask<S> {
        self.rise.abs().ge(simd.splat_f32(LEAST_RISE))
    }
}
