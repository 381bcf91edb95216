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
    for i in (0..count).step_by(S::F64::LANES) {
        let ([px, py, pz], [qx, qy, qz]) = (
            sheared(probe, factors, vertices.load(simd, i)),
            sheared(probe, factors, vertices.load(simd, i + 1)),
        );
        let (p_above, q_above) = (py.gt(zero), qy.gt(zero));
        let real = (1_u32 << (count - i).min(S::F64::LANES)) - 1;
        let crossing = ((p_above & !q_above) | (q_above & !p_above)).bits() & real;
        if crossing == 0 {
            continue;
        }
        let numerator = px * qy - py * qx;
        let rise = qy - py;
        let fraction = -py / rise;
        // x is no quotient of the numerator, which may have lost its digits to underflow.
        let mut depth_lanes = [0.0; MAX_LANES];
        let mut x_lanes = [0.0; MAX_LANES];
        between(fraction, pz, qz).store(&mut depth_lanes);
        between(fraction, px, qx).store(&mut x_lanes);
        for lane in 0..S::F64::LANES {
            if crossing >> lane & 1 == 0 {
                continue;
            }
            let sign = if numerator.lane(lane).abs() > 0.0 {
                numerator.lane(lane).total_cmp(&0.0)
            } else {
                compare_products(px.lane(lane), qy.lane(lane), py.lane(lane), qx.lane(lane))
            };
            let is_right = sign.is_ne() && sign.is_gt() == (rise.lane(lane) > 0.0);
            let candidate = Crossing { x: x_lanes[lane], depth: depth_lanes[lane] };
            if is_right {
                winding += if rise.lane(lane) > 0.0 { 1 } else { -1 };
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
