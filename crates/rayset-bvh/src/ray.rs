//! A ray in culling space.

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Ray, Span};

use crate::frame::{Frame, round_down, round_up};

/// How far planes of boxes are moved outwards, in units of culling space for an origin within the scene; multiplied by
/// one plus the origin's largest coordinate there.
///
/// Covers the rounding of single precision in the origin, the direction, its inverse and the distance to a plane.
/// Derived in `docs/numerics.md`.
pub const SLAB_MARGIN: f64 = 96.0 / 16_777_216.0;

/// The rounding of single precision.
pub(crate) const SINGLE: f64 = 1.0 / 16_777_216.0;

/// How far a computed hit may lie off its primitive's box, relative to the coordinates involved, in double precision:
/// twice `PARTITION_MARGIN`.
pub(crate) const HIT_MARGIN: f64 = 2.0 * rayset_geometry::PARTITION_MARGIN;

/// An origin farther out than this is moved along the ray first; in units of culling space.
const FAR: f64 = 4.0;

/// What counts as the end of a span that has none: rounding infinity down would give NaN, which no hit lies before.
const LAST: f64 = 1e38;

/// Components of the direction of a smaller size count as this.
pub(crate) const LEAST_COMPONENT: f32 = 1e-18;

/// A ray prepared for culling: it only discards what the `f64` ray cannot hit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CullRay {
    /// One over the direction.
    pub(crate) inverse: [f32; 3],
    /// What is added to a near or far plane's distance.
    pub(crate) near_offset: [f32; 3],
    pub(crate) far_offset: [f32; 3],
    /// Which of a node's six planes are near and far.
    pub(crate) near: [usize; 3],
    pub(crate) far: [usize; 3],
    /// Where the span starts, or less, and or more.
    pub(crate) start: f32,
    pub(crate) start_above: f32,
    /// Where the span ends, or less.
    pub(crate) end_below: f32,
    /// The origin in culling space, moved along the ray if it was far off, and the direction; rounded.
    pub(crate) origin: [f32; 3],
    pub(crate) direction: [f32; 3],
    /// How far off a coordinate may be: see [`crate::interval`].
    pub(crate) unit: f32,
    /// World units to units of culling space.
    scale: f64,
    /// How far the origin was moved along the ray, in units of culling space.
    advance: f64,
}

impl CullRay {
    /// Prepares a ray; `None` if it is so far off that it cannot hit anything.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the margin makes up for the rounding")]
    pub(crate) fn new(frame: &Frame, ray: &Ray, span: Span) -> Option<Self> {
        let direction = ray.direction();
        let mut origin = frame.point(ray.origin());
        let mut size = origin.abs().max_element();
        // The error of a hit grows with the coordinates of the origin as it was, and with those of the scene.
        let mut hit_slack = HIT_MARGIN * (2.0 * (size + frame.remoteness) + 1.0);
        let mut advance = 0.0;
        let mut start = span.start * frame.scale;
        if hit_slack.is_nan() || hit_slack >= 1.0 {
            // So far off that a hit's error is larger than the scene: every box is met.
            (origin, size, hit_slack, start) = (DVec3::ZERO, 0.0, 1e6, f64::NEG_INFINITY);
        } else if size > FAR {
            // Nothing lies nearer than the distance to a sphere round the unit cube.
            advance = (origin.length() - FAR).max(0.0);
            origin += advance * direction;
            size = origin.abs().max_element();
            if size > 4.0 * FAR {
                return None;
            }
        }
        let slack = (SLAB_MARGIN * (1.0 + size) + hit_slack) as f32;
        let single = |v: DVec3| [v.x as f32, v.y as f32, v.z as f32];
        let (origin_single, direction_single) = (single(origin), single(direction));
        let mut cull = Self {
            inverse: [0.0; 3],
            near_offset: [0.0; 3],
            far_offset: [0.0; 3],
            near: [0; 3],
            far: [0; 3],
            start: round_down(start - advance),
            start_above: round_up(start.max(0.0) - advance),
            end_below: round_down((span.end * frame.scale - advance).min(LAST)),
            origin: origin_single,
            direction: direction_single,
            unit: ((1.0 + size) / 16_777_216.0 + hit_slack) as f32,
            scale: frame.scale,
            advance,
        };
        for k in 0..3 {
            let (o, d) = (origin_single[k], direction_single[k]);
            let inverse = (1.0 / d.abs().max(LEAST_COMPONENT)).copysign(d);
            let towards = slack.copysign(d);
            cull.inverse[k] = inverse;
            cull.near_offset[k] = (-o - towards) * inverse;
            cull.far_offset[k] = (towards - o) * inverse;
            let is_turned = usize::from(d.is_sign_negative());
            cull.near[k] = k + 3 * is_turned;
            cull.far[k] = 3 + k - 3 * is_turned;
        }
        Some(cull)
    }

    /// A distance in culling space that is not below `t` in world units.
    #[inline(always)]
    pub(crate) fn end(&self, t: f64) -> f32 {
        round_up(t * self.scale - self.advance)
    }

    /// A distance in culling space that is not above `t` in world units.
    #[inline(always)]
    pub(crate) fn below(&self, t: f64) -> f32 {
        round_down(t * self.scale - self.advance)
    }
}

#[cfg(test)]
mod tests {
    use rayset_geometry::BoundingBox;

    use super::*;

    /// Whether the ray meets a box, as a traversal tests it.
    fn meets(cull: &CullRay, bounds: &crate::frame::CullBox) -> bool {
        let planes = [bounds.low, bounds.high].concat();
        let near = (0..3).map(|k| planes[cull.near[k]] * cull.inverse[k] + cull.near_offset[k]);
        let far = (0..3).map(|k| planes[cull.far[k]] * cull.inverse[k] + cull.far_offset[k]);
        near.fold(cull.start, f32::max) <= far.fold(f32::INFINITY, f32::min)
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
            let mut cull = CullRay::new(&frame, &ray, Span::FORWARD).unwrap();
            for k in 0..3 {
                let (near, far) = (cull.near_offset[k], cull.far_offset[k]);
                let middle = 0.5 * (near + far);
                cull.near_offset[k] = middle + factor * (near - middle);
                cull.far_offset[k] = middle + factor * (far - middle);
            }
            misses += usize::from(!meets(&cull, &frame.cull_box(&bounds)));
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
        let cull = CullRay::new(&frame, &ray, Span::FORWARD).expect("it hits");
        // A hit is sure only if it surely lies before the end.
        assert!(cull.end_below > 1e37, "{}", cull.end_below);
        assert!(cull.end(Span::FORWARD.end) > f32::MAX);
    }

    #[test]
    fn origins_far_away_are_moved_or_give_up() {
        let frame = Frame::of(&BoundingBox { min: DVec3::NEG_ONE, max: DVec3::ONE });
        for distance in [1.0, 10.0, 1e6, 1e12, 1e20, 1e300] {
            let ray = Ray::new(DVec3::new(0.0, 0.0, -distance), DVec3::Z);
            let cull = CullRay::new(&frame, &ray, Span::FORWARD).expect("it hits");
            assert!(cull.near_offset.iter().chain(&cull.far_offset).all(|offset| offset.is_finite()));
            assert!(meets(&cull, &frame.cull_box(&BoundingBox { min: DVec3::NEG_ONE, max: DVec3::ONE })));
            let missing = Ray::new(ray.origin(), -DVec3::Z);
            assert!(
                CullRay::new(&frame, &missing, Span::FORWARD).is_none() || !(100.0..1e12).contains(&distance)
            );
        }
    }
}
