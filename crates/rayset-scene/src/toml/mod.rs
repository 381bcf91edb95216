//! Scene files.

use std::path::Path;

use crate::{LoadOptions, LoadedScene, SceneError};

/// Reads a scene file.
///
/// # Errors
///
/// [`SceneError`].
pub fn load_toml(path: &Path, options: &LoadOptions) -> Result<LoadedScene, SceneError> {
    let _ = options;
    Err(SceneError::UnknownFormat { path: path.into() })
}
