//! Triangles in single precision: where rays pass through them, if they do, told apart as in `interval.rs`.

use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::interval::{Intervals, SpanLanes, splat};
use crate::ray::{CullRay, SINGLE};
use crate::shaft::BoxBlock;
use crate::shear::Shears;

/// How far a sheared vertex may be off, in units of the rounding of what lies in the scene.
pub const VERTEX_MARGIN: f32 = 7.25;
/// How far a distance may be off: in that unit times `1 / d_z`, and in roundings of the distance where `z` is 0.
pub const DISTANCE_MARGIN: [f32; 2] = [3.5, 1.25];
/// How far an edge function may be off: by the size of what it is made of and the error of a vertex, by the square of that
/// error, and, in roundings, by the square of the size.
pub const EDGE_MARGIN: [f32; 3] = [4.25, 3.0, 10.5];
/// How far distances may be off besides, in roundings of the farthest vertex's.
const OWN_ROUNDINGS: f32 = 3.5;
/// How far the distance of a hit may be off relative to how far its triangle stretches along the ray: in errors of an edge
/// function relative to the area, and in roundings.
pub const WEIGHT_MARGIN: [f32; 2] = [5.5, 8.0];

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

    /// The vertices of a lane.
    #[inline(always)]
    pub(crate) fn vertices(&self, lane: usize) -> [[f32; 3]; 3] {
        let [ax, ay, az, bx, by, bz, cx, cy, cz] = &self.vertices;
        let lane = lane % W;
        [[ax[lane], ay[lane], az[lane]], [bx[lane], by[lane], bz[lane]], [cx[lane], cy[lane], cz[lane]]]
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
        self.shear(simd, ray).intervals(simd, ray.rounding(), &ray.shears(simd), &span, front, back)
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
        let z = simd.load_f32(&self.vertices[first + z]);
        let x = simd.load_f32(&self.vertices[first + x]);
        let y = simd.load_f32(&self.vertices[first + y]);
        ray.shears(simd).of([x, y, z])
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

/// How far tests in single precision of what is sheared may be off.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rounding {
    /// A sheared vertex.
    pub(crate) vertex: f32,
    /// The largest factor of the shears, and at least 1.
    pub(crate) steepness: f32,
    /// A distance, apart from a triangle's weights.
    pub(crate) distance: f32,
}

impl Rounding {
    /// How far the edge functions of a triangle may be off whose largest coordinate across the ray is `size`.
    #[inline(always)]
    fn of_size<S: Simd>(self, simd: S, size: S::F32) -> S::F32 {
        let [first, second, own] = EDGE_MARGIN;
        let linear = size.mul_add(simd.splat_f32(own * SINGLE), simd.splat_f32(first * self.vertex));
        size.mul_add(linear, simd.splat_f32(second * self.vertex * self.vertex))
    }

    /// The same of a triangle that the ray passes through, by its largest extent along an axis.
    #[inline(always)]
    pub(crate) fn of_edges<S: Simd>(self, simd: S, extent: S::F32) -> S::F32 {
        // No vertex is farther from the ray than twice the extent, sheared.
        let most = extent.mul_add(simd.splat_f32(2.0 * self.steepness), simd.splat_f32(4.0 * self.vertex));
        self.of_size(simd, most)
    }

    /// How far distances along a ray may be off, by the least and the greatest of them.
    #[inline(always)]
    pub(crate) fn of_distances<S: Simd>(self, simd: S, [nearest, farthest]: [S::F32; 2]) -> S::F32 {
        let own = simd.splat_f32(OWN_ROUNDINGS * SINGLE);
        nearest.max_abs(farthest).mul_add(own, simd.splat_f32(self.distance))
    }

    #[cfg(test)]
    pub(crate) fn times(self, factor: f32) -> Self {
        Self { vertex: factor * self.vertex, distance: factor * self.distance, ..self }
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
        let error = rounding.of_size(simd, size);
        Sides {
            error,
            may_front: self.least.ge(-error),
            may_back: self.greatest.le(error),
            front: self.least.gt(error),
            back: self.greatest.lt(-error),
        }
    }

    /// How far along the rays the vertices lie.
    #[inline(always)]
    fn distances(&self, shears: &Shears<S>) -> [S::F32; 3] {
        let [[_, _, a], [_, _, b], [_, _, c]] = self.vertices;
        [shears.distance(a), shears.distance(b), shears.distance(c)]
    }

    /// Where the rays hit the triangles, of which the front and the back may be hit by some.
    #[inline(always)]
    pub(crate) fn intervals(
        &self,
        simd: S,
        rounding: Rounding,
        shears: &Shears<S>,
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
        let [a, b, c] = self.distances(shears);
        let (nearest, farthest) = (a.min(b).min(c), a.max(b).max(c));
        let inverse = simd.splat_f32(1.0) / (u + v + w);
        // From the first vertex on: what is added is rounded relative to the triangle only.
        let t = v.mul_add(b - a, w * (c - a)).mul_add(inverse, a);
        let [of_edges, of_weights] = WEIGHT_MARGIN;
        let range = farthest - nearest;
        let slack = rounding.of_distances(simd, [nearest, farthest]);
        let slack_of_sure = range.mul_add(simd.splat_f32(of_weights * SINGLE), slack);
        let weights = sides.error * simd.splat_f32(of_edges) * range;
        let slack_of_sure = weights.mul_add(inverse.abs(), slack_of_sure);
        let low = (t - slack_of_sure).select(sure, nearest - slack);
        let high = t + slack_of_sure;
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
