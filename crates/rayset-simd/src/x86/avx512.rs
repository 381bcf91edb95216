//! Registers of 512 bits: eight `f64` or sixteen `f32`, with masks in registers of their own.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use crate::{ByLanes, CullLanes, LaneMask, Lanes, Part, Simd};

/// The backend of AVX-512 (F, BW, DQ and VL).
///
/// Exists only where the machine has these instructions: [`Backend::run`](crate::Backend::run) makes it.
#[derive(Clone, Copy, Debug)]
pub struct Avx512(pub(crate) ());

macro_rules! bit_mask {
    ($mask:ident, $bits:ident, $lanes:ident) => {
        #[doc = concat!("A mask over [`", stringify!($lanes), "`]: one bit a lane.")]
        #[derive(Clone, Copy, Debug)]
        #[repr(transparent)]
        pub struct $mask(pub(super) $bits);

        impl LaneMask for $mask {
            #[inline(always)]
            fn bits(self) -> u32 {
                u32::from(self.0)
            }
        }

        impl BitAnd for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitand(self, other: Self) -> Self {
                Self(self.0 & other.0)
            }
        }

        impl BitOr for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitor(self, other: Self) -> Self {
                Self(self.0 | other.0)
            }
        }

        impl Not for $mask {
            type Output = Self;
            #[inline(always)]
            fn not(self) -> Self {
                Self(!self.0)
            }
        }
    };
}

bit_mask!(Avx512M64, u8, Avx512F64);
bit_mask!(Avx512M32, u16, Avx512F32);

register_lanes! {
    /// A register of eight `f64` lanes.
    Avx512F64(__m512d), Avx512M64, f64 x 8,
    add: _mm512_add_pd, sub: _mm512_sub_pd, mul: _mm512_mul_pd, div: _mm512_div_pd, sqrt: _mm512_sqrt_pd,
    min: _mm512_min_pd, max: _mm512_max_pd, store: _mm512_storeu_pd,
    neg: |a| _mm512_xor_pd(a, _mm512_set1_pd(-0.0)),
    abs: |a| _mm512_andnot_pd(_mm512_set1_pd(-0.0), a),
    lt: |a, b| _mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b),
    le: |a, b| _mm512_cmp_pd_mask::<_CMP_LE_OQ>(a, b),
    eq: |a, b| _mm512_cmp_pd_mask::<_CMP_EQ_OQ>(a, b),
    select: |mask, a, b| _mm512_mask_blend_pd(mask, b, a),
    compress: |mask, a| _mm512_maskz_compress_pd(mask, a),
}

register_lanes! {
    /// A register of sixteen `f32` lanes.
    Avx512F32(__m512), Avx512M32, f32 x 16,
    add: _mm512_add_ps, sub: _mm512_sub_ps, mul: _mm512_mul_ps, div: _mm512_div_ps, sqrt: _mm512_sqrt_ps,
    min: _mm512_min_ps, max: _mm512_max_ps, store: _mm512_storeu_ps,
    neg: |a| _mm512_xor_ps(a, _mm512_set1_ps(-0.0)),
    abs: |a| _mm512_andnot_ps(_mm512_set1_ps(-0.0), a),
    lt: |a, b| _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b),
    le: |a, b| _mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b),
    eq: |a, b| _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(a, b),
    select: |mask, a, b| _mm512_mask_blend_ps(mask, b, a),
    compress: |mask, a| _mm512_maskz_compress_ps(mask, a),
}

/// In each quarter, the greatest of that quarter of four registers.
#[inline(always)]
fn fours([a, b, c, d]: &[Avx512F32; 4]) -> __m512 {
    // SAFETY: see `register_lanes`.
    unsafe {
        let ab = _mm512_max_ps(_mm512_unpacklo_ps(a.0, b.0), _mm512_unpackhi_ps(a.0, b.0));
        let cd = _mm512_max_ps(_mm512_unpacklo_ps(c.0, d.0), _mm512_unpackhi_ps(c.0, d.0));
        let (ab, cd) = (_mm512_castps_pd(ab), _mm512_castps_pd(cd));
        let (low, high) = (_mm512_unpacklo_pd(ab, cd), _mm512_unpackhi_pd(ab, cd));
        _mm512_max_ps(_mm512_castpd_ps(low), _mm512_castpd_ps(high))
    }
}

impl CullLanes for Avx512F32 {
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        // SAFETY: see `register_lanes`.
        Self(unsafe { _mm512_fmadd_ps(self.0, factor.0, term.0) })
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, term: Self) -> Self {
        // SAFETY: see `register_lanes`.
        Self(unsafe { _mm512_fmsub_ps(self.0, factor.0, term.0) })
    }

    #[inline(always)]
    fn max_abs(self, other: Self) -> Self {
        /// The greater size, its sign cleared.
        const GREATER_SIZE: i32 = 0b1011;
        // SAFETY: see `register_lanes`.
        Self(unsafe { _mm512_range_ps::<GREATER_SIZE>(self.0, other.0) })
    }

    #[inline(always)]
    fn least(self) -> f32 {
        // SAFETY: see `register_lanes`.
        unsafe { _mm512_reduce_min_ps(self.0) }
    }

    #[inline(always)]
    fn greatest(self) -> f32 {
        // SAFETY: see `register_lanes`.
        unsafe { _mm512_reduce_max_ps(self.0) }
    }

    #[inline(always)]
    fn put(self, mask: Self::Mask, place: &mut Self) {
        let whole = self.select(mask, *place);
        // SAFETY: a reference may be written to. Volatile, so that it stays a whole store.
        unsafe { std::ptr::write_volatile(place, whole) }
    }
}

impl Simd for Avx512 {
    type F64 = Avx512F64;
    type F32 = Avx512F32;

    #[inline(always)]
    fn outline<P: Part<Self>>(self, part: P) -> P::Output {
        // SAFETY: the token exists only where the machine has the instructions.
        unsafe { run_part(part) }
    }
    #[inline(always)]
    fn fetch<T>(self, item: &T) {
        super::fetch(item);
    }

    #[inline(always)]
    fn by_lanes<P: ByLanes<Self>>(self, work: P) -> P::Output {
        work.sixteen(self)
    }

    #[inline(always)]
    fn splat_f64(self, value: f64) -> Avx512F64 {
        // SAFETY: see `register_lanes`; the same for the others.
        Avx512F64(unsafe { _mm512_set1_pd(value) })
    }

    #[inline(always)]
    fn expand_f64(self, mask: Avx512M64, values: &[f64]) -> Avx512F64 {
        let values = &values[..8];
        // SAFETY: the slice holds a register.
        Avx512F64(unsafe { _mm512_maskz_expand_pd(mask.0, _mm512_loadu_pd(values.as_ptr())) })
    }

    #[inline(always)]
    fn collect_f64(self, of_lane: impl Fn(usize) -> f64) -> Avx512F64 {
        let [a, b, c, d, e, f, g, h] = std::array::from_fn(of_lane);
        // SAFETY: see `register_lanes`.
        Avx512F64(unsafe { _mm512_set_pd(h, g, f, e, d, c, b, a) })
    }

    #[inline(always)]
    fn load_f64(self, values: &[f64]) -> Avx512F64 {
        let values = &values[..8];
        // SAFETY: the slice holds a register.
        Avx512F64(unsafe { _mm512_loadu_pd(values.as_ptr()) })
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "higher bits are ignored")]
    fn mask_f64(self, bits: u32) -> Avx512M64 {
        Avx512M64(bits as u8)
    }

    #[inline(always)]
    fn splat_f32(self, value: f32) -> Avx512F32 {
        // SAFETY: see `register_lanes`.
        Avx512F32(unsafe { _mm512_set1_ps(value) })
    }

    #[inline(always)]
    fn load_f32(self, values: &[f32]) -> Avx512F32 {
        let values = &values[..16];
        // SAFETY: the slice holds a register.
        Avx512F32(unsafe { _mm512_loadu_ps(values.as_ptr()) })
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "higher bits are ignored")]
    fn mask_f32(self, bits: u32) -> Avx512M32 {
        Avx512M32(bits as u16)
    }

    #[inline(always)]
    fn narrow_f32(self, values: &[f64], offset: f64, scale: f64) -> Avx512F32 {
        let values = &values[..16];
        // SAFETY: the slice holds two registers.
        Avx512F32(unsafe {
            let (offset, scale) = (_mm512_set1_pd(offset), _mm512_set1_pd(scale));
            let low = _mm512_mul_pd(_mm512_sub_pd(_mm512_loadu_pd(values.as_ptr()), offset), scale);
            let high = _mm512_mul_pd(_mm512_sub_pd(_mm512_loadu_pd(values.as_ptr().add(8)), offset), scale);
            let low = _mm512_castps256_ps512(_mm512_cvtpd_ps(low));
            _mm512_insertf32x8::<1>(low, _mm512_cvtpd_ps(high))
        })
    }

    #[inline(always)]
    fn narrowing_f32(self, values: &[f64], offset: f64, scale: f64) -> Avx512F32 {
        let values = &values[..16];
        // SAFETY: the slice holds two registers.
        Avx512F32(unsafe {
            let (offset, scale) = (_mm512_set1_pd(offset), _mm512_set1_pd(scale));
            let low = _mm512_mul_pd(_mm512_sub_pd(_mm512_loadu_pd(values.as_ptr()), offset), scale);
            let high = _mm512_mul_pd(_mm512_sub_pd(_mm512_loadu_pd(values.as_ptr().add(8)), offset), scale);
            let low = _mm512_sub_pd(low, _mm512_cvtps_pd(_mm512_cvtpd_ps(low)));
            let high = _mm512_sub_pd(high, _mm512_cvtps_pd(_mm512_cvtpd_ps(high)));
            let low = _mm512_castps256_ps512(_mm512_cvtpd_ps(low));
            _mm512_insertf32x8::<1>(low, _mm512_cvtpd_ps(high))
        })
    }

    #[inline(always)]
    fn join_f32(self, parts: &[Avx512F64]) -> Avx512F32 {
        let [low, high] = parts else { panic!("there are {} parts, not 2", parts.len()) };
        // SAFETY: see `register_lanes`.
        Avx512F32(unsafe {
            let low = _mm512_castps256_ps512(_mm512_cvtpd_ps(low.0));
            _mm512_insertf32x8::<1>(low, _mm512_cvtpd_ps(high.0))
        })
    }

    #[inline(always)]
    fn greatest_of_eight(self, of: &[[Avx512F32; 4]; 2]) -> [f32; 8] {
        let mut greatest = [0.0; 8];
        // SAFETY: see `register_lanes`; the array holds half a register. Of four, the greatest of each quarter in its four
        // parts; then of all quarters, which leaves those of the first four and of the second in the lower half.
        unsafe {
            let [low, high] = [fours(&of[0]), fours(&of[1])];
            let first = _mm512_shuffle_f32x4::<0b10_00_10_00>(low, high);
            let second = _mm512_shuffle_f32x4::<0b11_01_11_01>(low, high);
            let pairs = _mm512_max_ps(first, second);
            let first = _mm512_shuffle_f32x4::<0b10_00_10_00>(pairs, pairs);
            let second = _mm512_shuffle_f32x4::<0b11_01_11_01>(pairs, pairs);
            let all = _mm512_castps512_ps256(_mm512_max_ps(first, second));
            _mm256_storeu_ps(greatest.as_mut_ptr(), all);
        }
        greatest
    }

    #[inline(always)]
    fn equal_u32(self, values: &[u32], wanted: u32) -> Avx512M32 {
        let values = &values[..16];
        // SAFETY: the slice holds a register.
        Avx512M32(unsafe {
            let values = _mm512_loadu_si512(values.as_ptr().cast());
            _mm512_cmpeq_epi32_mask(values, _mm512_set1_epi32(wanted.cast_signed()))
        })
    }

    #[inline(always)]
    fn any_bits_u32(self, values: &[u32], bits: u32) -> Avx512M32 {
        let values = &values[..16];
        // SAFETY: the slice holds a register.
        Avx512M32(unsafe {
            let values = _mm512_loadu_si512(values.as_ptr().cast());
            _mm512_test_epi32_mask(values, _mm512_set1_epi32(bits.cast_signed()))
        })
    }

    #[inline(always)]
    fn compress_u32(self, mask: Avx512M32, values: &[u32], out: &mut [u32]) {
        let (values, out) = (&values[..16], &mut out[..16]);
        // SAFETY: both slices hold a register.
        unsafe {
            let values = _mm512_loadu_si512(values.as_ptr().cast());
            _mm512_storeu_si512(out.as_mut_ptr().cast(), _mm512_maskz_compress_epi32(mask.0, values));
        }
    }

    #[inline(always)]
    fn compress_u32_either_way(self, mask: Avx512M32, values: &[u32], is_turned: bool, out: &mut [u32]) {
        let (values, out) = (&values[..16], &mut out[..16]);
        let count = mask.bits().count_ones().cast_signed();
        let turn = -i32::from(is_turned);
        // SAFETY: both slices hold a register. Turned, what goes to a lane stood as far before the end as it is behind the
        // start: `!i + count`.
        unsafe {
            let values = _mm512_loadu_si512(values.as_ptr().cast());
            let values = _mm512_maskz_compress_epi32(mask.0, values);
            let lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
            let lanes = _mm512_xor_si512(lanes, _mm512_set1_epi32(turn));
            let lanes = _mm512_add_epi32(lanes, _mm512_set1_epi32(turn & count));
            _mm512_storeu_si512(out.as_mut_ptr().cast(), _mm512_permutexvar_epi32(lanes, values));
        }
    }
}

/// Runs a kernel compiled for this backend.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(crate) fn run<K: crate::Kernel>(kernel: K) -> K::Output {
    kernel.run(Avx512(()))
}

/// Runs a part of a kernel in a function of its own, compiled for this backend.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline(never)]
fn run_part<P: Part<Avx512>>(part: P) -> P::Output {
    part.run(Avx512(()))
}

/// Whether the machine has the instructions.
#[inline]
pub(crate) fn is_available() -> bool {
    super::avx2::is_available()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
}
