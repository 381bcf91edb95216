//! Rays of a list, one by one: as many as there are lanes are prepared together, and decided together at the end.

use std::marker::PhantomData;
use std::ops::Range;

use rayset_geometry::{Departure, PrimitiveKind};
use rayset_simd::{Part, Simd};

use crate::blockers::{Blocked, Blockers};
use crate::columns::{HitOrNone, RayColumns, RayOf};
use crate::entrance::{Entered, Entrance};
use crate::exact::{Departing, Sure};
use crate::few::{EachOfFew, OfFew};
use crate::frame::Frame;
use crate::hierarchy::{Scratch, Wide};

use crate::ray::CullRays;
use crate::shapes::{Anything, Content, Found, Nearest, OnlySpheres, OnlyTriangles, Traced};
use crate::traverse::Begin;

/// What is asked about rays.
pub(crate) trait OfRay: Copy {
    type Answer: Copy;
    /// What a traversal finds.
    type Found: Copy;
    /// Whether any hit is an answer.
    const ANY: bool;
    /// What is found where there is nothing.
    const NOTHING: Self::Found;
    /// What is found where a primitive is known to block the ray, if that is all that is asked.
    const BLOCKED: Option<Self::Found>;
    /// What is known of a ray at first.
    const UNKNOWN: Self::Answer;
    /// What is known of a ray by one hit.
    fn by_hit(hit: HitOrNone) -> Self::Answer;
    /// The primitive that is known to be hit.
    fn primitive(known: Self::Answer) -> Option<u32>;
    /// Whether what is known leaves anything to ask.
    fn is_open(known: Self::Answer) -> bool;
    /// What is found where nothing else is met.
    fn keep(known: Self::Answer) -> Self::Found;
    /// Where the span of a prepared ray ends, or more, by what is known.
    fn end<const W: usize>(rays: &CullRays<W>, lane: usize, known: Self::Answer) -> f32;
    fn ask<S: Simd, C: Content, const W: usize>(
        self,
        simd: S,
        wide: &Wide<W>,
        begin: &impl Begin<W>,
        traced: &Traced<'_, W>,
        known: Self::Answer,
        scratch: &mut Scratch,
    ) -> Self::Found;
    /// The answers to rays, by what was found.
    fn answer<S: Simd, const W: usize>(
        self,
        simd: S,
        wide: &Wide<W>,
        departing: &Departing<'_>,
        found: &[Self::Found; W],
        answers: &mut [Self::Answer],
    );
}

/// What is hit first.
#[derive(Clone, Copy, Default)]
pub(crate) struct NearestHit;
/// Whether anything is hit; what is may be asked about other rays too, if they share it.
#[derive(Clone, Copy, Default)]
pub(crate) struct AnyHit<const SHARED: bool>;

impl OfRay for NearestHit {
    type Answer = HitOrNone;
    type Found = Nearest;
    const ANY: bool = false;
    const NOTHING: Nearest = Nearest::NONE;
    const BLOCKED: Option<Nearest> = None;
    const UNKNOWN: HitOrNone = HitOrNone::NONE;

    #[inline(always)]
    fn by_hit(hit: HitOrNone) -> HitOrNone {
        hit
    }

    #[inline(always)]
    fn primitive(known: HitOrNone) -> Option<u32> {
        known.get().map(|hit| hit.primitive)
    }

    #[inline(always)]
    fn is_open(_: HitOrNone) -> bool {
        true
    }

    #[inline(always)]
    fn keep(known: HitOrNone) -> Nearest {
        Nearest::known(known.get())
    }

    #[inline(always)]
    fn end<const W: usize>(rays: &CullRays<W>, lane: usize, known: HitOrNone) -> f32 {
        known.get().map_or(rays.ends()[lane], |hit| rays.end(lane, hit.t))
    }

    #[inline(always)]
    fn ask<S: Simd, C: Content, const W: usize>(
        self,
        simd: S,
        wide: &Wide<W>,
        begin: &impl Begin<W>,
        traced: &Traced<'_, W>,
        known: HitOrNone,
        scratch: &mut Scratch,
    ) -> Nearest {
        wide.nearest_of::<S, C>(simd, begin, traced, known.get(), scratch)
    }

    #[inline(always)]
    fn answer<S: Simd, const W: usize>(
        self,
        simd: S,
        wide: &Wide<W>,
        departing: &Departing<'_>,
        found: &[Nearest; W],
        answers: &mut [HitOrNone],
    ) {
        let (mut sure, mut lanes, mut hits) = ([Sure::NONE; W], 0, [HitOrNone::NONE; W]);
        let n = answers.len();
        for lane in 0..n {
            match found[lane].found {
                Found::Nothing => {}
                Found::Sure(found) => {
                    sure[lane] = found;
                    lanes |= 1 << lane;
                }
                Found::At(known) => hits[lane] = known.into(),
            }
        }
        wide.shapes.resolve_all(simd, departing, &sure, lanes, &mut hits);
        answers.copy_from_slice(&hits[..n]);
    }
}

impl<const SHARED: bool> OfRay for AnyHit<SHARED> {
    type Answer = bool;
    type Found = bool;
    const ANY: bool = true;
    const NOTHING: bool = false;
    const BLOCKED: Option<bool> = if SHARED { Some(true) } else { None };
    const UNKNOWN: bool = false;

    #[inline(always)]
    fn by_hit(_: HitOrNone) -> bool {
        true
    }

    #[inline(always)]
    fn primitive(_: bool) -> Option<u32> {
        None
    }

    #[inline(always)]
    fn is_open(known: bool) -> bool {
        !known
    }

    #[inline(always)]
    fn keep(known: bool) -> bool {
        known
    }

    #[inline(always)]
    fn end<const W: usize>(rays: &CullRays<W>, lane: usize, _: bool) -> f32 {
        rays.ends()[lane]
    }

    #[inline(always)]
    fn ask<S: Simd, C: Content, const W: usize>(
        self,
        simd: S,
        wide: &Wide<W>,
        begin: &impl Begin<W>,
        traced: &Traced<'_, W>,
        known: bool,
        scratch: &mut Scratch,
    ) -> bool {
        known || wide.occluded_of::<S, C, SHARED>(simd, begin, traced, scratch)
    }

    #[inline(always)]
    fn answer<S: Simd, const W: usize>(
        self,
        _: S,
        _: &Wide<W>,
        _: &Departing<'_>,
        found: &[bool; W],
        answers: &mut [bool],
    ) {
        answers.copy_from_slice(&found[..answers.len()]);
    }
}

/// Rays of a list that are traced one by one.
pub(crate) struct Rays<'a, A, const KNOWN: bool> {
    pub(crate) columns: &'a RayColumns<'a>,
    /// Which of them; others are only read.
    pub(crate) range: Range<usize>,
    /// Where the answer of each ray of the columns goes; what is known of it already stands there, if anything is known.
    pub(crate) places: &'a mut [A],
    /// Blockers that they share, if they do, where any hit is an answer.
    pub(crate) shared: Option<&'a mut Blockers>,
}

/// A loop over rays, for one content: a function of its own, whose registers are not shared with other loops.
struct Each<'a, C, Q: OfRay, const KNOWN: bool, const W: usize> {
    content: PhantomData<C>,
    wide: &'a Wide<W>,
    frame: &'a Frame,
    question: Q,
    rays: Rays<'a, Q::Answer, KNOWN>,
    scratch: &'a mut Scratch,
}

impl<S: Simd, C: Content, Q: OfRay, const KNOWN: bool, const W: usize> Part<S> for Each<'_, C, Q, KNOWN, W> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { wide, frame, question, rays, scratch, .. } = self;
        let Rays { columns, range, places, mut shared } = rays;
        let columns = columns.cut(0..columns.len());
        let Range { start: mut first, end } = range;
        assert!(end <= columns.len() && end <= places.len(), "there are these rays");
        let (mut prepared, mut entrance) = (CullRays::<W>::NONE, Entrance::<W>::NONE);
        let (mut found, mut known) = ([Q::NOTHING; W], [Q::UNKNOWN; W]);
        while first < end {
            let len = (end - first).min(W);
            prepared.prepare(simd, frame, &columns, (first, len), wide.targets::<C>());
            let mut open = prepared.found(len);
            let mut ends = *prepared.ends();
            let left = columns.left_by(first..first + len);
            let departing = Departing { rays: columns, first, left };
            if KNOWN {
                known[..len].copy_from_slice(&places[first..first + len]);
            }
            let mut met = 0;
            if C::SPHERES && !KNOWN && wide.shapes.can_meet_own() {
                let mut hits = [HitOrNone::NONE; W];
                met = wide.shapes.meet_own(simd, &departing, open, &mut hits, &mut scratch.primitive_tests);
                let mut lanes = met;
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize % W;
                    lanes &= lanes - 1;
                    known[lane] = Q::by_hit(hits[lane]);
                }
            }
            if KNOWN || met != 0 {
                for (lane, &known) in known[..len].iter().enumerate() {
                    open &= !(u32::from(!Q::is_open(known)) << lane);
                    ends[lane] = Q::end(&prepared, lane, known);
                }
            }
            let mut blocked = 0;
            if Q::BLOCKED.is_some()
                && let Some(shared) = &mut shared
            {
                let tests = &mut scratch.primitive_tests;
                blocked = shared.ask(simd, &wide.shapes, &prepared, left, open, tests);
                open &= !blocked;
            }
            // Of eight rays too few go on to the same nodes.
            let second = Q::BLOCKED.is_some() && W > 8;
            scratch.steps.nodes += if second && C::FACES {
                entrance.begin::<S, true, true>(simd, &wide.tree, &prepared, &ends, open)
            } else if second {
                entrance.begin::<S, true, false>(simd, &wide.tree, &prepared, &ends, open)
            } else {
                entrance.begin::<S, false, false>(simd, &wide.tree, &prepared, &ends, open)
            };
            for (lane, place) in found[..len].iter_mut().enumerate() {
                let i = first + lane;
                let known = if KNOWN || C::SPHERES { known[lane] } else { Q::UNKNOWN };
                let begin = Entered { entrance: &entrance, ray: lane };
                *place = match prepared.ray(lane) {
                    Some(cull) if open >> lane & 1 == 1 && entrance.of(lane) != 0 => {
                        let mut departure = wide.shapes.departure(columns.left(i));
                        let own = columns.left.get(i).and_then(|left| left.inwards());
                        if C::SPHERES && own.is_some() && Q::primitive(known) == own {
                            // It is known where its own sphere is met, which is not asked again.
                            departure = departure.map(Departure::met_again);
                        }
                        let traced = Traced { cull, ray: RayOf { columns: &columns, i }, departure };
                        let found = question.ask::<S, C, W>(simd, wide, &begin, &traced, known, scratch);
                        if Q::BLOCKED.is_some()
                            && let Some(shared) = &mut shared
                            && let Some(record) = scratch.blocker.take()
                        {
                            let asked = Blocked { shapes: &wide.shapes, rays: &prepared, left, record };
                            let others = open & !(u32::MAX >> (31 - lane));
                            let more = shared.offer(simd, asked, others, &mut scratch.primitive_tests);
                            blocked |= more;
                            open &= !more;
                        }
                        found
                    }
                    _ => Q::keep(known),
                };
            }
            if let Some(answer) = Q::BLOCKED {
                while blocked != 0 {
                    found[blocked.trailing_zeros() as usize % W] = answer;
                    blocked &= blocked - 1;
                }
            }
            question.answer(simd, wide, &departing, &found, &mut places[first..first + len]);
            while met != 0 {
                known[met.trailing_zeros() as usize % W] = Q::UNKNOWN;
                met &= met - 1;
            }
            first += len;
        }
    }
}

impl<const W: usize> Wide<W> {
    /// Answers rays one by one.
    #[inline(always)]
    pub(crate) fn each<S: Simd, Q: OfFew, const KNOWN: bool>(
        &self,
        simd: S,
        frame: &Frame,
        question: Q,
        rays: Rays<'_, Q::Answer, KNOWN>,
        scratch: &mut Scratch,
    ) {
        if self.few.replace_tree() {
            let Rays { columns, range, places, .. } = rays;
            let columns = columns.cut(0..columns.len());
            let n = range.len() as u64;
            scratch.steps.leaves += n;
            scratch.primitive_tests += n * self.few.len() as u64;
            simd.outline(EachOfFew { few: &self.few, question, columns, range, places });
        } else if self.shapes.is_only(PrimitiveKind::Sphere) {
            let content = PhantomData::<OnlySpheres>;
            simd.outline(Each { content, wide: self, frame, question, rays, scratch });
        } else if self.shapes.is_only(PrimitiveKind::Triangle) && self.has_faces {
            let content = PhantomData::<OnlyTriangles<true>>;
            simd.outline(Each { content, wide: self, frame, question, rays, scratch });
        } else if self.shapes.is_only(PrimitiveKind::Triangle) {
            let content = PhantomData::<OnlyTriangles<false>>;
            simd.outline(Each { content, wide: self, frame, question, rays, scratch });
        } else {
            let content = PhantomData::<Anything>;
            simd.outline(Each { content, wide: self, frame, question, rays, scratch });
        }
    }
}
