//! Properties of images over arbitrary sizes, names and bit patterns.

use proptest::{collection::vec, prelude::*};
use rayset_image::{Image, compare, difference_image, false_colour};

/// An image of up to three float and two integer channels, samples of any bits.
fn images() -> impl Strategy<Value = Image> {
    (1..40_u32, 1..40_u32, 0..4_usize, 0..3_usize)
        .prop_filter("a file needs a channel", |(_, _, floats, integers)| floats + integers > 0)
        .prop_flat_map(|(width, height, floats, integers)| {
            let pixels = (width * height) as usize;
            (Just((width, height, floats)), vec(planes(pixels), floats + integers))
        })
        .prop_map(|((width, height, floats), planes)| {
            let mut image = Image::new(width, height).unwrap();
            for (number, plane) in planes.into_iter().enumerate() {
                if number < floats {
                    let name = ["B", "normal.Y", "a layer with a name longer than 31 bytes.Z"][number];
                    image.push_f32(name, plane.into_iter().map(f32::from_bits).collect()).unwrap();
                } else {
                    image.push_u32(["object", "work.tests"][number - floats], plane).unwrap();
                }
            }
            image
        })
}

/// Samples of any bits, or of few values, which compress well.
fn planes(pixels: usize) -> impl Strategy<Value = Vec<u32>> {
    let special = prop_oneof![
        Just(0),
        Just(0x8000_0000),
        Just(0x7f80_0000),
        Just(0xff80_0000),
        Just(0x7fc0_0001),
        Just(0x7f80_0001),
        Just(0x3f80_0000)
    ];
    prop_oneof![vec(any::<u32>(), pixels), vec(special, pixels)]
}

proptest! {
    #[test]
    fn an_image_is_identical_to_itself(image in images()) {
        let comparison = compare(&image, &image, 0.0).unwrap();
        prop_assert!(comparison.is_identical() && comparison.is_within_tolerance());
        prop_assert_eq!(comparison.max_abs.to_bits(), 0);
        prop_assert_eq!(comparison.mean_abs.to_bits(), 0);
        prop_assert_eq!(comparison.rmse.to_bits(), 0);
        prop_assert!(comparison.first_difference.is_none());
        let difference = difference_image(&image, &image).unwrap();
        let blank = difference_image(&difference, &difference).unwrap();
        prop_assert!(compare(&difference, &blank, 0.0).unwrap().is_identical());
    }

    #[test]
    fn one_changed_sample_is_found(image in images(), place in any::<prop::sample::Index>(), bit in 0..32_u32) {
        let mut changed = Image::new(image.width(), image.height()).unwrap();
        let pixel = place.index(image.pixels());
        let target = image.channels()[0].name();
        for channel in image.channels() {
            let flip = |index: usize| u32::from(index == pixel && channel.name() == target) << bit;
            match channel.samples() {
                rayset_image::Samples::F32(samples) => {
                    let bits = samples.iter().enumerate().map(|(index, sample)| sample.to_bits() ^ flip(index));
                    changed.push_f32(channel.name(), bits.map(f32::from_bits).collect()).unwrap();
                }
                rayset_image::Samples::U32(samples) => {
                    let bits = samples.iter().enumerate().map(|(index, sample)| sample ^ flip(index));
                    changed.push_u32(channel.name(), bits.collect()).unwrap();
                }
            }
        }
        let comparison = compare(&image, &changed, 0.0).unwrap();
        prop_assert_eq!(comparison.differing_pixels, 1);
        let first = comparison.first_difference.unwrap();
        prop_assert_eq!((first.y * image.width() + first.x) as usize, pixel);
        prop_assert_eq!(first.channel.as_str(), target);
    }

    #[test]
    fn summaries_have_a_line_a_block_row(image in images(), columns in 0..50_u32, rows in 0..50_u32) {
        let summary = image.summary(columns, rows);
        let floats = image.channels().iter().filter(|channel| channel.floats().is_ok()).count();
        let expected = 1 + image.channels().len() + floats * rows.clamp(1, image.height()) as usize;
        prop_assert_eq!(summary.lines().count(), expected);
    }

    #[test]
    fn every_value_has_a_colour(bits in vec(any::<u32>(), 1..50)) {
        let values: Vec<f32> = bits.into_iter().map(f32::from_bits).collect();
        prop_assert_eq!(false_colour(&values).len(), values.len());
    }
}

#[cfg(feature = "exr")]
mod files {
    use std::fs;

    use rayset_image::{ImageError, read_exr, write_exr};

    use super::*;

    proptest! {
        #[test]
        fn exr_files_lose_nothing(image in images(), value in any::<String>()) {
            let mut image = image;
            image.push_attribute("scene", value).unwrap();
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("image.exr");
            write_exr(&path, &image).unwrap();
            let read = read_exr(&path).unwrap();
            prop_assert!(compare(&image, &read, 0.0).unwrap().is_identical());
            prop_assert_eq!(read.attributes(), image.attributes());
            prop_assert_eq!(read.summary(3, 3), image.summary(3, 3));
            let first = fs::read(&path).unwrap();
            write_exr(&path, &read).unwrap();
            prop_assert!(fs::read(&path).unwrap() == first, "a second write gives other bytes");
        }

        #[test]
        fn mutated_files_never_panic_the_reader(
            image in images(),
            mutations in vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
            keep in any::<prop::sample::Index>(),
            truncate in any::<bool>(),
        ) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("image.exr");
            write_exr(&path, &image).unwrap();
            let mut bytes = fs::read(&path).unwrap();
            // Half of the mutations fall into the header, where they do most harm.
            for (number, (place, value)) in mutations.into_iter().enumerate() {
                let reach = if number % 2 == 0 { bytes.len() } else { bytes.len().min(400) };
                bytes[place.index(reach)] = value;
            }
            if truncate {
                bytes.truncate(keep.index(bytes.len()));
            }
            fs::write(&path, &bytes).unwrap();
            match read_exr(&path) {
                Ok(read) => prop_assert!(read.channels().iter().all(|channel| channel.samples().len() == read.pixels())),
                Err(ImageError::Decode { .. }) => {}
                Err(error) => prop_assert!(false, "{}", error),
            }
        }

        #[test]
        fn arbitrary_bytes_never_panic_the_reader(bytes in vec(any::<u8>(), 0..600), magic in any::<bool>()) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("image.exr");
            let start: &[u8] = if magic { &[0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0] } else { &[] };
            fs::write(&path, [start, &bytes].concat()).unwrap();
            prop_assert!(matches!(read_exr(&path), Err(ImageError::Decode { .. })), "nonsense was read");
        }
    }
}
