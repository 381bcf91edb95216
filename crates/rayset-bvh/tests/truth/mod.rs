//! What a loop over all primitives answers, and how every backend is held against it.
#![allow(dead_code, reason = "no test uses all of it")]

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;
use rayset_bvh::{Hierarchy, Hit, Query};
use rayset_geometry::glam::{DVec3, dvec3};
use rayset_geometry::{Primitive, PrimitiveColumns, PrimitiveKind, Side, Sides, Span, unit};
use rayset_simd::Backend;

pub(crate) type Primitives = Vec<(Primitive, Sides)>;

/// The least hit in the order `(t, primitive)`.
pub(crate) fn nearest(primitives: &[(Primitive, Sides)], query: &Query) -> Option<Hit> {
    let mut nearest: Option<Hit> = None;
    // A ray is a half-line.
    let span = match query.span {
        span if span.start < 0.0 => Span { start: 0.0, ..span },
        span => span,
    };
    for (number, (primitive, sides)) in (0..).zip(primitives) {
        let departure = query.from.filter(|from| from.0 == number).map(|from| from.1);
        if let Some(t) = primitive.intersect(&query.ray, span, *sides, departure)
            && nearest.is_none_or(|nearest| t < nearest.t)
        {
            nearest = Some(Hit { t, primitive: number });
        }
    }
    nearest
}

pub(crate) fn bits(hit: Option<Hit>) -> Option<(u64, u32)> {
    hit.map(|hit| (hit.t.to_bits(), hit.primitive))
}

pub(crate) fn columns_of(
    primitives: &[(Primitive, Sides)],
) -> (PrimitiveColumns, Vec<(PrimitiveKind, u32, Sides)>) {
    let mut columns = PrimitiveColumns::default();
    let items = primitives.iter().map(|(primitive, sides)| {
        let run = columns.push(primitive, *sides);
        (run.kind, run.range.start, *sides)
    });
    let items = items.collect();
    (columns, items)
}

/// Compares the answers on every backend with those of the loop; returns how many rays hit.
pub(crate) fn check(what: &str, primitives: &[(Primitive, Sides)], queries: &[Query]) -> usize {
    let (columns, items) = columns_of(primitives);
    let expected: Vec<_> = queries.iter().map(|query| nearest(primitives, query)).collect();
    for &backend in Backend::available() {
        let hierarchy = Hierarchy::over(&columns, &items, backend);
        let (mut hits, mut occluded) = (Vec::new(), Vec::new());
        hierarchy.nearest_batch(queries, &mut hits);
        hierarchy.occluded_batch(queries, &mut occluded);
        assert_eq!((hits.len(), occluded.len()), (queries.len(), queries.len()));
        for (i, query) in queries.iter().enumerate() {
            assert_eq!(bits(hits[i]), bits(expected[i]), "{what}, {backend}: {query:?}");
            assert_eq!(occluded[i], expected[i].is_some(), "{what}, {backend}: {query:?}");
        }
    }
    expected.iter().flatten().count()
}

pub(crate) struct Dice(pub(crate) ChaCha8Rng);

impl Dice {
    pub(crate) fn below(&mut self, n: usize) -> usize {
        self.0.next_u32() as usize % n
    }
    pub(crate) fn unit(&mut self) -> f64 {
        f64::from(self.0.next_u32()) / f64::from(u32::MAX)
    }
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }
    pub(crate) fn point(&mut self) -> DVec3 {
        let (x, y) = (self.between(-1.0, 1.0), self.between(-1.0, 1.0));
        dvec3(x, y, self.between(-1.0, 1.0))
    }
    pub(crate) fn pick<T: Clone>(&mut self, values: &[T]) -> T {
        values[self.below(values.len())].clone()
    }
    pub(crate) fn axis(&mut self) -> DVec3 {
        self.pick(&[DVec3::X, DVec3::Y, DVec3::Z]) * self.pick(&[-1.0, 1.0])
    }
    pub(crate) fn direction(&mut self) -> DVec3 {
        unit(self.point()).unwrap_or(DVec3::X)
    }
    pub(crate) fn side(&mut self) -> Side {
        self.pick(&[Side::Front, Side::Back])
    }
    pub(crate) fn sides(&mut self) -> Sides {
        self.pick(&[Sides::Both, Sides::Both, Sides::Front, Sides::Back])
    }
}
