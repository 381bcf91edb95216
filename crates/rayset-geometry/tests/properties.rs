//! What holds for all primitives and rays: hits lie on surfaces and inside bounds, and lanes change no bit.

mod generators;

use generators::{Aim, aim, any_primitive, departure, features, primitive, scale, sides, vector};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rayset_geometry::glam::DVec3;
use rayset_geometry::{
    BoundingSphere, ColumnHit, ColumnRun, Departure, PARTITION_MARGIN, Primitive, PrimitiveColumns,
    PrimitiveKind, Probe, Ray, Side, Sides, Span, VolumeSet, enclosing_sphere,
};
use rayset_simd::{Backend, Kernel, Simd};

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases: std::env::var("CASES").map_or(cases, |c| c.parse().unwrap()), rng_seed: std::env::var("SEED").map_or(RngSeed::Fixed(1985), |c| RngSeed::Fixed(c.parse().unwrap())), ..ProptestConfig::default() }
}

/// The coordinates that rounding is relative to: the origin's largest and the primitives' largest, in world units.
fn coordinates(ray: &Ray, primitives: &[Primitive]) -> f64 {
    ray.origin().abs().max_element() + primitives.iter().map(Primitive::extent).fold(0.0, f64::max)
}

fn nearest_on_segment(point: DVec3, [a, b]: [DVec3; 2]) -> DVec3 {
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
fn distance_to_surface(primitive: &Primitive, point: DVec3) -> f64 {
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

/// How far a computed hit may lie off its surface, relative to the coordinates: half the partition's margin.
const SURFACE_MARGIN: f64 = PARTITION_MARGIN / 2.0;

/// How far a hit may lie off a cone, relative to the cone's size: its thickness, see `Cone::bounding_sphere`.
const CONE_MARGIN: f64 = 1.0 / (1_u64 << 24) as f64;

/// The nearest and the first hit of a run, on any backend.
struct HitsOfRun<'a> {
    columns: &'a PrimitiveColumns,
    ray: &'a Ray,
    run: &'a ColumnRun,
    departure: Option<Departure>,
}

impl Kernel for HitsOfRun<'_> {
    type Output = [Option<ColumnHit>; 2];

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let probe = Probe::new(simd, self.ray, Span::FORWARD, self.columns.is_flat());
        [
            self.columns.nearest(&probe, self.run, self.departure),
            self.columns.any(&probe, self.run, self.departure),
        ]
    }
}

fn bits(hit: Option<ColumnHit>) -> Option<(u64, u32)> {
    hit.map(|hit| (hit.t.to_bits(), hit.index))
}

/// Several primitives near each other, all within `scale` of each other.
fn group(sizes: std::ops::RangeInclusive<usize>) -> impl Strategy<Value = Vec<Primitive>> {
    (scale(), vector(), prop::collection::vec(prop::sample::select(vec![1.0, 0.1, 1e-3]), sizes))
        .prop_flat_map(|(scale, center, sizes)| {
            let member = |size: f64| {
                vector().prop_flat_map(move |offset| primitive(scale * (center + 0.5 * offset), scale * size))
            };
            sizes.into_iter().map(member).collect::<Vec<_>>()
        })
}

fn aimed(primitive: &Primitive, aim: &Aim) -> Result<Ray, TestCaseError> {
    aim.at(primitive).ok_or_else(|| TestCaseError::reject("the ray starts at its target"))
}

proptest! {
    #![proptest_config(config(20_000))]

    #[test]
    fn hit_lies_on_its_surface_and_in_its_bounds(
        (primitive, aim, sides, departure) in (any_primitive(), aim(), sides(), departure()),
    ) {
        let ray = aimed(&primitive, &aim)?;
        let Some(t) = primitive.intersect(&ray, Span::FORWARD, sides, departure) else { return Ok(()) };
        let (point, size) = (ray.at(t), coordinates(&ray, std::slice::from_ref(&primitive)));
        let bounds = primitive.bounding_sphere();
        let outside = point.distance(bounds.center) - bounds.radius;
        prop_assert!(outside <= PARTITION_MARGIN * size, "{:?}: {} outside, {:e}", primitive.kind(), outside, outside / size);
        let allowed = SURFACE_MARGIN * size
            + if primitive.kind() == PrimitiveKind::Cone { CONE_MARGIN * bounds.radius } else { 0.0 };
        let off = distance_to_surface(&primitive, point);
        prop_assert!(off <= allowed, "{:?}: {:e} off, allowed {:e}", primitive.kind(), off, allowed);
    }

    #[test]
    fn volume_that_is_not_intersected_is_never_hit((members, aim) in (group(1..=4), aim())) {
        let ray = aimed(&members[0], &aim)?;
        let slack = PARTITION_MARGIN * coordinates(&ray, &members);
        let volumes = [enclosing_sphere(&members), members[0].bounding_sphere()];
        for (volume, members) in volumes.iter().zip([&members[..], &members[..1]]) {
            let set = VolumeSet::of(&ray, volume, slack);
            for member in members {
                let hit = member.intersect(&ray, Span::FORWARD, Sides::Both, None);
                prop_assert!(hit.is_none() || set == VolumeSet::Intersected, "{:?} hit at {:?} in {:?}", member, hit, set);
            }
        }
    }
}

proptest! {
    #![proptest_config(config(4_000))]

    #[test]
    fn every_backend_and_position_gives_the_bits_of_the_primitive_alone(
        (members, aim, sides, departure, who) in (group(1..=24), aim(), sides(), departure(), any::<prop::sample::Index>()),
    ) {
        let who = who.index(members.len());
        let ray = aimed(&members[who], &aim)?;
        let mut columns = PrimitiveColumns::default();
        let runs: Vec<ColumnRun> = members.iter().map(|member| columns.push(member, sides)).collect();
        let index = runs[who].range.start;
        let departure = departure.map(|side: Side| Departure { kind: runs[who].kind, index, side });
        let expected: Vec<Option<ColumnHit>> = members.iter().enumerate().map(|(i, member)| {
            let left = departure.filter(|_| i == who).map(|departure| departure.side);
            let t = member.intersect(&ray, Span::FORWARD, sides, left)?;
            Some(ColumnHit { t, index: runs[i].range.start })
        }).collect();
        let kind = runs[who].kind;
        let n = u32::try_from(columns.len(kind)).unwrap();
        let hits_of_kind = |range: &std::ops::Range<u32>| -> Vec<ColumnHit> {
            let of_kind = runs.iter().zip(&expected).filter(|(run, _)| run.kind == kind && range.contains(&run.range.start));
            of_kind.filter_map(|(_, hit)| *hit).collect()
        };
        // Alone, from the start, to the end, everything, and in the middle.
        for range in [index..index + 1, 0..index + 1, index..n, 0..n, index.saturating_sub(2)..(index + 3).min(n)] {
            let hits = hits_of_kind(&range);
            let nearest = hits.iter().copied().min_by(|a, b| a.t.total_cmp(&b.t).then(a.index.cmp(&b.index)));
            let run = ColumnRun { kind, sides, range };
            for backend in Backend::ALL {
                let [found, any] = backend.run(HitsOfRun { columns: &columns, ray: &ray, run: &run, departure });
                prop_assert_eq!(bits(found), bits(nearest), "{} {:?}", backend, run);
                prop_assert_eq!(bits(any), bits(hits.first().copied()), "{} {:?}", backend, run);
            }
        }
    }

    #[test]
    fn enclosing_sphere_holds_all_primitives(members in group(1..=8)) {
        let sphere = enclosing_sphere(&members);
        for member in &members {
            for point in features(member) {
                let outside = point.distance(sphere.center) - sphere.radius;
                prop_assert!(outside <= 4.0 * f64::EPSILON * member.extent(), "{:?} is {:e} outside {:?}", member, outside, sphere);
            }
        }
    }
}
