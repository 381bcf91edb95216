//! Bounding spheres.

use glam::DVec3;

use crate::{Primitive, unit};

/// A sphere that holds something: the paper's bounding volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingSphere {
    /// The centre, in world space.
    pub center: DVec3,
    /// The radius, in world units; not negative.
    pub radius: f64,
}

/// How much a computed radius is enlarged, relatively, to cover the rounding of the distances it comes from.
const RADIUS_MARGIN: f64 = 1.0 / (1_u64 << 48) as f64;

/// A near-minimal sphere that holds all primitives; at the origin with radius zero if there is none.
///
/// Conservative: no point of a primitive is outside. Its radius exceeds the smallest possible one by at most 1 %,
/// usually by less than 0.1 %. A single sphere is returned as it is. Time grows linearly with the primitives.
///
/// The points that determine the sphere are collected one by one, each the farthest of all primitives from the
/// centre so far, and the centre is moved towards the farthest of them in shrinking steps.
///
/// Source: Bădoiu, Clarkson 2003, "Smaller core-sets for balls", the farthest point taken over shapes.
#[must_use]
pub fn enclosing_sphere<'a, I>(primitives: I) -> BoundingSphere
where
    I: IntoIterator<Item = &'a Primitive, IntoIter: Clone>,
{
    let primitives = primitives.into_iter();
    let mut rest = primitives.clone();
    match (rest.next(), rest.next()) {
        (None, _) => return BoundingSphere { center: DVec3::ZERO, radius: 0.0 },
        (Some(Primitive::Sphere(sphere)), None) => return sphere.bounding_sphere(),
        (Some(Primitive::Triangle(triangle)), None) => {
            if let Some(center) = center_of_triangle(triangle.vertices()) {
                return around(center, farthest_of_all(primitives, center).distance(center));
            }
        }
        _ => {}
    }
    let any = primitives.clone().map(any_point).next().unwrap_or(DVec3::ZERO);
    let first = farthest_of_all(primitives.clone(), any);
    let second = farthest_of_all(primitives.clone(), first);
    let mut support = vec![first, second];
    let mut center = 0.5 * first + 0.5 * second;
    let mut best = (center, f64::INFINITY);
    for _ in 0..24 {
        center = center_of_points(&support, center);
        let point = farthest_of_all(primitives.clone(), center);
        let radius = point.distance(center);
        if radius < best.1 {
            best = (center, radius);
        }
        let reached = support.iter().map(|p| p.distance(center)).fold(0.0, f64::max);
        if radius <= reached * (1.0 + 1e-4) {
            break;
        }
        support.push(point);
    }
    around(best.0, best.1)
}

/// The sphere that holds everything within a computed distance of its centre.
fn around(center: DVec3, radius: f64) -> BoundingSphere {
    let scale = center.abs().max_element();
    BoundingSphere { center, radius: radius * (1.0 + RADIUS_MARGIN) + scale * RADIUS_MARGIN }
}

/// The centre of the smallest sphere around a triangle: the middle of its longest side unless it is acute, then the
/// centre of its circumcircle; `None` where that is too badly conditioned to be near.
fn center_of_triangle(&[a, b, c]: &[DVec3; 3]) -> Option<DVec3> {
    // Turned so that the longest side is from p to q.
    let turns = [(a, b, c), (b, c, a), (c, a, b)];
    let length = |turn: &(DVec3, DVec3, DVec3)| turn.0.distance_squared(turn.1);
    let (p, q, apex) = turns.into_iter().max_by(|x, y| length(x).total_cmp(&length(y)))?;
    let (u, v) = (p - apex, q - apex);
    if u.dot(v) <= 0.0 {
        return Some(0.5 * p + 0.5 * q);
    }
    let normal = u.cross(v);
    let center = apex
        + (u.length_squared() * v.cross(normal) + v.length_squared() * normal.cross(u))
            / (2.0 * normal.length_squared());
    // The radius of an acute triangle is at most its longest side over the root of three.
    let radius = center.distance(p).max(center.distance(q)).max(center.distance(apex));
    (radius * radius * 3.0 <= p.distance_squared(q) * 1.01).then_some(center)
}

/// Moves a centre until no point is much farther than the others.
///
/// Each step goes towards the farthest point by a share that shrinks as `1 / (i + 1)`; the best centre is kept.
fn center_of_points(points: &[DVec3], start: DVec3) -> DVec3 {
    let farthest = |center: DVec3| {
        let key = |p: &&DVec3| p.distance_squared(center);
        *points.iter().max_by(|a, b| key(a).total_cmp(&key(b))).expect("there are at least two points")
    };
    let radius = |center: DVec3| farthest(center).distance(center);
    let mut center = start;
    let mut best = (start, radius(start));
    for i in 1..=1500_u32 {
        center += (farthest(center) - center) / f64::from(i + 1);
        let reached = radius(center);
        if reached < best.1 {
            best = (center, reached);
        }
    }
    best.0
}

/// The point of a set of primitives that is farthest from `center`.
fn farthest_of_all<'a>(primitives: impl Iterator<Item = &'a Primitive>, center: DVec3) -> DVec3 {
    let mut farthest = (f64::NEG_INFINITY, center);
    for primitive in primitives {
        let mut consider = |point: DVec3| {
            let distance = point.distance_squared(center);
            if distance > farthest.0 {
                farthest = (distance, point);
            }
        };
        match primitive {
            Primitive::Sphere(sphere) => {
                let away = unit(sphere.center() - center).unwrap_or(DVec3::X);
                consider(sphere.center() + sphere.radius() * away);
            }
            Primitive::Triangle(triangle) => triangle.vertices().iter().copied().for_each(consider),
            Primitive::Polygon(polygon) => polygon.vertices().iter().copied().for_each(consider),
            Primitive::Cone(cone) => {
                for (circle, radius) in [(cone.base(), cone.base_radius()), (cone.apex(), cone.apex_radius())]
                {
                    let outward = perpendicular(circle - center, cone.axis());
                    let rim = circle + radius * outward;
                    consider(rim + cone.thickness() * unit(rim - center).unwrap_or(outward));
                }
            }
        }
    }
    farthest.1
}

/// The unit vector perpendicular to an axis on the side of `vector`; any perpendicular one where rounding hides it.
fn perpendicular(vector: DVec3, axis: DVec3) -> DVec3 {
    let across = |vector: DVec3| vector - vector.dot(axis) * axis;
    // Of a vector nearly along the axis the first step leaves rounding noise, which may point along the axis too.
    match unit(across(vector)).map(across) {
        Some(outward) if outward.length_squared() > 0.5 => outward.normalize(),
        _ => axis.any_orthonormal_vector(),
    }
}

fn any_point(primitive: &Primitive) -> DVec3 {
    match primitive {
        Primitive::Sphere(sphere) => sphere.center(),
        Primitive::Triangle(triangle) => triangle.vertices()[0],
        Primitive::Polygon(polygon) => polygon.vertices()[0],
        Primitive::Cone(cone) => cone.base(),
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "the values are exact, worked out by hand")]
mod tests {
    use glam::dvec3;

    use super::*;
    use crate::{Cone, Sphere, Triangle};

    fn points(points: &[DVec3]) -> Vec<Primitive> {
        points.iter().map(|&p| Triangle::new(p, p, p).into()).collect()
    }

    fn assert_near_minimal(primitives: &[Primitive], minimal: f64) {
        let sphere = enclosing_sphere(primitives);
        assert!(sphere.radius >= minimal, "{} is below the minimum {minimal}", sphere.radius);
        assert!(sphere.radius <= minimal * 1.01, "{} is more than 1 % above {minimal}", sphere.radius);
    }

    #[test]
    fn cube_and_simplex_are_enclosed_tightly() {
        let corners: Vec<_> =
            (0..8).map(|i| dvec3(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).collect();
        assert_near_minimal(&points(&corners), 0.75_f64.sqrt());
        let simplex =
            [dvec3(1.0, 1.0, 1.0), dvec3(1.0, -1.0, -1.0), dvec3(-1.0, 1.0, -1.0), dvec3(-1.0, -1.0, 1.0)];
        assert_near_minimal(&points(&simplex), 3.0_f64.sqrt());
    }

    #[test]
    fn obtuse_triangle_is_enclosed_by_its_longest_side() {
        let obtuse = Triangle::new(dvec3(-5.0, 0.0, 7.0), dvec3(5.0, 0.0, 7.0), dvec3(0.5, 1.0, 7.0));
        assert_near_minimal(&[obtuse.into()], 5.0);
        let equilateral = Triangle::new(DVec3::X, DVec3::Y, DVec3::Z);
        assert_near_minimal(&[equilateral.into()], (2.0_f64 / 3.0).sqrt());
    }

    #[test]
    fn spheres_and_cones_are_enclosed_with_their_thickness() {
        let ball = |x: f64, radius: f64| Primitive::from(Sphere::new(dvec3(x, 0.0, 0.0), radius));
        assert_near_minimal(&[ball(-3.0, 1.0), ball(4.0, 2.0)], 5.0);
        assert_near_minimal(&[ball(0.0, 3.0), ball(1.0, 1.0)], 3.0);
        let cylinder = Cone::new(DVec3::ZERO, 3.0, dvec3(0.0, 0.0, 8.0), 3.0).unwrap();
        assert_near_minimal(&[cylinder.into()], 5.0);
        let cone = Cone::new(DVec3::ZERO, 3.0, dvec3(0.0, 0.0, 1.0), 0.0).unwrap();
        assert_near_minimal(&[cone.into()], 3.0);
    }

    #[test]
    fn tilted_cylinders_are_enclosed() {
        // The centre lies on the axis up to rounding, and what is off it is noise.
        for i in 1..100 {
            let apex = dvec3(0.1 * f64::from(i), 3.7 - 0.07 * f64::from(i * i % 41), f64::from(i % 7) - 0.3);
            let minimal = (0.25 * apex.length_squared() + 0.01).sqrt();
            assert_near_minimal(&[Cone::new(DVec3::ZERO, 0.1, apex, 0.1).unwrap().into()], minimal);
        }
    }

    #[test]
    fn single_sphere_is_its_own_bound() {
        let sphere = Sphere::new(dvec3(1.0, 2.0, 3.0), 0.1);
        assert_eq!(enclosing_sphere(&[sphere.into()]), sphere.bounding_sphere());
        assert_eq!(enclosing_sphere(&[]).radius, 0.0);
    }
}
