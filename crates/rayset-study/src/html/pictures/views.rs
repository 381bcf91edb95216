//! What a picture can show.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, html};
use rayset::{ChannelNames, image_of};
use rayset_engine::Frame;
use rayset_image::{false_colour, png_rgb8, to_srgb8};

use crate::StudyError;

/// A state of the switch.
pub(super) struct View {
    /// What the switch says.
    pub(super) label: String,
    /// The picture as a `data:` URI.
    source: String,
    /// What a screen reader says of it.
    alternative: String,
    caption: String,
    legend: Legend,
}

enum Legend {
    None,
    Percent,
    Wrong,
}

/// Vermilion of Okabe and Ito, which stands out of grey for every reader.
const WRONG: [u8; 3] = [213, 94, 0];

impl View {
    pub(super) fn markup(&self, number: usize, side: u32) -> Markup {
        html! {
            figure.view data-view=(number) {
                img src=(self.source) alt=(self.alternative) width=(side) height=(side);
                @match self.legend {
                    Legend::None => {}
                    Legend::Percent => {
                        div.legend aria-hidden="true" {
                            span { "0 %" } span.viridis {} span { "100 % of the pixel's rays coherent" }
                        }
                    }
                    Legend::Wrong => {
                        div.legend aria-hidden="true" { span.swatch {} span { "wrong, drawn 3 x 3 pixels large; the scene in grey" } }
                    }
                }
                figcaption { strong { (self.label) ". " } (self.caption) }
            }
        }
    }
}

/// The picture itself.
pub(super) fn beauty(scene: &str, frame: &Frame) -> Result<View, StudyError> {
    Ok(View {
        label: "Beauty".to_owned(),
        source: data_uri(frame, &colours(frame)?)?,
        alternative: format!("{scene}, rendered by Whitted's rule."),
        caption: format!("{} rays were cast, light rays included.", frame.counts.total().cast),
        legend: Legend::None,
    })
}

/// The coherent fraction; none of a strategy that keeps nothing.
pub(super) fn coherent(scene: &str, strategy: &str, frame: &Frame) -> Result<Option<View>, StudyError> {
    let total = frame.stats.coherence.total().coherent;
    let Some(fractions) = frame.floats("coherent.all").filter(|_| total > 0) else { return Ok(None) };
    let cast = frame.counts.total().cast;
    let caption = format!("{:.1} % of all rays are coherent.", percent(total, cast));
    Ok(Some(View {
        label: format!("Coherent fraction, {strategy}"),
        source: data_uri(frame, &false_colour(fractions))?,
        alternative: format!(
            "{scene}: which fraction of each pixel's rays {strategy} found coherent. {caption}"
        ),
        caption,
        legend: Legend::Percent,
    }))
}

/// The pixels that differ, over the picture in grey.
pub(super) fn wrong(
    scene: &str,
    strategy: &str,
    frame: &Frame,
    standard: &Frame,
) -> Result<View, StudyError> {
    let marks = frame.integers("wrong.1985").unwrap_or_default();
    let mut pixels: Vec<_> = colours(standard)?.into_iter().map(pale).collect();
    let (width, height) = (frame.width as usize, frame.height as usize);
    for (i, _) in marks.iter().enumerate().filter(|(_, mark)| **mark != 0) {
        let (x, y) = (i % width, i / width);
        for row in y.saturating_sub(1)..=(y + 1).min(height - 1) {
            pixels[row * width + x.saturating_sub(1)..=row * width + (x + 1).min(width - 1)].fill(WRONG);
        }
    }
    let n_wrong = marks.iter().filter(|mark| **mark != 0).count() as u64;
    let share = percent(n_wrong, marks.len() as u64);
    let caption = format!("{n_wrong} of {} pixels are wrong: {share:.3} %.", marks.len());
    Ok(View {
        label: format!("Wrong pixels, {strategy}"),
        source: data_uri(frame, &pixels)?,
        alternative: format!("{scene}: pixels whose colour by {strategy} is not that of standard. {caption}"),
        caption,
        legend: Legend::Wrong,
    })
}

/// The picture as sRGB bytes.
fn colours(frame: &Frame) -> Result<Vec<[u8; 3]>, StudyError> {
    Ok(to_srgb8(&image_of(frame, ChannelNames::Plain, &[])?, 0.0)?)
}

/// Grey, and brighter, so that marks stand out.
fn pale([red, green, blue]: [u8; 3]) -> [u8; 3] {
    let luma = (299 * u32::from(red) + 587 * u32::from(green) + 114 * u32::from(blue)) / 1000;
    [u8::try_from(96 + luma * 140 / 255).unwrap_or(u8::MAX); 3]
}

fn data_uri(frame: &Frame, pixels: &[[u8; 3]]) -> Result<String, StudyError> {
    let png = png_rgb8("a picture of the report", frame.width, frame.height, pixels)?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(png)))
}

#[expect(clippy::cast_precision_loss, reason = "counts stay far below 2^53")]
fn percent(part: u64, whole: u64) -> f64 {
    100.0 * part as f64 / whole.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_pixel_is_marked_with_its_neighbours_inside_the_image() {
        let scene = crate::sphere_scene(1, 1).unwrap().scene;
        let options =
            rayset_engine::RenderOptions { width: 8, height: 8, ..rayset_engine::RenderOptions::default() };
        let strategy = rayset_engine::StrategyKind::Standard.bind(&scene);
        let standard = rayset_engine::render(strategy.as_ref(), &options).unwrap();
        let mut other = standard.clone();
        other.beauty[0][0] += 1.0;
        other.beauty[1][63] += 1.0;
        other.mark_wrong(&standard);
        let view = wrong("one", "a reading", &other, &standard).unwrap();
        assert_eq!(view.caption, "2 of 64 pixels are wrong: 3.125 %.");
        assert!(view.source.starts_with("data:image/png;base64,iVBORw0KGgo"));
        assert!(coherent("one", "standard", &standard).unwrap().is_none());
    }
}
