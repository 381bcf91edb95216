//! Files that appear whole or not at all.

use std::{
    fs::{self, OpenOptions},
    io::{self, Write},
    path::{Path, PathBuf},
    sync::atomic::{AtomicU64, Ordering},
};

use crate::ImageError;

/// Writes a file under a temporary name in its own folder and renames it into place; so do all writers of this crate.
///
/// # Errors
///
/// [`ImageError::Write`] if the disk refuses, or the target exists and is no regular file; it is then as it was.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    replace_file(path, bytes).map_err(|source| ImageError::Write { path: path.into(), source })
}

/// Tries whether [`write_whole`] could write a file there, and leaves nothing behind.
///
/// # Errors
///
/// [`ImageError::Write`] as [`write_whole`] would give it.
pub fn check_writable(path: &Path) -> Result<(), ImageError> {
    let attempt = || {
        let (file, temporary) = create_beside(&target_of(path)?)?;
        drop(file);
        fs::remove_file(&temporary)
    };
    attempt().map_err(|source| ImageError::Write { path: path.into(), source })
}

/// Writes a file under a temporary name in its own folder and renames it into place.
///
/// An existing file is replaced; through a symbolic link the file it points to is. On failure the target is as
/// it was and no temporary file is left. A target that exists but is no regular file, a device or a folder, is
/// refused, since renaming would replace it.
pub(crate) fn replace_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let target = target_of(path)?;
    let (mut file, temporary) = create_beside(&target)?;
    let written = file.write_all(bytes).and_then(|()| file.sync_all());
    drop(file);
    let placed = written.and_then(|()| fs::rename(&temporary, &target));
    if placed.is_err() {
        // The first failure is the one worth reporting.
        let _ = fs::remove_file(&temporary);
    }
    placed
}

/// The file to replace; an error if it is none.
fn target_of(path: &Path) -> io::Result<PathBuf> {
    let target = if path.is_symlink() { path.canonicalize()? } else { path.to_path_buf() };
    if fs::metadata(&target).is_ok_and(|existing| !existing.is_file()) {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "it exists and is not a regular file"));
    }
    if target.file_name().is_none() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "the path names no file"));
    }
    Ok(target)
}

/// Creates a new file of a fresh temporary name in the folder of `target`.
fn create_beside(target: &Path) -> io::Result<(fs::File, PathBuf)> {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    loop {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let temporary = target.with_file_name(format!(".rayset-{}-{number}.tmp", std::process::id()));
        match OpenOptions::new().write(true).create_new(true).open(&temporary) {
            Ok(file) => return Ok((file, temporary)),
            // A run that was killed, or another host on a shared folder, left the name behind.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn an_existing_file_is_replaced_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        replace_file(&path, b"first, and longer").unwrap();
        replace_file(&path, b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(entries(folder.path()), ["a"]);
    }

    #[test]
    fn a_failed_write_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        fs::create_dir(&path).unwrap();
        assert_eq!(replace_file(&path, b"bytes").unwrap_err().kind(), io::ErrorKind::InvalidInput);
        assert!(replace_file(&folder.path().join("absent/b"), b"bytes").is_err());
        assert!(replace_file(Path::new("/"), b"bytes").is_err());
        assert!(replace_file(Path::new(""), b"bytes").is_err());
        // A slash after the name makes the rename fail after the bytes are written.
        assert!(replace_file(&folder.path().join("file/"), b"bytes").is_err());
        assert_eq!(entries(folder.path()), ["a"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_symbolic_link_stays_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, b"old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        replace_file(&link, b"new").unwrap();
        assert!(link.is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"new");
    }

    #[cfg(unix)]
    #[test]
    fn a_special_file_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&path).unwrap();
        assert_eq!(replace_file(&path, b"bytes").unwrap_err().kind(), io::ErrorKind::InvalidInput);
        assert!(!path.is_file());
        assert_eq!(entries(folder.path()), ["socket"]);
    }
}
