//! Lists of rays: tiles of packets as long as they stay together, then packets, then one by one.
//!
//! Which it is, counters decide and never a clock: a shaft is given up once it has taken more steps than those who entered
//! the boxes on its way would have taken without it, and the next few are not even tried, the more of them the more often
//! that happens. What was found until then stays, since every hit is an upper bound.

use std::marker::PhantomData;
use std::ops::Range;

use rayset_simd::{Part, Simd};

use crate::beam::Misses;
use crate::blockers::Blockers;
use crate::columns::{HitOrNone, Left, RayColumns};
use crate::descent::{Descent, OfPacket, OfTile};
use crate::each::{OfRay, Rays};
use crate::exact::{Departing, Exact};
use crate::few::{BLOCK, BlocksOfFew, EachOfFew};
use crate::frame::Frame;
use crate::hierarchy::{Hierarchy, Scratch, Task, Wide};
use crate::lists::{List, NearestHits, Occluded};
use crate::packet::{Approach, Packet, Units, level};
use crate::shaft::Shaft;
use crate::shapes::Shapes;
use crate::together::Question;
use crate::trial::Trial;

/// What it costs to make a packet, in steps.
const PACKET_STEPS: u64 = 2;
/// Fewer rays than this are traced one by one.
const LEAST_PACKET: usize = 4;
/// What it costs to find out whether a tile misses everything, and what is spared if it does: of each other.
const MISS_STEPS: [u64; 2] = [64, 512];
/// After how many tiles that is tried again: a tile that misses is seldom alone.
const LONGEST_MISS_WAIT: usize = 8;
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
    cones: Trial,
    misses: Trial,
    tiles: Trial,
    packets: Trial,
    blockers: Blockers,
    /// Steps and number of the rays traced alone.
    alone: (u64, u64),
}

/// How many classes of rays are told apart, at most.
const N_CLASSES: usize = 64;

/// How many rays each stage answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bundled {
    /// In tiles of packets, or in tiles that miss everything; among few spheres, in blocks whose cone missed enough of them.
    pub tiles: u64,
    /// In packets.
    pub packets: u64,
    /// By what blocked a ray before them.
    pub blockers: u64,
    /// One by one.
    pub alone: u64,
    /// Of these, rays that ask for any hit and had it at once, in the sphere whose inside they leave into.
    pub at_once: u64,
}

impl Class {
    const NEW: Self = Self {
        cones: Trial::NEW,
        misses: Trial::NEW,
        tiles: Trial::NEW,
        packets: Trial::NEW,
        blockers: Blockers::NEW,
        alone: (0, 0),
    };

    /// How many steps some rays would take alone.
    fn steps(&self, rays: usize) -> u64 {
        let (steps, alone) = self.alone;
        if alone == 0 {
            return rays as u64 * FIRST_STEPS;
        }
        (rays as u64 * steps / alone).max(1)
    }

    /// Whether to try a shaft round a whole tile.
    fn wants_tile(&mut self) -> bool {
        // Where packets do not pay, tiles of them do not.
        self.packets.pays() && self.tiles.is_due()
    }
}

impl BundleScratch {
    /// Counts the rays of a class that blockers of others have answered, and remembers a blocker; how many that are.
    fn count_blocked(&mut self, class: usize, (blocked, record): (u64, Option<u32>)) -> u64 {
        if let Some(record) = record {
            self.classes[class].blockers.remember(record);
        }
        self.bundled.blockers += blocked;
        blocked
    }
}

impl Hierarchy {
    /// What the methods for lists need to keep between calls.
    #[must_use]
    pub fn bundle_scratch(&self) -> BundleScratch {
        BundleScratch {
            single: self.scratch(),
            bundled: Bundled::default(),
            classes: [Class::NEW; N_CLASSES],
        }
    }

    /// The least hits of some rays of a list; the answers go to the rays' places.
    ///
    /// Rays that are near each other in the list should be near each other in space. Whether shafts pay is found out for
    /// each `class` of rays by itself; numbers that differ by 64 share one.
    ///
    /// # Panics
    ///
    /// If a column or `hits` is too short, or there is no such primitive.
    pub fn nearest_bundle(
        &self,
        rays: &RayColumns<'_>,
        range: Range<usize>,
        class: usize,
        hits: &mut [HitOrNone],
        scratch: &mut BundleScratch,
    ) {
        if !self.few().replace_tree() {
            hits[range.clone()].fill(HitOrNone::NONE);
        }
        self.run(OfBundle { rays, range, class, list: NearestHits(hits), scratch });
    }

    /// Whether some rays of a list hit anything: as [`Hierarchy::nearest_bundle`].
    ///
    /// # Panics
    ///
    /// If a column or `occluded` is too short, or there is no such primitive.
    pub fn occluded_bundle(
        &self,
        rays: &RayColumns<'_>,
        range: Range<usize>,
        class: usize,
        occluded: &mut [bool],
        scratch: &mut BundleScratch,
    ) {
        if !self.few().replace_tree() {
            occluded[range.clone()].fill(false);
        }
        self.run(OfBundle { rays, range, class, list: Occluded(occluded), scratch });
    }
}

struct OfBundle<'a, L> {
    rays: &'a RayColumns<'a>,
    range: Range<usize>,
    class: usize,
    list: L,
    scratch: &'a mut BundleScratch,
}

impl<L: List> Task for OfBundle<'_, L> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd, const W: usize>(self, simd: S, frame: &Frame, wide: &Wide<W>) {
        let Self { rays, range, class, list, scratch } = self;
        wide.bundle(simd, frame, rays, range, class, list, scratch);
    }
}

/// Some rays that may leave spheres into their insides.
struct OwnHits<'a, Q: OfRay, const W: usize> {
    shapes: &'a Shapes<W>,
    question: PhantomData<Q>,
    rays: &'a RayColumns<'a>,
    first: usize,
    places: &'a mut [Q::Answer],
    tests: &'a mut u64,
}

impl<S: Simd, Q: OfRay, const W: usize> Part<S> for OwnHits<'_, Q, W> {
    type Output = usize;

    /// Writes what they meet where they leave their spheres; how many do.
    #[inline(always)]
    fn run(self, simd: S) -> usize {
        let Self { shapes, rays, first, places, tests, .. } = self;
        let (mut hits, mut n) = ([HitOrNone::NONE; W], 0);
        for (block, places) in places.chunks_mut(W).enumerate() {
            let first = first + block * W;
            let left = rays.left_by(first..first + places.len());
            let departing = Departing { rays: *rays, first, left };
            let mut met = shapes.meet_own(simd, &departing, u32::MAX, &mut hits, tests);
            n += met.count_ones() as usize;
            while met != 0 {
                let lane = met.trailing_zeros() as usize % W;
                met &= met - 1;
                places[lane] = Q::by_hit(hits[lane]);
            }
        }
        n
    }
}

impl<const W: usize> Wide<W> {
    #[inline(always)]
    #[expect(
        clippy::too_many_arguments,
        reason = "rays, what they are traced with, and where the answers go"
    )]
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
        let Range { start: mut first, end } = range;
        if !self.few.suit_cones() {
            if self.few.replace_tree() {
                self.alone(simd, frame, rays, first..end, false, class, &mut list, scratch);
            } else {
                self.tiles(simd, frame, rays, first..end, class, &mut list, scratch);
            }
            return;
        }
        while first < end {
            first += self.blocks(simd, rays, first..end, class, &mut list, scratch);
            let block = first..end.min(first + BLOCK);
            first = block.end;
            if !block.is_empty() {
                self.tiles(simd, frame, rays, block, class, &mut list, scratch);
            }
        }
    }

    /// Rays against few spheres, up to a block that may meet too many; how many that are.
    #[inline(always)]
    fn blocks<S: Simd, L: List>(
        &self,
        simd: S,
        rays: &RayColumns<'_>,
        range: Range<usize>,
        class: usize,
        list: &mut L,
        scratch: &mut BundleScratch,
    ) -> usize {
        let (question, columns) = (L::OfRay::default(), rays.cut(0..rays.len()));
        let each = EachOfFew { few: &self.few, question, columns, range, places: list.places() };
        let done = simd.outline(BlocksOfFew { each, trial: &mut scratch.classes[class].cones });
        let n = done.rays as u64;
        scratch.single.steps.leaves += n;
        scratch.single.primitive_tests += done.tests;
        scratch.bundled.tiles += done.in_cones;
        scratch.bundled.alone += n - done.in_cones;
        done.rays
    }

    /// Rays through the tree: tile by tile.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "as above")]
    fn tiles<S: Simd, L: List>(
        &self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        range: Range<usize>,
        class: usize,
        list: &mut L,
        scratch: &mut BundleScratch,
    ) {
        let suits = self.shapes.suits_packets();
        let mut first = range.start;
        while first < range.end {
            let len = (range.end - first).min(W * W);
            let place = (first, len);
            first += len;
            let met = self.own_hits(simd, rays, place, list, scratch);
            let at_once = if L::ANY { met.unwrap_or(0) } else { 0 };
            if at_once == len {
                scratch.bundled.alone += len as u64;
                scratch.bundled.at_once += len as u64;
                continue;
            }
            let is_known = met.is_some();
            let known = &mut scratch.classes[class];
            let packets = len.div_ceil(W);
            if suits && len > W && known.misses.is_due() {
                let range = place.0..place.0 + len;
                let Scratch { stack, steps, .. } = &mut scratch.single;
                let is_missed = simd.outline(Misses { tree: &self.tree, frame, rays, range, stack, steps });
                let [spent, saved] = MISS_STEPS;
                known.misses.end_within(spent, if is_missed { saved } else { 0 }, LONGEST_MISS_WAIT);
                if is_missed {
                    scratch.bundled.tiles += len as u64;
                    continue;
                }
            }
            if suits && len > W && known.wants_tile() {
                self.tile(simd, frame, rays, place, is_known, class, list, scratch);
            } else if suits && len >= LEAST_PACKET && known.packets.is_due_within(packets) {
                self.packets(simd, frame, rays, place, is_known, class, list, scratch);
            } else {
                known.packets.pass(packets);
                scratch.bundled.at_once += at_once as u64;
                let range = place.0..place.0 + len;
                self.alone(simd, frame, rays, range, is_known, class, list, scratch);
            }
        }
    }

    /// Some rays of a list that leave spheres into their insides meet these again: how many do; `None` if there are no such
    /// spheres, or the rays leave nothing.
    #[inline(always)]
    fn own_hits<S: Simd, L: List>(
        &self,
        simd: S,
        rays: &RayColumns<'_>,
        (first, len): (usize, usize),
        list: &mut L,
        scratch: &mut BundleScratch,
    ) -> Option<usize> {
        let left = rays.left_by(first..first + len);
        if left.is_empty() || !self.shapes.can_meet_own() || Left::all_outwards(left) {
            return None;
        }
        let question = PhantomData::<L::OfRay>;
        let places = &mut list.places()[first..first + len];
        let tests = &mut scratch.single.primitive_tests;
        Some(simd.outline(OwnHits { shapes: &self.shapes, question, rays, first, places, tests }))
    }

    /// Rays one by one; something may be known of them.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "as above")]
    fn alone<S: Simd, L: List>(
        &self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        range: Range<usize>,
        is_known: bool,
        class: usize,
        list: &mut L,
        scratch: &mut BundleScratch,
    ) {
        let n = range.len() as u64;
        let before = scratch.single.steps;
        let known = &mut scratch.classes[class];
        known.blockers.steps = known.steps(1);
        let shared = Some(&mut known.blockers);
        let (question, places) = (L::OfRay::default(), list.places());
        if is_known {
            let rays = Rays::<_, true> { columns: rays, range, places, shared };
            self.each(simd, frame, question, rays, &mut scratch.single);
        } else {
            let rays = Rays::<_, false> { columns: rays, range, places, shared };
            self.each(simd, frame, question, rays, &mut scratch.single);
        }
        let answered = std::mem::take(&mut scratch.classes[class].blockers.answered);
        let n = n - scratch.count_blocked(class, (answered, None));
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
        (first, len): (usize, usize),
        is_known: bool,
        class: usize,
        list: &mut L,
        scratch: &mut BundleScratch,
    ) {
        let n = len.div_ceil(W);
        let approach = Approach::of(frame, rays, first..first + len, self.shapes.is_flat());
        let mut packets = [Packet::<S, W>::none(simd); W];
        let packets = &mut packets[..n];
        for (p, packet) in packets.iter_mut().enumerate() {
            packet.take(simd, (first + p * W, (len - p * W).min(W)), &approach);
        }
        let Some(units) = level(simd, packets, &approach) else {
            scratch.classes[class].tiles.end(PACKET_STEPS * n as u64, 0);
            self.alone(simd, frame, rays, first..first + len, is_known, class, list, scratch);
            return;
        };
        let mut asked = [L::Asked::<S, W>::new(simd); W];
        if is_known {
            for (packet, asked) in packets.iter_mut().zip(&mut asked) {
                list.begin(simd, frame, packet, asked);
            }
        }
        let exact = Exact { shapes: &self.shapes, frame, rays };
        // Packets have to be made without a tile too.
        let making = PACKET_STEPS * n as u64;
        let (mut is_done, mut spent, mut worth) = (false, making, making);
        if let Some(shaft) = Shaft::around(simd, packets, units, &approach) {
            let known = &mut scratch.classes[class];
            let most = known.steps(len);
            if L::ANY {
                let tests = &mut scratch.single.primitive_tests;
                known.blockers.ask_packets(simd, &self.shapes, &shaft, packets, &mut asked, tests);
            }
            let (packets, asked, scratch) = (&mut *packets, &mut asked[..], &mut scratch.single);
            let (shaft, exact, tree) = (&shaft, &exact, &self.tree);
            let descent = Descent { shaft, packets, asked, tree, exact, most, scratch };
            let outcome = simd.outline(OfTile(descent));
            is_done = outcome.is_done;
            spent += outcome.spent;
            worth += outcome.worth;
        }
        scratch.classes[class].tiles.end(spent, if is_done { worth } else { 0 });
        if is_done {
            for (packet, asked) in packets.iter().zip(asked) {
                scratch.bundled.tiles += packet.len as u64 - scratch.count_blocked(class, asked.blocked());
                list.answer(simd, &exact, packet, asked);
            }
            return;
        }
        for (packet, asked) in packets.iter_mut().zip(asked) {
            let is_due = packet.len >= LEAST_PACKET && scratch.classes[class].packets.is_due();
            let due = is_due.then_some((units, approach.by(packet)));
            self.packet(simd, &exact, packet, asked, due, class, list, scratch);
        }
    }

    /// Up to `W` packets: those that are due each under its own shaft, all else ray by ray.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "as above")]
    fn packets<S: Simd, L: List>(
        &self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        (first, len): (usize, usize),
        is_known: bool,
        class: usize,
        list: &mut L,
        scratch: &mut BundleScratch,
    ) {
        let exact = Exact { shapes: &self.shapes, frame, rays };
        let end = first + len;
        // Rays before this are answered.
        let mut next = first;
        for first in (first..end).step_by(W) {
            let len = (end - first).min(W);
            if !(len >= LEAST_PACKET && scratch.classes[class].packets.is_due()) {
                continue;
            }
            let approach = Approach::of(frame, rays, first..first + len, self.shapes.is_flat());
            let mut packet = [Packet::<S, W>::none(simd)];
            packet[0].take(simd, (first, len), &approach);
            let Some(units) = level(simd, &mut packet, &approach) else {
                scratch.classes[class].packets.end(PACKET_STEPS, 0);
                continue;
            };
            if next < first {
                self.alone(simd, frame, rays, next..first, is_known, class, list, scratch);
            }
            let mut asked = L::Asked::<S, W>::new(simd);
            if is_known {
                list.begin(simd, frame, &mut packet[0], &mut asked);
            }
            self.packet(simd, &exact, &mut packet[0], asked, Some((units, approach)), class, list, scratch);
            next = first + len;
        }
        if next < end {
            self.alone(simd, frame, rays, next..end, is_known, class, list, scratch);
        }
    }

    /// One packet, under its shaft if it is due, and ray by ray if that did not answer it.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "as above")]
    fn packet<S: Simd, L: List>(
        &self,
        simd: S,
        exact: &Exact<'_, W>,
        packet: &mut Packet<S, W>,
        mut asked: L::Asked<S, W>,
        due: Option<(Units, Approach<'_>)>,
        class: usize,
        list: &mut L,
        scratch: &mut BundleScratch,
    ) {
        let (mut is_done, mut spent, mut worth) = (false, PACKET_STEPS, 0);
        if let Some((units, approach)) = due {
            let packets = std::slice::from_mut(&mut *packet);
            if let Some(shaft) = Shaft::around(simd, packets, units, &approach) {
                if L::ANY {
                    let (blockers, asked) =
                        (&mut scratch.classes[class].blockers, std::slice::from_mut(&mut asked));
                    let tests = &mut scratch.single.primitive_tests;
                    blockers.ask_packets(simd, &self.shapes, &shaft, packets, asked, tests);
                }
                let (asked, scratch) = (std::slice::from_mut(&mut asked), &mut scratch.single);
                let (shaft, tree) = (&shaft, &self.tree);
                let descent = Descent { shaft, packets, asked, tree, exact, most: u64::MAX, scratch };
                let outcome = simd.outline(OfPacket(descent));
                (is_done, worth) = (outcome.is_done, outcome.worth);
                spent += outcome.spent;
            }
            scratch.classes[class].packets.end(spent, if is_done { worth } else { 0 });
        }
        let blocked = scratch.count_blocked(class, asked.blocked());
        list.answer(simd, exact, packet, asked);
        if is_done {
            scratch.bundled.packets += packet.len as u64 - blocked;
        } else {
            let range = packet.first..packet.first + packet.len;
            self.alone(simd, exact.frame, exact.rays, range, true, class, list, scratch);
            scratch.bundled.alone -= blocked;
        }
    }
}
