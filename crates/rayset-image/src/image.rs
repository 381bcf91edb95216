//! The image: named planes of plain numbers, all of one size.

use std::fmt;

use crate::ImageError;

/// An image of named channels, all of the same size.
///
/// Samples are row-major, the first row is the top one.
/// Channel names follow OpenEXR: `R`, `G`, `B` are the beauty, `normal.X` is the component `X` of the layer
/// `normal`, and a layer of one value is a plain channel such as `depth` or a channel such as `depth.Y`.
///
/// Channels are kept in one canonical order, whatever the order they are pushed in: plain channels before
/// layers, layers by name, and inside a layer first `R G B A X Y Z`, then the rest by name.
/// So an image that was written and read back equals itself, and so do its summary and its comparisons.
/// Attributes are kept in the order of their names for the same reason.
#[derive(Clone, Debug)]
pub struct Image {
    width: u32,
    height: u32,
    channels: Vec<Channel>,
    attributes: Vec<(String, String)>,
}

/// One named plane of an [`Image`], one sample a pixel.
#[derive(Clone, Debug)]
pub struct Channel {
    name: String,
    samples: Samples,
}

/// The samples of a channel, row-major from the top.
#[derive(Clone, Debug)]
pub enum Samples {
    /// Measured quantities: radiance, depth, directions.
    F32(Vec<f32>),
    /// Counts and identifiers.
    U32(Vec<u32>),
}

/// One sample of a channel.
///
/// [`Display`](fmt::Display) writes the value and its bits, so two samples that differ never look alike.
#[derive(Clone, Copy, Debug)]
pub enum Sample {
    /// A sample of a float channel.
    F32(f32),
    /// A sample of an integer channel.
    U32(u32),
}

impl Image {
    /// The longest side, in pixels: the number of pixels of any image fits a `u32`.
    pub const MAX_SIDE: u32 = 65_535;

    /// An image without channels.
    ///
    /// # Errors
    ///
    /// [`ImageError::InvalidSize`] if a side is 0 or longer than [`Image::MAX_SIDE`].
    pub fn new(width: u32, height: u32) -> Result<Self, ImageError> {
        let sides = 1..=Self::MAX_SIDE;
        if !sides.contains(&width) || !sides.contains(&height) {
            return Err(ImageError::InvalidSize { width, height });
        }
        Ok(Self { width, height, channels: Vec::new(), attributes: Vec::new() })
    }

    /// Adds a float channel.
    ///
    /// A name has 1 to 255 printable ASCII characters and no empty part before, after or between its dots.
    ///
    /// # Errors
    ///
    /// [`ImageError::InvalidChannelName`], [`ImageError::DuplicateChannel`], or [`ImageError::WrongLength`] if
    /// there is not one sample a pixel; the image is then unchanged.
    pub fn push_f32(&mut self, name: impl Into<String>, samples: Vec<f32>) -> Result<(), ImageError> {
        self.push(name.into(), Samples::F32(samples))
    }

    /// Adds an integer channel; names are as in [`Image::push_f32`].
    ///
    /// # Errors
    ///
    /// Those of [`Image::push_f32`].
    pub fn push_u32(&mut self, name: impl Into<String>, samples: Vec<u32>) -> Result<(), ImageError> {
        self.push(name.into(), Samples::U32(samples))
    }

    /// Adds a line of provenance: scene, strategy, options or version.
    ///
    /// It is for what decides the pixels, never for times, dates, hosts or users: equal renders must give
    /// equal files. A name has 1 to 200 printable ASCII characters without spaces; a value is any text.
    ///
    /// # Errors
    ///
    /// [`ImageError::InvalidAttributeName`] or [`ImageError::DuplicateAttribute`].
    pub fn push_attribute(
        &mut self,
        name: impl Into<String>,
        value: impl Into<String>,
    ) -> Result<(), ImageError> {
        let name = name.into();
        if name.is_empty() || name.len() > 200 || !name.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err(ImageError::InvalidAttributeName { name });
        }
        match self.attributes.binary_search_by(|(other, _)| other.cmp(&name)) {
            Ok(_) => Err(ImageError::DuplicateAttribute { name }),
            Err(place) => {
                self.attributes.insert(place, (name, value.into()));
                Ok(())
            }
        }
    }

    /// Pixels in a row, at least 1.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows, at least 1.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Pixels, which is also the number of samples of every channel.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The channels in canonical order.
    #[must_use]
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// The channel of exactly this name.
    #[must_use]
    pub fn channel(&self, name: &str) -> Option<&Channel> {
        self.channels.iter().find(|channel| channel.name == name)
    }

    /// Provenance as names and values, in the order of the names.
    #[must_use]
    pub fn attributes(&self) -> &[(String, String)] {
        &self.attributes
    }

    fn push(&mut self, name: String, samples: Samples) -> Result<(), ImageError> {
        let printable = name.bytes().all(|byte| byte == b' ' || byte.is_ascii_graphic());
        if name.len() > 255 || !printable || name.split('.').any(str::is_empty) {
            return Err(ImageError::InvalidChannelName { name });
        }
        if self.channel(&name).is_some() {
            return Err(ImageError::DuplicateChannel { name });
        }
        let (expected, actual) = (self.pixels(), samples.len());
        if actual != expected {
            return Err(ImageError::WrongLength { name, expected, actual });
        }
        let channel = Channel { name, samples };
        let place = self.channels.partition_point(|other| other.order() < channel.order());
        self.channels.insert(place, channel);
        Ok(())
    }
}

impl Channel {
    /// The full name, such as `R` or `normal.X`.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The part of the name before its last dot; empty for a plain channel.
    #[must_use]
    pub fn layer_name(&self) -> &str {
        self.name.rsplit_once('.').map_or("", |(layer, _)| layer)
    }

    /// The part of the name after its last dot; the whole name of a plain channel.
    #[must_use]
    pub fn component(&self) -> &str {
        self.name.rsplit_once('.').map_or(&self.name, |(_, component)| component)
    }

    /// The samples, one a pixel.
    #[must_use]
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// The samples of a float channel.
    ///
    /// # Errors
    ///
    /// [`ImageError::NotFloat`] for an integer channel.
    pub fn floats(&self) -> Result<&[f32], ImageError> {
        match &self.samples {
            Samples::F32(samples) => Ok(samples),
            Samples::U32(_) => Err(ImageError::NotFloat { name: self.name.clone() }),
        }
    }

    /// The key of the canonical order.
    fn order(&self) -> (&str, usize, &str) {
        let component = self.component();
        let rank = ["R", "G", "B", "A", "X", "Y", "Z"].iter().position(|&known| known == component);
        (self.layer_name(), rank.unwrap_or(usize::MAX), component)
    }
}

impl Samples {
    /// The number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::F32(samples) => samples.len(),
            Self::U32(samples) => samples.len(),
        }
    }

    /// Whether there is no sample; never the case inside an [`Image`].
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The sample at an index, if there is one.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<Sample> {
        match self {
            Self::F32(samples) => samples.get(index).copied().map(Sample::F32),
            Self::U32(samples) => samples.get(index).copied().map(Sample::U32),
        }
    }
}

impl fmt::Display for Sample {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::F32(value) => write!(formatter, "{value:?} (0x{:08x})", value.to_bits()),
            Self::U32(value) => write!(formatter, "{value} (0x{value:08x})"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(image: &Image) -> Vec<&str> {
        image.channels().iter().map(Channel::name).collect()
    }

    #[test]
    fn sides_are_from_one_to_the_maximum() {
        assert!(matches!(Image::new(0, 1), Err(ImageError::InvalidSize { width: 0, height: 1 })));
        assert!(matches!(Image::new(1, 0), Err(ImageError::InvalidSize { .. })));
        assert!(matches!(Image::new(1, 65_536), Err(ImageError::InvalidSize { .. })));
        let largest = Image::new(Image::MAX_SIDE, Image::MAX_SIDE).unwrap();
        assert_eq!(u32::try_from(largest.pixels()).unwrap(), 65_535 * 65_535);
    }

    #[test]
    fn channels_are_kept_in_canonical_order() {
        let mut image = Image::new(1, 1).unwrap();
        for name in ["normal.Z", "zebra", "B", "a.b.X", "normal.X", "R", "albedo.R", "G", "normal.Y", "depth"]
        {
            image.push_f32(name, vec![0.0]).unwrap();
        }
        assert_eq!(
            names(&image),
            ["R", "G", "B", "depth", "zebra", "a.b.X", "albedo.R", "normal.X", "normal.Y", "normal.Z"]
        );
        assert_eq!(image.channel("a.b.X").unwrap().layer_name(), "a.b");
        assert_eq!(image.channel("a.b.X").unwrap().component(), "X");
        assert_eq!(image.channel("depth").unwrap().layer_name(), "");
        assert_eq!(image.channel("depth").unwrap().component(), "depth");
    }

    #[test]
    fn a_refused_channel_leaves_the_image_unchanged() {
        let mut image = Image::new(2, 1).unwrap();
        image.push_f32("R", vec![0.0, 1.0]).unwrap();
        let long = "n".repeat(256);
        for name in ["", ".", ".R", "R.", "a..R", "a\nb", "\u{e9}", long.as_str()] {
            let refused = image.push_f32(name, vec![0.0, 1.0]);
            assert!(matches!(refused, Err(ImageError::InvalidChannelName { .. })), "{name:?}");
        }
        assert!(matches!(
            image.push_u32("R", vec![0, 1]),
            Err(ImageError::DuplicateChannel { name }) if name == "R"
        ));
        assert!(matches!(
            image.push_u32("G", vec![0]),
            Err(ImageError::WrongLength { expected: 2, actual: 1, .. })
        ));
        assert_eq!(names(&image), ["R"]);
    }

    #[test]
    fn attributes_are_sorted_and_unique() {
        let mut image = Image::new(1, 1).unwrap();
        image.push_attribute("strategy", "coherent").unwrap();
        image.push_attribute("scene", "spheres, 7 \u{b0}").unwrap();
        assert!(matches!(image.push_attribute("scene", ""), Err(ImageError::DuplicateAttribute { .. })));
        assert!(matches!(image.push_attribute("a b", ""), Err(ImageError::InvalidAttributeName { .. })));
        let expected = [("scene", "spheres, 7 \u{b0}"), ("strategy", "coherent")];
        let expected = expected.map(|(name, value)| (name.to_owned(), value.to_owned()));
        assert_eq!(image.attributes(), expected);
    }

    #[test]
    fn samples_that_differ_never_look_alike() {
        let texts = [0.0_f32, -0.0, f32::from_bits(0x7fc0_0000), f32::from_bits(0x7fc0_0001)]
            .map(|value| Sample::F32(value).to_string());
        assert_eq!(texts, ["0.0 (0x00000000)", "-0.0 (0x80000000)", "NaN (0x7fc00000)", "NaN (0x7fc00001)"]);
        assert_eq!(Sample::U32(17).to_string(), "17 (0x00000011)");
    }
}
