//! Prepared rays.

use rayset_geometry::BoundingBox;
use rayset_simd::Scalar;

use super::*;

/// Whether the ray meets a box, as a traversal tests it.
fn meets(cull: CullRay<'_, 8>, bounds: &crate::frame::CullBox) -> bool {
    let planes = [bounds.low, bounds.high].concat();
    let ([near, far], [near_offset, far_offset]) = (cull.planes(), cull.offsets());
    let near = (0..3).map(|k| planes[near[k]] * cull.inverse()[k] + near_offset[k]);
    let far = (0..3).map(|k| planes[far[k]] * cull.inverse()[k] + far_offset[k]);
    near.fold(cull.start(), f32::max) <= far.fold(f32::INFINITY, f32::min)
}

/// A ray prepared by itself.
fn alone(frame: &Frame, ray: &Ray, span: Span) -> CullRays<8> {
    CullRays::alone(Scalar, frame, &Copies::<8>::of(ray, span).columns(), Targets::FLAT)
}

/// How many rays that touch a box exactly are said to miss it, if planes are moved by `factor` of the margin.
fn misses(factor: f32) -> usize {
    let frame = Frame::of(&BoundingBox { min: DVec3::splat(-3.0), max: DVec3::splat(5.0) });
    let mut misses = 0;
    for i in 0..4000 {
        let at = |k: f64| (f64::from(i) * k).fract();
        let (a, b, c) = (at(0.618_033_9), at(0.754_877_7), at(0.569_840_3));
        let bounds = BoundingBox { min: DVec3::new(a, b, c), max: DVec3::new(a + 0.1, b + 0.2, c + 0.3) };
        // Through an edge of the box and away from it.
        let edge = DVec3::new(a, b, c + 0.3 * at(0.819_172_5));
        let across = DVec3::new(1.0, -1.0, at(0.671_043_6) - 0.5).normalize();
        let ray = Ray::new(edge - (1.0 + 3.0 * a) * across, across);
        let mut rays = alone(&frame, &ray, Span::FORWARD);
        for k in 0..3 {
            let (near, far) = (rays.near_offset[k][0], rays.far_offset[k][0]);
            let middle = 0.5 * (near + far);
            rays.near_offset[k][0] = middle + factor * (near - middle);
            rays.far_offset[k][0] = middle + factor * (far - middle);
        }
        misses += usize::from(!meets(rays.ray(0).unwrap(), &frame.cull_box(&bounds)));
    }
    misses
}

#[test]
fn slab_margin_is_needed() {
    assert_eq!(misses(1.0), 0);
    assert!(misses(0.0) > 100, "{}", misses(0.0));
}

#[test]
fn a_span_without_an_end_is_one() {
    let frame = Frame::of(&BoundingBox { min: DVec3::NEG_ONE, max: DVec3::ONE });
    let ray = Ray::new(DVec3::new(0.0, 0.0, -3.0), DVec3::Z);
    let rays = alone(&frame, &ray, Span::FORWARD);
    let cull = rays.ray(0).expect("it hits");
    // A hit is sure only if it surely lies before the end.
    assert!(cull.end_below() > 1e37, "{}", cull.end_below());
    assert!(cull.end(Span::FORWARD.end) > f32::MAX);
}

#[test]
fn origins_far_away_are_moved_or_give_up() {
    let frame = Frame::of(&BoundingBox { min: DVec3::NEG_ONE, max: DVec3::ONE });
    for distance in [1.0, 10.0, 1e6, 1e12, 1e20, 1e300] {
        let ray = Ray::new(DVec3::new(0.0, 0.0, -distance), DVec3::Z);
        let rays = alone(&frame, &ray, Span::FORWARD);
        let cull = rays.ray(0).expect("it hits");
        assert!(cull.offsets().as_flattened().iter().all(|offset| offset.is_finite()));
        assert!(meets(cull, &frame.cull_box(&BoundingBox { min: DVec3::NEG_ONE, max: DVec3::ONE })));
        let missing = Ray::new(ray.origin(), -DVec3::Z);
        assert!(
            alone(&frame, &missing, Span::FORWARD).ray(0).is_none() || !(100.0..1e12).contains(&distance)
        );
    }
}

/// All there is of a ray: the bits of its numbers, its planes and axes.
fn all(cull: CullRay<'_, 8>) -> (Vec<u32>, [[usize; 3]; 3]) {
    let [near_offset, far_offset] = cull.offsets();
    let (origin, direction) = (cull.origin(), cull.direction());
    let Shears { factors, crossings } = cull.shears(Scalar);
    let [factors, crossings] = [factors, crossings].map(|three| three.map(|lanes| lanes.lane(0)));
    let threes = [cull.inverse(), near_offset, far_offset, origin, direction, factors, crossings];
    let Rounding { vertex, distance, .. } = cull.rounding();
    let ones =
        [vertex, distance, cull.unit(), cull.start(), cull.start_above(), cull.end_below(), cull.end_above()];
    let distances = [cull.end(1.0), cull.below(1.0)];
    let numbers = threes.as_flattened().iter().chain(&ones).chain(&distances);
    let [near, far] = cull.planes();
    (numbers.map(|x| x.to_bits()).collect(), [near, far, cull.axes])
}

#[test]
fn rays_prepared_together_are_what_each_is_alone() {
    let frame = Frame::of(&BoundingBox { min: DVec3::NEG_ONE, max: DVec3::ONE });
    let distances = [0.5, 3.0, 1e3, 1e17, 0.0, 50.0];
    let directions = [DVec3::Z, DVec3::NEG_X, DVec3::new(-0.6, 0.8, -0.0), DVec3::new(0.0, -0.6, 0.8)];
    let rays: Vec<_> = (0..23)
        .map(|i| {
            let direction = directions[i % directions.len()];
            let away = if i % 7 == 3 { 1.0 } else { -1.0 };
            let ray = Ray::new(away * distances[i % distances.len()] * direction, direction);
            (ray, Span { start: [0.0, 0.25, -1.0][i % 3], end: [2.0, f64::INFINITY][i % 2] })
        })
        .collect();
    let column = |of: &dyn Fn(&(Ray, Span)) -> f64| rays.iter().map(of).collect::<Vec<_>>();
    let origins = [0, 1, 2].map(|k| column(&|(ray, _)| ray.origin()[k]));
    let directions = [0, 1, 2].map(|k| column(&|(ray, _)| ray.direction()[k]));
    let (starts, ends) = (column(&|(_, span)| span.start), column(&|(_, span)| span.end));
    let columns = RayColumns {
        origins: [&origins[0], &origins[1], &origins[2]],
        directions: [&directions[0], &directions[1], &directions[2]],
        spans: (&starts, &ends),
        left: &[],
    };
    let mut prepared = CullRays::<8>::NONE;
    let (mut first, mut lost) = (0, 0);
    for len in [8, 1, 5, 8, 1] {
        prepared.prepare(Scalar, &frame, &columns, (first, len), Targets::FLAT);
        for lane in 0..len {
            let (ray, span) = rays[first + lane];
            let alone = alone(&frame, &ray, span);
            let (ray, alone) = (prepared.ray(lane), alone.ray(0));
            assert_eq!(ray.map(all), alone.map(all), "{}", first + lane);
            lost += u32::from(alone.is_none());
        }
        first += len;
    }
    assert!(first == rays.len() && lost > 0);
}
