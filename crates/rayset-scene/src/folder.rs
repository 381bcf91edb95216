//! The folder of a scene: which files it may name, and how they are opened.

#[cfg(feature = "obj")]
use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, BufReader};
use std::path::Path;
#[cfg(feature = "obj")]
use std::path::{Component, PathBuf};

/// The folder of a scene.
#[cfg(feature = "obj")]
#[derive(Debug)]
pub(crate) struct Folder {
    path: PathBuf,
    allow_outside: bool,
    /// The files opened before, without links.
    opened: HashSet<PathBuf>,
}

#[cfg(feature = "obj")]
impl Folder {
    /// The folder that holds a file.
    pub(crate) fn of(file: &Path, allow_outside: bool) -> Self {
        let parent = file.parent().filter(|parent| *parent != Path::new(""));
        Self { path: parent.unwrap_or(Path::new(".")).into(), allow_outside, opened: HashSet::new() }
    }

    /// The path of a file of the folder, without links.
    ///
    /// A name that leads outside is refused before the disk is looked at, a link that does before anything is opened.
    pub(crate) fn resolve(&self, name: &Path) -> io::Result<PathBuf> {
        let outside =
            || io::Error::new(io::ErrorKind::PermissionDenied, "it lies outside the folder of the scene");
        if !self.allow_outside && !stays_inside(name) {
            return Err(outside());
        }
        let path = self.path.join(name).canonicalize()?;
        if !self.allow_outside && !path.starts_with(self.path.canonicalize()?) {
            return Err(outside());
        }
        Ok(path)
    }

    /// Opens a file of the folder; `None` if it was opened before.
    pub(crate) fn open(&mut self, name: &Path) -> io::Result<Option<BufReader<File>>> {
        let path = self.resolve(name)?;
        if self.opened.contains(&path) {
            return Ok(None);
        }
        let file = open_regular(&path)?;
        self.opened.insert(path);
        Ok(Some(file))
    }
}

/// Opens a regular file; opening anything else could wait for ever or do harm.
pub(crate) fn open_regular(path: &Path) -> io::Result<BufReader<File>> {
    let check = |metadata: fs::Metadata| match metadata.is_file() {
        true => Ok(()),
        false => Err(io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file")),
    };
    check(fs::metadata(path)?)?;
    let file = File::open(path)?;
    // It may have been replaced in between.
    check(file.metadata()?)?;
    Ok(BufReader::with_capacity(1 << 16, file))
}

/// Whether a relative path never climbs above where it starts.
#[cfg(feature = "obj")]
fn stays_inside(path: &Path) -> bool {
    let mut depth = 0_usize;
    path.components().all(|component| match component {
        Component::Normal(_) => {
            depth += 1;
            true
        }
        Component::CurDir => true,
        Component::ParentDir => {
            let is_inside = depth > 0;
            depth = depth.saturating_sub(1);
            is_inside
        }
        Component::Prefix(_) | Component::RootDir => false,
    })
}

#[cfg(all(test, feature = "obj"))]
mod tests {
    use super::*;

    #[test]
    fn paths_that_climb_are_outside() {
        for inside in ["a", "a/b", "./a", "a/../b", "a/./b/../../c", "", "..a", "a/.."] {
            assert!(stays_inside(Path::new(inside)), "{inside}");
        }
        for outside in ["/a", "..", "../a", "a/../..", "a/../../a/b", "./../a"] {
            assert!(!stays_inside(Path::new(outside)), "{outside}");
        }
    }
}
