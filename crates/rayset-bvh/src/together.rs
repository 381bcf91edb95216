//! What packets ask for, and the answers so far.

use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::columns::HitOrNone;
use crate::exact::{Exact, ExactHits, ExactSure, ExactTogether, NONE, Sure};
use crate::interval::Intervals;
use crate::packet::Packet;
use crate::shapes::Hit;

/// What the rays of a packet ask for, and the answers so far.
pub(crate) trait Question<S: Simd, const W: usize>: Copy {
    /// Whether it is asked where exactly a hit is.
    const EXACT: bool;

    /// Nothing is known yet.
    fn new(simd: S) -> Self;

    /// Takes in where a record may be hit; whether any ray of the packet now ends earlier, and the number of exact tests.
    fn take(
        &mut self,
        simd: S,
        exact: &Exact<'_, W>,
        packet: &mut Packet<S, W>,
        record: u32,
        at: &Intervals<S>,
    ) -> (bool, u32);

    /// Whether any ray of the packet is still without an answer, if any hit is one.
    fn is_open(&self, packet: &Packet<S, W>) -> bool;

    /// Takes in the lanes that a blocker of other rays surely blocks, if that is all that is asked.
    fn block(&mut self, simd: S, packet: &mut Packet<S, W>, lanes: u32);

    /// How many lanes blockers of other rays block, and the record of what was found last to block one.
    fn blocked(&self) -> (u64, Option<u32>);
}

/// The nearest hits, each known by its record and an interval.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nearest<S: Simd> {
    /// No hit lies before these.
    lows: S::F32,
    /// The bits of each hit's record.
    records: S::F32,
}

impl<S: Simd, const W: usize> Question<S, W> for Nearest<S> {
    const EXACT: bool = true;

    #[inline(always)]
    fn new(simd: S) -> Self {
        Self { lows: simd.splat_f32(f32::INFINITY), records: simd.splat_f32(f32::from_bits(NONE)) }
    }

    #[inline(always)]
    fn take(
        &mut self,
        simd: S,
        exact: &Exact<'_, W>,
        packet: &mut Packet<S, W>,
        record: u32,
        at: &Intervals<S>,
    ) -> (bool, u32) {
        let taken = at.possible & at.sure & at.high.lt(self.lows);
        let unsure = (at.possible & !taken).bits();
        let tests = unsure.count_ones();
        at.low.put(taken, &mut self.lows);
        at.high.put(taken, &mut packet.ends);
        simd.splat_f32(f32::from_bits(record)).put(taken, &mut self.records);
        if unsure != 0 {
            let hits = exact.hits(simd, packet, unsure, record);
            let mut lanes = hits.lanes;
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize % W;
                lanes &= lanes - 1;
                let hit = Hit { t: hits.t[lane], primitive: hits.primitive };
                self.compare(simd, exact, packet, lane, record, hit);
            }
        }
        (true, tests)
    }

    #[inline(always)]
    fn is_open(&self, _: &Packet<S, W>) -> bool {
        true
    }

    #[inline(always)]
    fn block(&mut self, _: S, _: &mut Packet<S, W>, _: u32) {}

    #[inline(always)]
    fn blocked(&self) -> (u64, Option<u32>) {
        (0, None)
    }
}

impl<S: Simd> Nearest<S> {
    /// Keeps the nearer of what a lane has found and the exact hit of a record: by an exact test of what was found, where
    /// its interval does not tell.
    #[inline(always)]
    fn compare<const W: usize>(
        &mut self,
        simd: S,
        exact: &Exact<'_, W>,
        packet: &mut Packet<S, W>,
        lane: usize,
        record: u32,
        hit: Hit,
    ) {
        let (low, high) = (packet.below(exact.frame, hit.t), packet.above(exact.frame, hit.t));
        let mut lows = [0.0; W];
        self.lows.store(&mut lows);
        if high >= lows[lane] {
            let mut records = [0.0; W];
            self.records.store(&mut records);
            let best = records[lane].to_bits();
            if best != NONE
                && let Some(best) = exact.hit(simd, packet.first + lane, best)
                && !hit.precedes(&best)
            {
                return;
            }
        }
        let mask = simd.mask_f32(1 << lane);
        simd.splat_f32(f32::from_bits(record)).put(mask, &mut self.records);
        simd.splat_f32(low).put(mask, &mut self.lows);
        simd.splat_f32(high).put(mask, &mut packet.ends);
    }

    /// What the rays of a packet have found, exactly.
    #[inline(always)]
    pub(crate) fn finish<const W: usize>(
        &self,
        simd: S,
        exact: &Exact<'_, W>,
        packet: &Packet<S, W>,
        found: &mut [HitOrNone],
    ) {
        let mut records = [0.0; W];
        self.records.store(&mut records);
        let records = records.map(f32::to_bits);
        let lanes = !simd.equal_u32(&records, NONE).bits() & (u32::MAX >> (32 - packet.len));
        if lanes != 0 {
            simd.outline(ExactSure { exact, packet, records, lanes, found });
        }
    }
}

impl<const W: usize> Exact<'_, W> {
    /// The exact hits of rays of a packet, of a record.
    #[inline(always)]
    fn hits<S: Simd>(&self, simd: S, packet: &Packet<S, W>, lanes: u32, record: u32) -> ExactHits<W> {
        let Sure { kind, index, .. } = self.sure(record);
        let leaving = packet.leaving(simd, self.shapes.number(kind, index));
        simd.outline(ExactTogether { exact: self, first: packet.first, lanes, leaving, record })
    }
}

/// Whether anything is hit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hidden {
    /// A bit a lane.
    pub(crate) lanes: u32,
    /// Those that blockers of other rays block.
    blocked: u32,
    /// The record of what was found last.
    record: u32,
}

impl Hidden {
    /// Some lanes are answered before.
    #[inline(always)]
    pub(crate) fn begin<S: Simd, const W: usize>(&mut self, simd: S, packet: &mut Packet<S, W>, lanes: u32) {
        self.lanes = lanes;
        packet.close(simd, lanes);
    }
}

impl<S: Simd, const W: usize> Question<S, W> for Hidden {
    const EXACT: bool = false;

    #[inline(always)]
    fn new(_: S) -> Self {
        Self { lanes: 0, blocked: 0, record: NONE }
    }

    #[inline(always)]
    fn take(
        &mut self,
        simd: S,
        exact: &Exact<'_, W>,
        packet: &mut Packet<S, W>,
        record: u32,
        at: &Intervals<S>,
    ) -> (bool, u32) {
        let mut more = (at.possible & at.sure).bits();
        let unsure = at.possible.bits() & !more;
        let tests = unsure.count_ones();
        if unsure != 0 {
            more |= exact.hits(simd, packet, unsure, record).lanes;
        }
        if more != 0 {
            self.record = record;
        }
        self.lanes |= more;
        packet.close(simd, more);
        (more != 0, tests)
    }

    #[inline(always)]
    fn is_open(&self, packet: &Packet<S, W>) -> bool {
        !self.lanes & (u32::MAX >> (32 - packet.len)) != 0
    }

    #[inline(always)]
    fn block(&mut self, simd: S, packet: &mut Packet<S, W>, lanes: u32) {
        self.lanes |= lanes;
        self.blocked |= lanes;
        packet.close(simd, lanes);
    }

    #[inline(always)]
    fn blocked(&self) -> (u64, Option<u32>) {
        (u64::from(self.blocked.count_ones()), (self.record != NONE).then_some(self.record))
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use rayset_geometry::glam::DVec3;
    use rayset_geometry::{BoundingBox, Probe, Ray, Sides, Span, Triangle, unit};
    use rayset_simd::{Backend, Kernel, Scalar};

    use super::*;
    use crate::columns::RayColumns;
    use crate::frame::Frame;
    use crate::packet::{Approach, level};
    use crate::shaft::{BoxBlock, Shaft};
    use crate::triangles::{Sheared, TriangleBlock};

    /// How often single precision contradicts the exact test of a triangle, for rays that go mostly across the axis of
    /// their packet.
    #[derive(Debug, Default)]
    struct Tally {
        lost: u32,
        false_sure: u32,
        out_of_interval: u32,
        hits: u32,
    }

    struct Oblique {
        /// By what the margins are multiplied.
        factor: f32,
    }

    impl Kernel for Oblique {
        type Output = Tally;

        fn run<S: Simd>(self, simd: S) -> Tally {
            if S::F32::LANES == 16 {
                oblique::<S, 16>(simd, self.factor)
            } else {
                oblique::<S, 8>(simd, self.factor)
            }
        }
    }

    fn oblique<S: Simd, const W: usize>(simd: S, factor: f32) -> Tally {
        let mut dice = ChaCha8Rng::seed_from_u64(3);
        let mut tally = Tally::default();
        let frame = Frame::of(&BoundingBox { min: DVec3::NEG_ONE, max: DVec3::ONE });
        for case in 0..30_000 {
            let mut at = || 2.0 * f64::from(dice.next_u32()) / f64::from(u32::MAX) - 1.0;
            let mut point = || DVec3::new(at(), at(), at());
            let (a, b, c, across) = (0.8 * point(), point(), point(), point());
            let size = [0.1, 1e-2, 1e-3][case % 3];
            let corners = [a, a + size * b, a + size * c];
            let offset = [0.0, 1e-8, -1e-8, 1e-7, -1e-7, 1e-6, -1e-6, 1e-3][case % 8];
            let edge = corners[1] + (0.5 + 0.5 * at()) * (corners[2] - corners[1]);
            let target = edge + offset * (corners[0] - edge);
            // A quarter of the direction goes along z.
            let flat = unit(DVec3::new(across.x, across.y, 0.0)).unwrap_or(DVec3::X);
            let direction = unit(0.97 * flat + 0.25 * DVec3::Z).expect("it has a length");
            let eye = target - (0.5 + 0.4 * at()) * direction;
            let mut columns: [Vec<f64>; 6] = Default::default();
            for lane in 0..W {
                let direction = if lane == 0 { direction } else { DVec3::Z };
                for k in 0..3 {
                    columns[k].push(eye[k]);
                    columns[3 + k].push(direction[k]);
                }
            }
            let (starts, ends) = (vec![0.0; W], vec![f64::INFINITY; W]);
            let [ox, oy, oz, dx, dy, dz] = &columns;
            let (origins, directions) = ([&ox[..], oy, oz], [&dx[..], dy, dz]);
            let rays = RayColumns { origins, directions, spans: (&starts, &ends), left: &[] };
            let approach = Approach::of(&frame, &rays, 0..W, true);
            let mut packet = [Packet::<S, W>::new(simd, 0, W, &approach)];
            let units = level(simd, &mut packet, &approach).expect("they start nearby");
            let shaft = Shaft::around(simd, &mut packet, units, &approach).expect("all go along z");
            let packet = &packet[0];
            let mut block = TriangleBlock::<W>::EMPTY;
            block.set(0, corners.map(|corner| frame.point(corner).to_array()));
            let [a, b, c] = block.one(simd, 0, shaft.beam.axes);
            let [a, b, c] = [a, b, c].map(|vertex| packet.shears.of(vertex));
            // By itself, or as the second of two: then the edge that rays are aimed at is shared.
            let sheared =
                if case / 24 % 2 == 0 { Sheared::of([a, b, c]) } else { Sheared::two([b, a, c, a])[1] };
            let (all, rounding) = (simd.mask_f32(u32::MAX), shaft.rounding.times(factor));
            let extents = block.boxes(simd, &mut BoxBlock::EMPTY.clone());
            let near = sheared.near(simd.splat_f32(rounding.of_edges(simd, extents).lane(0)));
            let found = sheared.intervals(simd, rounding, &packet.shears, &packet.span(), all, all);
            let (possible, sure) = ((found.possible & near).bits() & 1 == 1, found.sure.bits() & 1 == 1);
            let probe = Probe::new(Scalar, &Ray::new(eye, direction), Span::FORWARD, true);
            let [a, b, c] = corners;
            let exact = Triangle::new(a, b, c).intersect(&probe, Sides::Both, None);
            tally.hits += u32::from(exact.is_some());
            tally.lost += u32::from(exact.is_some() && !possible);
            tally.false_sure += u32::from(exact.is_none() && sure);
            if let Some(t) = exact
                && possible
            {
                let (low, high) = (found.low.lane(0), found.high.lane(0));
                let is_within = low <= packet.above(&frame, t) && (!sure || high >= packet.below(&frame, t));
                tally.out_of_interval += u32::from(!is_within);
            }
        }
        tally
    }

    #[test]
    fn oblique_rays_of_a_packet_lose_no_triangle() {
        for &backend in Backend::available() {
            let tally = backend.run(Oblique { factor: 1.0 });
            let wrong = (tally.lost, tally.false_sure, tally.out_of_interval);
            assert!(wrong == (0, 0, 0) && tally.hits > 5_000, "{backend}: {tally:?}");
            let tally = backend.run(Oblique { factor: 0.0 });
            assert!(
                tally.lost > 0 && tally.false_sure > 0 && tally.out_of_interval > 0,
                "{backend}: {tally:?}"
            );
        }
    }
}
