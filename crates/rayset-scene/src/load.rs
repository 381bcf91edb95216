//! Scenes from files, whatever their format.

use std::path::Path;

use crate::{Scene, SceneError, Warning};

/// How files are read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LoadOptions {
    /// Whether a file may name files outside its own folder.
    pub allow_outside: bool,
    /// See [`SceneBuilder::max_volume_primitives`](crate::SceneBuilder::max_volume_primitives); `None` for what the
    /// file says, and one volume an object if it says nothing.
    pub max_volume_primitives: Option<u32>,
    /// Whether surfaces of NFF files are hit from both sides even where the format says one.
    pub two_sided: bool,
    /// How much a file may ask for.
    pub limits: Limits,
}

/// How much a file may ask for before it is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of a line, or of a statement continued over several lines.
    pub line_bytes: usize,
    /// Faces of one file, or primitives where they are not faces.
    pub faces: u64,
    /// Corners of one face.
    pub corners: u32,
    /// Bytes of one material library.
    pub library_bytes: u64,
    /// Bytes of memory that the geometry of one scene may take, roughly.
    pub memory_bytes: u64,
    /// Warnings kept; those beyond are only counted.
    pub warnings: usize,
}

impl Default for Limits {
    /// Lines of 1 MiB, 2^28 faces of at most 2^16 corners, libraries of 64 MiB, 16 GiB of memory, 100 warnings.
    fn default() -> Self {
        Self {
            line_bytes: 1 << 20,
            faces: 1 << 28,
            corners: 1 << 16,
            library_bytes: 64 << 20,
            memory_bytes: 16 << 30,
            warnings: 100,
        }
    }
}

/// A scene read from a file.
#[derive(Debug)]
pub struct LoadedScene {
    /// The scene.
    pub scene: Scene,
    /// The resolution that the file asks for, if it does: pixels across and down.
    pub resolution: Option<(u32, u32)>,
    /// What was ignored.
    pub warnings: Vec<Warning>,
}

/// Reads a scene; the ending of the file's name tells its format: `.toml`, `.nff`, `.nff.gz` or `.obj`.
///
/// # Errors
///
/// [`SceneError::UnknownFormat`] for another ending, and the errors of the format.
pub fn load_scene(path: &Path, options: &LoadOptions) -> Result<LoadedScene, SceneError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    if name.ends_with(".nff") || name.ends_with(".nff.gz") {
        return crate::load_nff(path, options);
    }
    #[cfg(feature = "obj")]
    if name.ends_with(".obj") {
        return crate::load_obj(path, options)?.into_scene(options);
    }
    #[cfg(feature = "toml")]
    if name.ends_with(".toml") {
        return crate::load_toml(path, options);
    }
    Err(SceneError::UnknownFormat { path: path.into() })
}
