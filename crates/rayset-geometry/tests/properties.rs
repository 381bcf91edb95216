//! What holds for all primitives and rays: hits lie on surfaces and inside bounds, and lanes change no bit.

mod generators;
mod measures;
mod surfaces;

use generators::{Aim, aim, any_primitive, departure, primitive, scale, sides, unit_vector, vector};
use measures::{CONE_MARGIN, coordinates, farthest_distance};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rayset_geometry::glam::DVec3;
use rayset_geometry::{
    AxesLanes, AxesOrder, BoundingPlane, BoundingSphere, ColumnHit, ColumnRun, Cylinder, Departure,
    PARTITION_MARGIN, Primitive, PrimitiveColumns, PrimitiveKind, Probe, Ray, RayLanes, Shear, ShearedLanes,
    Side, Sides, Span, Sphere, Triangle, VolumeSet, compare_products, enclosing_sphere, unit,
};
use rayset_simd::{Backend, Kernel, LaneMask, Lanes, MAX_LANES, Simd};
use surfaces::{distance_to_surface, is_convex, nearest_on_segment};

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(1985), ..ProptestConfig::default() }
}

/// How far a computed hit may lie off its surface, relative to the coordinates: half the partition's margin.
const SURFACE_MARGIN: f64 = PARTITION_MARGIN / 2.0;

/// The hits of one cone or polygon by rays that stand in lanes; some leave it into a side.
struct HitsByRays<'a> {
    columns: &'a PrimitiveColumns,
    kind: PrimitiveKind,
    rays: &'a [(Ray, Span)],
    sides: Sides,
    left: &'a dyn Fn(usize) -> Option<Side>,
}

impl Kernel for HitsByRays<'_> {
    type Output = Vec<Option<f64>>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let mut found = Vec::new();
        for first in (0..MAX_LANES).step_by(S::F64::LANES) {
            let (mut origins, mut directions) = ([[0.0; MAX_LANES]; 3], [[0.0; MAX_LANES]; 3]);
            let (mut starts, mut ends) = ([0.0; MAX_LANES], [0.0; MAX_LANES]);
            let (mut front, mut back) = (0, 0);
            for lane in 0..S::F64::LANES {
                let ((ray, span), left) = (&self.rays[first + lane], (self.left)(first + lane));
                (starts[lane], ends[lane]) = (span.start, span.end);
                for k in 0..3 {
                    origins[k][lane] = ray.origin()[k];
                    directions[k][lane] = ray.direction()[k];
                }
                // A plane is never met again.
                let never_again = if self.kind == PrimitiveKind::Polygon { left } else { Some(Side::Front) };
                front |= u32::from(self.sides.include(Side::Front) && left.is_none()) << lane;
                back |= u32::from(self.sides.include(Side::Back) && (left.is_none() || left != never_again))
                    << lane;
            }
            let load =
                |[x, y, z]: &[[f64; MAX_LANES]; 3]| [simd.load_f64(x), simd.load_f64(y), simd.load_f64(z)];
            let rays = RayLanes { origin: load(&origins), direction: load(&directions) };
            let span = [simd.load_f64(&starts), simd.load_f64(&ends)];
            let sides = (simd.mask_f64(front), simd.mask_f64(back));
            let (hits, t) = if self.kind == PrimitiveKind::Polygon {
                let axes = AxesLanes::of(simd, &rays.direction);
                let order = AxesOrder::of(axes);
                let rays =
                    RayLanes { origin: axes.order(rays.origin), direction: axes.order(rays.direction) };
                let sheared = ShearedLanes::of(simd, rays, span);
                self.columns.polygon_by_rays(simd, 0, (&sheared, &order), sides)
            } else {
                self.columns.cone_by_rays(simd, 0, &rays, span, sides)
            };
            let is_hit = |lane: usize| hits.bits() >> lane & 1 == 1;
            found.extend((0..S::F64::LANES).map(|lane| is_hit(lane).then(|| t.lane(lane))));
        }
        found
    }
}

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

/// A triangle, a ray at it, and how it may be hit.
#[derive(Clone, Debug)]
struct Pair {
    triangle: Triangle,
    ray: Ray,
    span: Span,
    sides: Sides,
    departure: Option<Side>,
}

impl Pair {
    /// A span of the kind ends, or starts, exactly where the ray hits, if it does.
    fn new(triangle: Triangle, ray: Ray, span: usize, sides: Sides, departure: Option<Side>) -> Self {
        let t = Primitive::from(triangle).intersect(&ray, Span::FORWARD, Sides::Both, None).unwrap_or(1.0);
        let span = match span {
            0 => Span { end: t, ..Span::FORWARD },
            1 => Span { start: t, ..Span::FORWARD },
            2 => Span { start: 0.5 * t, end: 2.0 * t },
            _ => Span::FORWARD,
        };
        Self { triangle, ray, span, sides, departure }
    }

    fn alone(&self) -> Option<f64> {
        let Self { triangle, ray, span, sides, departure } = self;
        Primitive::from(*triangle).intersect(ray, *span, *sides, *departure)
    }
}

/// The hits of pairs, a lane each.
struct HitsOfPairs<'a>(&'a [Pair]);

impl Kernel for HitsOfPairs<'_> {
    type Output = Vec<Option<f64>>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Self::Output {
        let mut found = Vec::new();
        for pairs in self.0.chunks(S::F64::LANES) {
            // Lanes without a pair hold a triangle that any ray through the origin is in doubt about.
            let (mut columns, mut sides) = ([[0.0; MAX_LANES]; 17], (0, 0));
            for (lane, pair) in pairs.iter().enumerate() {
                let vertices = pair.triangle.vertices().iter().flat_map(|v| v.to_array());
                let ray = [pair.ray.origin(), pair.ray.direction()].map(|v| v.to_array());
                let span = [pair.span.start, pair.span.end];
                let values = ray.into_iter().flatten().chain(span).chain(vertices);
                for (column, value) in columns.iter_mut().zip(values) {
                    column[lane] = value;
                }
                let may = |side| u32::from(pair.sides.include(side) && pair.departure.is_none()) << lane;
                sides = (sides.0 | may(Side::Front), sides.1 | may(Side::Back));
            }
            let lanes = columns.map(|column| simd.load_f64(&column));
            let [ox, oy, oz, dx, dy, dz, start, end, vertices @ ..] = lanes;
            let [ax, ay, az, bx, by, bz, cx, cy, cz] = vertices;
            let (origin, direction) = ([ox, oy, oz], [dx, dy, dz]);
            let axes = AxesLanes::of(simd, &direction);
            let all =
                |axes_of: &dyn Fn(usize) -> [usize; 3]| (0..S::F64::LANES).map(axes_of).collect::<Vec<_>>();
            let own = all(&|lane| Shear::axes_of(direction.map(|column| column.lane(lane))));
            assert_eq!(axes.common(), own.iter().all(|axes| *axes == own[0]).then_some(own[0]));
            let rays = RayLanes { origin: axes.order(origin), direction: axes.order(direction) };
            let rays = ShearedLanes::of(simd, rays, [start, end]);
            let vertices = axes.order_all([[ax, ay, az], [bx, by, bz], [cx, cy, cz]]);
            let sides = (simd.mask_f64(sides.0), simd.mask_f64(sides.1));
            let (is_hit, t) = Triangle::intersect_pairs(simd, &rays, vertices, sides);
            let known = Triangle::distances_of_pairs(simd, &rays, vertices, is_hit);
            let hits = (0..pairs.len()).filter(|lane| is_hit.bits() >> lane & 1 == 1);
            assert!(hits.into_iter().all(|lane| t.lane(lane).to_bits() == known.lane(lane).to_bits()));
            found.extend((0..pairs.len()).map(|lane| (is_hit.bits() >> lane & 1 == 1).then(|| t.lane(lane))));
        }
        found
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
    #![proptest_config(config(10_000))]

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
        let allowed = match &primitive {
            Primitive::Cone(_) => SURFACE_MARGIN * size + CONE_MARGIN * bounds.radius,
            // Seen edge-on, a concave polygon is only known to be hit inside its convex hull.
            Primitive::Polygon(p) if !is_convex(p) => SURFACE_MARGIN * size / p.normal().dot(ray.direction()).abs(),
            _ => SURFACE_MARGIN * size,
        };
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
    #![proptest_config(config(3_000))]

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
            for backend in Backend::available() {
                let [found, any] = backend.run(HitsOfRun { columns: &columns, ray: &ray, run: &run, departure });
                prop_assert_eq!(bits(found), bits(nearest), "{} {:?}", backend, run);
                prop_assert_eq!(bits(any), bits(hits.first().copied()), "{} {:?}", backend, run);
            }
        }
    }

    #[test]
    fn triangles_in_lanes_with_rays_of_their_own_have_the_bits_of_each_alone(
        pairs in prop::collection::vec((generators::any_triangle(), aim(), sides(), departure(), 0..6_usize), 1..=12),
        along in prop::sample::select(vec![None, Some(DVec3::X), Some(DVec3::NEG_Y), Some(DVec3::Z)]),
    ) {
        let mut made = Vec::new();
        for (triangle, aim, sides, departure, span) in pairs {
            let ray = aimed(&triangle.into(), &aim)?;
            // Along any axis, or all along one; through the same point or nearly.
            let ray = match along.and_then(|axis| unit(ray.direction() + 3.0 * axis)) {
                None => ray,
                Some(direction) => {
                    let t = Primitive::from(triangle).intersect(&ray, Span::FORWARD, Sides::Both, None);
                    let target = ray.at(t.unwrap_or(1.0));
                    Ray::new(target - triangle.bounding_sphere().radius * direction, direction)
                }
            };
            // One in three that leave.
            let departure = if span < 4 { None } else { departure };
            made.push(Pair::new(triangle, ray, span, sides, departure));
        }
        for backend in Backend::available() {
            let found = backend.run(HitsOfPairs(&made));
            for (pair, t) in made.iter().zip(found) {
                let (t, alone) = (t.map(f64::to_bits), pair.alone().map(f64::to_bits));
                prop_assert_eq!(t, alone, "{} {:?}", backend, pair);
            }
        }
    }

    #[test]
    fn rays_in_lanes_against_one_cone_or_polygon_have_the_bits_of_each_alone(
        primitive in prop_oneof![generators::any_cone(), generators::any_polygon()],
        (aims, sides, departure) in (prop::collection::vec(aim(), MAX_LANES), sides(), departure()),
        along in prop::sample::select(vec![None, Some(DVec3::X), Some(DVec3::NEG_Y), Some(DVec3::Z)]),
    ) {
        let mut rays = aims.iter().map(|aim| aimed(&primitive, aim)).collect::<Result<Vec<_>, _>>()?;
        if let Some(axis) = along {
            // Turned so that most share their longest axis, about where they were.
            for ray in &mut rays {
                let size = primitive.bounding_sphere().radius;
                let target = ray.at((primitive.bounding_sphere().center - ray.origin()).dot(ray.direction()));
                let direction = unit(ray.direction() + 3.0 * axis).unwrap_or(axis);
                *ray = Ray::new(target - size * direction, direction);
            }
        }
        // Spans that end, or start, exactly where the ray hits, if it does.
        let rays: Vec<_> = rays.into_iter().enumerate().map(|(lane, ray)| {
            let t = primitive.intersect(&ray, Span::FORWARD, Sides::Both, None).unwrap_or(1.0);
            let span = match lane / 2 % 4 {
                0 => Span { end: t, ..Span::FORWARD },
                1 => Span { start: t, ..Span::FORWARD },
                2 => Span { start: 0.5 * t, end: 2.0 * t },
                _ => Span::FORWARD,
            };
            (ray, span)
        }).collect();
        let mut columns = PrimitiveColumns::default();
        let kind = columns.push(&primitive, sides).kind;
        // Every other one leaves it.
        let left = |lane: usize| departure.filter(|_| lane.is_multiple_of(2));
        for backend in Backend::available() {
            let found = backend.run(HitsByRays { columns: &columns, kind, rays: &rays, sides, left: &left });
            for (lane, ((ray, span), t)) in rays.iter().zip(found).enumerate() {
                let alone = primitive.intersect(ray, *span, sides, left(lane));
                prop_assert_eq!(t.map(f64::to_bits), alone.map(f64::to_bits), "{} {:?}", backend, ray);
            }
        }
    }

    #[test]
    fn near_parallel_ray_hits_a_cone_inside_its_bounds(
        (cone, along, tilt, offset) in (generators::any_cone(), -1.0..3.0, vector(), vector()),
        (tilt_size, offset_size) in (tiny_size(), tiny_size()),
    ) {
        let Primitive::Cone(c) = &cone else { unreachable!() };
        // Parallel to the axis, or to a generator, beside it.
        let outward = c.axis().any_orthonormal_vector();
        let (from, to) = (c.base() + c.base_radius() * outward, c.apex() + c.apex_radius() * outward);
        let size = cone.bounding_sphere().radius;
        for direction in [to - from, c.apex() - c.base()] {
            let Some(direction) = unit(direction + tilt_size * size * tilt) else { continue };
            let ray = Ray::new(from - along * size * direction + offset_size * size * offset, direction);
            for sides in [Sides::Front, Sides::Back, Sides::Both] {
                let Some(t) = cone.intersect(&ray, Span::FORWARD, sides, None) else { continue };
                let bounds = cone.bounding_sphere();
                let outside = ray.at(t).distance(bounds.center) - bounds.radius;
                let margin = PARTITION_MARGIN * coordinates(&ray, std::slice::from_ref(&cone));
                prop_assert!(outside <= margin, "{:e} outside, {:e} allowed", outside, margin);
            }
        }
    }

    #[test]
    fn ray_reflected_off_the_outside_of_a_sphere_never_returns(
        (center, radius, scale, aim) in (vector(), 0.01..1.0, scale(), aim()),
    ) {
        let sphere = Primitive::from(Sphere::new(scale * center, scale * radius));
        let ray = aimed(&sphere, &aim)?;
        let Some(t) = sphere.intersect(&ray, Span::FORWARD, Sides::Front, None) else { return Ok(()) };
        let (point, d) = (ray.at(t), ray.direction());
        let normal = sphere.normal_at(point);
        let Some(reflected) = unit(d - 2.0 * d.dot(normal) * normal) else { return Ok(()) };
        let reflected = Ray::new(point, reflected);
        prop_assert_eq!(sphere.intersect(&reflected, Span::FORWARD, Sides::Both, Some(Side::Front)), None);
    }

    #[test]
    fn ray_refracted_into_a_sphere_hits_its_back_once(
        (center, radius, scale, aim, index) in (vector(), 0.01..1.0, scale(), aim(), 1.05..2.5),
    ) {
        let sphere = Primitive::from(Sphere::new(scale * center, scale * radius));
        let ray = aimed(&sphere, &aim)?;
        let Some(t) = sphere.intersect(&ray, Span::FORWARD, Sides::Front, None) else { return Ok(()) };
        let (point, d) = (ray.at(t), ray.direction());
        let normal = sphere.normal_at(point);
        let (eta, cosine): (f64, f64) = (1.0 / index, -d.dot(normal));
        let cosine_inside = (1.0 - eta * eta * (1.0 - cosine * cosine)).sqrt();
        let refracted = unit(eta * d + (eta * cosine - cosine_inside) * normal).expect("never zero");
        let inside = Ray::new(point, refracted);
        let from_inside = |sides: Sides, span: Span| sphere.intersect(&inside, span, sides, Some(Side::Back));
        let t = from_inside(Sides::Both, Span::FORWARD).expect("it comes out again");
        let chord: f64 = 2.0 * scale * radius * cosine_inside;
        let margin = PARTITION_MARGIN * (coordinates(&ray, std::slice::from_ref(&sphere)) + chord) / cosine_inside;
        prop_assert!((t - chord).abs() <= margin, "{} against {}, margin {:e}", t, chord, margin);
        prop_assert_eq!(from_inside(Sides::Front, Span::FORWARD), None);
        prop_assert_eq!(from_inside(Sides::Both, Span { start: t, ..Span::FORWARD }), None);
    }

    #[test]
    fn segment_that_does_not_pierce_a_zone_meets_nothing_outside_it(
        (anchor, axis, length, scale) in (vector(), unit_vector(), 0.01..2.0, scale()),
        volumes in prop::collection::vec((vector(), 0.0..0.5), 1..8),
        (from, to) in (in_zone(), in_zone()),
    ) {
        let (anchor, length) = (scale * anchor, scale * length);
        let ray = Ray::new(anchor, axis);
        let volumes: Vec<_> = volumes
            .iter()
            .map(|&(center, radius)| BoundingSphere { center: scale * 2.0 * center, radius: scale * radius })
            .collect();
        let largest = |v: &BoundingSphere| v.center.abs().max_element() + v.radius;
        let slack = PARTITION_MARGIN * (anchor.abs().max_element() + volumes.iter().map(largest).fold(0.0, f64::max));
        let plane = BoundingPlane::of(&ray);
        let overlaps = |volume: &BoundingSphere| {
            let along = plane.distance(volume.center);
            -volume.radius - slack <= along && along <= length + volume.radius + slack
        };
        let outside = |volume: &&BoundingSphere| VolumeSet::of(&ray, volume, slack) != VolumeSet::Intersected;
        let radial = |volume: &BoundingSphere| {
            let from_anchor = volume.center - anchor;
            (from_anchor - from_anchor.dot(axis) * axis).length() - volume.radius
        };
        let limits = volumes.iter().filter(outside).filter(|volume| overlaps(volume)).map(radial);
        // A zone shrinks by its margin: see the partition's.
        let radius = limits.fold(f64::INFINITY, f64::min) - slack;
        let zone = Cylinder { anchor, axis, length, radius };
        let across = axis.any_orthonormal_vector();
        let reach = if radius.is_finite() { radius } else { scale };
        let point = |(along, lateral, turn): (f64, f64, f64)| {
            let outward = unit(turn * across + (1.0 - turn.abs()) * axis.cross(across)).expect("not zero");
            anchor + along * length * axis + lateral * reach * outward
        };
        let (from, to) = (point(from), point(to));
        // The segment stays between the end planes; see `in_zone`.
        if zone.is_pierced_by(from, to) {
            return Ok(());
        }
        for volume in volumes.iter().filter(outside) {
            let gap = volume.center.distance(nearest_on_segment(volume.center, [from, to])) - volume.radius;
            let strictly_inside = zone.contains_axially(from) && zone.contains_axially(to);
            let allowed = if strictly_inside && overlaps(volume) { 0.0 } else { -slack };
            prop_assert!(gap >= allowed, "{:?} reaches {:e} into the segment", volume, -gap);
        }
    }

    #[test]
    fn enclosing_sphere_holds_all_primitives(members in group(1..=8)) {
        let sphere = enclosing_sphere(&members);
        for member in &members {
            let is_cone = member.kind() == PrimitiveKind::Cone;
            // Cones are held with the thickness of their hits.
            let thickness = if is_cone { CONE_MARGIN * member.bounding_sphere().radius } else { 0.0 };
            let farthest = farthest_distance(member, sphere.center) + thickness;
            prop_assert!(farthest <= sphere.radius, "{:?} reaches {:e} beyond", member, farthest - sphere.radius);
        }
    }

    #[test]
    fn enclosing_sphere_is_nearly_the_smallest(
        (points, scale, flatness) in
            (prop::collection::vec(vector(), 2..=6), scale(), prop::sample::select(vec![1.0, 0.1, 1e-3])),
    ) {
        let points: Vec<_> = points.iter().map(|&p| scale * p * DVec3::new(1.0, 1.0, flatness)).collect();
        let degenerate: Vec<_> = points.iter().map(|&p| Triangle::new(p, p, p).into()).collect();
        let (found, smallest) = (enclosing_sphere(&degenerate).radius, smallest_radius(&points));
        let size = scale * 1e-14;
        prop_assert!(found >= smallest * (1.0 - 1e-9) - size, "{} below {}", found, smallest);
        prop_assert!(found <= smallest * 1.01 + size, "{} is {} of {}", found, found / smallest, smallest);
    }

    #[test]
    fn products_are_compared_as_integers_are(
        (a, b, da, db, shift) in (1_i64..1 << 53, 1_i64..1 << 53, -2_i64..=2, -2_i64..=2, -500_i32..500),
        (sign, exponent) in (prop::sample::select(vec![1.0, -1.0]), -500_i32..400),
    ) {
        // c d = (a + da) (b + db) is as near to a b as integers come; also with b and d swapped for factors apart.
        let (c, d) = ((a + da).clamp(1, 1 << 53), (b + db).clamp(1, 1 << 53));
        let expected = (i128::from(a) * i128::from(b)).cmp(&(i128::from(c) * i128::from(d)));
        let power = |e: i32| f64::from_bits(u64::try_from(e + 1023).expect("a normal exponent") << 52);
        let float = |value: i64, e: i32| value as f64 * power(e);
        let (left, right) = ((float(a, exponent), float(b, shift)), (float(c, shift), float(d, exponent)));
        let order = compare_products(sign * left.0, left.1, right.0, sign * right.1);
        prop_assert_eq!(order, if sign > 0.0 { expected } else { expected.reverse() });
    }
}

fn tiny_size() -> impl Strategy<Value = f64> {
    prop::sample::select(vec![0.0, 1e-17, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3])
}

/// Where a point is in a zone: along the axis in lengths, off the axis in radii, and which way.
fn in_zone() -> impl Strategy<Value = (f64, f64, f64)> {
    let along = prop_oneof![8 => 0.0..1.0, 1 => Just(0.0), 1 => Just(1.0)];
    let lateral = prop_oneof![4 => 0.0..1.1, 1 => 0.999_999_999_999..1.000_000_000_001];
    (along, lateral, -1.0..1.0)
}

/// The radius of the smallest sphere round at most six points: the least circumsphere of two, three or four of them
/// that holds the others.
fn smallest_radius(points: &[DVec3]) -> f64 {
    let size = points.iter().map(|p| p.distance(points[0])).fold(0.0, f64::max);
    let subsets = (1_u32..1 << points.len()).filter(|set| (2..=4).contains(&set.count_ones()));
    let spheres = subsets.filter_map(|set| {
        let chosen: Vec<_> = (0..points.len()).filter(|i| set >> i & 1 == 1).map(|i| points[i]).collect();
        let center = circumcenter(&chosen)?;
        let radius = center.distance(chosen[0]);
        let holds_all = points.iter().all(|p| p.distance(center) <= radius + 1e-10 * size);
        holds_all.then_some(radius)
    });
    spheres.fold(f64::INFINITY, f64::min)
}

/// The centre of the smallest sphere through two, three or four points.
fn circumcenter(points: &[DVec3]) -> Option<DVec3> {
    let a = points[0];
    let edges: Vec<_> = points[1..].iter().map(|&p| p - a).collect();
    let offset = match edges[..] {
        [b] => 0.5 * b,
        [b, c] => {
            let normal = b.cross(c);
            (b.length_squared() * c - c.length_squared() * b).cross(normal) * 0.5 / normal.length_squared()
        }
        [b, c, d] => {
            let volume = b.dot(c.cross(d));
            let sum = b.length_squared() * c.cross(d)
                + c.length_squared() * d.cross(b)
                + d.length_squared() * b.cross(c);
            sum * 0.5 / volume
        }
        _ => return None,
    };
    offset.is_finite().then_some(a + offset)
}
