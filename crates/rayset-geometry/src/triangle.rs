//! Triangles, watertight.

use glam::DVec3;
use rayset_simd::{LaneMask, Lanes, MAX_LANES, Scalar, Simd};

use crate::crossing::Crossings;
use crate::departure::Allowed;
use crate::{
    BoundingSphere, PrimitiveKind, Probe, ShearedLanes, Side, Sides, compare_products, enclosing_sphere,
};

/// A triangle, in world space; its front is where its vertices go round counterclockwise.
///
/// A triangle without area is allowed and never hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    vertices: [DVec3; 3],
}

impl Triangle {
    /// A triangle of three vertices.
    ///
    /// # Panics
    ///
    /// If a vertex is not finite.
    #[must_use]
    pub fn new(a: DVec3, b: DVec3, c: DVec3) -> Self {
        assert!(a.is_finite() && b.is_finite() && c.is_finite(), "vertex of ({a}, {b}, {c}) is not finite");
        Self { vertices: [a, b, c] }
    }

    /// A triangle of vertices that are known to be finite.
    #[inline(always)]
    pub(crate) fn of_finite(vertices: [DVec3; 3]) -> Self {
        debug_assert!(vertices.iter().all(|vertex| vertex.is_finite()), "they are finite");
        Self { vertices }
    }

    /// The three vertices, in world space.
    #[must_use]
    pub fn vertices(&self) -> &[DVec3; 3] {
        &self.vertices
    }

    /// The vertices of one triangle, in every lane: as of [`Triangle::intersect_pairs`], in an order of the world's axes.
    ///
    /// # Panics
    ///
    /// If there is no such axis.
    #[must_use]
    #[inline(always)]
    pub fn splat<S: Simd>(&self, simd: S, [x, y, z]: [usize; 3]) -> [[S::F64; 3]; 3] {
        let zero = simd.splat_f64(0.0);
        let mut vertices = [[zero; 3]; 3];
        for (lanes, vertex) in vertices.iter_mut().zip(&self.vertices) {
            // As an array: of a point each coordinate is looked for by comparing.
            let vertex: &[f64; 3] = vertex.as_ref();
            *lanes = [simd.splat_f64(vertex[x]), simd.splat_f64(vertex[y]), simd.splat_f64(vertex[z])];
        }
        vertices
    }

    /// The vertices of triangles, one a lane: as of [`Triangle::intersect_pairs`], in the order of the world's axes.
    ///
    /// # Panics
    ///
    /// If there are fewer triangles than lanes.
    #[must_use]
    #[inline(always)]
    pub fn collect<S: Simd>(simd: S, triangles: &[&Self]) -> [[S::F64; 3]; 3] {
        let triangles = &triangles[..S::F64::LANES];
        let zero = simd.splat_f64(0.0);
        let mut vertices = [[zero; 3]; 3];
        for (v, lanes) in vertices.iter_mut().enumerate() {
            *lanes = [
                simd.collect_f64(|lane| triangles[lane].vertices[v].x),
                simd.collect_f64(|lane| triangles[lane].vertices[v].y),
                simd.collect_f64(|lane| triangles[lane].vertices[v].z),
            ];
        }
        vertices
    }

    /// The unit normal of the front; along +z for a triangle without area.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        let [a, b, c] = self.vertices;
        crate::unit((b - a).cross(c - a)).unwrap_or(DVec3::Z)
    }

    /// The weights of the vertices at a point of the triangle; they add up to 1.
    ///
    /// The point is projected along the dominant axis of the normal. A triangle without area gives `(1, 0, 0)`.
    #[must_use]
    pub fn barycentric(&self, point: DVec3) -> [f64; 3] {
        let [a, b, c] = self.vertices;
        let normal = (b - a).cross(c - a).abs();
        let axis = if normal.x > normal.y && normal.x > normal.z {
            0
        } else if normal.y > normal.z {
            1
        } else {
            2
        };
        let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
        // As arrays: of a point each coordinate is looked for by comparing.
        let [a, b, c] = [a, b, c].map(|vertex| (vertex - point).to_array());
        let area = |p: [f64; 3], q: [f64; 3]| p[i] * q[j] - p[j] * q[i];
        let weights = [area(b, c), area(c, a), area(a, b)];
        let sum = weights[0] + weights[1] + weights[2];
        if sum.abs() > 0.0 { weights.map(|weight| weight / sum) } else { [1.0, 0.0, 0.0] }
    }

    /// The distance at which a ray hits that was prepared for triangles; `departure` is the side into which it left this
    /// very triangle, if it did.
    #[must_use]
    #[inline(always)]
    pub fn intersect(&self, probe: &Probe<Scalar>, sides: Sides, departure: Option<Side>) -> Option<f64> {
        let [a, b, c]: [&[f64; 3]; 3] = self.vertices.each_ref().map(AsRef::as_ref);
        let [x, y, z] = probe.shear.axes;
        let vertices = [[a[x], a[y], a[z]], [b[x], b[y], b[z]], [c[x], c[y], c[z]]];
        let allowed = Allowed::of_one(PrimitiveKind::Triangle, sides, departure);
        let (is_hit, t) = intersect(probe, vertices, allowed);
        is_hit.then_some(t)
    }

    /// The smallest enclosing sphere, to within the bound that [`enclosing_sphere`] states.
    #[must_use]
    pub fn bounding_sphere(&self) -> BoundingSphere {
        enclosing_sphere(&[(*self).into()])
    }
}

/// How large `(|products| of the edge functions) (range of the depths)` may be against `determinant (largest depth)`
/// before `t` is interpolated between the edges. Derived in `docs/numerics.md`.
const STEADY: f64 = 8.0;

/// Below this, the edge functions' products may have lost digits to underflow, and so may those with depths; in world
/// units squared, and cubed.
const LEAST_DETERMINANT: f64 = 1e-280;

/// Where a ray meets triangles, a lane each: the lanes that are hit, and `t`.
///
/// `vertices[v][k]` is coordinate `k` of vertex `v`, with the axes in the order of the probe's shear.
/// In sheared space the ray is the z axis, so the triangle is hit when the origin of the xy plane lies in it:
/// when the edge functions `u = c_x b_y - c_y b_x`, ... have one sign. A product rounds monotonically, so the
/// computed sign is right unless the difference is zero; there the exact products decide. A ray exactly through
/// an edge or vertex hits every triangle that shares it. `t` is the convex combination of the vertices' depths
/// with the edge functions as weights. Their rounding errors displace the hit the farther the more edge-on the
/// triangle is seen; beyond a bound that [`PARTITION_MARGIN`](crate::PARTITION_MARGIN) covers, `t` is interpolated
/// between the edges instead, as in a polygon: so every hit lies on the triangle.
///
/// Source: Woop, Benthin, Wald 2013, "Watertight ray/triangle intersection".
/// Deviation: exact integers, not wider floats, decide the doubtful signs.
#[inline(always)]
pub(crate) fn intersect<S: Simd>(
    probe: &Probe<S>,
    vertices: [[S::F64; 3]; 3],
    allowed: Allowed<S>,
) -> (<S::F64 as Lanes>::Mask, S::F64) {
    let Allowed { front, back } = allowed;
    Triangle::intersect_pairs(probe.simd, &probe.sheared(), vertices, (front, back))
}

impl Triangle {
    /// Where rays meet triangles, a pair a lane: the lanes that are hit, and `t`; of the rays, how they are sheared, of
    /// the triangles, coordinate `k` of vertex `v` in `vertices[v][k]`, in the order of each ray's axes, and the lanes
    /// whose front and back may be hit.
    ///
    /// The arithmetic of [`Triangle::intersect`], and its bits.
    #[must_use]
    #[inline(always)]
    pub fn intersect_pairs<S: Simd>(
        simd: S,
        rays: &ShearedLanes<S>,
        vertices: [[S::F64; 3]; 3],
        sides: (<S::F64 as Lanes>::Mask, <S::F64 as Lanes>::Mask),
    ) -> (<S::F64 as Lanes>::Mask, S::F64) {
        let sheared = Sheared::of(rays, vertices);
        let visible = sheared.visible(simd, sides);
        if !visible.any() {
            return (visible, simd.splat_f64(0.0));
        }
        let [start, end] = rays.span;
        let t = sheared.distances(simd, rays.factors[2], visible);
        (visible & t.gt(start) & t.lt(end), t)
    }

    /// Where rays meet triangles that they are known to hit, a pair a lane: `t` as of [`Triangle::intersect_pairs`], with
    /// its bits, in the lanes in which that would say that there is a hit; elsewhere anything.
    #[must_use]
    #[inline(always)]
    pub fn distances_of_pairs<S: Simd>(
        simd: S,
        rays: &ShearedLanes<S>,
        vertices: [[S::F64; 3]; 3],
        hit: <S::F64 as Lanes>::Mask,
    ) -> S::F64 {
        Sheared::of(rays, vertices).distances(simd, rays.factors[2], hit)
    }
}

/// Triangles sheared along rays, a pair a lane, and their edge functions.
struct Sheared<S: Simd> {
    vertices: [[S::F64; 3]; 3],
    products: [(S::F64, S::F64); 3],
    edges: [S::F64; 3],
}

impl<S: Simd> Sheared<S> {
    #[inline(always)]
    fn of(rays: &ShearedLanes<S>, vertices: [[S::F64; 3]; 3]) -> Self {
        let [a, b, c] = vertices;
        let vertices = [rays.shear(a), rays.shear(b), rays.shear(c)];
        let [[ax, ay, _], [bx, by, _], [cx, cy, _]] = vertices;
        let products = [(cx * by, cy * bx), (ax * cy, ay * cx), (bx * ay, by * ax)];
        let [u, v, w] = products;
        Self { vertices, products, edges: [u.0 - u.1, v.0 - v.1, w.0 - w.1] }
    }

    /// The lanes in which the ray passes through a side that may be hit: the front, or the back.
    #[inline(always)]
    fn visible(
        &self,
        simd: S,
        (front, back): (<S::F64 as Lanes>::Mask, <S::F64 as Lanes>::Mask),
    ) -> <S::F64 as Lanes>::Mask {
        let zero = simd.splat_f64(0.0);
        let Self { vertices: [[ax, ay, _], [bx, by, _], [cx, cy, _]], edges: [u, v, w], .. } = *self;
        let mut negative = u.lt(zero) | v.lt(zero) | w.lt(zero);
        let mut positive = u.gt(zero) | v.gt(zero) | w.gt(zero);
        // Not where nothing may be hit: lanes without a pair hold anything.
        let doubtful = (u.eq(zero) | v.eq(zero) | w.eq(zero)) & !(negative & positive) & (front | back);
        if doubtful.any() {
            let edges = [(u, cx, by, cy, bx), (v, ax, cy, ay, cx), (w, bx, ay, by, ax)];
            for lane in 0..S::F64::LANES {
                if doubtful.bits() >> lane & 1 == 0 {
                    continue;
                }
                for (edge, a, b, c, d) in edges {
                    if edge.lane(lane).abs() > 0.0 {
                        continue;
                    }
                    match compare_products(a.lane(lane), b.lane(lane), c.lane(lane), d.lane(lane)) {
                        std::cmp::Ordering::Less => negative = negative | simd.mask_f64(1 << lane),
                        std::cmp::Ordering::Greater => positive = positive | simd.mask_f64(1 << lane),
                        std::cmp::Ordering::Equal => {}
                    }
                }
            }
        }
        // The edge functions are positive when the vertices go round clockwise about the ray's direction, which is
        // counterclockwise for the eye. Their exact signs count: all three may have rounded to zero.
        (positive & !negative & front) | (negative & !positive & back)
    }

    /// Where the ray meets the triangle, in the lanes in which it passes through it; elsewhere anything.
    #[inline(always)]
    fn distances(&self, simd: S, sz: S::F64, passed: <S::F64 as Lanes>::Mask) -> S::F64 {
        let Self { vertices: [[ax, ay, az], [bx, by, bz], [cx, cy, cz]], products, edges: [u, v, w] } = *self;
        let (a_depth, b_depth, c_depth) = (sz * az, sz * bz, sz * cz);
        let determinant = u + v + w;
        let t = (u * a_depth + v * b_depth + w * c_depth) / determinant;
        let [(u_left, u_right), (v_left, v_right), (w_left, w_right)] = products;
        let u_size = u_left.abs().max(u_right.abs());
        let v_size = v_left.abs().max(v_right.abs());
        let w_size = w_left.abs().max(w_right.abs());
        let depth_range = az.max(bz).max(cz) - az.min(bz).min(cz);
        let depth_size = az.abs().max(bz.abs()).max(cz.abs());
        // Of a triangle that is small for its distance, the products with depths may underflow before the weights do.
        let numerator_size = determinant.abs() * depth_size;
        let steady = ((u_size + v_size + w_size) * depth_range).lt(simd.splat_f64(STEADY) * numerator_size)
            & determinant.abs().min(numerator_size).gt(simd.splat_f64(LEAST_DETERMINANT));
        let unsteady = passed & !steady;
        if !unsteady.any() {
            return t;
        }
        let mut t_lanes = [0.0; MAX_LANES];
        t.store(&mut t_lanes);
        let mut stored = [[0.0; MAX_LANES]; 9];
        for (stored, value) in stored.iter_mut().zip([ax, ay, a_depth, bx, by, b_depth, cx, cy, c_depth]) {
            value.store(stored);
        }
        for (lane, t) in t_lanes.iter_mut().enumerate().take(S::F64::LANES) {
            if unsteady.bits() >> lane & 1 == 1 {
                let vertex = |k: usize| std::array::from_fn(|axis| stored[3 * k + axis][lane]);
                // NaN lies in no span.
                let depth = Crossings::depth_in_triangle([vertex(0), vertex(1), vertex(2)]);
                *t = depth.unwrap_or(f64::NAN);
            }
        }
        simd.load_f64(&t_lanes)
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "the values are exact, worked out by hand")]
mod tests {
    use approx::abs_diff_eq;
    use glam::dvec3;

    use super::*;
    use crate::{Primitive, Ray, Span};

    fn triangle() -> Primitive {
        Triangle::new(dvec3(0.0, 0.0, 2.0), dvec3(1.0, 0.0, 2.0), dvec3(0.0, 1.0, 2.0)).into()
    }

    fn hit(origin: DVec3, direction: DVec3, sides: Sides) -> Option<f64> {
        triangle().intersect(&Ray::new(origin, direction), Span::FORWARD, sides, None)
    }

    #[test]
    fn interior_ray_hits_from_the_side_that_is_visible() {
        // The vertices go round counterclockwise for an eye above, at greater z.
        let (above, below) = (dvec3(0.25, 0.25, 5.0), dvec3(0.25, 0.25, 0.0));
        assert_eq!(hit(above, -DVec3::Z, Sides::Front), Some(3.0));
        assert_eq!(hit(above, -DVec3::Z, Sides::Back), None);
        assert_eq!(hit(below, DVec3::Z, Sides::Back), Some(2.0));
        assert_eq!(hit(below, DVec3::Z, Sides::Front), None);
        assert_eq!(hit(below, DVec3::Z, Sides::Both), Some(2.0));
    }

    #[test]
    fn front_does_not_depend_on_the_dominant_axis() {
        let Primitive::Triangle(triangle) = triangle() else { unreachable!() };
        for turn in 0..3 {
            let turned = |p: DVec3| DVec3::from_array([p[turn % 3], p[(turn + 1) % 3], p[(turn + 2) % 3]]);
            let [a, b, c] = triangle.vertices.map(turned);
            let primitive = Primitive::from(Triangle::new(a, b, c));
            let ray = Ray::new(turned(dvec3(0.25, 0.25, 5.0)), turned(-DVec3::Z));
            assert_eq!(primitive.intersect(&ray, Span::FORWARD, Sides::Front, None), Some(3.0), "{turn}");
            assert_eq!(primitive.intersect(&ray, Span::FORWARD, Sides::Back, None), None, "{turn}");
        }
    }

    #[test]
    fn edges_and_vertices_belong_to_the_triangle() {
        for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.0), (0.5, 0.5)] {
            assert_eq!(hit(dvec3(x, y, 0.0), DVec3::Z, Sides::Both), Some(2.0), "({x}, {y})");
        }
        assert_eq!(hit(dvec3(-f64::MIN_POSITIVE, 0.5, 0.0), DVec3::Z, Sides::Both), None);
    }

    #[test]
    fn ray_in_the_plane_misses() {
        assert_eq!(hit(dvec3(-1.0, 0.25, 2.0), DVec3::X, Sides::Both), None);
        assert_eq!(hit(dvec3(-1.0, 0.0, 2.0), DVec3::X, Sides::Both), None);
    }

    #[test]
    fn triangle_without_area_is_never_hit() {
        let a = dvec3(0.0, 0.0, 2.0);
        for flat in [Triangle::new(a, a, a), Triangle::new(a, a + DVec3::X, a + 2.0 * DVec3::X)] {
            let ray = Ray::new(DVec3::ZERO, DVec3::Z);
            assert_eq!(Primitive::from(flat).intersect(&ray, Span::FORWARD, Sides::Both, None), None);
        }
    }

    #[test]
    fn negative_zeros_and_subnormal_components_hit_alike() {
        for tiny in [0.0, -0.0, f64::from_bits(1), -f64::MIN_POSITIVE / 2.0] {
            assert_eq!(hit(dvec3(0.25, 0.25, 0.0), dvec3(tiny, -tiny, 1.0), Sides::Both), Some(2.0));
        }
    }

    #[test]
    fn doubtful_edge_is_decided_exactly() {
        // The edge function of the origin against the edge from p to q is p_x q_y - p_y q_x = e^2, which rounds to
        // zero: the edge passes the origin at a distance of about 1e-32, on the side of (-5, 5).
        let e = f64::EPSILON;
        let (p, q) = (dvec3(1.0 + e, 1.0, 1.0), dvec3(-1.0, e - 1.0, 1.0));
        assert_eq!(p.x * q.y - p.y * q.x, 0.0);
        let ray = Ray::new(DVec3::ZERO, DVec3::Z);
        let sides = [dvec3(-5.0, 5.0, 1.0), dvec3(5.0, -5.0, 1.0)];
        let hits = sides.map(|apex| {
            let triangle = Primitive::from(Triangle::new(p, q, apex));
            triangle.intersect(&ray, Span::FORWARD, Sides::Both, None).is_some()
        });
        assert_eq!(hits, [false, true], "exactly one of two triangles that share the edge is hit");
    }

    #[test]
    fn all_edges_in_doubt_are_decided_exactly() {
        // Seen edge-on but for e^2: every edge function rounds to zero, and none is.
        let e = f64::EPSILON;
        let (p, q) = (dvec3(1.0 + e, 1.0, 1.0), dvec3(-1.0, e - 1.0, 2.0));
        let apex = dvec3(-1.0 - 2.0 * e, -1.0 - e, 3.0);
        let edges = [(p, q), (q, apex), (apex, p)];
        assert_eq!(edges.map(|(a, b)| a.x * b.y - a.y * b.x), [0.0; 3]);
        let exact = edges.map(|(a, b)| compare_products(a.x, b.y, a.y, b.x));
        assert_eq!(exact, [std::cmp::Ordering::Greater; 3]);
        let sliver = Primitive::from(Triangle::new(p, q, apex));
        let t = sliver.intersect(&Ray::new(DVec3::ZERO, DVec3::Z), Span::FORWARD, Sides::Both, None).unwrap();
        // It passes between the edges from p to q and from p to the apex.
        assert!((1.5..=2.0).contains(&t), "{t}");
    }

    #[test]
    fn underflowing_products_cost_no_digits() {
        let corners = [dvec3(-1.0, -2.0, 3.0), dvec3(4.0, -1.0, 5.0), dvec3(-1.5, 3.0, 7.0)];
        let t = |scale: f64| {
            let [a, b, c] = corners.map(|corner| scale * corner);
            let primitive = Primitive::from(Triangle::new(a, b, c));
            let ray = Ray::new(DVec3::ZERO, DVec3::Z);
            primitive.intersect(&ray, Span::FORWARD, Sides::Both, None).unwrap() / scale
        };
        for scale in [1e-100, 1e-150, 1e-155, 1e-158, 1e-161, 1e-200] {
            assert!(
                abs_diff_eq!(t(scale), t(1.0), epsilon = 1e-14),
                "{scale}: {} against {}",
                t(scale),
                t(1.0)
            );
        }
    }

    #[test]
    fn underflowing_numerators_cost_no_digits() {
        let corners = [dvec3(-1.0, -2.0, 0.0), dvec3(4.0, -1.0, 0.0), dvec3(-1.5, 3.0, 0.0)];
        for (size, distance) in [(1e-111, 1e-100), (1e-115, 1e-95), (1e-120, 1e-83), (1e-139, 1e-44)] {
            let [a, b, c] = corners.map(|corner| size * corner + distance * DVec3::Z);
            let primitive = Primitive::from(Triangle::new(a, b, c));
            let ray = Ray::new(DVec3::ZERO, DVec3::Z);
            let t = primitive.intersect(&ray, Span::FORWARD, Sides::Both, None).unwrap();
            assert!(abs_diff_eq!(t / distance, 1.0, epsilon = 1e-14), "{size:e} at {distance:e}: {t:e}");
        }
    }

    #[test]
    fn barycentric_weights_recover_the_point() {
        let Primitive::Triangle(triangle) = triangle() else { unreachable!() };
        assert_eq!(triangle.barycentric(dvec3(0.25, 0.5, 2.0)), [0.25, 0.25, 0.5]);
        assert_eq!(triangle.normal(), DVec3::Z);
    }
}
