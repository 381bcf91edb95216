//! Layers, which are channels grouped by name, and their display in false colour.

use crate::{Channel, Image, Samples};

/// The channels of an image that share the part of their names before the last dot.
#[derive(Clone, Debug)]
pub struct Layer<'image> {
    /// The shared part; empty for the layer of the plain channels.
    pub name: &'image str,
    /// The channels in canonical order, at least one.
    pub channels: Vec<&'image Channel>,
}

impl Image {
    /// The layers in canonical order, so the layer of the plain channels comes first.
    #[must_use]
    pub fn layers(&self) -> Vec<Layer<'_>> {
        self.channels()
            .chunk_by(|one, next| one.layer_name() == next.layer_name())
            .map(|channels| Layer { name: channels[0].layer_name(), channels: channels.iter().collect() })
            .collect()
    }

    /// The names of [`Image::layers`]; the layer of the plain channels is the empty name.
    #[must_use]
    pub fn layer_names(&self) -> Vec<&str> {
        self.layers().iter().map(|layer| layer.name).collect()
    }

    /// The layer of this name: its channels `name.*`, or else the plain channel `name` by itself.
    ///
    /// The empty name gives all plain channels.
    #[must_use]
    pub fn layer(&self, name: &str) -> Option<Layer<'_>> {
        let grouped = self.layers().into_iter().find(|layer| layer.name == name);
        grouped.or_else(|| {
            let channel = self.channel(name)?;
            channel.layer_name().is_empty().then(|| Layer { name: channel.name(), channels: vec![channel] })
        })
    }
}

/// Colours for values from 0 to 1, from dark violet over green to yellow.
///
/// The map is viridis: lightness grows evenly with the value, and it reads the same with the common kinds of
/// colour blindness. Values outside 0 to 1 take the colour of the nearer end; NaN is the neutral grey
/// `[128, 128, 128]`, which the map does not contain.
/// Colours between two entries of the table are interpolated linearly and rounded half up.
///
/// Source: viridis by S. van der Walt and N. Smith, 20 evenly spaced entries.
#[must_use]
pub fn false_colour(values: &[f32]) -> Vec<[u8; 3]> {
    values.iter().map(|&value| viridis(value)).collect()
}

/// Moves the range from `low` to `high` onto 0 to 1, for [`false_colour`].
///
/// Values outside the range land outside 0 to 1 and NaN stays NaN.
/// A range without extent (`high` not above `low`) gives 0 up to `low` and 1 above it.
#[must_use]
pub fn unit_values(samples: &Samples, low: f32, high: f32) -> Vec<f32> {
    let (low, high) = (f64::from(low), f64::from(high));
    let unit = |value: f64| {
        if high > low {
            (value - low) / (high - low)
        } else if value.is_nan() {
            value
        } else {
            f64::from(u8::from(value > low))
        }
    };
    #[expect(clippy::cast_possible_truncation, reason = "the nearest f32 is what a colour needs")]
    match samples {
        Samples::F32(samples) => samples.iter().map(|&sample| unit(f64::from(sample)) as f32).collect(),
        Samples::U32(samples) => samples.iter().map(|&sample| unit(f64::from(sample)) as f32).collect(),
    }
}

const NAN_COLOUR: [u8; 3] = [128, 128, 128];

const VIRIDIS: [[u8; 3]; 20] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x15, 0x68],
    [0x48, 0x26, 0x77],
    [0x45, 0x37, 0x81],
    [0x3f, 0x47, 0x88],
    [0x39, 0x55, 0x8c],
    [0x32, 0x64, 0x8e],
    [0x2d, 0x71, 0x8e],
    [0x28, 0x7d, 0x8e],
    [0x23, 0x8a, 0x8d],
    [0x1f, 0x96, 0x8b],
    [0x20, 0xa3, 0x86],
    [0x29, 0xaf, 0x7f],
    [0x3c, 0xbc, 0x75],
    [0x56, 0xc6, 0x67],
    [0x74, 0xd0, 0x55],
    [0x94, 0xd8, 0x40],
    [0xb8, 0xde, 0x29],
    [0xdc, 0xe3, 0x18],
    [0xfd, 0xe7, 0x25],
];

fn viridis(value: f32) -> [u8; 3] {
    if value.is_nan() {
        return NAN_COLOUR;
    }
    let place = f64::from(value.clamp(0.0, 1.0)) * 19.0;
    #[expect(clippy::cast_possible_truncation, reason = "from 0 to 19")]
    let below = (place as usize).min(18);
    let fraction = place - f64::from(u8::try_from(below).unwrap_or(18));
    std::array::from_fn(|component| {
        let [from, to] = [below, below + 1].map(|entry| f64::from(VIRIDIS[entry][component]));
        #[expect(clippy::cast_possible_truncation, reason = "between two bytes")]
        let byte = (from + (to - from) * fraction + 0.5) as u8;
        byte
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_grouped_before_their_last_dot() {
        let mut image = Image::new(1, 1).unwrap();
        for name in ["normal.Y", "R", "depth", "normal.X", "light.key.R"] {
            image.push_f32(name, vec![0.0]).unwrap();
        }
        assert_eq!(image.layer_names(), ["", "light.key", "normal"]);
        let members = |name: &str| -> Option<Vec<&str>> {
            Some(image.layer(name)?.channels.iter().map(|channel| channel.name()).collect())
        };
        assert_eq!(members("").unwrap(), ["R", "depth"]);
        assert_eq!(members("normal").unwrap(), ["normal.X", "normal.Y"]);
        assert_eq!(members("depth").unwrap(), ["depth"]);
        assert_eq!(members("light.key").unwrap(), ["light.key.R"]);
        assert!(members("normal.X").is_none() && members("light").is_none());
        assert!(Image::new(1, 1).unwrap().layers().is_empty());
    }

    #[test]
    fn false_colour_ends_at_the_ends_of_the_table() {
        let colours = false_colour(&[0.0, 1.0, -3.0, 7.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, -0.0]);
        let (violet, yellow) = ([0x44, 0x01, 0x54], [0xfd, 0xe7, 0x25]);
        assert_eq!(colours, [violet, yellow, violet, yellow, yellow, violet, [128; 3], violet]);
    }

    #[test]
    fn false_colour_interpolates_between_entries() {
        // Half way between entries 9 and 10: (0x23 + 0x1f) / 2 = 0x21, (0x8a + 0x96) / 2 = 0x90, and
        // (0x8d + 0x8b) / 2 = 0x8c.
        assert_eq!(false_colour(&[0.5]), [[0x21, 0x90, 0x8c]]);
        // 0.25 is three quarters of the way from entry 4 to 5: 58.5, 81.5 and 139, rounded half up.
        assert_eq!(false_colour(&[0.25]), [[59, 82, 139]]);
    }

    #[test]
    fn false_colour_grows_lighter_with_the_value() {
        let steps: Vec<f32> = (0..=1000_u16).map(|step| f32::from(step) / 1000.0).collect();
        // Relative luminance of the linearised bytes, in ten thousandths.
        let linear = |byte: u8| {
            let byte = u64::from(byte);
            byte * byte
        };
        let luminances: Vec<u64> = false_colour(&steps)
            .iter()
            .map(|[red, green, blue]| 2126 * linear(*red) + 7152 * linear(*green) + 722 * linear(*blue))
            .collect();
        let mut lightest = 0;
        for (step, luminance) in luminances.iter().enumerate() {
            // One byte of rounding in blue may undo a step; nothing more.
            assert!(luminance + 722 * 512 >= lightest, "darker at step {step}");
            lightest = lightest.max(*luminance);
        }
        assert!(luminances[1000] > 20 * luminances[0]);
    }

    #[test]
    fn ranges_are_moved_onto_the_unit() {
        let floats = Samples::F32(vec![2.0, 3.0, 4.0, 6.0]);
        assert_eq!(unit_values(&floats, 2.0, 4.0), [0.0, 0.5, 1.0, 2.0]);
        let counts = Samples::U32(vec![0, 5, 10]);
        assert_eq!(unit_values(&counts, 0.0, 10.0), [0.0, 0.5, 1.0]);
        assert_eq!(unit_values(&counts, 5.0, 5.0), [0.0, 0.0, 1.0]);
        let extreme = Samples::F32(vec![f32::MAX, f32::NAN]);
        let moved = unit_values(&extreme, f32::MIN, f32::MAX);
        assert_eq!(moved[0].to_bits(), 1.0_f32.to_bits());
        assert!(moved[1].is_nan());
        assert!(unit_values(&extreme, 1.0, 1.0)[1].is_nan());
    }
}
