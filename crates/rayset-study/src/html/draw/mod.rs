//! Figures as SVG that stands inside a page.

mod colours;
mod heat;
mod lines;
mod scatter;

use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use self::colours::N_COLOURS;
pub(super) use self::colours::{Scale, data_colour};
pub(super) use self::heat::HeatMap;
pub(super) use self::lines::{Curve, Lines, Point};
pub(super) use self::scatter::{Dot, Scatter};
use crate::StudyError;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Text and axes: the page's style turns exactly these into the colours of its scheme.
const INK: RGBColor = BLACK;
const RULE: RGBColor = RGBColor(204, 204, 204);
/// Black that stays black, for what lies on colours of data.
const FIXED_BLACK: RGBColor = RGBColor(1, 1, 1);

/// Draws a figure; `label` is what a screen reader says of it.
fn svg(
    label: &str,
    size: (u32, u32),
    draw: impl FnOnce(&Area<'_>) -> Result<(), Failure>,
) -> Result<String, StudyError> {
    let mut document = String::new();
    {
        let area = SVGBackend::with_string(&mut document, size).into_drawing_area();
        draw(&area)
            .and_then(|()| Ok(area.present()?))
            .map_err(|source| StudyError::Draw { figure: label.to_owned(), source })?;
    }
    // What plotters writes begins with `<svg ...>`; the label becomes its accessible name and its tooltip.
    let title = maud::html! { title { (label) } }.into_string();
    let head = document.find('>').map_or(0, |end| end + 1);
    let opening = document[..head].replace("<svg ", "<svg role=\"img\" ");
    Ok(format!("{opening}{title}{}", &document[head..]))
}

fn text(
    area: &Area<'_>,
    text: &str,
    at: (i32, i32),
    (horizontal, vertical): (HPos, VPos),
    size: i32,
    color: RGBColor,
) -> Result<(), Failure> {
    let style = ("sans-serif", size).into_font().color(&color).pos(Pos::new(horizontal, vertical));
    Ok(area.draw(&Text::new(text.to_owned(), at, style))?)
}

/// Text that runs upwards, centred.
fn upwards(area: &Area<'_>, text: &str, at: (i32, i32), size: i32) -> Result<(), Failure> {
    let font = ("sans-serif", size).into_font().transform(FontTransform::Rotate270);
    let style = font.color(&INK).pos(Pos::new(HPos::Center, VPos::Center));
    Ok(area.draw(&Text::new(text.to_owned(), at, style))?)
}

fn line(
    area: &Area<'_>,
    from: (i32, i32),
    to: (i32, i32),
    color: RGBColor,
    width: u32,
) -> Result<(), Failure> {
    Ok(area.draw(&PathElement::new([from, to], color.stroke_width(width)))?)
}

fn rectangle(area: &Area<'_>, from: (i32, i32), to: (i32, i32), color: RGBColor) -> Result<(), Failure> {
    Ok(area.draw(&Rectangle::new([from, to], color.filled()))?)
}

/// The shape of a curve's points, and whether its line is dashed: others where a colour comes again.
fn look(style: usize) -> (usize, bool) {
    let round = style / N_COLOURS;
    ((style + round) % 6, round % 2 == 1)
}

/// A part of a curve.
fn stretch(area: &Area<'_>, style: usize, from: (i32, i32), to: (i32, i32)) -> Result<(), Failure> {
    if !look(style).1 {
        return line(area, from, to, data_colour(style), 2);
    }
    let stroke = data_colour(style).stroke_width(2);
    Ok(area.draw(&DashedPathElement::new([from, to], 6, 4, stroke))?)
}

/// One of several shapes, so that no reader needs colours.
fn marker(area: &Area<'_>, style: usize, at: (i32, i32)) -> Result<(), Failure> {
    let color = data_colour(style);
    match look(style).0 {
        0 => area.draw(&Circle::new(at, 5, color.filled()))?,
        1 => area.draw(&TriangleMarker::new(at, 6, color.filled()))?,
        2 => area.draw(&Rectangle::new([(at.0 - 4, at.1 - 4), (at.0 + 4, at.1 + 4)], color.filled()))?,
        3 => area.draw(&Cross::new(at, 4, color.stroke_width(2)))?,
        4 => area.draw(&Circle::new(at, 5, color.stroke_width(2)))?,
        _ => {
            area.draw(&Rectangle::new([(at.0 - 4, at.1 - 4), (at.0 + 4, at.1 + 4)], color.stroke_width(2)))?
        }
    }
    Ok(())
}

#[expect(clippy::cast_possible_truncation, reason = "a place in a figure")]
fn pixel(value: f64) -> i32 {
    value.round() as i32
}

/// The place of an index.
fn place(index: usize) -> i32 {
    i32::try_from(index).expect("few of them")
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn curves_of_one_colour_differ_in_shape_and_dashes() {
        let looks: HashSet<_> = (0..12).map(|style| (data_colour(style).rgb(), look(style))).collect();
        assert_eq!(looks.len(), 12);
        for style in 0..N_COLOURS {
            let (first, second) = (look(style), look(style + N_COLOURS));
            assert!(first.0 != second.0 && first.1 != second.1, "{style}");
        }
    }

    #[test]
    fn a_figure_says_what_it_is() {
        let figure = svg("a < b", (10, 10), |area| line(area, (0, 0), (9, 9), INK, 1)).unwrap();
        assert!(figure.starts_with("<svg role=\"img\" width=\"10\""), "{figure}");
        assert!(figure.contains("<title>a &lt; b</title>"), "{figure}");
        // The page's style looks for these.
        assert!(figure.contains("stroke=\"#000000\""), "{figure}");
    }
}
