//! How much a scene file may still ask for.

use crate::{Limits, Part};

use super::fields::Fault;

/// Memory for an object of one primitive, its material and its name, beside the primitive itself; roughly.
const OBJECT_BYTES: u64 = 512;

/// Memory for a primitive, while the scene is built and then in its columns; roughly.
const PRIMITIVE_BYTES: u64 = size_of::<Part>() as u64 + 256;

/// Separate random spheres of one file: placing them takes time quadratic in their count, about a second for so many.
pub(super) const MAX_SEPARATE: u64 = 1 << 14;

/// Files that one scene file may name: each is read anew.
#[cfg(feature = "obj")]
const MAX_FILES: u64 = 1000;

/// What is left of the limits.
#[derive(Debug)]
pub(super) struct Budget {
    limits: Limits,
    primitives: u64,
    bytes: u64,
    separate: u64,
    #[cfg(feature = "obj")]
    files: u64,
}

impl Budget {
    pub(super) fn new(limits: Limits) -> Self {
        Self {
            limits,
            primitives: limits.faces,
            bytes: limits.memory_bytes,
            separate: MAX_SEPARATE,
            #[cfg(feature = "obj")]
            files: MAX_FILES,
        }
    }

    /// Takes primitives, each of which may be an object of its own.
    pub(super) fn take(&mut self, primitives: u64, objects: u64, at: usize) -> Result<(), Fault> {
        let Some(left) = self.primitives.checked_sub(primitives) else {
            return Err(Fault::new(at, format!("more than {} primitives", self.limits.faces)));
        };
        let bytes =
            primitives.saturating_mul(PRIMITIVE_BYTES).saturating_add(objects.saturating_mul(OBJECT_BYTES));
        let Some(bytes) = self.bytes.checked_sub(bytes) else {
            let message =
                format!("the scene would take more than {} bytes of memory", self.limits.memory_bytes);
            return Err(Fault::new(at, message));
        };
        (self.primitives, self.bytes) = (left, bytes);
        Ok(())
    }

    /// Takes random spheres that must not overlap.
    pub(super) fn take_separate(&mut self, spheres: u64, at: usize) -> Result<(), Fault> {
        let Some(left) = self.separate.checked_sub(spheres) else {
            let message = format!(
                "at most {MAX_SEPARATE} random spheres of a file can be kept apart: set `separate = false` for more"
            );
            return Err(Fault::new(at, message));
        };
        self.separate = left;
        Ok(())
    }

    /// Takes a file, and says how large it may be.
    #[cfg(feature = "obj")]
    pub(super) fn take_file(&mut self, at: usize) -> Result<Limits, Fault> {
        let Some(left) = self.files.checked_sub(1) else {
            return Err(Fault::new(at, format!("a scene file may name {MAX_FILES} files")));
        };
        self.files = left;
        Ok(Limits { faces: self.primitives, memory_bytes: self.bytes, ..self.limits })
    }
}
