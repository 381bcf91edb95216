//! Scene files; `docs/scene-files.md` describes every key.

mod budget;
mod fields;
mod keys;
#[cfg(feature = "obj")]
mod mesh;
mod reader;
mod shapes;
#[cfg(feature = "obj")]
mod transform;

use std::io::Read;
use std::path::Path;

use self::fields::Fault;
use crate::folder::open_regular;
use crate::{LoadOptions, LoadedScene, SceneError};

/// A longer scene file is refused: the parser takes up to 80 bytes of memory a byte of text. Geometry that does not
/// fit in belongs in a file of its own.
const MAX_BYTES: usize = 4 << 20;

/// Reads a scene file in TOML; `docs/scene-files.md` describes it.
///
/// Paths in it are relative to its folder.
///
/// # Errors
///
/// [`SceneError::Parse`] with the line for whatever cannot be understood or makes no sense; [`SceneError::Read`] if
/// the file cannot be read; for a file that it names, the errors of that format.
pub fn load_toml(path: &Path, options: &LoadOptions) -> Result<LoadedScene, SceneError> {
    let failed = |source| SceneError::Read { path: path.into(), source };
    let mut bytes = Vec::new();
    let file = open_regular(path).map_err(failed)?;
    file.take(MAX_BYTES as u64 + 1).read_to_end(&mut bytes).map_err(failed)?;
    match std::str::from_utf8(&bytes) {
        Ok(text) => read_toml(text, path, options),
        Err(_) if bytes.len() > MAX_BYTES => Err(too_long(path)),
        Err(error) => {
            let line = line_of(&bytes, error.valid_up_to());
            Err(SceneError::Parse { path: path.into(), line, message: "this is not UTF-8".to_owned() })
        }
    }
}

/// Reads the text of a scene file; `path` is where errors are said to be, and its folder that of the files it names.
///
/// ```
/// use std::path::Path;
///
/// use rayset_scene::{LoadOptions, read_toml};
///
/// let text = "[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\n";
/// let loaded = read_toml(text, Path::new("ball.toml"), &LoadOptions::default())?;
/// assert_eq!(loaded.scene.objects().len(), 1);
///
/// let text = "[[sphere]]\ncenter = [0, 0, 0]\nraduis = 1\n";
/// let error = read_toml(text, Path::new("ball.toml"), &LoadOptions::default()).unwrap_err();
/// assert_eq!(
///     error.to_string(),
///     "ball.toml:3: unknown key `raduis` in [[sphere]]: did you mean `radius`?"
/// );
/// # Ok::<(), rayset_scene::SceneError>(())
/// ```
///
/// # Errors
///
/// Those of [`load_toml`].
pub fn read_toml(text: &str, path: &Path, options: &LoadOptions) -> Result<LoadedScene, SceneError> {
    if text.len() > MAX_BYTES {
        return Err(too_long(path));
    }
    reader::read(text, path, options).map_err(|fault| match fault {
        Fault::Here { at, message } => {
            SceneError::Parse { path: path.into(), line: line_of(text.as_bytes(), at), message }
        }
        Fault::Elsewhere(error) => error,
    })
}

fn too_long(path: &Path) -> SceneError {
    let message = format!("a scene file may have {MAX_BYTES} bytes: put large geometry in a file of its own");
    SceneError::Parse { path: path.into(), line: 1, message }
}

/// The line of an offset, counted from 1.
fn line_of(text: &[u8], at: usize) -> usize {
    1 + text.iter().take(at).filter(|byte| **byte == b'\n').count()
}
