//! The leaves of a tree against packets: one primitive against all rays of a packet.
//!
//! What is the same for all packets under a shaft is made ready once: boxes and bounds for all primitives of a leaf, in
//! lanes, and the coordinates of one for all packets that may meet it.

use rayset_geometry::{PrimitiveKind, Sides, Triangle};
use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::axes::AxisRays;
use crate::exact::{Exact, PLACE_BITS, record_of};
use crate::interval::{Chords, Intervals, SphereBlock};
use crate::packet::{Mask, Packet};
use crate::shaft::{BoxBlock, Shaft};
use crate::shapes::{Run, Shapes};
use crate::together::Question;
use crate::traverse::Aligned;
use crate::triangles::{Sheared, one_of};

/// What it costs to test a primitive against the rays of a packet, in steps.
pub(crate) const PACKET_TEST_STEPS: u64 = 2;

/// Primitives of a run, to be tested one by one.
trait Primitives<S: Simd, const W: usize> {
    /// One of them, ready for any packet.
    type One;

    /// The one at a place.
    fn one(&self, simd: S, place: usize) -> Self::One;

    /// Where the rays of a packet hit it.
    fn intervals(&self, simd: S, one: &Self::One, shaft: &Shaft<S>, packet: &Packet<S, W>) -> Intervals<S>;

    /// Asks for what the exact test of the one at a place reads.
    #[inline(always)]
    fn fetch(&self, _: S, _: usize) {}

    /// What an exact test of a ray and one of them costs, in steps.
    fn exact_steps(&self) -> u32 {
        1
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
}

/// A triangle.
struct OneTriangle<S: Simd> {
    place: usize,
    vertices: [[S::F32; 3]; 3],
    error: S::F32,
}

impl<S: Simd, const W: usize> Primitives<S, W> for Triangles<'_, S, W> {
    type One = OneTriangle<S>;

    #[inline(always)]
    fn one(&self, simd: S, place: usize) -> OneTriangle<S> {
        let error = simd.splat_f32(self.errors.0[place % W]);
        OneTriangle { place, vertices: one_of(simd, &self.columns, place), error }
    }

    #[inline(always)]
    fn intervals(
        &self,
        simd: S,
        one: &OneTriangle<S>,
        shaft: &Shaft<S>,
        packet: &Packet<S, W>,
    ) -> Intervals<S> {
        let [a, b, c] = one.vertices;
        let sheared = Sheared::<S>::of([packet.shear(a), packet.shear(b), packet.shear(c)]);
        // Most tests are done with here.
        if !sheared.near(one.error).any() {
            return Intervals::none(simd);
        }
        let (front, back) = self.hittable.by(simd, one.place, packet);
        sheared.intervals(simd, shaft.rounding(), packet.factors[2], &packet.span(), front, back)
    }

    #[inline(always)]
    fn fetch(&self, simd: S, place: usize) {
        simd.fetch(&self.exact[place]);
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

impl<S: Simd, const W: usize> Primitives<S, W> for Spheres<'_, S, W> {
    type One = OneSphere<S>;

    #[inline(always)]
    fn one(&self, simd: S, place: usize) -> OneSphere<S> {
        OneSphere { place, sphere: self.block.one(simd, place % W) }
    }

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

/// Polygons or cones.
struct Others<'a, S: Simd, const W: usize> {
    hittable: Hittable<'a, S>,
    shapes: &'a Shapes<W>,
    run: &'a Run,
}

impl<S: Simd, const W: usize> Primitives<S, W> for Others<'_, S, W> {
    type One = usize;

    #[inline(always)]
    fn one(&self, _: S, place: usize) -> usize {
        place
    }

    /// Surely only where a fan says so.
    #[inline(always)]
    fn intervals(&self, simd: S, &place: &usize, shaft: &Shaft<S>, packet: &Packet<S, W>) -> Intervals<S> {
        let Self { hittable, shapes, run } = self;
        let bounds = shapes.box_block(run).bounds(place);
        let slabs = packet.slabs(simd, shaft.unit);
        let (mut possible, mut low) = slabs.enter(simd, bounds, packet.start, packet.ends);
        let high = simd.splat_f32(f32::INFINITY);
        if possible.any() {
            if run.kind == PrimitiveKind::Cone {
                let (ways, spans) = ([packet.origin, packet.direction], [packet.start, packet.ends]);
                let rays = AxisRays::new(ways, spans, shaft.unit);
                let met = shapes.axis_block(run).rays_that_meet(simd, place, &rays);
                possible = possible & met;
            } else if let Some(fans) = shapes.fan_block(run) {
                let (sides, span) = (hittable.by(simd, place, packet), packet.span());
                let Intervals { possible: met, sure, low: nearest, high } =
                    fans.all_intervals(simd, place, shaft, packet, sides);
                low = low.max(nearest);
                possible = possible & met & low.le(span.ends) & high.ge(span.start);
                let sure = sure & low.gt(span.start_above) & high.lt(span.end_below);
                return Intervals { possible, sure, low, high };
            }
        }
        Intervals { possible, sure: simd.mask_f32(0), low, high }
    }

    fn exact_steps(&self) -> u32 {
        let is_long = self.run.kind == PrimitiveKind::Polygon && self.shapes.fan_block(self.run).is_none();
        if is_long { 32 } else { 1 }
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
                    shaft.rounding().of_edges(simd, extents).store(&mut errors.0);
                    let columns = block.columns(shaft.axes);
                    let exact = shapes.triangles_of(run);
                    let triangles = Triangles { hittable, columns, errors: &errors, exact };
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
        let mut is_new = false;
        while candidates != 0 {
            let place = candidates.trailing_zeros();
            candidates &= candidates - 1;
            let mut met = 1;
            if !ALONE {
                progress.shaft_tests += 1;
                met = shaft.packets_that_meet(simd, boxes.bounds(place as usize), progress.reaches);
                if met == 0 {
                    continue;
                }
            }
            let one = primitives.one(simd, place as usize);
            while met != 0 {
                let p = if ALONE { 0 } else { met.trailing_zeros() as usize };
                met &= met - 1;
                let (packet, asked) = (&mut packets[p], &mut asked[p]);
                progress.packet_tests += 1;
                progress.ray_tests += packet.len as u64;
                let at = primitives.intervals(simd, &one, shaft, packet);
                if at.possible.any() {
                    if Q::EXACT {
                        primitives.fetch(simd, place as usize);
                    }
                    let (is_nearer, tests) = asked.take(simd, exact, packet, record_of(i, place), &at);
                    progress.exact_steps += u64::from(tests * primitives.exact_steps());
                    if is_nearer {
                        let reach = simd.splat_f32(shaft.reach(simd, packet));
                        reach.put(simd.mask_f32(1 << p), &mut progress.reaches);
                        is_new = true;
                    }
                }
            }
        }
        if is_new {
            progress.sum_up();
        }
    }
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
    /// How many rays those were.
    pub(crate) ray_tests: u64,
    /// Steps for tests in double precision, where single precision was not sure.
    pub(crate) exact_steps: u64,
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
        Self { reaches, reach, shaft_tests: 0, packet_tests: 0, ray_tests: 0, exact_steps: 0 }
    }

    /// What the tests of rays against primitives took, in steps.
    pub(crate) fn tests(&self) -> u64 {
        PACKET_TEST_STEPS * self.packet_tests + self.exact_steps
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

    /// The rays of a packet that surely hit the primitive of a record.
    #[inline(always)]
    pub(crate) fn surely_hit<S: Simd>(
        &self,
        simd: S,
        record: u32,
        shaft: &Shaft<S>,
        packet: &Packet<S, W>,
    ) -> Mask<S> {
        let (run, place) = self.place_of(record);
        let place = place as usize;
        let hittable = Hittable::of(simd, self, run);
        let at = match run.kind {
            PrimitiveKind::Triangle => {
                let columns = self.triangle_block(run).columns(shaft.axes);
                let errors = &Aligned([f32::INFINITY; W]);
                let triangles = Triangles { hittable, columns, errors, exact: self.triangles_of(run) };
                triangles.intervals(simd, &triangles.one(simd, place), shaft, packet)
            }
            PrimitiveKind::Sphere => {
                let spheres = Spheres { hittable, block: self.sphere_block(run) };
                spheres.intervals(simd, &spheres.one(simd, place), shaft, packet)
            }
            PrimitiveKind::Polygon | PrimitiveKind::Cone => {
                Others { hittable, shapes: self, run }.intervals(simd, &place, shaft, packet)
            }
        };
        at.possible & at.sure
    }
}
