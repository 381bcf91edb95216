//! The tree: the same for any number of threads, bounded in depth, and not undone by coincidence or size.

mod truth;

use std::fmt::{self, Write};
use std::hash::{DefaultHasher, Hasher};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayset_bvh::{BoxHierarchy, Hierarchy, Hit, Query, Scratch};
use rayset_geometry::glam::{DVec3, dvec3};
use rayset_geometry::{BoundingBox, Cone, Polygon, Primitive, Ray, Side, Sides, Span, Sphere, Triangle};
use rayset_simd::Backend;
use truth::{Dice, Primitives, bits, check, columns_of, nearest};

struct Hashed(DefaultHasher);

impl Write for Hashed {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.write(text.as_bytes());
        Ok(())
    }
}

/// Of everything there is in a hierarchy.
fn fingerprint(hierarchy: &impl fmt::Debug) -> u64 {
    let mut hashed = Hashed(DefaultHasher::new());
    write!(hashed, "{hierarchy:?}").unwrap();
    hashed.0.finish()
}

fn random_spheres(count: usize, seed: u64) -> Vec<Sphere> {
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(seed));
    (0..count).map(|_| Sphere::new(dice.point(), dice.between(0.0, 0.01))).collect()
}

#[test]
fn tree_is_the_same_for_any_number_of_threads() {
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(5));
    let mut primitives = Primitives::new();
    for _ in 0..30_000 {
        let a = dice.point();
        let primitive = match dice.below(3) {
            0 => Triangle::new(a, a + 0.01 * dice.point(), a + 0.01 * dice.point()).into(),
            // Many in one place.
            1 => Sphere::new((2.0 * a).round(), 0.25).into(),
            _ => Sphere::new(a, 0.01).into(),
        };
        primitives.push((primitive, dice.sides()));
    }
    let (columns, items) = columns_of(&primitives);
    let boxes: Vec<_> = primitives.iter().map(|(primitive, _)| primitive.bounding_box()).collect();
    for &backend in &[Backend::Portable, Backend::widest()] {
        let trees = [1, 2, 4].map(|n_threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            pool.install(|| {
                let hierarchy = Hierarchy::over(&columns, &items, backend);
                let of_boxes = BoxHierarchy::on(boxes.iter().copied(), backend);
                (fingerprint(&hierarchy), fingerprint(&of_boxes))
            })
        });
        assert!(trees.iter().all(|tree| *tree == trees[0]), "{backend}: {trees:?}");
    }
}

#[test]
fn depth_is_bounded_whatever_the_primitives_are() {
    let halves = |k: i32| (0..k).fold(1.0, |size, _| 0.5 * size);
    let along = |axis: DVec3| (0..1000).map(move |k| Sphere::new(halves(k) * axis, halves(k + 2)));
    let sets: Vec<(&str, Vec<Sphere>)> = vec![
        ("sizes 2^-k along an axis", along(DVec3::X).collect()),
        ("along three axes", along(DVec3::X).chain(along(DVec3::Y)).chain(along(DVec3::Z)).collect()),
        ("along the diagonal", along(DVec3::ONE).collect()),
        ("towards a corner and back", along(DVec3::ONE).chain(along(-DVec3::ONE)).collect()),
        ("round one centre", (0..1000).map(|k| Sphere::new(DVec3::ZERO, halves(k))).collect()),
        (
            "steps of a rounding",
            (0..5000).map(|i| Sphere::new(dvec3(1.0 + f64::from(i) * f64::EPSILON, 0.0, 0.0), 1.0)).collect(),
        ),
        ("in one place", vec![Sphere::new(DVec3::ONE, 1.0); 5000]),
        ("spread evenly", random_spheres(20_000, 1)),
    ];
    for (name, spheres) in &sets {
        let primitives: Primitives = spheres.iter().map(|&sphere| (sphere.into(), Sides::Both)).collect();
        let (columns, items) = columns_of(&primitives);
        let most = 40 + spheres.len().next_power_of_two().ilog2() as usize;
        for &backend in Backend::available() {
            let depth = Hierarchy::over(&columns, &items, backend).depth();
            assert!(depth <= most, "{name}, {backend}: {depth}");
        }
        let mut dice = Dice(ChaCha8Rng::seed_from_u64(2));
        let rays = |_| {
            let target = dice.pick(spheres).center();
            Ray::between(3.0 * dice.point(), target).unwrap_or(Ray::new(DVec3::NEG_X, DVec3::X)).into()
        };
        check(name, &primitives, &(0..40).map(rays).collect::<Vec<Query>>());
    }
}

fn trace(hierarchy: &Hierarchy, queries: &[Query]) -> (Vec<Option<Hit>>, Scratch) {
    let mut scratch = hierarchy.scratch();
    let answers = queries.iter().map(|query| hierarchy.nearest_with(query, &mut scratch)).collect();
    (answers, scratch)
}

/// A million of one primitive, and some others.
#[test]
fn a_million_coincident_primitives_cost_no_more_than_two() {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let shapes: [Primitive; 4] = [
        Sphere::new(DVec3::ZERO, 0.5).into(),
        Triangle::new(x, y, z).into(),
        Polygon::new(vec![x, y, z]).unwrap().into(),
        Cone::new(-y, 0.5, y, 0.25).unwrap().into(),
    ];
    for shape in &shapes {
        let n =
            if matches!(shape, Primitive::Sphere(_) | Primitive::Triangle(_)) { 1_000_000 } else { 50_000 };
        let mut dice = Dice(ChaCha8Rng::seed_from_u64(4));
        let mut primitives: Primitives = vec![(shape.clone(), Sides::Both); n];
        for _ in 0..100 {
            let place = dice.below(n);
            primitives[place] = (Sphere::new(dice.point(), 0.1).into(), Sides::Both);
        }
        let (columns, items) = columns_of(&primitives);
        let hierarchy = Hierarchy::over(&columns, &items, Backend::active());
        let mut queries = Vec::new();
        for i in 0..10_000 {
            let ray = Ray::between(2.0 * dice.point(), 0.3 * dice.point()).unwrap();
            // Leaving the first few, the last, one in between, or none.
            let numbers = [0, 1, 2, 3, 4, n - 1, dice.below(n)];
            let from = u32::try_from(numbers[i % 7]).unwrap();
            let side = dice.side();
            queries.push(match i % 3 {
                0 => ray.into(),
                _ => Query::leaving(ray, Span::FORWARD, from, side),
            });
        }
        let (answers, scratch) = trace(&hierarchy, &queries);
        let tests = scratch.primitive_tests / queries.len() as u64;
        assert!(tests < 64, "{:?}: {tests} tests a ray", shape.kind());
        for (query, answer) in queries.iter().zip(answers).step_by(500) {
            assert_eq!(bits(answer), bits(nearest(&primitives, query)), "{query:?}");
        }
    }
}

/// Every departure from a few duplicates, among others: which one a ray leaves matters.
#[test]
fn rays_that_leave_a_duplicate_meet_the_others() {
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let shapes: [Primitive; 5] = [
        Sphere::new(DVec3::ZERO, 0.5).into(),
        Triangle::new(x, y, z).into(),
        Polygon::new(vec![x, y, z]).unwrap().into(),
        Cone::new(-y, 0.5, y, 0.25).unwrap().into(),
        Cone::new(-y, 0.0, y, 0.25).unwrap().into(),
    ];
    for shape in &shapes {
        for sides in [Sides::Both, Sides::Front, Sides::Back] {
            let mut dice = Dice(ChaCha8Rng::seed_from_u64(4));
            let mut primitives: Primitives = vec![(shape.clone(), sides); 7];
            primitives.insert(2, (Sphere::new(0.3 * x, 0.2).into(), Sides::Both));
            primitives.insert(4, (shape.clone(), Sides::Both));
            let mut queries = Vec::new();
            for _ in 0..200 {
                let ray = Ray::between(dice.point(), 0.3 * dice.point()).unwrap();
                queries.push(ray.into());
                for primitive in 0..9 {
                    for side in [Side::Front, Side::Back] {
                        queries.push(Query::leaving(ray, Span::FORWARD, primitive, side));
                    }
                }
            }
            assert!(check("duplicates", &primitives, &queries) > 1000);
        }
    }
}

#[test]
fn a_million_spheres_answer_like_a_loop() {
    let spheres = random_spheres(1_000_000, 7);
    let hierarchy = Hierarchy::of_spheres(&spheres);
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(8));
    let queries: Vec<Query> =
        (0..60).map(|_| Ray::between(2.0 * dice.point(), dice.point()).unwrap().into()).collect();
    let (answers, scratch) = trace(&hierarchy, &queries);
    // A ray that has hit something does not look at what is behind it.
    let n = queries.len() as u64;
    assert!(scratch.primitive_tests < 250 * n && scratch.steps.nodes < 100 * n, "{scratch:?}");
    let mut hits = 0;
    for (query, answer) in queries.iter().zip(answers) {
        let mut expected: Option<Hit> = None;
        for (sphere, primitive) in spheres.iter().zip(0..) {
            if let Some(t) = sphere.intersect(&query.ray, query.span, Sides::Both, None)
                && expected.is_none_or(|hit| t < hit.t)
            {
                expected = Some(Hit { t, primitive });
            }
        }
        assert_eq!(bits(answer), bits(expected), "{query:?}");
        hits += usize::from(answer.is_some());
    }
    assert!(hits > 30, "{hits}");
}

#[test]
#[should_panic(expected = "is not finite")]
fn primitives_that_reach_farther_than_f64_are_refused() {
    let _ = Hierarchy::of_spheres(&[Sphere::new(DVec3::splat(f64::MAX), f64::MAX)]);
}

#[test]
fn slices_of_one_shape_are_numbered_in_order() {
    let triangles =
        [2.0, 1.0, 3.0].map(|z| Triangle::new(dvec3(-1.0, -1.0, z), dvec3(1.0, -1.0, z), dvec3(0.0, 1.0, z)));
    let ray = Ray::new(DVec3::ZERO, DVec3::Z);
    let hit = Hierarchy::of_triangles(&triangles).nearest(&ray, Span::FORWARD);
    assert_eq!(hit, Some(Hit { t: 1.0, primitive: 1 }));
    assert!(
        BoundingBox::EMPTY.is_empty() && Hierarchy::of_triangles(&[]).nearest(&ray, Span::FORWARD).is_none()
    );
}
