//! Output that is whole or not there.

use std::fs;
use std::path::Path;

use rayset_image::write_whole;

use crate::StudyError;

/// Writes a file under a temporary name in its folder, which is made if need be, and renames it.
///
/// # Errors
///
/// [`StudyError::Write`] if the folder or file cannot be written; nothing is left behind.
pub fn write_file(path: &Path, contents: &[u8]) -> Result<(), StudyError> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)
            .map_err(|source| StudyError::Write { path: path.into(), source: source.into() })?;
    }
    Ok(write_whole(path, contents)?)
}
