//! What can go wrong with a scene.

use std::fmt;
use std::path::PathBuf;

/// A scene could not be loaded or built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A file could not be opened or read.
    #[error("cannot read `{path}`", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A line of a file cannot be understood or trusted.
    #[error("{path}:{line}: {message}", path = path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What is wrong.
        message: String,
    },
    /// The ending of a file's name is that of no format that is read here.
    #[error("`{path}` is no scene: its name ends neither with .toml, .nff, .nff.gz nor with .obj", path = path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// A file holds no geometry.
    #[error("`{path}` holds no face", path = path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// Something was given a value that makes no sense.
    #[error("{item}: {message}")]
    Invalid {
        /// What it belongs to.
        item: String,
        /// What is wrong.
        message: String,
    },
    /// There are more of something than a scene can number.
    #[error("more than {limit} {what}")]
    TooMany {
        /// What there are too many of.
        what: &'static str,
        /// How many there may be.
        limit: u64,
    },
}

/// Something in a file was ignored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// The file.
    pub path: PathBuf,
    /// The line, counted from 1; zero if it concerns the whole file.
    pub line: usize,
    /// What was ignored and why.
    pub message: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(f, "{}: {}", self.path.display(), self.message),
            line => write!(f, "{}:{line}: {}", self.path.display(), self.message),
        }
    }
}
