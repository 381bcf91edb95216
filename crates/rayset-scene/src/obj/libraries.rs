//! The libraries that an OBJ file names.

use std::collections::HashSet;
use std::fmt;
use std::io::{self, BufRead};
use std::path::{Component, Path, PathBuf};

use super::context::Context;
use super::feed::Fault;
use super::mtl;
use super::statements::{Statement, Words, excerpt, without_comment};

/// Opens a library by the name that the OBJ file gives it; `None` if it was read before by another name.
pub(super) type Open<'a> = dyn FnMut(&Path) -> io::Result<Option<Box<dyn BufRead>>> + 'a;

/// Memory for the name of a library, beside the name; roughly.
const NAME_BYTES: u64 = 128;

/// Reads every library once.
pub(super) struct Libraries<'a> {
    /// The OBJ file.
    pub(super) path: &'a Path,
    pub(super) context: Context,
    open: &'a mut Open<'a>,
    /// The names tried so far.
    tried: HashSet<PathBuf>,
}

impl fmt::Debug for Libraries<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Libraries")
            .field("path", &self.path)
            .field("tried", &self.tried)
            .finish_non_exhaustive()
    }
}

impl<'a> Libraries<'a> {
    pub(super) fn new(path: &'a Path, context: Context, open: &'a mut Open<'a>) -> Self {
        Self { path, context, open, tried: HashSet::new() }
    }

    /// Reads what an `mtllib` names: one library whose name may have blanks, else one a word.
    ///
    /// What cannot be opened is a warning.
    pub(super) fn read(&mut self, statement: Statement) -> Result<(), Fault> {
        let Statement { line, rest: whole, .. } = statement;
        if whole.is_empty() {
            self.context.warn(self.path, line, "`mtllib` needs a name");
            return Ok(());
        }
        let Err(error) = self.library(whole)? else { return Ok(()) };
        let mut n_read = 0;
        let mut failed = Vec::new();
        for word in Words::new(whole).filter(|word| word.len() < whole.len()) {
            match self.library(word)? {
                Ok(()) => n_read += 1,
                Err(error) => failed.push((word, error)),
            }
        }
        if n_read == 0 {
            failed = vec![(without_comment(whole), error)];
        }
        for (name, error) in failed {
            let reason = match error.kind() {
                io::ErrorKind::NotFound => "there is no such file".to_owned(),
                _ => error.to_string(),
            };
            self.context.warn(self.path, line, format!("library `{}` ignored: {reason}", excerpt(name)));
        }
        Ok(())
    }

    /// Reads a library, unless it was read before; the inner error says why it cannot be opened.
    fn library(&mut self, name: &[u8]) -> Result<io::Result<()>, Fault> {
        let library = path_of(name);
        let key = library.components().filter(|component| *component != Component::CurDir).collect();
        self.context.take(name.len() as u64 + NAME_BYTES)?;
        if !self.tried.insert(key) {
            return Ok(Ok(()));
        }
        let opened = match (self.open)(&library) {
            // Other systems write folders so.
            Err(error) if error.kind() == io::ErrorKind::NotFound && name.contains(&b'\\') => {
                let name: Vec<u8> = name.iter().map(|&b| if b == b'\\' { b'/' } else { b }).collect();
                (self.open)(&path_of(&name))
            }
            opened => opened,
        };
        match opened {
            Ok(Some(reader)) => {
                let path = self.path.parent().unwrap_or(Path::new("")).join(&library);
                mtl::read(reader, &path, &mut self.context).map_err(Fault::Elsewhere)?;
                Ok(Ok(()))
            }
            Ok(None) => Ok(Ok(())),
            Err(error) => Ok(Err(error)),
        }
    }
}

/// A name as the system spells it.
#[cfg(unix)]
fn path_of(name: &[u8]) -> PathBuf {
    use std::os::unix::ffi::OsStrExt;

    PathBuf::from(std::ffi::OsStr::from_bytes(name))
}

/// A name as the system spells it.
#[cfg(not(unix))]
fn path_of(name: &[u8]) -> PathBuf {
    PathBuf::from(String::from_utf8_lossy(name).into_owned())
}
