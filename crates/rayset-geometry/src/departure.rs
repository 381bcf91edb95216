//! The primitive that a ray leaves, and what it may hit there.

use rayset_simd::{Lanes, Scalar, Simd};

use crate::{PrimitiveKind, Side, Sides};

/// The primitive that a ray leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Departure {
    /// Its kind.
    pub kind: PrimitiveKind,
    /// Its index in the columns of that kind.
    pub index: u32,
    /// The side into which the ray leaves.
    pub side: Side,
}

impl Departure {
    /// That of a ray of which it is known where it meets the primitive again: as if it never did.
    #[must_use]
    #[inline(always)]
    pub fn met_again(self) -> Self {
        Self { side: Side::Front, ..self }
    }
}

/// The lanes whose front, or back, may be hit: by visibility, and by where the ray left.
#[derive(Clone, Copy)]
pub(crate) struct Allowed<S: Simd> {
    pub(crate) front: <S::F64 as Lanes>::Mask,
    pub(crate) back: <S::F64 as Lanes>::Mask,
}

impl<S: Simd> Allowed<S> {
    /// What may be hit in the lanes of primitives `i`, `i + 1`, ...
    #[inline(always)]
    pub(crate) fn of(simd: S, sides: Sides, departure: Option<Departure>, i: usize) -> Self {
        let (all, none) = (simd.mask_f64(u32::MAX), simd.mask_f64(0));
        let visible = |side: Side| if sides.include(side) { all } else { none };
        let (front, back) = (visible(Side::Front), visible(Side::Back));
        if let Some(departure) = departure
            && let Some(lane) = (departure.index as usize).checked_sub(i)
            && lane < S::F64::LANES
        {
            let left = simd.mask_f64(1 << lane);
            // A ray that leaves a plane or the outside of a convex surface never meets it again; one that leaves
            // into the inside of a convex surface meets its back, where it comes out, but its front no more.
            let inwards = departure.side == Side::Back && departure.kind != PrimitiveKind::Triangle;
            return Self { front: front & !left, back: if inwards { back } else { back & !left } };
        }
        Self { front, back }
    }
}

impl Allowed<Scalar> {
    /// What may be hit of one primitive; `departure` is the side into which the ray left it, if it did.
    #[inline(always)]
    pub(crate) fn of_one(kind: PrimitiveKind, sides: Sides, departure: Option<Side>) -> Self {
        Self::of(Scalar, sides, departure.map(|side| Departure { kind, index: 0, side }), 0)
    }
}
