//! One lane: plain numbers. The reference for every other backend.

use crate::{ByLanes, F32x8, LaneMask, Lanes, M32x8, Part, Portable, Simd};

/// The backend with one lane of `f64`; it culls in the lanes of [`Portable`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Scalar;

impl LaneMask for bool {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }
}

macro_rules! scalar_lanes {
    ($scalar:ident) => {
        impl Lanes for $scalar {
            type Scalar = $scalar;
            type Mask = bool;
            const LANES: usize = 1;

            #[inline(always)]
            fn lane(self, i: usize) -> $scalar {
                assert!(i == 0, "a scalar has one lane");
                self
            }
            #[inline(always)]
            fn store(self, out: &mut [$scalar]) {
                out[0] = self;
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                <$scalar>::sqrt(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                <$scalar>::abs(self)
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                if self < other { self } else { other }
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if self > other { self } else { other }
            }
            #[inline(always)]
            fn lt(self, other: Self) -> bool {
                self < other
            }
            #[inline(always)]
            fn le(self, other: Self) -> bool {
                self <= other
            }
            #[inline(always)]
            fn eq(self, other: Self) -> bool {
                self == other
            }
            #[inline(always)]
            fn select(self, mask: bool, other: Self) -> Self {
                if mask { self } else { other }
            }
            #[inline(always)]
            fn compress(self, _: bool, out: &mut [$scalar]) {
                out[0] = self;
            }
        }
    };
}

scalar_lanes!(f64);

impl Simd for Scalar {
    type F64 = f64;
    type F32 = F32x8;

    #[inline(never)]
    fn outline<P: Part<Self>>(self, part: P) -> P::Output {
        part.run(self)
    }
    #[inline(always)]
    fn by_lanes<P: ByLanes<Self>>(self, work: P) -> P::Output {
        work.eight(self)
    }
    #[inline(always)]
    fn splat_f64(self, value: f64) -> f64 {
        value
    }
    #[inline(always)]
    fn load_f64(self, values: &[f64]) -> f64 {
        values[0]
    }
    #[inline(always)]
    fn expand_f64(self, mask: bool, values: &[f64]) -> f64 {
        let value = values[0];
        if mask { value } else { 0.0 }
    }
    #[inline(always)]
    fn collect_f64(self, of_lane: impl Fn(usize) -> f64) -> f64 {
        of_lane(0)
    }
    #[inline(always)]
    fn mask_f64(self, bits: u32) -> bool {
        bits & 1 == 1
    }
    #[inline(always)]
    fn splat_f32(self, value: f32) -> F32x8 {
        Portable.splat_f32(value)
    }
    #[inline(always)]
    fn load_f32(self, values: &[f32]) -> F32x8 {
        Portable.load_f32(values)
    }
    #[inline(always)]
    fn mask_f32(self, bits: u32) -> M32x8 {
        Portable.mask_f32(bits)
    }
    #[inline(always)]
    fn narrow_f32(self, values: &[f64], offset: f64, scale: f64) -> F32x8 {
        Portable.narrow_f32(values, offset, scale)
    }
    #[inline(always)]
    fn narrowing_f32(self, values: &[f64], offset: f64, scale: f64) -> F32x8 {
        Portable.narrowing_f32(values, offset, scale)
    }
    #[inline(always)]
    fn join_f32(self, parts: &[f64]) -> F32x8 {
        assert!(parts.len() == 8, "there are {} parts, not 8", parts.len());
        Portable.narrow_f32(parts, 0.0, 1.0)
    }
    #[inline(always)]
    fn greatest_of_eight(self, of: &[[F32x8; 4]; 2]) -> [f32; 8] {
        Portable.greatest_of_eight(of)
    }
    #[inline(always)]
    fn equal_u32(self, values: &[u32], wanted: u32) -> M32x8 {
        Portable.equal_u32(values, wanted)
    }
    #[inline(always)]
    fn any_bits_u32(self, values: &[u32], bits: u32) -> M32x8 {
        Portable.any_bits_u32(values, bits)
    }
    #[inline(always)]
    fn compress_u32(self, mask: M32x8, values: &[u32], out: &mut [u32]) {
        Portable.compress_u32(mask, values, out);
    }
    #[inline(always)]
    fn compress_u32_either_way(self, mask: M32x8, values: &[u32], is_turned: bool, out: &mut [u32]) {
        Portable.compress_u32_either_way(mask, values, is_turned, out);
    }
}
