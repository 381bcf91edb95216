//! What the vector backends of x86-64 share: lanes of a vector register, and how they are made.

/// Implements [`Lanes`](crate::Lanes) for a register, from the intrinsics of its instruction set.
///
/// SAFETY of every block: a value of a vector type exists only if it was made by its backend's token, directly or from
/// other such values, and a token exists only where [`Backend::run`](crate::Backend::run) has found that the machine
/// has the instructions (the token's field is private to this crate). Loads and stores go through slices that were
/// cut to the length of the register.
macro_rules! register_lanes {
    (
        $(#[$doc:meta])* $lanes:ident($vector:ty), $mask:ident, $scalar:ident x $n:literal,
        add: $add:path, sub: $sub:path, mul: $mul:path, div: $div:path, sqrt: $sqrt:path, min: $min:path, max: $max:path,
        store: $store:path,
        neg: |$neg_a:ident| $neg:expr, abs: |$abs_a:ident| $abs:expr,
        lt: |$lt_a:ident, $lt_b:ident| $lt:expr, le: |$le_a:ident, $le_b:ident| $le:expr,
        eq: |$eq_a:ident, $eq_b:ident| $eq:expr,
        select: |$select_mask:ident, $select_a:ident, $select_b:ident| $select:expr,
        compress: |$compress_mask:ident, $compress_a:ident| $compress:expr $(,)?
    ) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        #[repr(transparent)]
        pub struct $lanes(pub(super) $vector);

        register_lanes!(@operator $lanes, Add, add, $add);
        register_lanes!(@operator $lanes, Sub, sub, $sub);
        register_lanes!(@operator $lanes, Mul, mul, $mul);
        register_lanes!(@operator $lanes, Div, div, $div);

        impl Neg for $lanes {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                let $neg_a = self.0;
                // SAFETY: see the macro.
                Self(unsafe { $neg })
            }
        }

        impl Lanes for $lanes {
            type Scalar = $scalar;
            type Mask = $mask;
            const LANES: usize = $n;

            #[inline(always)]
            fn lane(self, i: usize) -> $scalar {
                let mut lanes = [0.0; $n];
                self.store(&mut lanes);
                lanes[i]
            }
            #[inline(always)]
            fn store(self, out: &mut [$scalar]) {
                let out = &mut out[..$n];
                // SAFETY: see the macro.
                unsafe { $store(out.as_mut_ptr(), self.0) }
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                // SAFETY: see the macro.
                Self(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn abs(self) -> Self {
                let $abs_a = self.0;
                // SAFETY: see the macro.
                Self(unsafe { $abs })
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                // The instruction is `a < b ? a : b` by definition. SAFETY: see the macro.
                Self(unsafe { $min(self.0, other.0) })
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                // SAFETY: see the macro.
                Self(unsafe { $max(self.0, other.0) })
            }
            #[inline(always)]
            fn lt(self, other: Self) -> $mask {
                let ($lt_a, $lt_b) = (self.0, other.0);
                // SAFETY: see the macro.
                $mask(unsafe { $lt })
            }
            #[inline(always)]
            fn le(self, other: Self) -> $mask {
                let ($le_a, $le_b) = (self.0, other.0);
                // SAFETY: see the macro.
                $mask(unsafe { $le })
            }
            #[inline(always)]
            fn eq(self, other: Self) -> $mask {
                let ($eq_a, $eq_b) = (self.0, other.0);
                // SAFETY: see the macro.
                $mask(unsafe { $eq })
            }
            #[inline(always)]
            fn select(self, mask: $mask, other: Self) -> Self {
                let ($select_mask, $select_a, $select_b) = (mask.0, self.0, other.0);
                // SAFETY: see the macro.
                Self(unsafe { $select })
            }
            #[inline(always)]
            fn compress(self, mask: $mask, out: &mut [$scalar]) {
                let out = &mut out[..$n];
                let ($compress_mask, $compress_a) = (mask.0, self.0);
                // In a register, which is stored whole: the instruction that compresses into memory takes several times
                // as long. SAFETY: see the macro.
                unsafe { $store(out.as_mut_ptr(), $compress) }
            }
        }
    };
    (@operator $lanes:ident, $trait:ident, $method:ident, $intrinsic:path) => {
        impl $trait for $lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: see the macro.
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}

pub(crate) mod avx2;
pub(crate) mod avx512;

/// Asks for an item, of one or two lines of the cache, to be brought near at hand.
#[inline(always)]
fn fetch<T>(item: &T) {
    use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};

    let start = std::ptr::from_ref(item).cast::<i8>();
    // SAFETY: the machine may be asked for any address; this one is that of an item, and of its last byte.
    unsafe {
        _mm_prefetch::<_MM_HINT_T0>(start);
        _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(size_of::<T>().saturating_sub(1)));
    }
}
