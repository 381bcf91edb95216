//! Rays that ask for any hit of triangles, many at once: node by node, each with the rays that enter it.
//!
//! Where any hit will do, all that a ray enters has to be visited, in any order. So nodes are visited and not rays: a node's
//! boxes are tested by one ray after the other, and those that enter a child are listed for it. What a ray by itself takes
//! longest for is spared, guessing where it goes on and waiting for that: guesses are made once for a list, and tests of
//! one node by several rays do not wait for each other. Each ray visits what it would visit by itself, in the same order.
//!
//! Among triangles alone: tests of spheres need most of what is prepared of a ray, which a ray by itself keeps in registers.
//!
//! Source: Barringer and Akenine-Möller 2014, "Dynamic ray stream traversal".

use std::any::Any;
use std::marker::PhantomData;

use rayset_geometry::Departure;
use rayset_simd::{LaneMask, Part, Simd};

use crate::columns::{RayColumns, RayOf};
use crate::frame::Frame;
use crate::hierarchy::{Scratch, Wide};
use crate::node::{Child, Tree};
use crate::ray::CullRays;
use crate::shapes::{Content, Traced};
use crate::traverse::{Begin, BoxRay};

/// How many rays go together at most: what is prepared of them stays in the first cache.
const MOST: usize = 128;

/// Fewer rays than this go on from a node one by one.
const LEAST: usize = 3;

/// Rays that wait for a child.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    child: Child,
    /// The axes along which all of them run backwards, a bit each; along the others none does.
    turned: u32,
    /// Where their list begins, and how long it is.
    first: usize,
    len: usize,
}

/// What is kept between lists; it grows as rays and lists come.
#[derive(Debug, Default)]
struct Stream<const W: usize> {
    prepared: Vec<CullRays<W>>,
    departures: Vec<Option<Departure>>,
    waiting: Vec<Waiting>,
    /// Lists of rays by their places in the stream, one behind the other: of what waits.
    lists: Vec<u32>,
    /// The places of rays in a stream, as numbers.
    numbers: Vec<u32>,
    /// The rays at a node, and the children that each enters, a bit each.
    here: Vec<u32>,
    entered: Vec<u32>,
}

impl<const W: usize> Stream<W> {
    /// Has room for so many rays.
    fn reserve(&mut self, rays: usize) {
        if self.here.len() < rays + W {
            self.prepared.resize(rays.div_ceil(W), CullRays::NONE);
            self.departures.resize(rays, None);
            // Whole registers are written, and read, where lists end.
            self.numbers = (0..rays + W).map(number).collect();
            self.here.resize(rays + W, 0);
            self.entered.resize(rays + W, 0);
            self.lists.resize(self.lists.len().max(rays + W), 0);
        }
    }

    /// Lists the rays here that enter a child, from a place on; where the list ends.
    #[inline(always)]
    fn list<S: Simd>(
        &mut self,
        simd: S,
        n: usize,
        (child, lane): (Child, u32),
        place: (u32, usize),
    ) -> usize {
        let (turned, first) = place;
        let mut end = first;
        for block in (0..n).step_by(W) {
            let lanes = simd.any_bits_u32(&self.entered[block..block + W], 1 << lane);
            simd.compress_u32(lanes, &self.here[block..block + W], &mut self.lists[end..end + W]);
            end += lanes.bits().count_ones() as usize;
        }
        self.waiting.push(Waiting { child, turned, first, len: end - first });
        end
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

/// Rays of a list that ask for any hit: a function of its own for one content.
pub(crate) struct AnyOfStreams<'a, C, const W: usize> {
    pub(crate) content: PhantomData<C>,
    pub(crate) wide: &'a Wide<W>,
    pub(crate) frame: &'a Frame,
    pub(crate) columns: &'a RayColumns<'a>,
    /// Where the answers go, a place for each ray at least.
    pub(crate) places: &'a mut [bool],
    pub(crate) scratch: &'a mut Scratch,
}

impl<S: Simd, C: Content, const W: usize> Part<S> for AnyOfStreams<'_, C, W> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { wide, frame, columns, places, scratch, .. } = self;
        assert!(columns.len() <= places.len(), "each ray has a place");
        let (columns, places) = (columns.cut(0..columns.len()), &mut places[..columns.len()]);
        let kept = scratch.room.0.take().and_then(|kept| kept.downcast().ok());
        let mut stream: Box<Stream<W>> = kept.unwrap_or_default();
        stream.reserve(places.len().min(MOST));
        for (i, places) in places.chunks_mut(MOST).enumerate() {
            let rays = Streamed { wide, columns, first: i * MOST };
            rays.begin::<S, C>(simd, frame, places, &mut stream);
            rays.go_on::<S, C>(simd, places, &mut stream, scratch);
        }
        scratch.room.0 = Some(stream);
    }
}

/// Rays of columns from one on, as many as there are places for answers.
#[derive(Clone, Copy)]
struct Streamed<'a, const W: usize> {
    wide: &'a Wide<W>,
    columns: RayColumns<'a>,
    first: usize,
}

impl<const W: usize> Streamed<'_, W> {
    /// Prepares the rays, and lets those that may hit something wait for the root, in a list for each way that rays run.
    #[inline(always)]
    fn begin<S: Simd, C: Content>(
        &self,
        simd: S,
        frame: &Frame,
        places: &mut [bool],
        stream: &mut Stream<W>,
    ) {
        let Self { wide, columns, first } = *self;
        let mut ways = 0;
        for (block, places) in places.chunks_mut(W).enumerate() {
            let (at, prepared) = (block * W, &mut stream.prepared[block]);
            prepared.prepare(simd, frame, &columns, (first + at, places.len()), wide.targets::<C>());
            let found = prepared.found(places.len());
            ways |= (0..8).map(|way| u32::from(prepared.turned(way) & found != 0) << way).sum::<u32>();
            for (lane, place) in places.iter_mut().enumerate() {
                *place = false;
                stream.departures[at + lane] = wide.shapes.departure(columns.left(first + at + lane));
            }
        }
        stream.waiting.clear();
        let (child, mut end) = (wide.tree.root, 0);
        for turned in (0..8).filter(|way| ways >> way & 1 == 1) {
            let first = end;
            for (block, prepared) in stream.prepared[..places.len().div_ceil(W)].iter().enumerate() {
                let of = block * W..places.len().min((block + 1) * W);
                let lanes = simd.mask_f32(prepared.turned(turned) & prepared.found(of.len()));
                simd.compress_u32(lanes, &stream.numbers[of.start..], &mut stream.lists[end..]);
                end += lanes.bits().count_ones() as usize;
            }
            stream.waiting.push(Waiting { child, turned, first, len: end - first });
        }
    }

    /// Visits what waits, the last first.
    #[inline(always)]
    fn go_on<S: Simd, C: Content>(
        &self,
        simd: S,
        places: &mut [bool],
        stream: &mut Stream<W>,
        scratch: &mut Scratch,
    ) {
        while let Some(Waiting { child, turned, first, len }) = stream.waiting.pop() {
            let mut n = 0;
            for &ray in &stream.lists[first..first + len] {
                stream.here[n] = ray;
                n += usize::from(!places[ray as usize]);
            }
            if child.is_leaf() || n < LEAST {
                self.visit_each::<S, C>(simd, child, n, places, stream, scratch);
            } else {
                scratch.steps.nodes += n as u64;
                self.enter::<S, C>(simd, child, n, (turned, first), stream);
            }
        }
    }

    /// The rays here visit a leaf, or all that they enter below a node, one by one.
    #[inline(always)]
    fn visit_each<S: Simd, C: Content>(
        &self,
        simd: S,
        child: Child,
        n: usize,
        places: &mut [bool],
        stream: &Stream<W>,
        scratch: &mut Scratch,
    ) {
        let Self { wide, columns, first } = self;
        for &ray in &stream.here[..n] {
            let ray = ray as usize;
            let Some(cull) = stream.prepared[ray / W].ray(ray % W) else { continue };
            let of = RayOf { columns, i: first + ray };
            let traced = Traced { cull, ray: of, departure: stream.departures[ray] };
            places[ray] = if child.is_leaf() {
                scratch.steps.leaves += 1;
                let (end, tests) = (cull.end_above(), &mut scratch.primitive_tests);
                wide.shapes.any::<S, C>(simd, child.leaf_index(), &traced, end, tests, &mut None)
            } else {
                wide.occluded_of::<S, C, false>(simd, &At(child), &traced, scratch)
            };
        }
    }

    /// The rays here test the boxes of a node, and are listed from a place on for the children that they enter.
    #[inline(always)]
    fn enter<S: Simd, C: Content>(
        &self,
        simd: S,
        child: Child,
        n: usize,
        (turned, first): (u32, usize),
        stream: &mut Stream<W>,
    ) {
        let node = &self.wide.tree.nodes[child.node_index()];
        let mut children = 0;
        for (&ray, entered) in stream.here[..n].iter().zip(&mut stream.entered) {
            let ray = ray as usize;
            let Some(cull) = stream.prepared[ray / W].ray(ray % W) else { continue };
            let end = simd.splat_f32(cull.end_above());
            (*entered, _) = BoxRay::new(simd, cull, C::FACES).test(simd, node, end);
            children |= *entered;
        }
        if children == 0 {
            return;
        }
        // Behind the rays there are none.
        stream.entered[n..n + W].fill(0);
        let most = first + n * children.count_ones() as usize + W;
        if stream.lists.len() < most {
            stream.lists.resize(most, 0);
        }
        // What is listed last is visited first: in the order of a ray by itself.
        let (mut end, is_turned) = (first, child.is_turned(turned));
        while children != 0 {
            let lane = if is_turned { 31 - children.leading_zeros() } else { children.trailing_zeros() };
            children ^= 1 << lane;
            end = stream.list(simd, n, (Child(node.children[lane as usize % W]), lane), (turned, end));
        }
    }
}

/// The place of a ray in a stream.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "a stream is short")]
fn number(ray: usize) -> u32 {
    ray as u32
}
