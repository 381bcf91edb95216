//! Polygons that are shaded as if they were curved.

use std::ops::Range;

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Polygon, Sides};

use crate::Part;

/// A polygon with a normal at each vertex, which shade it and never move a hit.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// The shape.
    pub polygon: Polygon,
    /// From which sides rays hit it, light rays too.
    pub sides: Sides,
    /// A normal for each vertex, in world space and in the order of the vertices; they need not have unit length.
    ///
    /// Between the vertices they are interpolated with mean value coordinates, which a polygon of any shape has; in a
    /// triangle they are the barycentric ones.
    pub normals: Vec<DVec3>,
}

impl Patch {
    /// The polygon without its normals, and the normals.
    pub(crate) fn split(self) -> (Part, Vec<DVec3>) {
        (Part { sides: self.sides, ..self.polygon.into() }, self.normals)
    }
}

/// A vertex of a patch.
#[derive(Clone, Copy, Debug)]
struct Corner {
    vertex: DVec3,
    normal: DVec3,
}

/// The vertex normals of a scene's polygons.
#[derive(Debug, Default)]
pub(crate) struct PatchNormals {
    corners: Vec<Corner>,
    /// The corners of each polygon, by its index in the columns; empty for one without normals. Polygons beyond the
    /// last patch are left out.
    ranges: Vec<Range<usize>>,
}

impl PatchNormals {
    /// Adds the normals of the polygon with the given index, which must exceed all indices before.
    pub(crate) fn push(&mut self, index: u32, vertices: &[DVec3], normals: &[DVec3]) {
        let start = self.corners.len();
        let corner = |(&vertex, &normal): (&DVec3, &DVec3)| Corner { vertex, normal };
        self.corners.extend(vertices.iter().zip(normals).map(corner));
        self.ranges.resize(index as usize, 0..0);
        self.ranges.push(start..self.corners.len());
    }

    /// The normal at a point of a polygon in the plane with the given unit normal, of any length; `None` if the polygon
    /// has no vertex normals or they add up to nothing there.
    pub(crate) fn at(&self, index: u32, plane: DVec3, point: DVec3) -> Option<DVec3> {
        let corners = &self.corners[self.ranges.get(index as usize)?.clone()];
        interpolate(corners, plane, point)
    }
}

/// Nearer than this to a vertex or edge, relative to the distances of the vertices, a point counts as on it: so far off
/// rounding puts any point.
const ON_EDGE: f64 = 1.0 / (1_u64 << 50) as f64;

/// Interpolates the normals of a polygon with mean value coordinates.
///
/// From the point, with `r_i` the distance of vertex `i` and `a_i` the signed angle to the next vertex, the weight of
/// vertex `i` is `(tan(a_(i-1) / 2) + tan(a_i / 2)) / r_i`. The tangents take no trigonometry: `tan(a / 2)` is
/// `sin a / (1 + cos a)`, or `(1 - cos a) / sin a`, whichever loses no digits. The weights add up to more than zero
/// wherever a polygon does not cross itself; they reproduce linear functions, and on an edge they are those of its ends.
///
/// Source: Floater 2003, "Mean value coordinates"; for concave polygons, Hormann and Floater 2006, "Mean value
/// coordinates for arbitrary planar polygons".
fn interpolate(corners: &[Corner], plane: DVec3, point: DVec3) -> Option<DVec3> {
    let offset = |corner: &Corner| {
        let offset = corner.vertex - point;
        offset - offset.dot(plane) * plane
    };
    let size = corners.iter().map(|corner| offset(corner).abs().max_element()).fold(0.0, f64::max);
    if !(size > 0.0 && size.is_finite()) {
        return None;
    }
    let mut sum = DVec3::ZERO;
    let mut total = 0.0;
    for (i, p) in corners.iter().enumerate() {
        let q = &corners[(i + 1) % corners.len()];
        let (to_p, to_q) = (offset(p) / size, offset(q) / size);
        let (p_distance, q_distance) = (to_p.length(), to_q.length());
        if p_distance <= ON_EDGE {
            return Some(p.normal);
        }
        if q_distance <= ON_EDGE {
            return Some(q.normal);
        }
        let product = p_distance * q_distance;
        let (sine, cosine) = (plane.dot(to_p.cross(to_q)), to_p.dot(to_q));
        if cosine < 0.0 && sine.abs() <= ON_EDGE * product {
            let share = p_distance / (p_distance + q_distance);
            return Some((1.0 - share) * p.normal + share * q.normal);
        }
        let tangent = if cosine < 0.0 { (product - cosine) / sine } else { sine / (product + cosine) };
        let (p_weight, q_weight) = (tangent / p_distance, tangent / q_distance);
        sum += p_weight * p.normal + q_weight * q.normal;
        total += p_weight + q_weight;
    }
    (total.abs() > 0.0).then(|| sum / total).filter(|normal| normal.is_finite())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;
    use rayset_geometry::glam::dvec3;
    use rayset_geometry::unit;

    use super::*;
    use crate::{Material, SceneBuilder};

    /// A concave arrowhead in the plane through three points: corners as they lie along `x` and `y` from `origin`.
    fn arrowhead(origin: DVec3, x: DVec3, y: DVec3) -> Vec<DVec3> {
        let at = |u: f64, v: f64| origin + u * x + v * y;
        vec![at(0.0, 0.0), at(2.0, 2.0), at(0.0, 4.0), at(0.8, 2.0)]
    }

    fn corners(vertices: &[DVec3], normals: impl Fn(DVec3) -> DVec3) -> Vec<Corner> {
        vertices.iter().map(|&vertex| Corner { vertex, normal: normals(vertex) }).collect()
    }

    #[test]
    fn vertices_and_edges_have_their_own_normals() {
        let vertices = arrowhead(DVec3::ZERO, DVec3::X, DVec3::Y);
        let normals = [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X];
        let all: Vec<_> =
            vertices.iter().zip(normals).map(|(&vertex, normal)| Corner { vertex, normal }).collect();
        for (vertex, normal) in vertices.iter().zip(normals) {
            assert_eq!(interpolate(&all, DVec3::Z, *vertex), Some(normal));
        }
        assert_eq!(interpolate(&all, DVec3::Z, dvec3(0.5, 0.5, 0.0)), Some(dvec3(0.75, 0.25, 0.0)));
        // Beside the edge by less and by more than what counts as on it.
        for beside in [1e-17, 1e-14, 1e-9] {
            let near = interpolate(&all, DVec3::Z, dvec3(0.5, 0.5 + beside, 0.0)).unwrap();
            assert!((near - dvec3(0.75, 0.25, 0.0)).length() < 10.0 * beside + 1e-15, "{beside:e}: {near}");
        }
    }

    #[test]
    fn weights_of_a_square_are_those_of_its_symmetry() {
        let square = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        let all = corners(&square, |vertex| dvec3(vertex.x * vertex.y, 0.0, 1.0));
        let middle = interpolate(&all, DVec3::Z, dvec3(0.5, 0.5, 0.0)).unwrap();
        assert!((middle - dvec3(0.25, 0.0, 1.0)).length() < 1e-15, "{middle}");
    }

    #[test]
    fn polygon_that_crosses_itself_gives_nothing_where_its_weights_cancel() {
        let bow =
            [dvec3(-1.0, -1.0, 0.0), dvec3(1.0, 1.0, 0.0), dvec3(1.0, -1.0, 0.0), dvec3(-1.0, 1.0, 0.0)];
        let all = corners(&bow, |_| DVec3::Z);
        // Where it crosses itself, an edge decides; beside, whatever comes is finite.
        assert_eq!(interpolate(&all, DVec3::Z, DVec3::ZERO), Some(DVec3::Z));
        assert!(interpolate(&all, DVec3::Z, dvec3(0.0, 0.5, 0.0)).is_none_or(DVec3::is_finite));
    }

    #[test]
    fn patches_are_objects_whose_normals_must_fit() {
        let square = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        let patch = |offset: f64, normals: Vec<DVec3>| {
            let vertices = square.iter().map(|&vertex| vertex + offset * DVec3::Z).collect();
            Patch { polygon: Polygon::new(vertices).unwrap(), sides: Sides::Front, normals }
        };
        let build = |normals: Vec<DVec3>, max| {
            let mut builder = SceneBuilder::new();
            let material = builder.add_material(Material::default());
            let plain = patch(0.0, Vec::new()).split().0;
            builder.add_object("floor", material, [plain.clone(), plain.clone()]);
            let good = |offset: f64, normal| patch(offset, vec![normal; 4]);
            builder.add_patches(
                "quilt",
                material,
                [good(9.0, DVec3::X), patch(1.0, normals), good(5.0, DVec3::Y)],
            );
            builder.add_object("roof", material, [plain]);
            builder.max_volume_primitives(max);
            builder.build()
        };
        // However the object is split, a patch keeps its normals.
        for max in [None, Some(1), Some(2)] {
            let scene = build(vec![DVec3::ONE; 4], max).unwrap();
            let shading = |i| scene.surface_at(crate::PrimitiveId(i), DVec3::splat(0.25)).shading_normal;
            let diagonal = DVec3::ONE / 3.0_f64.sqrt();
            let expected = [DVec3::Z, DVec3::Z, DVec3::X, diagonal, DVec3::Y, DVec3::Z];
            for (i, expected) in (0..).zip(expected) {
                assert!((shading(i) - expected).length() < 1e-14, "{max:?}: {i}");
            }
        }
        let refused = |normals| build(normals, None).unwrap_err().to_string();
        let expected = "object `quilt`: a patch needs as many normals as it has vertices";
        assert_eq!(refused(vec![DVec3::ONE; 3]), expected);
        assert_eq!(refused(vec![DVec3::NAN; 4]), "object `quilt`: a vertex normal is not finite");
    }

    fn vector() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-1.0..1.0).prop_map(DVec3::from_array)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 3000, rng_seed: RngSeed::Fixed(1987), ..ProptestConfig::default() })]

        #[test]
        fn linear_fields_are_reproduced_inside_concave_polygons(
            (origin, x, y) in (vector(), vector(), vector()), rows in prop::array::uniform3(vector()),
            (along, across) in (0.01..0.99, 0.01..0.99), scale in prop::sample::select(vec![1e-6, 1.0, 1e9]),
        ) {
            let Some(plane) = unit(x.cross(y)).filter(|_| x.cross(y).length() > 1e-2) else { return Ok(()) };
            let vertices: Vec<_> = arrowhead(origin, x, y).iter().map(|&v| scale * v).collect();
            let field = |v: DVec3| rows[0] + dvec3(rows[1].dot(v), rows[2].dot(v), (rows[1] + rows[2]).dot(v)) / scale;
            let all = corners(&vertices, field);
            // The wing of the notch and the first two corners make a triangle inside.
            let point = vertices[0].lerp(vertices[1].lerp(vertices[3], across), along);
            let normal = interpolate(&all, plane, point).unwrap();
            prop_assert!((normal - field(point)).length() < 1e-9, "{} against {}", normal, field(point));
        }

        #[test]
        fn every_point_has_a_finite_normal_or_none(
            vertices in prop::collection::vec((vector(), vector()), 3..9), plane in vector(), point in vector(),
            (u, who) in (prop::sample::select(vec![0.0, 1e-300, 1e-17, 1e-16, 1e-15, 0.5, 1.0]), any::<prop::sample::Index>()),
            scale in prop::sample::select(vec![1e-200, 1e-9, 1.0, 1e60]),
        ) {
            let Some(plane) = unit(plane) else { return Ok(()) };
            let all: Vec<_> = vertices
                .iter()
                .map(|&(vertex, normal)| Corner { vertex: scale * (vertex - vertex.dot(plane) * plane), normal })
                .collect();
            // On or near an edge, or anywhere.
            let (p, q) = (&all[who.index(all.len())], &all[(who.index(all.len()) + 1) % all.len()]);
            for point in [scale * point, p.vertex + u * (q.vertex - p.vertex), p.vertex + u * scale * point] {
                prop_assert!(interpolate(&all, plane, point).is_none_or(DVec3::is_finite));
            }
        }
    }
}
