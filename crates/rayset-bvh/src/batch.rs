//! Lists of rays, and hierarchies over slices of one shape.

use rayset_geometry::{Primitive, PrimitiveColumns, Ray, Side, Sides, Span, Sphere, Triangle};
use rayset_simd::{Backend, Kernel, Simd};

use crate::{Hierarchy, Hit, RayList};

/// What is asked about a ray of a list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Query {
    /// The ray, in world space.
    pub ray: Ray,
    /// The part of it that counts; what lies behind the origin never does.
    pub span: Span,
    /// The primitive that the ray leaves, and the side into which it leaves; `None` for a ray that starts anywhere.
    ///
    /// The place that was left is no hit, and a plane or the outside of a convex shape is not met again: see
    /// [`Primitive::intersect`].
    pub from: Option<(u32, Side)>,
}

impl Query {
    /// A ray that starts anywhere.
    #[must_use]
    pub fn new(ray: Ray, span: Span) -> Self {
        Self { ray, span, from: None }
    }

    /// A ray that leaves a primitive into one of its sides.
    #[must_use]
    pub fn leaving(ray: Ray, span: Span, primitive: u32, side: Side) -> Self {
        Self { ray, span, from: Some((primitive, side)) }
    }
}

impl From<Ray> for Query {
    /// Everything in front of the origin.
    fn from(ray: Ray) -> Self {
        Self::new(ray, Span::FORWARD)
    }
}

impl Hierarchy {
    /// Builds a hierarchy over spheres that can be hit from both sides, numbered in their order.
    ///
    /// # Panics
    ///
    /// As [`Hierarchy::new`] does.
    #[must_use]
    pub fn of_spheres(spheres: &[Sphere]) -> Self {
        of(spheres.iter().map(|&sphere| sphere.into()))
    }

    /// Builds a hierarchy over triangles that can be hit from both sides, numbered in their order.
    ///
    /// # Panics
    ///
    /// As [`Hierarchy::new`] does.
    #[must_use]
    pub fn of_triangles(triangles: &[Triangle]) -> Self {
        of(triangles.iter().map(|&triangle| triangle.into()))
    }

    /// Appends the least hit of every ray, in order: the answers of [`Hierarchy::nearest`], with the lanes chosen once.
    ///
    /// # Panics
    ///
    /// If a ray leaves a primitive that does not exist.
    pub fn nearest_batch(&self, queries: &[Query], answers: &mut Vec<Option<Hit>>) {
        self.backend().run(NearestBatch { hierarchy: self, queries, answers });
    }

    /// Appends for every ray, in order, whether it hits anything.
    ///
    /// # Panics
    ///
    /// If a ray leaves a primitive that does not exist.
    pub fn occluded_batch(&self, queries: &[Query], answers: &mut Vec<bool>) {
        self.backend().run(OccludedBatch { hierarchy: self, queries, answers });
    }
}

/// A hierarchy over primitives that can be hit from both sides.
fn of(primitives: impl Iterator<Item = Primitive>) -> Hierarchy {
    let mut columns = PrimitiveColumns::default();
    let items: Vec<_> = primitives
        .map(|primitive| {
            let run = columns.push(&primitive, Sides::Both);
            (run.kind, run.range.start, Sides::Both)
        })
        .collect();
    Hierarchy::over(&columns, &items, Backend::active())
}

struct NearestBatch<'a> {
    hierarchy: &'a Hierarchy,
    queries: &'a [Query],
    answers: &'a mut Vec<Option<Hit>>,
}

impl Kernel for NearestBatch<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { hierarchy, queries, answers } = self;
        answers.reserve(queries.len());
        hierarchy.nearest_each(simd, &mut List { queries, answers }, &mut hierarchy.scratch());
    }
}

struct OccludedBatch<'a> {
    hierarchy: &'a Hierarchy,
    queries: &'a [Query],
    answers: &'a mut Vec<bool>,
}

impl Kernel for OccludedBatch<'_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { hierarchy, queries, answers } = self;
        answers.reserve(queries.len());
        hierarchy.occluded_each(simd, &mut List { queries, answers }, &mut hierarchy.scratch());
    }
}

/// Queries and their answers.
struct List<'a, A> {
    queries: &'a [Query],
    answers: &'a mut Vec<A>,
}

impl<A> RayList<A> for List<'_, A> {
    #[inline(always)]
    fn rays(&self) -> usize {
        self.queries.len()
    }
    #[inline(always)]
    fn ray(&self, i: usize) -> Query {
        self.queries[i]
    }
    #[inline(always)]
    fn answer(&mut self, answer: A) {
        self.answers.push(answer);
    }
}
