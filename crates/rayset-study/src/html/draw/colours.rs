//! Colours that readers tell apart, whatever kind of colour blindness they have.

use plotters::style::RGBColor;
use rayset_image::false_colour;

/// What a colour stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::html) enum Scale {
    /// From 0 to 100 percent: viridis.
    Percent,
    /// Ratios, from one over the greatest to the greatest, over logarithms: blue below 1, white at 1, red above.
    Ratio {
        /// The base-2 logarithm of the greatest.
        octaves: f64,
    },
}

/// Nine of `RdBu`, from blue to red, which colour-blind readers tell apart.
///
/// Source: Brewer, `ColorBrewer` 2.0.
const BLUE_TO_RED: [[u8; 3]; 9] = [
    [33, 102, 172],
    [67, 147, 195],
    [146, 197, 222],
    [209, 229, 240],
    [247, 247, 247],
    [253, 219, 199],
    [244, 165, 130],
    [214, 96, 77],
    [178, 24, 43],
];

/// Okabe and Ito's colours, without those that are too light for lines.
const OF_DATA: [[u8; 3]; N_COLOURS] =
    [[230, 159, 0], [213, 94, 0], [0, 158, 115], [204, 121, 167], [0, 114, 178], [86, 180, 233]];

/// How many colours of data there are.
pub(super) const N_COLOURS: usize = 6;

/// A colour for a curve or a kind of point, by its number.
pub(in crate::html) fn data_colour(number: usize) -> RGBColor {
    let [red, green, blue] = OF_DATA[number % OF_DATA.len()];
    RGBColor(red, green, blue)
}

impl Scale {
    /// A scale of ratios that has room for some.
    pub(in crate::html) fn of_ratios(ratios: impl Iterator<Item = f64>) -> Self {
        let greatest = ratios.map(|ratio| ratio.log2().abs()).filter(|octaves| octaves.is_finite());
        // Half octaves; no more than four octaves, so that one odd ratio does not pale all others.
        let octaves = (2.0 * greatest.fold(0.0, f64::max)).ceil() / 2.0;
        Self::Ratio { octaves: octaves.clamp(0.5, 4.0) }
    }

    /// Where a value lies between the ends, from 0 to 1.
    pub(super) fn unit(self, value: f64) -> f64 {
        match self {
            Self::Percent => value / 100.0,
            Self::Ratio { octaves } => f64::midpoint(value.log2() / octaves, 1.0),
        }
        .clamp(0.0, 1.0)
    }

    pub(super) fn colour(self, value: f64) -> RGBColor {
        let unit = self.unit(value);
        #[expect(clippy::cast_possible_truncation, reason = "the nearest f32 is what a colour needs")]
        let [red, green, blue] = match self {
            Self::Percent => false_colour(&[unit as f32])[0],
            Self::Ratio { .. } => between(unit),
        };
        RGBColor(red, green, blue)
    }

    /// The value at a place from 0 to 1.
    pub(super) fn value(self, unit: f64) -> f64 {
        match self {
            Self::Percent => 100.0 * unit,
            Self::Ratio { octaves } => (octaves * (2.0 * unit - 1.0)).exp2(),
        }
    }

    /// Values to write beside the scale.
    pub(super) fn marks(self) -> Vec<f64> {
        match self {
            Self::Percent => vec![0.0, 25.0, 50.0, 75.0, 100.0],
            Self::Ratio { octaves } => {
                (-4..=4).map(f64::from).filter(|octave| octave.abs() <= octaves).map(f64::exp2).collect()
            }
        }
    }

    /// A value as text.
    pub(in crate::html) fn text(self, value: f64) -> String {
        match self {
            Self::Percent => format!("{value:.0}"),
            // Two digits of what other methods leave over.
            Self::Ratio { .. } if value < 0.1 => format!("{value:.3}"),
            Self::Ratio { .. } => format!("{value:.2}"),
        }
    }
}

fn between(unit: f64) -> [u8; 3] {
    let place = unit * 8.0;
    #[expect(clippy::cast_possible_truncation, reason = "from 0 to 8")]
    let below = (place as usize).min(7);
    let fraction = place - f64::from(u32::try_from(below).unwrap_or(7));
    std::array::from_fn(|component| {
        let [from, to] = [below, below + 1].map(|entry| f64::from(BLUE_TO_RED[entry][component]));
        #[expect(clippy::cast_possible_truncation, reason = "between two bytes")]
        let byte = (from + (to - from) * fraction).round() as u8;
        byte
    })
}

/// Black or white, whichever contrasts more with a colour.
pub(super) fn readable_on(RGBColor(red, green, blue): RGBColor) -> RGBColor {
    // Squares stand for the transfer of sRGB. Where the luminance is 0.18, both contrast alike (WCAG 2).
    let luminance =
        [(red, 0.2126), (green, 0.7152), (blue, 0.0722)].into_iter().fold(0.0, |sum, (byte, weight)| {
            let unit = f64::from(byte) / 255.0;
            sum + weight * unit * unit
        });
    if luminance > 0.18 { super::FIXED_BLACK } else { RGBColor(254, 254, 254) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::abs_diff_eq;

    #[test]
    fn one_is_white_and_the_ends_are_blue_and_red() {
        let scale = Scale::of_ratios([0.5, 1.2].into_iter());
        assert_eq!(scale, Scale::Ratio { octaves: 1.0 });
        assert_eq!(scale.colour(1.0), RGBColor(247, 247, 247));
        assert_eq!(scale.colour(0.1), RGBColor(33, 102, 172));
        assert_eq!(scale.colour(2.0), RGBColor(178, 24, 43));
        assert_eq!(Scale::of_ratios(std::iter::empty()), Scale::Ratio { octaves: 0.5 });
    }

    #[test]
    fn places_and_values_are_inverse() {
        for scale in [Scale::Percent, Scale::Ratio { octaves: 2.0 }] {
            for unit in [0.0, 0.25, 0.5, 1.0] {
                assert!(
                    abs_diff_eq!(scale.unit(scale.value(unit)), unit, epsilon = 1e-12),
                    "{scale:?} {unit}"
                );
            }
        }
    }

    #[test]
    fn text_can_be_read_on_the_ends() {
        assert_eq!(readable_on(Scale::Percent.colour(0.0)), RGBColor(254, 254, 254));
        assert_eq!(readable_on(Scale::Percent.colour(100.0)), super::super::FIXED_BLACK);
    }
}
