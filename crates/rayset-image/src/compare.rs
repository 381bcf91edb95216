//! Exact comparison of two images.

use std::fmt;

use crate::{Image, ImageError, Sample, Samples};

/// How two images of one size and one set of channels differ.
///
/// Samples *differ* when their bits do: `-0.0` differs from `0.0`, and NaNs differ when their payloads do.
/// The *distance* of two float samples is `|expected - actual|`, in `f64`. It is 0 for equal bits and for two NaNs,
/// and infinite where only one of them is NaN. Two integer samples are an identity or a count and have distance 0
/// or 1: equal or not.
/// A float sample is *over the tolerance* when its distance is greater; a differing integer sample always is.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Pixels of each image.
    pub pixels: usize,
    /// Pixels with a differing sample in some channel.
    pub differing_pixels: usize,
    /// Pixels with a sample over the tolerance in some channel.
    pub over_tolerance: usize,
    /// The tolerance that was asked for.
    pub tolerance: f32,
    /// The largest distance in the float channels; 0 if there are none.
    pub max_abs: f64,
    /// The mean distance in the float channels; 0 if there are none.
    pub mean_abs: f64,
    /// The root of the mean square distance in the float channels; 0 if there are none.
    pub rmse: f64,
    /// The first differing sample: pixels in rows from the top, in a pixel the channels in canonical order.
    pub first_difference: Option<FirstDifference>,
    /// One row a channel, in canonical order.
    pub channels: Vec<ChannelComparison>,
}

/// A differing sample and where it is.
#[derive(Clone, Debug)]
pub struct FirstDifference {
    /// The column, from 0 at the left.
    pub x: u32,
    /// The row, from 0 at the top.
    pub y: u32,
    /// The name of the channel.
    pub channel: String,
    /// The sample of the expected image.
    pub expected: Sample,
    /// The sample of the actual image.
    pub actual: Sample,
}

/// How one channel differs; the terms are those of [`Comparison`].
#[derive(Clone, Debug)]
pub struct ChannelComparison {
    /// The name of the channel.
    pub name: String,
    /// Differing samples.
    pub differing: usize,
    /// Samples over the tolerance.
    pub over_tolerance: usize,
    /// The largest distance.
    pub max_abs: f64,
    /// The mean distance.
    pub mean_abs: f64,
    /// The root of the mean square distance.
    pub rmse: f64,
}

impl Comparison {
    /// Whether no bit of any sample differs.
    #[must_use]
    pub fn is_identical(&self) -> bool {
        self.differing_pixels == 0
    }

    /// Whether no sample is over the tolerance.
    #[must_use]
    pub fn is_within_tolerance(&self) -> bool {
        self.over_tolerance == 0
    }
}

impl fmt::Display for Comparison {
    /// A short text: counts, distances, the first differing sample, and a line a differing channel.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(first) = &self.first_difference else {
            return write!(formatter, "{} pixels, identical by bits", self.pixels);
        };
        let (pixels, differing, over) = (self.pixels, self.differing_pixels, self.over_tolerance);
        let tolerance = self.tolerance;
        writeln!(
            formatter,
            "{differing} of {pixels} pixels differ, {over} over the tolerance {tolerance:?}"
        )?;
        write_distances(formatter, self.max_abs, self.mean_abs, self.rmse)?;
        write!(formatter, "\nfirst at {first}")?;
        for channel in self.channels.iter().filter(|channel| channel.differing > 0) {
            let ChannelComparison { name, differing, over_tolerance, max_abs, mean_abs, rmse } = channel;
            write!(
                formatter,
                "\nchannel `{name}`: {differing} differ, {over_tolerance} over the tolerance, "
            )?;
            write_distances(formatter, *max_abs, *mean_abs, *rmse)?;
        }
        Ok(())
    }
}

impl fmt::Display for FirstDifference {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { x, y, channel, expected, actual } = self;
        write!(formatter, "x = {x}, y = {y}, channel `{channel}`: expected {expected}, actual {actual}")
    }
}

/// Compares two images sample by sample; attributes are not compared.
///
/// Sums are taken in `f64` in a fixed order, row by row in a channel and then channel by channel, so the result is
/// the same on every host.
///
/// # Errors
///
/// [`ImageError::InvalidTolerance`] if the tolerance is negative or NaN; [`ImageError::SizeMismatch`],
/// [`ImageError::ChannelMismatch`] or [`ImageError::SampleTypeMismatch`] if the images cannot be compared.
pub fn compare(expected: &Image, actual: &Image, tolerance: f32) -> Result<Comparison, ImageError> {
    if tolerance.is_nan() || tolerance < 0.0 {
        return Err(ImageError::InvalidTolerance { tolerance });
    }
    check_comparable(expected, actual)?;

    let pixels = expected.pixels();
    let mut differing = vec![false; pixels];
    let mut over = vec![false; pixels];
    let mut first: Option<(usize, usize)> = None;
    let mut total = Distances::default();
    let mut channels = Vec::new();
    for (number, (one, other)) in expected.channels().iter().zip(actual.channels()).enumerate() {
        let mut of_channel = Distances::default();
        let mut note = |index: usize, is_over: bool, distance: f64| {
            of_channel.differing += 1;
            differing[index] = true;
            if is_over {
                of_channel.over_tolerance += 1;
                over[index] = true;
            }
            // Channels come in order, so an earlier channel keeps a pixel they share.
            if first.is_none_or(|(pixel, _)| index < pixel) {
                first = Some((index, number));
            }
            of_channel.add(distance);
        };
        match (one.samples(), other.samples()) {
            (Samples::F32(ones), Samples::F32(others)) => {
                for (index, (one, other)) in ones.iter().zip(others).enumerate() {
                    if one.to_bits() != other.to_bits() {
                        let distance = distance(f64::from(*one), f64::from(*other));
                        note(index, distance > f64::from(tolerance), distance);
                    }
                }
                total.merge(&of_channel, pixels);
            }
            (Samples::U32(ones), Samples::U32(others)) => {
                for (index, (one, other)) in ones.iter().zip(others).enumerate() {
                    if one != other {
                        note(index, true, 1.0);
                    }
                }
            }
            _ => return Err(ImageError::SampleTypeMismatch { name: one.name().to_owned() }),
        }
        channels.push(ChannelComparison {
            name: one.name().to_owned(),
            differing: of_channel.differing,
            over_tolerance: of_channel.over_tolerance,
            max_abs: of_channel.max,
            mean_abs: mean(of_channel.sum, pixels),
            rmse: mean(of_channel.sum_of_squares, pixels).sqrt(),
        });
    }

    Ok(Comparison {
        pixels,
        differing_pixels: differing.iter().filter(|&&differs| differs).count(),
        over_tolerance: over.iter().filter(|&&is_over| is_over).count(),
        tolerance,
        max_abs: total.max,
        mean_abs: mean(total.sum, total.samples),
        rmse: mean(total.sum_of_squares, total.samples).sqrt(),
        first_difference: first
            .and_then(|(pixel, channel)| first_difference(expected, actual, pixel, channel)),
        channels,
    })
}

/// The distances of two images as an image of the same channels: what [`Comparison`] calls distance, rounded to
/// `f32`, for float channels, and 0 or 1 for integer channels. It has no attributes.
///
/// # Errors
///
/// Those of [`compare`], but for the tolerance.
pub fn difference_image(expected: &Image, actual: &Image) -> Result<Image, ImageError> {
    check_comparable(expected, actual)?;
    let mut image = Image::new(expected.width(), expected.height())?;
    for (one, other) in expected.channels().iter().zip(actual.channels()) {
        match (one.samples(), other.samples()) {
            (Samples::F32(ones), Samples::F32(others)) => {
                #[expect(clippy::cast_possible_truncation, reason = "the nearest f32 is meant")]
                let distances = ones
                    .iter()
                    .zip(others)
                    .map(|(&one, &other)| distance(f64::from(one), f64::from(other)) as f32);
                image.push_f32(one.name(), distances.collect())?;
            }
            (Samples::U32(ones), Samples::U32(others)) => {
                let differ = ones.iter().zip(others).map(|(one, other)| u32::from(one != other));
                image.push_u32(one.name(), differ.collect())?;
            }
            _ => return Err(ImageError::SampleTypeMismatch { name: one.name().to_owned() }),
        }
    }
    Ok(image)
}

/// Running sums over the samples of a channel, or of all float channels.
#[derive(Default)]
struct Distances {
    samples: usize,
    differing: usize,
    over_tolerance: usize,
    max: f64,
    sum: f64,
    sum_of_squares: f64,
}

impl Distances {
    fn add(&mut self, distance: f64) {
        self.max = self.max.max(distance);
        self.sum += distance;
        self.sum_of_squares += distance * distance;
    }

    fn merge(&mut self, channel: &Self, samples: usize) {
        self.samples += samples;
        self.max = self.max.max(channel.max);
        self.sum += channel.sum;
        self.sum_of_squares += channel.sum_of_squares;
    }
}

fn distance(expected: f64, actual: f64) -> f64 {
    match (expected.is_nan(), actual.is_nan()) {
        (true, true) => 0.0,
        (true, false) | (false, true) => f64::INFINITY,
        // Infinities of one sign: their difference would be NaN.
        (false, false) if expected.to_bits() == actual.to_bits() => 0.0,
        (false, false) => (expected - actual).abs(),
    }
}

fn mean(sum: f64, samples: usize) -> f64 {
    let samples = samples.max(1) as f64;
    sum / samples
}

/// Whether sizes and channel names agree; canonical order then pairs the channels.
fn check_comparable(expected: &Image, actual: &Image) -> Result<(), ImageError> {
    let size = |image: &Image| (image.width(), image.height());
    if size(expected) != size(actual) {
        return Err(ImageError::SizeMismatch { expected: size(expected), actual: size(actual) });
    }
    let without = |image: &Image, other: &Image| -> Vec<String> {
        let names = image.channels().iter().map(|channel| channel.name());
        names.filter(|name| other.channel(name).is_none()).map(str::to_owned).collect()
    };
    let (missing, unexpected) = (without(expected, actual), without(actual, expected));
    if missing.is_empty() && unexpected.is_empty() {
        Ok(())
    } else {
        Err(ImageError::ChannelMismatch { missing, unexpected })
    }
}

fn first_difference(
    expected: &Image,
    actual: &Image,
    pixel: usize,
    channel: usize,
) -> Option<FirstDifference> {
    let index = u32::try_from(pixel).ok()?;
    Some(FirstDifference {
        x: index % expected.width(),
        y: index / expected.width(),
        channel: expected.channels()[channel].name().to_owned(),
        expected: expected.channels()[channel].samples().get(pixel)?,
        actual: actual.channels()[channel].samples().get(pixel)?,
    })
}

fn write_distances(formatter: &mut fmt::Formatter<'_>, max: f64, mean: f64, rmse: f64) -> fmt::Result {
    write!(formatter, "largest distance {max:.5e}, mean {mean:.5e}, root mean square {rmse:.5e}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(red: [f32; 4], id: [u32; 4]) -> Image {
        let mut image = Image::new(2, 2).unwrap();
        image.push_f32("R", red.to_vec()).unwrap();
        image.push_u32("object", id.to_vec()).unwrap();
        image
    }

    #[test]
    fn a_worked_comparison() {
        // Distances 0, 0.5, 0 and 1.5: mean 2 / 4, root of (0.25 + 2.25) / 4 = 0.625.
        let expected = image([1.0, 2.0, 3.0, 4.0], [0, 1, 2, 3]);
        let actual = image([1.0, 2.5, 3.0, 2.5], [0, 1, 9, 3]);
        let comparison = compare(&expected, &actual, 0.5).unwrap();
        assert_eq!(comparison.pixels, 4);
        assert_eq!(comparison.differing_pixels, 3);
        assert_eq!(comparison.over_tolerance, 2, "0.5 is not over 0.5, a changed identity is over anything");
        let close = |value: f64, to: f64| value.to_bits() == to.to_bits();
        assert!(close(comparison.max_abs, 1.5));
        assert!(close(comparison.mean_abs, 0.5));
        assert!(close(comparison.rmse, 0.625_f64.sqrt()));
        let rows: Vec<(&str, usize, usize)> = (comparison.channels.iter())
            .map(|channel| (channel.name.as_str(), channel.differing, channel.over_tolerance))
            .collect();
        assert_eq!(rows, [("R", 2, 1), ("object", 1, 1)]);
        assert_eq!(
            comparison.to_string(),
            "3 of 4 pixels differ, 2 over the tolerance 0.5\n\
             largest distance 1.50000e0, mean 5.00000e-1, root mean square 7.90569e-1\n\
             first at x = 1, y = 0, channel `R`: expected 2.0 (0x40000000), actual 2.5 (0x40200000)\n\
             channel `R`: 2 differ, 1 over the tolerance, \
             largest distance 1.50000e0, mean 5.00000e-1, root mean square 7.90569e-1\n\
             channel `object`: 1 differ, 1 over the tolerance, \
             largest distance 1.00000e0, mean 2.50000e-1, root mean square 5.00000e-1"
        );
    }

    #[test]
    fn the_first_difference_is_the_first_pixel_not_the_first_channel() {
        let expected = image([0.0; 4], [0; 4]);
        let first = |actual: &Image| compare(&expected, actual, 0.0).unwrap().first_difference.unwrap();
        let earlier = first(&image([0.0, 0.0, 0.0, 1.0], [0, 0, 5, 0]));
        assert_eq!((earlier.x, earlier.y, earlier.channel.as_str()), (0, 1, "object"));
        assert_eq!(earlier.actual.to_string(), "5 (0x00000005)");
        let shared = first(&image([0.0, 0.0, 1.0, 0.0], [0, 0, 5, 0]));
        assert_eq!((shared.x, shared.y, shared.channel.as_str()), (0, 1, "R"));
    }

    #[test]
    fn differing_is_by_bits_and_distance_by_value() {
        let payload = f32::from_bits(0x7fc0_0001);
        let expected = image([0.0, f32::NAN, f32::INFINITY, 1.0], [0; 4]);
        let signs = image([-0.0, payload, f32::INFINITY, 1.0], [0; 4]);
        let comparison = compare(&expected, &signs, 0.0).unwrap();
        assert_eq!((comparison.differing_pixels, comparison.over_tolerance), (2, 0));
        assert_eq!(comparison.max_abs.to_bits(), 0.0_f64.to_bits());
        assert!(!comparison.is_identical() && comparison.is_within_tolerance());

        let lost = image([0.0, f32::NAN, f32::INFINITY, f32::NAN], [0; 4]);
        let comparison = compare(&expected, &lost, 1e30).unwrap();
        assert_eq!((comparison.differing_pixels, comparison.over_tolerance), (1, 1));
        assert!(comparison.max_abs.is_infinite() && comparison.rmse.is_infinite());

        let same = compare(&expected, &expected.clone(), 0.0).unwrap();
        assert!(same.is_identical());
        assert_eq!(same.to_string(), "4 pixels, identical by bits");
    }

    #[test]
    fn images_that_cannot_be_compared_are_errors() {
        let expected = image([0.0; 4], [0; 4]);
        let wide = compare(&expected, &Image::new(4, 1).unwrap(), 0.0).unwrap_err();
        assert_eq!(wide.to_string(), "images differ in size: expected 2 x 2 pixels, actual 4 x 1");

        let mut other = Image::new(2, 2).unwrap();
        other.push_f32("R", vec![0.0; 4]).unwrap();
        other.push_f32("G", vec![0.0; 4]).unwrap();
        let channels = compare(&expected, &other, 0.0).unwrap_err();
        assert_eq!(channels.to_string(), "images differ in channels: missing [object], unexpected [G]");
        assert!(matches!(difference_image(&expected, &other), Err(ImageError::ChannelMismatch { .. })));

        let mut swapped = Image::new(2, 2).unwrap();
        swapped.push_f32("R", vec![0.0; 4]).unwrap();
        swapped.push_f32("object", vec![0.0; 4]).unwrap();
        let types = compare(&expected, &swapped, 0.0);
        assert!(matches!(types, Err(ImageError::SampleTypeMismatch { name }) if name == "object"));
        assert!(matches!(difference_image(&expected, &swapped), Err(ImageError::SampleTypeMismatch { .. })));

        for tolerance in [-1.0, f32::NAN] {
            let refused = compare(&expected, &expected, tolerance);
            assert!(matches!(refused, Err(ImageError::InvalidTolerance { .. })));
        }
    }

    #[test]
    fn difference_images_hold_distances() {
        let expected = image([1.0, 2.0, f32::INFINITY, f32::NAN], [0, 1, 2, 3]);
        let actual = image([1.5, 1.0, f32::INFINITY, 0.0], [0, 1, 9, 3]);
        let difference = difference_image(&expected, &actual).unwrap();
        assert_eq!(difference.channel("R").unwrap().floats().unwrap(), [0.5, 1.0, 0.0, f32::INFINITY]);
        let Samples::U32(objects) = difference.channel("object").unwrap().samples() else {
            panic!("integers stay integers");
        };
        assert_eq!(objects, &[0, 0, 1, 0]);
    }
}
