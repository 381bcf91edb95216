//! Every answer has the bits of a loop over all primitives.

use proptest::prelude::*;
use rayset_bvh::{Hierarchy, Hit, Query};
use rayset_geometry::glam::{DVec3, dvec3};
use rayset_geometry::{Cone, Polygon, Primitive, Ray, Side, Sides, Span, Sphere, Triangle, unit};
use rayset_simd::Backend;

/// The least hit in the order `(t, primitive)`, by a loop.
fn brute_force(primitives: &[(Primitive, Sides)], query: &Query) -> Option<Hit> {
    let mut nearest: Option<Hit> = None;
    for (number, (primitive, sides)) in (0_u32..).zip(primitives) {
        let departure = query.from.filter(|from| from.0 == number).map(|from| from.1);
        if let Some(t) = primitive.intersect(&query.ray, query.span, *sides, departure)
            && nearest.is_none_or(|nearest| t < nearest.t)
        {
            nearest = Some(Hit { t, primitive: number });
        }
    }
    nearest
}

fn answers(hierarchy: &Hierarchy, rays: &[Query]) -> Vec<(Option<Hit>, bool)> {
    let mut scratch = hierarchy.scratch();
    let answer =
        |query| (hierarchy.nearest_with(query, &mut scratch), hierarchy.occluded_with(query, &mut scratch));
    rays.iter().map(answer).collect()
}

fn check(primitives: &[(Primitive, Sides)], rays: &[Query]) {
    let mut columns = rayset_geometry::PrimitiveColumns::default();
    let items: Vec<_> = primitives
        .iter()
        .map(|(primitive, sides)| {
            let run = columns.push(primitive, *sides);
            (run.kind, run.range.start, *sides)
        })
        .collect();
    let expected: Vec<_> = rays.iter().map(|query| brute_force(primitives, query)).collect();
    for &backend in Backend::available() {
        let hierarchy = Hierarchy::over(&columns, &items, backend);
        let answers = answers(&hierarchy, rays);
        for (i, (answer, expected)) in answers.iter().zip(&expected).enumerate() {
            let bits = |hit: &Option<Hit>| hit.map(|hit| (hit.t.to_bits(), hit.primitive));
            assert_eq!(bits(&answer.0), bits(expected), "{backend}: {:?}", rays[i]);
            assert_eq!(answer.1, expected.is_some(), "{backend}: {:?}", rays[i]);
        }
    }
}

fn point() -> impl Strategy<Value = DVec3> {
    (-1.0..1.0, -1.0..1.0, -1.0..1.0).prop_map(|(x, y, z)| dvec3(x, y, z))
}

/// A coordinate of a lattice: many coincide.
fn lattice() -> impl Strategy<Value = DVec3> {
    (-2..=2, -2..=2, -2..=2).prop_map(|(x, y, z)| 0.5 * dvec3(f64::from(x), f64::from(y), f64::from(z)))
}

fn any_point() -> impl Strategy<Value = DVec3> {
    prop_oneof![point(), lattice()]
}

fn primitive() -> impl Strategy<Value = Primitive> {
    let radius = prop_oneof![0.01..0.3, Just(0.25), Just(0.5), Just(0.0)];
    prop_oneof![
        (any_point(), radius).prop_map(|(center, radius)| Sphere::new(center, radius).into()),
        (any_point(), any_point(), any_point()).prop_map(|(a, b, c)| Triangle::new(a, b, c).into()),
        (any_point(), any_point(), any_point()).prop_map(|(a, b, c)| {
            match Polygon::new(vec![a, b, c, a + c - b]) {
                Some(polygon) => polygon.into(),
                None => Triangle::new(a, b, c).into(),
            }
        }),
        (any_point(), 0.0..0.3, any_point(), 0.01..0.3).prop_map(|(base, r, apex, s)| {
            match Cone::new(base, r, apex, s) {
                Some(cone) => cone.into(),
                None => Sphere::new(base, s).into(),
            }
        }),
    ]
}

fn sides() -> impl Strategy<Value = Sides> {
    prop_oneof![Just(Sides::Both), Just(Sides::Front), Just(Sides::Back)]
}

fn direction() -> impl Strategy<Value = DVec3> {
    let component = || prop_oneof![4 => -1.0..1.0, 1 => Just(0.0), 1 => Just(-0.0), 1 => Just(5e-324), 1 => Just(-1e-310), 1 => Just(1e-19)];
    (component(), component(), component()).prop_map(|(x, y, z)| unit(dvec3(x, y, z)).unwrap_or(DVec3::NEG_Z))
}

fn ray() -> impl Strategy<Value = (DVec3, DVec3, f64, f64, Option<(prop::sample::Index, bool)>)> {
    let far = prop_oneof![4 => Just(1.0), 1 => Just(3.0), 1 => Just(100.0), 1 => Just(1e6)];
    let end = prop_oneof![2 => Just(f64::INFINITY), 1 => 0.0..3.0];
    (any_point(), far, direction(), end, prop::option::of((any::<prop::sample::Index>(), any::<bool>())))
        .prop_map(|(origin, far, direction, end, from)| {
            // From far away, along the ray: so that it may still hit.
            (origin - (far - 1.0) * direction, direction, far - 1.0, end, from)
        })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]
    #[test]
    fn answers_have_the_bits_of_a_loop(
        primitives in prop::collection::vec((primitive(), sides()), 0..120),
        rays in prop::collection::vec(ray(), 40),
        scale in prop::sample::select(vec![1.0, 1e-3, 1e-100, 1e6, 1e50]),
        shift in prop::sample::select(vec![0.0, 0.0, 1e3, 1e6]),
    ) {
        let place = |p: DVec3| scale * (p + DVec3::splat(shift));
        let primitives: Vec<(Primitive, Sides)> = primitives
            .into_iter()
            .map(|(primitive, sides)| (moved(&primitive, place, scale), sides))
            .collect();
        let rays: Vec<_> = rays
            .into_iter()
            .map(|(origin, direction, far, end, from)| {
                let span = Span { start: 0.0, end: scale * (end + far) };
                let from = from.filter(|_| !primitives.is_empty()).map(|(index, front)| {
                    let number = u32::try_from(index.index(primitives.len())).unwrap();
                    (number, if front { Side::Front } else { Side::Back })
                });
                Query { ray: Ray::new(place(origin), direction), span, from }
            })
            .collect();
        check(&primitives, &rays);
    }
}

fn moved(primitive: &Primitive, place: impl Fn(DVec3) -> DVec3, scale: f64) -> Primitive {
    match primitive {
        Primitive::Sphere(s) => Sphere::new(place(s.center()), scale * s.radius()).into(),
        Primitive::Triangle(t) => {
            let [a, b, c] = t.vertices().map(&place);
            Triangle::new(a, b, c).into()
        }
        Primitive::Polygon(p) => match Polygon::new(p.vertices().iter().copied().map(&place).collect()) {
            Some(polygon) => polygon.into(),
            None => Sphere::new(place(p.vertices()[0]), 0.1 * scale).into(),
        },
        Primitive::Cone(c) => {
            match Cone::new(
                place(c.base()),
                scale * c.base_radius(),
                place(c.apex()),
                scale * c.apex_radius(),
            ) {
                Some(cone) => cone.into(),
                None => Sphere::new(place(c.base()), 0.1 * scale).into(),
            }
        }
    }
}

#[test]
fn coincident_primitives_answer_with_the_least_number() {
    for n in [1_u32, 7, 16, 17, 1000, 20_000] {
        let sphere = Primitive::from(Sphere::new(DVec3::ZERO, 1.0));
        let primitives: Vec<_> = (0..n).map(|_| (sphere.clone(), Sides::Both)).collect();
        let ray = Ray::new(dvec3(0.0, 0.0, -3.0), DVec3::Z);
        check(&primitives, &[ray.into(), Query::leaving(ray, Span::FORWARD, 0, Side::Front)]);
    }
}
