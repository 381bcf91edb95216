//! Lanes of `f32` and `f64` with the same bits on every backend.
//!
//! A kernel is written once, generic over [`Simd`], and run on a [`Backend`] that is chosen at run time,
//! once for a whole list of rays.
//! Every operation of [`Lanes`] is one IEEE 754 operation a lane: no lane is fused, approximate or
//! reassociated, so a kernel gives the bits of its [`Scalar`] run on any backend.
//! The exceptions are [`CullLanes::mul_add`] and [`CullLanes::mul_sub`] of single precision, for kernels that only discard.
//!
//! ```
//! use rayset_simd::{Backend, Kernel, Lanes, Simd};
//!
//! /// The squared lengths of many two-dimensional vectors.
//! struct SquaredLengths<'a> { x: &'a [f64], y: &'a [f64], out: &'a mut [f64] }
//!
//! impl Kernel for SquaredLengths<'_> {
//!     type Output = ();
//!     fn run<S: Simd>(self, simd: S) {
//!         for i in (0..self.x.len()).step_by(S::F64::LANES) {
//!             let (x, y) = (simd.load_f64(&self.x[i..]), simd.load_f64(&self.y[i..]));
//!             (x * x + y * y).store(&mut self.out[i..]);
//!         }
//!     }
//! }
//!
//! let mut out = [0.0; 8];
//! Backend::active().run(SquaredLengths { x: &[3.0; 8], y: &[4.0; 8], out: &mut out });
//! assert_eq!(out, [25.0; 8]);
//! ```

mod backend;
mod lanes;
mod pages;
mod portable;
mod scalar;
#[cfg(target_arch = "x86_64")]
#[macro_use]
mod x86;

pub use backend::{Backend, ByLanes, Kernel, Part, UnknownBackend};
pub use lanes::{CullLanes, LaneMask, Lanes, MAX_LANES, Simd};
pub use pages::large_page_vec;
pub use portable::{F32x8, F64x4, M32x8, M64x4, Portable};
pub use scalar::Scalar;
#[cfg(target_arch = "x86_64")]
pub use x86::avx2::{Avx2, Avx2F32, Avx2F64, Avx2M32, Avx2M64};
#[cfg(target_arch = "x86_64")]
pub use x86::avx512::{Avx512, Avx512F32, Avx512F64, Avx512M32, Avx512M64};
