//! Which lanes a kernel runs on, chosen once a list.

use std::fmt;
use std::str::FromStr;
use std::sync::OnceLock;

#[cfg(target_arch = "x86_64")]
use crate::x86;
use crate::{Portable, Scalar, Simd};

/// Work that is written once for any backend.
pub trait Kernel {
    /// What the work returns.
    type Output;

    /// Does the work on the lanes of `simd`.
    ///
    /// Mark the implementation `#[inline(always)]`, so that it is compiled for the instruction set of the
    /// backend that runs it.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// A part of a kernel that is compiled by itself.
///
/// What is inlined into one kernel is compiled once for each place it is called from, and again for each backend;
/// [`Simd::outline`] keeps a part that is called from several places, or whose call costs nothing beside its work, in a
/// function of its own.
pub trait Part<S: Simd> {
    /// What the work returns.
    type Output;

    /// Does the work on the lanes of `simd`; mark it `#[inline(always)]`, as [`Kernel::run`].
    fn run(self, simd: S) -> Self::Output;
}

/// Work whose data is as wide as the lanes of single precision.
///
/// [`Simd::by_lanes`] compiles the one method that fits, for each backend.
pub trait ByLanes<S: Simd> {
    /// What the work returns.
    type Output;

    /// Does the work on eight lanes; mark it `#[inline(always)]`, as [`Kernel::run`].
    fn eight(self, simd: S) -> Self::Output;

    /// Does the work on sixteen lanes; mark it `#[inline(always)]`, as [`Kernel::run`].
    fn sixteen(self, simd: S) -> Self::Output;
}

/// An implementation of lanes.
///
/// In increasing order of the number of lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Backend {
    /// One lane of `f64`; culls in the lanes of [`Backend::Portable`].
    Scalar,
    /// Arrays of four `f64` or eight `f32`, on any machine.
    Portable,
    /// Registers of 256 bits of x86-64, with fused multiply-add for culling.
    Avx2,
    /// Registers of 512 bits of x86-64.
    Avx512,
}

/// The text is not the name of a backend of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownBackend {
    name: String,
}

impl Backend {
    /// Every backend, whether or not this machine has it, from the narrowest.
    pub const ALL: &[Self] = &[Self::Scalar, Self::Portable, Self::Avx2, Self::Avx512];

    /// The backends this machine can run, from the narrowest.
    #[must_use]
    pub fn available() -> &'static [Self] {
        static AVAILABLE: OnceLock<Vec<Backend>> = OnceLock::new();
        AVAILABLE.get_or_init(|| Self::ALL.iter().copied().filter(|backend| backend.is_available()).collect())
    }

    /// Whether this machine can run it.
    #[must_use]
    #[inline]
    pub fn is_available(self) -> bool {
        match self {
            Self::Scalar | Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => x86::avx2::is_available(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => x86::avx512::is_available(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// The widest backend of this machine.
    #[must_use]
    pub fn widest() -> Self {
        Self::available().last().copied().unwrap_or(Self::Portable)
    }

    /// The backend that `RAYSET_SIMD` names, or the widest; read once a process.
    ///
    /// A value that names no backend of this machine counts as none; a program should refuse it with
    /// [`Backend::from_environment`].
    #[must_use]
    pub fn active() -> Self {
        static ACTIVE: OnceLock<Backend> = OnceLock::new();
        *ACTIVE.get_or_init(|| Self::from_environment().ok().flatten().unwrap_or_else(Self::widest))
    }

    /// The backend that the environment variable `RAYSET_SIMD` names, if it is set.
    ///
    /// # Errors
    ///
    /// [`UnknownBackend`] if it names none of this machine.
    pub fn from_environment() -> Result<Option<Self>, UnknownBackend> {
        std::env::var_os("RAYSET_SIMD").map(|name| name.to_string_lossy().parse()).transpose()
    }

    /// The name that `RAYSET_SIMD` knows it by.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Portable => "portable",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// Runs a kernel on this backend, or on [`Backend::Portable`] where the machine lacks it: the bits are the same.
    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            Self::Scalar => kernel.run(Scalar),
            // SAFETY: the machine has just been found to have the instructions that the function was compiled for.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 if self.is_available() => unsafe { x86::avx2::run(kernel) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 if self.is_available() => unsafe { x86::avx512::run(kernel) },
            _ => kernel.run(Portable),
        }
    }
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Backend {
    type Err = UnknownBackend;

    fn from_str(name: &str) -> Result<Self, UnknownBackend> {
        let backend = Self::available().iter().copied().find(|backend| backend.name() == name);
        backend.ok_or_else(|| UnknownBackend { name: name.to_owned() })
    }
}

impl fmt::Display for UnknownBackend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` is no SIMD backend of this machine; it has", self.name)?;
        for (i, backend) in Backend::available().iter().enumerate() {
            write!(f, "{} {backend}", if i == 0 { "" } else { "," })?;
        }
        Ok(())
    }
}

impl std::error::Error for UnknownBackend {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_backend_is_known_by_its_name() {
        for &backend in Backend::available() {
            assert_eq!(backend.name().parse(), Ok(backend));
        }
        let error = "sse9".parse::<Backend>().unwrap_err().to_string();
        assert!(
            error.starts_with("`sse9` is no SIMD backend of this machine; it has scalar, portable"),
            "{error}"
        );
    }

    #[test]
    fn every_backend_runs_somewhere() {
        struct Count;
        impl Kernel for Count {
            type Output = usize;
            #[inline(always)]
            fn run<S: Simd>(self, _: S) -> usize {
                <S::F64 as crate::Lanes>::LANES
            }
        }
        for &backend in Backend::ALL {
            let lanes = backend.run(Count);
            let expected = match backend {
                Backend::Scalar => 1,
                Backend::Avx512 if backend.is_available() => 8,
                _ => 4,
            };
            assert_eq!(lanes, expected, "{backend}");
        }
    }
}
