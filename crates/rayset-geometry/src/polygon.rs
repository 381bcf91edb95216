//! Planar polygons, convex or not.

use glam::DVec3;
use rayset_simd::{LaneMask, Lanes, MAX_LANES, Scalar, Simd};

use crate::crossing::{Crossed, Crossing, Crossings};
use crate::{BoundingSphere, Probe, ShearedLanes, Side, compare_products, enclosing_sphere};

/// A polygon whose vertices lie in one plane, in world space; its front is where they go round counterclockwise.
///
/// It may be concave; where it crosses itself, what is inside an odd number of times is inside, and each part has
/// its front where its own edges go round counterclockwise.
/// Vertices that lie off the plane by rounding do no harm: a hit's distance is interpolated between its edges.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    vertices: Vec<DVec3>,
    normal: DVec3,
}

impl Polygon {
    /// A polygon; `None` if it has fewer than three vertices, one that is not finite, or no area.
    ///
    /// The normal is Newell's: the vector area, scaled to unit length.
    #[must_use]
    pub fn new(vertices: Vec<DVec3>) -> Option<Self> {
        if vertices.len() < 3 || vertices.iter().any(|vertex| !vertex.is_finite()) {
            return None;
        }
        let first = vertices[0];
        let area = vertices[1..]
            .windows(2)
            .fold(DVec3::ZERO, |area, pair| area + (pair[0] - first).cross(pair[1] - first));
        Some(Self { normal: crate::unit(area)?, vertices })
    }

    /// The vertices in order, in world space; the last is joined to the first.
    #[must_use]
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// The unit normal of the front.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// The smallest enclosing sphere, to within the bound that [`enclosing_sphere`] states.
    #[must_use]
    pub fn bounding_sphere(&self) -> BoundingSphere {
        enclosing_sphere(&[self.clone().into()])
    }
}

/// The side from which a ray meets a polygon, and `t`; `None` if it misses.
///
/// `load(i)` gives x, y and z of the vertices from `i` on, a lane each; vertex `count` is the first once more, and
/// lanes beyond it may hold anything finite.
///
/// In sheared space (see [`crate::Shear`]) the ray is the z axis. The edges that cross the x axis are counted on
/// its positive half; an odd number means inside. A vertex with `y = 0` counts as below and a crossing at
/// `x = 0` as left, so of two polygons that share an edge exactly one is hit, whatever the rounding: the sign of
/// a crossing is taken from its exact products where rounding leaves it in doubt. The side is the sense in which
/// the edges wind round the ray, which holds even where the ray is so nearly in the plane that the rounded normal
/// would not know. `t` lies on the line between the nearest crossing on either side, so the hit lies on the
/// polygon, or at least in its convex hull if it is concave and seen edge-on: no ray, however nearly in the plane,
/// hits outside its bounds.
///
/// Source: the crossing number of Shimrat 1962, in the space of Woop et al. 2013.
#[inline(always)]
pub(crate) fn intersect<S: Simd>(
    probe: &Probe<S>,
    vertices: &impl Vertices<S>,
    count: usize,
) -> Option<(Side, f64)> {
    let (simd, axes, ray) = (probe.simd, probe.shear.axes, probe.sheared());
    let zero = simd.splat_f64(0.0);
    let mut crossings = Crossings::none(f64::INFINITY);
    let mut winding = 0;
    let mut parts = Parts::new(count);
    while let Some(i) = parts.next(probe, &ray, vertices) {
        let p @ [px, py, _] = sheared(&ray, axes, vertices.load(simd, i));
        let q @ [qx, qy, _] = sheared(&ray, axes, vertices.load(simd, i + 1));
        let (p_above, q_above) = (py.gt(zero), qy.gt(zero));
        let real = (1_u32 << (count - i).min(S::F64::LANES)) - 1;
        let mut crossing = ((p_above & !q_above) | (q_above & !p_above)).bits() & real;
        if crossing == 0 {
            continue;
        }
        let crossed = Crossed::of(p, q);
        let (mut numerators, mut rises) = ([0.0; MAX_LANES], [0.0; MAX_LANES]);
        crossed.numerator.store(&mut numerators);
        crossed.rise.store(&mut rises);
        let (mut xs, mut depths) = ([0.0; MAX_LANES], [0.0; MAX_LANES]);
        crossed.at.x.store(&mut xs);
        crossed.at.depth.store(&mut depths);
        while crossing != 0 {
            let lane = crossing.trailing_zeros() as usize % MAX_LANES;
            crossing &= crossing - 1;
            let numerator = numerators[lane];
            let sign = if numerator.abs() > 0.0 {
                numerator.total_cmp(&0.0)
            } else {
                compare_products(px.lane(lane), qy.lane(lane), py.lane(lane), qx.lane(lane))
            };
            let rises = rises[lane] > 0.0;
            let candidate = Crossing { x: xs[lane], depth: depths[lane] };
            if sign.is_ne() && sign.is_gt() == rises {
                winding += if rises { 1 } else { -1 };
                crossings.add_right(true, candidate, 0.0);
            } else {
                crossings.add_left(true, candidate, 0.0);
            }
        }
    }
    if winding % 2 == 0 {
        return None;
    }
    // Clockwise about the ray's direction is counterclockwise for the eye.
    let side = if winding < 0 { Side::Front } else { Side::Back };
    Some((side, crossings.depth_of_ray(0.0)))
}

/// Where rays meet a polygon of `count` vertices, a ray a lane: the lanes that hit it, and `t`; of the rays, the lanes whose
/// front and back may be hit.
///
/// The arithmetic of [`intersect`], and its bits: every edge is asked about all rays, where that one asks a ray about
/// several edges.
#[inline(always)]
pub(crate) fn intersect_by_rays<S: Simd>(
    simd: S,
    rays: &ShearedLanes<S>,
    corners: &impl Corners<S>,
    count: usize,
    (front, back): (<S::F64 as Lanes>::Mask, <S::F64 as Lanes>::Mask),
) -> (<S::F64 as Lanes>::Mask, S::F64) {
    let (zero, one) = (simd.splat_f64(0.0), simd.splat_f64(1.0));
    let mut crossings = Crossings::none(simd.splat_f64(f64::INFINITY));
    let (mut is_odd, mut winding) = (simd.mask_f64(0), zero);
    let wanted = front | back;
    for part in 0..count.div_ceil(PART) {
        if count > LONG && !(wanted & may_cross(simd, rays, corners.part(simd, part))).any() {
            continue;
        }
        let first = part * PART;
        let mut p = corners.vertex(simd, first);
        let mut p_along = rays.along(p[2]);
        let mut p_y = rays.across(1, p[1], p_along);
        for i in first..(first + PART).min(count) {
            let q = corners.vertex(simd, i + 1);
            let q_along = rays.along(q[2]);
            let q_y = rays.across(1, q[1], q_along);
            let (p_above, q_above) = (p_y.gt(zero), q_y.gt(zero));
            let crossing = wanted & ((p_above & !q_above) | (q_above & !p_above));
            if crossing.any() {
                let factor = rays.factors[2];
                let sheared_p = [rays.across(0, p[0], p_along), p_y, factor * p_along];
                let sheared_q = [rays.across(0, q[0], q_along), q_y, factor * q_along];
                let Crossed { rise, numerator, at } = Crossed::of(sheared_p, sheared_q);
                let (mut positive, mut negative) = (numerator.gt(zero), numerator.lt(zero));
                let doubtful = crossing & !(positive | negative);
                if doubtful.any() {
                    let [more, less] = signs_of_products(doubtful.bits(), sheared_p, sheared_q);
                    (positive, negative) = (positive | simd.mask_f64(more), negative | simd.mask_f64(less));
                }
                let rises = rise.gt(zero);
                let is_right = crossing & ((positive & rises) | (negative & !rises));
                is_odd = (is_odd & !is_right) | (is_right & !is_odd);
                winding = winding + one.select(rises, -one).select(is_right, zero);
                crossings.add_right(is_right, at, zero);
                crossings.add_left(crossing & !is_right, at, zero);
            }
            (p, p_along, p_y) = (q, q_along, q_y);
        }
    }
    let met = is_odd & ((winding.lt(zero) & front) | (winding.gt(zero) & back));
    let t = crossings.depth_of_ray(zero);
    let [start, end] = rays.span;
    (met & t.gt(start) & t.lt(end), t)
}

/// Of some lanes, those in which the exact `p_x q_y - p_y q_x` is positive, and negative.
#[cold]
fn signs_of_products<L: Lanes<Scalar = f64>>(
    mut lanes: u32,
    [px, py, _]: [L; 3],
    [qx, qy, _]: [L; 3],
) -> [u32; 2] {
    let mut signs = [0; 2];
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize;
        lanes &= lanes - 1;
        let sign = compare_products(px.lane(lane), qy.lane(lane), py.lane(lane), qx.lane(lane));
        signs[0] |= u32::from(sign.is_gt()) << lane;
        signs[1] |= u32::from(sign.is_lt()) << lane;
    }
    signs
}

/// Where the corners of a polygon are read from, each in every lane, in the order of each ray's axes. A trait and not a
/// closure, since it must be inlined always.
pub(crate) trait Corners<S: Simd> {
    /// Vertex `i`; vertex `count` is the first once more.
    fn vertex(&self, simd: S, i: usize) -> [S::F64; 3];

    /// Lower y and z of the box of a part, and upper ones.
    fn part(&self, simd: S, part: usize) -> [[S::F64; 2]; 2];
}

/// Where the vertices are read from. A trait and not a closure, since it must be inlined always.
pub(crate) trait Vertices<S: Simd> {
    /// The vertices `i`, `i + 1`, ... as many as there are lanes; the first stands once more after the last.
    fn load(&self, simd: S, i: usize) -> [S::F64; 3];

    /// Which of the parts `first`, `first + 1`, ... as many as there are lanes, may have an edge that crosses the x axis.
    #[inline(always)]
    fn may_cross(&self, _probe: &Probe<S>, _ray: &ShearedLanes<S>, _first: usize) -> u32 {
        u32::MAX
    }
}

/// How many edges stand in one part of a polygon.
const PART: usize = 8;
/// Polygons of more edges are tested part by part: first the boxes of parts, then the edges of those that may cross.
const LONG: usize = 2 * PART;

/// The boxes of the parts of a polygon: lower x, y, z, then upper, `PART` edges a box; nothing unless it is [`LONG`].
pub(crate) fn boxes_of(vertices: &[DVec3]) -> impl Iterator<Item = [f64; 6]> {
    let count = vertices.len();
    let n = if count > LONG { count.div_ceil(PART) } else { 0 };
    (0..n).map(move |part| {
        let ends = part * PART..=((part + 1) * PART).min(count);
        let of_part = ends.map(|i| vertices[i % count]);
        let (low, high) = of_part.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), vertex| {
            (low.min(vertex), high.max(vertex))
        });
        [low.x, low.y, low.z, high.x, high.y, high.z]
    })
}

/// Which boxes may hold an edge that crosses the x axis of sheared space, a ray and a box a lane: lower y and z of the boxes,
/// and upper ones, by the axes of each ray.
///
/// An edge crosses it whose ends are told apart by whether their sheared y is above zero. What is computed here for the
/// ends of a box is computed by the operations of [`ShearedLanes::shear`], each of which is monotonic in every operand,
/// rounding and all: so no vertex of the box has a computed y beyond these two, and there is no margin.
#[inline(always)]
pub(crate) fn may_cross<S: Simd>(
    simd: S,
    rays: &ShearedLanes<S>,
    [[low_y, low_z], [high_y, high_z]]: [[S::F64; 2]; 2],
) -> <S::F64 as Lanes>::Mask {
    let (zero, [_, oy, _], [_, sy, _]) = (simd.splat_f64(0.0), rays.origin, rays.factors);
    let (at_low, at_high) = (sy * rays.along(low_z), sy * rays.along(high_z));
    let least = (low_y - oy) - at_low.max(at_high);
    let greatest = (high_y - oy) - at_low.min(at_high);
    // Coordinates so large that their difference is no number bound nothing.
    let is_bound = at_low.eq(at_low) & at_high.eq(at_high);
    !(is_bound & (least.gt(zero) | greatest.le(zero)))
}

/// Goes through the edges of a polygon that may cross the x axis, as many at a time as there are lanes.
struct Parts {
    count: usize,
    /// The next edge, and the end of its part.
    next: usize,
    end: usize,
    /// The parts that may cross, of those from `base` on.
    bits: u32,
    base: usize,
    next_base: usize,
}

impl Parts {
    #[inline(always)]
    fn new(count: usize) -> Self {
        // A short polygon is one part.
        let end = if count > LONG { 0 } else { count };
        Self { count, next: 0, end, bits: 0, base: 0, next_base: 0 }
    }

    /// The first of the edges to be tested next.
    #[inline(always)]
    fn next<S: Simd>(
        &mut self,
        probe: &Probe<S>,
        ray: &ShearedLanes<S>,
        vertices: &impl Vertices<S>,
    ) -> Option<usize> {
        if self.next >= self.end {
            if self.count <= LONG {
                return None;
            }
            let n = self.count.div_ceil(PART);
            while self.bits == 0 {
                self.base = self.next_base;
                if self.base >= n {
                    return None;
                }
                self.next_base += S::F64::LANES;
                let real = (1 << (n - self.base).min(S::F64::LANES)) - 1;
                self.bits = vertices.may_cross(probe, ray, self.base) & real;
            }
            let part = self.base + self.bits.trailing_zeros() as usize;
            self.bits &= self.bits - 1;
            self.next = part * PART;
            self.end = (self.next + PART).min(self.count);
        }
        let next = self.next;
        self.next += S::F64::LANES;
        Some(next)
    }
}

impl Vertices<Scalar> for Polygon {
    #[inline(always)]
    fn load(&self, _: Scalar, i: usize) -> [f64; 3] {
        self.vertices[if i < self.vertices.len() { i } else { 0 }].to_array()
    }
}

/// A vertex in sheared space, with the distance along the ray for a depth.
#[inline(always)]
fn sheared<S: Simd>(ray: &ShearedLanes<S>, [ax, ay, az]: [usize; 3], vertex: [S::F64; 3]) -> [S::F64; 3] {
    let [x, y, z] = ray.shear([vertex[ax], vertex[ay], vertex[az]]);
    [x, y, ray.factors[2] * z]
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;
    use crate::{Primitive, Ray, Sides, Span};

    /// An L in the plane z = 2: the unit square twice as wide, without its upper right quarter.
    fn l_shape() -> Primitive {
        let corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)];
        Polygon::new(corners.iter().map(|&(x, y)| dvec3(x, y, 2.0)).collect()).unwrap().into()
    }

    fn hit(polygon: &Primitive, origin: DVec3, direction: DVec3, sides: Sides) -> Option<f64> {
        polygon.intersect(&Ray::new(origin, direction), Span::FORWARD, sides, None)
    }

    #[test]
    fn concave_polygon_is_hit_inside_only() {
        for (x, y, inside) in [(0.5, 0.5, true), (1.5, 0.5, true), (0.5, 1.5, true), (1.5, 1.5, false)] {
            let expected = inside.then_some(2.0);
            assert_eq!(hit(&l_shape(), dvec3(x, y, 0.0), DVec3::Z, Sides::Both), expected, "({x}, {y})");
        }
    }

    #[test]
    fn front_is_where_the_vertices_go_round_counterclockwise() {
        assert_eq!(hit(&l_shape(), dvec3(0.5, 0.5, 5.0), -DVec3::Z, Sides::Front), Some(3.0));
        assert_eq!(hit(&l_shape(), dvec3(0.5, 0.5, 0.0), DVec3::Z, Sides::Front), None);
        assert_eq!(hit(&l_shape(), dvec3(0.5, 0.5, 0.0), DVec3::Z, Sides::Back), Some(2.0));
    }

    #[test]
    fn polygons_that_share_an_edge_are_hit_once() {
        let square = |x: f64, y: f64| {
            let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
            Primitive::from(
                Polygon::new(corners.iter().map(|c| dvec3(x + c.0, y + c.1, 2.0)).collect()).unwrap(),
            )
        };
        let squares = [square(0.0, 0.0), square(1.0, 0.0), square(0.0, 1.0), square(1.0, 1.0)];
        for (x, y) in [(1.0, 1.0), (1.0, 0.5), (0.5, 1.0), (1.0, 1.5), (0.5, 0.5)] {
            let hits = squares.iter().filter(|s| hit(s, dvec3(x, y, 0.0), DVec3::Z, Sides::Both).is_some());
            assert_eq!(hits.count(), 1, "({x}, {y})");
        }
    }

    #[test]
    fn ray_in_the_plane_misses() {
        assert_eq!(hit(&l_shape(), dvec3(-1.0, 0.5, 2.0), DVec3::X, Sides::Both), None);
    }

    #[test]
    fn ray_nearly_in_the_plane_hits_inside_the_bounds() {
        for slope in [1e-3, 1e-8, 1e-15, 1e-17, 1e-300] {
            let direction = crate::unit(dvec3(1.0, 0.0, slope)).unwrap();
            if let Some(t) = hit(&l_shape(), dvec3(-1.0, 0.5, 2.0 - slope), direction, Sides::Both) {
                assert!((1.0..=3.0).contains(&t), "{slope}: {t}");
            }
        }
    }

    #[test]
    fn polygons_without_area_are_refused() {
        assert_eq!(Polygon::new(vec![DVec3::ZERO, DVec3::X]), None);
        assert_eq!(Polygon::new(vec![DVec3::ZERO, DVec3::X, 2.0 * DVec3::X]), None);
        assert_eq!(Polygon::new(vec![DVec3::ZERO, DVec3::X, DVec3::NAN]), None);
    }
}
