//! Rays of a list do what each would do by itself; among triangles they go together, node by node.

mod together;
mod truth;

use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayset_bvh::{Group, Hierarchy, HitOrNone, Left, Query};
use rayset_geometry::glam::{DVec3, dvec3};
use rayset_geometry::{Primitive, Ray, Side, Sides, Span, Sphere, Triangle};
use rayset_simd::Backend;

use together::{List, check};
use truth::columns_of;

/// Random points in a cube.
struct Dice(ChaCha8Rng);

impl Dice {
    fn number(&mut self) -> f64 {
        2.0 * f64::from(self.0.next_u32()) / f64::from(u32::MAX) - 1.0
    }

    fn point(&mut self) -> DVec3 {
        dvec3(self.number(), self.number(), self.number())
    }
}

/// Small triangles in a cube, some of which can be hit from one side alone.
fn triangles(n: usize, dice: &mut Dice) -> Vec<(Primitive, Sides)> {
    let sides = [Sides::Both, Sides::Front, Sides::Back, Sides::Both];
    let mut triangle = |i: usize| {
        let a = dice.point();
        let triangle = Triangle::new(a, a + 0.1 * dice.point(), a + 0.1 * dice.point());
        (triangle.into(), sides[i % 4])
    };
    (0..n).map(&mut triangle).collect()
}

/// Rays towards a light, as they leave triangles or from anywhere; a few have no span, or none that counts.
fn rays(n: usize, primitives: usize, dice: &mut Dice) -> (List, Vec<Query>) {
    let light = dvec3(0.5, 3.0, 0.25);
    let (mut list, mut queries) = (List::default(), Vec::new());
    for i in 0..n {
        let ray = Ray::between(dice.point(), light + 0.1 * dice.point()).unwrap();
        let spans = [f64::INFINITY, 3.0, 0.5, 0.25, f64::INFINITY, if i % 17 == 0 { f64::NAN } else { 2.0 }];
        let span = Span { start: 1e-9, end: spans[i % spans.len()] };
        let number = u32::try_from(i * 31 % primitives).unwrap();
        let from = [None, Some((number, Side::Front)), Some((number, Side::Back))][i % 3];
        list.push(&ray, span, from);
        queries.push(Query { ray, span, from });
    }
    (list, queries)
}

/// Squares across the axes on a grid, each of two triangles: planes that many of them share.
fn steps(n: usize, dice: &mut Dice) -> Vec<(Primitive, Sides)> {
    let mut corners = |i: usize| {
        let on_grid = |x: f64| (8.0 * x).round() / 8.0;
        let a = dice.point().to_array().map(on_grid);
        let (mut u, mut v) = ([0.0; 3], [0.0; 3]);
        (u[(i + 1) % 3], v[(i + 2) % 3]) = (0.125, 0.125);
        let [a, u, v] = [a, u, v].map(DVec3::from);
        [Triangle::new(a, a + u, a + v), Triangle::new(a + u + v, a + u, a + v)]
    };
    (0..n).flat_map(&mut corners).map(|triangle| (triangle.into(), Sides::Both)).collect()
}

/// Rays that leave triangles from their middles.
fn leaving(n: usize, primitives: &[(Primitive, Sides)], dice: &mut Dice) -> (List, Vec<Query>) {
    let (mut list, mut queries) = (List::default(), Vec::new());
    for i in 0..n {
        let number = i * 31 % primitives.len();
        let Primitive::Triangle(triangle) = &primitives[number].0 else { unreachable!("all are triangles") };
        let [a, b, c] = triangle.vertices();
        let ray = Ray::between((a + b + c) / 3.0, 4.0 * dice.point()).unwrap();
        let span = Span { start: 1e-9, end: f64::INFINITY };
        let from = Some((u32::try_from(number).unwrap(), [Side::Front, Side::Back][i % 2]));
        list.push(&ray, span, from);
        queries.push(Query { ray, span, from });
    }
    (list, queries)
}

/// Compares lists of many lengths with rays one by one: answers, and nodes, leaves and primitives that were tested, on
/// every backend; how many nodes those were.
fn compare(primitives: &[(Primitive, Sides)], mut rays: impl FnMut(usize) -> (List, Vec<Query>)) -> Vec<u64> {
    let (columns, items) = columns_of(primitives);
    let each = |&backend: &Backend| {
        let hierarchy = Hierarchy::over(&columns, &items, backend);
        let (mut scratch, mut alone) = (hierarchy.scratch(), hierarchy.scratch());
        for len in [300, 0, 1, 2, 3, 7, 8, 9, 15, 16, 17, 33, 127, 128, 129, 257] {
            let (list, queries) = rays(len);
            let what = format!("{backend}, {} primitives, {len} rays", primitives.len());
            let left: Vec<_> = list.left.iter().map(|&left| Left::from(left)).collect();
            let expected: Vec<_> =
                queries.iter().map(|query| hierarchy.occluded_with(query, &mut alone)).collect();
            // What stands in the places before does not matter, nor that there are more.
            let mut occluded = vec![true; len + 1];
            hierarchy.occluded_each(&list.columns(&left), &mut occluded, &mut scratch);
            assert_eq!(occluded.pop(), Some(true), "{what}: no place of another ray is written");
            assert_eq!(occluded, expected, "{what}");
            assert_eq!(scratch.steps, alone.steps, "{what}");
            assert_eq!(scratch.primitive_tests, alone.primitive_tests, "{what}");
            let expected: Vec<HitOrNone> =
                queries.iter().map(|query| hierarchy.nearest_with(query, &mut alone).into()).collect();
            let something = HitOrNone { t: 0.5, primitive: 1 };
            let mut hits = vec![something; len + 1];
            hierarchy.nearest_each(&list.columns(&left), &mut hits, &mut scratch);
            assert_eq!(hits.pop(), Some(something), "{what}: no place of another ray is written");
            assert_eq!(hits, expected, "{what}");
            assert_eq!(scratch.steps, alone.steps, "{what}, nearest");
            assert_eq!(scratch.primitive_tests, alone.primitive_tests, "{what}, nearest");
        }
        scratch.steps.nodes
    };
    Backend::available().iter().map(each).collect()
}

/// Nodes, leaves and primitives are those of rays one by one, whatever list they stand in.
#[test]
fn a_stream_visits_what_each_of_its_rays_does() {
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(1));
    // A single leaf, a few nodes, and many.
    for n in [3, 60, 5000] {
        let primitives = triangles(n, &mut dice);
        let nodes = compare(&primitives, |len| rays(len, n, &mut dice));
        assert!(n < 1000 || nodes.iter().all(|&nodes| nodes > 4000), "{nodes:?}");
    }
}

/// The same where rays leave faces behind them.
#[test]
fn a_stream_leaves_the_faces_behind_that_each_of_its_rays_does() {
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(3));
    for n in [20, 2000] {
        let primitives = steps(n, &mut dice);
        compare(&primitives, |len| leaving(len, &primitives, &mut dice));
    }
}

/// The same among spheres, whose rays go one by one.
#[test]
fn lists_among_spheres_do_the_work_of_each_of_their_rays() {
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(4));
    for n in [64, 2000] {
        let primitives: Vec<_> =
            (0..n).map(|_| (Sphere::new(dice.point(), 0.05).into(), Sides::Both)).collect();
        compare(&primitives, |len| rays(len, n, &mut dice));
    }
}

/// In a row between two triangles that are hit, whichever way it runs, the far end is where rays look first: by themselves,
/// in lists, which visit node by node, and in tiles of packets.
#[test]
fn what_lies_farthest_is_looked_at_first() {
    let across = |x: f64, y: f64, z: f64, axis: usize| match axis {
        0 => dvec3(z, x, y),
        1 => dvec3(y, z, x),
        _ => dvec3(x, y, z),
    };
    // Beside a line that passes through their boxes; the first and the last lie on it.
    let triangle = |i: u32, axis: usize| {
        let (z, x) = (f64::from(i), if i == 0 || i == 999 { 2.0 } else { -1.0 });
        let corner = |x: f64, y: f64| across(x, y, z, axis);
        Primitive::from(Triangle::new(corner(-1.0, 1.0), corner(1.0, -1.0), corner(x, x)))
    };
    for axis in 0..3 {
        let primitives: Vec<_> = (0..1000).map(|i| (triangle(i, axis), Sides::Both)).collect();
        let (columns, items) = columns_of(&primitives);
        for &backend in Backend::available() {
            let hierarchy = Hierarchy::over(&columns, &items, backend);
            for (z, sense) in [(2.0, 1.0), (997.0, -1.0)] {
                let ray = Ray::new(across(0.25, 0.25, z, axis), across(0.0, 0.0, sense, axis));
                let (span, from) = (Span { start: 0.0, end: f64::INFINITY }, None);
                let mut scratch = hierarchy.scratch();
                assert!(hierarchy.occluded_with(&Query { ray, span, from }, &mut scratch));
                assert_eq!(scratch.steps.leaves, 1, "{backend}, axis {axis}, {sense}");
                // Alone, a few, and many.
                for len in [1, 2, 40] {
                    let mut list = List::default();
                    (0..len).for_each(|_| list.push(&ray, span, from));
                    let left: Vec<_> = list.left.iter().map(|&left| Left::from(left)).collect();
                    let (mut occluded, mut scratch) = (vec![false; len], hierarchy.scratch());
                    hierarchy.occluded_each(&list.columns(&left), &mut occluded, &mut scratch);
                    assert_eq!((occluded, scratch.steps.leaves), (vec![true; len], len as u64), "{backend}");
                }
                // In a tile of packets.
                let len = hierarchy.tile_len();
                let mut list = List::default();
                (0..len).for_each(|_| list.push(&ray, span, from));
                let left: Vec<_> = list.left.iter().map(|&left| Left::from(left)).collect();
                let (mut occluded, mut scratch) = (vec![false; len], hierarchy.bundle_scratch());
                let group = [Group { range: 0..len, class: 0 }];
                hierarchy.occluded_bundle(&list.columns(&left), &group, &mut occluded, &mut scratch);
                assert_eq!((occluded, scratch.single.steps.leaves), (vec![true; len], 1), "{backend}");
                assert_eq!(scratch.take_bundled(0).tiles, len as u64, "{backend}");
            }
        }
    }
}

/// In a row of triangles that are all hit, whichever way it runs, the near end is where rays look first that ask for the
/// nearest hit: by themselves, and in lists, which visit node by node.
#[test]
fn what_lies_nearest_is_looked_at_first() {
    let across = |x: f64, y: f64, z: f64, axis: usize| match axis {
        0 => dvec3(z, x, y),
        1 => dvec3(y, z, x),
        _ => dvec3(x, y, z),
    };
    for axis in 0..3 {
        let corner = |x: f64, y: f64, z: f64| across(x, y, z, axis);
        let primitives: Vec<_> = (0..1000)
            .map(|i| {
                let z = f64::from(i);
                let triangle = Triangle::new(corner(-1.0, 1.0, z), corner(1.0, -1.0, z), corner(2.0, 2.0, z));
                (Primitive::from(triangle), Sides::Both)
            })
            .collect();
        let (columns, items) = columns_of(&primitives);
        for &backend in Backend::available() {
            let hierarchy = Hierarchy::over(&columns, &items, backend);
            for (z, sense, first) in [(-10.0, 1.0, 0), (1010.0, -1.0, 999)] {
                let ray = Ray::new(across(0.25, 0.25, z, axis), across(0.0, 0.0, sense, axis));
                let (span, from) = (Span { start: 0.0, end: f64::INFINITY }, None);
                let mut scratch = hierarchy.scratch();
                let hit = hierarchy.nearest_with(&Query { ray, span, from }, &mut scratch);
                assert_eq!(hit.map(|hit| hit.primitive), Some(first), "{backend}, axis {axis}, {sense}");
                assert_eq!(scratch.steps.leaves, 1, "{backend}, axis {axis}, {sense}");
                for len in [1, 2, 40] {
                    let mut list = List::default();
                    (0..len).for_each(|_| list.push(&ray, span, from));
                    let left: Vec<_> = list.left.iter().map(|&left| Left::from(left)).collect();
                    let (mut hits, mut scratch) = (vec![HitOrNone::NONE; len], hierarchy.scratch());
                    hierarchy.nearest_each(&list.columns(&left), &mut hits, &mut scratch);
                    assert!(hits.iter().all(|hit| hit.primitive == first), "{backend}, axis {axis}, {sense}");
                    assert_eq!(scratch.steps.leaves, len as u64, "{backend}, axis {axis}, {sense}");
                }
            }
        }
    }
}

/// What is kept between lists has room for a hierarchy that is deeper than the last.
#[test]
fn a_scratch_serves_several_hierarchies() {
    let mut dice = Dice(ChaCha8Rng::seed_from_u64(2));
    let (few, many) = (triangles(40, &mut dice), triangles(20_000, &mut dice));
    for &backend in Backend::available() {
        let [few, many] = [&few, &many].map(|primitives| {
            let (columns, items) = columns_of(primitives);
            Hierarchy::over(&columns, &items, backend)
        });
        let (mut scratch, other) = (many.scratch(), many.scratch());
        for (hierarchy, len) in [(&few, 5), (&many, 300), (&few, 300), (&many, 40)] {
            let (list, _) = rays(len, 40, &mut dice);
            let left: Vec<_> = list.left.iter().map(|&left| Left::from(left)).collect();
            let [mut occluded, mut expected] = [(); 2].map(|()| vec![false; len]);
            hierarchy.occluded_each(&list.columns(&left), &mut occluded, &mut scratch);
            hierarchy.occluded_each(&list.columns(&left), &mut expected, &mut other.clone());
            assert_eq!(occluded, expected, "{backend}");
            let [mut hits, mut expected] = [(); 2].map(|()| vec![HitOrNone::NONE; len]);
            hierarchy.nearest_each(&list.columns(&left), &mut hits, &mut scratch);
            hierarchy.nearest_each(&list.columns(&left), &mut expected, &mut other.clone());
            assert_eq!(hits, expected, "{backend}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 16 } else { 64 }))]

    #[test]
    fn a_stream_has_the_answers_of_a_loop(seed in any::<u64>(), n in 1..600_usize, len in 1..400_usize) {
        let mut dice = Dice(ChaCha8Rng::seed_from_u64(seed));
        let primitives = triangles(n, &mut dice);
        let (list, _) = rays(len, n, &mut dice);
        check(&primitives, &list);
    }
}
