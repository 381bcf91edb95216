//! Puts primitives into the order of leaves, and into blocks that are tested at once.

use std::ops::Range;

use rayon::prelude::*;
use rayset_geometry::glam::DVec3;
use rayset_geometry::{PrimitiveColumns, PrimitiveKind, Sides};
use rayset_simd::large_page_vec;

use super::{NO_BLOCK, Place, PolygonBlock, Run, Shapes};
use crate::axes::AxisBlock;
use crate::build::Reference;
use crate::cells::PolygonCells;
use crate::fans::{FanBlock, fan_len};
use crate::frame::Frame;
use crate::interval::SphereBlock;
use crate::shaft::BoxBlock;
use crate::triangles::TriangleBlock;

impl<const W: usize> Shapes<W> {
    /// Puts primitives in the order of leaves; returns for each leaf its first run.
    pub(crate) fn arrange(
        frame: &Frame,
        source: &PrimitiveColumns,
        items: &[(PrimitiveKind, u32, Sides)],
        references: &[Reference],
        leaves: &[Range<u32>],
    ) -> (Self, Vec<u32>) {
        let first = items.first();
        if let Some(&(kind @ (PrimitiveKind::Sphere | PrimitiveKind::Triangle), _, sides)) = first
            && items.iter().all(|item| (item.0, item.2) == (kind, sides))
        {
            return Self::arrange_alike(frame, source, items, references, leaves);
        }
        let mut shapes = Self { places: vec![Place::NOWHERE; items.len()], ..Self::default() };
        let mut members = Vec::new();
        let mut leaf_runs = Vec::with_capacity(leaves.len());
        for leaf in leaves {
            members.clear();
            members.extend(leaf.clone().map(|i| references[i as usize].primitive()));
            // By kind and sides for long runs; by number within, since the least number wins a tie.
            members.sort_unstable_by_key(|&number| {
                let (kind, _, sides) = items[number as usize];
                (kind as u8, sides as u8, number)
            });
            leaf_runs.push(index_of(shapes.runs.len()));
            for run in members.chunk_by(|&a, &b| {
                let key = |number: u32| (items[number as usize].0, items[number as usize].2);
                key(a) == key(b)
            }) {
                shapes.push_run(frame, source, items, run);
            }
            if let Some(last) = shapes.runs.last_mut() {
                last.goes_on = false;
            }
        }
        shapes.only =
            items.first().map(|first| first.0).filter(|&kind| items.iter().all(|item| item.0 == kind));
        shapes.spheres_have_backs = spheres_have_backs(items);
        shapes.is_flat = shapes.columns.is_flat() || !shapes.triangles.is_empty();
        (shapes, leaf_runs)
    }

    /// The same for spheres alone, or triangles, all visible from the same sides: a leaf is a run and a block, and the
    /// primitives stand as the references do, so that each can be put in its place by any thread.
    fn arrange_alike(
        frame: &Frame,
        source: &PrimitiveColumns,
        items: &[(PrimitiveKind, u32, Sides)],
        references: &[Reference],
        leaves: &[Range<u32>],
    ) -> (Self, Vec<u32>) {
        let (kind, _, sides) = items[0];
        let index = |reference: &Reference| items[reference.primitive() as usize].1;
        let mut shapes = Self { only: Some(kind), ..Self::default() };
        shapes.spheres_have_backs = spheres_have_backs(&items[..1]);
        let run = |(block, leaf): (usize, &Range<u32>)| Run {
            kind,
            sides,
            goes_on: false,
            len: u16::try_from(leaf.len()).expect("a leaf is small"),
            first: leaf.start,
            block: index_of(block),
            boxes: NO_BLOCK,
        };
        shapes.runs = collected(leaves.par_iter().enumerate().with_min_len(1024).map(run));
        let members = |leaf: &Range<u32>| &references[leaf.start as usize..leaf.end as usize];
        if kind == PrimitiveKind::Sphere {
            let block = |leaf| {
                let mut block = SphereBlock::EMPTY;
                for (lane, reference) in members(leaf).iter().enumerate() {
                    let sphere = source.sphere(index(reference));
                    block.set(lane, frame.point(sphere.center()).to_array(), sphere.radius() * frame.scale);
                }
                block
            };
            shapes.sphere_blocks = collected(leaves.par_iter().with_min_len(64).map(block));
            let sphere = |reference| source.sphere(index(reference));
            shapes.spheres = collected(references.par_iter().with_min_len(1024).map(sphere));
        } else {
            shapes.is_flat = true;
            let triangle = |reference| source.triangle(index(reference));
            shapes.triangles = collected(references.par_iter().with_min_len(1024).map(triangle));
            let triangles = &shapes.triangles;
            let block = |leaf: &Range<u32>| {
                let mut block = TriangleBlock::EMPTY;
                for (lane, i) in leaf.clone().enumerate() {
                    let place = |vertex: &DVec3| frame.point(*vertex).to_array();
                    let [a, b, c] = triangles[i as usize].vertices();
                    block.set(lane, [place(a), place(b), place(c)]);
                }
                block
            };
            shapes.triangle_blocks = collected(leaves.par_iter().with_min_len(64).map(block));
            let blocks = shapes.triangle_blocks.par_iter_mut().zip(leaves).with_min_len(64);
            shapes.pairs = collected(blocks.map(|(block, leaf)| block.pair_up(leaf.len())));
        }
        let numbers = collected(references.par_iter().with_min_len(1024).map(Reference::primitive));
        shapes.places = large_page_vec(items.len());
        shapes.places.resize(items.len(), Place::NOWHERE);
        for (place, reference) in references.iter().enumerate() {
            shapes.places[reference.primitive() as usize] = Place::new(kind, index_of(place));
        }
        shapes.numbers[kind as usize] = numbers;
        (shapes, (0..index_of(leaves.len())).collect())
    }

    fn push_run(
        &mut self,
        frame: &Frame,
        source: &PrimitiveColumns,
        items: &[(PrimitiveKind, u32, Sides)],
        members: &[u32],
    ) {
        let (kind, _, sides) = items[members[0] as usize];
        let first = index_of(self.numbers[kind as usize].len());
        let block = match kind {
            PrimitiveKind::Sphere => self.sphere_blocks.len(),
            PrimitiveKind::Triangle => self.triangle_blocks.len(),
            PrimitiveKind::Polygon => self.polygon_blocks.len(),
            PrimitiveKind::Cone => self.axis_blocks.len(),
        };
        let has_block = match kind {
            PrimitiveKind::Sphere | PrimitiveKind::Triangle | PrimitiveKind::Cone => true,
            PrimitiveKind::Polygon => self.push_polygons(frame, source, items, members),
        };
        let len = u16::try_from(members.len()).expect("a leaf is small");
        let block_index = if has_block { index_of(block) } else { NO_BLOCK };
        let boxes = index_of(self.box_blocks.len());
        self.runs.push(Run { kind, sides, goes_on: true, len, first, block: block_index, boxes });
        if matches!(kind, PrimitiveKind::Polygon | PrimitiveKind::Cone) {
            self.box_blocks.push(BoxBlock::EMPTY);
        }
        match kind {
            PrimitiveKind::Sphere => self.sphere_blocks.push(SphereBlock::EMPTY),
            PrimitiveKind::Triangle => self.triangle_blocks.push(TriangleBlock::EMPTY),
            PrimitiveKind::Cone => self.axis_blocks.push(AxisBlock::EMPTY),
            PrimitiveKind::Polygon => {}
        }
        for (lane, &number) in members.iter().enumerate() {
            let (_, index, _) = items[number as usize];
            match kind {
                PrimitiveKind::Sphere => {
                    let sphere = source.sphere(index);
                    let center = frame.point(sphere.center()).to_array();
                    self.sphere_blocks[block].set(lane, center, sphere.radius() * frame.scale);
                    self.spheres.push(sphere);
                }
                PrimitiveKind::Triangle => {
                    let triangle = source.triangle(index);
                    let place = |vertex: &DVec3| frame.point(*vertex).to_array();
                    let [a, b, c] = triangle.vertices();
                    self.triangle_blocks[block].set(lane, [place(a), place(b), place(c)]);
                    self.triangles.push(triangle);
                }
                PrimitiveKind::Polygon | PrimitiveKind::Cone => {
                    if kind == PrimitiveKind::Cone {
                        self.axis_blocks[block].set(lane, &source.cone_axis(index), frame);
                    }
                    let bounds = frame.cull_box(&source.bounding_box(kind, index));
                    self.box_blocks[boxes as usize].set(lane, &bounds);
                    self.columns.push_from(source, kind, index, sides);
                }
            }
            self.places[number as usize] = Place::new(kind, first + index_of(lane));
            self.numbers[kind as usize].push(number);
        }
        if kind == PrimitiveKind::Triangle {
            self.pairs.push(self.triangle_blocks[block].pair_up(members.len()));
        }
    }

    /// Puts polygons into a block, if there is one for them.
    fn push_polygons(
        &mut self,
        frame: &Frame,
        source: &PrimitiveColumns,
        items: &[(PrimitiveKind, u32, Sides)],
        members: &[u32],
    ) -> bool {
        let block = polygon_block(frame, source, items, members);
        let has_block = block.is_some();
        self.polygon_blocks.extend(block);
        has_block
    }
}

/// A block of polygons: of one that has no fan, its cells, if they can tell anything.
fn polygon_block<const W: usize>(
    frame: &Frame,
    source: &PrimitiveColumns,
    items: &[(PrimitiveKind, u32, Sides)],
    members: &[u32],
) -> Option<PolygonBlock<W>> {
    let mut block = FanBlock::EMPTY;
    let mut lane = 0;
    for (place, &number) in members.iter().enumerate() {
        let index = items[number as usize].1;
        let normal = source.normal_at(PrimitiveKind::Polygon, index, DVec3::ZERO);
        let points: Vec<DVec3> =
            source.polygon_vertices(index).into_iter().map(|vertex| frame.point(vertex)).collect();
        if fan_len(points.len(), W - lane).is_none() {
            let is_alone = members.len() == 1;
            return PolygonCells::of(&points, normal, frame).filter(|_| is_alone).map(PolygonBlock::Cells);
        }
        lane = block.set(lane, place, &points, normal);
    }
    Some(PolygonBlock::Fans(block))
}

/// What an iterator gives, in large pages.
fn collected<T: Send>(items: impl IndexedParallelIterator<Item = T>) -> Vec<T> {
    let mut all = large_page_vec(items.len());
    all.par_extend(items);
    all
}

fn index_of(len: usize) -> u32 {
    u32::try_from(len).expect("fewer than 2^32 primitives")
}

/// Whether there are spheres, all of which can be hit from the back.
fn spheres_have_backs(items: &[(PrimitiveKind, u32, Sides)]) -> bool {
    let mut spheres = items.iter().filter(|item| item.0 == PrimitiveKind::Sphere).peekable();
    spheres.peek().is_some() && spheres.all(|item| item.2 != Sides::Front)
}
