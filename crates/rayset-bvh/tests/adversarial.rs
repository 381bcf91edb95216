//! Scenes made to break culling, on every backend, against a loop over all primitives.

mod truth;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayset_bvh::Query;
use rayset_geometry::glam::{DVec3, dvec3};
use rayset_geometry::{Cone, Polygon, Primitive, Ray, Side, Sides, Span, Sphere, Triangle, unit};
use truth::{Dice, Primitives, check, nearest};

/// Scaled and moved: `p' = scale (p + shift)`.
#[derive(Clone, Copy)]
struct Place {
    scale: f64,
    shift: f64,
}

impl Place {
    fn point(self, p: DVec3) -> DVec3 {
        self.scale * (p + DVec3::splat(self.shift))
    }
    fn sphere(self, center: DVec3, radius: f64) -> Primitive {
        Sphere::new(self.point(center), self.scale * radius).into()
    }
    fn triangle(self, a: DVec3, b: DVec3, c: DVec3) -> Primitive {
        Triangle::new(self.point(a), self.point(b), self.point(c)).into()
    }
    fn polygon(self, corners: &[DVec3]) -> Option<Primitive> {
        Polygon::new(corners.iter().map(|&p| self.point(p)).collect()).map(Primitive::from)
    }
    fn cone(self, base: DVec3, r: f64, apex: DVec3, s: f64) -> Option<Primitive> {
        let (base, apex) = (self.point(base), self.point(apex));
        Cone::new(base, self.scale * r, apex, self.scale * s).map(Primitive::from)
    }
}

const PLACES: [Place; 8] = [
    Place { scale: 1.0, shift: 0.0 },
    Place { scale: 1.0, shift: 1e3 },
    Place { scale: 1.0, shift: 1e9 },
    Place { scale: 1e-100, shift: 0.0 },
    Place { scale: 1e-12, shift: 3.0 },
    Place { scale: 1e6, shift: 0.0 },
    Place { scale: 1e12, shift: 1.0 },
    Place { scale: 1e50, shift: 0.0 },
];

fn two_sided(primitives: impl IntoIterator<Item = Primitive>) -> Primitives {
    primitives.into_iter().map(|primitive| (primitive, Sides::Both)).collect()
}

/// Spheres that touch their neighbours, and the squares between them.
fn touching(place: Place, _: &mut Dice) -> Primitives {
    let mut primitives = Vec::new();
    for i in 0..64 {
        let at = |k: u32| f64::from((i >> (2 * k)) & 3) - 1.5;
        let corner = dvec3(at(0), at(1), at(2));
        primitives.push(place.sphere(corner, 0.5));
        if i % 3 == 0 {
            let (a, b, c) = (corner + DVec3::X, corner + DVec3::X + DVec3::Y, corner + DVec3::Y);
            primitives.extend([place.triangle(corner, a, b), place.triangle(corner, b, c)]);
        }
    }
    two_sided(primitives)
}

/// Shells round one point, and shells that touch the next larger from inside.
fn nested(place: Place, _: &mut Dice) -> Primitives {
    let mut primitives = Vec::new();
    let (mut radius, mut center) = (1.0, DVec3::ZERO);
    for k in 0..40 {
        primitives.push(place.sphere(DVec3::ZERO, radius));
        primitives.push(place.sphere(center, radius));
        center += 0.5 * radius * [DVec3::X, DVec3::Y, DVec3::NEG_Z][k % 3];
        radius *= 0.5;
    }
    two_sided(primitives)
}

/// Boxes without thickness: everything lies in one of two planes.
fn flat(place: Place, dice: &mut Dice) -> Primitives {
    let mut primitives = Vec::new();
    for i in 0..48 {
        let (x, y) = (0.25 * f64::from(i % 8) - 1.0, 0.25 * f64::from(i / 8) - 0.75);
        let corner = |i: f64, j: f64| match is_first_plane(x) {
            true => dvec3(x + i, y + j, 0.5),
            false => dvec3(0.25, x + i, y + j),
        };
        let [a, b, c, d] = [(0.0, 0.0), (0.25, 0.0), (0.25, 0.25), (0.0, 0.25)].map(|(i, j)| corner(i, j));
        match dice.below(3) {
            0 => primitives.extend(place.polygon(&[a, b, c, d])),
            _ => primitives.extend([place.triangle(a, b, c), place.triangle(c, d, a)]),
        }
    }
    two_sided(primitives)
}

fn is_first_plane(x: f64) -> bool {
    x < 0.0
}

/// Everything along one axis, ever smaller and closer.
fn line(place: Place, _: &mut Dice) -> Primitives {
    let mut primitives = Vec::new();
    let mut x = 1.0;
    for k in 0..60 {
        let center = dvec3(x, 0.0, 0.0);
        primitives.push(if k % 3 == 0 {
            place.triangle(center, center + 0.1 * x * DVec3::Y, center + 0.1 * x * DVec3::Z)
        } else {
            place.sphere(center, 0.1 * x)
        });
        x *= 0.7;
    }
    primitives.extend((0..20).map(|i| place.sphere(dvec3(-0.1 * f64::from(i), 0.0, 0.0), 0.05)));
    two_sided(primitives)
}

/// Triangles and polygons that are almost, or altogether, lines; and points.
fn slivers(place: Place, dice: &mut Dice) -> Primitives {
    let mut primitives = Vec::new();
    for _ in 0..40 {
        let (a, b) = (dice.point(), dice.point());
        let width = dice.pick(&[1e-3, 1e-6, 1e-9, 1e-15, 0.0]);
        let c = a + dice.unit() * (b - a) + width * dice.point();
        primitives.push(place.triangle(a, b, c));
        primitives.extend(place.polygon(&[a, c, b, a + b - c]));
        primitives.push(place.sphere(c, dice.pick(&[0.0, 1e-9, 1e-3])));
    }
    two_sided(primitives)
}

/// Shapes in one place, bit by bit or but for a rounding, seen from these sides or those.
fn coincident(place: Place, dice: &mut Dice) -> Primitives {
    let (a, b, c) = (dvec3(-0.5, -0.5, 0.25), dvec3(0.75, -0.5, 0.25), dvec3(0.0, 0.75, 0.25));
    let shapes = [
        Some(place.sphere(DVec3::ZERO, 0.5)),
        Some(place.sphere(DVec3::ZERO, 0.5_f64.next_up())),
        Some(place.sphere(dvec3(f64::EPSILON, 0.0, -0.0), 0.5)),
        Some(place.triangle(a, b, c)),
        Some(place.triangle(b, c, a)),
        Some(place.triangle(a, c, b)),
        Some(place.triangle(a, b, c + f64::EPSILON * DVec3::Z)),
        place.polygon(&[a, b, c]),
        place.cone(DVec3::NEG_Y, 0.5, DVec3::Y, 0.5),
        place.cone(DVec3::NEG_Y, 0.5, DVec3::Y, 0.25),
    ];
    let shapes: Vec<Primitive> = shapes.into_iter().flatten().collect();
    (0..120).map(|_| (dice.pick(&shapes), dice.sides())).collect()
}

/// All kinds at random, large and small.
fn kinds(place: Place, dice: &mut Dice) -> Primitives {
    let mut primitives = Primitives::new();
    for i in 0..100 {
        let (a, size) = (dice.point(), dice.pick(&[0.01, 0.1, 0.5]));
        let (b, c) = (a + size * dice.point(), a + size * dice.point());
        let primitive = match i % 4 {
            0 => Some(place.sphere(a, 0.5 * size)),
            1 => Some(place.triangle(a, b, c)),
            2 => place.polygon(&[a, b, b + c - a, c]),
            _ => place.cone(a, 0.3 * size, b, dice.pick(&[0.3, 0.1, 0.0]) * size),
        };
        primitives.extend(primitive.map(|primitive| (primitive, dice.sides())));
    }
    primitives
}

/// A ball of triangles without a gap.
fn mesh(place: Place, _: &mut Dice) -> Primitives {
    let point = |i: i32, j: i32| {
        // Points of a cube's faces, pushed out to the sphere; the seams have the same bits on both sides.
        let (u, v) = (f64::from(i), f64::from(j));
        move |face: usize| {
            let p = match face {
                0 => dvec3(4.0, u, v),
                1 => dvec3(-4.0, v, u),
                2 => dvec3(v, 4.0, u),
                3 => dvec3(u, -4.0, v),
                4 => dvec3(u, v, 4.0),
                _ => dvec3(v, u, -4.0),
            };
            unit(p).unwrap_or(DVec3::X)
        }
    };
    let mut primitives = Vec::new();
    for face in 0..6 {
        for (i, j) in (-2..2).flat_map(|i| (-2..2).map(move |j| (2 * i, 2 * j))) {
            let [a, b, c, d] =
                [(i, j), (i + 2, j), (i + 2, j + 2), (i, j + 2)].map(|(i, j)| point(i, j)(face));
            primitives.extend([place.triangle(a, b, c), place.triangle(c, d, a)]);
        }
    }
    two_sided(primitives)
}

/// Something big, and dust that is lost in its rounding.
fn dust(place: Place, dice: &mut Dice) -> Primitives {
    let mut primitives = vec![place.sphere(DVec3::ZERO, 1.0)];
    let mut size = 1.0;
    for k in 0..80 {
        let corner = dvec3(1.0, 1.0, -1.0) * (1.0 - size);
        primitives.push(match k % 2 {
            0 => place.sphere(corner, 0.1 * size),
            _ => place.triangle(corner, corner + size * dice.point(), corner + size * dice.point()),
        });
        size *= 0.7;
    }
    two_sided(primitives)
}

/// A point of a primitive where it is in doubt whether a ray hits.
fn doubtful_point(primitive: &Primitive, dice: &mut Dice) -> DVec3 {
    let between = |dice: &mut Dice, vertices: &[DVec3]| {
        let i = dice.below(vertices.len());
        let (a, b) = (vertices[i], vertices[(i + 1) % vertices.len()]);
        a + dice.pick(&[0.0, 0.0, 0.5, 0.25, 1.0 / 3.0]) * (b - a)
    };
    match primitive {
        Primitive::Sphere(sphere) => {
            let outwards = if dice.below(2) == 0 { dice.axis() } else { dice.direction() };
            sphere.center() + dice.pick(&[0.0, 1.0, 1.0, 1.0 - 1e-7]) * sphere.radius() * outwards
        }
        Primitive::Triangle(triangle) => between(dice, triangle.vertices()),
        Primitive::Polygon(polygon) => between(dice, polygon.vertices()),
        Primitive::Cone(cone) => {
            let axis = cone.apex() - cone.base();
            let across = unit(axis.cross(dice.direction())).unwrap_or(DVec3::X);
            match dice.below(3) {
                0 => cone.base() + cone.base_radius() * across,
                1 => cone.apex() + cone.apex_radius() * across,
                _ => cone.base() + dice.unit() * axis,
            }
        }
    }
}

/// Rays at the places in doubt, from near, far and very far, along axes, in planes, and from the surfaces themselves.
fn rays(primitives: &Primitives, place: Place, dice: &mut Dice, count: usize) -> Vec<Ray> {
    let mut rays = Vec::new();
    while rays.len() < count {
        let target = doubtful_point(&dice.pick(primitives).0, dice);
        let axis = dice.axis();
        let ray = match dice.below(6) {
            0 => Ray::between(place.point(2.0 * dice.point()), target),
            1 => Ray::between(doubtful_point(&dice.pick(primitives).0, dice), target),
            2 => Some(Ray::new(target - place.scale * dice.pick(&[0.0, 0.5, 3.0, 1e12]) * axis, axis)),
            3 => {
                // As good as along an axis; zeros of both signs.
                let least = || [0.0, -0.0, 5e-324, -5e-324, 1e-310, -1e-30];
                let mut direction = dvec3(dice.pick(&least()), dice.pick(&least()), dice.pick(&least()));
                let k = dice.below(3);
                direction[k] = dice.pick(&[-1.0, 1.0]);
                Some(Ray::new(target - place.scale * dice.pick(&[0.0, 0.5, 3.0, 1e6]) * direction, direction))
            }
            4 => {
                let direction = dice.direction();
                let distance = dice.pick(&[1.0, 5.0, 1e3, 1e6, 1e9, 1e12, 1e20]);
                Some(Ray::new(target - place.scale * distance * direction, direction))
            }
            // In a plane across an axis.
            _ => unit(dice.point() * (DVec3::ONE - axis.abs()))
                .map(|direction| Ray::new(target - place.scale * direction, direction)),
        };
        rays.extend(ray);
    }
    rays
}

/// Each ray with spans that end, or start, exactly at what it hits, and as one that leaves what it hits.
fn queries(primitives: &Primitives, rays: &[Ray], dice: &mut Dice) -> Vec<Query> {
    let mut queries = Vec::new();
    for &ray in rays {
        let forward = Query::from(ray);
        queries.push(forward);
        let all = Span { start: f64::NEG_INFINITY, end: f64::INFINITY };
        queries.push(Query::new(ray, all));
        let Some(hit) = nearest(primitives, &forward) else { continue };
        let t = hit.t;
        for (start, end) in [
            (0.0, t),
            (0.0, t.next_up()),
            (t.next_down(), t.next_up()),
            (t, f64::INFINITY),
            (0.5 * t, 2.0 * t),
            (t, t),
        ] {
            queries.push(Query::new(ray, Span { start, end }));
        }
        for side in [Side::Front, Side::Back] {
            queries.push(Query::leaving(ray, Span::FORWARD, hit.primitive, side));
            queries.push(Query::leaving(
                Ray::new(ray.at(t), ray.direction()),
                Span::FORWARD,
                hit.primitive,
                side,
            ));
        }
        let any = u32::try_from(dice.below(primitives.len())).unwrap();
        queries.push(Query::leaving(ray, Span::FORWARD, any, dice.side()));
    }
    queries
}

fn run(name: &str, make: fn(Place, &mut Dice) -> Primitives) {
    let mut hits = 0;
    for (i, place) in PLACES.into_iter().enumerate() {
        let mut dice = Dice(ChaCha8Rng::seed_from_u64(i as u64));
        let primitives = make(place, &mut dice);
        let rays = rays(&primitives, place, &mut dice, 250);
        let what = format!("{name}, scale {:e}, shift {:e}", place.scale, place.shift);
        hits += check(&what, &primitives, &queries(&primitives, &rays, &mut dice));
    }
    assert!(hits > 2000, "{name}: {hits} hits only");
}

#[test]
fn touching_lattices() {
    run("touching", touching);
}

#[test]
fn nested_shells() {
    run("nested", nested);
}

#[test]
fn flat_boxes() {
    run("flat", flat);
}

#[test]
fn primitives_on_a_line() {
    run("line", line);
}

#[test]
fn slivers_and_points() {
    run("slivers", slivers);
}

#[test]
fn coincident_shapes() {
    run("coincident", coincident);
}

#[test]
fn mixed_kinds() {
    run("kinds", kinds);
}

#[test]
fn closed_meshes() {
    run("mesh", mesh);
}

#[test]
fn dust_beside_something_big() {
    run("dust", dust);
}

#[test]
fn one_primitive_or_none() {
    let ray = Ray::new(DVec3::ZERO, DVec3::X);
    assert_eq!(check("none", &[], &[ray.into()]), 0);
    for place in PLACES {
        let mut dice = Dice(ChaCha8Rng::seed_from_u64(9));
        for primitive in kinds(place, &mut dice).into_iter().chain(slivers(place, &mut dice)) {
            let primitives = vec![primitive];
            let rays = rays(&primitives, place, &mut dice, 4);
            check("one", &primitives, &queries(&primitives, &rays, &mut dice));
        }
    }
}

#[test]
fn senseless_rays_hit_nothing_and_spans_may_be_anything() {
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(3));
    let primitives = kinds(PLACES[0], &mut dice);
    let mut queries = Vec::new();
    for (start, end) in [
        (f64::NAN, 1.0),
        (0.0, f64::NAN),
        (1.0, 0.0),
        (f64::INFINITY, f64::INFINITY),
        (f64::NEG_INFINITY, 0.0),
        (-3.0, -0.0),
        (-0.0, 5e-324),
        (0.0, f64::MAX),
        (0.0, -1.0),
    ] {
        for origin in [DVec3::ZERO, dvec3(0.0, 0.0, 1e3), dvec3(0.0, 0.0, -1e3), dvec3(1e300, 0.0, 0.0)] {
            queries.push(Query::new(Ray::new(origin, DVec3::Z), Span { start, end }));
        }
    }
    for origin in [DVec3::splat(f64::NAN), dvec3(f64::INFINITY, 0.0, 0.0), dvec3(0.0, 0.0, f64::NEG_INFINITY)]
    {
        queries.push(Ray::new(origin, DVec3::Z).into());
    }
    check("senseless", &primitives, &queries);
}

/// So few spheres that there is no tree to go through; and one more, and two.
#[test]
fn few_spheres_answer_like_a_loop() {
    let mut hits = 0;
    for seed in 0..120 {
        let mut dice = Dice(ChaCha8Rng::seed_from_u64(seed));
        let place = dice.pick(&PLACES);
        let mut spheres: Vec<(DVec3, f64)> = Vec::new();
        for i in 0..=dice.below(10) {
            // Some coincide with another, or have its centre.
            let (center, radius) = (dice.point(), dice.between(0.0, 1.0));
            spheres.push(match dice.below(4) {
                0 if i > 0 => dice.pick(&spheres),
                1 if i > 0 => (dice.pick(&spheres).0, radius),
                _ => (center, radius),
            });
        }
        let primitives: Primitives =
            spheres.iter().map(|&(c, r)| (place.sphere(c, r), dice.sides())).collect();
        let queries: Vec<Query> = (0..dice.below(70))
            .map(|_| {
                let (from, target) = (2.0 * dice.point(), dice.pick(&spheres));
                let target = target.0 + dice.pick(&[0.0, 1.0, 1.0 - 1e-9]) * target.1 * dice.direction();
                let origin = place.point(if dice.below(4) == 0 { target } else { from });
                let direction = unit(place.point(target) - origin).unwrap_or(dice.direction());
                let ray = Ray::new(origin, direction);
                let hit = nearest(&primitives, &ray.into()).map_or(1.0, |hit| hit.t);
                let end = dice.pick(&[f64::INFINITY, hit, hit.next_up(), 0.5 * hit, f64::NAN]);
                let start = dice.pick(&[0.0, 0.0, -0.0, -hit, 0.5 * hit, hit, f64::NAN]);
                let number = u32::try_from(dice.below(primitives.len())).unwrap();
                let from = (dice.below(2) == 0).then(|| (number, dice.side()));
                Query { ray, span: Span { start, end }, from }
            })
            .collect();
        hits += check(&format!("seed {seed}, {} spheres", primitives.len()), &primitives, &queries);
    }
    assert!(hits > 500, "{hits} hits");
}
