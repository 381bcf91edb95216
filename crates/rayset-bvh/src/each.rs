//! Rays of a list, one by one: as many as there are lanes are prepared together, and decided together at the end.

use std::marker::PhantomData;
use std::ops::Range;

use rayset_geometry::{Departure, PrimitiveKind, Ray, Side, Span};
use rayset_simd::{Part, Simd};

use crate::exact::{Departing, Sure};
use crate::frame::Frame;
use crate::hierarchy::{Scratch, Wide};
use crate::packet::RayColumns;
use crate::ray::{CullRay, CullRays};
use crate::shapes::{Anything, Content, Found, Hit, Nearest, OnlySpheres, OnlyTriangles};

/// Rays that are traced one by one, and where their answers go.
///
/// Mark the methods `#[inline(always)]`: they are called in the innermost loop, once a ray.
pub trait RayList<'r, A> {
    /// Columns that hold the rays and the parts of them that count, all equally long.
    fn columns(&self) -> RayColumns<'r>;
    /// Which rays of the columns are traced; others are only read.
    #[inline(always)]
    fn range(&self) -> Range<usize> {
        0..self.columns().len()
    }
    /// The primitive that a ray of the columns leaves, and into which of its sides.
    #[inline(always)]
    fn left(&self, i: usize) -> Option<(u32, Side)> {
        self.columns().left(i)
    }
    /// What is known of a ray already: a hit, than which only nearer ones count, or that it hits something.
    #[inline(always)]
    fn known(&self, _i: usize) -> Option<A> {
        None
    }
    /// Takes the answer of the next ray, in order.
    fn answer(&mut self, answer: A);
}

/// What is asked about rays.
pub(crate) trait OfRay: Copy {
    type Answer: Copy;
    /// What a traversal finds.
    type Found: Copy;
    /// What is found where there is nothing.
    const NOTHING: Self::Found;
    fn ask<S: Simd, C: Content, const W: usize>(
        self,
        simd: S,
        wide: &Wide<W>,
        traced: &Traced,
        known: Option<Self::Answer>,
        scratch: &mut Scratch,
    ) -> Self::Found;
    /// The answers to rays, by what was found.
    fn answer<S: Simd, const W: usize>(
        self,
        simd: S,
        wide: &Wide<W>,
        departing: &Departing<'_>,
        found: &[Self::Found; W],
        answers: impl FnMut(Self::Answer),
    );
}

/// What is hit first.
#[derive(Clone, Copy, Default)]
pub(crate) struct NearestHit;
/// Whether anything is hit.
#[derive(Clone, Copy, Default)]
pub(crate) struct AnyHit;

impl OfRay for NearestHit {
    type Answer = Option<Hit>;
    type Found = Nearest;
    const NOTHING: Nearest = Nearest::NONE;

    #[inline(always)]
    fn ask<S: Simd, C: Content, const W: usize>(
        self,
        simd: S,
        wide: &Wide<W>,
        traced: &Traced,
        known: Option<Self::Answer>,
        scratch: &mut Scratch,
    ) -> Nearest {
        wide.nearest_of::<S, C>(simd, traced, known.flatten(), scratch)
    }

    #[inline(always)]
    fn answer<S: Simd, const W: usize>(
        self,
        simd: S,
        wide: &Wide<W>,
        departing: &Departing<'_>,
        found: &[Nearest; W],
        mut answers: impl FnMut(Option<Hit>),
    ) {
        let (mut sure, mut lanes, mut hits) = ([Sure::NONE; W], 0, [None; W]);
        let n = departing.left.len();
        for lane in 0..n {
            match found[lane].found {
                Found::Nothing => {}
                Found::Sure(found) => {
                    sure[lane] = found;
                    lanes |= 1 << lane;
                }
                Found::At(known) => hits[lane] = Some(known),
            }
        }
        wide.shapes.resolve_all(simd, departing, &sure, lanes, &mut hits);
        hits[..n].iter().copied().for_each(&mut answers);
    }
}

impl OfRay for AnyHit {
    type Answer = bool;
    type Found = bool;
    const NOTHING: bool = false;

    #[inline(always)]
    fn ask<S: Simd, C: Content, const W: usize>(
        self,
        simd: S,
        wide: &Wide<W>,
        traced: &Traced,
        known: Option<Self::Answer>,
        scratch: &mut Scratch,
    ) -> bool {
        known == Some(true) || wide.occluded_of::<S, C>(simd, traced, scratch)
    }

    #[inline(always)]
    fn answer<S: Simd, const W: usize>(
        self,
        _: S,
        _: &Wide<W>,
        departing: &Departing<'_>,
        found: &[bool; W],
        mut answers: impl FnMut(bool),
    ) {
        found[..departing.left.len()].iter().copied().for_each(&mut answers);
    }
}

/// A ray on its way.
pub(crate) struct Traced {
    /// In culling space, unless it cannot hit anything.
    pub(crate) cull: Option<CullRay>,
    pub(crate) ray: Ray,
    pub(crate) span: Span,
    pub(crate) departure: Option<Departure>,
}

/// A loop over rays, for one content: a function of its own, whose registers are not shared with other loops.
struct Each<'a, C, Q, R, const W: usize> {
    content: PhantomData<C>,
    wide: &'a Wide<W>,
    frame: &'a Frame,
    question: Q,
    rays: &'a mut R,
    scratch: &'a mut Scratch,
}

impl<'r, S: Simd, C: Content, Q: OfRay, R: RayList<'r, Q::Answer>, const W: usize> Part<S>
    for Each<'_, C, Q, R, W>
{
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { wide, frame, question, rays, scratch, .. } = self;
        let columns = rays.columns();
        let columns = columns.cut(0..columns.len());
        let Range { start: mut first, end } = rays.range();
        assert!(end <= columns.len(), "there are these rays");
        let mut prepared = CullRays::<W>::NONE;
        let mut left = [None; W];
        let mut found = [Q::NOTHING; W];
        while first < end {
            let len = (end - first).min(W);
            prepared.prepare(simd, frame, &columns, (first, len), wide.is_flat::<C>());
            for lane in 0..len {
                let i = first + lane;
                let (ray, span) = columns.ray(i);
                left[lane] = rays.left(i);
                let departure = wide.shapes.departure(left[lane]);
                let traced = Traced { cull: prepared.ray(lane), ray, span, departure };
                found[lane] = question.ask::<S, C, W>(simd, wide, &traced, rays.known(i), scratch);
            }
            let departing = Departing { rays: columns, first, left: &left[..len] };
            question.answer(simd, wide, &departing, &found, |answer| rays.answer(answer));
            first += len;
        }
    }
}

impl<const W: usize> Wide<W> {
    /// Answers rays one by one.
    #[inline(always)]
    pub(crate) fn each<'r, S: Simd, Q: OfRay>(
        &self,
        simd: S,
        frame: &Frame,
        question: Q,
        rays: &mut impl RayList<'r, Q::Answer>,
        scratch: &mut Scratch,
    ) {
        if self.shapes.is_only(PrimitiveKind::Sphere) {
            let content = PhantomData::<OnlySpheres>;
            simd.outline(Each { content, wide: self, frame, question, rays, scratch });
        } else if self.shapes.is_only(PrimitiveKind::Triangle) {
            let content = PhantomData::<OnlyTriangles>;
            simd.outline(Each { content, wide: self, frame, question, rays, scratch });
        } else {
            let content = PhantomData::<Anything>;
            simd.outline(Each { content, wide: self, frame, question, rays, scratch });
        }
    }
}
