//! The margins of hits and bounds: each is needed by some ray, and enough for all.

mod measures;

use measures::{CONE_MARGIN, coordinates, farthest_distance};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayset_geometry::glam::DVec3;
use rayset_geometry::{
    BoundingSphere, Cone, PARTITION_MARGIN, Polygon, Primitive, Ray, Sides, Span, Sphere, Triangle,
    VolumeSet, unit,
};

/// Primitives that touch a volume from inside, and rays from 1e6 units away that brush past the place.
///
/// Returns how many rays hit the primitive, and how many of those miss the volume at no slack and at the margin.
fn brush_past(touching: impl Fn(DVec3, DVec3) -> Primitive) -> [usize; 3] {
    let mut random = ChaCha8Rng::seed_from_u64(1985);
    let mut number = || (random.next_u64() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
    let mut vector = || unit(DVec3::new(number(), number(), number())).expect("no random vector is zero");
    let mut counts = [0; 3];
    for _ in 0..10_000 {
        let (center, normal) = (vector(), vector());
        let contact = center + normal;
        let direction = unit(vector().cross(normal)).expect("no random vectors are parallel");
        let primitive = touching(center, contact);
        let ray = Ray::new(contact - 1e-10 * vector() - 1e6 * direction, direction);
        let volume = BoundingSphere { center, radius: farthest_distance(&primitive, center) };
        if primitive.intersect(&ray, Span::FORWARD, Sides::Both, None).is_some() {
            let slack = PARTITION_MARGIN * coordinates(&ray, &[primitive]);
            let is_lost = |slack: f64| VolumeSet::of(&ray, &volume, slack) != VolumeSet::Intersected;
            counts[0] += 1;
            counts[1] += usize::from(is_lost(0.0));
            counts[2] += usize::from(is_lost(slack));
        }
    }
    counts
}

#[test]
fn cone_thickness_is_needed_and_enough() {
    let mut random = ChaCha8Rng::seed_from_u64(1985);
    let mut number = || (random.next_u64() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
    let mut vector = || DVec3::new(number(), number(), number());
    let axes: Vec<_> = (0..101).map(|_| unit(vector()).expect("no random vector is zero")).collect();
    let pointed = |&axis: &DVec3| Cone::new(DVec3::ZERO, 0.1, axis, 0.0).expect("it has a height").into();
    let cones: Vec<Primitive> = axes.iter().map(pointed).collect();
    let (mut outside, mut hits) = (0, 0);
    for i in 0..200_000_u32 {
        // Past a pointed apex, at the distances where the roots of rounding errors lie.
        let axis = axes[i as usize % axes.len()];
        let cone = &cones[i as usize % axes.len()];
        let direction = unit(vector()).expect("no random vector is zero");
        let closeness = 1e-7 / f64::from(1 << (i % 8));
        let ray = Ray::new(axis + closeness * vector() - direction, direction);
        let Some(t) = cone.intersect(&ray, Span::FORWARD, Sides::Both, None) else { continue };
        // A sphere that the apex alone touches, from the side.
        let center = axis - 10.0 * unit(0.3 * axis + axis.any_orthonormal_vector()).expect("not zero");
        let beyond = ray.at(t).distance(center) - farthest_distance(cone, center);
        let margin = PARTITION_MARGIN * 4.0;
        hits += 1;
        outside += u32::from(beyond > margin);
        let allowed = CONE_MARGIN * cone.bounding_sphere().radius + margin;
        assert!(beyond <= allowed, "{beyond:e} beyond the apex, {allowed:e} allowed");
    }
    assert!(hits > 1000, "only {hits} hits");
    assert!(outside > 0, "all {hits} hits lie in a sphere round the cone without its thickness");
}

#[test]
fn flat_cone_is_hit_inside_its_bounds() {
    let mut random = ChaCha8Rng::seed_from_u64(1985);
    let mut number = || (random.next_u64() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
    let mut vector = || DVec3::new(number(), number(), number());
    let axes: Vec<_> = (0..101).map(|_| unit(vector()).expect("no random vector is zero")).collect();
    let mut hits = 0;
    for (i, &axis) in axes.iter().enumerate() {
        let height = [1e-6, 1e-8, 1e-10, 1e-12, 1e-14][i % 5];
        let apex_radius = if i % 2 == 0 { 0.0 } else { 0.5 };
        let cone = Cone::new(DVec3::ZERO, 1.0, height * axis, apex_radius).expect("it has a height");
        for _ in 0..2000 {
            // In the plane of its base, or tilted by the slope of its surface.
            let across = unit(vector().cross(axis)).expect("no random vectors are parallel");
            let direction = unit(across + height * vector()).expect("not zero");
            let beside = vector().cross(axis);
            let ray = Ray::new(beside - 2.0 * direction, direction);
            let Some(t) = Primitive::from(cone).intersect(&ray, Span::FORWARD, Sides::Both, None) else {
                continue;
            };
            hits += 1;
            let bounds = cone.bounding_sphere();
            let outside = ray.at(t).distance(bounds.center) - bounds.radius;
            assert!(outside <= PARTITION_MARGIN * 4.0, "height {height:e}: {outside:e} outside");
        }
    }
    assert!(hits > 1000, "only {hits} hits");
}

#[test]
fn partition_margin_is_needed_and_enough() {
    let sphere = |center: DVec3, contact: DVec3| Sphere::new(center.lerp(contact, 0.5), 0.5).into();
    let base = |center: DVec3, contact: DVec3| {
        let across = (contact - center).any_orthonormal_vector();
        [center + 0.3 * across, center - 0.4 * across]
    };
    let triangle = |center: DVec3, contact: DVec3| {
        let [a, b] = base(center, contact);
        Triangle::new(a, b, contact).into()
    };
    let polygon = |center: DVec3, contact: DVec3| {
        let [a, b] = base(center, contact);
        Polygon::new(vec![a, center - 0.1 * (contact - center), b, contact]).expect("it has an area").into()
    };
    let cone = |center: DVec3, contact: DVec3| {
        let [base, _] = base(center, contact);
        Cone::new(base, 0.3, contact, 0.0).expect("it has a height").into()
    };
    let counts = [brush_past(sphere), brush_past(triangle), brush_past(polygon), brush_past(cone)];
    for (kind, [hits, lost_without, lost]) in ["sphere", "triangle", "polygon", "cone"].iter().zip(counts) {
        assert!(hits > 100, "only {hits} rays hit the {kind}");
        assert!(lost_without > 0, "no hit of a {kind} needs the margin");
        assert_eq!(lost, 0, "of {hits} hits of a {kind} the partition loses {lost}");
    }
}
