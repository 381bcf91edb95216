//! How far points are from surfaces, by formulas of the tests' own.

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Polygon, Primitive};

/// The point of a segment that is nearest to a point.
pub(crate) fn nearest_on_segment(point: DVec3, [a, b]: [DVec3; 2]) -> DVec3 {
    let along = (point - a).dot(b - a) / (b - a).length_squared();
    let along = if along.is_finite() { along.clamp(0.0, 1.0) } else { 0.0 };
    a + along * (b - a)
}

/// The distance from a flat surface with these corners, tight to a few roundings of the coordinates.
///
/// The height over the plane is taken from the nearest point of the outline, since the normal of a sliver is too
/// inaccurate for a longer lever.
fn distance_to_flat(point: DVec3, corners: &[DVec3], normal: DVec3) -> f64 {
    let edge = |i: usize| nearest_on_segment(point, [corners[i], corners[(i + 1) % corners.len()]]);
    let outline = (0..corners.len()).map(edge).min_by(|p, q| p.distance(point).total_cmp(&q.distance(point)));
    let from_outline = point - outline.expect("there are corners");
    if winds_around(corners, normal, point) { from_outline.dot(normal).abs() } else { from_outline.length() }
}

/// How far a point is from a primitive's surface, in world units.
pub(crate) fn distance_to_surface(primitive: &Primitive, point: DVec3) -> f64 {
    match primitive {
        Primitive::Sphere(s) => (point.distance(s.center()) - s.radius()).abs(),
        Primitive::Triangle(t) => distance_to_flat(point, t.vertices(), t.normal()),
        Primitive::Polygon(p) => distance_to_flat(point, p.vertices(), p.normal()),
        Primitive::Cone(c) => {
            let from_base = point - c.base();
            let along = from_base.dot(c.axis());
            let lateral = (from_base - along * c.axis()).length();
            let height = c.base().distance(c.apex());
            let seen = DVec3::new(lateral, along, 0.0);
            let generator = [DVec3::new(c.base_radius(), 0.0, 0.0), DVec3::new(c.apex_radius(), height, 0.0)];
            seen.distance(nearest_on_segment(seen, generator))
        }
    }
}

/// Whether a polygon turns the same way at all its corners.
pub(crate) fn is_convex(polygon: &Polygon) -> bool {
    let (corners, n) = (polygon.vertices(), polygon.vertices().len());
    let turn =
        |i: usize| (corners[(i + 1) % n] - corners[i]).cross(corners[(i + 2) % n] - corners[(i + 1) % n]);
    (0..n).all(|i| turn(i).dot(polygon.normal()) >= 0.0)
}

/// Whether a polygon winds around a point, seen along its normal.
fn winds_around(vertices: &[DVec3], normal: DVec3, point: DVec3) -> bool {
    let x = normal.any_orthonormal_vector();
    let y = normal.cross(x);
    let seen = |v: DVec3| ((v - point).dot(x), (v - point).dot(y));
    let crossings = (0..vertices.len()).filter(|&i| {
        let ((px, py), (qx, qy)) = (seen(vertices[i]), seen(vertices[(i + 1) % vertices.len()]));
        (py > 0.0) != (qy > 0.0) && (px * qy - py * qx > 0.0) == (qy > py)
    });
    crossings.count() % 2 == 1
}
