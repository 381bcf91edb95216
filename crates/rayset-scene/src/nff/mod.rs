//! The Neutral File Format of the standard scenes.

use std::path::Path;

use crate::{LoadOptions, LoadedScene, SceneError};

/// Reads an NFF file.
///
/// # Errors
///
/// [`SceneError`].
pub fn load_nff(path: &Path, options: &LoadOptions) -> Result<LoadedScene, SceneError> {
    let _ = options;
    Err(SceneError::UnknownFormat { path: path.into() })
}
