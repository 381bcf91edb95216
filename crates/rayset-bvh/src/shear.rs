//! Rays in culling space, found in double precision and rounded once; and their shears.
//!
//! A sheared point is `x + s z - x_0`, where `x_0` is where the ray crosses the plane `z = 0` of culling space: that lies
//! near the scene, wherever the ray begins, if the ray meets the scene at all. So a sheared vertex is as good as the
//! vertex itself, for rays from far away too; see `VERTEX_MARGIN` in `docs/numerics.md`.

use std::ops::Range;

use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::columns::RayColumns;
use crate::frame::Frame;
use crate::interval::splat;
use crate::ray::SINGLE;
use crate::triangles::{DISTANCE_MARGIN, Rounding};

/// How many parts of double precision make the lanes of single precision, at most.
pub(crate) const MOST_PARTS: usize = 8;

/// `W` rays as columns of doubles, and how they come into culling space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Doubles<'a> {
    origins: [&'a [f64]; 3],
    directions: [&'a [f64]; 3],
    /// What is taken off the origins, and what they are then multiplied by.
    center: [f64; 3],
    scale: f64,
}

/// How rays are sheared, a lane each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shears<S: Simd> {
    /// `-d_x / d_z`, `-d_y / d_z` and `1 / d_z`.
    pub(crate) factors: [S::F32; 3],
    /// Where `z` is 0: x, y, and the distance.
    pub(crate) crossings: [S::F32; 3],
}

/// Rays in culling space, a lane each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ways<S: Simd> {
    /// In the order of the columns.
    pub(crate) origin: [S::F32; 3],
    pub(crate) direction: [S::F32; 3],
    pub(crate) shears: Shears<S>,
}

/// The lanes that are sheared along the first axis, or else along the last, or else along the second; and those whose
/// direction is negative along it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Along {
    pub(crate) first: u32,
    pub(crate) last: u32,
    pub(crate) turned: u32,
}

/// Rays, a lane each, and how they are sheared: all along one axis, or each along its own.
pub(crate) trait Shearing<S: Simd> {
    fn shears(&self) -> &Shears<S>;

    /// How far tests of what is sheared may be off.
    fn rounding(&self) -> Rounding;

    /// A vector, its axes in the order of each ray's shear.
    fn in_order(&self, simd: S, vector: [f32; 3]) -> [S::F32; 3];

    /// A point, sheared along each ray.
    #[inline(always)]
    fn shear(&self, simd: S, point: [f32; 3]) -> [S::F32; 3] {
        self.shears().of(self.in_order(simd, point))
    }
}

/// Rays, a lane each, that are sheared along one axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShearedAlike<S: Simd> {
    pub(crate) axes: [usize; 3],
    pub(crate) shears: Shears<S>,
    pub(crate) rounding: Rounding,
}

impl<S: Simd> Shearing<S> for ShearedAlike<S> {
    #[inline(always)]
    fn shears(&self) -> &Shears<S> {
        &self.shears
    }

    #[inline(always)]
    fn rounding(&self) -> Rounding {
        self.rounding
    }

    #[inline(always)]
    fn in_order(&self, simd: S, vector: [f32; 3]) -> [S::F32; 3] {
        let [x, y, z] = self.axes;
        splat(simd, [vector[x], vector[y], vector[z]])
    }
}

impl<S: Simd> Shears<S> {
    /// None yet.
    #[inline(always)]
    pub(crate) fn none(simd: S) -> Self {
        let zero = simd.splat_f32(0.0);
        Self { factors: [zero; 3], crossings: [zero; 3] }
    }

    /// A point, its axes in the order of the shear's: across the ray, and along the axis.
    #[inline(always)]
    pub(crate) fn of(&self, [x, y, z]: [S::F32; 3]) -> [S::F32; 3] {
        let ([sx, sy, _], [ox, oy, _]) = (self.factors, self.crossings);
        // In this order, since the difference is as small as x is, where the ray passes nearby.
        [z.mul_sub(sx, ox) + x, z.mul_sub(sy, oy) + y, z]
    }

    /// How far along the ray a depth along the axis is.
    #[inline(always)]
    pub(crate) fn distance(&self, z: S::F32) -> S::F32 {
        z.mul_add(self.factors[2], self.crossings[2])
    }

    /// How far that may be off, but for its own rounding: by the rounding of what lies in the scene times `1 / d_z`, and in
    /// roundings of where `z` is 0.
    #[inline(always)]
    pub(crate) fn distance_slack(&self, simd: S, unit: S::F32) -> S::F32 {
        let [along, start] = DISTANCE_MARGIN;
        let along = simd.splat_f32(along) * unit * self.factors[2].abs();
        self.crossings[2].abs().mul_add(simd.splat_f32(start * SINGLE), along)
    }
}

/// `W` rays in culling space.
#[derive(Clone, Debug)]
pub(crate) struct Room<const W: usize> {
    pub(crate) origins: [[f64; W]; 3],
    pub(crate) directions: [[f64; W]; 3],
}

impl<const W: usize> Room<W> {
    /// The rays of columns from `first` on, 1 to `W` of them, and the last again in the lanes that are left; moved along
    /// their directions.
    #[inline(never)]
    pub(crate) fn of(
        frame: &Frame,
        rays: &RayColumns<'_>,
        (first, len): (usize, usize),
        advance: f64,
    ) -> Self {
        let mut room = Self { origins: [[0.0; W]; 3], directions: [[0.0; W]; 3] };
        for lane in 0..W {
            let i = first + lane.min(len - 1);
            let direction = rays.direction(i);
            let origin = frame.point(rays.origin(i));
            // Not by nothing, which would turn -0.0 into 0.0.
            let origin = if advance > 0.0 { origin + advance * direction } else { origin };
            for k in 0..3 {
                (room.origins[k][lane], room.directions[k][lane]) = (origin[k], direction[k]);
            }
        }
        room
    }
}

impl<'a> Doubles<'a> {
    /// As culling space has them already.
    #[inline(always)]
    pub(crate) fn within<const W: usize>(room: &'a Room<W>) -> Self {
        let ([ox, oy, oz], [dx, dy, dz]) = (&room.origins, &room.directions);
        Self { origins: [ox, oy, oz], directions: [dx, dy, dz], center: [0.0; 3], scale: 1.0 }
    }

    /// As they stand in world space.
    #[inline(always)]
    pub(crate) fn of(frame: &Frame, rays: &RayColumns<'a>, range: Range<usize>) -> Self {
        let ([ox, oy, oz], [dx, dy, dz]) = (rays.origins, rays.directions);
        Self {
            origins: [&ox[range.clone()], &oy[range.clone()], &oz[range.clone()]],
            directions: [&dx[range.clone()], &dy[range.clone()], &dz[range]],
            center: frame.center.to_array(),
            scale: frame.scale,
        }
    }

    /// Origins and directions of the lanes from `at` on, the axes in another order.
    #[inline(always)]
    fn load<S: Simd>(&self, simd: S, at: usize, axes: [usize; 3]) -> [[S::F64; 3]; 2] {
        let zero = simd.splat_f64(0.0);
        let (mut origin, mut direction) = ([zero; 3], [zero; 3]);
        let scale = simd.splat_f64(self.scale);
        for k in 0..3 {
            let axis = axes[k];
            direction[k] = simd.load_f64(&self.directions[axis][at..]);
            let place = simd.load_f64(&self.origins[axis][at..]) - simd.splat_f64(self.center[axis]);
            origin[k] = place * scale;
        }
        [origin, direction]
    }

    /// The rays, and their shears along the last of the axes in some order.
    #[inline(always)]
    pub(crate) fn ways<S: Simd, const W: usize>(&self, simd: S, axes: [usize; 3]) -> Ways<S> {
        let zero = simd.splat_f64(0.0);
        let mut parts = Parts::<S>([[zero; MOST_PARTS]; 12]);
        for part in 0..W / S::F64::LANES {
            let [origin, direction] = self.load(simd, part * S::F64::LANES, axes);
            parts.set_ways(part, [origin, direction]);
            parts.set_shears(simd, part, [origin, direction]);
        }
        let mut ways = parts.rounded::<W>(simd);
        let (origin, direction) = (ways.origin, ways.direction);
        for k in 0..3 {
            ways.origin[axes[k]] = origin[k];
            ways.direction[axes[k]] = direction[k];
        }
        ways
    }

    /// The rays, and their shears, each along the axis along which it goes most.
    #[inline(always)]
    pub(crate) fn ways_of_each<S: Simd, const W: usize>(&self, simd: S) -> (Ways<S>, Along) {
        let zero = simd.splat_f64(0.0);
        let mut parts = Parts::<S>([[zero; MOST_PARTS]; 12]);
        let mut along = Along { first: 0, last: 0, turned: 0 };
        for part in 0..W / S::F64::LANES {
            let at = part * S::F64::LANES;
            let [origin, direction] = self.load(simd, at, [0, 1, 2]);
            parts.set_ways(part, [origin, direction]);
            let [x, y, z] = direction;
            let (x, y, z) = (x.abs(), y.abs(), z.abs());
            let (first, last) = (x.gt(y), z.ge(x.max(y)));
            let [_, _, dz] = turn_axes(direction, first, last, simd.mask_f64(0));
            let turned = dz.lt(zero);
            along.first |= first.bits() << at;
            along.last |= last.bits() << at;
            along.turned |= turned.bits() << at;
            let origin = turn_axes(origin, first, last, turned);
            let direction = turn_axes(direction, first, last, turned);
            parts.set_shears(simd, part, [origin, direction]);
        }
        (parts.rounded::<W>(simd), along)
    }
}

/// The coordinates across the axis of each lane's shear, and the one along it.
#[inline(always)]
pub(crate) fn turn_axes<L: Lanes>(
    [x, y, z]: [L; 3],
    along_first: L::Mask,
    along_last: L::Mask,
    turned: L::Mask,
) -> [L; 3] {
    let along = z.select(along_last, x.select(along_first, y));
    let next = x.select(along_last, y.select(along_first, z));
    let last = y.select(along_last, z.select(along_first, x));
    [last.select(turned, next), next.select(turned, last), along]
}

/// Origins, directions, factors and crossings in double precision, in as many parts as it takes.
struct Parts<S: Simd>([[S::F64; MOST_PARTS]; 12]);

impl<S: Simd> Parts<S> {
    #[inline(always)]
    fn set_ways(&mut self, part: usize, [origin, direction]: [[S::F64; 3]; 2]) {
        for k in 0..3 {
            self.0[k][part] = origin[k];
            self.0[3 + k][part] = direction[k];
        }
    }

    #[inline(always)]
    fn set_shears(&mut self, simd: S, part: usize, [[ox, oy, oz], [dx, dy, dz]]: [[S::F64; 3]; 2]) {
        let inverse = simd.splat_f64(1.0) / dz;
        let (sx, sy) = (-dx * inverse, -dy * inverse);
        self.0[6][part] = sx;
        self.0[7][part] = sy;
        self.0[8][part] = inverse;
        self.0[9][part] = ox + sx * oz;
        self.0[10][part] = oy + sy * oz;
        self.0[11][part] = -oz * inverse;
    }

    #[inline(always)]
    fn rounded<const W: usize>(&self, simd: S) -> Ways<S> {
        let zero = simd.splat_f32(0.0);
        let mut rounded = [zero; 12];
        for (rounded, parts) in rounded.iter_mut().zip(&self.0) {
            *rounded = simd.join_f32(&parts[..W / S::F64::LANES]);
        }
        let [ox, oy, oz, dx, dy, dz, sx, sy, inverse, x, y, t] = rounded;
        let shears = Shears { factors: [sx, sy, inverse], crossings: [x, y, t] };
        Ways { origin: [ox, oy, oz], direction: [dx, dy, dz], shears }
    }
}
