//! OpenEXR files: one part of scan lines, ZIP compression, nothing lost.

use std::{
    collections::BTreeSet,
    error::Error,
    fs,
    io::Cursor,
    panic,
    path::{Path, PathBuf},
};

use ::exr::{
    block::{self, BlockIndex, UncompressedBlock, reader::ChunksReader, writer::ChunksWriter},
    math::Vec2,
    meta::{
        BlockDescription,
        attribute::{AttributeValue, ChannelDescription, Compression, LineOrder, SampleType, Text},
        header::{Header, LayerAttributes},
    },
    prelude::f16,
};

#[cfg(feature = "parallel")]
use rayon::prelude::*;

use crate::{Channel, Image, ImageError, Samples, output::replace_file};

type Failure = Box<dyn Error + Send + Sync>;

/// Our attributes carry this before their names, so they never meet one that OpenEXR defines.
const PREFIX: &str = "rayset.";

/// Deflate, the strongest of the lossless compressions, makes at most 1032 bytes of one.
const MOST_BYTES_FROM_ONE: u64 = 1032;

/// Writes an image as one OpenEXR part of scan lines from the top, losslessly compressed in blocks of 16 (ZIP).
///
/// Float channels are stored as 32-bit floats and integer channels as unsigned integers, bit for bit: NaN
/// payloads, infinities and negative zeros come back as they were. Every attribute `name` becomes the string
/// attribute `rayset.name`. Equal images give equal bytes on every host: header attributes are sorted, and no
/// time, host, user or library version is written.
///
/// The file appears whole or not at all; an existing one is replaced. Its blocks are compressed on all threads of the
/// current rayon pool (feature `parallel`), to the same bytes.
///
/// # Errors
///
/// [`ImageError::Encode`] for an image without channels, which the format has no way to express;
/// [`ImageError::Write`] if the disk refuses.
pub fn write_exr(path: &Path, image: &Image) -> Result<(), ImageError> {
    let bytes = encode(image).map_err(|source| ImageError::Encode { path: path.into(), source })?;
    replace_file(path, &bytes).map_err(|source| ImageError::Write { path: path.into(), source })
}

/// Reads an OpenEXR file of one part.
///
/// Scan lines and tiles in any compression the decoder knows are read; of several resolutions the largest is
/// taken. Half floats become the same 32-bit floats. The data window is the image: its position and the display
/// window are ignored. Of the attributes only the strings written by [`write_exr`] are kept.
///
/// The size a file claims is checked before anything is allocated for it, against what its bytes can hold; that
/// also refuses a few honest files, images of one colour in a lossy compression. A file that does not give every
/// pixel exactly once is refused. Malformed files are errors, never panics: a panic of the decoder is caught,
/// although the panic hook still sees it.
///
/// # Errors
///
/// [`ImageError::Read`] if the file cannot be read from the disk; [`ImageError::Decode`] if it is malformed, has
/// several parts, deep or subsampled data, channel names that [`Image::push_f32`] refuses, or sides longer than
/// [`Image::MAX_SIDE`].
pub fn read_exr(path: &Path) -> Result<Image, ImageError> {
    let bytes = fs::read(path).map_err(|source| ImageError::Read { path: path.into(), source })?;
    let decoded = panic::catch_unwind(|| decode(&bytes));
    let decoded = decoded.unwrap_or_else(|_| Err("the decoder gave up on malformed data".into()));
    decoded.map_err(|source| ImageError::Decode { path: PathBuf::from(path), source })
}

fn encode(image: &Image) -> Result<Vec<u8>, Failure> {
    // The format wants channels in the order of their names' bytes.
    let mut channels: Vec<&Channel> = image.channels().iter().collect();
    channels.sort_by_key(|channel| channel.name());
    let descriptions = channels.iter().map(|channel| {
        let sample_type = match channel.samples() {
            Samples::F32(_) => SampleType::F32,
            Samples::U32(_) => SampleType::U32,
        };
        ChannelDescription::named(text(channel.name()), sample_type)
    });
    let attributes = image.attributes().iter().map(|(name, value)| {
        let name = format!("{PREFIX}{name}");
        (text(&name), AttributeValue::Text(text(value)))
    });
    let size = Vec2(image.width() as usize, image.height() as usize);
    let header = Header::new(text(""), size, descriptions.collect())
        .with_encoding(Compression::ZIP16, BlockDescription::ScanLines, LineOrder::Increasing)
        .with_attributes(LayerAttributes { other: attributes.collect(), ..LayerAttributes::default() });

    let mut bytes = Vec::new();
    block::write(Cursor::new(&mut bytes), [header].into_iter().collect(), true, |meta, chunks| {
        let descriptions = &meta.headers[0].channels;
        let compressed = |(place, index): (usize, BlockIndex)| {
            let block = UncompressedBlock::from_lines(descriptions, index, |line| {
                let at = line.location;
                let start = at.position.y() * size.width() + at.position.x();
                let range = start..start + at.sample_count;
                match channels[at.channel].samples() {
                    Samples::F32(samples) => line.write_samples_from_slice(&samples[range]),
                    Samples::U32(samples) => line.write_samples_from_slice(&samples[range]),
                }
                .expect("a line has room for its samples");
            });
            Ok((place, block.compress_to_chunk(&meta.headers)?))
        };
        let blocks: Vec<_> = meta.enumerate_ordered_header_block_indices().collect();
        // Compressing takes nearly all of the time. What comes of a block does not depend on who compresses it.
        #[cfg(feature = "parallel")]
        let blocks = blocks.into_par_iter();
        #[cfg(not(feature = "parallel"))]
        let blocks = blocks.into_iter();
        let blocks: Result<Vec<_>, ::exr::error::Error> = blocks.map(compressed).collect();
        blocks?.into_iter().try_for_each(|(place, chunk)| chunks.write_chunk(place, chunk))
    })?;
    if channels.iter().any(|channel| channel.name().len() > 31) {
        // The encoder looks at attribute names only when it sets the flag for long names: bit 10 of the
        // version, which follows the four bytes of the magic number.
        bytes[5] |= 0b100;
    }
    sort_attributes(&mut bytes).ok_or("the encoder wrote a header we cannot follow")?;
    Ok(bytes)
}

/// Sorts the header attributes by name, in place.
///
/// The encoder keeps custom attributes in a hash map, whose order changes from run to run. Their length does
/// not, so the offsets after the header stay right. Gives `None` if the bytes are no OpenEXR header.
fn sort_attributes(bytes: &mut [u8]) -> Option<()> {
    const START: usize = 8;
    let mut attributes = Vec::new();
    let mut end = START;
    while *bytes.get(end)? != 0 {
        // An attribute is a name and a type, each ended by a zero, a 32-bit length and that many bytes.
        let name = bytes[end..].split(|&byte| byte == 0).next()?;
        let kind = bytes.get(end + name.len() + 1..)?.split(|&byte| byte == 0).next()?;
        let length_at = end + name.len() + 1 + kind.len() + 1;
        let length = u32::from_le_bytes(bytes.get(length_at..length_at + 4)?.try_into().ok()?);
        let next = length_at + 4 + length as usize;
        attributes.push((name.to_vec(), bytes.get(end..next)?.to_vec()));
        end = next;
    }
    attributes.sort();
    let sorted: Vec<u8> = attributes.into_iter().flat_map(|(_, attribute)| attribute).collect();
    bytes[START..end].copy_from_slice(&sorted);
    Some(())
}

fn decode(bytes: &[u8]) -> Result<Image, Failure> {
    let reader = block::read(Cursor::new(bytes), false)?;
    let [header] = reader.headers() else {
        return Err(format!("it has {} parts where one is supported", reader.headers().len()).into());
    };
    let header = header.clone();
    let mut image =
        Image::new(u32::try_from(header.layer_size.width())?, u32::try_from(header.layer_size.height())?)?;
    let claimed = image.pixels() as u64 * header.channels.bytes_per_pixel as u64;
    if claimed / MOST_BYTES_FROM_ONE > bytes.len() as u64 {
        let size = bytes.len();
        return Err(
            format!("it claims {claimed} bytes of pixels, more than its {size} bytes can hold").into()
        );
    }

    let mut planes: Vec<Samples> = (header.channels.list.iter())
        .map(|channel| match channel.sample_type {
            SampleType::F32 | SampleType::F16 => Samples::F32(vec![0.0; image.pixels()]),
            SampleType::U32 => Samples::U32(vec![0; image.pixels()]),
        })
        .collect();
    let mut seen = BTreeSet::new();
    let mut seen_pixels = 0;
    let chunks = reader.filter_chunks(true, |_, _, block| block.level == Vec2(0, 0))?;
    chunks.decompress_sequential(true, |_, block| {
        if block.index.level == Vec2(0, 0)
            && seen.insert((block.index.pixel_position.y(), block.index.pixel_position.x()))
        {
            seen_pixels += block.index.pixel_size.area();
        }
        for line in block.lines(&header.channels) {
            let at = line.location;
            let start = at.position.y() * header.layer_size.width() + at.position.x();
            let range = start..start + at.sample_count;
            let is_half = header.channels.list[at.channel].sample_type == SampleType::F16;
            match &mut planes[at.channel] {
                Samples::F32(samples) if is_half => {
                    for (sample, half) in samples[range].iter_mut().zip(line.read_samples::<f16>()) {
                        *sample = half?.to_f32();
                    }
                }
                Samples::F32(samples) => line.read_samples_into_slice(&mut samples[range])?,
                Samples::U32(samples) => line.read_samples_into_slice(&mut samples[range])?,
            }
        }
        Ok(())
    })?;
    if seen_pixels != image.pixels() {
        return Err("some of its pixels are missing".into());
    }

    for (channel, samples) in header.channels.list.iter().zip(planes) {
        let name = String::from_utf8_lossy(channel.name.bytes());
        match samples {
            Samples::F32(samples) => image.push_f32(name, samples)?,
            Samples::U32(samples) => image.push_u32(name, samples)?,
        }
    }
    for (name, value) in &header.own_attributes.other {
        let name = String::from_utf8_lossy(name.bytes());
        if let (Some(name), AttributeValue::Text(value)) = (name.strip_prefix(PREFIX), value) {
            image.push_attribute(name, String::from_utf8_lossy(value.bytes()))?;
        }
    }
    Ok(image)
}

/// The bytes of a text as they are, so an attribute may hold any UTF-8.
fn text(string: &str) -> Text {
    Text::from_slice_unchecked(string.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample_image() -> Image {
        let mut image = Image::new(5, 37).unwrap();
        let ramp = |step: f32| (0..185_u16).map(|index| f32::from(index) * step).collect::<Vec<f32>>();
        image.push_f32("R", ramp(0.5)).unwrap();
        image.push_f32("G", ramp(-0.25)).unwrap();
        image.push_u32("work.partitions", (0..185).map(|index| index * 12_345_678).collect()).unwrap();
        for name in ["scene", "strategy", "depth", "bundle", "recording", "version"] {
            image.push_attribute(name, format!("{name} \u{3bb} = 2\n")).unwrap();
        }
        image
    }

    fn floats_by_bits(image: &Image, name: &str) -> Vec<u32> {
        image.channel(name).unwrap().floats().unwrap().iter().map(|sample| sample.to_bits()).collect()
    }

    /// The place of the value of a header attribute.
    fn value_of(bytes: &[u8], name_and_type: &[u8]) -> usize {
        let place = bytes.windows(name_and_type.len()).position(|window| window == name_and_type).unwrap();
        place + name_and_type.len() + 4
    }

    #[test]
    #[cfg(feature = "parallel")]
    fn bytes_do_not_depend_on_the_number_of_threads() {
        let image = sample_image();
        let bytes = [1, 2, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| encode(&image)).unwrap()
        });
        assert!(bytes[0] == bytes[1] && bytes[0] == bytes[2]);
    }

    #[test]
    fn special_floats_survive_by_bits() {
        let bits = [
            0x7fc0_0001_u32,
            0xffc1_2345,
            0x7f80_0001,
            0xff80_0000,
            0x7f80_0000,
            0x8000_0000,
            0,
            1,
            0x807f_ffff,
        ];
        let mut image = Image::new(9, 1).unwrap();
        image.push_f32("depth", bits.iter().map(|&bits| f32::from_bits(bits)).collect()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("special.exr");
        write_exr(&path, &image).unwrap();
        assert_eq!(floats_by_bits(&read_exr(&path).unwrap(), "depth"), bits);
    }

    #[test]
    fn names_types_and_attributes_survive() {
        let mut image = sample_image();
        let long = format!("layer.{}", "n".repeat(249));
        image.push_u32(long.as_str(), vec![u32::MAX; 185]).unwrap();
        let bytes = encode(&image).unwrap();
        assert_eq!(bytes[4..8], [2, 0b100, 0, 0], "version 2 with the flag for long names");
        assert_eq!(encode(&sample_image()).unwrap()[4..8], [2, 0, 0, 0]);
        let read = decode(&bytes).unwrap();
        assert_eq!(read.attributes(), image.attributes());
        assert_eq!(floats_by_bits(&read, "G"), floats_by_bits(&image, "G"));
        let names = |image: &Image| -> Vec<String> {
            image.channels().iter().map(|channel| channel.name().to_owned()).collect()
        };
        assert_eq!(names(&read), ["R", "G", long.as_str(), "work.partitions"]);
        assert_eq!(names(&read), names(&image));
        assert!(matches!(read.channel(&long).unwrap().samples(), Samples::U32(_)));
    }

    #[test]
    fn equal_images_give_equal_bytes() {
        let first = encode(&sample_image()).unwrap();
        // Six attributes have 720 orders, so chance would show in a few tries.
        for _ in 0..20 {
            assert!(encode(&sample_image()).unwrap() == first);
        }
        let in_header: Vec<usize> = (["bundle", "depth", "recording", "scene", "strategy", "version"].iter())
            .map(|name| value_of(&first, format!("rayset.{name}\0string\0").as_bytes()))
            .collect();
        assert!(in_header.is_sorted());
    }

    #[test]
    fn files_are_zip_scan_lines_from_the_top_without_stamps() {
        let bytes = encode(&sample_image()).unwrap();
        assert_eq!(
            bytes[value_of(&bytes, b"compression\0compression\0")],
            3,
            "ZIP in blocks of 16 is code 3"
        );
        assert_eq!(bytes[value_of(&bytes, b"lineOrder\0lineOrder\0")], 0, "increasing is code 0");
        for stamp in ["capDate", "utcOffset", "owner", "software", "comments"] {
            let found = bytes.windows(stamp.len()).any(|window| window == stamp.as_bytes());
            assert!(!found, "{stamp}");
        }
        // The first block starts at the row of y = 0.
        let reader = block::read(Cursor::new(&bytes), true).unwrap();
        assert_eq!(reader.headers()[0].layer_size, Vec2(5, 37));
    }

    #[test]
    fn truncated_files_are_errors() {
        let bytes = encode(&sample_image()).unwrap();
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
        }
    }

    #[test]
    fn flipped_bits_never_panic_the_reader() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flipped.exr");
        let bytes = encode(&sample_image()).unwrap();
        for place in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[place] ^= 1 << (place % 8);
            fs::write(&path, &flipped).unwrap();
            if let Ok(image) = read_exr(&path) {
                assert!(image.channels().iter().all(|channel| channel.samples().len() == image.pixels()));
            }
        }
    }

    #[test]
    fn a_claimed_size_is_checked_before_allocating() {
        let bytes = encode(&sample_image()).unwrap();
        let window = value_of(&bytes, b"dataWindow\0box2i\0");
        let count = value_of(&bytes, b"chunkCount\0int\0");
        let claim = |x_max: i32, y_max: i32| {
            let mut claiming = bytes.clone();
            claiming[count..count + 4].copy_from_slice(&(y_max / 16 + 1).to_le_bytes());
            claiming[window + 8..window + 12].copy_from_slice(&x_max.to_le_bytes());
            claiming[window + 12..window + 16].copy_from_slice(&y_max.to_le_bytes());
            decode(&claiming).unwrap_err().to_string()
        };
        let error = claim(65_534, 65_534);
        assert!(error.starts_with("it claims 51538034700 bytes of pixels"), "{error}");
        let error = claim(65_535, 36);
        assert!(error.contains("65536 x 37 pixels is not supported"), "{error}");
        let error = claim(1_000_000_000, 1_000_000_000);
        assert!(error.contains("not supported"), "{error}");
    }

    #[test]
    fn hostile_attributes_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hostile.exr");
        let bytes = encode(&sample_image()).unwrap();
        let with_attribute = |name_and_type: &[u8], length: i32, value: &[u8]| {
            let attribute = [name_and_type, &length.to_le_bytes(), value].concat();
            fs::write(&path, [&bytes[..8], &attribute, &bytes[8..]].concat()).unwrap();
            read_exr(&path).unwrap_err()
        };
        let all = [0xff; 8];
        // The byte count of a preview of 2^31 - 1 squared pixels, or of more, overflows.
        let large = [i32::MAX.to_le_bytes(), i32::MAX.to_le_bytes()].concat();
        for value in [&all, large.as_slice()] {
            with_attribute(b"preview\0preview\0", 8, value);
        }
        for length in [i32::MAX, i32::MIN, -1, 1_000_000] {
            with_attribute(b"rayset.a\0string\0", length, b"a");
            with_attribute(b"a\0unknown\0", length, b"a");
            with_attribute(b"multiView\0stringvector\0", length, &all);
        }
        let tiles = [0, 0, 0, 0, 0, 0, 0, 0, 0];
        with_attribute(b"tiles\0tiledesc\0", 9, &tiles);
    }

    #[test]
    fn a_block_stored_twice_is_an_error() {
        let mut bytes = encode(&sample_image()).unwrap();
        let reader = block::read(Cursor::new(&bytes), true).unwrap();
        assert_eq!(reader.headers()[0].chunk_count, 3);
        // The second of three blocks says it starts at row 0 instead of 16.
        let second = bytes.windows(4).rposition(|window| window == 16_i32.to_le_bytes()).unwrap();
        bytes[second..second + 4].copy_from_slice(&0_i32.to_le_bytes());
        assert_eq!(decode(&bytes).unwrap_err().to_string(), "some of its pixels are missing");
    }

    #[test]
    fn half_floats_become_floats() {
        use ::exr::{image::AnyChannel, prelude::*};
        let halves = [1.5, -2.0, 65_504.0, 0.0].map(f16::from_f32).to_vec();
        let channel = AnyChannel::new("Y", FlatSamples::F16(halves));
        let encoding = Encoding { compression: Compression::PIZ, ..Encoding::SMALL_FAST_LOSSLESS };
        let layer = Layer::new(
            (2, 2),
            LayerAttributes::named("main"),
            encoding,
            AnyChannels::sort([channel].into_iter().collect()),
        );
        let mut bytes = Vec::new();
        ::exr::image::Image::from_layer(layer).write().to_buffered(Cursor::new(&mut bytes)).unwrap();
        let image = decode(&bytes).unwrap();
        assert_eq!(image.channel("Y").unwrap().floats().unwrap(), [1.5, -2.0, 65_504.0, 0.0]);
    }

    #[test]
    fn an_image_without_channels_is_refused_before_anything_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("empty.exr");
        let refused = write_exr(&path, &Image::new(2, 2).unwrap());
        assert!(matches!(refused, Err(ImageError::Encode { .. })));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn errors_name_the_file_and_keep_their_source() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("absent.exr");
        let error = read_exr(&path).unwrap_err();
        assert_eq!(error.to_string(), format!("cannot read `{}`", path.display()));
        assert!(error.source().unwrap().is::<std::io::Error>());
        fs::write(&path, b"no image").unwrap();
        let error = read_exr(&path).unwrap_err();
        assert_eq!(error.to_string(), format!("cannot decode `{}`", path.display()));
        assert!(error.source().is_some());
    }
}
