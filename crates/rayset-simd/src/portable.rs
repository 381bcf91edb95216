//! Arrays of lanes in safe Rust, which the compiler turns into whatever vectors the target has.

use std::array::from_fn;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use crate::{ByLanes, CullLanes, LaneMask, Lanes, Part, Simd};

/// The backend of plain arrays: four `f64` or eight `f32`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Portable;

macro_rules! array_lanes {
    ($lanes:ident, $mask:ident, $scalar:ident, $bits:ident, $n:literal, $align:literal) => {
        #[doc = concat!("An array of ", stringify!($n), " `", stringify!($scalar), "` lanes.")]
        #[derive(Clone, Copy, Debug)]
        #[repr(C, align($align))]
        pub struct $lanes([$scalar; $n]);

        #[doc = concat!("A mask over [`", stringify!($lanes), "`]: all bits of a set lane are ones.")]
        #[derive(Clone, Copy, Debug)]
        #[repr(C, align($align))]
        pub struct $mask([$bits; $n]);

        impl $mask {
            #[inline(always)]
            fn of(lane: impl Fn(usize) -> bool) -> Self {
                Self(from_fn(|i| if lane(i) { $bits::MAX } else { 0 }))
            }

            /// Moves the values of set lanes to the front of `out`.
            #[inline(always)]
            fn compress<T: Copy>(self, values: [T; $n], out: &mut [T]) {
                let out = &mut out[..$n];
                let mut front = 0;
                for (value, lane) in values.into_iter().zip(self.0) {
                    // Written always and kept only if set: no branch to guess.
                    out[front] = value;
                    front += usize::from(lane != 0);
                    front &= $n - 1;
                }
            }
        }

        impl LaneMask for $mask {
            #[inline(always)]
            fn bits(self) -> u32 {
                let mut bits = 0;
                for i in 0..$n {
                    bits |= u32::from(self.0[i] != 0) << i;
                }
                bits
            }
            #[inline(always)]
            fn any(self) -> bool {
                self.0.iter().fold(0, |all, lane| all | lane) != 0
            }
        }

        impl BitAnd for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitand(self, other: Self) -> Self {
                Self(from_fn(|i| self.0[i] & other.0[i]))
            }
        }

        impl BitOr for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitor(self, other: Self) -> Self {
                Self(from_fn(|i| self.0[i] | other.0[i]))
            }
        }

        impl Not for $mask {
            type Output = Self;
            #[inline(always)]
            fn not(self) -> Self {
                Self(self.0.map(|lane| !lane))
            }
        }

        array_lanes!(@operator $lanes, Add, add, +);
        array_lanes!(@operator $lanes, Sub, sub, -);
        array_lanes!(@operator $lanes, Mul, mul, *);
        array_lanes!(@operator $lanes, Div, div, /);

        impl Neg for $lanes {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self(self.0.map(|lane| -lane))
            }
        }

        impl Lanes for $lanes {
            type Scalar = $scalar;
            type Mask = $mask;
            const LANES: usize = $n;

            #[inline(always)]
            fn lane(self, i: usize) -> $scalar {
                self.0[i]
            }
            #[inline(always)]
            fn store(self, out: &mut [$scalar]) {
                out[..$n].copy_from_slice(&self.0);
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(self.0.map($scalar::sqrt))
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self(self.0.map($scalar::abs))
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                Self(from_fn(|i| if self.0[i] < other.0[i] { self.0[i] } else { other.0[i] }))
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                Self(from_fn(|i| if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] }))
            }
            #[inline(always)]
            fn lt(self, other: Self) -> $mask {
                $mask::of(|i| self.0[i] < other.0[i])
            }
            #[inline(always)]
            fn le(self, other: Self) -> $mask {
                $mask::of(|i| self.0[i] <= other.0[i])
            }
            #[inline(always)]
            fn eq(self, other: Self) -> $mask {
                $mask::of(|i| self.0[i] == other.0[i])
            }
            #[inline(always)]
            fn select(self, mask: $mask, other: Self) -> Self {
                Self(from_fn(|i| {
                    let (a, b) = (self.0[i].to_bits(), other.0[i].to_bits());
                    $scalar::from_bits((a & mask.0[i]) | (b & !mask.0[i]))
                }))
            }
            #[inline(always)]
            fn compress(self, mask: $mask, out: &mut [$scalar]) {
                mask.compress(self.0, out);
            }
        }
    };
    (@operator $lanes:ident, $trait:ident, $method:ident, $operator:tt) => {
        impl $trait for $lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(from_fn(|i| self.0[i] $operator other.0[i]))
            }
        }
    };
}

array_lanes!(F64x4, M64x4, f64, u64, 4, 32);
array_lanes!(F32x8, M32x8, f32, u32, 8, 32);

impl CullLanes for F32x8 {
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        self * factor + term
    }
    #[inline(always)]
    fn mul_sub(self, factor: Self, term: Self) -> Self {
        self * factor - term
    }
    #[inline(always)]
    fn max_abs(self, other: Self) -> Self {
        self.abs().max(other.abs())
    }
    #[inline(always)]
    fn least(self) -> f32 {
        self.0.into_iter().fold(f32::INFINITY, f32::min)
    }
    #[inline(always)]
    fn greatest(self) -> f32 {
        self.0.into_iter().fold(f32::NEG_INFINITY, f32::max)
    }
}

impl Simd for Portable {
    type F64 = F64x4;
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
    fn splat_f64(self, value: f64) -> F64x4 {
        F64x4([value; 4])
    }
    #[inline(always)]
    fn load_f64(self, values: &[f64]) -> F64x4 {
        let values = &values[..4];
        F64x4(from_fn(|i| values[i]))
    }
    #[inline(always)]
    fn expand_f64(self, mask: M64x4, values: &[f64]) -> F64x4 {
        let values = &values[..4];
        let mut next = 0;
        F64x4(from_fn(|i| {
            let is_set = mask.0[i] != 0;
            let value = values[next & 3];
            next += usize::from(is_set);
            if is_set { value } else { 0.0 }
        }))
    }
    #[inline(always)]
    fn collect_f64(self, of_lane: impl Fn(usize) -> f64) -> F64x4 {
        F64x4(from_fn(of_lane))
    }
    #[inline(always)]
    fn mask_f64(self, bits: u32) -> M64x4 {
        M64x4::of(|i| bits >> i & 1 == 1)
    }
    #[inline(always)]
    fn splat_f32(self, value: f32) -> F32x8 {
        F32x8([value; 8])
    }
    #[inline(always)]
    fn load_f32(self, values: &[f32]) -> F32x8 {
        let values = &values[..8];
        F32x8(from_fn(|i| values[i]))
    }
    #[inline(always)]
    fn mask_f32(self, bits: u32) -> M32x8 {
        M32x8::of(|i| bits >> i & 1 == 1)
    }
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "rounded to single precision")]
    fn narrow_f32(self, values: &[f64], offset: f64, scale: f64) -> F32x8 {
        let values = &values[..8];
        F32x8(from_fn(|i| ((values[i] - offset) * scale) as f32))
    }
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "rounded to single precision")]
    fn narrowing_f32(self, values: &[f64], offset: f64, scale: f64) -> F32x8 {
        let values = &values[..8];
        F32x8(from_fn(|i| {
            let value = (values[i] - offset) * scale;
            (value - f64::from(value as f32)) as f32
        }))
    }
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "rounded to single precision")]
    fn join_f32(self, parts: &[F64x4]) -> F32x8 {
        let [low, high] = parts else { panic!("there are {} parts, not 2", parts.len()) };
        F32x8(from_fn(|i| if i < 4 { low.0[i] } else { high.0[i - 4] } as f32))
    }
    #[inline(always)]
    fn greatest_of_eight(self, of: &[[F32x8; 4]; 2]) -> [f32; 8] {
        from_fn(|i| of[i / 4][i % 4].greatest())
    }
    #[inline(always)]
    fn equal_u32(self, values: &[u32], wanted: u32) -> M32x8 {
        let values = &values[..8];
        M32x8::of(|i| values[i] == wanted)
    }
    #[inline(always)]
    fn any_bits_u32(self, values: &[u32], bits: u32) -> M32x8 {
        let values = &values[..8];
        M32x8::of(|i| values[i] & bits != 0)
    }
    #[inline(always)]
    fn compress_u32(self, mask: M32x8, values: &[u32], out: &mut [u32]) {
        let values = &values[..8];
        mask.compress(from_fn(|i| values[i]), out);
    }
    #[inline(always)]
    fn compress_u32_either_way(self, mask: M32x8, values: &[u32], is_turned: bool, out: &mut [u32]) {
        self.compress_u32(mask, values, out);
        if is_turned {
            out[..mask.bits().count_ones() as usize].reverse();
        }
    }
}
