//! What can go wrong with an experiment.

use std::path::PathBuf;

use rayset_engine::RenderError;
use rayset_image::ImageError;
use rayset_scene::SceneError;

/// An experiment could not be run or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A scene could not be made.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A frame could not be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// An image could not be written.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// Results could not be read.
    #[error("cannot read `{path}`", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A figure could not be drawn.
    #[error("cannot draw {figure}")]
    Draw {
        /// What it shows.
        figure: String,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Strategies that are exact gave different pixels or rays.
    #[error("strategies differ: {what}")]
    Differs {
        /// Where.
        what: String,
    },
    /// A report could not be written.
    #[error("cannot write `{path}`", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}
