//! Planar polygons, convex or not.

use glam::DVec3;
use rayset_simd::{LaneMask, Lanes, MAX_LANES, Scalar, Simd};

use crate::crossing::{Crossing, Crossings};
use crate::probe::map3;
use crate::{BoundingSphere, Probe, Side, compare_products, enclosing_sphere};

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
    let simd = probe.simd;
    let zero = simd.splat_f64(0.0);
    let factors = map3(probe.shear.factors, |factor| simd.splat_f64(factor));
    let mut crossings = Crossings::default();
    let mut winding = 0;
    let mut parts = Parts::new(count);
    while let Some(i) = parts.next(probe, factors, vertices) {
        let ([px, py, pz], [qx, qy, qz]) = (
            sheared(probe, factors, vertices.load(simd, i)),
            sheared(probe, factors, vertices.load(simd, i + 1)),
        );
        let (p_above, q_above) = (py.gt(zero), qy.gt(zero));
        let real = (1_u32 << (count - i).min(S::F64::LANES)) - 1;
        let mut crossing = ((p_above & !q_above) | (q_above & !p_above)).bits() & real;
        if crossing == 0 {
            continue;
        }
        let rise = qy - py;
        let fraction = -py / rise;
        let (mut numerators, mut rises) = ([0.0; MAX_LANES], [0.0; MAX_LANES]);
        (px * qy - py * qx).store(&mut numerators);
        rise.store(&mut rises);
        // x is no quotient of the numerator, which may have lost its digits to underflow.
        let (mut xs, mut depths) = ([0.0; MAX_LANES], [0.0; MAX_LANES]);
        between(fraction, px, qx).store(&mut xs);
        between(fraction, pz, qz).store(&mut depths);
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
                crossings.add_right(candidate);
            } else {
                crossings.add_left(candidate);
            }
        }
    }
    if winding % 2 == 0 {
        return None;
    }
    // Clockwise about the ray's direction is counterclockwise for the eye.
    let side = if winding < 0 { Side::Front } else { Side::Back };
    Some((side, crossings.depth_of_ray()?))
}

/// Where the vertices are read from. A trait and not a closure, since it must be inlined always.
pub(crate) trait Vertices<S: Simd> {
    /// The vertices `i`, `i + 1`, ... as many as there are lanes; the first stands once more after the last.
    fn load(&self, simd: S, i: usize) -> [S::F64; 3];

    /// Which of the parts `first`, `first + 1`, ... as many as there are lanes, may have an edge that crosses the x axis.
    #[inline(always)]
    fn may_cross(&self, _probe: &Probe<S>, _factors: [S::F64; 3], _first: usize) -> u32 {
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

/// Which of the parts with the boxes from `first` on may have an edge that crosses the x axis of sheared space.
///
/// An edge crosses it whose ends are told apart by whether their sheared y is above zero. What is computed here for the
/// ends of a box is computed by the operations of [`sheared`], each of which is monotonic in every operand, rounding
/// and all: so no vertex of the box has a computed y beyond these two, and there is no margin.
#[inline(always)]
pub(crate) fn parts_that_may_cross<S: Simd>(
    probe: &Probe<S>,
    [_, sy, _]: [S::F64; 3],
    boxes: &[Vec<f64>; 6],
    first: usize,
) -> u32 {
    let ([_, ay, az], origin, simd) = (probe.shear.axes, &probe.lanes.origin, probe.simd);
    let plane = |k: usize| &boxes[k][first..];
    let zero = simd.splat_f64(0.0);
    let at_low = sy * (simd.load_f64(plane(az)) - origin[az]);
    let at_high = sy * (simd.load_f64(plane(3 + az)) - origin[az]);
    let least = (simd.load_f64(plane(ay)) - origin[ay]) - at_low.max(at_high);
    let greatest = (simd.load_f64(plane(3 + ay)) - origin[ay]) - at_low.min(at_high);
    // Coordinates so large that their difference is no number bound nothing.
    let is_bound = at_low.eq(at_low) & at_high.eq(at_high);
    !(is_bound & (least.gt(zero) | greatest.le(zero))).bits()
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
        factors: [S::F64; 3],
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
                self.bits = vertices.may_cross(probe, factors, self.base) & real;
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
fn sheared<S: Simd>(probe: &Probe<S>, [sx, sy, sz]: [S::F64; 3], vertex: [S::F64; 3]) -> [S::F64; 3] {
    let ([ax, ay, az], origin) = (probe.shear.axes, &probe.lanes.origin);
    let z = vertex[az] - origin[az];
    let x = (vertex[ax] - origin[ax]) - sx * z;
    let y = (vertex[ay] - origin[ay]) - sy * z;
    [x, y, sz * z]
}

/// A fraction of the way from `p` to `q`; where rounding leads beyond the ends, the clamp keeps the bound exact.
#[inline(always)]
fn between<L: Lanes>(fraction: L, p: L, q: L) -> L {
    (p + fraction * (q - p)).max(p.min(q)).min(p.max(q))
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
