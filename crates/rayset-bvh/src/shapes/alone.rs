//! A ray by itself against the primitives of a leaf: as many at once as there are lanes.

use rayset_geometry::{ColumnRun, Departure, PrimitiveKind, Probe, Side, Sides};
use rayset_simd::{LaneMask, Lanes, Scalar, Simd};

use super::{Hit, PolygonBlock, Run, Shapes};
use crate::cells::PolygonCells;
use crate::columns::RayOf;
use crate::exact::{Sure, record_of};
use crate::fans::{Candidate, FanBlock};
use crate::interval::{Intervals, SpanLanes};
use crate::ray::CullRay;

/// What kinds of primitives there are, known when a traversal is compiled: what is not there is not prepared for.
///
/// A type parameter: a loop over leaves of any kind would have the constants of all tests computed in front of it, for
/// every ray.
pub(crate) trait Content {
    const SPHERES: bool;
    const TRIANGLES: bool;
    /// Polygons and cones.
    const OTHERS: bool;
    /// Whether rays look for the faces that they leave behind.
    const FACES: bool;
    /// Whether rays look first at what lies farthest along them where any hit will do, and not where slots end.
    const FARTHEST_FIRST: bool;
    /// Whether lists of rays go node by node, which lets children be visited by the way that rays run.
    const STREAMS: bool;
}

/// Spheres alone.
pub(crate) struct OnlySpheres;
/// Triangles alone: with `FACES`, many in planes across an axis.
pub(crate) struct OnlyTriangles<const FACES: bool>;
/// Anything.
pub(crate) struct Anything;

impl Content for OnlySpheres {
    const SPHERES: bool = true;
    const TRIANGLES: bool = false;
    const OTHERS: bool = false;
    const FACES: bool = false;
    const FARTHEST_FIRST: bool = false;
    const STREAMS: bool = false;
}

impl<const FACES: bool> Content for OnlyTriangles<FACES> {
    const SPHERES: bool = false;
    const TRIANGLES: bool = true;
    const OTHERS: bool = false;
    const FACES: bool = FACES;
    const FARTHEST_FIRST: bool = true;
    const STREAMS: bool = true;
}

impl Content for Anything {
    const SPHERES: bool = true;
    const TRIANGLES: bool = true;
    const OTHERS: bool = true;
    const FACES: bool = false;
    const FARTHEST_FIRST: bool = false;
    const STREAMS: bool = false;
}

/// A ray on its way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Traced<'a, const W: usize> {
    pub(crate) cull: CullRay<'a, W>,
    /// What the exact tests are made of, where a leaf asks for them.
    pub(crate) ray: RayOf<'a>,
    pub(crate) departure: Option<Departure>,
}

impl<const W: usize> Traced<'_, W> {
    /// What the tests of columns are made of; `is_flat` says whether there may be polygons.
    #[inline(always)]
    fn probe<S: Simd>(&self, simd: S, is_flat: bool) -> Probe<S> {
        let (ray, span) = self.ray.read();
        Probe::new(simd, &ray, span, is_flat)
    }
}

/// The nearest hit so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nearest {
    /// There is none before this.
    pub(crate) low: f32,
    pub(crate) found: Found,
}

/// What is hit: surely, but not known where, or exactly.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Found {
    Nothing,
    Sure(Sure),
    At(Hit),
}

impl Nearest {
    pub(crate) const NONE: Self = Self { low: f32::INFINITY, found: Found::Nothing };

    /// What is known of a ray that meets nothing else.
    #[inline(always)]
    pub(crate) fn known(hit: Option<Hit>) -> Self {
        hit.map_or(Self::NONE, |hit| Self { found: Found::At(hit), ..Self::NONE })
    }

    /// An exact hit.
    #[inline(always)]
    pub(crate) fn at<const W: usize>(cull: CullRay<'_, W>, hit: Hit) -> Self {
        Self { low: cull.below(hit.t), found: Found::At(hit) }
    }
}

impl<const W: usize> Shapes<W> {
    /// The lanes of a run whose front, and whose back, may be hit.
    #[inline(always)]
    fn allowed(run: &Run, departure: Option<Departure>) -> (u32, u32) {
        let all = u32::MAX >> (32 - W);
        let mut front = if run.sides == Sides::Back { 0 } else { all };
        let mut back = if run.sides == Sides::Front { 0 } else { all };
        if let Some(departure) = departure
            && departure.kind == run.kind
            && departure.index.wrapping_sub(run.first) < u32::from(run.len)
        {
            let left = 1 << (departure.index - run.first);
            front &= !left;
            if departure.side == Side::Front || run.kind == PrimitiveKind::Triangle {
                back &= !left;
            }
        }
        (front, back)
    }

    /// The exact distance to a primitive.
    #[inline(always)]
    fn exact<S: Simd, C: Content>(
        &self,
        simd: S,
        ray: &Traced<'_, W>,
        kind: PrimitiveKind,
        index: u32,
        sides: Sides,
    ) -> Option<f64> {
        let departure = match ray.departure {
            Some(departure) if departure.kind == kind && departure.index == index => Some(departure.side),
            _ => None,
        };
        if C::OTHERS && matches!(kind, PrimitiveKind::Cone | PrimitiveKind::Polygon) {
            // A function of its own: loops that seldom come here keep their registers.
            let (exact, span) = ray.ray.read();
            let sure = Sure { kind, index, sides };
            return self.exact_alone(simd, (&exact, span), ray.departure, &sure).map(|hit| hit.t);
        }
        let is_sphere = !C::TRIANGLES || (C::SPHERES && kind == PrimitiveKind::Sphere);
        if is_sphere {
            let (ray, span) = ray.ray.read();
            self.spheres[index as usize].intersect(&ray, span, sides, departure)
        } else {
            self.triangles[index as usize].intersect(&ray.probe(Scalar, true), sides, departure)
        }
    }

    #[inline(always)]
    fn intervals<S: Simd, C: Content>(
        &self,
        simd: S,
        i: usize,
        ray: &Traced<'_, W>,
        end: f32,
    ) -> Intervals<S> {
        let run = &self.runs[i];
        let (front, back) = Self::allowed(run, ray.departure);
        // Where there is nothing else, every run has its block, in the same order: no number to wait for.
        let block = if C::SPHERES && C::TRIANGLES { run.block as usize } else { i };
        if !C::TRIANGLES || (C::SPHERES && run.kind == PrimitiveKind::Sphere) {
            self.sphere_blocks[block].intervals(simd, ray.cull, end, front, back)
        } else {
            self.triangle_blocks[block].intervals(simd, ray.cull, end, front, back)
        }
    }

    /// The hit that was known by an interval only.
    #[inline(always)]
    pub(crate) fn resolve<S: Simd, C: Content>(
        &self,
        simd: S,
        ray: &Traced<'_, W>,
        nearest: Nearest,
    ) -> Option<Hit> {
        match nearest.found {
            Found::Nothing => None,
            Found::At(hit) => Some(hit),
            Found::Sure(Sure { kind, index, sides }) => {
                let t = self.exact::<S, C>(simd, ray, kind, index, sides);
                debug_assert!(t.is_some(), "a sure hit is one");
                let primitive = self.numbers[kind as usize][index as usize];
                t.map(|t| Hit { t, primitive })
            }
        }
    }

    /// Keeps the nearest of a hit and those in a leaf; `end` is where the span ends for what is still to be found.
    #[inline(always)]
    pub(crate) fn nearest<S: Simd, C: Content>(
        &self,
        simd: S,
        first_run: usize,
        ray: &Traced<'_, W>,
        nearest: &mut Nearest,
        end: &mut f32,
        tests: &mut u64,
    ) {
        let mut i = first_run;
        loop {
            let run = &self.runs[i];
            *tests += u64::from(run.len);
            match run.kind {
                _ if !C::OTHERS => self.nearest_in_block::<S, C>(simd, i, ray, nearest, end),
                PrimitiveKind::Sphere | PrimitiveKind::Triangle => {
                    self.nearest_in_block::<S, C>(simd, i, ray, nearest, end);
                }
                PrimitiveKind::Polygon => match self.polygon_block(run) {
                    Some(PolygonBlock::Fans(fans)) => {
                        self.nearest_in_fans::<S, C>(simd, (run, fans), ray, nearest, end);
                    }
                    Some(PolygonBlock::Cells(cells)) => {
                        let found = Self::in_cells(simd, (run, cells), ray, *end);
                        self.nearest_of::<S, C>(simd, run, &found, ray, nearest, end);
                    }
                    None => self.nearest_in_columns::<S, C>(simd, &run.columns(), ray, nearest, end),
                },
                PrimitiveKind::Cone => {
                    let found = self.in_axes(simd, run, ray, *end);
                    self.nearest_of::<S, C>(simd, run, &found, ray, nearest, end);
                }
            }
            if !run.goes_on {
                return;
            }
            i += 1;
        }
    }

    #[inline(always)]
    fn nearest_in_block<S: Simd, C: Content>(
        &self,
        simd: S,
        i: usize,
        ray: &Traced<'_, W>,
        nearest: &mut Nearest,
        end: &mut f32,
    ) {
        let run = &self.runs[i];
        let found = self.intervals::<S, C>(simd, i, ray, *end);
        let mut bits = found.possible.bits();
        if bits == 0 {
            return;
        }
        let sure = found.sure.bits();
        let (mut lows, mut highs) = ([0.0; W], [0.0; W]);
        found.low.store(&mut lows);
        found.high.store(&mut highs);
        while bits != 0 {
            let lane = bits.trailing_zeros();
            bits &= bits - 1;
            let (low, high) = (lows[lane as usize], highs[lane as usize]);
            if low > *end {
                continue;
            }
            let index = run.first + lane;
            if sure >> lane & 1 == 1 && high < nearest.low {
                if !C::SPHERES {
                    // It will be asked where, exactly, when all rays of the lanes have come to an end.
                    simd.fetch(&self.triangles[index as usize]);
                }
                let sure = Sure { kind: run.kind, index, sides: run.sides };
                *nearest = Nearest { low, found: Found::Sure(sure) };
                *end = high;
            } else if let Some(t) = self.exact::<S, C>(simd, ray, run.kind, index, run.sides) {
                let primitive = self.numbers[run.kind as usize][index as usize];
                self.offer::<S, C>(simd, ray, nearest, end, Hit { t, primitive });
            }
        }
    }

    /// Keeps the nearer of an exact hit and the nearest so far.
    #[inline(always)]
    fn offer<S: Simd, C: Content>(
        &self,
        simd: S,
        ray: &Traced<'_, W>,
        nearest: &mut Nearest,
        end: &mut f32,
        hit: Hit,
    ) {
        let hit = match self.resolve::<S, C>(simd, ray, *nearest) {
            Some(best) if !hit.precedes(&best) => best,
            _ => hit,
        };
        *nearest = Nearest::at(ray.cull, hit);
        *end = ray.cull.end(hit.t);
    }

    /// Whether anything in a leaf is hit.
    #[inline(always)]
    pub(crate) fn any<S: Simd, C: Content>(
        &self,
        simd: S,
        first_run: usize,
        ray: &Traced<'_, W>,
        end: f32,
        tests: &mut u64,
        blocker: &mut Option<u32>,
    ) -> bool {
        let mut i = first_run;
        loop {
            let run = &self.runs[i];
            *tests += u64::from(run.len);
            let is_hit = match run.kind {
                _ if !C::OTHERS => self.any_in_block::<S, C>(simd, i, ray, end, blocker),
                PrimitiveKind::Sphere | PrimitiveKind::Triangle => {
                    self.any_in_block::<S, C>(simd, i, ray, end, blocker)
                }
                PrimitiveKind::Polygon => match self.polygon_block(run) {
                    Some(PolygonBlock::Fans(fans)) => self.any_in_fans(simd, (i, fans), ray, end, blocker),
                    Some(PolygonBlock::Cells(cells)) => {
                        self.any_of(simd, i, &Self::in_cells(simd, (run, cells), ray, end), ray, blocker)
                    }
                    None => self.any_in_columns(simd, &run.columns(), ray),
                },
                PrimitiveKind::Cone => self.any_of(simd, i, &self.in_axes(simd, run, ray, end), ray, blocker),
            };
            if is_hit || !run.goes_on {
                return is_hit;
            }
            i += 1;
        }
    }

    #[inline(always)]
    fn any_in_block<S: Simd, C: Content>(
        &self,
        simd: S,
        i: usize,
        ray: &Traced<'_, W>,
        end: f32,
        blocker: &mut Option<u32>,
    ) -> bool {
        let run = &self.runs[i];
        let found = self.intervals::<S, C>(simd, i, ray, end);
        if found.sure.any() {
            *blocker = Some(record_of(i, found.sure.bits().trailing_zeros()));
            return true;
        }
        let mut bits = found.possible.bits();
        while bits != 0 {
            let lane = bits.trailing_zeros();
            bits &= bits - 1;
            if self.exact::<S, C>(simd, ray, run.kind, run.first + lane, run.sides).is_some() {
                *blocker = Some(record_of(i, lane));
                return true;
            }
        }
        false
    }

    /// Keeps the nearest of a hit and those in a run of the columns, by their `f64` tests.
    #[inline(always)]
    fn nearest_in_columns<S: Simd, C: Content>(
        &self,
        simd: S,
        run: &ColumnRun,
        ray: &Traced<'_, W>,
        nearest: &mut Nearest,
        end: &mut f32,
    ) {
        let is_flat = run.kind == PrimitiveKind::Polygon;
        if let Some(hit) = self.columns.nearest(&ray.probe(simd, is_flat), run, ray.departure) {
            let primitive = self.numbers[run.kind as usize][hit.index as usize];
            self.offer::<S, C>(simd, ray, nearest, end, Hit { t: hit.t, primitive });
        }
    }

    /// Whether anything in a run of the columns is hit, by its `f64` tests.
    #[inline(always)]
    fn any_in_columns<S: Simd>(&self, simd: S, run: &ColumnRun, ray: &Traced<'_, W>) -> bool {
        let is_flat = run.kind == PrimitiveKind::Polygon;
        self.columns.any(&ray.probe(simd, is_flat), run, ray.departure).is_some()
    }

    /// Where a ray hits the cones of a run.
    #[inline(always)]
    fn in_axes<S: Simd>(&self, simd: S, run: &Run, ray: &Traced<'_, W>, end: f32) -> Intervals<S> {
        self.axis_block(run).intervals(simd, ray.cull, end, Self::allowed(run, ray.departure))
    }

    /// Where a ray hits the one polygon of a run.
    #[inline(always)]
    fn in_cells<S: Simd>(
        simd: S,
        (run, cells): (&Run, &PolygonCells),
        ray: &Traced<'_, W>,
        end: f32,
    ) -> Intervals<S> {
        if run.is_left_by(ray.departure) {
            return Intervals::none(simd);
        }
        let cull = ray.cull;
        let rays = cull.sheared(simd);
        // The one lane of all that are the same.
        let (front, back) = (run.sides != Sides::Back, run.sides != Sides::Front);
        let sides = (simd.mask_f32(front.into()), simd.mask_f32(back.into()));
        cells.intervals(simd, &rays, &SpanLanes::of(simd, cull, end), sides)
    }

    /// Keeps the nearest of a hit and those of a run that are found: surely, or by their `f64` tests.
    #[inline(always)]
    fn nearest_of<S: Simd, C: Content>(
        &self,
        simd: S,
        run: &Run,
        found: &Intervals<S>,
        ray: &Traced<'_, W>,
        nearest: &mut Nearest,
        end: &mut f32,
    ) {
        if !found.possible.any() {
            return;
        }
        let (mut lows, mut highs) = ([0.0; W], [0.0; W]);
        found.low.store(&mut lows);
        found.high.store(&mut highs);
        let (mut sure, mut unsure) = (found.sure.bits(), found.possible.bits() & !found.sure.bits());
        while sure != 0 {
            let lane = sure.trailing_zeros();
            sure &= sure - 1;
            let (low, high) = (lows[lane as usize], highs[lane as usize]);
            if low > *end {
                continue;
            }
            if high < nearest.low {
                let sure = Sure { kind: run.kind, index: run.first + lane, sides: run.sides };
                *nearest = Nearest { low, found: Found::Sure(sure) };
                *end = high;
            } else {
                unsure |= 1 << lane;
            }
        }
        unsure &= found.low.le(simd.splat_f32(*end)).bits();
        if unsure != 0 {
            self.nearest_in_columns::<S, C>(simd, &Self::part(run, unsure), ray, nearest, end);
        }
    }

    /// Whether anything of a run is hit that is found.
    #[inline(always)]
    fn any_of<S: Simd>(
        &self,
        simd: S,
        i: usize,
        found: &Intervals<S>,
        ray: &Traced<'_, W>,
        blocker: &mut Option<u32>,
    ) -> bool {
        let run = &self.runs[i];
        if found.sure.any() {
            *blocker = Some(record_of(i, found.sure.bits().trailing_zeros()));
            return true;
        }
        let candidates = found.possible.bits();
        candidates != 0 && self.any_in_columns(simd, &Self::part(run, candidates), ray)
    }

    /// The part of a run in which some lanes lie.
    #[inline(always)]
    fn part(run: &Run, lanes: u32) -> ColumnRun {
        let (first, last) = (lanes.trailing_zeros(), u32::BITS - 1 - lanes.leading_zeros());
        ColumnRun { kind: run.kind, sides: run.sides, range: run.first + first..run.first + last + 1 }
    }

    #[inline(always)]
    fn nearest_in_fans<S: Simd, C: Content>(
        &self,
        simd: S,
        (run, block): (&Run, &FanBlock<W>),
        ray: &Traced<'_, W>,
        nearest: &mut Nearest,
        end: &mut f32,
    ) {
        if run.is_left_by(ray.departure) {
            return;
        }
        let Some(mut fans) = block.test(simd, ray.cull) else { return };
        while let Some(polygon) = block.next(&mut fans) {
            let one = run.column(polygon.place);
            if polygon.low > *end || Self::is_passed(&polygon, &one, ray) {
                continue;
            }
            if polygon.high < nearest.low && Self::is_sure(&polygon, run.sides, ray.cull) {
                let sure = Sure { kind: run.kind, index: one.range.start, sides: run.sides };
                *nearest = Nearest { low: polygon.low, found: Found::Sure(sure) };
                *end = polygon.high;
            } else {
                self.nearest_in_columns::<S, C>(simd, &one, ray, nearest, end);
            }
        }
    }

    #[inline(always)]
    fn any_in_fans<S: Simd>(
        &self,
        simd: S,
        (i, block): (usize, &FanBlock<W>),
        ray: &Traced<'_, W>,
        end: f32,
        blocker: &mut Option<u32>,
    ) -> bool {
        let run = &self.runs[i];
        if run.is_left_by(ray.departure) {
            return false;
        }
        let Some(mut fans) = block.test(simd, ray.cull) else { return false };
        while let Some(polygon) = block.next(&mut fans) {
            let one = run.column(polygon.place);
            if polygon.low > end || Self::is_passed(&polygon, &one, ray) {
                continue;
            }
            if Self::is_sure(&polygon, run.sides, ray.cull) {
                *blocker = Some(record_of(i, polygon.place));
                return true;
            }
            if self.any_in_columns(simd, &one, ray) {
                return true;
            }
        }
        false
    }

    /// Whether a ray has a polygon behind it, or leaves it: a plane is never met again.
    #[inline(always)]
    fn is_passed(polygon: &Candidate, one: &ColumnRun, ray: &Traced<'_, W>) -> bool {
        polygon.high < ray.cull.start()
            || ray.departure.is_some_and(|d| d.kind == one.kind && d.index == one.range.start)
    }

    /// Whether a ray that does not leave a polygon surely hits it.
    #[inline(always)]
    fn is_sure(polygon: &Candidate, sides: Sides, cull: CullRay<'_, W>) -> bool {
        let is_met = (polygon.is_front && sides != Sides::Back) || (polygon.is_back && sides != Sides::Front);
        is_met && polygon.low > cull.start_above() && polygon.high < cull.end_below()
    }
}
