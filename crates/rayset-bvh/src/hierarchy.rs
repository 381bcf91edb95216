//! The hierarchy and what it answers.

use std::hint::black_box;
use std::marker::PhantomData;

use rayon::prelude::*;
use rayset_geometry::{
    BoundingBox, Departure, Primitive, PrimitiveColumns, PrimitiveKind, Ray, Side, Sides, Span,
};
use rayset_simd::{Backend, ByLanes, Kernel, Simd, large_page_vec};

use crate::build::{Reference, build};
use crate::columns::RayOf;
use crate::duplicates::superfluous;
use crate::each::{AnyHit, NearestHit, Rays};
use crate::fans::fan_len;
use crate::few::{BLOCK, Few, OfFew};
use crate::frame::Frame;
use crate::node::Tree;
use crate::ray::{Copies, CullRays, Targets};
use crate::shapes::{Anything, Content, Found, Hit, Nearest, OnlySpheres, OnlyTriangles, Shapes, Traced};
use crate::stream::{OfStream, OfStreams, Room};
use crate::traverse::{AtRoot, Begin, Stack, Steps, Visitor, is_stopped, traverse};
use crate::{HitOrNone, Query, RayColumns};

/// A bounding volume hierarchy over primitives of any shape.
#[derive(Clone, Debug)]
pub struct Hierarchy {
    backend: Backend,
    pub(crate) frame: Frame,
    pub(crate) width: Width,
}

/// As wide as the lanes that traverse it.
#[derive(Clone, Debug)]
pub(crate) enum Width {
    Eight(Wide<8>),
    Sixteen(Wide<16>),
}

/// What a caller keeps between rays, so that tracing one allocates nothing.
#[derive(Clone, Debug)]
pub struct Scratch {
    pub(crate) stack: Stack,
    /// What was done with it.
    pub steps: Steps,
    /// How many primitives were tested.
    pub primitive_tests: u64,
    /// The record of what was found to block a ray, until it is taken.
    pub(crate) blocker: Option<u32>,
    /// Room for rays that go together.
    pub(crate) room: Room,
}

impl Hierarchy {
    /// Builds a hierarchy over primitives, numbered in their order, for the lanes of [`Backend::active`].
    ///
    /// # Panics
    ///
    /// If there are 2^30 primitives or more, or one reaches farther than `f64`.
    #[must_use]
    pub fn new<'p>(primitives: impl IntoIterator<Item = (&'p Primitive, Sides)>) -> Self {
        let mut columns = PrimitiveColumns::default();
        let mut items = Vec::new();
        for (primitive, sides) in primitives {
            let run = columns.push(primitive, sides);
            items.push((run.kind, run.range.start, sides));
        }
        Self::over(&columns, &items, Backend::active())
    }

    /// Builds a hierarchy over primitives that stand in columns: their kinds, indices in the columns of the kind, and
    /// the sides they can be hit from.
    ///
    /// # Panics
    ///
    /// If an index is not in the columns, there are 2^30 primitives or more, or one reaches farther than `f64`.
    #[must_use]
    pub fn over(columns: &PrimitiveColumns, items: &[(PrimitiveKind, u32, Sides)], backend: Backend) -> Self {
        assert!(items.len() < 1 << 30, "fewer than 2^30 primitives");
        let bounds = items
            .par_iter()
            .with_min_len(1024)
            .map(|&(kind, index, _)| columns.bounding_box(kind, index))
            .inspect(|bounds| {
                assert!(bounds.min.is_finite() && bounds.max.is_finite(), "{bounds:?} is not finite");
            })
            .reduce(|| BoundingBox::EMPTY, BoundingBox::union);
        let frame = Frame::of(&bounds);
        let width = if backend == Backend::Avx512 && backend.is_available() {
            Width::Sixteen(Wide::new(&frame, columns, items))
        } else {
            Width::Eight(Wide::new(&frame, columns, items))
        };
        Self { backend, frame, width }
    }

    /// The lanes it was built for.
    #[must_use]
    pub fn backend(&self) -> Backend {
        self.backend
    }

    /// How many primitives are culled at a time: 8, or 16 on [`Backend::Avx512`].
    #[must_use]
    pub fn lanes(&self) -> usize {
        match self.width {
            Width::Eight(_) => 8,
            Width::Sixteen(_) => 16,
        }
    }

    /// Whether rays can go together: through a tree, or past some of several spheres. One or two spheres each ray tests.
    #[must_use]
    pub fn suits_bundles(&self) -> bool {
        let few = self.few();
        !few.replace_tree() || few.suit_cones()
    }

    /// How many rays of a list go together at most: [`Hierarchy::nearest_bundle`] and [`Hierarchy::occluded_bundle`] do the
    /// same work for a list as for its parts of this length.
    #[must_use]
    pub fn tile_len(&self) -> usize {
        if self.few().suit_cones() { BLOCK } else { self.lanes() * self.lanes() }
    }

    /// All there is, if that is few spheres.
    pub(crate) fn few(&self) -> &Few {
        match &self.width {
            Width::Eight(wide) => &wide.few,
            Width::Sixteen(wide) => &wide.few,
        }
    }

    /// What tracing a ray needs, to be kept between rays.
    #[must_use]
    pub fn scratch(&self) -> Scratch {
        let stack = match &self.width {
            Width::Eight(wide) => Stack::of(&wide.tree),
            Width::Sixteen(wide) => Stack::of(&wide.tree),
        };
        Scratch { stack, steps: Steps::default(), primitive_tests: 0, blocker: None, room: Room::default() }
    }

    /// The least hit of a ray in the order `(t, primitive)`; nothing behind the origin, even if the span begins there.
    #[must_use]
    pub fn nearest(&self, ray: &Ray, span: Span) -> Option<Hit> {
        self.nearest_with(&Query::new(*ray, span), &mut self.scratch())
    }

    /// Whether a ray hits anything.
    #[must_use]
    pub fn occluded(&self, ray: &Ray, span: Span) -> bool {
        self.occluded_with(&Query::new(*ray, span), &mut self.scratch())
    }

    /// The least hit, as [`Hierarchy::nearest`]; allocates nothing.
    ///
    /// # Panics
    ///
    /// If the ray leaves a primitive that does not exist, or the scratch is of a hierarchy that is less deep.
    pub fn nearest_with(&self, query: &Query, scratch: &mut Scratch) -> Option<Hit> {
        self.run(NearestOf { query, scratch })
    }

    /// Whether anything is hit, as [`Hierarchy::occluded`]; allocates nothing.
    ///
    /// # Panics
    ///
    /// As [`Hierarchy::nearest_with`] does.
    pub fn occluded_with(&self, query: &Query, scratch: &mut Scratch) -> bool {
        self.run(OccludedOf { query, scratch })
    }

    /// The least hits of rays; the answers go to the rays' places. Among triangles alone rays go together, node by node, and
    /// visit what each would by itself; else one by one.
    ///
    /// # Panics
    ///
    /// If a column or `hits` is too short, or as [`Hierarchy::nearest_with`] does.
    pub fn nearest_each(&self, rays: &RayColumns<'_>, hits: &mut [HitOrNone], scratch: &mut Scratch) {
        self.run(OfEach { question: NearestHit, rays, places: hits, scratch });
    }

    /// Whether rays hit anything, as [`Hierarchy::nearest_each`].
    ///
    /// # Panics
    ///
    /// As [`Hierarchy::nearest_each`] does.
    pub fn occluded_each(&self, rays: &RayColumns<'_>, occluded: &mut [bool], scratch: &mut Scratch) {
        self.run(OfEach { question: AnyHit::<false>, rays, places: occluded, scratch });
    }

    /// Does work on the tree, on the lanes it was built for.
    pub(crate) fn run<T: Task>(&self, task: T) -> T::Output {
        self.backend.run(OnLanes { hierarchy: self, task })
    }

    /// The longest way from the root to a leaf, in nodes: at most 71, whatever the primitives are.
    #[must_use]
    pub fn depth(&self) -> usize {
        match &self.width {
            Width::Eight(wide) => wide.tree.depth,
            Width::Sixteen(wide) => wide.tree.depth,
        }
    }

    /// How many bytes nodes and primitives take.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match &self.width {
            Width::Eight(wide) => wide.bytes(),
            Width::Sixteen(wide) => wide.bytes(),
        }
    }
}

/// What of a span lies ahead of the origin: a ray is a half-line.
#[inline(always)]
pub(crate) fn ahead(span: Span) -> Span {
    if span.start < 0.0 { Span { start: 0.0, ..span } } else { span }
}

/// Leaves primitives out: those that can be no answer.
fn drop_superfluous(references: &mut Vec<Reference>, numbers: &[u32]) {
    if numbers.is_empty() {
        return;
    }
    let mut is_kept = vec![true; references.len()];
    for &number in numbers {
        is_kept[number as usize] = false;
    }
    references.retain(|reference| is_kept[reference.primitive() as usize]);
}

/// How many lanes of its kind's block in a leaf a primitive takes, or what it costs as much as.
fn weight<const W: usize>(columns: &PrimitiveColumns, kind: PrimitiveKind, index: u32) -> u8 {
    let weight = match kind {
        PrimitiveKind::Sphere | PrimitiveKind::Triangle | PrimitiveKind::Cone => 1,
        PrimitiveKind::Polygon => fan_len(columns.polygon_len(index), W).unwrap_or(W),
    };
    u8::try_from(weight).expect("a leaf is small")
}

/// Where at least one primitive of so many is flat along an axis, rays look for the faces that they leave.
const LEAST_FLAT: usize = 8;

/// A tree and its primitives.
#[derive(Clone, Debug)]
pub(crate) struct Wide<const W: usize> {
    pub(crate) tree: Tree<W>,
    pub(crate) shapes: Shapes<W>,
    /// All there is, if that is few spheres.
    pub(crate) few: Few,
    /// Whether many primitives are flat along an axis.
    pub(crate) has_faces: bool,
}

impl<const W: usize> Wide<W> {
    fn new(frame: &Frame, columns: &PrimitiveColumns, items: &[(PrimitiveKind, u32, Sides)]) -> Self {
        let reference = |(primitive, &(kind, index, _)): (usize, &(PrimitiveKind, u32, Sides))| {
            let bounds = frame.cull_box(&columns.bounding_box(kind, index));
            let primitive = u32::try_from(primitive).expect("checked before");
            Reference::new(&bounds, primitive, kind as u8, weight::<W>(columns, kind, index))
        };
        let mut references = large_page_vec(items.len());
        references.par_extend(items.par_iter().enumerate().with_min_len(1024).map(reference));
        let n_flat = references.iter().filter(|reference| reference.is_flat()).count();
        let has_faces = n_flat > 0 && n_flat >= references.len() / LEAST_FLAT;
        drop_superfluous(&mut references, &superfluous(columns, items));
        let (mut tree, leaves) = build::<W>(&mut references, W);
        let (shapes, leaf_runs) = Shapes::arrange(frame, columns, items, &references, &leaves);
        tree.relabel_leaves(&leaf_runs);
        let few = shapes.few_spheres();
        Self { tree, shapes, few, has_faces }
    }

    /// What rays are tested against.
    #[inline(always)]
    pub(crate) fn targets<C: Content>(&self) -> Targets {
        let are_flat = C::TRIANGLES && (!C::OTHERS || self.shapes.is_flat());
        Targets { are_flat, have_faces: C::FACES }
    }

    /// The least of a ray's hits.
    #[inline(always)]
    pub(crate) fn nearest<S: Simd>(
        &self,
        simd: S,
        frame: &Frame,
        ray: &Ray,
        span: Span,
        from: Option<(u32, Side)>,
        scratch: &mut Scratch,
    ) -> Option<Hit> {
        if self.shapes.is_only(PrimitiveKind::Sphere) {
            self.nearest_alone::<S, OnlySpheres>(simd, frame, ray, span, from, scratch)
        } else if self.shapes.is_only(PrimitiveKind::Triangle) && self.has_faces {
            self.nearest_alone::<S, OnlyTriangles<true>>(simd, frame, ray, span, from, scratch)
        } else if self.shapes.is_only(PrimitiveKind::Triangle) {
            self.nearest_alone::<S, OnlyTriangles<false>>(simd, frame, ray, span, from, scratch)
        } else {
            self.nearest_alone::<S, Anything>(simd, frame, ray, span, from, scratch)
        }
    }

    #[inline(always)]
    fn nearest_alone<S: Simd, C: Content>(
        &self,
        simd: S,
        frame: &Frame,
        ray: &Ray,
        span: Span,
        from: Option<(u32, Side)>,
        scratch: &mut Scratch,
    ) -> Option<Hit> {
        let copies = Copies::<W>::of(ray, span);
        let (columns, mut departure) = (copies.columns(), self.shapes.departure(from));
        let rays = CullRays::alone(simd, frame, &columns, self.targets::<C>());
        let cull = rays.ray(0)?;
        let own = self.own_hit::<C>(ray, span, departure, scratch);
        if own.is_some() {
            departure = departure.map(Departure::met_again);
        }
        let traced = Traced { cull, ray: RayOf { columns: &columns, i: 0 }, departure };
        let nearest = if C::STREAMS {
            // As in a list.
            let so_far = (Nearest::NONE, cull.end_above());
            self.nearest_from::<S, C, true>(simd, &AtRoot, &traced, so_far, scratch).0
        } else {
            self.nearest_of::<S, C>(simd, &AtRoot, &traced, own, scratch)
        };
        match nearest.found {
            Found::Nothing => None,
            Found::At(hit) => Some(hit),
            Found::Sure(sure) => self.shapes.exact_alone(simd, (ray, span), departure, &sure),
        }
    }

    /// Where a ray that leaves a sphere into its inside meets it again.
    #[inline(always)]
    fn own_hit<C: Content>(
        &self,
        ray: &Ray,
        span: Span,
        departure: Option<Departure>,
        scratch: &mut Scratch,
    ) -> Option<Hit> {
        let Departure { kind, index, side } = departure?;
        let is_inwards = C::SPHERES && kind == PrimitiveKind::Sphere && side == Side::Back;
        // Of few spheres lists test all as well.
        if !is_inwards || !self.shapes.can_meet_own() || self.few.replace_tree() {
            return None;
        }
        scratch.primitive_tests += 1;
        self.shapes.own_hit(ray, span, index)
    }

    /// The least of a ray's hits and one that is known; not yet exactly where it is sure.
    #[inline(always)]
    pub(crate) fn nearest_of<S: Simd, C: Content>(
        &self,
        simd: S,
        begin: &impl Begin<W>,
        traced: &Traced<'_, W>,
        known: Option<Hit>,
        scratch: &mut Scratch,
    ) -> Nearest {
        let cull = if C::TRIANGLES { traced.cull.with_axes_known() } else { traced.cull };
        let traced = &Traced { cull, ..*traced };
        let end = known.map_or(cull.end_above(), |hit| cull.end(hit.t));
        let nearest = known.map_or(Nearest::NONE, |hit| Nearest::at(cull, hit));
        self.nearest_from::<S, C, false>(simd, begin, traced, (nearest, end), scratch).0
    }

    /// The least of a ray's hits and what is known so far, and where the span ends by it; children are visited by the way
    /// that the ray runs, or by their distances.
    #[inline(always)]
    pub(crate) fn nearest_from<S: Simd, C: Content, const BY_WAY: bool>(
        &self,
        simd: S,
        begin: &impl Begin<W>,
        traced: &Traced<'_, W>,
        (nearest, end): (Nearest, f32),
        scratch: &mut Scratch,
    ) -> (Nearest, f32) {
        let cull = if C::TRIANGLES { traced.cull.with_axes_known() } else { traced.cull };
        let traced = &Traced { cull, ..*traced };
        let Scratch { stack, steps, primitive_tests, .. } = scratch;
        let mut visitor = NearestVisitor::<S, C, BY_WAY, W> {
            content: PhantomData::<C>,
            simd,
            shapes: &self.shapes,
            ray: traced,
            end,
            nearest,
            tests: primitive_tests,
        };
        traverse(simd, &self.tree, begin, stack, cull, end, steps, &mut visitor);
        (visitor.nearest, visitor.end)
    }

    #[inline(always)]
    pub(crate) fn occluded<S: Simd>(
        &self,
        simd: S,
        frame: &Frame,
        ray: &Ray,
        span: Span,
        from: Option<(u32, Side)>,
        scratch: &mut Scratch,
    ) -> bool {
        if self.shapes.is_only(PrimitiveKind::Sphere) {
            self.occluded_alone::<S, OnlySpheres>(simd, frame, ray, span, from, scratch)
        } else if self.shapes.is_only(PrimitiveKind::Triangle) && self.has_faces {
            self.occluded_alone::<S, OnlyTriangles<true>>(simd, frame, ray, span, from, scratch)
        } else if self.shapes.is_only(PrimitiveKind::Triangle) {
            self.occluded_alone::<S, OnlyTriangles<false>>(simd, frame, ray, span, from, scratch)
        } else {
            self.occluded_alone::<S, Anything>(simd, frame, ray, span, from, scratch)
        }
    }

    #[inline(always)]
    fn occluded_alone<S: Simd, C: Content>(
        &self,
        simd: S,
        frame: &Frame,
        ray: &Ray,
        span: Span,
        from: Option<(u32, Side)>,
        scratch: &mut Scratch,
    ) -> bool {
        let copies = Copies::<W>::of(ray, span);
        let (columns, departure) = (copies.columns(), self.shapes.departure(from));
        let rays = CullRays::alone(simd, frame, &columns, self.targets::<C>());
        let Some(cull) = rays.ray(0) else { return false };
        if self.own_hit::<C>(ray, span, departure, scratch).is_some() {
            return true;
        }
        let traced = Traced { cull, ray: RayOf { columns: &columns, i: 0 }, departure };
        self.occluded_of::<S, C, false>(simd, &AtRoot, &traced, scratch)
    }

    #[inline(always)]
    pub(crate) fn occluded_of<S: Simd, C: Content, const SHARED: bool>(
        &self,
        simd: S,
        begin: &impl Begin<W>,
        traced: &Traced<'_, W>,
        scratch: &mut Scratch,
    ) -> bool {
        let Scratch { stack, steps, primitive_tests, blocker, .. } = scratch;
        let end = traced.cull.end_above();
        let mut visitor = AnyVisitor {
            content: PhantomData::<C>,
            simd,
            shapes: &self.shapes,
            ray: traced,
            end,
            tests: primitive_tests,
            blocker: if SHARED { Some(blocker) } else { None },
        };
        is_stopped(simd, &self.tree, begin, stack, traced.cull, end, steps, &mut visitor)
    }

    fn bytes(&self) -> usize {
        size_of_val(&self.tree.nodes[..]) + self.shapes.bytes()
    }
}

struct NearestVisitor<'h, S: Simd, C: Content, const BY_WAY: bool, const W: usize> {
    content: PhantomData<C>,
    simd: S,
    shapes: &'h Shapes<W>,
    ray: &'h Traced<'h, W>,
    end: f32,
    nearest: Nearest,
    tests: &'h mut u64,
}

impl<S: Simd, C: Content, const BY_WAY: bool, const W: usize> Visitor
    for NearestVisitor<'_, S, C, BY_WAY, W>
{
    const FACES: bool = C::FACES;
    const FARTHEST_FIRST: bool = C::FARTHEST_FIRST;
    const BY_WAY: bool = BY_WAY;

    #[inline(always)]
    fn leaf(&mut self, leaf: usize) -> Option<f32> {
        let Self { shapes, end, nearest, tests, .. } = self;
        shapes.nearest::<S, C>(self.simd, leaf, self.ray, nearest, end, tests);
        Some(self.end)
    }
}

struct AnyVisitor<'h, S: Simd, C: Content, const W: usize> {
    content: PhantomData<C>,
    simd: S,
    shapes: &'h Shapes<W>,
    ray: &'h Traced<'h, W>,
    end: f32,
    tests: &'h mut u64,
    /// Where the record of what blocks the ray goes, if somebody wants it.
    blocker: Option<&'h mut Option<u32>>,
}

impl<S: Simd, C: Content, const W: usize> Visitor for AnyVisitor<'_, S, C, W> {
    const FACES: bool = C::FACES;
    const FARTHEST_FIRST: bool = C::FARTHEST_FIRST;
    const BY_WAY: bool = false;

    #[inline(always)]
    fn leaf(&mut self, leaf: usize) -> Option<f32> {
        // Where all are triangles, what a block is tested with would else be spread over lanes before the traversal, for
        // every ray, and not stay in registers.
        let only_triangles = C::TRIANGLES && !C::OTHERS;
        let ray = if only_triangles { black_box(self.ray) } else { self.ray };
        let mut found = None;
        let is_hit = self.shapes.any::<S, C>(self.simd, leaf, ray, self.end, self.tests, &mut found);
        if is_hit && let Some(blocker) = &mut self.blocker {
            **blocker = found;
        }
        if is_hit { None } else { Some(self.end) }
    }
}

/// Work on a tree, which is as wide as the lanes.
pub(crate) trait Task {
    type Output;
    fn run<S: Simd, const W: usize>(self, simd: S, frame: &Frame, wide: &Wide<W>) -> Self::Output;
}

struct OnLanes<'h, T> {
    hierarchy: &'h Hierarchy,
    task: T,
}

impl<T: Task> Kernel for OnLanes<'_, T> {
    type Output = T::Output;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> T::Output {
        simd.by_lanes(self)
    }
}

impl<S: Simd, T: Task> ByLanes<S> for OnLanes<'_, T> {
    type Output = T::Output;
    #[inline(always)]
    fn eight(self, simd: S) -> T::Output {
        let Hierarchy { frame, width: Width::Eight(wide), .. } = self.hierarchy else {
            unreachable!("a hierarchy runs on the lanes it was built for")
        };
        self.task.run(simd, frame, wide)
    }
    #[inline(always)]
    fn sixteen(self, simd: S) -> T::Output {
        let Hierarchy { frame, width: Width::Sixteen(wide), .. } = self.hierarchy else {
            unreachable!("a hierarchy runs on the lanes it was built for")
        };
        self.task.run(simd, frame, wide)
    }
}

struct NearestOf<'a> {
    query: &'a Query,
    scratch: &'a mut Scratch,
}

impl Task for NearestOf<'_> {
    type Output = Option<Hit>;
    #[inline(always)]
    fn run<S: Simd, const W: usize>(self, simd: S, frame: &Frame, wide: &Wide<W>) -> Option<Hit> {
        let Query { ray, span, from } = self.query;
        wide.nearest(simd, frame, ray, ahead(*span), *from, self.scratch)
    }
}

struct OccludedOf<'a> {
    query: &'a Query,
    scratch: &'a mut Scratch,
}

impl Task for OccludedOf<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<S: Simd, const W: usize>(self, simd: S, frame: &Frame, wide: &Wide<W>) -> bool {
        let Query { ray, span, from } = self.query;
        wide.occluded(simd, frame, ray, ahead(*span), *from, self.scratch)
    }
}

struct OfEach<'a, Q: OfFew> {
    question: Q,
    rays: &'a RayColumns<'a>,
    places: &'a mut [Q::Answer],
    scratch: &'a mut Scratch,
}

impl<Q: OfFew + OfStream> Task for OfEach<'_, Q> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd, const W: usize>(self, simd: S, frame: &Frame, wide: &Wide<W>) {
        let Self { question, rays, places, scratch } = self;
        if !wide.shapes.is_only(PrimitiveKind::Triangle) {
            let rays = Rays::<_, false> { columns: rays, range: 0..rays.len(), places, shared: None };
            wide.each(simd, frame, question, rays, scratch);
        } else if wide.has_faces {
            let content = PhantomData::<OnlyTriangles<true>>;
            simd.outline(OfStreams::<_, Q, W> { content, wide, frame, columns: rays, places, scratch });
        } else {
            let content = PhantomData::<OnlyTriangles<false>>;
            simd.outline(OfStreams::<_, Q, W> { content, wide, frame, columns: rays, places, scratch });
        }
    }
}
