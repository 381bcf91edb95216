//! Lists of rays: in packets as long as they stay together, one by one where they do not.
//!
//! Which it is, counters decide and never a clock: a packet that takes more steps than its rays would take alone is
//! given up, and the next few are not even tried, the more of them the more often that happens. What a packet that is
//! given up has found stays, since every hit is an upper bound.

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Departure, Ray, Side, Span};
use rayset_simd::{Lanes, Simd};

use crate::frame::Frame;
use crate::hierarchy::{Hierarchy, Scratch, Wide, Width, ahead};
use crate::node::Child;
use crate::packet::{Packet, RayColumns};
use crate::shapes::Hit;
use crate::together::{Exact, Found};

/// What a packet may cost, in steps of one of its rays alone.
const BUDGET: u64 = 8;
/// Fewer rays than this are traced one by one.
const LEAST_PACKET: usize = 4;
/// After how many packets at most one is tried again.
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
    /// How many packets are not tried.
    wait: u32,
    /// How many will not be tried after the next that is given up.
    next_wait: u32,
    /// Steps and number of the rays traced alone.
    alone: (u64, u64),
}

/// How many classes of rays are told apart, at most.
const N_CLASSES: usize = 64;

/// How many rays each stage answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bundled {
    /// In packets.
    pub together: u64,
    /// Begun in packets that were given up, and ended one by one.
    pub given_up: u64,
    /// One by one.
    pub alone: u64,
}

impl Class {
    /// Whether to try the next packet.
    fn is_due(&mut self) -> bool {
        self.wait = self.wait.saturating_sub(1);
        self.wait == 0
    }

    fn succeed(&mut self) {
        self.next_wait = (self.next_wait / 2).max(1);
        self.wait = 1;
    }

    fn give_up(&mut self) {
        self.wait = self.next_wait;
        self.next_wait = (2 * self.next_wait).min(LONGEST_WAIT);
    }

    fn budget(&self) -> u64 {
        let (steps, rays) = self.alone;
        BUDGET * steps.checked_div(rays).unwrap_or(FIRST_STEPS).max(1)
    }
}

impl Hierarchy {
    /// What the methods for lists need to keep between calls.
    #[must_use]
    pub fn bundle_scratch(&self) -> BundleScratch {
        BundleScratch {
            single: self.scratch(),
            bundled: Bundled::default(),
            classes: [Class { wait: 1, next_wait: 1, alone: (0, 0) }; N_CLASSES],
        }
    }

    /// The least hits of the rays whose indices are `members`, in a kernel that runs on the lanes the hierarchy was built
    /// for; `left` are the primitives that all rays of the columns leave, and the answers go to the rays' places.
    ///
    /// Rays that are near each other in `members` should be near each other in space. Whether packets pay is found out for
    /// each `class` of rays by itself; numbers that differ by 64 share one.
    ///
    /// # Panics
    ///
    /// If the lanes are others, a column is too short, or there is no such primitive.
    #[inline(always)]
    #[expect(
        clippy::too_many_arguments,
        reason = "rays, what they are traced with, and where the answers go"
    )]
    pub fn nearest_bundle_on<S: Simd>(
        &self,
        simd: S,
        rays: &RayColumns<'_>,
        left: &[Option<(u32, Side)>],
        members: &[u32],
        class: usize,
        hits: &mut [Option<Hit>],
        scratch: &mut BundleScratch,
    ) {
        match &self.width {
            Width::Eight(wide) if S::F32::LANES == 8 => {
                wide.nearest_bundle(simd, &self.frame, rays, left, members, class, hits, scratch);
            }
            Width::Sixteen(wide) if S::F32::LANES == 16 => {
                wide.nearest_bundle(simd, &self.frame, rays, left, members, class, hits, scratch);
            }
            _ => panic!("a hierarchy runs on the lanes it was built for"),
        }
    }

    /// Whether the rays whose indices are `members` hit anything: as [`Hierarchy::nearest_bundle_on`].
    ///
    /// # Panics
    ///
    /// If the lanes are others, a column is too short, or there is no such primitive.
    #[inline(always)]
    #[expect(
        clippy::too_many_arguments,
        reason = "rays, what they are traced with, and where the answers go"
    )]
    pub fn occluded_bundle_on<S: Simd>(
        &self,
        simd: S,
        rays: &RayColumns<'_>,
        left: &[Option<(u32, Side)>],
        members: &[u32],
        class: usize,
        occluded: &mut [bool],
        scratch: &mut BundleScratch,
    ) {
        match &self.width {
            Width::Eight(wide) if S::F32::LANES == 8 => {
                wide.occluded_bundle(simd, &self.frame, rays, left, members, class, occluded, scratch);
            }
            Width::Sixteen(wide) if S::F32::LANES == 16 => {
                wide.occluded_bundle(simd, &self.frame, rays, left, members, class, occluded, scratch);
            }
            _ => panic!("a hierarchy runs on the lanes it was built for"),
        }
    }
}

impl RayColumns<'_> {
    #[inline(always)]
    fn ray(&self, i: usize) -> (Ray, Span) {
        let at = |columns: &[&[f64]; 3]| DVec3::new(columns[0][i], columns[1][i], columns[2][i]);
        let span = Span { start: self.spans.0[i], end: self.spans.1[i] };
        (Ray::new(at(&self.origins), at(&self.directions)), ahead(span))
    }
}

/// The rays of a packet, gathered.
struct Gathered<const W: usize> {
    rays: [Ray; W],
    spans: [Span; W],
    left: [Option<Departure>; W],
    n: usize,
}

impl<const W: usize> Gathered<W> {
    #[inline(always)]
    fn exact(&self) -> Exact<'_> {
        Exact { rays: &self.rays[..self.n], spans: &self.spans[..self.n], left: &self.left[..self.n] }
    }
}

impl<const W: usize> Wide<W> {
    #[inline(always)]
    fn gather(&self, rays: &RayColumns<'_>, left: &[Option<(u32, Side)>], members: &[u32]) -> Gathered<W> {
        let (first, span) = rays.ray(members[0] as usize);
        let mut gathered = Gathered { rays: [first; W], spans: [span; W], left: [None; W], n: members.len() };
        for (lane, &i) in members.iter().enumerate() {
            (gathered.rays[lane], gathered.spans[lane]) = rays.ray(i as usize);
            gathered.left[lane] = self.shapes.departure(left[i as usize]);
        }
        gathered
    }

    #[inline(always)]
    #[expect(
        clippy::too_many_arguments,
        reason = "rays, what they are traced with, and where the answers go"
    )]
    fn nearest_bundle<S: Simd>(
        &self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        left: &[Option<(u32, Side)>],
        members: &[u32],
        class: usize,
        hits: &mut [Option<Hit>],
        scratch: &mut BundleScratch,
    ) {
        let (suits, class) = (self.shapes.suits_packets(), class % N_CLASSES);
        for members in members.chunks(W) {
            let mut known = [None; W];
            if suits && members.len() >= LEAST_PACKET && scratch.classes[class].is_due() {
                if self.nearest_together(simd, frame, rays, left, members, class, &mut known, scratch) {
                    scratch.classes[class].succeed();
                    scratch.bundled.together += members.len() as u64;
                    for (&i, hit) in members.iter().zip(known) {
                        hits[i as usize] = hit;
                    }
                    continue;
                }
                scratch.classes[class].give_up();
                scratch.bundled.given_up += members.len() as u64;
            } else {
                scratch.bundled.alone += members.len() as u64;
            }
            let before = scratch.single.steps;
            for (&i, known) in members.iter().zip(known) {
                let (ray, span) = rays.ray(i as usize);
                hits[i as usize] =
                    self.nearest(simd, frame, &ray, span, left[i as usize], known, &mut scratch.single);
            }
            let after = scratch.single.steps;
            scratch.classes[class].alone.0 += after.nodes + after.leaves - before.nodes - before.leaves;
            scratch.classes[class].alone.1 += members.len() as u64;
        }
    }

    /// Traces a packet; whether it came to an end. Either way `known` holds what was found.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "as above")]
    fn nearest_together<S: Simd>(
        &self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        left: &[Option<(u32, Side)>],
        members: &[u32],
        class: usize,
        known: &mut [Option<Hit>; W],
        scratch: &mut BundleScratch,
    ) -> bool {
        let Some(packet) = Packet::new::<W>(simd, frame, rays, members) else { return false };
        let gathered = self.gather(rays, left, members);
        let exact = gathered.exact();
        let mut found = Found::nothing(simd, &packet);
        let budget = scratch.classes[class].budget();
        let Scratch { stack, steps, primitive_tests } = &mut scratch.single;
        let stack = stack.together.as_mut_slice();
        let (mut height, mut spent) = (0, 0);
        let mut reach = packet.reach(simd, found.ends);
        let mut current = Child::node(0);
        let is_done = loop {
            spent += 1;
            if current.is_leaf() {
                steps.leaves += 1;
                let (tests, is_new) =
                    self.shapes.nearest_of_all(simd, current.index(), &packet, &exact, &mut found, reach);
                spent += u64::from(tests);
                *primitive_tests += u64::from(tests) * members.len() as u64;
                if is_new {
                    reach = packet.reach(simd, found.ends);
                }
            } else {
                steps.nodes += 1;
                height = packet.push_children(simd, &self.tree.nodes[current.index()], reach, stack, height);
            }
            while height > 0 && stack[height - 1].1 > reach {
                height -= 1;
            }
            if height == 0 {
                break true;
            }
            if spent > budget {
                break false;
            }
            height -= 1;
            current = stack[height].0;
        };
        for (lane, known) in known.iter_mut().enumerate().take(members.len()) {
            *known = self.shapes.finish(&exact, &mut found, lane);
        }
        is_done
    }

    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "as above")]
    fn occluded_bundle<S: Simd>(
        &self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        left: &[Option<(u32, Side)>],
        members: &[u32],
        class: usize,
        occluded: &mut [bool],
        scratch: &mut BundleScratch,
    ) {
        let (suits, class) = (self.shapes.suits_packets(), class % N_CLASSES);
        for members in members.chunks(W) {
            let mut hidden = 0;
            if suits && members.len() >= LEAST_PACKET && scratch.classes[class].is_due() {
                if self.occluded_together(simd, frame, rays, left, members, class, &mut hidden, scratch) {
                    scratch.classes[class].succeed();
                    scratch.bundled.together += members.len() as u64;
                    for (lane, &i) in members.iter().enumerate() {
                        occluded[i as usize] = hidden >> lane & 1 == 1;
                    }
                    continue;
                }
                scratch.classes[class].give_up();
                scratch.bundled.given_up += members.len() as u64;
            } else {
                scratch.bundled.alone += members.len() as u64;
            }
            let before = scratch.single.steps;
            for (lane, &i) in members.iter().enumerate() {
                let (ray, span) = rays.ray(i as usize);
                occluded[i as usize] = hidden >> lane & 1 == 1
                    || self.occluded(simd, frame, &ray, span, left[i as usize], &mut scratch.single);
            }
            let after = scratch.single.steps;
            scratch.classes[class].alone.0 += after.nodes + after.leaves - before.nodes - before.leaves;
            scratch.classes[class].alone.1 += members.len() as u64;
        }
    }

    /// Traces a packet; whether it came to an end. Either way those of `hidden` are hidden.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "as above")]
    fn occluded_together<S: Simd>(
        &self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        left: &[Option<(u32, Side)>],
        members: &[u32],
        class: usize,
        hidden: &mut u32,
        scratch: &mut BundleScratch,
    ) -> bool {
        let Some(mut packet) = Packet::new::<W>(simd, frame, rays, members) else { return false };
        let gathered = self.gather(rays, left, members);
        let exact = gathered.exact();
        let all = u32::MAX >> (32 - members.len());
        let budget = scratch.classes[class].budget();
        let Scratch { stack, steps, primitive_tests } = &mut scratch.single;
        let stack = stack.together.as_mut_slice();
        let (mut height, mut spent) = (0, 0);
        let mut reach = packet.reach(simd, packet.end);
        let mut current = Child::node(0);
        loop {
            spent += 1;
            if current.is_leaf() {
                steps.leaves += 1;
                let open = all & !*hidden;
                let (tests, more) =
                    self.shapes.hidden_of_all(simd, current.index(), &packet, &exact, open, reach);
                spent += u64::from(tests);
                *primitive_tests += u64::from(tests) * members.len() as u64;
                if more != 0 {
                    *hidden |= more;
                    if *hidden == all {
                        return true;
                    }
                    // A ray that is answered asks for nothing more.
                    packet.end = simd.splat_f32(-1e30).select(simd.mask_f32(more), packet.end);
                    reach = packet.reach(simd, packet.end);
                }
            } else {
                steps.nodes += 1;
                height = packet.push_children(simd, &self.tree.nodes[current.index()], reach, stack, height);
            }
            while height > 0 && stack[height - 1].1 > reach {
                height -= 1;
            }
            if height == 0 {
                return true;
            }
            if spent > budget {
                return false;
            }
            height -= 1;
            current = stack[height].0;
        }
    }
}
