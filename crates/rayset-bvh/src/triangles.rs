//! Triangles in single precision: where rays pass through them, if they do, told apart as in `interval.rs`.

use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::interval::{Intervals, SpanLanes, splat};
use crate::ray::CullRay;
use crate::shaft::BoxBlock;

/// How far a sheared vertex may be off.
pub const VERTEX_MARGIN: f32 = 12.0;
/// How far the distance of a vertex may be off.
pub(crate) const DEPTH_MARGIN: f32 = 12.0;
/// How far a distance to a triangle may be off, apart from its weights.
const TRIANGLE_DISTANCE_MARGIN: f32 = 40.0;

/// `W` triangles.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct TriangleBlock<const W: usize> {
    /// Coordinate `k` of vertex `v` is `3 v + k`.
    vertices: [[f32; W]; 9],
}

impl<const W: usize> TriangleBlock<W> {
    /// A block without triangles.
    pub(crate) const EMPTY: Self = Self { vertices: [[f32::NAN; W]; 9] };

    #[expect(clippy::cast_possible_truncation, reason = "the margins make up for the rounding")]
    pub(crate) fn set(&mut self, lane: usize, vertices: [[f64; 3]; 3]) {
        for (column, coordinate) in self.vertices.iter_mut().zip(vertices.as_flattened()) {
            column[lane] = *coordinate as f32;
        }
    }

    /// A vertex of a lane.
    pub(crate) fn at(&self, lane: usize, vertex: usize) -> [f32; 3] {
        std::array::from_fn(|k| self.vertices[3 * vertex + k][lane])
    }

    /// Turns a triangle so that it begins with one of its vertices.
    pub(crate) fn turn(&mut self, lane: usize, first: usize) {
        let vertices = [0, 1, 2].map(|vertex| self.at(lane, (first + vertex) % 3));
        for (column, coordinate) in self.vertices.iter_mut().zip(vertices.as_flattened()) {
            column[lane] = *coordinate;
        }
    }

    /// The triangles, sheared along a ray.
    #[inline(always)]
    pub(crate) fn shear<S: Simd, const N: usize>(&self, simd: S, ray: CullRay<'_, N>) -> Sheared<S> {
        Sheared::of([self.vertex(simd, ray, 0), self.vertex(simd, ray, 3), self.vertex(simd, ray, 6)])
    }

    /// Where a ray hits the triangles whose `front` and `back` may be hit.
    #[inline(always)]
    pub(crate) fn intervals<S: Simd, const N: usize>(
        &self,
        simd: S,
        ray: CullRay<'_, N>,
        end: f32,
        front: u32,
        back: u32,
    ) -> Intervals<S> {
        let span = SpanLanes::of(simd, ray, end);
        let (front, back) = (simd.mask_f32(front), simd.mask_f32(back));
        let rounding = Rounding { unit: ray.unit(), scale: 1.0 };
        let depth = simd.splat_f32(ray.factors()[2]);
        self.shear(simd, ray).intervals(simd, rounding, depth, &span, front, back)
    }

    /// Three columns, sheared.
    #[inline(always)]
    pub(crate) fn vertex<S: Simd, const N: usize>(
        &self,
        simd: S,
        ray: CullRay<'_, N>,
        first: usize,
    ) -> [S::F32; 3] {
        let [x, y, z] = ray.axes;
        let [ox, oy, oz] = splat(simd, ray.sheared());
        let [sx, sy, _] = splat(simd, ray.factors());
        let z = simd.load_f32(&self.vertices[first + z]);
        let x = simd.load_f32(&self.vertices[first + x]);
        let y = simd.load_f32(&self.vertices[first + y]);
        [z.mul_add(sx, x) - ox, z.mul_add(sy, y) - oy, z - oz]
    }
}

/// Triangles sheared along rays, a pair a lane, and their edge functions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sheared<S: Simd> {
    vertices: [[S::F32; 3]; 3],
    u: S::F32,
    v: S::F32,
    w: S::F32,
    least: S::F32,
    greatest: S::F32,
}

/// The rounding of a coordinate, and by how much more a shear along an axis that is not the dominant one adds to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rounding {
    pub(crate) unit: f32,
    pub(crate) scale: f32,
}

impl Rounding {
    /// How far a sheared vertex may be off.
    #[inline(always)]
    fn of_vertex(self) -> f32 {
        self.scale * VERTEX_MARGIN * self.unit
    }

    /// How far the edge functions of a triangle may be off if the ray passes through it, by its largest extent along an
    /// axis.
    #[inline(always)]
    pub(crate) fn of_edges<S: Simd>(self, simd: S, extent: S::F32) -> S::F32 {
        // No vertex is farther from the ray than twice the extent, sheared.
        let error = self.of_vertex();
        let (linear, constant) = (12.0 * error * self.scale, 36.0 * error * error);
        extent.mul_add(simd.splat_f32(linear), simd.splat_f32(constant))
    }
}

impl<S: Simd> Sheared<S> {
    #[inline(always)]
    pub(crate) fn of(vertices: [[S::F32; 3]; 3]) -> Self {
        let [[ax, ay, _], [bx, by, _], [cx, cy, _]] = vertices;
        let u = cx.mul_sub(by, cy * bx);
        let v = ax.mul_sub(cy, ay * cx);
        let w = bx.mul_sub(ay, by * ax);
        Self { vertices, u, v, w, least: u.min(v).min(w), greatest: u.max(v).max(w) }
    }

    /// `a b c` and `a c d`.
    #[inline(always)]
    pub(crate) fn two([a, b, c, d]: [[S::F32; 3]; 4]) -> [Self; 2] {
        let first = Self::of([a, b, c]);
        let ([ax, ay, _], [cx, cy, _], [dx, dy, _]) = (a, c, d);
        let u = dx.mul_sub(cy, dy * cx);
        let v = ax.mul_sub(dy, ay * dx);
        let w = -first.v;
        let vertices = [a, c, d];
        [first, Self { vertices, u, v, w, least: u.min(v).min(w), greatest: u.max(v).max(w) }]
    }

    /// The pairs of which the ray may pass through the triangle, by [`Rounding::of_edges`]: some more than
    /// [`Sheared::sides`] says, and sooner known.
    #[inline(always)]
    pub(crate) fn near(&self, error: S::F32) -> <S::F32 as Lanes>::Mask {
        self.least.ge(-error) | self.greatest.le(error)
    }

    /// From which sides the rays pass through the triangles.
    #[inline(always)]
    pub(crate) fn sides(&self, simd: S, rounding: Rounding) -> Sides<S> {
        let [[ax, ay, _], [bx, by, _], [cx, cy, _]] = self.vertices;
        let size = ax.max_abs(ay).max_abs(bx.max_abs(by)).max_abs(cx.max_abs(cy));
        // |a_x b_y - a_y b_x| is off by 5.2 e m, rounded up, and what is left of second order.
        let error = rounding.of_vertex();
        let (first, second) = (6.0 * error, 4.0 * error * error);
        let error = size.mul_add(simd.splat_f32(first), simd.splat_f32(second));
        let twice = error + error;
        Sides {
            error,
            may_front: self.least.ge(-error),
            may_back: self.greatest.le(error),
            front: self.least.gt(twice),
            back: self.greatest.lt(-twice),
        }
    }

    /// How far along the rays the vertices lie, by what turns depths into distances.
    #[inline(always)]
    pub(crate) fn depths(&self, sz: S::F32) -> [S::F32; 3] {
        let [[_, _, az], [_, _, bz], [_, _, cz]] = self.vertices;
        [sz * az, sz * bz, sz * cz]
    }

    /// Where the rays hit the triangles, of which the front and the back may be hit by some; by what turns depths into
    /// distances.
    #[inline(always)]
    pub(crate) fn intervals(
        &self,
        simd: S,
        rounding: Rounding,
        sz: S::F32,
        span: &SpanLanes<S>,
        front: <S::F32 as Lanes>::Mask,
        back: <S::F32 as Lanes>::Mask,
    ) -> Intervals<S> {
        let sides = self.sides(simd, rounding);
        let possible = (sides.may_front & front) | (sides.may_back & back);
        if !possible.any() {
            // Most leaves are done with here.
            return Intervals { possible, sure: possible, low: sides.error, high: sides.error };
        }
        let Self { u, v, w, .. } = *self;
        let sure = (sides.front & front) | (sides.back & back);
        let [a_depth, b_depth, c_depth] = self.depths(sz);
        let nearest = a_depth.min(b_depth).min(c_depth);
        let range = a_depth.max(b_depth).max(c_depth) - nearest;
        let determinant = u + v + w;
        let inverse = simd.splat_f32(1.0) / determinant;
        let t = u.mul_add(a_depth, v.mul_add(b_depth, w * c_depth)) * inverse;
        let slack = simd.splat_f32(rounding.scale * TRIANGLE_DISTANCE_MARGIN * rounding.unit);
        let weights = simd.splat_f32(6.5) * sides.error * range * inverse.abs();
        let low = (t - (weights + slack)).select(sure, nearest - slack);
        let high = t + (weights + slack);
        let possible = possible & low.le(span.ends) & !(sure & high.lt(span.start));
        Intervals {
            possible,
            sure: sure & possible & low.gt(span.start_above) & high.lt(span.end_below),
            low,
            high,
        }
    }
}

/// From which sides rays pass through triangles, a pair a lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sides<S: Simd> {
    /// How far the edge functions may be off.
    error: S::F32,
    /// Whether a ray may pass through the front, and the back.
    pub(crate) may_front: <S::F32 as Lanes>::Mask,
    pub(crate) may_back: <S::F32 as Lanes>::Mask,
    /// Whether it surely does.
    pub(crate) front: <S::F32 as Lanes>::Mask,
    pub(crate) back: <S::F32 as Lanes>::Mask,
}

impl<const W: usize> TriangleBlock<W> {
    /// The boxes of the triangles, and the largest extent of each along an axis.
    #[inline(always)]
    pub(crate) fn boxes<S: Simd>(&self, simd: S, boxes: &mut BoxBlock<W>) -> S::F32 {
        let mut extent = simd.splat_f32(0.0);
        for k in 0..3 {
            let a = simd.load_f32(&self.vertices[k]);
            let (b, c) = (simd.load_f32(&self.vertices[3 + k]), simd.load_f32(&self.vertices[6 + k]));
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            extent = extent.max(high - low);
            boxes.set_all::<S>(k, [low, high]);
        }
        extent
    }

    /// The columns of the coordinates of three vertices, in an order of the axes.
    #[inline(always)]
    pub(crate) fn columns(&self, [x, y, z]: [usize; 3]) -> [[&[f32; W]; 3]; 3] {
        let [ax, ay, az, bx, by, bz, cx, cy, cz] = &self.vertices;
        let [a, b, c] = [[ax, ay, az], [bx, by, bz], [cx, cy, cz]];
        [[a[x], a[y], a[z]], [b[x], b[y], b[z]], [c[x], c[y], c[z]]]
    }

    /// A triangle's vertices, the same in every lane.
    #[inline(always)]
    pub(crate) fn one<S: Simd>(&self, simd: S, lane: usize, axes: [usize; 3]) -> [[S::F32; 3]; 3] {
        one_of(simd, &self.columns(axes), lane)
    }
}

/// A triangle's vertices by their columns, the same in every lane.
#[inline(always)]
pub(crate) fn one_of<S: Simd, const W: usize>(
    simd: S,
    [a, b, c]: &[[&[f32; W]; 3]; 3],
    lane: usize,
) -> [[S::F32; 3]; 3] {
    [splat(simd, at_lane(a, lane)), splat(simd, at_lane(b, lane)), splat(simd, at_lane(c, lane))]
}

/// Three coordinates in a lane.
#[inline(always)]
pub(crate) fn at_lane<const W: usize>([x, y, z]: &[&[f32; W]; 3], lane: usize) -> [f32; 3] {
    [x[lane % W], y[lane % W], z[lane % W]]
}
