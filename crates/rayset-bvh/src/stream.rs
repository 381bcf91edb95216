//! Rays of a list among triangles, many at once: node by node, each with the rays that enter it.
//!
//! Nodes are visited and not rays: a node's boxes are tested by one ray after the other, and those that enter a child are
//! listed for it. What a ray by itself takes longest for is spared, guessing where it goes on and waiting for that: guesses
//! are made once for a list, and tests of one node by several rays do not wait for each other. Rays of a list run the same
//! way, so that it is known once which planes of all boxes are near. In which order children are visited depends on that way
//! alone, and not on where each ray enters them, so that each ray visits what it would visit by itself, in the same order.
//!
//! Among triangles alone: tests of spheres need most of what is prepared of a ray, which a ray by itself keeps in registers.
//!
//! Source: Barringer and Akenine-Möller 2014, "Dynamic ray stream traversal".

use std::any::Any;
use std::marker::PhantomData;

use rayset_geometry::Departure;
use rayset_simd::{LaneMask, Lanes, Part, Simd};

use crate::columns::{HitOrNone, RayColumns, RayOf};
use crate::each::{AnyHit, NearestHit, OfRay};
use crate::entrance::{ahead, enter};
use crate::exact::Departing;
use crate::frame::Frame;
use crate::hierarchy::{Scratch, Wide};
use crate::node::{Child, Node, Tree};
use crate::ray::CullRays;
use crate::shapes::{Content, Nearest, Traced};
use crate::traverse::{Begin, BoxRay, farthest_first, sides};

/// How many rays go together at most: what is prepared of them stays in the first cache.
const MOST: usize = 128;

/// Fewer rays than this go on from a node one by one.
const LEAST: usize = 3;

/// Where the span of a ray ends that has its answer.
const ANSWERED: f32 = f32::NEG_INFINITY;

/// Why a ray of a list is one that may hit something.
const LISTED: &str = "rays that can hit nothing are in no list";

/// Whole registers are written, and read, where lists end.
const BEHIND: usize = 16;

/// The rays at a node, or at a child that they go on to.
#[derive(Clone, Copy, Debug)]
struct Group {
    child: Child,
    /// The axes along which all of them run backwards, a bit each; along the others none does.
    turned: u32,
    len: usize,
}

/// Rays that wait for a child.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    group: Group,
    /// Where their list begins.
    first: usize,
    /// Where each of them enters the child stands so far behind its place in the column of distances.
    column: usize,
    /// Where the distances end that it and what waits below it read.
    near_end: usize,
}

/// What is kept between lists; it grows as rays and lists come.
#[derive(Debug)]
struct Stream<const W: usize> {
    prepared: Vec<CullRays<W>>,
    departures: [Option<Departure>; MOST],
    /// Where the span of each ray ends by what is known, in culling space, or more.
    ends: [f32; MOST],
    nearest: [Nearest; MOST],
    /// Of the rays that have been prepared together, the lanes that enter each child of the root.
    entered_root: Vec<[u32; W]>,
    waiting: Vec<Waiting>,
    /// Lists of rays, one behind the other: of what waits.
    lists: Vec<u32>,
    /// Where rays enter children, if it is asked where hits are: columns of a node's children for each ray.
    near: Vec<f32>,
    /// The rays at a node; as they are listed; and the children that each enters, a bit each.
    here: [u32; MOST + BEHIND],
    listed: [u32; MOST + BEHIND],
    entered: [u32; MOST + BEHIND],
}

/// A ray in a list: its number in the lowest bits, and above where its distances stand.
///
/// There are at most 71 nodes on the way from a root, and as many distances for each as there are rays and lanes: fewer than
/// 2^18.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "a stream is short, and a tree not deep")]
fn listed(ray: usize, near: usize) -> u32 {
    (near * MOST + ray) as u32
}

/// The number of a ray as it stands among those at a node.
#[inline(always)]
fn number(ray: usize) -> u32 {
    listed(ray, 0)
}

#[inline(always)]
fn ray_of(listed: u32) -> usize {
    listed as usize % MOST
}

#[inline(always)]
fn near_of(listed: u32) -> usize {
    listed as usize / MOST
}

impl<const W: usize> Stream<W> {
    fn new() -> Box<Self> {
        Box::new(Self {
            prepared: vec![CullRays::NONE; MOST / W],
            departures: [None; MOST],
            ends: [ANSWERED; MOST],
            nearest: [Nearest::NONE; MOST],
            entered_root: vec![[0; W]; MOST / W],
            waiting: Vec::new(),
            lists: Vec::new(),
            near: vec![0.0; MOST * W],
            here: [0; MOST + BEHIND],
            listed: [0; MOST + BEHIND],
            entered: [0; MOST + BEHIND],
        })
    }

    /// Where the lists end that wait, and the distances that they read.
    #[inline(always)]
    fn in_use(&self) -> (usize, usize) {
        self.waiting.last().map_or((0, 0), |waiting| (waiting.first + waiting.group.len, waiting.near_end))
    }

    /// The rays of the list that waits last which still look for something there.
    #[inline(always)]
    fn take<Q: OfRay>(&mut self) -> Option<Group> {
        let Waiting { mut group, first, column, .. } = self.waiting.pop()?;
        let Self { lists, near, here, ends, .. } = self;
        let mut n = 0;
        for &listed in &lists[first..first + group.len] {
            let end = ends[ray_of(listed)];
            here[n] = number(ray_of(listed));
            n += usize::from(if Q::ANY {
                end > ANSWERED
            } else {
                // As entries of a stack are compared: what is below zero counts as zero.
                near[near_of(listed) + column] <= end.max(0.0)
            });
        }
        group.len = n;
        Some(group)
    }
}

/// Room for the streams of a hierarchy, which alone knows how wide they are.
#[derive(Debug, Default)]
pub(crate) struct Room(Option<Box<dyn Any + Send + Sync>>);

impl Clone for Room {
    /// Room of its own.
    fn clone(&self) -> Self {
        Self(None)
    }
}

/// Begins at a child.
struct At(Child);

impl<const W: usize> Begin<W> for At {
    #[inline(always)]
    fn nearest(&self, _: &Tree<W>, _: &mut [u64], _: &mut usize) -> Child {
        self.0
    }

    #[inline(always)]
    fn any<S: Simd>(&self, _: S, _: &Tree<W>, _: u32, _: &mut [u32], _: &mut usize) -> Option<Child> {
        Some(self.0)
    }
}

/// What is asked about the rays of a stream.
pub(crate) trait OfStream: OfRay {
    /// A ray visits a leaf, or all that it enters below a node.
    fn visit<S: Simd, C: Content, const W: usize>(
        simd: S,
        wide: &Wide<W>,
        child: Child,
        traced: &Traced<'_, W>,
        so_far: (&mut Nearest, &mut f32),
        scratch: &mut Scratch,
    );

    /// The answers to rays that were prepared together.
    fn write<S: Simd, const W: usize>(
        simd: S,
        wide: &Wide<W>,
        departing: &Departing<'_>,
        found: (&[Nearest], &[f32]),
        answers: &mut [Self::Answer],
    );
}

impl OfStream for AnyHit<false> {
    #[inline(always)]
    fn visit<S: Simd, C: Content, const W: usize>(
        simd: S,
        wide: &Wide<W>,
        child: Child,
        traced: &Traced<'_, W>,
        (_, end): (&mut Nearest, &mut f32),
        scratch: &mut Scratch,
    ) {
        let is_hit = if child.is_leaf() {
            scratch.steps.leaves += 1;
            let tests = &mut scratch.primitive_tests;
            wide.shapes.any::<S, C>(simd, child.leaf_index(), traced, *end, tests, &mut None)
        } else {
            wide.occluded_of::<S, C, false>(simd, &At(child), traced, scratch)
        };
        if is_hit {
            *end = ANSWERED;
        }
    }

    #[inline(always)]
    fn write<S: Simd, const W: usize>(
        _: S,
        _: &Wide<W>,
        _: &Departing<'_>,
        (_, ends): (&[Nearest], &[f32]),
        answers: &mut [bool],
    ) {
        for (answer, &end) in answers.iter_mut().zip(ends) {
            *answer = end <= ANSWERED;
        }
    }
}

impl OfStream for NearestHit {
    #[inline(always)]
    fn visit<S: Simd, C: Content, const W: usize>(
        simd: S,
        wide: &Wide<W>,
        child: Child,
        traced: &Traced<'_, W>,
        (nearest, end): (&mut Nearest, &mut f32),
        scratch: &mut Scratch,
    ) {
        if child.is_leaf() {
            scratch.steps.leaves += 1;
            let tests = &mut scratch.primitive_tests;
            wide.shapes.nearest::<S, C>(simd, child.leaf_index(), traced, nearest, end, tests);
        } else {
            let so_far = (*nearest, *end);
            (*nearest, *end) = wide.nearest_from::<S, C, true>(simd, &At(child), traced, so_far, scratch);
        }
    }

    #[inline(always)]
    fn write<S: Simd, const W: usize>(
        simd: S,
        wide: &Wide<W>,
        departing: &Departing<'_>,
        (nearest, _): (&[Nearest], &[f32]),
        answers: &mut [HitOrNone],
    ) {
        let mut found = [Nearest::NONE; W];
        found[..nearest.len()].copy_from_slice(nearest);
        NearestHit.answer(simd, wide, departing, &found, answers);
    }
}

/// Rays of a list that go together: a function of its own for one content and question.
pub(crate) struct OfStreams<'a, C, Q: OfStream, const W: usize> {
    pub(crate) content: PhantomData<C>,
    pub(crate) wide: &'a Wide<W>,
    pub(crate) frame: &'a Frame,
    pub(crate) columns: &'a RayColumns<'a>,
    /// Where the answers go, a place for each ray at least.
    pub(crate) places: &'a mut [Q::Answer],
    pub(crate) scratch: &'a mut Scratch,
}

impl<S: Simd, C: Content, Q: OfStream, const W: usize> Part<S> for OfStreams<'_, C, Q, W> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { wide, frame, columns, places, scratch, .. } = self;
        assert!(columns.len() <= places.len(), "each ray has a place");
        let (columns, places) = (columns.cut(0..columns.len()), &mut places[..columns.len()]);
        let kept = scratch.room.0.take().and_then(|kept| kept.downcast().ok());
        let mut stream: Box<Stream<W>> = kept.unwrap_or_else(Stream::new);
        for (i, places) in places.chunks_mut(MOST).enumerate() {
            let rays = Streamed::<W> { wide, columns, first: i * MOST };
            rays.prepare::<S, C>(simd, frame, places.len(), &mut stream);
            rays.begin::<S, C, Q>(simd, places.len(), &mut stream, scratch);
            rays.go_on::<S, C, Q>(simd, &mut stream, scratch);
            rays.end::<S, Q>(simd, places, &stream);
        }
        scratch.room.0 = Some(stream);
    }
}

/// Rays of columns from one on.
#[derive(Clone, Copy)]
struct Streamed<'a, const W: usize> {
    wide: &'a Wide<W>,
    columns: RayColumns<'a>,
    first: usize,
}

impl<const W: usize> Streamed<'_, W> {
    /// Prepares so many rays.
    #[inline(always)]
    fn prepare<S: Simd, C: Content>(&self, simd: S, frame: &Frame, n: usize, stream: &mut Stream<W>) {
        let Self { wide, columns, first } = *self;
        let Stream { prepared, departures, ends, nearest, .. } = stream;
        for (block, prepared) in prepared[..n.div_ceil(W)].iter_mut().enumerate() {
            let at = block * W;
            let of = at..n.min(at + W);
            prepared.prepare(simd, frame, &columns, (first + at, of.len()), wide.targets::<C>());
            ends[of.clone()].copy_from_slice(&prepared.ends()[..of.len()]);
            nearest[of.clone()].fill(Nearest::NONE);
            for (ray, departure) in of.clone().zip(&mut departures[of]) {
                *departure = wide.shapes.departure(columns.left(first + ray));
            }
        }
    }

    /// The rays that may hit something test the root, as many together as there are lanes, and wait for what they enter, in
    /// lists for each way that rays run.
    #[inline(always)]
    fn begin<S: Simd, C: Content, Q: OfRay>(
        &self,
        simd: S,
        n: usize,
        stream: &mut Stream<W>,
        scratch: &mut Scratch,
    ) {
        let tree = &self.wide.tree;
        let root = &tree.nodes[0];
        let is_leaf = tree.root.is_leaf();
        let Stream { prepared, entered_root, waiting, lists, near, listed: numbers, .. } = stream;
        let (mut ways, mut children) = (0, 0);
        for (block, prepared) in prepared[..n.div_ceil(W)].iter().enumerate() {
            let at = block * W;
            let found = prepared.found((n - at).min(W));
            ways |= (0..8).map(|way| u32::from(prepared.turned(way) & found != 0) << way).sum::<u32>();
            for lane in 0..W {
                numbers[at + lane] = listed(at + lane, at * W + lane);
            }
            let entered_root = &mut entered_root[block];
            *entered_root = [0; W];
            if is_leaf {
                // It stands in the first slot of the first node, and is entered untested.
                (entered_root[0], children) = (found, 1);
                near[at * W..][..W].fill(0.0);
                continue;
            }
            scratch.steps.nodes += u64::from(found.count_ones());
            let slabs = prepared.slabs(simd);
            let faces = if C::FACES { Some(prepared.faces(simd)) } else { None };
            let ends = simd.load_f32(prepared.ends());
            for child in (0..W).take_while(|&child| !root.is_empty(child)) {
                let (mut lanes, at_child) = enter(simd, root, child, &slabs, ends);
                if let Some(faces) = &faces {
                    lanes = lanes & ahead(simd, root, child, &slabs, faces);
                }
                if !Q::ANY {
                    at_child.max(simd.splat_f32(0.0)).store(&mut near[(at + child) * W..][..W]);
                }
                entered_root[child] = lanes.bits() & found;
                children |= u32::from(entered_root[child] != 0) << child;
            }
        }
        waiting.clear();
        if lists.len() < n * children.count_ones() as usize + BEHIND {
            lists.resize(n * children.count_ones() as usize + BEHIND, 0);
        }
        let mut end = 0;
        for turned in (0..8).filter(|way| ways >> way & 1 == 1) {
            let (order, len) = in_order::<S, Q, W>(simd, root, tree.root, turned, children);
            for &lane in &order[..len] {
                let (first, lane) = (end, lane as usize);
                for (block, prepared) in prepared[..n.div_ceil(W)].iter().enumerate() {
                    let lanes = simd.mask_f32(entered_root[block][lane] & prepared.turned(turned));
                    simd.compress_u32(lanes, &numbers[block * W..], &mut lists[end..]);
                    end += lanes.bits().count_ones() as usize;
                }
                let child = if is_leaf { tree.root } else { Child(root.children[lane]) };
                let group = Group { child, turned, len: end - first };
                waiting.push(Waiting { group, first, column: lane * W, near_end: n.next_multiple_of(W) * W });
            }
        }
    }

    /// Visits what waits, the last first.
    #[inline(always)]
    fn go_on<S: Simd, C: Content, Q: OfStream>(
        &self,
        simd: S,
        stream: &mut Stream<W>,
        scratch: &mut Scratch,
    ) {
        while let Some(mut group) = stream.take::<Q>() {
            while group.len >= LEAST && !group.child.is_leaf() {
                scratch.steps.nodes += group.len as u64;
                group = self.enter::<S, C, Q>(simd, group, stream);
            }
            self.visit_each::<S, C, Q>(simd, group, stream, scratch);
        }
    }

    /// Rays visit a leaf, or all that they enter below a node, one by one.
    #[inline(always)]
    fn visit_each<S: Simd, C: Content, Q: OfStream>(
        &self,
        simd: S,
        Group { child, len, .. }: Group,
        stream: &mut Stream<W>,
        scratch: &mut Scratch,
    ) {
        let Self { wide, columns, first } = self;
        let Stream { prepared, departures, ends, nearest, here, .. } = stream;
        for &ray in &here[..len] {
            let ray = ray_of(ray);
            let cull = prepared[ray / W].ray(ray % W).expect(LISTED);
            let of = RayOf { columns, i: first + ray };
            let traced = Traced { cull: cull.with_axes_known(), ray: of, departure: departures[ray] };
            Q::visit::<S, C, W>(simd, wide, child, &traced, (&mut nearest[ray], &mut ends[ray]), scratch);
        }
    }

    /// Rays test the boxes of a node, and wait for the children that they enter; gives those that go on at once.
    #[inline(always)]
    fn enter<S: Simd, C: Content, Q: OfRay>(
        &self,
        simd: S,
        Group { child, turned, len: n }: Group,
        stream: &mut Stream<W>,
    ) -> Group {
        let node = &self.wide.tree.nodes[child.node_index()];
        let (mut end, near_first) = stream.in_use();
        let near_end = if Q::ANY { 0 } else { near_first + n * W };
        let Stream { prepared, ends, waiting, lists, near, here, listed: entries, entered, .. } = stream;
        if near.len() < near_end {
            near.resize(near_end, 0.0);
        }
        let (planes, zero) = (sides(simd, node, turned), simd.splat_f32(0.0));
        let mut children = 0;
        for i in 0..n.min(MOST) {
            let ray = ray_of(here[i]);
            let cull = prepared[ray / W].ray(ray % W).expect(LISTED);
            let end = simd.splat_f32(ends[ray]);
            let (bits, near_each) = BoxRay::new(simd, cull, C::FACES).test_sides(simd, node, planes, end);
            entries[i] = here[i];
            if !Q::ANY {
                let at = near_first + i * W;
                near_each.max(zero).store(&mut near[at..at + W]);
                entries[i] = listed(ray, at);
            }
            entered[i] = bits;
            children |= bits;
        }
        // Behind the rays there are none.
        entered[n..n + W].fill(0);
        let (order, len) = in_order::<S, Q, W>(simd, node, child, turned, children);
        let Some((&next, others)) = order[..len].split_last() else { return Group { child, turned, len: 0 } };
        let most = end + n * others.len() + BEHIND;
        if lists.len() < most {
            lists.resize(most, 0);
        }
        for &lane in others {
            let first = end;
            for block in (0..n).step_by(W) {
                let lanes = simd.any_bits_u32(&entered[block..block + W], 1 << lane);
                simd.compress_u32(lanes, &entries[block..block + W], &mut lists[end..end + W]);
                end += lanes.bits().count_ones() as usize;
            }
            let group = Group { child: Child(node.children[lane as usize % W]), turned, len: end - first };
            waiting.push(Waiting { group, first, column: lane as usize, near_end });
        }
        // Those that go on move up, behind what has been read.
        let mut end = 0;
        for block in (0..n).step_by(W) {
            let lanes = simd.any_bits_u32(&entered[block..block + W], 1 << next);
            let rays: [u32; W] = here[block..block + W].try_into().expect("as many as lanes");
            simd.compress_u32(lanes, &rays, &mut here[end..end + W]);
            end += lanes.bits().count_ones() as usize;
        }
        Group { child: Child(node.children[next as usize % W]), turned, len: end }
    }

    /// Writes the answers.
    #[inline(always)]
    fn end<S: Simd, Q: OfStream>(&self, simd: S, places: &mut [Q::Answer], stream: &Stream<W>) {
        let Self { wide, columns, first } = self;
        for (block, places) in places.chunks_mut(W).enumerate() {
            let of = block * W..block * W + places.len();
            let left = columns.left_by(first + of.start..first + of.end);
            let departing = Departing { rays: *columns, first: first + of.start, left };
            Q::write::<S, W>(simd, wide, &departing, (&stream.nearest[of.clone()], &stream.ends[of]), places);
        }
    }
}

/// Of a node, the slots of children given by their bits, in the order in which lists are made of them: what is listed last is
/// visited first, as by a ray by itself.
#[inline(always)]
fn in_order<S: Simd, Q: OfRay, const W: usize>(
    simd: S,
    node: &Node<W>,
    number: Child,
    turned: u32,
    mut children: u32,
) -> ([u32; W], usize) {
    if Q::ANY {
        let (mut order, mut len, is_turned) = ([0; W], 0, number.is_turned(turned));
        while children != 0 {
            let lane = if is_turned { 31 - children.leading_zeros() } else { children.trailing_zeros() };
            children ^= 1 << lane;
            order[len % W] = lane;
            len += 1;
        }
        return (order, len);
    }
    farthest_first(simd, node, turned, children)
}
