//! Predicted against measured, over logarithms.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

use super::{INK, RULE, data_colour, line, pixel, svg, text, upwards};
use crate::StudyError;

/// Points around a diagonal.
pub(in crate::html) struct Scatter<'a> {
    /// What a screen reader says of it.
    pub(in crate::html) label: String,
    /// The points.
    pub(in crate::html) dots: &'a [Dot],
    /// The base-2 logarithms of the ends of both axes.
    pub(in crate::html) octaves: (i32, i32),
}

/// A ratio.
#[derive(Clone, Copy, Debug)]
pub(in crate::html) struct Dot {
    /// What was measured.
    pub(in crate::html) measured: f64,
    /// What was predicted.
    pub(in crate::html) predicted: f64,
    /// Whether the model was fitted to it.
    pub(in crate::html) is_fitted: bool,
}

const SIDE: i32 = 300;
const LEFT: i32 = 56;
const TOP: i32 = 10;
const BOTTOM: i32 = TOP + SIDE;
const RIGHT: i32 = LEFT + SIDE;

impl Scatter<'_> {
    pub(in crate::html) fn svg(&self) -> Result<String, StudyError> {
        let (low, high) = (f64::from(self.octaves.0), f64::from(self.octaves.1));
        let along = |value: f64| {
            let unit = (value.log2() - low) / (high - low);
            pixel(unit.clamp(0.0, 1.0) * f64::from(SIDE))
        };
        let at = |x: f64, y: f64| (LEFT + along(x), BOTTOM - along(y));
        let (width, height) = ((RIGHT + 24).unsigned_abs(), (BOTTOM + 68).unsigned_abs());
        svg(&self.label, (width, height), |area| {
            for octave in self.octaves.0..=self.octaves.1 {
                let value = f64::from(octave).exp2();
                let (x, y) = at(value, value);
                let width = if octave == 0 { 2 } else { 1 };
                line(area, (x, TOP), (x, BOTTOM), RULE, width)?;
                line(area, (LEFT, y), (RIGHT, y), RULE, width)?;
                let shown = format!("{value}");
                text(area, &shown, (x, BOTTOM + 5), (HPos::Center, VPos::Top), 15, INK)?;
                text(area, &shown, (LEFT - 6, y), (HPos::Right, VPos::Center), 15, INK)?;
            }
            line(area, (LEFT, BOTTOM), (RIGHT, TOP), INK, 1)?;
            for dot in self.dots {
                let at = at(dot.measured, dot.predicted);
                draw(area, at, dot.is_fitted)?;
            }
            let middle = i32::midpoint(LEFT, RIGHT);
            text(area, "measured ratio of times", (middle, BOTTOM + 24), (HPos::Center, VPos::Top), 15, INK)?;
            upwards(area, "predicted ratio of times", (9, i32::midpoint(TOP, BOTTOM)), 15)?;
            let legend = BOTTOM + 56;
            draw(area, (LEFT + 30, legend), true)?;
            text(area, "fitted scenes", (LEFT + 40, legend), (HPos::Left, VPos::Center), 15, INK)?;
            draw(area, (LEFT + 170, legend), false)?;
            text(area, "other scenes", (LEFT + 180, legend), (HPos::Left, VPos::Center), 15, INK)
        })
    }
}

/// Rings for what was fitted, full triangles for what was not: the latter are the test.
fn draw(area: &super::Area<'_>, at: (i32, i32), is_fitted: bool) -> Result<(), super::Failure> {
    if is_fitted {
        area.draw(&Circle::new(at, 4, data_colour(4).stroke_width(2)))?;
    } else {
        area.draw(&TriangleMarker::new(at, 6, data_colour(1).filled()))?;
    }
    Ok(())
}
