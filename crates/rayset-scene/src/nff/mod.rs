//! The Neutral File Format of the standard scenes.
//!
//! Source: Haines 1987, "A proposal for standard graphics environments", and the description of the format, version
//! 3.9, that comes with its databases.

mod gzip;
mod reader;
mod view;
mod words;

use std::io::BufRead;
use std::path::Path;

use self::reader::Reader;
use crate::folder::open_regular;
use crate::{LoadOptions, LoadedScene, SceneError};

/// Reads an NFF file, also one that is compressed with gzip (feature `gzip`).
///
/// Every primitive becomes an object, named after its kind and its place among its kind. Opaque primitives are hit from
/// their front only, or from their back if their radii are negative; where the fill transmits light, from both sides.
/// How fills, lights and views become ours is described in the crate's README.
///
/// # Errors
///
/// [`SceneError::Read`] if the file cannot be read, or is compressed and damaged or this build reads no gzip;
/// [`SceneError::Parse`] with the line for what cannot be understood or trusted, or exceeds the limits; and
/// [`SceneError::Empty`] if there is no primitive.
pub fn load_nff(path: &Path, options: &LoadOptions) -> Result<LoadedScene, SceneError> {
    let open = open_regular(path).map_err(|source| SceneError::Read { path: path.into(), source })?;
    read_nff(open, path, options)
}

/// Reads NFF text, or gzip that holds it, from anywhere; messages name it `path`.
///
/// # Errors
///
/// As [`load_nff`].
pub fn read_nff(
    mut reader: impl BufRead,
    path: &Path,
    options: &LoadOptions,
) -> Result<LoadedScene, SceneError> {
    let is_compressed = gzip::is_compressed(&mut reader, path)
        .map_err(|source| SceneError::Read { path: path.into(), source })?;
    if is_compressed {
        let text = gzip::decompress(reader, options.limits.memory_bytes)
            .map_err(|source| SceneError::Read { path: path.into(), source })?;
        return Reader::new(text, path, options).read();
    }
    Reader::new(reader, path, options).read()
}
