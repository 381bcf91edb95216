//! The cells that a ray passes through, one after the other.

use rayset_geometry::{Ray, Span};

use super::grid::Grid;

/// A component of a direction below this counts as zero: along the part of a ray that can hit anything, at most 2^12
/// times the scene's extent, it moves the ray by 2^-88 of the extent, which is far below a rounding.
const PARALLEL: f64 = 1.0 / (1_u128 << 100) as f64;

/// What a ray has to do with a grid.
pub(super) enum Entry<'g> {
    /// It starts too far away, or its span is empty or begins behind its origin: no proof holds.
    InDoubt,
    /// It hits nothing.
    Missed,
    /// It walks from its first cell on.
    Inside(Walk<'g>),
}

/// A walk through a grid, in the cell it has come to.
///
/// Its clock are the computed times at which the ray crosses the planes between cells, each from the plane itself and
/// none from the time before, so that no rounding adds up. Each axis crosses its planes in order, and the walk takes the
/// earliest crossing of the three. So what is hit at a computed `t` is found in the cell in which the walk is when it
/// has made all crossings up to `t`, and in no later one: see `docs/numerics.md`.
#[derive(Debug)]
pub(super) struct Walk<'g> {
    grid: &'g Grid,
    pub(super) cell: usize,
    /// No hit is at this time or later, in world units.
    end: f64,
    axes: [Axis; 3],
}

/// A walk along one axis.
#[derive(Clone, Copy, Debug)]
struct Axis {
    origin: f64,
    /// 1 over the direction; 0 for a ray that never crosses a plane.
    inverse: f64,
    /// The plane that is crossed next.
    plane: usize,
    /// When, in world units; infinite for never.
    crossing: f64,
}

impl Grid {
    /// Starts the walk of a ray.
    #[inline(always)]
    pub(super) fn enter(&self, ray: &Ray, span: Span) -> Entry<'_> {
        let (origin, direction) = (ray.origin().to_array(), ray.direction().to_array());
        let is_near = origin.iter().all(|x| x.abs() <= self.farthest);
        if !(is_near && span.start >= 0.0 && span.start < span.end) {
            return Entry::InDoubt;
        }
        let (mut start, mut end) = (span.start, span.end);
        let mut inverses = [0.0; 3];
        for k in 0..3 {
            let (low, high) = (self.planes[k][0], self.planes[k][self.planes[k].len() - 1]);
            if direction[k].abs() < PARALLEL {
                if origin[k] < low || origin[k] > high {
                    return Entry::Missed;
                }
                continue;
            }
            inverses[k] = 1.0 / direction[k];
            let (first, second) = ((low - origin[k]) * inverses[k], (high - origin[k]) * inverses[k]);
            start = start.max(first.min(second));
            end = end.min(first.max(second));
        }
        if start >= end {
            return Entry::Missed;
        }
        let mut cell = 0;
        let axes = [0, 1, 2].map(|k| {
            let (origin, inverse) = (origin[k], inverses[k]);
            let moved = if inverse == 0.0 { 0.0 } else { start * direction[k] };
            let index = self.locate(k, origin + moved);
            cell += index * self.strides[k];
            let plane = index + usize::from(inverse > 0.0);
            let mut axis = Axis { origin, inverse, plane, crossing: f64::INFINITY };
            axis.look_ahead(&self.planes[k]);
            axis
        });
        Entry::Inside(Walk { grid: self, cell, end, axes })
    }
}

impl Axis {
    /// When the next plane is crossed.
    #[inline(always)]
    fn look_ahead(&mut self, planes: &[f64]) {
        if self.inverse != 0.0 {
            self.crossing = (planes[self.plane] - self.origin) * self.inverse;
        }
    }
}

impl Walk<'_> {
    /// Steps to the next cell; `false` if nothing that counts is hit there or later, nothing being looked for beyond
    /// `reach`.
    ///
    /// A hit at `reach` itself is still looked for: another may be as near.
    #[inline(always)]
    pub(super) fn step(&mut self, reach: f64) -> bool {
        let [x, y, z] = self.axes.each_ref().map(|axis| axis.crossing);
        let k = if x < y {
            if x < z { 0 } else { 2 }
        } else if y < z {
            1
        } else {
            2
        };
        let axis = &mut self.axes[k];
        // The last plane of an axis is crossed at the end or later, so the walk never leaves the grid.
        if axis.crossing >= self.end || axis.crossing > reach {
            return false;
        }
        if axis.inverse > 0.0 {
            self.cell += self.grid.strides[k];
            axis.plane += 1;
        } else {
            self.cell -= self.grid.strides[k];
            axis.plane -= 1;
        }
        axis.look_ahead(&self.grid.planes[k]);
        true
    }
}
