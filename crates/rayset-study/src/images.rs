//! From frames to images: the one place that knows both.

use rayset_engine::{Frame, PlaneSamples};
use rayset_image::{Image, ImageError};

/// The image of a frame: its planes as channels, and where it comes from.
///
/// `provenance` gives names and values of attributes: scene, strategy, options. The version is added.
///
/// # Errors
///
/// [`ImageError`] if an attribute has an unusable name.
pub fn image_of(frame: &Frame, provenance: &[(&str, &str)]) -> Result<Image, ImageError> {
    let mut image = Image::new(frame.width, frame.height)?;
    for plane in frame.planes() {
        match plane.samples {
            PlaneSamples::F32(samples) => image.push_f32(plane.name, samples.to_vec())?,
            PlaneSamples::U32(samples) => image.push_u32(plane.name, samples.to_vec())?,
        }
    }
    for (name, value) in provenance {
        image.push_attribute(*name, *value)?;
    }
    image.push_attribute("version", env!("CARGO_PKG_VERSION"))?;
    Ok(image)
}
