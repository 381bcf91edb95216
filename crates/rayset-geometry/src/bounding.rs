//! Bounding spheres.

use glam::DVec3;

use crate::{Cone, Primitive, unit};

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
/// usually by less than 0.01 %. A single sphere is returned as it is; a single triangle or cone has a closed form.
/// Time grows linearly with the primitives.
///
/// Else the smallest sphere round at most four points is kept. As long as a point of the primitives is outside, the
/// farthest one takes the place of those that are not needed any more beside it. The radius of these spheres grows from
/// step to step and is never above that of the smallest sphere.
///
/// Source: Gärtner 1999, "Fast and robust smallest enclosing balls", the farthest point taken over shapes.
#[must_use]
pub fn enclosing_sphere<'a, I>(primitives: I) -> BoundingSphere
where
    I: IntoIterator<Item = &'a Primitive, IntoIter: Clone>,
{
    let primitives = primitives.into_iter();
    let mut rest = primitives.clone();
    let center = match (rest.next(), rest.next()) {
        (None, _) => return BoundingSphere { center: DVec3::ZERO, radius: 0.0 },
        (Some(Primitive::Sphere(sphere)), None) => return sphere.bounding_sphere(),
        (Some(Primitive::Triangle(triangle)), None) => center_of_triangle(triangle.vertices()),
        (Some(Primitive::Cone(cone)), None) => Some(center_of_cone(cone)),
        _ => None,
    };
    if let Some(center) = center {
        return around(center, farthest_of_all(primitives, center).distance(center));
    }
    let any = primitives.clone().map(any_point).next().unwrap_or(DVec3::ZERO);
    let first = farthest_of_all(primitives.clone(), any);
    let mut support = Support::of(first);
    let mut best = (first, f64::INFINITY);
    for _ in 0..MAX_STEPS {
        let point = farthest_of_all(primitives.clone(), support.center);
        let radius = point.distance(support.center);
        if radius < best.1 {
            best = (support.center, radius);
        }
        if radius <= support.radius * (1.0 + 1e-4) {
            break;
        }
        support.admit(point);
    }
    around(best.0, best.1)
}

/// How often the farthest point is looked for; few primitives need a quarter of it.
const MAX_STEPS: usize = 64;

/// The smallest sphere round at most four points.
#[derive(Clone, Copy, Debug)]
struct Support {
    points: [DVec3; 4],
    len: usize,
    center: DVec3,
    /// The greatest distance of a point from the centre.
    radius: f64,
}

impl Support {
    fn of(point: DVec3) -> Self {
        Self { points: [point; 4], len: 1, center: point, radius: 0.0 }
    }

    /// Makes it the smallest sphere round its points and another one outside of it, which then determines it with one
    /// to three of the others.
    ///
    /// Of the spheres through the new point and some of the others, each round the centre that is equally far from
    /// them, it is the one that must be enlarged least to hold the rest: rounding never makes it a wrong one.
    fn admit(&mut self, point: DVec3) {
        let others = &self.points[..self.len];
        let mut best = Self { radius: f64::INFINITY, ..*self };
        for set in 1_u32..1 << self.len {
            let mut chosen = Self::of(point);
            for (i, &other) in others.iter().enumerate() {
                if set >> i & 1 == 1 && chosen.len < 4 {
                    chosen.points[chosen.len] = other;
                    chosen.len += 1;
                }
            }
            if set.count_ones() > 3 {
                continue;
            }
            let Some(center) = equidistant(&chosen.points[..chosen.len]) else { continue };
            chosen.center = center;
            chosen.radius = others.iter().map(|p| p.distance(center)).fold(point.distance(center), f64::max);
            if chosen.radius < best.radius {
                best = chosen;
            }
        }
        if best.radius.is_finite() {
            *self = best;
        }
    }
}

/// The point in the plane or space of two to four points that is equally far from them; `None` where rounding hides it.
fn equidistant(points: &[DVec3]) -> Option<DVec3> {
    let a = points[0];
    let offset = match *points {
        [_, b] => 0.5 * (b - a),
        [_, b, c] => {
            let (b, c) = (b - a, c - a);
            let normal = b.cross(c);
            (b.length_squared() * c - c.length_squared() * b).cross(normal) / (2.0 * normal.length_squared())
        }
        [_, b, c, d] => {
            let (b, c, d) = (b - a, c - a, d - a);
            let sum = b.length_squared() * c.cross(d)
                + c.length_squared() * d.cross(b)
                + d.length_squared() * b.cross(c);
            sum / (2.0 * b.dot(c.cross(d)))
        }
        _ => return None,
    };
    offset.is_finite().then_some(a + offset)
}

/// The centre of the smallest sphere around a cone: the point of the axis that is equally far from both circles, or the
/// centre of one that holds the other.
fn center_of_cone(cone: &Cone) -> DVec3 {
    let (base, apex) = (cone.base_radius(), cone.apex_radius());
    let height = cone.base().distance(cone.apex());
    // m^2 + r^2 = (h - m)^2 + s^2.
    let along = 0.5 * (height + (apex - base) * ((apex + base) / height));
    cone.base() + along.clamp(0.0, height) * cone.axis()
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
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;
    use crate::{Polygon, Sphere, Triangle};

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
    fn flat_cones_of_any_shape_are_enclosed() {
        for (base, apex, height) in [(3.0, 3.0, 1e-12), (3.0, 1.0, 1e-100), (1.0, 2.0, 2.0), (1e-9, 0.0, 1e9)]
        {
            let cone = Cone::new(DVec3::ZERO, base, height * DVec3::Y, apex).unwrap();
            let larger = f64::max(base, apex);
            let along: f64 = (0.5 * (height + (apex * apex - base * base) / height)).clamp(0.0, height);
            let minimal = (along * along + base * base).sqrt().max(larger);
            assert_near_minimal(&[cone.into()], minimal);
        }
    }

    #[test]
    fn polygons_are_enclosed_tightly() {
        let square = [DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y].map(|corner| 2.0 * corner);
        assert_near_minimal(&[Polygon::new(square.to_vec()).unwrap().into()], 2.0);
        // A gear of 144 corners, half of them as good as on the sphere.
        let corner = |i: u32| {
            let t = f64::from(i % 36) / 36.0;
            let on_circle = dvec3(1.0 - t * t, 2.0 * t, 0.0) / (1.0 + t * t);
            let turned = (0..i / 36).fold(on_circle, |p, _| dvec3(-p.y, p.x, 0.0));
            turned * if (i / 2).is_multiple_of(2) { 1.0 } else { 0.9 }
        };
        assert_near_minimal(&[Polygon::new((0..144).map(corner).collect()).unwrap().into()], 1.0 - 1e-15);
    }

    #[test]
    fn mixed_primitives_are_enclosed_no_worse_than_by_many_small_steps() {
        let mut random = ChaCha8Rng::seed_from_u64(1999);
        let mut number = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        for case in 0..300 {
            // Spheres and cones that all reach equally far are the worst: ever other points are the farthest.
            let reach = if case % 3 == 0 { 1.0 } else { number() };
            let flatness = [1.0, 1e-3, 1e-9][case % 3];
            let mut point = || dvec3(number() - 0.5, number() - 0.5, flatness * (number() - 0.5));
            let members: Vec<Primitive> = (0..2 + case % 40)
                .map(|i| {
                    let (a, b) = (point(), point());
                    match i % 3 {
                        0 => Sphere::new(a, (reach - a.length()).max(0.01)).into(),
                        1 => Cone::new(a, 0.3 * reach, b, 0.1).unwrap().into(),
                        _ => Triangle::new(a, b, point()).into(),
                    }
                })
                .collect();
            let (mut center, mut least) = (DVec3::ZERO, f64::INFINITY);
            for i in 1..3000 {
                let farthest = farthest_of_all(members.iter(), center);
                least = least.min(farthest.distance(center));
                center += (farthest - center) / f64::from(i + 1);
            }
            let found = enclosing_sphere(&members).radius;
            assert!(found <= least * 1.0002, "{case}: {found} against {least}");
        }
    }

    #[test]
    fn single_sphere_is_its_own_bound() {
        let sphere = Sphere::new(dvec3(1.0, 2.0, 3.0), 0.1);
        assert_eq!(enclosing_sphere(&[sphere.into()]), sphere.bounding_sphere());
        assert_eq!(enclosing_sphere(&[]).radius, 0.0);
    }
}
