//! What a backend offers: lanes, masks over lanes, and the token that makes them.

use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use crate::{ByLanes, Part};

/// An upper bound on [`Lanes::LANES`] of any backend, for both widths.
///
/// Columns that are read in lanes are padded by this many values, so that the last load stays inside.
pub const MAX_LANES: usize = 16;

/// One truth value a lane.
pub trait LaneMask:
    Copy + Debug + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> + Send + Sync + 'static
{
    /// The lanes as bits: lane `i` is bit `i`; the bits above are zero.
    #[must_use]
    fn bits(self) -> u32;

    /// Whether any lane is set.
    #[must_use]
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
}

/// Several numbers that go through the same operation at the same time.
///
/// Every operation rounds each lane as the scalar operation of IEEE 754 does; none is fused.
pub trait Lanes:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Send
    + Sync
    + 'static
{
    /// The number in a lane: `f32` or `f64`.
    type Scalar: Copy;
    /// The result of a comparison.
    type Mask: LaneMask;
    /// How many lanes there are.
    const LANES: usize;

    /// The number in lane `i`.
    ///
    /// # Panics
    ///
    /// If `i` is not below [`Lanes::LANES`].
    #[must_use]
    fn lane(self, i: usize) -> Self::Scalar;
    /// Writes all lanes to the front of `out`.
    ///
    /// # Panics
    ///
    /// If `out` is shorter than [`Lanes::LANES`].
    fn store(self, out: &mut [Self::Scalar]);
    /// The square root, correctly rounded.
    #[must_use]
    fn sqrt(self) -> Self;
    /// The absolute value; clears the sign bit, of NaN and -0.0 too.
    #[must_use]
    fn abs(self) -> Self;
    /// `a < b ? a : b` a lane: `other` where either is NaN, and where they compare equal.
    #[must_use]
    fn min(self, other: Self) -> Self;
    /// `a > b ? a : b` a lane: `other` where either is NaN, and where they compare equal.
    #[must_use]
    fn max(self, other: Self) -> Self;
    /// `self < other`, false where either is NaN.
    #[must_use]
    fn lt(self, other: Self) -> Self::Mask;
    /// `self <= other`, false where either is NaN.
    #[must_use]
    fn le(self, other: Self) -> Self::Mask;
    /// `self > other`, false where either is NaN.
    #[must_use]
    #[inline(always)]
    fn gt(self, other: Self) -> Self::Mask {
        other.lt(self)
    }
    /// `self >= other`, false where either is NaN.
    #[must_use]
    #[inline(always)]
    fn ge(self, other: Self) -> Self::Mask {
        other.le(self)
    }
    /// `self == other`, false where either is NaN; -0.0 equals 0.0.
    #[must_use]
    fn eq(self, other: Self) -> Self::Mask;
    /// `self` where `mask` is set, `other` elsewhere; bits are copied.
    #[must_use]
    fn select(self, mask: Self::Mask, other: Self) -> Self;
    /// Moves the lanes that are set to the front of `out`, in their order; what stands in `out` after them is not
    /// specified.
    ///
    /// # Panics
    ///
    /// If `out` is shorter than [`Lanes::LANES`].
    fn compress(self, mask: Self::Mask, out: &mut [Self::Scalar]);
}

/// Lanes of single precision, which cull and never decide.
///
/// They need no bits in common between backends, only bounds: so they may fuse, and every backend has at least eight,
/// the scalar one too.
pub trait CullLanes: Lanes<Scalar = f32> {
    /// `self * factor + term`, rounded once or twice.
    #[must_use]
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// `self * factor - term`, rounded once or twice.
    #[must_use]
    fn mul_sub(self, factor: Self, term: Self) -> Self;
    /// The greater of the sizes of two numbers; what where one is NaN is not specified.
    #[must_use]
    fn max_abs(self, other: Self) -> Self;
    /// The least lane; which of several zeros, or what where one is NaN, is not specified.
    #[must_use]
    fn least(self) -> f32;
    /// The greatest lane; which of several zeros, or what where one is NaN, is not specified.
    #[must_use]
    fn greatest(self) -> f32;
    /// Replaces the lanes of `place` that are set.
    ///
    /// As `*place = self.select(mask, *place)`, which compilers make a masked store: some processors take much longer for
    /// that than for a whole one, and to read it back.
    #[inline(always)]
    fn put(self, mask: Self::Mask, place: &mut Self) {
        *place = self.select(mask, *place);
    }
}

/// A backend's token: the only way to make lanes, so lanes exist only where the machine has them.
pub trait Simd: Copy + Debug + Send + Sync + 'static {
    /// Runs a part of a kernel in a function of its own, compiled for this backend.
    fn outline<P: Part<Self>>(self, part: P) -> P::Output;

    /// Asks for an item to be brought near at hand, where the machine can; nothing depends on it but time.
    #[inline(always)]
    fn fetch<T>(self, item: &T) {
        let _ = item;
    }

    /// Does work in the way that fits the number of lanes of [`Simd::F32`].
    fn by_lanes<P: ByLanes<Self>>(self, work: P) -> P::Output;

    /// Lanes of double precision: what decides.
    type F64: Lanes<Scalar = f64>;
    /// Lanes of single precision: what may cull.
    type F32: CullLanes;

    /// `value` in every lane.
    #[must_use]
    fn splat_f64(self, value: f64) -> Self::F64;
    /// The first [`Lanes::LANES`] values.
    ///
    /// # Panics
    ///
    /// If there are fewer.
    #[must_use]
    fn load_f64(self, values: &[f64]) -> Self::F64;
    /// Moves the first values into the lanes that are set, in their order: where [`Lanes::compress`] took them from. The
    /// other lanes are zero.
    ///
    /// # Panics
    ///
    /// If there are fewer values than [`Lanes::LANES`].
    #[must_use]
    fn expand_f64(self, mask: <Self::F64 as Lanes>::Mask, values: &[f64]) -> Self::F64;
    /// What is given for each lane, from wherever it stands.
    ///
    /// Put together in a register: lanes that are written one by one, and read again all at once, wait for the memory.
    #[must_use]
    fn collect_f64(self, of_lane: impl Fn(usize) -> f64) -> Self::F64;
    /// The mask whose lane `i` is bit `i`; higher bits are ignored.
    #[must_use]
    fn mask_f64(self, bits: u32) -> <Self::F64 as Lanes>::Mask;
    /// `value` in every lane.
    #[must_use]
    fn splat_f32(self, value: f32) -> Self::F32;
    /// The first [`Lanes::LANES`] values.
    ///
    /// # Panics
    ///
    /// If there are fewer.
    #[must_use]
    fn load_f32(self, values: &[f32]) -> Self::F32;
    /// The mask whose lane `i` is bit `i`; higher bits are ignored.
    #[must_use]
    fn mask_f32(self, bits: u32) -> <Self::F32 as Lanes>::Mask;
    /// `(value - offset) * scale` of the first [`Lanes::LANES`] of `F32` values, in double precision, each then rounded to
    /// single.
    ///
    /// # Panics
    ///
    /// If there are fewer.
    #[must_use]
    fn narrow_f32(self, values: &[f64], offset: f64, scale: f64) -> Self::F32;
    /// What each value loses by [`Simd::narrow_f32`], itself rounded to single precision: what it was, less what it is.
    ///
    /// # Panics
    ///
    /// If there are fewer.
    #[must_use]
    fn narrowing_f32(self, values: &[f64], offset: f64, scale: f64) -> Self::F32;
    /// The values of several registers, one after the other, each rounded to single precision.
    ///
    /// # Panics
    ///
    /// If they have not as many lanes together as `F32`.
    #[must_use]
    fn join_f32(self, parts: &[Self::F64]) -> Self::F32;
    /// The greatest lane of each of eight; which of several zeros, or what where one is NaN, is not specified.
    #[must_use]
    fn greatest_of_eight(self, of: &[[Self::F32; 4]; 2]) -> [f32; 8];
    /// The lanes of `F32` whose value is `wanted`.
    ///
    /// # Panics
    ///
    /// If there are fewer values than [`Lanes::LANES`] of `F32`.
    #[must_use]
    fn equal_u32(self, values: &[u32], wanted: u32) -> <Self::F32 as Lanes>::Mask;
    /// The lanes of `F32` whose value shares a bit with `bits`.
    ///
    /// # Panics
    ///
    /// If there are fewer values than [`Lanes::LANES`] of `F32`.
    #[must_use]
    fn any_bits_u32(self, values: &[u32], bits: u32) -> <Self::F32 as Lanes>::Mask;
    /// Moves the values whose lane of `F32` is set to the front of `out`, in their order; what stands in `out` after
    /// them is not specified.
    ///
    /// # Panics
    ///
    /// If either is shorter than [`Lanes::LANES`] of `F32`.
    fn compress_u32(self, mask: <Self::F32 as Lanes>::Mask, values: &[u32], out: &mut [u32]);
    /// The same, or in the opposite order.
    ///
    /// # Panics
    ///
    /// As above.
    fn compress_u32_either_way(
        self,
        mask: <Self::F32 as Lanes>::Mask,
        values: &[u32],
        is_turned: bool,
        out: &mut [u32],
    );
}
