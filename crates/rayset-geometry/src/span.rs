//! The part of a ray that counts.

/// An open interval of distances along a ray, in world units: a hit counts when `start < t < end`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Nothing at this distance or nearer counts.
    pub start: f64,
    /// Nothing at this distance or farther counts; may be infinite.
    pub end: f64,
}

impl Span {
    /// Everything in front of the origin.
    pub const FORWARD: Self = Self { start: 0.0, end: f64::INFINITY };

    /// Whether a hit at distance `t` counts; never for NaN.
    #[must_use]
    #[inline]
    pub fn contains(&self, t: f64) -> bool {
        self.start < t && t < self.end
    }
}
