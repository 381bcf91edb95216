//! A figure over the plane of n and resolution, with the paper's row below it.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, VPos};

use super::colours::{Scale, readable_on};
use super::{Area, FIXED_BLACK, Failure, INK, RULE, line, pixel, place, rectangle, svg, text, upwards};
use crate::StudyError;

/// What to draw.
pub(in crate::html) struct HeatMap<'a> {
    /// What a screen reader says of it.
    pub(in crate::html) label: String,
    /// The numbers of spheres.
    pub(in crate::html) columns: &'a [u32],
    /// The resolutions, upwards.
    pub(in crate::html) rows: &'a [u32],
    /// Row by row.
    pub(in crate::html) values: &'a [Vec<Option<f64>>],
    /// Where a row crosses 1, in columns.
    pub(in crate::html) crossings: &'a [Vec<f64>],
    /// What the paper says, column by column; none if it says nothing.
    pub(in crate::html) paper: Option<Vec<Option<f64>>>,
    /// What colours stand for.
    pub(in crate::html) scale: Scale,
    /// The unit of the scale.
    pub(in crate::html) unit: &'static str,
}

const WIDTH: i32 = 420;
const LEFT: i32 = 64;
const TOP: i32 = 6;
/// The least height of a cell.
const CELL: i32 = 28;
/// The least height of the plane: room for what its rows are.
const PLANE: i32 = 100;
const GAP: i32 = 8;
const NOTCH: i32 = 6;
/// From the cells to the lower edge: numbers, what they are, and the scale.
const BELOW: i32 = 96;

impl HeatMap<'_> {
    pub(in crate::html) fn svg(&self) -> Result<String, StudyError> {
        let height = self.bottom() + BELOW;
        svg(&self.label, (WIDTH.unsigned_abs(), height.unsigned_abs()), |area| {
            self.draw_cells(area)?;
            self.draw_axes(area)?;
            self.draw_scale(area, self.bottom() + 48)
        })
    }

    fn n_rows(&self) -> i32 {
        place(self.rows.len())
    }

    /// The height of a cell.
    fn cell(&self) -> i32 {
        CELL.max(PLANE / self.n_rows().max(1))
    }

    /// The lower edge of the plane.
    fn plane_bottom(&self) -> i32 {
        TOP + self.cell() * self.n_rows()
    }

    /// The lower edge of all cells.
    fn bottom(&self) -> i32 {
        self.plane_bottom() + if self.paper.is_some() { GAP + self.cell() } else { 0 }
    }

    /// The left edge of a column; those between columns too.
    fn x(&self, column: f64) -> i32 {
        let width = f64::from(WIDTH - LEFT - 6) / f64::from(place(self.columns.len()));
        LEFT + pixel(column * width)
    }

    fn draw_cells(&self, area: &Area<'_>) -> Result<(), Failure> {
        for (row, values) in self.values.iter().enumerate() {
            let y = self.plane_bottom() - self.cell() * (place(row) + 1);
            self.draw_row(area, y, values)?;
            for crossing in self.crossings.get(row).into_iter().flatten() {
                let x = self.x(crossing + 0.5);
                // Notches at both edges: the number between them stays readable.
                for (from, to) in [(y, y + NOTCH), (y + self.cell() - 1 - NOTCH, y + self.cell() - 1)] {
                    line(area, (x, from), (x, to), WHITE, 6)?;
                    line(area, (x, from), (x, to), FIXED_BLACK, 3)?;
                }
            }
        }
        match &self.paper {
            Some(values) => self.draw_row(area, self.plane_bottom() + GAP, values),
            None => Ok(()),
        }
    }

    fn draw_row(&self, area: &Area<'_>, y: i32, values: &[Option<f64>]) -> Result<(), Failure> {
        for (i, value) in values.iter().enumerate() {
            let column = f64::from(place(i));
            let (from, to) = ((self.x(column), y), (self.x(column + 1.0), y + self.cell()));
            let Some(value) = *value else {
                // Nothing is known: a stroke, no colour of the scale.
                line(area, (from.0 + 8, y + self.cell() / 2), (to.0 - 8, y + self.cell() / 2), RULE, 1)?;
                continue;
            };
            let colour = self.scale.colour(value);
            rectangle(area, from, (to.0 - 1, to.1 - 1), colour)?;
            let middle = (i32::midpoint(from.0, to.0), y + self.cell() / 2);
            let shown = self.scale.text(value);
            // Three digits behind the point need more room.
            let size = if shown.len() > 4 { 12 } else { 14 };
            text(area, &shown, middle, (HPos::Center, VPos::Center), size, readable_on(colour))?;
        }
        Ok(())
    }

    fn draw_axes(&self, area: &Area<'_>) -> Result<(), Failure> {
        let right = (HPos::Right, VPos::Center);
        for (row, side) in self.rows.iter().enumerate() {
            let y = self.plane_bottom() - self.cell() * place(row) - self.cell() / 2;
            text(area, &side.to_string(), (LEFT - 6, y), right, 15, INK)?;
        }
        upwards(area, "pixels a side", (9, i32::midpoint(TOP, self.plane_bottom())), 15)?;
        if self.paper.is_some() {
            let y = self.plane_bottom() + GAP + self.cell() / 2;
            text(area, "paper", (LEFT - 6, y), right, 15, INK)?;
        }
        let bottom = self.bottom();
        for (column, n) in self.columns.iter().enumerate() {
            let x = self.x(f64::from(place(column)) + 0.5);
            text(area, &n.to_string(), (x, bottom + 5), (HPos::Center, VPos::Top), 15, INK)?;
        }
        let middle = i32::midpoint(LEFT, WIDTH - 6);
        text(area, "n, spheres", (middle, bottom + 23), (HPos::Center, VPos::Top), 15, INK)
    }

    fn draw_scale(&self, area: &Area<'_>, y: i32) -> Result<(), Failure> {
        let (from, to) = (LEFT, WIDTH - 20);
        let steps = 100;
        let x = |unit: f64| from + pixel(unit * f64::from(to - from));
        for step in 0..steps {
            let [low, high] = [step, step + 1].map(|step| f64::from(step) / f64::from(steps));
            let colour = self.scale.colour(self.scale.value(f64::midpoint(low, high)));
            // One pixel more than its share: no gap shows when the figure is scaled.
            rectangle(area, (x(low), y), ((x(high) + 1).min(to), y + 10), colour)?;
        }
        for value in self.scale.marks() {
            let x = x(self.scale.unit(value));
            line(area, (x, y + 10), (x, y + 13), INK, 1)?;
            let shown = if value < 1.0 { value.to_string() } else { format!("{value:.0}") };
            text(area, &shown, (x, y + 15), (HPos::Center, VPos::Top), 14, INK)?;
        }
        let middle = i32::midpoint(from, to);
        text(area, self.unit, (middle, y + 31), (HPos::Center, VPos::Top), 14, INK)
    }
}
