#![doc = include_str!("../README.md")]

mod compare;
mod error;
#[cfg(feature = "exr")]
mod exr;
mod image;
mod layers;
mod output;
#[cfg(feature = "png")]
mod png;
mod summary;

#[cfg(feature = "exr")]
pub use self::exr::{read_exr, write_exr};
#[cfg(feature = "png")]
pub use self::png::{png_rgb8, to_srgb8, write_false_colour_png, write_png_rgb8};
pub use self::{
    compare::{ChannelComparison, Comparison, FirstDifference, compare, difference_image},
    error::ImageError,
    image::{Channel, Image, Sample, Samples},
    layers::{Layer, false_colour, unit_values},
    output::{check_writable, write_whole},
};
