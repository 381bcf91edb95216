//! How large primitives are, for tests of margins.

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Primitive, Ray};

/// How far a hit may lie off a cone, relative to the cone's size: 2^-22, and farther by the root of two at its rim.
pub(crate) const CONE_MARGIN: f64 = 1.5 / (1_u64 << 22) as f64;

/// The coordinates that rounding is relative to: the origin's largest and the primitives' largest, in world units.
pub(crate) fn coordinates(ray: &Ray, primitives: &[Primitive]) -> f64 {
    ray.origin().abs().max_element() + primitives.iter().map(Primitive::extent).fold(0.0, f64::max)
}

/// The distance of a primitive's farthest point, by formulas of its own.
pub(crate) fn farthest_distance(primitive: &Primitive, center: DVec3) -> f64 {
    let of_points = |points: &[DVec3]| points.iter().map(|p| p.distance(center)).fold(0.0, f64::max);
    match primitive {
        Primitive::Sphere(sphere) => sphere.center().distance(center) + sphere.radius(),
        Primitive::Cone(cone) => {
            let rim = |circle: DVec3, radius: f64| {
                let along = (circle - center).dot(cone.axis());
                let lateral = (circle - center).cross(cone.axis()).length() + radius;
                (along * along + lateral * lateral).sqrt()
            };
            rim(cone.base(), cone.base_radius()).max(rim(cone.apex(), cone.apex_radius()))
        }
        Primitive::Triangle(triangle) => of_points(triangle.vertices()),
        Primitive::Polygon(polygon) => of_points(polygon.vertices()),
    }
}
