//! Curves over the number of spheres.

use plotters::style::text_anchor::{HPos, VPos};

use super::{Failure, INK, RULE, data_colour, line, marker, pixel, place, stretch, svg, text, upwards};
use crate::StudyError;

/// Curves over the logarithm of n.
pub(in crate::html) struct Lines<'a> {
    /// What a screen reader says of it.
    pub(in crate::html) label: String,
    /// What is drawn upwards, with its unit.
    pub(in crate::html) upwards: &'static str,
    /// The greatest value that is sure to fit.
    pub(in crate::html) top: f64,
    /// The distance of lines of the grid, or twice and more where there would be many.
    pub(in crate::html) grid: f64,
    /// A value that is drawn through.
    pub(in crate::html) reference: Option<f64>,
    /// The curves.
    pub(in crate::html) curves: &'a [Curve],
}

/// A curve with its name.
#[derive(Clone, Debug)]
pub(in crate::html) struct Curve {
    /// Its name.
    pub(in crate::html) name: String,
    /// Colour and shape: the same number is the same source in every figure.
    pub(in crate::html) style: usize,
    /// Its points, in the order of the numbers of spheres.
    pub(in crate::html) points: Vec<Point>,
}

/// A point of a curve.
#[derive(Clone, Copy, Debug)]
pub(in crate::html) struct Point {
    /// The number of spheres.
    pub(in crate::html) n: u32,
    /// The value.
    pub(in crate::html) value: f64,
    /// Its quartiles, where there are any.
    pub(in crate::html) quartiles: Option<(f64, f64)>,
}

const WIDTH: i32 = 420;
const LEFT: i32 = 56;
const RIGHT: i32 = WIDTH - 16;
const TOP: i32 = 12;
const BOTTOM: i32 = 262;
/// The height of a line of the legend.
const ENTRY: i32 = 20;

impl Lines<'_> {
    pub(in crate::html) fn svg(&self) -> Result<String, StudyError> {
        let height = BOTTOM + 50 + ENTRY * place(self.curves.len()) + 4;
        let points = || self.curves.iter().flat_map(|curve| &curve.points);
        let values = points().flat_map(|p| [p.value, p.quartiles.map_or(p.value, |q| q.1)]);
        let greatest = values.fold(self.top, f64::max);
        let mut grid = self.grid;
        // Lines so close that their numbers would touch tell nothing.
        while greatest > 10.0 * grid {
            grid *= 2.0;
        }
        let top = (greatest / grid).ceil() * grid;
        let mut numbers: Vec<u32> = points().map(|point| point.n).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let [least, greatest] =
            [numbers.first(), numbers.last()].map(|n| f64::from(n.copied().unwrap_or(1)).log2());
        let x = |n: u32| {
            let unit = (f64::from(n).log2() - least) / (greatest - least).max(1.0);
            LEFT + 16 + pixel(unit * f64::from(RIGHT - LEFT - 32))
        };
        let y = |value: f64| BOTTOM - pixel(value / top * f64::from(BOTTOM - TOP));
        svg(&self.label, (WIDTH.unsigned_abs(), height.unsigned_abs()), |area| {
            let mut level = 0.0;
            while level <= top * 1.0001 {
                line(area, (LEFT, y(level)), (RIGHT, y(level)), RULE, 1)?;
                let shown = if self.grid < 1.0 { format!("{level:.2}") } else { format!("{level:.0}") };
                text(area, &shown, (LEFT - 6, y(level)), (HPos::Right, VPos::Center), 15, INK)?;
                level += grid;
            }
            for &n in &numbers {
                line(area, (x(n), BOTTOM), (x(n), BOTTOM + 4), INK, 1)?;
                text(area, &n.to_string(), (x(n), BOTTOM + 7), (HPos::Center, VPos::Top), 15, INK)?;
            }
            let middle = i32::midpoint(LEFT, RIGHT);
            text(area, "n, spheres", (middle, BOTTOM + 25), (HPos::Center, VPos::Top), 15, INK)?;
            upwards(area, self.upwards, (9, i32::midpoint(TOP, BOTTOM)), 15)?;
            line(area, (LEFT, BOTTOM), (RIGHT, BOTTOM), INK, 1)?;
            if let Some(reference) = self.reference {
                line(area, (LEFT, y(reference)), (RIGHT, y(reference)), INK, 2)?;
            }
            for curve in self.curves {
                curve.draw(area, &x, &y)?;
            }
            for (i, curve) in self.curves.iter().enumerate() {
                let at = BOTTOM + 58 + ENTRY * place(i);
                stretch(area, curve.style, (LEFT, at), (LEFT + 36, at))?;
                marker(area, curve.style, (LEFT + 18, at))?;
                text(area, &curve.name, (LEFT + 44, at), (HPos::Left, VPos::Center), 15, INK)?;
            }
            Ok(())
        })
    }
}

impl Curve {
    fn draw(
        &self,
        area: &super::Area<'_>,
        x: &dyn Fn(u32) -> i32,
        y: &dyn Fn(f64) -> i32,
    ) -> Result<(), Failure> {
        let colour = data_colour(self.style);
        for pair in self.points.windows(2) {
            let [from, to] = [pair[0], pair[1]].map(|point| (x(point.n), y(point.value)));
            stretch(area, self.style, from, to)?;
        }
        for &Point { n, value, quartiles } in &self.points {
            if let Some((low, high)) = quartiles {
                line(area, (x(n), y(low)), (x(n), y(high)), colour, 1)?;
            }
            marker(area, self.style, (x(n), y(value)))?;
        }
        Ok(())
    }
}
