//! The leaves of a packet: one primitive against all rays.

use rayset_geometry::{Departure, PrimitiveKind, Ray, Side, Sides, Span};
use rayset_simd::{LaneMask, Lanes, Simd};

use crate::interval::{self, Intervals, SpanLanes};
use crate::packet::Packet;
use crate::shapes::{Hit, Run, Shapes};

/// How many bits of a record's number say where in its run it stands.
const PLACE_BITS: u32 = 4;
/// No record.
const NONE: u32 = u32::MAX;
/// How much more a shear adds to errors whose axis has a fifth of the direction at least, and not half at least.
const SHEAR_SCALE: f32 = 5.0;

/// What the rays of a packet have found: each by its interval or exactly.
#[derive(Clone, Debug)]
pub(crate) struct Found<S: Simd, const W: usize> {
    /// No hit lies before these.
    lows: S::F32,
    /// The nearest hit is not behind these.
    pub(crate) ends: S::F32,
    /// The nearest hit's run, and its place there.
    records: [u32; W],
    /// Which lanes know their hit exactly.
    exact: u32,
    hits: [Hit; W],
}

/// The rays of a packet as the exact tests need them, a lane each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exact<'a> {
    pub(crate) rays: &'a [Ray],
    pub(crate) spans: &'a [Span],
    /// What each leaves.
    pub(crate) left: &'a [Option<Departure>],
}

impl<S: Simd, const W: usize> Found<S, W> {
    pub(crate) fn nothing(simd: S, packet: &Packet<S>) -> Self {
        Self {
            lows: simd.splat_f32(f32::INFINITY),
            ends: packet.end,
            records: [NONE; W],
            exact: 0,
            hits: [Hit { t: 0.0, primitive: 0 }; W],
        }
    }
}

/// The number of what stands at a place of a run.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "`Shapes::suits_packets` has counted the runs")]
fn record_of(run: usize, place: u32) -> u32 {
    (run as u32) << PLACE_BITS | place
}

impl<const W: usize> Shapes<W> {
    /// Whether packets can test everything there is.
    pub(crate) fn suits_packets(&self) -> bool {
        self.has_blocks_only() && self.runs().len() < 1 << (31 - PLACE_BITS)
    }

    /// Where the rays hit the primitive at a place of a run.
    #[inline(always)]
    fn all_intervals<S: Simd>(
        &self,
        simd: S,
        run: &Run,
        place: u32,
        packet: &Packet<S>,
        ends: S::F32,
        left: &[Option<Departure>],
    ) -> Intervals<S> {
        let all = u32::MAX >> (32 - W);
        let mut front = if run.sides == Sides::Back { 0 } else { all };
        let mut back = if run.sides == Sides::Front { 0 } else { all };
        for (lane, departure) in left.iter().enumerate() {
            if let Some(departure) = departure
                && departure.index == run.first + place
                && departure.kind == run.kind
            {
                front &= !(1 << lane);
                if departure.side == Side::Front || run.kind == PrimitiveKind::Triangle {
                    back &= !(1 << lane);
                }
            }
        }
        let (front, back) = (simd.mask_f32(front), simd.mask_f32(back));
        let span = SpanLanes {
            start: packet.start,
            start_above: packet.start_above,
            end_below: packet.end_below,
            ends,
        };
        if run.kind == PrimitiveKind::Sphere {
            let (center, radius) = self.sphere_block(run).one(simd, place as usize);
            interval::sphere(
                simd,
                center,
                radius,
                packet.origin,
                packet.direction,
                packet.unit,
                &span,
                front,
                back,
            )
        } else {
            let [a, b, c] = self.triangle_block(run).one(simd, place as usize, packet.axes);
            let vertices = [packet.shear(a), packet.shear(b), packet.shear(c)];
            interval::triangle(
                simd,
                vertices,
                packet.factors[2],
                [packet.unit, SHEAR_SCALE],
                &span,
                front,
                back,
            )
        }
    }

    /// The exact hit of a lane, if there is one, of a record.
    #[inline(always)]
    fn exact_of(&self, exact: &Exact<'_>, lane: usize, record: u32) -> Option<Hit> {
        let run = &self.runs()[(record >> PLACE_BITS) as usize];
        let index = run.first + (record & ((1 << PLACE_BITS) - 1));
        self.exact_alone(&exact.rays[lane], exact.spans[lane], exact.left[lane], run, index)
    }

    /// Makes what a lane has found exact.
    #[inline(always)]
    fn settle<S: Simd>(&self, exact: &Exact<'_>, found: &mut Found<S, W>, lane: usize) -> Option<Hit> {
        if found.records[lane] == NONE {
            return None;
        }
        if found.exact >> lane & 1 == 0 {
            let hit = self.exact_of(exact, lane, found.records[lane]);
            debug_assert!(hit.is_some(), "a sure hit is one");
            found.hits[lane] = hit?;
            found.exact |= 1 << lane;
        }
        Some(found.hits[lane])
    }

    /// Keeps the nearest of what the rays have found and what a leaf holds; returns how many primitives were tested, and
    /// whether anything was found.
    #[inline(always)]
    pub(crate) fn nearest_of_all<S: Simd>(
        &self,
        simd: S,
        first_run: usize,
        packet: &Packet<S>,
        exact: &Exact<'_>,
        found: &mut Found<S, W>,
        reach: f32,
    ) -> (u32, bool) {
        let (mut tests, mut is_new) = (0, false);
        let mut i = first_run;
        loop {
            let run = &self.runs()[i];
            let mut candidates = self.candidates(simd, run, packet, reach);
            while candidates != 0 {
                let place = candidates.trailing_zeros();
                candidates &= candidates - 1;
                tests += 1;
                let at = self.all_intervals(simd, run, place, packet, found.ends, exact.left);
                if !at.possible.any() {
                    continue;
                }
                is_new = true;
                let record = record_of(i, place);
                let taken = at.possible & at.sure & at.high.lt(found.lows);
                let mut unsure = (at.possible & !taken).bits();
                found.lows = at.low.select(taken, found.lows);
                found.ends = at.high.select(taken, found.ends);
                let mut bits = taken.bits();
                found.exact &= !bits;
                while bits != 0 {
                    found.records[bits.trailing_zeros() as usize] = record;
                    bits &= bits - 1;
                }
                while unsure != 0 {
                    let lane = unsure.trailing_zeros() as usize;
                    unsure &= unsure - 1;
                    self.compare(simd, exact, found, lane, record, packet);
                }
            }
            if !run.goes_on {
                return (tests, is_new);
            }
            i += 1;
        }
    }

    /// Keeps the nearer of what a lane has found and a record, by exact tests of both.
    #[inline(always)]
    fn compare<S: Simd>(
        &self,
        simd: S,
        exact: &Exact<'_>,
        found: &mut Found<S, W>,
        lane: usize,
        record: u32,
        packet: &Packet<S>,
    ) {
        let Some(hit) = self.exact_of(exact, lane, record) else { return };
        if let Some(best) = self.settle(exact, found, lane)
            && !hit.precedes(&best)
        {
            return;
        }
        found.records[lane] = record;
        found.hits[lane] = hit;
        found.exact |= 1 << lane;
        let mask = simd.mask_f32(1 << lane);
        found.lows = simd.splat_f32(packet.below(hit.t)).select(mask, found.lows);
        found.ends = simd.splat_f32(packet.above(hit.t)).select(mask, found.ends);
    }

    /// What a lane has found.
    pub(crate) fn finish<S: Simd>(
        &self,
        exact: &Exact<'_>,
        found: &mut Found<S, W>,
        lane: usize,
    ) -> Option<Hit> {
        self.settle(exact, found, lane)
    }

    /// The rays that a leaf hides the light of, of those that are `open`; and how many primitives were tested.
    #[inline(always)]
    pub(crate) fn hidden_of_all<S: Simd>(
        &self,
        simd: S,
        first_run: usize,
        packet: &Packet<S>,
        exact: &Exact<'_>,
        open: u32,
        reach: f32,
    ) -> (u32, u32) {
        let (mut tests, mut hidden) = (0, 0);
        let mut i = first_run;
        loop {
            let run = &self.runs()[i];
            let mut candidates = self.candidates(simd, run, packet, reach);
            while candidates != 0 {
                let place = candidates.trailing_zeros();
                candidates &= candidates - 1;
                tests += 1;
                let at = self.all_intervals(simd, run, place, packet, packet.end, exact.left);
                hidden |= (at.possible & at.sure).bits() & open;
                let mut unsure = at.possible.bits() & open & !hidden;
                let record = record_of(i, place);
                while unsure != 0 {
                    let lane = unsure.trailing_zeros();
                    unsure &= unsure - 1;
                    if self.exact_of(exact, lane as usize, record).is_some() {
                        hidden |= 1 << lane;
                    }
                }
                if hidden == open {
                    return (tests, hidden);
                }
            }
            if !run.goes_on {
                return (tests, hidden);
            }
            i += 1;
        }
    }

    /// The places of a run whose primitives the shaft meets.
    #[inline(always)]
    fn candidates<S: Simd>(&self, simd: S, run: &Run, packet: &Packet<S>, reach: f32) -> u32 {
        if run.kind == PrimitiveKind::Sphere {
            packet.candidates(simd, self.sphere_block(run), reach)
        } else {
            packet.candidates(simd, self.triangle_block(run), reach)
        }
    }
}
