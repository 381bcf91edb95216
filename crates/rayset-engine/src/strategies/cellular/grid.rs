//! A uniform grid over all primitives of a scene.

use std::ops::Range;

use rayset_geometry::glam::DVec3;
use rayset_geometry::{BoundingBox, ColumnRun};
use rayset_scene::{Scene, VolumeId};

/// How much wider than a primitive the box is that decides into which cells it goes, relative to the coordinates
/// involved.
///
/// No computed hit is farther from its primitive's box, and no computed step from its plane, than a part of this
/// together. 2^-46 is 128 roundings; derived in `docs/numerics.md`.
pub(super) const CELL_MARGIN: f64 = 1.0 / (1_u64 << 46) as f64;

/// How far from the origin of the world a ray may start, in units of the scene's extent: the boxes are widened for all
/// rays at once. Rays from farther away are partitioned.
const FARTHEST: f64 = 1023.0;

/// In smaller scenes there is no grid: squares of distances that underflow are off by up to 2^-537 as distances, which
/// is far below a margin of 2^-46 only if the extent is above 2^-480.
const LEAST_EXTENT: f64 = f64::from_bits((1023 - 480) << 52);

/// Cells a primitive, where nothing limits them.
const DENSITY: f64 = 6.0;

/// An axis along which the grid is thinner than this share of its longest is not divided.
const FLAT: f64 = 1.0 / (1 << 20) as f64;

/// Cells along an axis, at most.
const MAX_CELLS_OF_AXIS: f64 = 1024.0;

/// Cells, at most.
const MAX_CELLS: f64 = (1_u64 << 24) as f64;

/// References from cells to primitives, at most: as many for each primitive, and some more for small scenes. A grid
/// that needs more is made coarser, down to a single cell with one reference a primitive.
const MAX_REFERENCES_OF_PRIMITIVE: u64 = 16;
const MAX_REFERENCES_BESIDES: u64 = 1 << 16;

/// Cells of equal size, each with the primitives whose widened boxes overlap it.
#[derive(Debug)]
pub(super) struct Grid {
    /// Where cells end along each axis, in world units: one more than there are cells, not decreasing.
    pub(super) planes: [Vec<f64>; 3],
    /// How far apart neighbours along each axis are in `starts`.
    pub(super) strides: [usize; 3],
    /// The largest absolute coordinate of an origin for which the boxes are wide enough.
    pub(super) farthest: f64,
    /// Where the references of each cell begin, and one past the end of the last.
    starts: Vec<u32>,
    /// Members of cells, in increasing order within a cell.
    references: Vec<u32>,
    members: Vec<Member>,
}

/// A primitive of the grid. Members are numbered as volumes hold them.
#[derive(Clone, Debug)]
pub(super) struct Member {
    /// The run of it alone.
    pub(super) run: ColumnRun,
    /// Whether it can be appended to a run that ends with the member before it: their indices and their ids follow one
    /// another, so that of equally near hits the one of least index is the one of least id.
    pub(super) follows: bool,
}

impl Grid {
    /// The grid of a scene, each box widened by `margin` relative to the coordinates involved; none for a scene that is
    /// empty or too small.
    pub(super) fn of(scene: &Scene, margin: f64) -> Option<Self> {
        let extent = scene.extent();
        if scene.n_primitives() == 0 || extent < LEAST_EXTENT {
            return None;
        }
        let members = members(scene);
        let widening = DVec3::splat(margin * (1.0 + FARTHEST) * extent);
        let boxes: Vec<BoundingBox> = members
            .iter()
            .map(|member| {
                let inner = scene.primitives().bounding_box(member.run.kind, member.run.range.start);
                BoundingBox { min: inner.min - widening, max: inner.max + widening }
            })
            .collect();
        let bounds: BoundingBox = boxes.iter().copied().collect();
        let n = boxes.len() as u64;
        let max_references =
            (MAX_REFERENCES_OF_PRIMITIVE * n + MAX_REFERENCES_BESIDES).min(u64::from(u32::MAX));
        let mut n_wanted = (DENSITY * n as f64).min(MAX_CELLS);
        let (planes, n_references) = loop {
            let planes = planes(&bounds, n_wanted);
            let n_references: u64 = boxes.iter().map(|inner| n_cells(&cells(&planes, inner))).sum();
            if n_references <= max_references || planes.iter().all(|planes| planes.len() == 2) {
                break (planes, n_references);
            }
            n_wanted /= 8.0;
        };
        let counts = planes.each_ref().map(|planes| planes.len() - 1);
        let mut grid = Self {
            strides: [1, counts[0], counts[0] * counts[1]],
            planes,
            farthest: FARTHEST * extent,
            starts: vec![0; counts[0] * counts[1] * counts[2] + 1],
            references: vec![0; usize::try_from(n_references).expect("references that memory holds")],
            members,
        };
        grid.fill(&boxes);
        Some(grid)
    }

    /// Sorts the members into their cells, by counting.
    fn fill(&mut self, boxes: &[BoundingBox]) {
        for inner in boxes {
            let ranges = cells(&self.planes, inner);
            self.for_each_cell(&ranges, |starts, cell| starts[cell + 1] += 1);
        }
        for i in 1..self.starts.len() {
            self.starts[i] += self.starts[i - 1];
        }
        let mut references = std::mem::take(&mut self.references);
        for (inner, member) in boxes.iter().zip(0..) {
            let ranges = cells(&self.planes, inner);
            self.for_each_cell(&ranges, |starts, cell| {
                references[starts[cell] as usize] = member;
                starts[cell] += 1;
            });
        }
        self.references = references;
        // Each start has moved on to its cell's end.
        self.starts.pop();
        self.starts.insert(0, 0);
    }

    fn for_each_cell(&mut self, [x, y, z]: &[Range<usize>; 3], mut visit: impl FnMut(&mut [u32], usize)) {
        for z in z.clone() {
            for y in y.clone() {
                for x in x.clone() {
                    let cell = x + y * self.strides[1] + z * self.strides[2];
                    visit(&mut self.starts, cell);
                }
            }
        }
    }

    /// The members of a cell.
    #[inline(always)]
    pub(super) fn references(&self, cell: usize) -> &[u32] {
        &self.references[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// A primitive of the grid.
    #[inline(always)]
    pub(super) fn member(&self, index: u32) -> &Member {
        &self.members[index as usize]
    }

    /// How many primitives there are.
    pub(super) fn n_members(&self) -> usize {
        self.members.len()
    }

    /// The cell along an axis in which a coordinate lies; the nearest where it lies outside.
    #[inline(always)]
    pub(super) fn locate(&self, axis: usize, x: f64) -> usize {
        locate(&self.planes[axis], x)
    }
}

/// All primitives, in the order of volumes.
fn members(scene: &Scene) -> Vec<Member> {
    let mut members: Vec<Member> = Vec::with_capacity(scene.n_primitives());
    let mut last = None;
    for volume in (0..scene.volumes().len()).map(|i| VolumeId(u32::try_from(i).expect("ids have 32 bits"))) {
        for run in scene.volume_runs(volume) {
            for index in run.range.clone() {
                let run = ColumnRun { range: index..index + 1, ..run.clone() };
                let id = scene.primitive_id(run.kind, index);
                let follows = last.is_some_and(|last| last < id)
                    && members.last().is_some_and(|before| {
                        (before.run.kind, before.run.sides, before.run.range.end)
                            == (run.kind, run.sides, index)
                    });
                last = Some(id);
                members.push(Member { run, follows });
            }
        }
    }
    members
}

/// The planes of a grid of about so many cells, as near to cubes as the limits allow.
///
/// With the lengths `x`, `y`, `z` of the box, a cube's edge is `(x y z / n)^(1/3)`; along an axis that is shorter there
/// is one cell, and the other axes share the cells: `(x y / n)^(1/2)`, and so on.
fn planes(bounds: &BoundingBox, n_cells: f64) -> [Vec<f64>; 3] {
    let size = bounds.diagonal();
    // Relative to the longest, so that no product leaves the range of numbers.
    let size = size / size.max_element();
    let mut divided: Vec<usize> = (0..3).filter(|&axis| size[axis] > FLAT).collect();
    let edge = loop {
        let volume = divided.iter().fold(1.0, |volume, &axis| volume * size[axis]) / n_cells;
        let edge = match divided.len() {
            3 => libm::cbrt(volume),
            2 => volume.sqrt(),
            _ => volume,
        };
        let before = divided.len();
        divided.retain(|&axis| size[axis] > edge);
        if divided.len() == before || divided.is_empty() {
            break edge;
        }
    };
    [0, 1, 2].map(|axis| {
        let n = if divided.contains(&axis) { (size[axis] / edge).min(MAX_CELLS_OF_AXIS) } else { 1.0 };
        let (n, low, high) = (n.max(1.0).floor(), bounds.min[axis], bounds.max[axis]);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 1 to 1024")]
        let inner = (1..n as u32).map(|i| (low + (high - low) * (f64::from(i) / n)).min(high));
        std::iter::once(low).chain(inner).chain([high]).collect()
    })
}

/// The cells that a box overlaps, along each axis.
fn cells(planes: &[Vec<f64>; 3], inner: &BoundingBox) -> [Range<usize>; 3] {
    [0, 1, 2].map(|axis| locate(&planes[axis], inner.min[axis])..locate(&planes[axis], inner.max[axis]) + 1)
}

fn n_cells(ranges: &[Range<usize>; 3]) -> u64 {
    ranges.iter().map(|range| range.len() as u64).product()
}

/// The last cell that begins at `x` or before; the first if none does.
///
/// Found by a division and put right by the planes themselves, so that a coordinate and a plane are never compared in
/// two ways.
#[inline(always)]
pub(super) fn locate(planes: &[f64], x: f64) -> usize {
    let n = planes.len() - 1;
    let share = (x - planes[0]) / (planes[n] - planes[0]);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, and is put right"
    )]
    let mut cell = ((share * n as f64) as usize).min(n - 1);
    while cell > 0 && planes[cell] > x {
        cell -= 1;
    }
    while cell + 1 < n && planes[cell + 1] <= x {
        cell += 1;
    }
    cell
}
