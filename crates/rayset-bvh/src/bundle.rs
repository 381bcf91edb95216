//! Lists of rays: tiles of packets as long as they stay together, then packets, then one by one.
//!
//! Which it is, counters decide and never a clock: a shaft is given up once it has taken more steps than those who entered
//! the boxes on its way would have taken without it, and the next few are not even tried, the more of them the more often
//! that happens. What was found until then stays, since every hit is an upper bound.
//!
//! Rays that go one by one wait for those behind them in the list, so that few lanes are empty.

use std::marker::PhantomData;
use std::ops::{AddAssign, Range};

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
use crate::traverse::Steps;
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
    /// What the parts of lists took, if it is to be written down: who asks for it clears it.
    pub parts: Option<Vec<PartOfList>>,
    /// What the parts took that have been written down.
    written: Spent,
    /// What is known of each class of rays.
    classes: [Class; N_CLASSES],
    waiting: Waiting,
}

/// Some rays of a list that correspond: what is found out about shafts round some is taken to hold for the others.
#[derive(Clone, Debug)]
pub struct Group {
    /// Which rays these are.
    pub range: Range<usize>,
    /// Whether shafts pay is found out for each class by itself, from list to list; numbers that differ by 64 share one.
    pub class: usize,
}

/// What some rays of a list took together.
#[derive(Clone, Debug)]
pub struct PartOfList {
    /// Which rays these are; a ray may be in several parts.
    pub range: Range<usize>,
    /// What they took.
    pub spent: Spent,
}

/// What rays took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Spent {
    /// Nodes whose boxes were tested.
    pub nodes: u64,
    /// Primitives that were tested.
    pub primitive_tests: u64,
}

/// Rays that are to go one by one, of which nothing is known yet.
#[derive(Clone, Debug)]
struct Waiting {
    range: Range<usize>,
    /// How many of them each class has.
    classes: Vec<(usize, u64)>,
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
    bundled: Bundled,
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

impl AddAssign for Bundled {
    fn add_assign(&mut self, Self { tiles, packets, blockers, alone, at_once }: Self) {
        self.tiles += tiles;
        self.packets += packets;
        self.blockers += blockers;
        self.alone += alone;
        self.at_once += at_once;
    }
}

impl Class {
    const NEW: Self = Self {
        cones: Trial::NEW,
        misses: Trial::NEW,
        tiles: Trial::NEW,
        packets: Trial::NEW,
        blockers: Blockers::NEW,
        alone: (0, 0),
        bundled: Bundled { tiles: 0, packets: 0, blockers: 0, alone: 0, at_once: 0 },
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
    /// How the rays of a class were answered since this was last asked.
    pub fn take_bundled(&mut self, class: usize) -> Bundled {
        std::mem::take(&mut self.classes[class % N_CLASSES].bundled)
    }

    /// What all rays took so far.
    fn spent(&self) -> Spent {
        Spent { nodes: self.single.steps.nodes, primitive_tests: self.single.primitive_tests }
    }

    /// Writes down that some rays took what has been counted since `before`, if it is to be written down.
    fn write_part(&mut self, range: &Range<usize>, before: Spent) {
        let now = self.spent();
        if let Some(parts) = &mut self.parts {
            let nodes = now.nodes - before.nodes;
            let primitive_tests = now.primitive_tests - before.primitive_tests;
            parts.push(PartOfList { range: range.clone(), spent: Spent { nodes, primitive_tests } });
            self.written.nodes += nodes;
            self.written.primitive_tests += primitive_tests;
        }
    }

    /// Counts what rays that went one by one have taken, so many of each class; the blockers were those of the first.
    fn count_alone(&mut self, before: Steps, classes: &[(usize, u64)]) {
        let Steps { nodes, leaves } = self.single.steps;
        let steps = nodes + leaves - before.nodes - before.leaves;
        let all: u64 = classes.iter().map(|&(_, n)| n).sum();
        let mut answered = std::mem::take(&mut self.classes[classes[0].0].blockers.answered);
        for &(class, n) in classes {
            // Which of the rays they were is not known, and does not matter.
            let blocked = answered.min(n);
            answered -= blocked;
            let Class { bundled, alone, .. } = &mut self.classes[class];
            bundled.blockers += blocked;
            bundled.alone += n - blocked;
            *alone = (alone.0 + steps * n / all, alone.1 + n - blocked);
        }
    }

    /// Counts the rays of a class that blockers of others have answered, and remembers a blocker; how many that are.
    fn count_blocked(&mut self, class: usize, (blocked, record): (u64, Option<u32>)) -> u64 {
        if let Some(record) = record {
            self.classes[class].blockers.remember(record);
        }
        self.classes[class].bundled.blockers += blocked;
        blocked
    }
}

impl Hierarchy {
    /// What the methods for lists need to keep between calls.
    #[must_use]
    pub fn bundle_scratch(&self) -> BundleScratch {
        BundleScratch {
            single: self.scratch(),
            parts: None,
            written: Spent::default(),
            classes: [Class::NEW; N_CLASSES],
            waiting: Waiting { range: 0..0, classes: Vec::new() },
        }
    }

    /// The least hits of the rays of a list that are in its groups; the answers go to the rays' places.
    ///
    /// Rays that are near each other in a group should be near each other in space.
    ///
    /// # Panics
    ///
    /// If a column or `hits` is too short, or there is no such primitive.
    pub fn nearest_bundle(
        &self,
        rays: &RayColumns<'_>,
        groups: &[Group],
        hits: &mut [HitOrNone],
        scratch: &mut BundleScratch,
    ) {
        if !self.few().replace_tree() {
            groups.iter().for_each(|group| hits[group.range.clone()].fill(HitOrNone::NONE));
        }
        self.run(OfBundle { rays, groups, list: NearestHits(hits), scratch });
    }

    /// Whether the rays of a list that are in its groups hit anything: as [`Hierarchy::nearest_bundle`].
    ///
    /// # Panics
    ///
    /// If a column or `occluded` is too short, or there is no such primitive.
    pub fn occluded_bundle(
        &self,
        rays: &RayColumns<'_>,
        groups: &[Group],
        occluded: &mut [bool],
        scratch: &mut BundleScratch,
    ) {
        if !self.few().replace_tree() {
            groups.iter().for_each(|group| occluded[group.range.clone()].fill(false));
        }
        self.run(OfBundle { rays, groups, list: Occluded(occluded), scratch });
    }
}

struct OfBundle<'a, L> {
    rays: &'a RayColumns<'a>,
    groups: &'a [Group],
    list: L,
    scratch: &'a mut BundleScratch,
}

impl<L: List> Task for OfBundle<'_, L> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd, const W: usize>(self, simd: S, frame: &Frame, wide: &Wide<W>) {
        let Self { rays, groups, mut list, scratch } = self;
        scratch.written = scratch.spent();
        for group in groups {
            wide.bundle(simd, frame, rays, group, &mut list, scratch);
        }
        wide.go_on(simd, frame, rays, &mut list, scratch);
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

/// Rays that go one by one, so many of each class; something may be known of them.
struct OneByOne<'a, L, const KNOWN: bool, const W: usize> {
    wide: &'a Wide<W>,
    frame: &'a Frame,
    rays: &'a RayColumns<'a>,
    range: Range<usize>,
    classes: &'a [(usize, u64)],
    list: &'a mut L,
    scratch: &'a mut BundleScratch,
}

impl<S: Simd, L: List, const KNOWN: bool, const W: usize> Part<S> for OneByOne<'_, L, KNOWN, W> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { wide, frame, rays, range, classes, list, scratch } = self;
        let before = scratch.single.steps;
        // They share the blockers of the first.
        let known = &mut scratch.classes[classes[0].0];
        known.blockers.steps = known.steps(1);
        let (places, shared) = (list.places(), Some(&mut known.blockers));
        let rays = Rays::<_, KNOWN> { columns: rays, range, places, shared };
        wide.each(simd, frame, L::OfRay::default(), rays, &mut scratch.single);
        scratch.count_alone(before, classes);
    }
}

impl<const W: usize> Wide<W> {
    #[inline(always)]
    fn bundle<S: Simd, L: List>(
        &self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        group: &Group,
        list: &mut L,
        scratch: &mut BundleScratch,
    ) {
        let class = group.class % N_CLASSES;
        let Range { start: mut first, end } = group.range;
        if !self.few.suit_cones() {
            if self.few.replace_tree() {
                self.alone(simd, frame, rays, first..end, false, class, list, scratch);
            } else {
                self.tiles(simd, frame, rays, first..end, class, list, scratch);
            }
            return;
        }
        while first < end {
            let block = first..first + self.blocks(simd, rays, first..end, class, list, scratch);
            scratch.write_part(&block, scratch.written);
            let block = block.end..end.min(block.end + BLOCK);
            first = block.end;
            if !block.is_empty() {
                self.tiles(simd, frame, rays, block, class, list, scratch);
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
        let bundled = &mut scratch.classes[class].bundled;
        bundled.tiles += done.in_cones;
        bundled.alone += n - done.in_cones;
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
        for first in range.clone().step_by(W * W) {
            let tile = first..range.end.min(first + W * W);
            self.by_stages(simd, frame, rays, &tile, class, list, scratch);
            scratch.write_part(&tile, scratch.written);
        }
    }

    /// The rays of a tile: together, in packets, or one by one.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "as above")]
    fn by_stages<S: Simd, L: List>(
        &self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        range: &Range<usize>,
        class: usize,
        list: &mut L,
        scratch: &mut BundleScratch,
    ) {
        let place @ (_, len) = (range.start, range.len());
        let met = self.own_hits(simd, rays, place, list, scratch);
        let at_once = if L::ANY { met.unwrap_or(0) } else { 0 };
        let is_known = met.is_some();
        let known = &mut scratch.classes[class];
        if at_once == len {
            known.bundled.alone += len as u64;
            known.bundled.at_once += len as u64;
            return;
        }
        let suits = self.shapes.suits_packets();
        let packets = len.div_ceil(W);
        if suits && len > W && known.misses.is_due() {
            let range = range.clone();
            let Scratch { stack, steps, .. } = &mut scratch.single;
            let is_missed = simd.outline(Misses { tree: &self.tree, frame, rays, range, stack, steps });
            let [spent, saved] = MISS_STEPS;
            known.misses.end_within(spent, if is_missed { saved } else { 0 }, LONGEST_MISS_WAIT);
            if is_missed {
                known.bundled.tiles += len as u64;
                return;
            }
        }
        if suits && len > W && known.wants_tile() {
            self.tile(simd, frame, rays, place, is_known, class, list, scratch);
        } else if suits && len >= LEAST_PACKET && known.packets.is_due_within(packets) {
            self.packets(simd, frame, rays, place, is_known, class, list, scratch);
        } else {
            known.packets.pass(packets);
            known.bundled.at_once += at_once as u64;
            self.alone(simd, frame, rays, range.clone(), is_known, class, list, scratch);
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

    /// Rays one by one; something may be known of them. If not, they wait for those that stand behind them.
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
        if is_known {
            let classes = &[(class, n)];
            simd.outline(OneByOne::<_, true, W> { wide: self, frame, rays, range, classes, list, scratch });
            return;
        }
        if scratch.waiting.range.end != range.start {
            self.go_on(simd, frame, rays, list, scratch);
        }
        let Waiting { range: waiting, classes } = &mut scratch.waiting;
        if classes.is_empty() {
            waiting.start = range.start;
        }
        waiting.end = range.end;
        match classes.last_mut() {
            Some((last, rays)) if *last == class => *rays += n,
            _ => classes.push((class, n)),
        }
    }

    /// The rays that have waited go one by one.
    #[inline(always)]
    fn go_on<S: Simd, L: List>(
        &self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        list: &mut L,
        scratch: &mut BundleScratch,
    ) {
        let range = std::mem::replace(&mut scratch.waiting.range, 0..0);
        if range.is_empty() {
            return;
        }
        let mut classes = std::mem::take(&mut scratch.waiting.classes);
        let before = scratch.spent();
        let (wide, waited) = (self, range.clone());
        let one_by_one = OneByOne { wide, frame, rays, range, classes: &classes, list, scratch };
        simd.outline::<OneByOne<'_, _, false, W>>(one_by_one);
        scratch.write_part(&waited, before);
        classes.clear();
        scratch.waiting.classes = classes;
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
                let blocked = scratch.count_blocked(class, asked.blocked());
                scratch.classes[class].bundled.tiles += packet.len as u64 - blocked;
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
            scratch.classes[class].bundled.packets += packet.len as u64 - blocked;
        } else {
            let range = packet.first..packet.first + packet.len;
            self.alone(simd, exact.frame, exact.rays, range, true, class, list, scratch);
            scratch.classes[class].bundled.alone -= blocked;
        }
    }
}
