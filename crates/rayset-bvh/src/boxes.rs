//! A hierarchy over boxes whose contents the caller tests.

use rayset_geometry::{BoundingBox, Ray, Span};
use rayset_simd::{Backend, ByLanes, Kernel, Simd};

use crate::batch::Columns;
use crate::build::{Reference, build};
use crate::entrance::{Entered, Entrance};
use crate::frame::Frame;
use crate::hierarchy::ahead;
use crate::node::Tree;
use crate::ray::{CullRay, CullRays, Targets};
use crate::traverse::{Stack, Steps, Visitor, traverse};
use crate::{Hit, Query};

/// How many boxes a leaf holds at most: few, since a box is cheaper to test than what may be in it.
const LEAF_LEN: usize = 2;

/// A bounding volume hierarchy over boxes; what is in them, a closure knows.
///
/// The closure is given the number of a primitive, the ray, and the span that still counts. It returns the least
/// distance within the span at which the ray hits the primitive, in world units, or `None`.
///
/// # What the closure must keep to
///
/// 1. A hit lies in the primitive's box: the point `o + t d` may be outside by at most
///    [`PARTITION_MARGIN`](rayset_geometry::PARTITION_MARGIN), 2^-46, times the largest coordinate of the ray's origin
///    plus the largest of any box. The tests of [`rayset_geometry`] keep to it; for a test that is less exact, give
///    boxes that are wider by what it may be off.
/// 2. The distance depends on the primitive and the ray alone. The span ends just after the nearest hit so far, and
///    may so cut a hit off, but must not change it.
///
/// Then every answer is that of a loop over all primitives, the least in the order `(t, primitive)`, on any backend.
/// Whatever the closure does, nothing panics or runs on for ever; what it returns outside of the span counts as
/// `None`. It is called at most once a ray for each primitive, now and then for one whose box the ray misses.
///
/// ```
/// use rayset_bvh::BoxHierarchy;
/// use rayset_geometry::{BoundingBox, Ray, Span, glam::{DVec3, dvec3}};
///
/// // A row of unit squares across the z axis, each with a round hole of radius 0.25.
/// let depths: Vec<f64> = (1..=10).map(f64::from).collect();
/// let boxes = depths.iter().map(|&z| BoundingBox { min: dvec3(0.0, 0.0, z), max: dvec3(1.0, 1.0, z) });
/// let hierarchy = BoxHierarchy::new(boxes);
///
/// let intersect = |primitive: u32, ray: &Ray, span: Span| {
///     let t = (depths[primitive as usize] - ray.origin().z) / ray.direction().z;
///     let point = ray.at(t) - dvec3(0.5, 0.5, 0.0);
///     let is_hit = point.x.abs().max(point.y.abs()) <= 0.5 && point.x.hypot(point.y) > 0.25;
///     (is_hit && span.contains(t)).then_some(t)
/// };
/// let ray = Ray::new(dvec3(0.1, 0.5, 0.0), DVec3::Z);
/// assert_eq!(hierarchy.nearest(&ray, Span::FORWARD, intersect).unwrap().primitive, 0);
/// let through = Ray::new(dvec3(0.5, 0.6, 0.0), DVec3::Z);
/// assert!(!hierarchy.occluded(&through, Span::FORWARD, intersect));
/// ```
#[derive(Clone, Debug)]
pub struct BoxHierarchy {
    backend: Backend,
    frame: Frame,
    width: Width,
}

/// As wide as the lanes that traverse it.
#[derive(Clone, Debug)]
enum Width {
    Eight(Wide<8>),
    Sixteen(Wide<16>),
}

impl BoxHierarchy {
    /// Builds a hierarchy over boxes in world space, numbered in their order, for the lanes of [`Backend::active`].
    ///
    /// A box may be flat, a point, or the same as another; an empty one holds nothing and is never looked into.
    ///
    /// # Panics
    ///
    /// If a coordinate of a box that is not empty is NaN or not finite, or there are 2^31 boxes or more.
    #[must_use]
    pub fn new(boxes: impl IntoIterator<Item = BoundingBox>) -> Self {
        Self::on(boxes, Backend::active())
    }

    /// Builds a hierarchy for the lanes of a backend.
    ///
    /// # Panics
    ///
    /// As [`BoxHierarchy::new`] does.
    #[must_use]
    pub fn on(boxes: impl IntoIterator<Item = BoundingBox>, backend: Backend) -> Self {
        let boxes: Vec<BoundingBox> = boxes.into_iter().collect();
        assert!(boxes.len() < 1 << 31, "fewer than 2^31 boxes");
        let held = |bounds: &&BoundingBox| !bounds.is_empty();
        for bounds in boxes.iter().filter(held) {
            assert!(bounds.min.is_finite() && bounds.max.is_finite(), "{bounds:?} is not finite");
        }
        let frame = Frame::of(&boxes.iter().filter(held).copied().collect());
        let width = if backend == Backend::Avx512 && backend.is_available() {
            Width::Sixteen(Wide::new(&frame, &boxes))
        } else {
            Width::Eight(Wide::new(&frame, &boxes))
        };
        Self { backend, frame, width }
    }

    /// The lanes it was built for.
    #[must_use]
    pub fn backend(&self) -> Backend {
        self.backend
    }

    /// The least hit of a ray in the order `(t, primitive)`.
    #[must_use]
    pub fn nearest(
        &self,
        ray: &Ray,
        span: Span,
        intersect: impl Fn(u32, &Ray, Span) -> Option<f64>,
    ) -> Option<Hit> {
        let query = Query::new(*ray, span);
        let intersect = |primitive: u32, query: &Query| intersect(primitive, &query.ray, query.span);
        let mut answer = None;
        self.backend.run(Batch {
            hierarchy: self,
            queries: &[query],
            search: NearestOf { intersect, answer: |hit| answer = hit },
        });
        answer
    }

    /// Whether a ray hits anything.
    #[must_use]
    pub fn occluded(
        &self,
        ray: &Ray,
        span: Span,
        intersect: impl Fn(u32, &Ray, Span) -> Option<f64>,
    ) -> bool {
        let query = Query::new(*ray, span);
        let intersect = |primitive: u32, query: &Query| intersect(primitive, &query.ray, query.span);
        let mut answer = false;
        self.backend.run(Batch {
            hierarchy: self,
            queries: &[query],
            search: OccludedOf { intersect, answer: |is_hit| answer = is_hit },
        });
        answer
    }

    /// Appends the least hit of every ray, in order.
    ///
    /// The closure is given the query as it stands in the list, with the span that still counts: what the ray leaves,
    /// [`Query::from`], is for the closure alone to honour.
    pub fn nearest_batch(
        &self,
        queries: &[Query],
        intersect: impl Fn(u32, &Query) -> Option<f64>,
        answers: &mut Vec<Option<Hit>>,
    ) {
        answers.reserve(queries.len());
        let search = NearestOf { intersect, answer: |hit| answers.push(hit) };
        self.backend.run(Batch { hierarchy: self, queries, search });
    }

    /// Appends for every ray, in order, whether it hits anything; the closure is that of
    /// [`BoxHierarchy::nearest_batch`].
    pub fn occluded_batch(
        &self,
        queries: &[Query],
        intersect: impl Fn(u32, &Query) -> Option<f64>,
        answers: &mut Vec<bool>,
    ) {
        answers.reserve(queries.len());
        let search = OccludedOf { intersect, answer: |is_hit| answers.push(is_hit) };
        self.backend.run(Batch { hierarchy: self, queries, search });
    }
}

/// A tree and which boxes are in its leaves.
#[derive(Clone, Debug)]
struct Wide<const W: usize> {
    tree: Tree<W>,
    /// The numbers of primitives, leaf by leaf.
    numbers: Vec<u32>,
    /// Where each leaf starts in them, and one past the end of the last.
    starts: Vec<u32>,
}

impl<const W: usize> Wide<W> {
    fn new(frame: &Frame, boxes: &[BoundingBox]) -> Self {
        let mut references: Vec<Reference> = boxes
            .iter()
            .zip(0..)
            .filter(|(bounds, _)| !bounds.is_empty())
            .map(|(bounds, primitive)| Reference::new(&frame.cull_box(bounds), primitive, 0, 1))
            .collect();
        let (tree, leaves) = build::<W>(&mut references, LEAF_LEN);
        let (mut numbers, mut starts) = (Vec::with_capacity(references.len()), vec![0]);
        for leaf in leaves {
            let leaf = &mut references[leaf.start as usize..leaf.end as usize];
            leaf.sort_unstable_by_key(|reference| reference.primitive());
            numbers.extend(leaf.iter().map(|reference| reference.primitive()));
            starts.push(u32::try_from(numbers.len()).expect("fewer than 2^31 boxes"));
        }
        Self { tree, numbers, starts }
    }

    #[inline(always)]
    fn run<S: Simd>(&self, simd: S, frame: &Frame, queries: &[Query], search: &mut impl Search) {
        let mut stack = Stack::of(&self.tree);
        let mut steps = Steps::default();
        let mut columns = Columns::NONE;
        let (mut prepared, mut entrance) = (CullRays::<W>::NONE, Entrance::<W>::NONE);
        for queries in queries.chunks(W) {
            prepared.prepare(simd, frame, &columns.fill(queries), (0, queries.len()), Targets::default());
            let open = prepared.found(queries.len());
            entrance.begin::<S, false, false>(simd, &self.tree, &prepared, prepared.ends(), open);
            for (ray, query) in queries.iter().enumerate() {
                let query = Query { span: ahead(query.span), ..*query };
                let Some(cull) = prepared.ray(ray).filter(|_| entrance.of(ray) != 0) else {
                    search.finish(None);
                    continue;
                };
                let end = cull.end_above();
                let begin = Entered { entrance: &entrance, ray };
                let mut visit = Visit { wide: self, cull, end, query, nearest: None, search };
                traverse(simd, &self.tree, &begin, &mut stack, cull, end, &mut steps, &mut visit);
                let nearest = visit.nearest;
                search.finish(nearest);
            }
        }
    }
}

/// What is wanted of a ray.
trait Search {
    /// Whether the first hit that is found will do.
    const ANY: bool;

    /// The hit of a primitive.
    fn intersect(&self, primitive: u32, query: &Query) -> Option<f64>;

    /// Takes the answer for a ray.
    fn finish(&mut self, nearest: Option<Hit>);
}

struct NearestOf<F, A> {
    intersect: F,
    answer: A,
}

impl<F: Fn(u32, &Query) -> Option<f64>, A: FnMut(Option<Hit>)> Search for NearestOf<F, A> {
    const ANY: bool = false;

    #[inline(always)]
    fn intersect(&self, primitive: u32, query: &Query) -> Option<f64> {
        (self.intersect)(primitive, query)
    }

    #[inline(always)]
    fn finish(&mut self, nearest: Option<Hit>) {
        (self.answer)(nearest);
    }
}

struct OccludedOf<F, A> {
    intersect: F,
    answer: A,
}

impl<F: Fn(u32, &Query) -> Option<f64>, A: FnMut(bool)> Search for OccludedOf<F, A> {
    const ANY: bool = true;

    #[inline(always)]
    fn intersect(&self, primitive: u32, query: &Query) -> Option<f64> {
        (self.intersect)(primitive, query)
    }

    #[inline(always)]
    fn finish(&mut self, nearest: Option<Hit>) {
        (self.answer)(nearest.is_some());
    }
}

/// A ray on its way through a tree.
struct Visit<'a, Q, const W: usize> {
    wide: &'a Wide<W>,
    cull: CullRay<'a, W>,
    end: f32,
    /// The span ends just after the nearest hit so far, so that ties are found.
    query: Query,
    nearest: Option<Hit>,
    search: &'a Q,
}

impl<Q: Search, const W: usize> Visitor for Visit<'_, Q, W> {
    const FACES: bool = false;
    const FARTHEST_FIRST: bool = false;
    const BY_WAY: bool = false;

    #[inline(always)]
    fn leaf(&mut self, leaf: usize) -> Option<f32> {
        let range = self.wide.starts[leaf] as usize..self.wide.starts[leaf + 1] as usize;
        for &primitive in &self.wide.numbers[range] {
            let Some(t) = self.search.intersect(primitive, &self.query) else { continue };
            let hit = Hit { t, primitive };
            if !self.query.span.contains(t) || self.nearest.is_some_and(|nearest| !hit.precedes(&nearest)) {
                continue;
            }
            self.nearest = Some(hit);
            if Q::ANY {
                return None;
            }
            self.query.span.end = self.query.span.end.min(t.next_up());
            self.end = self.cull.end(t);
        }
        Some(self.end)
    }
}

struct Batch<'a, Q> {
    hierarchy: &'a BoxHierarchy,
    queries: &'a [Query],
    search: Q,
}

impl<Q: Search> Kernel for Batch<'_, Q> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        simd.by_lanes(self);
    }
}

impl<S: Simd, Q: Search> ByLanes<S> for Batch<'_, Q> {
    type Output = ();
    #[inline(always)]
    fn eight(mut self, simd: S) {
        let BoxHierarchy { frame, width: Width::Eight(wide), .. } = self.hierarchy else {
            unreachable!("a hierarchy runs on the lanes it was built for")
        };
        wide.run(simd, frame, self.queries, &mut self.search);
    }
    #[inline(always)]
    fn sixteen(mut self, simd: S) {
        let BoxHierarchy { frame, width: Width::Sixteen(wide), .. } = self.hierarchy else {
            unreachable!("a hierarchy runs on the lanes it was built for")
        };
        wide.run(simd, frame, self.queries, &mut self.search);
    }
}
