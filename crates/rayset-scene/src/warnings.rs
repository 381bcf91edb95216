//! Collects warnings, but not without bound.

use std::path::Path;

use crate::Warning;

/// Warnings, of which only the first so many are kept.
#[derive(Debug)]
pub(crate) struct Warnings {
    kept: Vec<Warning>,
    limit: usize,
    n_suppressed: usize,
}

impl Warnings {
    pub(crate) fn new(limit: usize) -> Self {
        Self { kept: Vec::new(), limit, n_suppressed: 0 }
    }

    /// Notes a warning; line 0 is the whole file.
    pub(crate) fn push(&mut self, path: &Path, line: usize, message: impl Into<String>) {
        if self.kept.len() < self.limit {
            self.kept.push(Warning { path: path.into(), line, message: message.into() });
        } else {
            self.n_suppressed += 1;
        }
    }

    /// The warnings kept, and how many there were beyond, in the words of a last one about `path`.
    pub(crate) fn into_vec(mut self, path: &Path) -> Vec<Warning> {
        if self.n_suppressed > 0 {
            let message = format!("{} further warnings are not shown", self.n_suppressed);
            self.kept.push(Warning { path: path.into(), line: 0, message });
        }
        self.kept
    }
}
