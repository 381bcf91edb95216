//! From frames to images: the one place that knows both.

use crate::engine::{Frame, PlaneSamples};
use crate::image::{Image, ImageError};

/// What the channels of beauty are called.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ChannelNames {
    /// `R`, `G`, `B`: what every program opens as the picture.
    Plain,
    /// `beauty.R`, `beauty.G`, `beauty.B`: a layer among others.
    Layered,
}

/// The image of a frame: its planes as channels, and where it comes from.
///
/// `provenance` gives names and values of attributes: scene, strategy, options. The version is added.
///
/// # Errors
///
/// [`ImageError`] if an attribute has an unusable name.
pub fn image_of(
    frame: &Frame,
    names: ChannelNames,
    provenance: &[(&str, &str)],
) -> Result<Image, ImageError> {
    let mut image = Image::new(frame.width, frame.height)?;
    for plane in frame.planes() {
        let name = match (names, plane.name.strip_prefix("beauty.")) {
            (ChannelNames::Plain, Some(component)) => component.to_owned(),
            _ => plane.name,
        };
        match plane.samples {
            PlaneSamples::F32(samples) => image.push_f32(name, samples)?,
            PlaneSamples::U32(samples) => image.push_u32(name, samples)?,
        }
    }
    for (name, value) in provenance {
        image.push_attribute(*name, *value)?;
    }
    image.push_attribute("version", env!("CARGO_PKG_VERSION"))?;
    Ok(image)
}
