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

/// How far a computed hit may lie off its primitive's box, relative to the coordinates involved, in double precision:
/// twice `PARTITION_MARGIN`.
const HIT_MARGIN: f64 = 2.0 * rayset_geometry::PARTITION_MARGIN;

/// An origin farther out than this is moved along the ray first; in units of culling space.
const FAR: f64 = 4.0;

/// Components of the direction of a smaller size count as this.
const LEAST_COMPONENT: f64 = 1e-18;

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
    /// The origin in culling space, moved along the ray if it was far off.
    pub(crate) origin: DVec3,
    /// How far off a coordinate may be: see [`crate::interval`].
    pub(crate) unit: f32,
    /// World units to units of culling space.
    scale: f64,
    /// How far the origin was moved along the ray, in units of culling space.
    advance: f64,
}

impl CullRay {
    /// Prepares a ray; `None` if it is so far off that it cannot hit anything.
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "the margin makes up for the rounding")]
    pub(crate) fn new(frame: &Frame, ray: &Ray, span: Span) -> Option<Self> {
        let direction = ray.direction();
        let mut origin = frame.point(ray.origin());
        let mut size = origin.abs().max_element();
        // The error of a hit grows with the coordinates of the origin as it was, and with those of the scene.
        let center = frame.center.abs().max_element() * frame.scale;
        let mut hit_slack = HIT_MARGIN * (2.0 * (size + center) + 1.0);
        let mut advance = 0.0;
        let mut start = span.start * frame.scale;
        if !(hit_slack < 1.0) {
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
        let slack = SLAB_MARGIN * (1.0 + size) + hit_slack;
        let mut cull = Self {
            inverse: [0.0; 3],
            near_offset: [0.0; 3],
            far_offset: [0.0; 3],
            near: [0, 1, 2],
            far: [3, 4, 5],
            start: round_down(start - advance),
            start_above: round_up(start.max(0.0) - advance),
            end_below: round_down(span.end * frame.scale - advance),
            origin,
            unit: ((1.0 + size) / 16_777_216.0 + hit_slack) as f32,
            scale: frame.scale,
            advance,
        };
        for k in 0..3 {
            let inverse = 1.0 / direction[k].abs().max(LEAST_COMPONENT);
            let (inverse, towards) =
                if direction[k].is_sign_negative() { (-inverse, -slack) } else { (inverse, slack) };
            if towards < 0.0 {
                (cull.near[k], cull.far[k]) = (3 + k, k);
            }
            cull.inverse[k] = inverse as f32;
            cull.near_offset[k] = ((-origin[k] - towards) * inverse) as f32;
            cull.far_offset[k] = ((-origin[k] + towards) * inverse) as f32;
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
