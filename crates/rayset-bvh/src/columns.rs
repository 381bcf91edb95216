//! Lists of rays, as columns, and of their answers.

use std::ops::Range;

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Ray, Side, Span};
use rayset_simd::{LaneMask, Simd};

use crate::Hit;
use crate::hierarchy::ahead;

/// What a ray leaves: a primitive, into one of its sides, or nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(transparent)]
pub struct Left(u32);

impl Left {
    /// The ray starts anywhere.
    pub const NOTHING: Self = Self(u32::MAX);

    /// The bit that says that the ray leaves into the front.
    const FRONT: u32 = 1 << 31;

    /// A primitive, by its number, and the side of it into which the ray leaves.
    ///
    /// # Panics
    ///
    /// If the number is 2^30 or more, which no primitive of a hierarchy has.
    #[must_use]
    #[inline(always)]
    pub fn new(primitive: u32, side: Side) -> Self {
        assert!(primitive < 1 << 30, "there is no such primitive");
        Self::of(primitive, side)
    }

    /// As [`Left::new`], of what is there.
    #[inline(always)]
    pub(crate) fn of(primitive: u32, side: Side) -> Self {
        Self(primitive | if side == Side::Front { Self::FRONT } else { 0 })
    }

    /// The number of what is no primitive.
    pub(crate) const NOBODY: u32 = !Self::FRONT;

    /// The primitives that rays in lanes leave, and the lanes that leave them into their fronts.
    #[inline(always)]
    pub(crate) fn split<S: Simd, const W: usize>(simd: S, left: &[Self; W]) -> ([u32; W], u32) {
        let fronts = simd.equal_u32(&left.map(|left| left.0 & Self::FRONT), Self::FRONT).bits();
        (left.map(|left| left.0 & !Self::FRONT), fronts)
    }

    /// Whether no ray leaves a primitive into its back.
    #[inline(always)]
    pub(crate) fn all_outwards(left: &[Self]) -> bool {
        left.iter().fold(Self::FRONT, |all, left| all & left.0) != 0
    }

    /// The primitive, if the ray leaves it into its back.
    #[inline(always)]
    pub(crate) fn inwards(self) -> Option<u32> {
        (self.0 & Self::FRONT == 0).then_some(self.0)
    }

    /// The lanes of rays that leave a primitive, and those that do so into its front.
    #[inline(always)]
    pub(crate) fn lanes_that_leave<S: Simd, const W: usize>(
        simd: S,
        left: &[Self],
        primitive: u32,
    ) -> (u32, u32) {
        if left.is_empty() {
            return (0, 0);
        }
        let mut all = [Self::NOTHING; W];
        match left.get(..W) {
            Some(left) => all.copy_from_slice(left),
            None => all[..left.len()].copy_from_slice(left),
        }
        let all = all.map(|left| left.0);
        let lanes = |side| simd.equal_u32(&all, Self::of(primitive, side).0).bits();
        let (front, back) = (lanes(Side::Front), lanes(Side::Back));
        (front | back, front)
    }

    /// The primitive and the side.
    #[must_use]
    #[inline(always)]
    pub fn get(self) -> Option<(u32, Side)> {
        let side = if self.0 & Self::FRONT == 0 { Side::Back } else { Side::Front };
        (self != Self::NOTHING).then_some((self.0 & !Self::FRONT, side))
    }
}

impl From<Option<(u32, Side)>> for Left {
    /// What a ray leaves, if it leaves anything.
    ///
    /// # Panics
    ///
    /// As [`Left::new`] does.
    #[inline(always)]
    fn from(left: Option<(u32, Side)>) -> Self {
        left.map_or(Self::NOTHING, |(primitive, side)| Self::new(primitive, side))
    }
}

/// Rays as columns, of which packets take some.
#[derive(Clone, Copy, Debug)]
pub struct RayColumns<'a> {
    /// The x, y and z of the origins, in world space.
    pub origins: [&'a [f64]; 3],
    /// The x, y and z of the unit directions.
    pub directions: [&'a [f64]; 3],
    /// Where each span starts and ends, in world units.
    pub spans: (&'a [f64], &'a [f64]),
    /// What each ray leaves; empty if none leaves anything.
    pub left: &'a [Left],
}

impl<'a> RayColumns<'a> {
    /// How many rays there are.
    #[inline(always)]
    pub(crate) fn len(&self) -> usize {
        self.spans.0.len()
    }

    /// Some of the rays.
    #[inline(always)]
    pub(crate) fn cut(&self, range: Range<usize>) -> Self {
        let n = range.len();
        let ([ox, oy, oz], [dx, dy, dz]) = (self.origins, self.directions);
        Self {
            origins: [&ox[range.clone()][..n], &oy[range.clone()][..n], &oz[range.clone()][..n]],
            directions: [&dx[range.clone()][..n], &dy[range.clone()][..n], &dz[range.clone()][..n]],
            spans: (&self.spans.0[range.clone()][..n], &self.spans.1[range.clone()][..n]),
            left: self.left_by(range),
        }
    }

    #[inline(always)]
    pub(crate) fn origin(&self, i: usize) -> DVec3 {
        let [x, y, z] = self.origins;
        DVec3::new(x[i], y[i], z[i])
    }

    #[inline(always)]
    pub(crate) fn direction(&self, i: usize) -> DVec3 {
        let [x, y, z] = self.directions;
        DVec3::new(x[i], y[i], z[i])
    }

    #[inline(always)]
    pub(crate) fn ray(&self, i: usize) -> (Ray, Span) {
        let span = Span { start: self.spans.0[i], end: self.spans.1[i] };
        (Ray::new(self.origin(i), self.direction(i)), ahead(span))
    }

    #[inline(always)]
    pub(crate) fn left(&self, i: usize) -> Option<(u32, Side)> {
        self.left.get(i).copied().and_then(Left::get)
    }

    /// What some rays leave; empty if none leaves anything.
    #[inline(always)]
    pub(crate) fn left_by(&self, range: Range<usize>) -> &'a [Left] {
        if self.left.is_empty() { self.left } else { &self.left[range] }
    }
}

/// One of the rays of columns, read where it is asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayOf<'a> {
    pub(crate) columns: &'a RayColumns<'a>,
    pub(crate) i: usize,
}

impl RayOf<'_> {
    #[inline(always)]
    pub(crate) fn read(self) -> (Ray, Span) {
        self.columns.ray(self.i)
    }
}

/// The answer to a ray of a list: a hit, or none, in 16 bytes and without a tag to branch on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HitOrNone {
    /// The distance along the ray, in world units; infinite where there is no hit.
    pub t: f64,
    /// The number of the primitive; `u32::MAX` where there is no hit.
    pub primitive: u32,
}

impl HitOrNone {
    /// No hit.
    pub const NONE: Self = Self { t: f64::INFINITY, primitive: u32::MAX };

    /// The hit, if there is one.
    #[must_use]
    #[inline(always)]
    pub fn get(self) -> Option<Hit> {
        let Self { t, primitive } = self;
        (primitive != u32::MAX).then_some(Hit { t, primitive })
    }
}

impl From<Hit> for HitOrNone {
    #[inline(always)]
    fn from(Hit { t, primitive }: Hit) -> Self {
        Self { t, primitive }
    }
}

impl From<Option<Hit>> for HitOrNone {
    #[inline(always)]
    fn from(hit: Option<Hit>) -> Self {
        hit.map_or(Self::NONE, Self::from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_ray_leaves_is_read_as_it_was_written() {
        for primitive in [0, 1, 77, (1 << 30) - 1] {
            for side in [Side::Front, Side::Back] {
                assert_eq!(Left::new(primitive, side).get(), Some((primitive, side)));
                assert_eq!(Left::from(Some((primitive, side))), Left::new(primitive, side));
            }
        }
        assert_eq!(Left::from(None), Left::NOTHING);
        assert_eq!(Left::NOTHING.get(), None);
        assert_eq!(size_of::<Left>(), 4);
    }

    #[test]
    #[should_panic(expected = "no such primitive")]
    fn a_ray_leaves_no_primitive_that_cannot_be() {
        let _ = Left::new(1 << 30, Side::Back);
    }

    #[test]
    fn an_answer_is_read_as_it_was_written() {
        let hit = Hit { t: 2.5, primitive: 0 };
        assert_eq!(HitOrNone::from(hit).get(), Some(hit));
        assert_eq!(HitOrNone::from(Some(hit)).get(), Some(hit));
        assert_eq!(HitOrNone::from(None).get(), None);
        assert_eq!(HitOrNone::NONE.get(), None);
        assert_eq!(size_of::<HitOrNone>(), 16);
    }
}
