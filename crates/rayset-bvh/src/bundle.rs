//! Lists of rays: tiles of packets as long as they stay together, then packets, then one by one.
//!
//! Which it is, counters decide and never a clock: a shaft that takes more steps than a share of what its rays would
//! take alone is given up, and the next few are not even tried, the more of them the more often that happens. What was
//! found until then stays, since every hit is an upper bound.

use std::ops::Range;

use rayset_simd::{Lanes, Part, Simd};

use crate::frame::Frame;
use crate::hierarchy::{Hierarchy, Scratch, Wide, Width};
use crate::node::Tree;
use crate::packet::{Packet, RayColumns, Shaft, level};
use crate::shapes::Hit;
use crate::together::{Exact, Hidden, Nearest, Progress, Question};

/// What a shaft may cost a ray, as a share of the steps of a ray alone: two are a half.
const BUDGET_SHARE: u64 = 2;
/// Fewer rays than this are traced one by one.
const LEAST_PACKET: usize = 4;
/// After how many shafts at most one is tried again.
const LONGEST_WAIT: u32 = 64;
/// What is taken for the steps of a ray before any was traced alone.
const FIRST_STEPS: u64 = 8;

/// What is kept from list to list.
#[derive(Clone, Debug)]
pub struct BundleScratch {
    /// What single rays keep.
    pub single: Scratch,
    /// How the rays were answered.
    pub bundled: Bundled,
    /// What is known of each class of rays.
    classes: [Class; N_CLASSES],
}

/// How the rays of a class fared so far.
#[derive(Clone, Copy, Debug)]
struct Class {
    tiles: Trial,
    packets: Trial,
    /// Steps and number of the rays traced alone.
    alone: (u64, u64),
}

/// Whether a kind of shaft is worth trying.
#[derive(Clone, Copy, Debug)]
struct Trial {
    /// How many are not tried.
    wait: u32,
    /// How many will not be tried after the next that is given up.
    next_wait: u32,
}

/// How many classes of rays are told apart, at most.
const N_CLASSES: usize = 64;

/// How many rays each stage answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bundled {
    /// In tiles of packets.
    pub tiles: u64,
    /// In packets.
    pub packets: u64,
    /// One by one.
    pub alone: u64,
}

impl Trial {
    const NEW: Self = Self { wait: 1, next_wait: 1 };

    /// Whether to try the next.
    fn is_due(&mut self) -> bool {
        self.wait = self.wait.saturating_sub(1);
        self.wait == 0
    }

    fn end(&mut self, is_done: bool) {
        if is_done {
            self.next_wait = (self.next_wait / 2).max(1);
            self.wait = 1;
        } else {
            self.wait = self.next_wait;
            self.next_wait = (2 * self.next_wait).min(LONGEST_WAIT);
        }
    }
}

impl Class {
    /// How many steps a shaft of some rays may take.
    fn budget(&self, rays: usize) -> u64 {
        let (steps, alone) = self.alone;
        rays as u64 * steps.checked_div(alone).unwrap_or(FIRST_STEPS).max(1) / BUDGET_SHARE
    }
}

impl Hierarchy {
    /// What the methods for lists need to keep between calls.
    #[must_use]
    pub fn bundle_scratch(&self) -> BundleScratch {
        BundleScratch {
            single: self.scratch(),
            bundled: Bundled::default(),
            classes: [Class { tiles: Trial::NEW, packets: Trial::NEW, alone: (0, 0) }; N_CLASSES],
        }
    }

    /// The least hits of some rays of a list, in a kernel that runs on the lanes the hierarchy was built for; the answers
    /// go to the rays' places.
    ///
    /// Rays that are near each other in the list should be near each other in space. Whether shafts pay is found out for
    /// each `class` of rays by itself; numbers that differ by 64 share one.
    ///
    /// # Panics
    ///
    /// If the lanes are others, a column is too short, or there is no such primitive.
    #[inline(always)]
    pub fn nearest_bundle_on<S: Simd>(
        &self,
        simd: S,
        rays: &RayColumns<'_>,
        range: Range<usize>,
        class: usize,
        hits: &mut [Option<Hit>],
        scratch: &mut BundleScratch,
    ) {
        match &self.width {
            Width::Eight(wide) if S::F32::LANES == 8 => {
                wide.bundle::<S, NearestHits<'_>>(simd, &self.frame, rays, range, class, NearestHits(hits), scratch);
            }
            Width::Sixteen(wide) if S::F32::LANES == 16 => {
                wide.bundle::<S, NearestHits<'_>>(simd, &self.frame, rays, range, class, NearestHits(hits), scratch);
            }
            _ => panic!("a hierarchy runs on the lanes it was built for"),
        }
    }

    /// Whether some rays of a list hit anything: as [`Hierarchy::nearest_bundle_on`].
    ///
    /// # Panics
    ///
    /// If the lanes are others, a column is too short, or there is no such primitive.
    #[inline(always)]
    pub fn occluded_bundle_on<S: Simd>(
        &self,
        simd: S,
        rays: &RayColumns<'_>,
        range: Range<usize>,
        class: usize,
        occluded: &mut [bool],
        scratch: &mut BundleScratch,
    ) {
        match &self.width {
            Width::Eight(wide) if S::F32::LANES == 8 => {
                wide.bundle::<S, Occluded<'_>>(simd, &self.frame, rays, range, class, Occluded(occluded), scratch);
            }
            Width::Sixteen(wide) if S::F32::LANES == 16 => {
                wide.bundle::<S, Occluded<'_>>(simd, &self.frame, rays, range, class, Occluded(occluded), scratch);
            }
            _ => panic!("a hierarchy runs on the lanes it was built for"),
        }
    }
}

/// Where the answers of a list go, and how rays are answered.
trait List {
    /// What a packet asks for.
    type Asked<S: Simd, const W: usize>: Question<S, W>;

    /// Takes over what a packet has found.
    fn answer<S: Simd, const W: usize>(
        &mut self,
        simd: S,
        exact: &Exact<'_, W>,
        packet: &Packet<S, W>,
        asked: Self::Asked<S, W>,
    );

    /// Traces a ray alone that is not answered yet; its place may hold an upper bound.
    fn trace_alone<S: Simd, const W: usize>(
        &mut self,
        simd: S,
        wide: &Wide<W>,
        frame: &Frame,
        rays: &RayColumns<'_>,
        ray: usize,
        scratch: &mut Scratch,
    );
}

/// Places of nearest hits, all without one at first.
struct NearestHits<'a>(&'a mut [Option<Hit>]);

impl List for NearestHits<'_> {
    type Asked<S: Simd, const W: usize> = Nearest<S>;

    #[inline(always)]
    fn answer<S: Simd, const W: usize>(
        &mut self,
        simd: S,
        exact: &Exact<'_, W>,
        packet: &Packet<S, W>,
        asked: Nearest<S>,
    ) {
        asked.finish(simd, exact, packet, &mut self.0[packet.first..packet.first + packet.len]);
    }

    #[inline(always)]
    fn trace_alone<S: Simd, const W: usize>(
        &mut self,
        simd: S,
        wide: &Wide<W>,
        frame: &Frame,
        rays: &RayColumns<'_>,
        i: usize,
        scratch: &mut Scratch,
    ) {
        let (ray, span) = rays.ray(i);
        self.0[i] = wide.nearest(simd, frame, &ray, span, rays.left(i), self.0[i], scratch);
    }
}

/// Places that say whether something is hit, all false at first.
struct Occluded<'a>(&'a mut [bool]);

impl List for Occluded<'_> {
    type Asked<S: Simd, const W: usize> = Hidden;

    #[inline(always)]
    fn answer<S: Simd, const W: usize>(
        &mut self,
        _: S,
        _: &Exact<'_, W>,
        packet: &Packet<S, W>,
        asked: Hidden,
    ) {
        for lane in 0..packet.len {
            self.0[packet.first + lane] = asked.0 >> lane & 1 == 1;
        }
    }

    #[inline(always)]
    fn trace_alone<S: Simd, const W: usize>(
        &mut self,
        simd: S,
        wide: &Wide<W>,
        frame: &Frame,
        rays: &RayColumns<'_>,
        i: usize,
        scratch: &mut Scratch,
    ) {
        if !self.0[i] {
            let (ray, span) = rays.ray(i);
            self.0[i] = wide.occluded(simd, frame, &ray, span, rays.left(i), scratch);
        }
    }
}

impl<const W: usize> Wide<W> {
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "rays, what they are traced with, and where the answers go")]
    fn bundle<S: Simd, L: List>(
        &self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        range: Range<usize>,
        class: usize,
        mut list: L,
        scratch: &mut BundleScratch,
    ) {
        let class = class % N_CLASSES;
        let suits = self.shapes.suits_packets();
        let mut first = range.start;
        while first < range.end {
            let len = (range.end - first).min(W * W);
            let is_answered = suits && len >= LEAST_PACKET && {
                let Class { tiles, packets, .. } = &mut scratch.classes[class];
                let (try_tile, try_packets) = (len > W && tiles.is_due(), packets.wait <= len.div_ceil(W) as u32);
                if try_tile || try_packets {
                    self.tile(simd, frame, rays, first, len, class, try_tile, &mut list, scratch);
                    true
                } else {
                    packets.wait -= len.div_ceil(W) as u32;
                    false
                }
            };
            if !is_answered {
                self.alone(simd, frame, rays, first..first + len, class, &mut list, scratch);
            }
            first += len;
        }
    }

    /// Rays one by one.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "as above")]
    fn alone<S: Simd, L: List>(
        &self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        range: Range<usize>,
        class: usize,
        list: &mut L,
        scratch: &mut BundleScratch,
    ) {
        let n = range.len() as u64;
        let single = &mut scratch.single;
        let before = single.steps;
        simd.outline(Alone { wide: self, frame, rays, range, list, single });
        let after = scratch.single.steps;
        let (steps, alone) = &mut scratch.classes[class].alone;
        *steps += after.nodes + after.leaves - before.nodes - before.leaves;
        *alone += n;
        scratch.bundled.alone += n;
    }

    /// Up to `W` packets: under one shaft, then each under its own, then ray by ray.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "as above")]
    fn tile<S: Simd, L: List>(
        &self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        first: usize,
        len: usize,
        class: usize,
        try_tile: bool,
        list: &mut L,
        scratch: &mut BundleScratch,
    ) {
        let n = len.div_ceil(W);
        let mut packets = Vec::with_capacity(W);
        for p in 0..n {
            packets.push(Packet::<S, W>::new(simd, frame, rays, first + p * W, (len - p * W).min(W)));
        }
        let Some(unit) = level(simd, frame, &mut packets) else {
            self.alone(simd, frame, rays, first..first + len, class, list, scratch);
            return;
        };
        let mut asked = [L::Asked::<S, W>::new(simd); W];
        let exact = Exact { shapes: &self.shapes, frame, rays };
        let mut is_done = false;
        if try_tile {
            if let Some(shaft) = Shaft::around(simd, &mut packets, unit) {
                let budget = scratch.classes[class].budget(len);
                let (packets, asked, scratch) = (&mut packets[..], &mut asked[..], &mut scratch.single);
                let (shaft, exact, tree) = (&shaft, &exact, &self.tree);
                is_done = simd.outline(Descent { shaft, packets, asked, tree, exact, budget, scratch });
            }
            scratch.classes[class].tiles.end(is_done);
        }
        if is_done {
            scratch.bundled.tiles += len as u64;
            for (packet, asked) in packets.iter().zip(asked) {
                list.answer(simd, &exact, packet, asked);
            }
            return;
        }
        for (packet, asked) in packets.iter_mut().zip(&mut asked) {
            let mut is_done = false;
            if packet.len >= LEAST_PACKET && scratch.classes[class].packets.is_due() {
                let packets = std::slice::from_mut(&mut *packet);
                if let Some(shaft) = Shaft::around(simd, packets, unit) {
                    let budget = scratch.classes[class].budget(packets[0].len);
                    let (asked, scratch) = (std::slice::from_mut(&mut *asked), &mut scratch.single);
                    let (shaft, exact, tree) = (&shaft, &exact, &self.tree);
                    is_done = simd.outline(Descent { shaft, packets, asked, tree, exact, budget, scratch });
                }
                scratch.classes[class].packets.end(is_done);
            }
            list.answer(simd, &exact, packet, *asked);
            if is_done {
                scratch.bundled.packets += packet.len as u64;
            } else {
                let range = packet.first..packet.first + packet.len;
                self.alone(simd, frame, rays, range, class, list, scratch);
            }
        }
    }
}

/// Rays that are traced one by one.
struct Alone<'a, L, const W: usize> {
    wide: &'a Wide<W>,
    frame: &'a Frame,
    rays: &'a RayColumns<'a>,
    range: Range<usize>,
    list: &'a mut L,
    single: &'a mut Scratch,
}

impl<S: Simd, L: List, const W: usize> Part<S> for Alone<'_, L, W> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { wide, frame, rays, range, list, single } = self;
        for i in range {
            list.trace_alone(simd, wide, frame, rays, i, single);
        }
    }
}

/// Takes packets through the tree under one shaft; whether they came to an end.
struct Descent<'a, S: Simd, Q, const W: usize> {
    shaft: &'a Shaft<S>,
    packets: &'a mut [Packet<S, W>],
    asked: &'a mut [Q],
    tree: &'a Tree<W>,
    exact: &'a Exact<'a, W>,
    /// How many steps it may take.
    budget: u64,
    scratch: &'a mut Scratch,
}

impl<S: Simd, Q: Question<S, W>, const W: usize> Part<S> for Descent<'_, S, Q, W> {
    type Output = bool;

    #[inline(always)]
    fn run(self, simd: S) -> bool {
        let Self { shaft, packets, asked, tree, exact, budget, scratch } = self;
        let Scratch { stack, steps, primitive_tests } = scratch;
        let stack = stack.together.as_mut_slice();
        let mut progress = Progress::new(simd, shaft, packets);
        let (mut height, mut nodes, mut leaves) = (0, 0, 0);
        let mut current = tree.root;
        let is_done = loop {
            if current.is_leaf() {
                leaves += 1;
                exact.shapes.ask(simd, current.index(), shaft, packets, asked, exact, &mut progress);
            } else {
                nodes += 1;
                let node = &tree.nodes[current.index()];
                height = shaft.push_children(simd, node, progress.reach, stack, height);
            }
            while height > 0 && stack[height - 1].1 > progress.reach {
                height -= 1;
            }
            if height == 0 {
                break true;
            }
            if nodes + leaves + progress.shaft_tests + progress.packet_tests > budget {
                break false;
            }
            height -= 1;
            current = stack[height].0;
        };
        steps.nodes += nodes + progress.shaft_tests;
        steps.leaves += leaves;
        *primitive_tests += progress.ray_tests;
        is_done
    }
}
