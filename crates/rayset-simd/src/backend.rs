//! Which lanes a kernel runs on, chosen once a list.

use std::fmt;
use std::str::FromStr;
use std::sync::OnceLock;

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

/// An implementation of lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Backend {
    /// One lane.
    Scalar,
    /// Arrays of four `f64` or eight `f32`, on any machine.
    Portable,
}

/// The text is not the name of a backend of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownBackend {
    name: String,
}

impl Backend {
    /// The backends this machine can run, from the narrowest.
    pub const ALL: &[Self] = &[Self::Scalar, Self::Portable];

    /// The widest backend of this machine.
    #[must_use]
    pub fn widest() -> Self {
        Self::Portable
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
        }
    }

    /// Runs a kernel on this backend.
    #[inline]
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self {
            Self::Scalar => kernel.run(Scalar),
            Self::Portable => kernel.run(Portable),
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
        let backend = Self::ALL.iter().copied().find(|backend| backend.name() == name);
        backend.ok_or_else(|| UnknownBackend { name: name.to_owned() })
    }
}

impl fmt::Display for UnknownBackend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` is no SIMD backend of this machine; it has", self.name)?;
        for (i, backend) in Backend::ALL.iter().enumerate() {
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
        for &backend in Backend::ALL {
            assert_eq!(backend.name().parse(), Ok(backend));
        }
        let error = "sse9".parse::<Backend>().unwrap_err();
        assert_eq!(error.to_string(), "`sse9` is no SIMD backend of this machine; it has scalar, portable");
    }
}
