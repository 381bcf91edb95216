//! The numbered contracts of `IntersectionStrategy`, and that recording tells what it says.

mod queries;
mod scenes;

use std::collections::HashMap;

use queries::{Query, queries_of};
use rayset_engine::geometry::glam::{DVec3, dvec3};
use rayset_engine::geometry::{Polygon, Primitive, Ray, Side, Span, Sphere, Triangle};
use rayset_engine::scene::{LightId, Material, ObjectId, Part, PrimitiveId, Scene, SceneBuilder};
use rayset_engine::{
    Answers, Backend, EyeRays, Generation, Hit, IntersectionStrategy, Layers, Originating, PixelOrder,
    QueryWork, RayQuery, RaySetIndex, Recording, RenderOptions, ShadowGeneration, ShadowQuery, Slot,
    Speer1985, StrategyKind, SweepLength, Tracer,
};

const OPTIONS: RenderOptions = RenderOptions {
    width: 23,
    height: 17,
    max_depth: 5,
    cutoff: None,
    order: Some(PixelOrder::Scanline),
    sweep: SweepLength::Rows(4),
    bundle_len: Some(9),
    layers: Layers::BEAUTY,
    eye_rays: EyeRays::Centers { samples: 1 },
    crop: None,
};

/// An answer to a [`Query`].
#[derive(Clone, Copy, Debug, PartialEq)]
enum Answer {
    Nearest(Option<Hit>),
    Occluded(bool),
}

fn ask(tracer: &mut dyn Tracer, query: &Query) -> Answer {
    match query {
        Query::Nearest(query) => Answer::Nearest(tracer.nearest(query)),
        Query::Occluded(query) => Answer::Occluded(tracer.occluded(query)),
    }
}

fn exact(scene: &Scene) -> impl Iterator<Item = Box<dyn IntersectionStrategy + '_>> {
    StrategyKind::ALL.iter().map(|kind| kind.bind(scene)).filter(|strategy| strategy.is_exact())
}

#[test]
fn lists_may_mix_rays_that_leave_a_surface_with_rays_that_do_not() {
    let mut answered = 0;
    for test in &scenes::all() {
        for sweep in queries_of(&test.scene, &OPTIONS) {
            // The first is an initial ray. From zero on only what a ray leaves keeps its own surface from it.
            let mut rays = Generation::default();
            for query in &sweep {
                if let Query::Nearest(query) = query {
                    rays.push(&RayQuery { span: Span::FORWARD, ..*query });
                }
            }
            let answers = |kind: StrategyKind| {
                let strategy = kind.bind(&test.scene);
                let mut answers = Answers::default();
                strategy.begin_sweep(Recording::Off).nearest_bundle(&rays, &mut answers);
                let bits = |hit: &Option<Hit>| hit.map(|hit| (hit.t.to_bits(), hit.primitive));
                answers.values.iter().map(bits).collect::<Vec<_>>()
            };
            let expected = answers(StrategyKind::Standard);
            for kind in [StrategyKind::Hierarchical, StrategyKind::Bundle, StrategyKind::Auto] {
                assert_eq!(answers(kind), expected, "{}", kind.name());
            }
            answered += (0..rays.len()).filter(|&i| rays.originating(i).is_some()).count();
        }
    }
    assert!(answered > 1000, "{answered} rays left a surface");
}

#[test]
fn contract_1_queries_of_a_slot_arrive_in_increasing_order_of_ray_sets() {
    let orders = [PixelOrder::Scanline, PixelOrder::Serpentine, PixelOrder::Tiles(4), PixelOrder::Morton(4)];
    for test in &scenes::all() {
        for (order, bundle_len) in orders.into_iter().flat_map(|order| [1, 9, 1000].map(|len| (order, len))) {
            let options = RenderOptions { order: Some(order), bundle_len: Some(bundle_len), ..OPTIONS };
            for sweep in queries_of(&test.scene, &options) {
                let mut last: HashMap<(Slot, Option<LightId>), RaySetIndex> = HashMap::new();
                for query in &sweep {
                    let (place, ray_set) = match query {
                        Query::Nearest(query) => ((query.slot, None), query.ray_set),
                        Query::Occluded(query) => ((query.slot, Some(query.light)), query.ray_set),
                    };
                    let before = last.insert(place, ray_set);
                    assert!(before < Some(ray_set), "{}: {place:?}, {before:?}, then {ray_set:?}", test.name);
                }
            }
        }
    }
}

#[test]
fn rays_leave_a_primitive_of_their_originating_object() {
    let mut left = 0;
    for test in &scenes::all() {
        for query in queries_of(&test.scene, &OPTIONS).iter().flatten() {
            let (Query::Nearest(RayQuery { originating: Some(from), .. })
            | Query::Occluded(ShadowQuery { originating: from, .. })) = query
            else {
                continue;
            };
            let volume = test.scene.location(from.primitive).volume;
            assert_eq!(from.object, test.scene.volume_object(volume), "{}", test.name);
            left += usize::from(from.object != ObjectId(0));
        }
    }
    assert!(left > 1000, "{left} rays left another object than the first");
}

#[test]
fn contract_1_initial_rays_of_a_sweep_are_numbered_without_a_gap() {
    let scene = &scenes::all()[3].scene;
    let mut firsts = Vec::new();
    for sweep in queries_of(scene, &OPTIONS) {
        let initial = sweep.iter().filter_map(|query| match query {
            Query::Nearest(query) if query.slot == Slot::ROOT => Some(query.ray_set.0),
            _ => None,
        });
        let initial: Vec<u32> = initial.collect();
        assert!(initial.windows(2).all(|pair| pair[1] == pair[0] + 1));
        firsts.push((initial[0], initial.len()));
    }
    // Four rows a sweep, and one that is left.
    firsts.sort_unstable();
    assert_eq!(firsts, [(0, 92), (92, 92), (184, 92), (276, 92), (368, 23)]);
}

fn initial(origin: DVec3, direction: DVec3) -> RayQuery {
    RayQuery {
        ray_set: RaySetIndex(0),
        slot: Slot::ROOT,
        originating: None,
        ray: Ray::new(origin, direction),
        span: Span::FORWARD,
    }
}

/// A scene of objects with one material.
fn scene_of(objects: impl IntoIterator<Item = Vec<Part>>) -> Scene {
    let mut builder = SceneBuilder::new();
    let material = builder.add_material(Material::default());
    for parts in objects {
        builder.add_object("object", material, parts);
    }
    builder.build().unwrap()
}

#[test]
fn contract_2_of_coincident_primitives_the_least_object_and_primitive_is_hit() {
    let corners = [dvec3(0.0, 0.0, 5.0), dvec3(4.0, 0.0, 5.0), dvec3(0.0, 4.0, 5.0)];
    let triangle = || Part::from(Triangle::new(corners[0], corners[1], corners[2]));
    let polygon = || Part::from(Polygon::new(corners.into()).unwrap());
    let farther =
        || Part::from(Triangle::new(corners[0] + DVec3::Z, corners[1] + DVec3::Z, corners[2] + DVec3::Z));
    let sphere = || Part::from(Sphere::new(dvec3(1.0, 1.0, 6.0), 1.0));
    let query = initial(dvec3(1.0, 1.0, 0.0), DVec3::Z);
    for (name, objects, expected) in [
        ("doubled triangles", vec![vec![triangle(), triangle()], vec![triangle()]], (0, 0)),
        ("a polygon before a triangle", vec![vec![polygon(), triangle()]], (0, 0)),
        ("a triangle before a polygon", vec![vec![triangle(), polygon()]], (0, 0)),
        ("a sphere that touches a polygon", vec![vec![polygon()], vec![sphere()]], (0, 0)),
        ("a polygon that touches a sphere", vec![vec![sphere()], vec![polygon()]], (0, 0)),
        (
            "something farther first",
            vec![vec![farther()], vec![farther(), polygon()], vec![triangle()]],
            (1, 2),
        ),
        ("many", (0..20).map(|_| vec![triangle(), sphere()]).collect(), (0, 0)),
    ] {
        let scene = scene_of(objects);
        let (object, primitive) = (ObjectId(expected.0), PrimitiveId(expected.1));
        for (strategy, &backend) in StrategyKind::ALL
            .iter()
            .flat_map(|kind| Backend::available().iter().map(move |backend| (kind, backend)))
        {
            let bound = strategy.bind_on(&scene, backend);
            let hit = bound.begin_sweep(Recording::Off).nearest(&query);
            assert_eq!(hit, Some(Hit { t: 5.0, object, primitive }), "{strategy}, {backend}, {name}");
        }
    }
}

#[test]
fn contract_2_answers_honour_span_sides_and_departure() {
    let plane: Primitive =
        Triangle::new(dvec3(-9.0, -9.0, 2.0), dvec3(9.0, -9.0, 2.0), dvec3(0.0, 9.0, 2.0)).into();
    let scene = scene_of([vec![Sphere::new(dvec3(0.0, 0.0, 5.0), 1.0).into()], vec![Part::from(plane)]]);
    let query = initial(DVec3::ZERO, DVec3::Z);
    let left = |object, side| Originating { object: ObjectId(object), primitive: PrimitiveId(object), side };
    let hit = |t, object| Some(Hit { t, object: ObjectId(object), primitive: PrimitiveId(object) });
    for (query, expected) in [
        (query, hit(2.0, 1)),
        (RayQuery { span: Span { start: 2.0, end: 9.0 }, ..query }, hit(4.0, 0)),
        (RayQuery { span: Span { start: 0.0, end: 2.0 }, ..query }, None),
        (RayQuery { span: Span { start: 4.0, end: 9.0 }, ..query }, hit(6.0, 0)),
        (RayQuery { originating: Some(left(1, Side::Back)), ..query }, hit(4.0, 0)),
        (
            RayQuery {
                originating: Some(left(0, Side::Back)),
                ray: Ray::new(dvec3(0.0, 0.0, 4.0), DVec3::Z),
                ..query
            },
            hit(2.0, 0),
        ),
        (
            RayQuery {
                originating: Some(left(0, Side::Front)),
                ray: Ray::new(dvec3(0.0, 0.0, 6.0), DVec3::Z),
                ..query
            },
            None,
        ),
    ] {
        for strategy in exact(&scene) {
            let mut tracer = strategy.begin_sweep(Recording::Off);
            assert_eq!(tracer.nearest(&query), expected, "{}: {query:?}", strategy.name());
            let RayQuery { ray_set, slot, originating, ray, span } = query;
            if let Some(originating) = originating {
                let shadow = ShadowQuery { ray_set, slot, light: LightId(0), originating, ray, span };
                assert_eq!(tracer.occluded(&shadow), expected.is_some(), "{}: {query:?}", strategy.name());
            }
        }
    }
}

/// The rays of the queries in generations of some length, and in between those for light.
fn bundles(queries: &[Query], len: usize) -> Vec<(Generation, ShadowGeneration)> {
    let mut bundles = Vec::new();
    for chunk in queries.chunks(len) {
        let (mut rays, mut shadow) = (Generation::default(), ShadowGeneration::default());
        for query in chunk {
            match query {
                Query::Nearest(query) => rays.push(query),
                Query::Occluded(query) => shadow.push(query),
            }
        }
        bundles.push((rays, shadow));
    }
    bundles
}

#[test]
fn contract_3_bundles_append_one_answer_a_query_as_the_methods_for_one_ray_give_it() {
    for test in &scenes::all() {
        let sweeps = queries_of(&test.scene, &OPTIONS);
        let kinds = StrategyKind::ALL
            .iter()
            .flat_map(|kind| [Recording::Off, Recording::PerQuery].map(|r| (kind, r)));
        for ((kind, recording), len) in kinds.flat_map(|kind| [1, 10, 1000].map(|len| (kind, len))) {
            let strategy = kind.bind(&test.scene);
            let what = format!("{kind}, {}, {recording:?}, {len}", test.name);
            for queries in &sweeps {
                let (mut one, mut many) = (strategy.begin_sweep(recording), strategy.begin_sweep(recording));
                // What stands there already stays.
                let earlier = Hit { t: 7.0, object: ObjectId(7), primitive: PrimitiveId(7) };
                let mut hits = Answers { values: vec![Some(earlier)], work: vec![QueryWork::default()] };
                let mut occluded = Answers { values: vec![true], work: vec![QueryWork::default()] };
                let (mut expected_hits, mut expected_occluded) =
                    (hits.values.clone(), occluded.values.clone());
                for (rays, shadow) in bundles(queries, len) {
                    many.nearest_bundle(&rays, &mut hits);
                    many.occluded_bundle(&shadow, &mut occluded);
                    expected_hits.extend((0..rays.len()).map(|i| one.nearest(&rays.query(i))));
                    expected_occluded.extend((0..shadow.len()).map(|i| one.occluded(&shadow.query(i))));
                }
                assert!(hits.values == expected_hits, "{what}");
                assert!(occluded.values == expected_occluded, "{what}");
                // The work of these depends on which rays come together; that of the others does not.
                let is_shared = matches!(kind, StrategyKind::Bundle | StrategyKind::Auto);
                let same_work = one.stats() == many.stats();
                assert!(same_work || is_shared, "{what}: {} {}", one.stats(), many.stats());
                let recorded = |n: usize| if recording == Recording::PerQuery { n } else { 1 };
                assert_eq!(hits.work.len(), recorded(hits.values.len()), "{what}");
                assert_eq!(occluded.work.len(), recorded(occluded.values.len()), "{what}");
                let mut sum = rayset_engine::Work::default();
                hits.work.iter().chain(&occluded.work).for_each(|work| sum += work.work);
                assert!(recording == Recording::Off || sum == many.stats().work, "{what}: {sum:?}");
            }
        }
    }
}

#[test]
fn contract_4_answers_of_exact_strategies_do_not_depend_on_what_is_retained() {
    for test in &scenes::all() {
        let queries = queries_of(&test.scene, &OPTIONS).concat();
        for strategy in exact(&test.scene) {
            let mut in_order = strategy.begin_sweep(Recording::Off);
            let expected: Vec<Answer> = queries.iter().map(|query| ask(in_order.as_mut(), query)).collect();
            let mut others = strategy.begin_sweep(Recording::Off);
            // Backwards, every third, and by steps that jump through the whole image; each query twice.
            let n = queries.len();
            let step = (n / 3 + 1..).find(|&step| greatest_common_divisor(step, n) == 1).unwrap();
            let orders = (0..n).rev().chain((0..n).step_by(3)).chain((0..n).map(|i| i * step % n));
            for i in orders.flat_map(|i| [i, i]) {
                let answer = ask(others.as_mut(), &queries[i]);
                assert_eq!(answer, expected[i], "{}, {}: {:?}", strategy.name(), test.name, queries[i]);
            }
            for i in (0..n).step_by(7) {
                let answer = ask(strategy.begin_sweep(Recording::Off).as_mut(), &queries[i]);
                assert_eq!(
                    answer,
                    expected[i],
                    "{}, {}, alone: {:?}",
                    strategy.name(),
                    test.name,
                    queries[i]
                );
            }
        }
    }
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[test]
fn recorded_query_is_either_coherent_or_one_partition() {
    for test in &scenes::all() {
        let strategy = Speer1985::new(&test.scene);
        for sweep in queries_of(&test.scene, &OPTIONS) {
            let mut tracer = strategy.begin_sweep(Recording::PerQuery);
            let (mut hits, mut occluded) = (Answers::default(), Answers::default());
            for (rays, shadow) in bundles(&sweep, 50) {
                tracer.nearest_bundle(&rays, &mut hits);
                tracer.occluded_bundle(&shadow, &mut occluded);
            }
            for work in hits.work.iter().chain(&occluded.work) {
                assert_eq!(work.work.partitions, u64::from(!work.coherent), "{}: {work:?}", test.name);
            }
        }
    }
}
