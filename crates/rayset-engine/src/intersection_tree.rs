//! The intersection trees of a bundle of ray-sets.

use std::ops::Range;

use rayset_geometry::Side;
use rayset_geometry::glam::DVec3;
use rayset_scene::MaterialId;
use rayset_simd::MAX_LANES;

use crate::lanes::{ROWS, lengthen, n_blocks};
use crate::leaving::among;
use crate::lights::Seen;
use crate::spawning::Spawning;
use crate::surfaces::Surfaces;
use crate::{Answers, Generation, Hit, RaySetIndex, Slot};

/// A ray of a tree and what it met.
///
/// Source: Speer et al. 1985, section 2.2 (the record of the objects intersected).
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// Which ray-set of the bundle it belongs to, counted from 0.
    pub ray_set: u32,
    /// Its place in the tree.
    pub slot: Slot,
    /// The unit direction of the ray.
    pub direction: DVec3,
    /// Its nearest intersection, and the surface there; `None` if it met nothing.
    pub hit: Option<(Hit, Surface)>,
    /// The greatest share of its intensity that reaches the pixel.
    pub weight: f64,
    /// The node whose hit it leaves, which stands before it; `None` for an initial ray.
    pub parent: Option<usize>,
    /// Whether the surface at its hit would refract, and reflects totally: the reflected ray carries the refracted share
    /// too.
    pub reflects_totally: bool,
}

/// The surface at a hit.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// The point, in world space.
    pub point: DVec3,
    /// The unit normal on the side the ray came from.
    pub normal: DVec3,
    /// The unit normal to shade with, on the same side.
    pub shading_normal: DVec3,
    /// The side the ray came from.
    pub side: Side,
    /// How the surface answers light: the first of the scene's materials that is the same as that of the object.
    pub material: MaterialId,
}

/// How a light stands to a hit point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightState {
    /// The surface faces away: no ray was cast.
    #[default]
    FacesAway,
    /// Something lies between.
    Hidden,
    /// The light shines on the point.
    Visible,
}

/// The trees of a bundle of ray-sets, grown level by level; children stand behind their parents.
///
/// The first nodes are the initial rays, one a ray-set, in order. A level is kept as columns: a [`Node`] is put together
/// when it is asked for.
#[derive(Clone, Debug, Default)]
pub struct IntersectionTrees {
    /// Those of the bundle come first; behind them memory is kept for deeper ones.
    levels: Vec<Level>,
    n_levels: usize,
    /// The first ray-set of the bundle.
    first: RaySetIndex,
}

impl IntersectionTrees {
    /// How many nodes there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.levels().iter().map(Level::len).sum()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All nodes, level by level.
    pub fn nodes(&self) -> impl Iterator<Item = Node> {
        let mut base = 0;
        let mut base_before = 0;
        self.levels().iter().flat_map(move |level| {
            let parents = std::mem::replace(&mut base_before, base);
            base += level.len();
            (0..level.len()).map(move |row| level.node(row, self.first, parents))
        })
    }

    /// A node.
    ///
    /// # Panics
    ///
    /// If there is no such node.
    #[must_use]
    pub fn node(&self, node: usize) -> Node {
        let (level, row) = self.place(node);
        let bases: usize = self.levels[..level.saturating_sub(1)].iter().map(Level::len).sum();
        self.levels[level].node(row, self.first, bases)
    }

    /// The state of every light at the hit of a node.
    ///
    /// # Panics
    ///
    /// If there is no such node.
    #[must_use]
    pub fn lights_of(&self, node: usize) -> Vec<LightState> {
        let (level, row) = self.place(node);
        self.levels[level].lights_of(row).iter().map(|seen| seen.state(row % ROWS)).collect()
    }

    /// The level of a node, counted from 0, and its row there.
    fn place(&self, node: usize) -> (usize, usize) {
        let mut row = node;
        for (i, level) in self.levels().iter().enumerate() {
            if row < level.len() {
                return (i, row);
            }
            row -= level.len();
        }
        panic!("there is no node {node}")
    }

    /// The levels, from that of the initial rays.
    pub(crate) fn levels(&self) -> &[Level] {
        &self.levels[..self.n_levels]
    }

    /// Begins new trees; returns the level of the initial rays, empty.
    pub(crate) fn begin(&mut self, first: RaySetIndex) -> &mut Level {
        self.first = first;
        if self.levels.is_empty() {
            self.levels.push(Level::default());
        }
        let roots = self.roots();
        roots.clear();
        roots
    }

    /// The level of the initial rays, once it has begun.
    pub(crate) fn roots(&mut self) -> &mut Level {
        &mut self.levels[0]
    }

    /// A level to be grown, counted from 0, and the next, empty.
    pub(crate) fn open(&mut self, level: usize) -> (&mut Level, &mut Level) {
        if self.levels.len() < level + 2 {
            self.levels.resize_with(level + 2, Level::default);
        }
        let (before, next) = self.levels.split_at_mut(level + 1);
        next[0].clear();
        (&mut before[level], &mut next[0])
    }

    /// How many levels there are, once they are grown.
    pub(crate) fn close(&mut self, n_levels: usize) {
        self.n_levels = n_levels;
    }
}

/// The rays of one depth of a bundle of trees and what they met, as columns.
///
/// Columns that are written in lanes never shrink, and hold anything behind the last ray.
#[derive(Clone, Debug, Default)]
pub(crate) struct Level {
    pub(crate) rays: Generation,
    /// Where the rays of each slot stand.
    pub(crate) runs: Vec<Run>,
    /// The greatest share of each ray's intensity that reaches the pixel, with room for lanes beyond.
    pub(crate) weights: Vec<f64>,
    /// The row, of the level before, whose hit each ray leaves; none for initial rays.
    pub(crate) parents: Vec<u32>,
    pub(crate) answers: Answers<Option<Hit>>,
    /// The surfaces at the hits, in blocks of sixteen rows.
    pub(crate) surfaces: Vec<Surfaces>,
    /// How each light is seen from the hits of each block.
    pub(crate) lights: Vec<Seen>,
    pub(crate) n_lights: usize,
    /// Where the hits send rays, if any does.
    pub(crate) spawning: Vec<Spawning>,
    pub(crate) is_spawning: bool,
}

/// Rays of one slot, which stand together.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub(crate) slot: Slot,
    pub(crate) rows: Range<usize>,
}

impl Level {
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.rays.len()
    }

    /// Removes all rays and keeps the memory.
    fn clear(&mut self) {
        self.rays.clear();
        self.runs.clear();
        self.answers.clear();
        self.is_spawning = false;
    }

    /// Makes room for so many rays, and for lanes beyond.
    pub(crate) fn make_room(&mut self, n: usize) {
        self.rays.make_room(n);
        lengthen(&mut self.weights, n + MAX_LANES, 1.0);
    }

    /// Makes room for what is seen from the hits.
    pub(crate) fn make_room_for_hits(&mut self, n_lights: usize) {
        let n = n_blocks(self.len());
        self.n_lights = n_lights;
        lengthen(&mut self.surfaces, n, Surfaces::default());
        lengthen(&mut self.lights, n * n_lights, Seen::default());
        lengthen(&mut self.spawning, n, Spawning::default());
    }

    /// The surfaces at the hits, in blocks.
    pub(crate) fn surfaces(&self) -> &[Surfaces] {
        &self.surfaces[..n_blocks(self.len())]
    }

    /// How many of some rows have hits, once it is known what is seen from them.
    pub(crate) fn n_hits(&self, rows: &Range<usize>) -> u64 {
        let blocks = rows.start / ROWS..n_blocks(rows.end);
        blocks.map(|block| u64::from((self.surfaces[block].hit & among(rows, block)).count_ones())).sum()
    }

    /// How each light is seen from the block of a row.
    fn lights_of(&self, row: usize) -> &[Seen] {
        &self.lights[row / ROWS * self.n_lights..][..self.n_lights]
    }

    /// Whether the surface at the hit in a row would refract, and reflects totally.
    #[inline(always)]
    pub(crate) fn reflects_totally(&self, row: usize) -> bool {
        self.is_spawning && self.spawning[row / ROWS].total >> (row % ROWS) & 1 == 1
    }

    /// The node of a row; `first` is the first ray-set of the bundle, `parents` the first node of the level before.
    fn node(&self, row: usize, first: RaySetIndex, parents: usize) -> Node {
        let surface = |hit: Hit| (hit, self.surfaces[row / ROWS].surface(row % ROWS));
        Node {
            ray_set: self.rays.ray_sets()[row].0 - first.0,
            slot: self.rays.slots()[row],
            direction: DVec3::from_array(self.rays.directions().each_ref().map(|column| column[row])),
            hit: self.answers.values[row].map(surface),
            weight: self.weights[row],
            parent: self.parents.get(row).map(|&parent| parents + parent as usize),
            reflects_totally: self.reflects_totally(row),
        }
    }
}
