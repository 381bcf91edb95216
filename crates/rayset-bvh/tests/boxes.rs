//! A hierarchy over boxes, with a closure that tests what is in them.

mod truth;

use std::cell::Cell;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayset_bvh::{BoxHierarchy, Hit, Query, Shape, ShapeHierarchy};
use rayset_geometry::glam::{DVec3, dvec3};
use rayset_geometry::{BoundingBox, Cone, Primitive, Ray, Side, Sides, Span, Sphere, Triangle};
use rayset_simd::Backend;
use truth::{Dice, Primitives, bits, nearest};

fn primitives(dice: &mut Dice, count: usize) -> Primitives {
    let mut primitives = Primitives::new();
    for i in 0..count {
        let a = if i % 2 == 0 { dice.point() } else { (2.0 * dice.point()).round() * 0.5 };
        let primitive: Primitive = match i % 3 {
            0 => Sphere::new(a, dice.pick(&[0.0, 0.1, 0.25, 0.5])).into(),
            1 => Triangle::new(a, a + 0.5 * dice.axis(), a + 0.5 * dice.axis()).into(),
            _ => Cone::new(a, 0.1, a + dice.axis(), 0.2).unwrap().into(),
        };
        primitives.push((primitive, dice.sides()));
    }
    primitives
}

fn box_of(primitive: &Primitive) -> BoundingBox {
    // Hits of a cone lie on a surface with some thickness.
    let wider = if matches!(primitive, Primitive::Cone(_)) { 1e-6 } else { 0.0 };
    let bounds = primitive.bounding_box();
    BoundingBox { min: bounds.min - wider, max: bounds.max + wider }
}

/// A shape that a library may have.
#[derive(Clone)]
struct Own(Primitive, Sides);

impl Shape for Own {
    fn bounding_box(&self) -> BoundingBox {
        box_of(&self.0)
    }

    fn intersect(&self, ray: &Ray, span: Span, departure: Option<Side>) -> Option<f64> {
        self.0.intersect(ray, span, self.1, departure)
    }
}

#[test]
fn closures_and_shapes_answer_like_a_loop_on_every_backend() {
    for seed in 0..20 {
        let mut dice = Dice(ChaCha8Rng::seed_from_u64(seed));
        let count = dice.pick(&[0, 1, 2, 17, 200]);
        let primitives = primitives(&mut dice, count);
        let intersect = |primitive: u32, query: &Query| {
            let (shape, sides) = &primitives[primitive as usize];
            let departure = query.from.filter(|from| from.0 == primitive).map(|from| from.1);
            shape.intersect(&query.ray, query.span, *sides, departure)
        };
        let mut queries = Vec::new();
        for _ in 0..200 {
            let far = dice.pick(&[1.0, 3.0, 1e6, 1e12]);
            let direction = if dice.below(3) == 0 { dice.axis() } else { dice.direction() };
            let target = if dice.below(2) == 0 { dice.point() } else { (2.0 * dice.point()).round() * 0.5 };
            let ray = Ray::new(target - far * direction, direction);
            let end = dice.pick(&[f64::INFINITY, far]);
            queries.push(Query::new(ray, Span { start: 0.0, end }));
            if count > 0 {
                let from = u32::try_from(dice.below(count)).unwrap();
                queries.push(Query::leaving(ray, Span::FORWARD, from, Side::Back));
            }
        }
        for &backend in Backend::available() {
            let hierarchy = BoxHierarchy::on(primitives.iter().map(|(shape, _)| box_of(shape)), backend);
            assert_eq!(hierarchy.backend(), backend);
            let (mut hits, mut occluded) = (Vec::new(), Vec::new());
            hierarchy.nearest_batch(&queries, intersect, &mut hits);
            hierarchy.occluded_batch(&queries, intersect, &mut occluded);
            let own = primitives.iter().map(|(shape, sides)| Own(shape.clone(), *sides));
            let owning = ShapeHierarchy::on(own.clone(), backend);
            let dynamic = ShapeHierarchy::on(own.map(|shape| Box::new(shape) as Box<dyn Shape>), backend);
            let (mut own_hits, mut own_occluded) = (Vec::new(), Vec::new());
            owning.nearest_batch(&queries, &mut own_hits);
            dynamic.occluded_batch(&queries, &mut own_occluded);
            assert_eq!(owning.shapes().len(), count);
            for (i, query) in queries.iter().enumerate() {
                let expected = nearest(&primitives, query);
                assert_eq!(bits(hits[i]), bits(expected), "{seed}, {backend}: {query:?}");
                assert_eq!(occluded[i], expected.is_some(), "{seed}, {backend}: {query:?}");
                assert_eq!(bits(own_hits[i]), bits(expected), "{seed}, {backend}: {query:?}");
                assert_eq!(own_occluded[i], expected.is_some(), "{seed}, {backend}: {query:?}");
                if query.from.is_none() {
                    let one =
                        |primitive: u32, ray: &Ray, span: Span| intersect(primitive, &Query::new(*ray, span));
                    let hit = hierarchy.nearest(&query.ray, query.span, one);
                    assert_eq!(bits(hit), bits(expected), "{seed}, {backend}: {query:?}");
                    assert_eq!(hierarchy.occluded(&query.ray, query.span, one), expected.is_some());
                    assert_eq!(bits(dynamic.nearest(&query.ray, query.span)), bits(expected));
                    assert_eq!(owning.occluded(&query.ray, query.span), expected.is_some());
                }
            }
        }
    }
}

#[test]
fn equally_near_hits_go_to_the_least_number() {
    let unit = BoundingBox { min: DVec3::NEG_ONE, max: DVec3::ONE };
    let ray = Ray::new(dvec3(0.0, 0.0, -2.0), DVec3::Z);
    for count in [1, 2, 3, 100, 5000] {
        let hierarchy = BoxHierarchy::new((0..count).map(|_| unit));
        let hit = hierarchy.nearest(&ray, Span::FORWARD, |_, _, _| Some(2.5));
        assert_eq!(hit, Some(Hit { t: 2.5, primitive: 0 }));
    }
}

#[test]
fn empty_boxes_hold_nothing_and_flat_ones_do() {
    let boxes = [
        BoundingBox::EMPTY,
        BoundingBox { min: DVec3::ONE, max: DVec3::ONE },
        BoundingBox { min: DVec3::X, max: -DVec3::X },
        BoundingBox { min: dvec3(-1.0, -1.0, 3.0), max: dvec3(1.0, 1.0, 3.0) },
    ];
    let hierarchy = BoxHierarchy::new(boxes);
    let plane = |primitive: u32, ray: &Ray, _: Span| {
        assert!(primitive % 2 == 1, "{primitive} is in an empty box");
        let bounds = boxes[primitive as usize];
        let point = ray.origin();
        let is_hit = point.x <= bounds.max.x && point.x >= bounds.min.x;
        is_hit.then_some((bounds.min.z - point.z) / ray.direction().z)
    };
    let hit = hierarchy.nearest(&Ray::new(dvec3(1.0, 1.0, 0.0), DVec3::Z), Span::FORWARD, plane);
    assert_eq!(hit, Some(Hit { t: 1.0, primitive: 1 }));
    let hit = hierarchy.nearest(&Ray::new(DVec3::ZERO, DVec3::Z), Span::FORWARD, plane);
    assert_eq!(hit, Some(Hit { t: 3.0, primitive: 3 }));
    let nothing = BoxHierarchy::new([BoundingBox::EMPTY]);
    assert!(!nothing.occluded(&Ray::new(DVec3::ZERO, DVec3::Z), Span::FORWARD, |_, _, _| Some(1.0)));
}

#[test]
fn closure_is_called_once_a_primitive_with_what_is_left_of_the_span() {
    let boxes: Vec<_> = (1..=64)
        .map(|i| BoundingBox { min: dvec3(-1.0, -1.0, f64::from(i)), max: dvec3(1.0, 1.0, f64::from(i)) })
        .collect();
    let hierarchy = BoxHierarchy::new(boxes.iter().copied());
    let calls: Vec<Cell<u32>> = boxes.iter().map(|_| Cell::new(0)).collect();
    let ends = Cell::new(f64::INFINITY);
    let hit = hierarchy.nearest(
        &Ray::new(DVec3::ZERO, DVec3::Z),
        Span { start: 0.0, end: 40.0 },
        |i, ray, span| {
            calls[i as usize].set(calls[i as usize].get() + 1);
            assert!(span.end <= ends.replace(span.end) && span.end <= 40.0);
            let t = boxes[i as usize].min.z - ray.origin().z;
            // From the thirtieth on.
            (i >= 29 && span.contains(t)).then_some(t)
        },
    );
    assert_eq!(hit, Some(Hit { t: 30.0, primitive: 29 }));
    assert!(calls.iter().all(|calls| calls.get() <= 1));
    assert!(calls[31..].iter().all(|calls| calls.get() == 0), "boxes after the hit are not looked into");
}

#[test]
fn senseless_answers_count_as_none() {
    let unit = BoundingBox { min: DVec3::NEG_ONE, max: DVec3::ONE };
    let hierarchy = BoxHierarchy::new([unit; 20]);
    let ray = Ray::new(dvec3(0.0, 0.0, -2.0), DVec3::Z);
    for answer in [f64::NAN, -1.0, 0.0, f64::INFINITY, 5.0, 7.0] {
        let span = Span { start: 0.0, end: 5.0 };
        assert_eq!(hierarchy.nearest(&ray, span, |_, _, _| Some(answer)), None, "{answer}");
        assert!(!hierarchy.occluded(&ray, span, |_, _, _| Some(answer)), "{answer}");
    }
}

#[test]
fn boxes_that_are_not_finite_are_refused() {
    let bad = [
        BoundingBox { min: DVec3::ZERO, max: dvec3(1.0, f64::INFINITY, 1.0) },
        BoundingBox { min: dvec3(f64::NAN, 0.0, 0.0), max: DVec3::ONE },
        BoundingBox { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY },
    ];
    for bounds in bad {
        let refused = std::panic::catch_unwind(|| BoxHierarchy::new([bounds]));
        assert!(refused.is_err(), "{bounds:?}");
    }
}
