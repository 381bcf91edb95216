//! PNG files for looking at, and the steps from linear radiance to bytes.

use std::path::Path;
use std::sync::OnceLock;

use ::image::{ExtendedColorType, ImageEncoder as _, codecs::png::PngEncoder};

use crate::{Image, ImageError, false_colour, output::replace_file, unit_values};

/// Writes 8-bit colours as a PNG; row-major from the top.
///
/// Equal pixels give equal bytes; no time, host or user is written.
/// The file appears whole or not at all; an existing one is replaced.
///
/// # Errors
///
/// [`ImageError::InvalidSize`] if a side is 0 or longer than [`Image::MAX_SIDE`], [`ImageError::PixelCount`] if
/// there is not one colour a pixel, and [`ImageError::Write`] if the disk refuses.
pub fn write_png_rgb8(path: &Path, width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<(), ImageError> {
    let bytes = png_bytes(path, width, height, pixels)?;
    replace_file(path, &bytes).map_err(|source| ImageError::Write { path: path.into(), source })
}

/// 8-bit colours as the bytes of a PNG, for a file that holds others; row-major from the top.
///
/// `name` stands for the path in errors.
///
/// # Errors
///
/// Those of [`write_png_rgb8`] but [`ImageError::Write`].
pub fn png_rgb8(name: &str, width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<Vec<u8>, ImageError> {
    png_bytes(Path::new(name), width, height, pixels)
}

fn png_bytes(path: &Path, width: u32, height: u32, pixels: &[[u8; 3]]) -> Result<Vec<u8>, ImageError> {
    let actual = pixels.len();
    if actual != Image::new(width, height)?.pixels() {
        return Err(ImageError::PixelCount { path: path.into(), width, height, actual });
    }
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(pixels.as_flattened(), width, height, ExtendedColorType::Rgb8)
        .map_err(|error| ImageError::Encode { path: path.into(), source: Box::new(error) })?;
    Ok(bytes)
}

/// Writes one channel as a PNG in the colours of [`false_colour`], the range from `low` to `high` spread over the
/// whole map as in [`unit_values`].
///
/// # Errors
///
/// [`ImageError::MissingChannel`], or those of [`write_png_rgb8`].
pub fn write_false_colour_png(
    path: &Path,
    image: &Image,
    channel: &str,
    low: f32,
    high: f32,
) -> Result<(), ImageError> {
    let plane =
        image.channel(channel).ok_or_else(|| ImageError::MissingChannel { name: channel.to_owned() })?;
    let colours = false_colour(&unit_values(plane.samples(), low, high));
    write_png_rgb8(path, image.width(), image.height(), &colours)
}

/// The beauty of an image, its channels `R`, `G` and `B`, as sRGB bytes.
///
/// Each sample goes through these steps, in `f64`:
/// 1. multiply by `2^exposure_ev`;
/// 2. clamp to 0 to 1; NaN becomes 0, and so does the product of an infinity and a zero;
/// 3. the sRGB transfer: `12.92 v` up to `v = 0.0031308`, above it `1.055 v^(1 / 2.4) - 0.055`;
/// 4. multiply by 255 and round half up: `floor(255 s + 0.5)`.
///
/// The powers are computed in software, so the bytes are the same on every host.
///
/// Source: IEC 61966-2-1 (sRGB).
///
/// # Errors
///
/// [`ImageError::MissingChannel`] if one of the three channels is absent, [`ImageError::NotFloat`] if one holds
/// integers.
pub fn to_srgb8(image: &Image, exposure_ev: f64) -> Result<Vec<[u8; 3]>, ImageError> {
    let scale = libm::exp2(exposure_ev);
    let plane = |name: &str| {
        let missing = || ImageError::MissingChannel { name: name.to_owned() };
        image.channel(name).ok_or_else(missing)?.floats()
    };
    let (red, green, blue) = (plane("R")?, plane("G")?, plane("B")?);
    let steps = SrgbSteps::get();
    let byte = |sample: f32| steps.byte(f64::from(sample) * scale);
    Ok(red
        .iter()
        .zip(green)
        .zip(blue)
        .map(|((&red, &green), &blue)| [byte(red), byte(green), byte(blue)])
        .collect())
}

/// Where the transfer goes from one byte to the next: a look instead of a power a sample.
struct SrgbSteps {
    /// The least numbers that become 1, 2, ... 255.
    least: [f64; 255],
    /// How many of them are no greater than the beginning of each of equal parts of the range.
    passed: [u8; PARTS],
}

/// So many that hardly two steps lie in one.
const PARTS: usize = 4096;

impl SrgbSteps {
    fn get() -> &'static Self {
        static STEPS: OnceLock<SrgbSteps> = OnceLock::new();
        STEPS.get_or_init(|| {
            let least = std::array::from_fn(|i| {
                // Numbers that are not negative are ordered as their bits are.
                let (mut below, mut above) = (0, 1.0_f64.to_bits());
                while above - below > 1 {
                    let middle = below + (above - below) / 2;
                    let is_passed = usize::from(srgb_byte(f64::from_bits(middle))) > i;
                    (below, above) = if is_passed { (below, middle) } else { (middle, above) };
                }
                f64::from_bits(above)
            });
            let passed = |part: usize| {
                let begin = part as f64 / PARTS as f64;
                u8::try_from(least.iter().filter(|&&least: &&f64| least <= begin).count()).unwrap_or(u8::MAX)
            };
            Self { least, passed: std::array::from_fn(passed) }
        })
    }

    /// The byte of a number.
    fn byte(&self, linear: f64) -> u8 {
        // NaN is not above zero.
        let linear = if linear > 0.0 { linear.min(1.0) } else { 0.0 };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "from 0 to the number of parts"
        )]
        let part = ((linear * PARTS as f64) as usize).min(PARTS - 1);
        let mut byte = self.passed[part];
        while self.least.get(usize::from(byte)).is_some_and(|&least| least <= linear) {
            byte += 1;
        }
        byte
    }
}

fn srgb_byte(linear: f64) -> u8 {
    let encoded =
        if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 };
    #[expect(
        clippy::cast_possible_truncation,
        reason = "from 0 to 255, and casting down rounds as floor does"
    )]
    let byte = (255.0 * encoded + 0.5) as u8;
    byte
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn grey(samples: &[f32]) -> Image {
        let mut image = Image::new(u32::try_from(samples.len()).unwrap(), 1).unwrap();
        for name in ["R", "G", "B"] {
            image.push_f32(name, samples.to_vec()).unwrap();
        }
        image
    }

    #[test]
    fn srgb_bytes_match_the_standard() {
        // 0.18: 1.055 * 0.18^(1 / 2.4) - 0.055 = 0.46136, times 255 = 117.65. 0.002: 12.92 * 0.002 * 255 = 6.59.
        // 0.0031308 is the end of the straight part: 10.31. 0.5: 0.73536 * 255 = 187.52.
        let bytes = to_srgb8(&grey(&[0.0, 0.002, 0.003_130_8, 0.18, 0.5, 1.0]), 0.0).unwrap();
        assert_eq!(bytes, [0, 7, 10, 118, 188, 255].map(|byte| [byte; 3]));
    }

    #[test]
    fn out_of_range_samples_are_clamped_and_nan_is_black() {
        let samples = [-1.0, 2.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, -0.0];
        let bytes = to_srgb8(&grey(&samples), 0.0).unwrap();
        assert_eq!(bytes, [0, 255, 255, 0, 0, 0].map(|byte| [byte; 3]));
        let darkened = to_srgb8(&grey(&[f32::INFINITY]), f64::NEG_INFINITY).unwrap();
        assert_eq!(darkened, [[0; 3]]);
    }

    #[test]
    fn exposure_is_a_power_of_two_before_the_transfer() {
        let image = grey(&[0.25, 0.125]);
        assert_eq!(to_srgb8(&image, 1.0).unwrap(), to_srgb8(&grey(&[0.5, 0.25]), 0.0).unwrap());
        assert_eq!(to_srgb8(&image, -2.0).unwrap(), to_srgb8(&grey(&[0.0625, 0.03125]), 0.0).unwrap());
    }

    #[test]
    fn every_byte_is_the_byte_nearest_to_its_own_colour() {
        // The inverse transfer at byte / 255 must come back as that byte.
        for byte in 0..=255_u8 {
            let encoded = f64::from(byte) / 255.0;
            let linear =
                if encoded <= 0.040_45 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) };
            assert_eq!(srgb_byte(linear), byte);
        }
        let mut last = 0;
        for step in 0..=100_000_u32 {
            let byte = srgb_byte(f64::from(step) / 100_000.0);
            assert!(byte >= last);
            last = byte;
        }
    }

    #[test]
    fn steps_are_those_of_the_transfer() {
        let steps = SrgbSteps::get();
        for step in 0..=1_000_000_u32 {
            let linear = f64::from(step) / 1_000_000.0;
            assert_eq!(steps.byte(linear), srgb_byte(linear), "{linear}");
        }
        for &least in &steps.least {
            for linear in [least.next_down(), least, least.next_up().min(1.0)] {
                assert_eq!(steps.byte(linear), srgb_byte(linear), "{linear}");
            }
        }
    }

    #[test]
    fn beauty_needs_three_float_channels() {
        let mut image = Image::new(1, 1).unwrap();
        image.push_f32("R", vec![0.0]).unwrap();
        image.push_u32("G", vec![0]).unwrap();
        assert!(matches!(to_srgb8(&image, 0.0), Err(ImageError::NotFloat { name }) if name == "G"));
        let missing = Image::new(1, 1).unwrap();
        assert!(matches!(to_srgb8(&missing, 0.0), Err(ImageError::MissingChannel { name }) if name == "R"));
    }

    #[test]
    fn png_pixels_come_back_as_they_were() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("colours.png");
        let pixels = [[1, 2, 3], [4, 5, 6], [255, 0, 128], [7, 7, 7], [0, 0, 0], [9, 8, 7]];
        write_png_rgb8(&path, 3, 2, &pixels).unwrap();
        let first = fs::read(&path).unwrap();
        let decoded = ::image::load_from_memory(&first).unwrap().into_rgb8();
        assert_eq!(decoded.dimensions(), (3, 2));
        assert_eq!(decoded.into_raw(), pixels.as_flattened());
        write_png_rgb8(&path, 3, 2, &pixels).unwrap();
        assert!(fs::read(&path).unwrap() == first);
    }

    #[test]
    fn false_colour_files_hold_the_colours_of_the_map() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("work.png");
        let mut image = Image::new(3, 1).unwrap();
        image.push_u32("work", vec![10, 15, 20]).unwrap();
        write_false_colour_png(&path, &image, "work", 10.0, 20.0).unwrap();
        let decoded = ::image::open(&path).unwrap().into_rgb8();
        assert_eq!(decoded.into_raw(), false_colour(&[0.0, 0.5, 1.0]).as_flattened());
        let missing = write_false_colour_png(&path, &image, "play", 0.0, 1.0);
        assert!(matches!(missing, Err(ImageError::MissingChannel { name }) if name == "play"));
    }

    #[test]
    fn a_refused_png_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("colours.png");
        let short = write_png_rgb8(&path, 3, 2, &[[0; 3]; 5]);
        assert!(matches!(short, Err(ImageError::PixelCount { actual: 5, .. })));
        assert!(matches!(write_png_rgb8(&path, 0, 2, &[]), Err(ImageError::InvalidSize { .. })));
        let nowhere = write_png_rgb8(&folder.path().join("absent/colours.png"), 1, 1, &[[0; 3]]);
        assert!(matches!(nowhere, Err(ImageError::Write { .. })));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
