//! Registers of 256 bits: four `f64` or eight `f32`.

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use crate::{ByLanes, CullLanes, LaneMask, Lanes, Part, Simd};

/// The backend of AVX2 with FMA, BMI and LZCNT.
///
/// Exists only where the machine has these instructions: [`Backend::run`](crate::Backend::run) makes it.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(pub(crate) ());

macro_rules! register_mask {
    ($mask:ident($vector:ty), $lanes:ident, $and:path, $or:path, $xor:path, $movemask:path, $ones:expr) => {
        #[doc = concat!("A mask over [`", stringify!($lanes), "`]: all bits of a set lane are ones.")]
        #[derive(Clone, Copy, Debug)]
        #[repr(transparent)]
        pub struct $mask(pub(super) $vector);

        impl LaneMask for $mask {
            #[inline(always)]
            fn bits(self) -> u32 {
                // SAFETY: see `register_lanes`; the same for the others. The result has a bit a lane.
                (unsafe { $movemask(self.0) }).cast_unsigned()
            }
        }

        impl BitAnd for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitand(self, other: Self) -> Self {
                // SAFETY: see `register_lanes`.
                Self(unsafe { $and(self.0, other.0) })
            }
        }

        impl BitOr for $mask {
            type Output = Self;
            #[inline(always)]
            fn bitor(self, other: Self) -> Self {
                // SAFETY: see `register_lanes`.
                Self(unsafe { $or(self.0, other.0) })
            }
        }

        impl Not for $mask {
            type Output = Self;
            #[inline(always)]
            fn not(self) -> Self {
                // SAFETY: see `register_lanes`.
                Self(unsafe { $xor(self.0, $ones) })
            }
        }
    };
}

register_mask!(
    Avx2M64(__m256d),
    Avx2F64,
    _mm256_and_pd,
    _mm256_or_pd,
    _mm256_xor_pd,
    _mm256_movemask_pd,
    _mm256_castsi256_pd(_mm256_set1_epi64x(-1))
);
register_mask!(
    Avx2M32(__m256),
    Avx2F32,
    _mm256_and_ps,
    _mm256_or_ps,
    _mm256_xor_ps,
    _mm256_movemask_ps,
    _mm256_castsi256_ps(_mm256_set1_epi32(-1))
);

register_lanes! {
    /// A register of four `f64` lanes.
    Avx2F64(__m256d), Avx2M64, f64 x 4,
    add: _mm256_add_pd, sub: _mm256_sub_pd, mul: _mm256_mul_pd, div: _mm256_div_pd, sqrt: _mm256_sqrt_pd,
    min: _mm256_min_pd, max: _mm256_max_pd, store: _mm256_storeu_pd,
    neg: |a| _mm256_xor_pd(a, _mm256_set1_pd(-0.0)),
    abs: |a| _mm256_andnot_pd(_mm256_set1_pd(-0.0), a),
    lt: |a, b| _mm256_cmp_pd::<_CMP_LT_OQ>(a, b),
    le: |a, b| _mm256_cmp_pd::<_CMP_LE_OQ>(a, b),
    eq: |a, b| _mm256_cmp_pd::<_CMP_EQ_OQ>(a, b),
    select: |mask, a, b| _mm256_blendv_pd(b, a, mask),
    compress: |mask, a| _mm256_castps_pd(_mm256_permutevar8x32_ps(_mm256_castpd_ps(a), front_pairs(Avx2M64(mask)))),
}

register_lanes! {
    /// A register of eight `f32` lanes.
    Avx2F32(__m256), Avx2M32, f32 x 8,
    add: _mm256_add_ps, sub: _mm256_sub_ps, mul: _mm256_mul_ps, div: _mm256_div_ps, sqrt: _mm256_sqrt_ps,
    min: _mm256_min_ps, max: _mm256_max_ps, store: _mm256_storeu_ps,
    neg: |a| _mm256_xor_ps(a, _mm256_set1_ps(-0.0)),
    abs: |a| _mm256_andnot_ps(_mm256_set1_ps(-0.0), a),
    lt: |a, b| _mm256_cmp_ps::<_CMP_LT_OQ>(a, b),
    le: |a, b| _mm256_cmp_ps::<_CMP_LE_OQ>(a, b),
    eq: |a, b| _mm256_cmp_ps::<_CMP_EQ_OQ>(a, b),
    select: |mask, a, b| _mm256_blendv_ps(b, a, mask),
    compress: |mask, a| _mm256_permutevar8x32_ps(a, front(Avx2M32(mask))),
}

/// For each mask over lanes of so many parts of 32 bits, the permutation of parts that moves its set lanes to the front.
const fn fronts<const MASKS: usize>(parts: u32) -> [[u32; 8]; MASKS] {
    let mut table = [[0; 8]; MASKS];
    let mut mask = 0;
    while mask < MASKS {
        let (mut part, mut front) = (0_u32, 0);
        while part < 8 {
            if mask >> (part / parts) & 1 == 1 {
                table[mask][front] = part;
                front += 1;
            }
            part += 1;
        }
        mask += 1;
    }
    table
}

/// Those of eight lanes, and of four of twice the width.
static FRONT: [[u32; 8]; 256] = fronts(1);
static FRONT_PAIRS: [[u32; 8]; 16] = fronts(2);

/// For each mask over four lanes of twice the width, the permutation of halves that moves the first to the set lanes.
static BACK_PAIRS: [[u32; 8]; 16] = {
    let mut table = [[0; 8]; 16];
    let mut mask = 0;
    while mask < 16 {
        let (mut lane, mut front) = (0, 0);
        while lane < 4 {
            if mask >> lane & 1 == 1 {
                table[mask][2 * lane] = 2 * front;
                table[mask][2 * lane + 1] = 2 * front + 1;
                front += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

/// Where the set lanes of a mask come from when they are moved to the front.
#[inline(always)]
fn front(mask: Avx2M32) -> __m256i {
    let lanes: &[u32; 8] = &FRONT[mask.bits() as usize & 0xff];
    // SAFETY: see `register_lanes`; the array holds a register.
    unsafe { _mm256_loadu_si256(lanes.as_ptr().cast()) }
}

/// Where the halves of the set lanes of a mask come from when they are moved to the front.
#[inline(always)]
fn front_pairs(mask: Avx2M64) -> __m256i {
    let halves: &[u32; 8] = &FRONT_PAIRS[mask.bits() as usize & 0xf];
    // SAFETY: see `register_lanes`; the array holds a register.
    unsafe { _mm256_loadu_si256(halves.as_ptr().cast()) }
}

/// In each half, the greatest of that half of four registers.
#[inline(always)]
fn fours([a, b, c, d]: &[Avx2F32; 4]) -> __m256 {
    // SAFETY: see `register_lanes`.
    unsafe {
        let ab = _mm256_max_ps(_mm256_unpacklo_ps(a.0, b.0), _mm256_unpackhi_ps(a.0, b.0));
        let cd = _mm256_max_ps(_mm256_unpacklo_ps(c.0, d.0), _mm256_unpackhi_ps(c.0, d.0));
        let (ab, cd) = (_mm256_castps_pd(ab), _mm256_castps_pd(cd));
        let (low, high) = (_mm256_unpacklo_pd(ab, cd), _mm256_unpackhi_pd(ab, cd));
        _mm256_max_ps(_mm256_castpd_ps(low), _mm256_castpd_ps(high))
    }
}

impl CullLanes for Avx2F32 {
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        // SAFETY: see `register_lanes`.
        Self(unsafe { _mm256_fmadd_ps(self.0, factor.0, term.0) })
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, term: Self) -> Self {
        // SAFETY: see `register_lanes`.
        Self(unsafe { _mm256_fmsub_ps(self.0, factor.0, term.0) })
    }

    #[inline(always)]
    fn max_abs(self, other: Self) -> Self {
        self.abs().max(other.abs())
    }

    #[inline(always)]
    fn least(self) -> f32 {
        // SAFETY: see `register_lanes`. Halves, quarters, pairs.
        unsafe {
            let half = _mm_min_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let quarter = _mm_min_ps(half, _mm_movehl_ps(half, half));
            _mm_cvtss_f32(_mm_min_ss(quarter, _mm_shuffle_ps::<1>(quarter, quarter)))
        }
    }

    #[inline(always)]
    fn greatest(self) -> f32 {
        // SAFETY: see `register_lanes`. Halves, quarters, pairs.
        unsafe {
            let half = _mm_max_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let quarter = _mm_max_ps(half, _mm_movehl_ps(half, half));
            _mm_cvtss_f32(_mm_max_ss(quarter, _mm_shuffle_ps::<1>(quarter, quarter)))
        }
    }

    #[inline(always)]
    fn put(self, mask: Self::Mask, place: &mut Self) {
        let whole = self.select(mask, *place);
        // SAFETY: a reference may be written to. Volatile, so that it stays a whole store.
        unsafe { std::ptr::write_volatile(place, whole) }
    }
}

impl Simd for Avx2 {
    type F64 = Avx2F64;
    type F32 = Avx2F32;

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
        work.eight(self)
    }

    #[inline(always)]
    fn splat_f64(self, value: f64) -> Avx2F64 {
        // SAFETY: see `register_lanes`; the same for the others.
        Avx2F64(unsafe { _mm256_set1_pd(value) })
    }

    #[inline(always)]
    fn expand_f64(self, mask: Avx2M64, values: &[f64]) -> Avx2F64 {
        let values = &values[..4];
        let halves: &[u32; 8] = &BACK_PAIRS[mask.bits() as usize & 0xf];
        // SAFETY: the slice and the array hold a register each.
        Avx2F64(unsafe {
            let halves = _mm256_loadu_si256(halves.as_ptr().cast());
            let values = _mm256_castpd_ps(_mm256_loadu_pd(values.as_ptr()));
            _mm256_and_pd(mask.0, _mm256_castps_pd(_mm256_permutevar8x32_ps(values, halves)))
        })
    }

    #[inline(always)]
    fn collect_f64(self, of_lane: impl Fn(usize) -> f64) -> Avx2F64 {
        let [a, b, c, d] = std::array::from_fn(of_lane);
        // SAFETY: see `register_lanes`.
        Avx2F64(unsafe { _mm256_set_pd(d, c, b, a) })
    }

    #[inline(always)]
    fn load_f64(self, values: &[f64]) -> Avx2F64 {
        let values = &values[..4];
        // SAFETY: the slice holds a register.
        Avx2F64(unsafe { _mm256_loadu_pd(values.as_ptr()) })
    }

    #[inline(always)]
    fn mask_f64(self, bits: u32) -> Avx2M64 {
        // SAFETY: see `register_lanes`.
        Avx2M64(unsafe {
            let lanes = _mm256_setr_epi64x(1, 2, 4, 8);
            let bits = _mm256_set1_epi64x(i64::from(bits));
            _mm256_castsi256_pd(_mm256_cmpeq_epi64(_mm256_and_si256(bits, lanes), lanes))
        })
    }

    #[inline(always)]
    fn splat_f32(self, value: f32) -> Avx2F32 {
        // SAFETY: see `register_lanes`.
        Avx2F32(unsafe { _mm256_set1_ps(value) })
    }

    #[inline(always)]
    fn load_f32(self, values: &[f32]) -> Avx2F32 {
        let values = &values[..8];
        // SAFETY: the slice holds a register.
        Avx2F32(unsafe { _mm256_loadu_ps(values.as_ptr()) })
    }

    #[inline(always)]
    fn mask_f32(self, bits: u32) -> Avx2M32 {
        // SAFETY: see `register_lanes`.
        Avx2M32(unsafe {
            let lanes = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let bits = _mm256_set1_epi32(bits.cast_signed());
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(bits, lanes), lanes))
        })
    }

    #[inline(always)]
    fn narrow_f32(self, values: &[f64], offset: f64, scale: f64) -> Avx2F32 {
        let values = &values[..8];
        // SAFETY: the slice holds two registers.
        Avx2F32(unsafe {
            let (offset, scale) = (_mm256_set1_pd(offset), _mm256_set1_pd(scale));
            let low = _mm256_mul_pd(_mm256_sub_pd(_mm256_loadu_pd(values.as_ptr()), offset), scale);
            let high = _mm256_mul_pd(_mm256_sub_pd(_mm256_loadu_pd(values.as_ptr().add(4)), offset), scale);
            _mm256_set_m128(_mm256_cvtpd_ps(high), _mm256_cvtpd_ps(low))
        })
    }

    #[inline(always)]
    fn narrowing_f32(self, values: &[f64], offset: f64, scale: f64) -> Avx2F32 {
        let values = &values[..8];
        // SAFETY: the slice holds two registers.
        Avx2F32(unsafe {
            let (offset, scale) = (_mm256_set1_pd(offset), _mm256_set1_pd(scale));
            let low = _mm256_mul_pd(_mm256_sub_pd(_mm256_loadu_pd(values.as_ptr()), offset), scale);
            let high = _mm256_mul_pd(_mm256_sub_pd(_mm256_loadu_pd(values.as_ptr().add(4)), offset), scale);
            let low = _mm256_sub_pd(low, _mm256_cvtps_pd(_mm256_cvtpd_ps(low)));
            let high = _mm256_sub_pd(high, _mm256_cvtps_pd(_mm256_cvtpd_ps(high)));
            _mm256_set_m128(_mm256_cvtpd_ps(high), _mm256_cvtpd_ps(low))
        })
    }

    #[inline(always)]
    fn join_f32(self, parts: &[Avx2F64]) -> Avx2F32 {
        let [low, high] = parts else { panic!("there are {} parts, not 2", parts.len()) };
        // SAFETY: see `register_lanes`.
        Avx2F32(unsafe { _mm256_set_m128(_mm256_cvtpd_ps(high.0), _mm256_cvtpd_ps(low.0)) })
    }

    #[inline(always)]
    fn greatest_of_eight(self, of: &[[Avx2F32; 4]; 2]) -> [f32; 8] {
        let mut greatest = [0.0; 8];
        // SAFETY: see `register_lanes`; the array holds a register. Of four, the greatest of each half in its four parts;
        // then the halves.
        unsafe {
            let [low, high] = [fours(&of[0]), fours(&of[1])];
            let first = _mm256_permute2f128_ps::<0x20>(low, high);
            let second = _mm256_permute2f128_ps::<0x31>(low, high);
            _mm256_storeu_ps(greatest.as_mut_ptr(), _mm256_max_ps(first, second));
        }
        greatest
    }

    #[inline(always)]
    fn equal_u32(self, values: &[u32], wanted: u32) -> Avx2M32 {
        let values = &values[..8];
        // SAFETY: the slice holds a register.
        Avx2M32(unsafe {
            let values = _mm256_loadu_si256(values.as_ptr().cast());
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(values, _mm256_set1_epi32(wanted.cast_signed())))
        })
    }

    #[inline(always)]
    fn any_bits_u32(self, values: &[u32], bits: u32) -> Avx2M32 {
        let values = &values[..8];
        // SAFETY: the slice holds a register.
        Avx2M32(unsafe {
            let values = _mm256_loadu_si256(values.as_ptr().cast());
            let shared = _mm256_and_si256(values, _mm256_set1_epi32(bits.cast_signed()));
            let none = _mm256_cmpeq_epi32(shared, _mm256_setzero_si256());
            _mm256_castsi256_ps(_mm256_xor_si256(none, _mm256_set1_epi32(-1)))
        })
    }

    #[inline(always)]
    fn compress_u32(self, mask: Avx2M32, values: &[u32], out: &mut [u32]) {
        let (values, out) = (&values[..8], &mut out[..8]);
        // SAFETY: both slices hold a register.
        unsafe {
            let values = _mm256_loadu_si256(values.as_ptr().cast());
            _mm256_storeu_si256(out.as_mut_ptr().cast(), _mm256_permutevar8x32_epi32(values, front(mask)));
        }
    }

    #[inline(always)]
    fn compress_u32_either_way(self, mask: Avx2M32, values: &[u32], is_turned: bool, out: &mut [u32]) {
        let (values, out) = (&values[..8], &mut out[..8]);
        let count = mask.bits().count_ones().cast_signed();
        let turn = -i32::from(is_turned);
        // SAFETY: both slices hold a register. Turned, what goes to a lane stood as far before the end as it is behind the
        // start: `!i + count`.
        unsafe {
            let values = _mm256_loadu_si256(values.as_ptr().cast());
            let values = _mm256_permutevar8x32_epi32(values, front(mask));
            let lane = _mm256_xor_si256(_mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7), _mm256_set1_epi32(turn));
            let lane = _mm256_add_epi32(lane, _mm256_set1_epi32(turn & count));
            _mm256_storeu_si256(out.as_mut_ptr().cast(), _mm256_permutevar8x32_epi32(values, lane));
        }
    }
}

/// Runs a kernel compiled for this backend.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
pub(crate) fn run<K: crate::Kernel>(kernel: K) -> K::Output {
    kernel.run(Avx2(()))
}

/// Runs a part of a kernel in a function of its own, compiled for this backend.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline(never)]
fn run_part<P: Part<Avx2>>(part: P) -> P::Output {
    part.run(Avx2(()))
}

/// Whether the machine has the instructions.
#[inline]
pub(crate) fn is_available() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
}
