//! The one error type of this crate.

use std::{error::Error, io, path::PathBuf};

/// Why an image could not be made, compared, read or written.
///
/// Messages name the file or channel and do not repeat their source, which [`Error::source`] gives.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// A side is zero or longer than [`Image::MAX_SIDE`](crate::Image::MAX_SIDE).
    #[error("an image of {width} x {height} pixels is not supported: each side must be from 1 to 65535")]
    InvalidSize {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// A channel name is empty, too long, not printable ASCII, or has an empty part between its dots.
    #[error("channel name `{name}` is not valid")]
    InvalidChannelName {
        /// The refused name.
        name: String,
    },
    /// The image already has a channel of this name.
    #[error("channel `{name}` occurs twice")]
    DuplicateChannel {
        /// The repeated name.
        name: String,
    },
    /// A plane does not have one sample a pixel.
    #[error("channel `{name}` has {actual} samples where the image has {expected} pixels")]
    WrongLength {
        /// The channel.
        name: String,
        /// Pixels of the image.
        expected: usize,
        /// Samples given.
        actual: usize,
    },
    /// An attribute name is empty, too long, or not printable ASCII without spaces.
    #[error("attribute name `{name}` is not valid")]
    InvalidAttributeName {
        /// The refused name.
        name: String,
    },
    /// The image already has an attribute of this name.
    #[error("attribute `{name}` occurs twice")]
    DuplicateAttribute {
        /// The repeated name.
        name: String,
    },
    /// A channel that is needed is absent.
    #[error("the image has no channel `{name}`")]
    MissingChannel {
        /// The absent channel.
        name: String,
    },
    /// A channel that must hold floats holds integers.
    #[error("channel `{name}` does not hold floats")]
    NotFloat {
        /// The channel.
        name: String,
    },
    /// The two images of a comparison have different sizes.
    #[error(
        "images differ in size: expected {} x {} pixels, actual {} x {}",
        expected.0, expected.1, actual.0, actual.1
    )]
    SizeMismatch {
        /// Width and height of the expected image.
        expected: (u32, u32),
        /// Width and height of the actual image.
        actual: (u32, u32),
    },
    /// The two images of a comparison have different channels.
    #[error("images differ in channels: missing [{}], unexpected [{}]", missing.join(", "), unexpected.join(", "))]
    ChannelMismatch {
        /// Channels of the expected image that the actual one lacks.
        missing: Vec<String>,
        /// Channels of the actual image that the expected one lacks.
        unexpected: Vec<String>,
    },
    /// A channel holds floats in one image and integers in the other.
    #[error("channel `{name}` holds floats in one image and integers in the other")]
    SampleTypeMismatch {
        /// The channel.
        name: String,
    },
    /// A tolerance is negative or NaN.
    #[error("tolerance {tolerance} is not a number of at least 0")]
    InvalidTolerance {
        /// The refused tolerance.
        tolerance: f32,
    },
    /// The pixels handed to a writer do not fill the stated size.
    #[error("cannot write `{path}`: {actual} pixels do not fill {width} x {height}", path = path.display())]
    PixelCount {
        /// The file that was not written.
        path: PathBuf,
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Pixels given.
        actual: usize,
    },
    /// A file could not be read from the disk.
    #[error("cannot read `{path}`", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// A file could not be written to the disk; nothing of it is left behind.
    #[error("cannot write `{path}`", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// The bytes of a file are not an image we can read.
    #[error("cannot decode `{path}`", path = path.display())]
    Decode {
        /// The file.
        path: PathBuf,
        /// What is wrong with its bytes.
        source: Box<dyn Error + Send + Sync>,
    },
    /// The image cannot be expressed in the format of the file; nothing was written.
    #[error("cannot encode `{path}`", path = path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// What cannot be expressed.
        source: Box<dyn Error + Send + Sync>,
    },
}
