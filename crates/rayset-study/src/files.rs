//! Output that is whole or not there.

use std::fs;
use std::path::Path;

use crate::StudyError;

/// Writes a file under a temporary name in its folder, which is made if need be, and renames it.
///
/// # Errors
///
/// [`StudyError::Write`] if the folder or file cannot be written; nothing is left behind.
pub fn write_file(path: &Path, contents: &[u8]) -> Result<(), StudyError> {
    let failed = |source: std::io::Error| StudyError::Write { path: path.into(), source: source.into() };
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(failed)?;
    }
    let mut temporary = path.as_os_str().to_owned();
    temporary.push(format!(".{}.tmp", std::process::id()));
    fs::write(&temporary, contents).and_then(|()| fs::rename(&temporary, path)).map_err(|error| {
        let _ = fs::remove_file(&temporary);
        failed(error)
    })
}
