//! The leaves of a tree against packets: one primitive against all rays of a packet.
//!
//! What is the same for all packets under a shaft is made ready once: boxes and bounds for all primitives of a leaf, in
//! lanes, and the coordinates of one for all packets that may meet it.

use rayset_geometry::{PrimitiveKind, Sides, Triangle};
use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::axes::AxisRays;
use crate::exact::{Exact, PLACE_BITS, record_of};
use crate::interval::{Chords, Intervals, SphereBlock, splat};
use crate::packet::{Mask, Packet};
use crate::pairs::Pairs;
use crate::shaft::{BoxBlock, Shaft};
use crate::shapes::{Run, Shapes};
use crate::shear::ShearedAlike;
use crate::together::Question;
use crate::traverse::Aligned;
use crate::triangles::{Sheared, at_lane, one_of};

/// What it costs to test a primitive against the rays of a packet, in steps.
pub(crate) const PACKET_TEST_STEPS: u64 = 2;

/// Primitives of a run, to be tested one by one.
trait Primitives<S: Simd, const W: usize> {
    /// One of them, ready for any packet.
    type One;

    /// Which are tested together.
    #[inline(always)]
    fn pairs(&self) -> Pairs {
        Pairs::NONE
    }

    /// The one at a place, or two.
    fn one(&self, simd: S, place: usize, partner: Option<usize>) -> Self::One;

    /// Tests it against the rays of a packet, and tells where they may hit it.
    fn test<Q: Question<S, W>>(&self, simd: S, one: &Self::One, taker: &mut Taker<'_, S, Q, W>);
}

/// A packet that is tested against primitives of a run, and what it asks.
struct Taker<'a, S: Simd, Q, const W: usize> {
    exact: &'a Exact<'a, W>,
    shaft: &'a Shaft<S>,
    /// The number of the run.
    run: usize,
    packet: &'a mut Packet<S, W>,
    asked: &'a mut Q,
    /// Whether any ray now ends earlier.
    is_nearer: bool,
    /// How many exact tests there were.
    exact_tests: u32,
}

impl<S: Simd, Q: Question<S, W>, const W: usize> Taker<'_, S, Q, W> {
    /// Takes in where the rays may hit what stands at a place of the run.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "a leaf is small")]
    fn take(&mut self, simd: S, place: usize, at: &Intervals<S>) {
        if at.possible.any() {
            let record = record_of(self.run, place as u32);
            let (is_nearer, tests) = self.asked.take(simd, self.exact, self.packet, record, at);
            self.is_nearer |= is_nearer;
            self.exact_tests += tests;
        }
    }
}

/// The numbers of the primitives of a run, and from where rays may hit those that they do not leave.
#[derive(Clone, Copy)]
struct Hittable<'a, S: Simd> {
    numbers: &'a [u32],
    front: Mask<S>,
    back: Mask<S>,
    /// Whether who leaves one never meets it again.
    is_flat: bool,
}

impl<'a, S: Simd> Hittable<'a, S> {
    #[inline(always)]
    fn of<const W: usize>(simd: S, shapes: &'a Shapes<W>, run: &Run) -> Self {
        let all = u32::MAX >> (32 - W);
        Self {
            numbers: shapes.numbers_of(run),
            front: simd.mask_f32(if run.sides == Sides::Back { 0 } else { all }),
            back: simd.mask_f32(if run.sides == Sides::Front { 0 } else { all }),
            is_flat: matches!(run.kind, PrimitiveKind::Triangle | PrimitiveKind::Polygon),
        }
    }

    /// The rays of a packet that may hit the front, and the back, of the one at a place.
    #[inline(always)]
    fn by<const W: usize>(&self, simd: S, place: usize, packet: &Packet<S, W>) -> (Mask<S>, Mask<S>) {
        let Self { numbers, front, back, is_flat } = *self;
        match packet.lanes_that_leave(simd, numbers, place) {
            None => (front, back),
            Some((leaving, outwards)) => {
                (front & !leaving, back & !(if is_flat { leaving } else { outwards }))
            }
        }
    }
}

/// Triangles.
struct Triangles<'a, S: Simd, const W: usize> {
    hittable: Hittable<'a, S>,
    /// The columns of their coordinates, in the order of the shaft's axes.
    columns: [[&'a [f32; W]; 3]; 3],
    /// How far the edge functions of each may be off where a ray passes through it.
    errors: &'a Aligned<[f32; W]>,
    /// They themselves.
    exact: &'a [Triangle],
    pairs: Pairs,
}

/// A triangle, or two that share an edge: `a b c` at a place, and `a c d` at the partner's.
struct OneOrTwo<S: Simd> {
    place: usize,
    partner: Option<usize>,
    vertices: [[S::F32; 3]; 4],
    errors: [S::F32; 2],
}

impl<S: Simd, const W: usize> Triangles<'_, S, W> {
    /// Where the rays of a packet hit the triangle at a place, by how it is sheared along them.
    #[inline(always)]
    fn intervals(
        &self,
        simd: S,
        place: usize,
        sheared: &Sheared<S>,
        shaft: &Shaft<S>,
        packet: &Packet<S, W>,
    ) -> Intervals<S> {
        let (front, back) = self.hittable.by(simd, place, packet);
        sheared.intervals(simd, shaft.rounding, &packet.shears, &packet.span(), front, back)
    }

    /// Tells where the rays of a packet may hit the triangle at a place.
    #[inline(always)]
    fn tell<Q: Question<S, W>>(
        &self,
        simd: S,
        place: usize,
        sheared: &Sheared<S>,
        taker: &mut Taker<'_, S, Q, W>,
    ) {
        let at = self.intervals(simd, place, sheared, taker.shaft, taker.packet);
        if Q::EXACT && at.possible.any() {
            // The exact test will read it.
            simd.fetch(&self.exact[place]);
        }
        taker.take(simd, place, &at);
    }
}

impl<S: Simd, const W: usize> Primitives<S, W> for Triangles<'_, S, W> {
    type One = OneOrTwo<S>;

    #[inline(always)]
    fn pairs(&self) -> Pairs {
        self.pairs
    }

    #[inline(always)]
    fn one(&self, simd: S, place: usize, partner: Option<usize>) -> OneOrTwo<S> {
        let [a, b, c] = one_of(simd, &self.columns, place);
        let other = partner.unwrap_or(place);
        let d = splat(simd, at_lane(&self.columns[2], other));
        let errors = [place, other].map(|place| self.errors.0[place % W]);
        let errors = [simd.splat_f32(errors[0]), simd.splat_f32(errors[1])];
        OneOrTwo { place, partner, vertices: [a, b, c, d], errors }
    }

    #[inline(always)]
    fn test<Q: Question<S, W>>(&self, simd: S, one: &OneOrTwo<S>, taker: &mut Taker<'_, S, Q, W>) {
        let packet = &*taker.packet;
        let [a, b, c, d] = one.vertices;
        let shears = &packet.shears;
        let (a, b, c) = (shears.of(a), shears.of(b), shears.of(c));
        let Some(partner) = one.partner else {
            let sheared = Sheared::<S>::of([a, b, c]);
            // Most tests are done with here.
            if sheared.near(one.errors[0]).any() {
                self.tell(simd, one.place, &sheared, taker);
            }
            return;
        };
        let [first, second] = Sheared::<S>::two([a, b, c, shears.of(d)]);
        let (near_first, near_second) = (first.near(one.errors[0]), second.near(one.errors[1]));
        if !(near_first | near_second).any() {
            return;
        }
        if near_first.any() {
            self.tell(simd, one.place, &first, taker);
        }
        if near_second.any() {
            self.tell(simd, partner, &second, taker);
        }
    }
}

/// Spheres.
struct Spheres<'a, S: Simd, const W: usize> {
    hittable: Hittable<'a, S>,
    block: &'a SphereBlock<W>,
}

/// A sphere: its place, centre and radius.
struct OneSphere<S: Simd> {
    place: usize,
    sphere: ([S::F32; 3], S::F32),
}

impl<S: Simd, const W: usize> Spheres<'_, S, W> {
    /// Where the rays of a packet hit one.
    #[inline(always)]
    fn intervals(
        &self,
        simd: S,
        one: &OneSphere<S>,
        shaft: &Shaft<S>,
        packet: &Packet<S, W>,
    ) -> Intervals<S> {
        let chords = Chords::of(simd, one.sphere, packet.origin, packet.direction, shaft.unit);
        if !chords.are_real(simd).any() {
            return Intervals::none(simd);
        }
        let (front, back) = self.hittable.by(simd, one.place, packet);
        chords.intervals(simd, &packet.span(), front, back)
    }
}

impl<S: Simd, const W: usize> Primitives<S, W> for Spheres<'_, S, W> {
    type One = OneSphere<S>;

    #[inline(always)]
    fn one(&self, simd: S, place: usize, _: Option<usize>) -> OneSphere<S> {
        OneSphere { place, sphere: self.block.one(simd, place % W) }
    }

    #[inline(always)]
    fn test<Q: Question<S, W>>(&self, simd: S, one: &OneSphere<S>, taker: &mut Taker<'_, S, Q, W>) {
        let at = self.intervals(simd, one, taker.shaft, taker.packet);
        taker.take(simd, one.place, &at);
    }
}

/// Polygons or cones.
struct Others<'a, S: Simd, const W: usize> {
    hittable: Hittable<'a, S>,
    shapes: &'a Shapes<W>,
    run: &'a Run,
}

impl<S: Simd, const W: usize> Others<'_, S, W> {
    /// Where the rays of a packet hit the one at a place: surely only where a fan says so.
    #[inline(always)]
    fn intervals(&self, simd: S, place: usize, shaft: &Shaft<S>, packet: &Packet<S, W>) -> Intervals<S> {
        let Self { hittable, shapes, run } = self;
        let bounds = shapes.box_block(run).bounds(place);
        let slabs = packet.slabs(simd, shaft.unit);
        let (possible, low) = slabs.enter(simd, bounds, packet.start, packet.ends);
        let high = simd.splat_f32(f32::INFINITY);
        if possible.any() {
            if run.kind == PrimitiveKind::Cone {
                let rays = AxisRays::new([packet.origin, packet.direction], packet.span(), shaft.unit);
                let sides = hittable.by(simd, place, packet);
                let found = shapes.axis_block(run).intervals_of_rays(simd, place, &rays, sides);
                let (possible, low) = (possible & found.possible, low.max(found.low));
                return Intervals { possible, sure: possible & found.sure, low, high: found.high };
            }
            if let Some(block) = shapes.polygon_block(run) {
                let (axes, shears) = (shaft.beam.axes, packet.shears);
                let rays = ShearedAlike { axes, shears, rounding: shaft.rounding };
                let (front, back) = hittable.by(simd, place, packet);
                let sides = (front & possible, back & possible);
                let found = block.intervals(simd, place, &rays, (&packet.span(), low), sides);
                return Intervals { low: low.max(found.low), ..found };
            }
        }
        Intervals { possible, sure: simd.mask_f32(0), low, high }
    }
}

impl<S: Simd, const W: usize> Primitives<S, W> for Others<'_, S, W> {
    type One = usize;

    #[inline(always)]
    fn one(&self, _: S, place: usize, _: Option<usize>) -> usize {
        place
    }

    #[inline(always)]
    fn test<Q: Question<S, W>>(&self, simd: S, &place: &usize, taker: &mut Taker<'_, S, Q, W>) {
        let at = self.intervals(simd, place, taker.shaft, taker.packet);
        taker.take(simd, place, &at);
    }
}

/// Packets under a shaft, what they ask, and how far they have come.
pub(crate) struct Asking<'a, S: Simd, Q, const W: usize> {
    pub(crate) exact: &'a Exact<'a, W>,
    pub(crate) shaft: &'a Shaft<S>,
    pub(crate) packets: &'a mut [Packet<S, W>],
    pub(crate) asked: &'a mut [Q],
    pub(crate) progress: Progress<S>,
}

impl<S: Simd, Q: Question<S, W>, const W: usize> Asking<'_, S, Q, W> {
    /// Tests a leaf against the packets; there is but one if they are `ALONE`.
    #[inline(always)]
    pub(crate) fn leaf<const ALONE: bool>(&mut self, simd: S, first_run: usize) {
        let (shapes, shaft) = (self.exact.shapes, self.shaft);
        let (mut boxes, mut errors) = (BoxBlock::EMPTY, Aligned([0.0; W]));
        let mut i = first_run;
        loop {
            let run = &shapes.runs()[i];
            let hittable = Hittable::of(simd, shapes, run);
            match run.kind {
                PrimitiveKind::Triangle => {
                    let block = shapes.triangle_block(run);
                    let extents = block.boxes(simd, &mut boxes);
                    shaft.rounding.of_edges(simd, extents).store(&mut errors.0);
                    let columns = block.columns(shaft.beam.axes);
                    let exact = shapes.triangles_of(run);
                    let triangles =
                        Triangles { hittable, columns, errors: &errors, exact, pairs: shapes.pairs(run) };
                    self.run::<ALONE, _>(simd, i, &boxes, &triangles);
                }
                PrimitiveKind::Sphere => {
                    let block = shapes.sphere_block(run);
                    block.boxes(simd, &mut boxes);
                    self.run::<ALONE, _>(simd, i, &boxes, &Spheres { hittable, block });
                }
                PrimitiveKind::Polygon | PrimitiveKind::Cone => {
                    let others = Others { hittable, shapes, run };
                    self.run::<ALONE, _>(simd, i, shapes.box_block(run), &others);
                }
            }
            if !run.goes_on {
                return;
            }
            i += 1;
        }
    }

    /// Tests the primitives of a run, whose boxes are given, against the packets.
    #[inline(always)]
    fn run<const ALONE: bool, P: Primitives<S, W>>(
        &mut self,
        simd: S,
        i: usize,
        boxes: &BoxBlock<W>,
        primitives: &P,
    ) {
        let Self { exact, shaft, packets, asked, progress } = self;
        let mut candidates = shaft.candidates(simd, boxes, progress.reach);
        // Where any hit will do, packets by themselves are often answered by the first half.
        let pairs = if ALONE && !Q::EXACT { Pairs::NONE } else { primitives.pairs() };
        let mut is_new = false;
        while candidates != 0 {
            let place = candidates.trailing_zeros();
            candidates &= candidates - 1;
            let partner = pairs.of(place);
            let partner = (candidates >> partner & 1 != 0).then_some(partner as usize);
            let mut bounds = boxes.bounds(place as usize);
            if let Some(partner) = partner {
                candidates &= !(1 << partner);
                bounds = union(bounds, boxes.bounds(partner));
            }
            let mut met = 1;
            if !ALONE {
                progress.shaft_tests += 1;
                met = shaft.packets_that_meet(simd, bounds, progress.reaches);
                if met == 0 {
                    continue;
                }
            }
            let one = primitives.one(simd, place as usize, partner);
            let n_tested = 1 + u64::from(partner.is_some());
            while met != 0 {
                let p = if ALONE { 0 } else { met.trailing_zeros() as usize };
                met &= met - 1;
                let (packet, asked) = (&mut packets[p], &mut asked[p]);
                progress.packet_tests += 1;
                progress.ray_tests += n_tested * packet.len as u64;
                let mut taker =
                    Taker { exact, shaft, run: i, packet, asked, is_nearer: false, exact_tests: 0 };
                primitives.test(simd, &one, &mut taker);
                let Taker { is_nearer, exact_tests, .. } = taker;
                progress.exact_tests += u64::from(exact_tests);
                if is_nearer {
                    let reach = simd.splat_f32(shaft.reach(simd, packet));
                    reach.put(simd.mask_f32(1 << p), &mut progress.reaches);
                    is_new = true;
                }
            }
        }
        if is_new {
            progress.sum_up();
        }
    }
}

/// A box round two.
#[inline(always)]
fn union([low, high]: [[f32; 3]; 2], [other_low, other_high]: [[f32; 3]; 2]) -> [[f32; 3]; 2] {
    let mut both = [low, high];
    for k in 0..3 {
        both[0][k] = if other_low[k] < low[k] { other_low[k] } else { low[k] };
        both[1][k] = if other_high[k] > high[k] { other_high[k] } else { high[k] };
    }
    both
}

/// How far the packets of a shaft still reach along its axis, and what testing them took.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Progress<S: Simd> {
    /// Of each packet; of those that are not there, nowhere.
    pub(crate) reaches: S::F32,
    /// The farthest.
    pub(crate) reach: f32,
    /// Tests of a primitive against the shafts of the packets.
    pub(crate) shaft_tests: u64,
    /// Tests of a primitive against the rays of a packet.
    pub(crate) packet_tests: u64,
    /// How many rays and primitives those were.
    pub(crate) ray_tests: u64,
    /// Tests of a ray in double precision, where single precision was not sure.
    pub(crate) exact_tests: u64,
}

impl<S: Simd> Progress<S> {
    #[inline(always)]
    pub(crate) fn new<const W: usize>(simd: S, shaft: &Shaft<S>, packets: &[Packet<S, W>]) -> Self {
        let mut reaches = [-1e30; W];
        for (reach, packet) in reaches.iter_mut().zip(packets) {
            *reach = shaft.reach(simd, packet);
        }
        let reaches = simd.load_f32(&reaches);
        let reach = reaches.greatest();
        Self { reaches, reach, shaft_tests: 0, packet_tests: 0, ray_tests: 0, exact_tests: 0 }
    }

    /// What the tests of rays against primitives took, in steps.
    pub(crate) fn tests(&self) -> u64 {
        PACKET_TEST_STEPS * self.packet_tests + self.exact_tests
    }

    #[inline(always)]
    fn sum_up(&mut self) {
        self.reach = self.reaches.greatest();
    }
}

impl<const W: usize> Shapes<W> {
    /// Whether packets can test everything there is.
    pub(crate) fn suits_packets(&self) -> bool {
        self.runs().len() < 1 << (31 - PLACE_BITS)
    }

    /// Answers the rays of packets under a shaft that surely hit the primitive of a record, if any hit is an answer.
    #[inline(always)]
    pub(crate) fn block<S: Simd, Q: Question<S, W>>(
        &self,
        simd: S,
        record: u32,
        shaft: &Shaft<S>,
        packets: &mut [Packet<S, W>],
        asked: &mut [Q],
    ) -> Blocking {
        let (run, place) = self.place_of(record);
        let place = place as usize;
        let hittable = Hittable::of(simd, self, run);
        match run.kind {
            PrimitiveKind::Triangle => {
                let vertices = self.triangle_block(run).one(simd, place, shaft.beam.axes);
                block(simd, &OneTriangle { hittable, place, vertices }, shaft, packets, asked)
            }
            PrimitiveKind::Sphere => {
                let spheres = Spheres { hittable, block: self.sphere_block(run) };
                let one = spheres.one(simd, place, None);
                block(simd, &(spheres, one), shaft, packets, asked)
            }
            PrimitiveKind::Polygon | PrimitiveKind::Cone => {
                block(simd, &(Others { hittable, shapes: self, run }, place), shaft, packets, asked)
            }
        }
    }
}

/// One primitive that may block rays.
trait Blocker<S: Simd, const W: usize> {
    /// Where the rays of a packet hit it.
    fn at(&self, simd: S, shaft: &Shaft<S>, packet: &Packet<S, W>) -> Intervals<S>;
}

struct OneTriangle<'a, S: Simd> {
    hittable: Hittable<'a, S>,
    place: usize,
    /// In the order of the shaft's axes.
    vertices: [[S::F32; 3]; 3],
}

impl<S: Simd, const W: usize> Blocker<S, W> for OneTriangle<'_, S> {
    #[inline(always)]
    fn at(&self, simd: S, shaft: &Shaft<S>, packet: &Packet<S, W>) -> Intervals<S> {
        let [a, b, c] = self.vertices;
        let shears = &packet.shears;
        let sheared = Sheared::<S>::of([shears.of(a), shears.of(b), shears.of(c)]);
        let (front, back) = self.hittable.by(simd, self.place, packet);
        sheared.intervals(simd, shaft.rounding, &packet.shears, &packet.span(), front, back)
    }
}

impl<S: Simd, const W: usize> Blocker<S, W> for (Spheres<'_, S, W>, OneSphere<S>) {
    #[inline(always)]
    fn at(&self, simd: S, shaft: &Shaft<S>, packet: &Packet<S, W>) -> Intervals<S> {
        self.0.intervals(simd, &self.1, shaft, packet)
    }
}

impl<S: Simd, const W: usize> Blocker<S, W> for (Others<'_, S, W>, usize) {
    #[inline(always)]
    fn at(&self, simd: S, shaft: &Shaft<S>, packet: &Packet<S, W>) -> Intervals<S> {
        self.0.intervals(simd, self.1, shaft, packet)
    }
}

/// What came of asking packets about a blocker.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Blocking {
    /// How many rays it blocks.
    pub(crate) answered: u64,
    /// How many packets, and rays of these, it was tested against.
    pub(crate) packets: u64,
    pub(crate) rays: u64,
}

/// Answers the rays that a primitive surely blocks, of packets that are not answered whole.
#[inline(always)]
fn block<S: Simd, Q: Question<S, W>, const W: usize>(
    simd: S,
    blocker: &impl Blocker<S, W>,
    shaft: &Shaft<S>,
    packets: &mut [Packet<S, W>],
    asked: &mut [Q],
) -> Blocking {
    let mut blocking = Blocking::default();
    for (packet, asked) in packets.iter_mut().zip(asked) {
        if asked.is_open(packet) {
            let at = blocker.at(simd, shaft, packet);
            let blocked = (at.possible & at.sure).bits();
            asked.block(simd, packet, blocked);
            blocking.answered += u64::from(blocked.count_ones());
            blocking.packets += 1;
            blocking.rays += packet.len as u64;
        }
    }
    blocking
}
