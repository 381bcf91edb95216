//! Lists of rays, and hierarchies over slices of one shape.

use rayset_geometry::{Primitive, PrimitiveColumns, Ray, Side, Sides, Span, Sphere, Triangle};
use rayset_simd::Backend;

use crate::{Hierarchy, Hit, HitOrNone, Left, RayColumns};

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
        let (mut columns, mut scratch) = (Box::new(Columns::NONE), self.scratch());
        let mut hits = [HitOrNone::NONE; CHUNK];
        for queries in queries.chunks(CHUNK) {
            self.nearest_each(&columns.fill(queries), &mut hits, &mut scratch);
            answers.extend(hits[..queries.len()].iter().map(|hit| hit.get()));
        }
    }

    /// Appends for every ray, in order, whether it hits anything.
    ///
    /// # Panics
    ///
    /// If a ray leaves a primitive that does not exist.
    pub fn occluded_batch(&self, queries: &[Query], answers: &mut Vec<bool>) {
        let first = answers.len();
        answers.resize(first + queries.len(), false);
        let (mut columns, mut scratch) = (Box::new(Columns::NONE), self.scratch());
        for (queries, occluded) in queries.chunks(CHUNK).zip(answers[first..].chunks_mut(CHUNK)) {
            self.occluded_each(&columns.fill(queries), occluded, &mut scratch);
        }
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

/// How many queries are put into columns at a time.
const CHUNK: usize = 64;

/// Queries as columns: origins, directions, starts and ends of spans, and what each ray leaves.
pub(crate) struct Columns([[f64; CHUNK]; 8], [Left; CHUNK]);

impl Columns {
    pub(crate) const NONE: Self = Self([[0.0; CHUNK]; 8], [Left::NOTHING; CHUNK]);

    /// Takes queries in, as many as there is room for.
    #[inline(always)]
    pub(crate) fn fill(&mut self, queries: &[Query]) -> RayColumns<'_> {
        let Self(columns, left) = self;
        for (i, query) in queries.iter().enumerate() {
            let (origin, direction) = (query.ray.origin(), query.ray.direction());
            for k in 0..3 {
                columns[k][i] = origin[k];
                columns[3 + k][i] = direction[k];
            }
            columns[6][i] = query.span.start;
            columns[7][i] = query.span.end;
            left[i] = query.from.into();
        }
        let [ox, oy, oz, dx, dy, dz, starts, ends] =
            columns.each_ref().map(|column| &column[..queries.len()]);
        let left = &left[..queries.len()];
        RayColumns { origins: [ox, oy, oz], directions: [dx, dy, dz], spans: (starts, ends), left }
    }
}
