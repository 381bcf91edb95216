//! Polygons of many vertices in single precision: their plane in cells, each inside, outside, or in doubt.
//!
//! Where a ray meets the plane is found once, however many edges there are, and looked up. Cells that an edge comes near
//! are in doubt, and the `f64` test is asked, which goes through the edges.

use rayset_geometry::glam::DVec3;
use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::frame::Frame;
use crate::interval::{Intervals, SpanLanes};
use crate::packet::Mask;
use crate::planes::{Meeting, Plane};
use crate::ray::SINGLE;
use crate::shear::{Shearing, Shears};
use crate::triangles::VERTEX_MARGIN;

/// How far the place where a ray meets the plane may be off: in errors of a sheared vertex, times the steepness of the
/// shear, over how much the plane rises along the ray.
pub const PLACE_MARGIN: f32 = 40.0;
/// What it may be off besides, in how far vertices lie off the plane.
const OFF_PLANE: f32 = 3.5;

/// How often what a ray straight across the plane may be off has to go into how near edges leave cells in doubt: rays
/// that cross it slanting are off by more, and are not known there.
const WORTH: f64 = 4.0;
/// How many columns and rows of cells there are.
const SIDE: u8 = 64;
/// How near to a cell an edge leaves it in doubt, in cells: what the place in it may be off.
pub(crate) const NEAR: f64 = 0.125;

/// A polygon of many vertices.
#[derive(Clone, Debug)]
pub(crate) struct PolygonCells {
    plane: Plane,
    /// The column, and the row, of a point in the plane: `axis . p + start`.
    axes: [[f32; 3]; 2],
    starts: [f32; 2],
    /// How far in culling space a place may be off.
    near: f32,
    rows: Box<[Row; SIDE as usize]>,
}

/// A row of cells, a bit each: those that are in no doubt, and those that are inside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Row {
    known: u64,
    inside: u64,
}

impl PolygonCells {
    /// The cells of a polygon, in culling space; `None` if it is too small for them to tell anything, or its vertices lie too
    /// far off a plane.
    pub(crate) fn of(points: &[DVec3], normal: DVec3, frame: &Frame) -> Option<Self> {
        Self::with(points, normal, frame, NEAR)
    }

    #[expect(clippy::cast_possible_truncation, reason = "the margins make up for the rounding")]
    pub(crate) fn with(points: &[DVec3], normal: DVec3, frame: &Frame, doubt: f64) -> Option<Self> {
        let (plane, size) = (Plane::through(points, normal), normal.abs());
        // Across the axis along which the normal is largest: the outline goes round as the normal says.
        let along = if size.x >= size.y.max(size.z) { 0 } else { 2 - usize::from(size.y >= size.z) };
        let across = [(along + 1) % 3, (along + 2) % 3];
        let turn = if normal[along] > 0.0 { 1 } else { -1 };
        let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = points.iter().fold(start, |(low, high), point| (low.min(*point), high.max(*point)));
        // A cell is left free on all sides.
        let widths = across.map(|k| (high[k] - low[k]) / f64::from(SIDE - 2));
        let near = NEAR * widths[0].min(widths[1]);
        let rounding = PLACE_MARGIN * VERTEX_MARGIN * SINGLE * frame.reach;
        // What a ray straight across the plane is off by.
        let least_off = f64::from(rounding + OFF_PLANE * plane.off);
        if near <= WORTH * least_off {
            return None;
        }
        let starts = [0, 1].map(|i| 1.0 - low[across[i]] / widths[i]);
        let cell = |point: &DVec3| [0, 1].map(|i| point[across[i]] / widths[i] + starts[i]);
        let outline: Vec<[f64; 2]> = points.iter().map(cell).collect();
        let mut axes = [[0.0; 3]; 2];
        for i in 0..2 {
            axes[i][across[i]] = widths[i].recip() as f32;
        }
        let rows = Box::new(rows_of(&outline, turn, doubt));
        Some(Self { plane, axes, starts: starts.map(|start| start as f32), near: near as f32, rows })
    }

    /// How many bytes it takes beside its own.
    pub(crate) fn more_bytes(&self) -> usize {
        size_of_val(&self.rows[..])
    }

    /// Where rays hit it, of which the front and the back may be hit by some.
    #[inline(always)]
    pub(crate) fn intervals<S: Simd>(
        &self,
        simd: S,
        rays: &impl Shearing<S>,
        span: &SpanLanes<S>,
        (front, back): (Mask<S>, Mask<S>),
    ) -> Intervals<S> {
        let (rounding, shears) = (rays.rounding(), rays.shears());
        let Shears { factors: [sx, sy, inverse], crossings: [ox, oy, _] } = *shears;
        let Meeting { z, rise, low, high } = self.plane.splat(simd, rays).meet(simd, shears, rounding);
        let off_place =
            rounding.steepness * PLACE_MARGIN.mul_add(rounding.vertex, OFF_PLANE * self.plane.off);
        let is_there = (rise.abs() * simd.splat_f32(self.near)).ge(simd.splat_f32(off_place));
        // What is not there may be anywhere.
        let (mut possible, mut sure) = ((front | back) & !is_there, simd.mask_f32(0));
        let near = (front | back) & is_there & low.le(span.ends) & high.ge(span.start);
        if near.any() {
            let point = [ox - sx * z, oy - sy * z, z];
            let (column, row) = (self.place(simd, 0, rays, point), self.place(simd, 1, rays, point));
            let (zero, side) = (simd.splat_f32(0.0), simd.splat_f32(f32::from(SIDE)));
            let on_cells = near & column.ge(zero) & column.lt(side) & row.ge(zero) & row.lt(side);
            let [known, inside] = self.look_up::<S>(on_cells.bits(), column, row);
            let is_front = (rise * inverse).lt(zero);
            let met = simd.mask_f32(inside) & ((is_front & front) | (back & !is_front));
            possible = possible | met | (on_cells & !simd.mask_f32(known));
            sure = met & low.gt(span.start_above) & high.lt(span.end_below);
        }
        let low = low.select(is_there, span.start);
        Intervals { possible, sure, low, high }
    }

    /// The column of points of the plane, or the row.
    #[inline(always)]
    fn place<S: Simd>(&self, simd: S, i: usize, rays: &impl Shearing<S>, [x, y, z]: [S::F32; 3]) -> S::F32 {
        let [ax, ay, az] = rays.in_order(simd, self.axes[i]);
        x.mul_add(ax, y.mul_add(ay, z.mul_add(az, simd.splat_f32(self.starts[i]))))
    }

    /// Of some lanes, by columns and rows, those whose cells are in no doubt, and those whose cells are inside.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "they are on the cells")]
    fn look_up<S: Simd>(&self, mut lanes: u32, column: S::F32, row: S::F32) -> [u32; 2] {
        const MOST: usize = rayset_simd::MAX_LANES;
        let (mut columns, mut rows) = ([0.0; MOST], [0.0; MOST]);
        column.store(&mut columns);
        row.store(&mut rows);
        let (mut known, mut inside) = (0, 0);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % MOST;
            lanes &= lanes - 1;
            let row = self.rows[rows[lane] as usize % usize::from(SIDE)];
            let column = columns[lane] as u32 % u32::from(SIDE);
            known |= ((row.known >> column & 1) as u32) << lane;
            inside |= ((row.inside >> column & 1) as u32) << lane;
        }
        [known, inside]
    }
}

/// The rows of cells of an outline, in units of cells, whose inside it goes round in the sense of `turn`.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "all of it lies on the cells")]
fn rows_of(outline: &[[f64; 2]], turn: i32, doubt: f64) -> [Row; SIDE as usize] {
    let mut rows = [Row { known: u64::MAX, inside: 0 }; SIDE as usize];
    // How much more often than the column before each column of a row is wound round, in its middle.
    let mut steps = [[0; SIDE as usize]; SIDE as usize];
    let last = f64::from(SIDE - 1);
    let index = |place: f64| place.floor().clamp(0.0, last) as usize;
    for (i, &p) in outline.iter().enumerate() {
        let q = outline[(i + 1) % outline.len()];
        let (low, high) = if p[1] <= q[1] { (p, q) } else { (q, p) };
        let rise = high[1] - low[1];
        let at = |y: f64| {
            let part = if rise > 0.0 { ((y - low[1]) / rise).clamp(0.0, 1.0) } else { 0.0 };
            low[0] + part * (high[0] - low[0])
        };
        for y in index(low[1] - doubt)..=index(high[1] + doubt) {
            let middle = y as f64 + 0.5;
            let ends = [at(middle - 0.5 - doubt), at(middle + 0.5 + doubt)];
            let ends = if rise > 0.0 { ends } else { [low[0], high[0]] };
            let (left, right) = (index(ends[0].min(ends[1]) - doubt), index(ends[0].max(ends[1]) + doubt));
            rows[y].known &= !((u64::MAX >> (63 - (right - left))) << left);
            if low[1] <= middle && middle < high[1] {
                // What goes upwards has its inside on the left.
                steps[y][index(at(middle) + 0.5)] += if q[1] > p[1] { -1 } else { 1 };
            }
        }
    }
    for (row, steps) in rows.iter_mut().zip(&steps) {
        let mut winding = 0;
        for (column, step) in steps.iter().enumerate() {
            winding += step;
            let bit = 1 << column;
            if winding == turn {
                row.inside |= bit;
            } else if winding % 2 != 0 {
                // Inside, but of a part that goes round the other way, or more than once.
                row.known &= !bit;
            }
        }
        row.inside &= row.known;
    }
    rows
}

#[cfg(test)]
mod tests {
    use crate::doubtful::{Aimed, tally_of};

    #[test]
    fn no_polygon_is_lost_and_no_sure_one_is_none() {
        for (backend, tally) in tally_of(&Aimed::at(9..=60)) {
            assert_eq!(tally.wrong(), [0; 3], "{backend}: {tally:?}");
            let told = [tally.hits, tally.sure, tally.passed_over];
            assert!(told.iter().all(|&n| n > 5_000), "{backend}: {tally:?}");
        }
    }

    #[test]
    fn without_the_margins_polygons_are_lost() {
        for (backend, tally) in tally_of(&Aimed { factor: 0.0, ..Aimed::at(9..=60) }) {
            assert!(tally.wrong().iter().all(|&n| n > 0), "{backend}: {tally:?}");
        }
        for (backend, tally) in tally_of(&Aimed { near: 0.0, ..Aimed::at(9..=60) }) {
            assert!(tally.wrong()[..2].iter().all(|&n| n > 0), "{backend}: {tally:?}");
        }
    }
}
