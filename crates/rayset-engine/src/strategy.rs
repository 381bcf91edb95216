//! The seam between Whitted's recursion and how rays find what they hit.

use rayset_scene::Scene;
use rayset_simd::{Backend, Kernel, Simd};

use crate::{
    Answers, Generation, Hit, PixelOrder, QueryWork, RayQuery, ShadowGeneration, ShadowQuery, Stats, Work,
};

/// What a tracer writes down beside its answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Recording {
    /// Only sums.
    #[default]
    Off,
    /// The work of every query.
    PerQuery,
}

/// An intersection strategy, bound to one scene and shared by all threads.
///
/// # Contracts
///
/// 1. Queries of one slot, or of one slot and light, arrive in increasing order of ray-sets.
/// 2. [`Tracer::nearest`] returns the least hit in the order `(t, object, primitive)`, so the answer does not depend
///    on the order of tests.
/// 3. The `*_bundle` methods append exactly one answer a query, in order, the same as the methods for one ray.
/// 4. No answer of an exact strategy depends on what is retained; retained state may only save work.
pub trait IntersectionStrategy: Sync {
    /// The name by which options and reports know it.
    fn name(&self) -> &'static str;

    /// Whether every answer is the least hit; only `speer-1985` says no.
    fn is_exact(&self) -> bool;

    /// The scene it is bound to.
    fn scene(&self) -> &Scene;

    /// How many ray-sets it likes to answer together.
    fn preferred_bundle_len(&self) -> usize {
        64
    }

    /// The order in which it likes to visit pixels.
    fn preferred_order(&self) -> PixelOrder {
        PixelOrder::Scanline
    }

    /// Starts a sweep with nothing retained.
    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_>;
}

/// Answers the visibility queries of one sweep; keeps what it likes between them.
pub trait Tracer {
    /// The nearest hit within the span.
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit>;

    /// Whether anything lies within the span.
    fn occluded(&mut self, query: &ShadowQuery) -> bool;

    /// What was counted since the sweep began.
    fn stats(&self) -> &Stats;

    /// What is recorded for each query.
    fn recording(&self) -> Recording;

    /// See [`QueryWork::certificate_radius`]: of the query answered last; asked only where work is recorded.
    fn certificate_radius(&self) -> f64 {
        0.0
    }

    /// Answers a whole generation; override it to batch.
    fn nearest_bundle(&mut self, generation: &Generation, answers: &mut Answers<Option<Hit>>) {
        for i in 0..generation.len() {
            let before = Before::of(self);
            answers.values.push(self.nearest(&generation.query(i)));
            before.record(self, &mut answers.work);
        }
    }

    /// Answers the light rays of a generation; override it to batch.
    fn occluded_bundle(&mut self, generation: &ShadowGeneration, answers: &mut Answers<bool>) {
        for i in 0..generation.len() {
            let before = Before::of(self);
            answers.values.push(self.occluded(&generation.query(i)));
            before.record(self, &mut answers.work);
        }
    }
}

/// What a tracer had done before a query, if the query's work is recorded.
pub(crate) struct Before(Option<(Work, u64)>);

impl Before {
    #[inline(always)]
    pub(crate) fn of<T: Tracer + ?Sized>(tracer: &T) -> Self {
        match tracer.recording() {
            Recording::Off => Self(None),
            Recording::PerQuery => Self(Some(Self::progress(tracer.stats()))),
        }
    }

    /// Writes down what the query took.
    #[inline(always)]
    pub(crate) fn record<T: Tracer + ?Sized>(self, tracer: &T, column: &mut Vec<QueryWork>) {
        if let Some((work, coherent)) = self.0 {
            let after = Self::progress(tracer.stats());
            column.push(QueryWork {
                work: after.0 - work,
                coherent: after.1 > coherent,
                certificate_radius: tracer.certificate_radius(),
            });
        }
    }

    fn progress(stats: &Stats) -> (Work, u64) {
        (stats.work, stats.coherence.total().coherent)
    }
}

/// A tracer written once for any number of lanes; the lanes are chosen once a generation.
pub(crate) trait LaneTracer {
    fn nearest_on<S: Simd>(&mut self, simd: S, query: &RayQuery) -> Option<Hit>;
    fn occluded_on<S: Simd>(&mut self, simd: S, query: &ShadowQuery) -> bool;
    fn lane_stats(&self) -> &Stats;
    fn lane_recording(&self) -> Recording;
    fn lane_certificate_radius(&self) -> f64 {
        0.0
    }
    fn backend(&self) -> Backend;
}

impl<T: LaneTracer> Tracer for T {
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
        self.backend().run(Nearest { tracer: self, query })
    }

    fn occluded(&mut self, query: &ShadowQuery) -> bool {
        self.backend().run(Occluded { tracer: self, query })
    }

    fn stats(&self) -> &Stats {
        self.lane_stats()
    }

    fn recording(&self) -> Recording {
        self.lane_recording()
    }

    fn certificate_radius(&self) -> f64 {
        self.lane_certificate_radius()
    }

    fn nearest_bundle(&mut self, generation: &Generation, answers: &mut Answers<Option<Hit>>) {
        self.backend().run(NearestBundle { tracer: self, generation, answers });
    }

    fn occluded_bundle(&mut self, generation: &ShadowGeneration, answers: &mut Answers<bool>) {
        self.backend().run(OccludedBundle { tracer: self, generation, answers });
    }
}

struct Nearest<'a, T> {
    tracer: &'a mut T,
    query: &'a RayQuery,
}

impl<T: LaneTracer> Kernel for Nearest<'_, T> {
    type Output = Option<Hit>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<Hit> {
        self.tracer.nearest_on(simd, self.query)
    }
}

struct Occluded<'a, T> {
    tracer: &'a mut T,
    query: &'a ShadowQuery,
}

impl<T: LaneTracer> Kernel for Occluded<'_, T> {
    type Output = bool;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        self.tracer.occluded_on(simd, self.query)
    }
}

struct NearestBundle<'a, T> {
    tracer: &'a mut T,
    generation: &'a Generation,
    answers: &'a mut Answers<Option<Hit>>,
}

impl<T: LaneTracer> Kernel for NearestBundle<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for i in 0..self.generation.len() {
            let before = Before::of(self.tracer);
            let hit = self.tracer.nearest_on(simd, &self.generation.query(i));
            self.answers.values.push(hit);
            before.record(self.tracer, &mut self.answers.work);
        }
    }
}

struct OccludedBundle<'a, T> {
    tracer: &'a mut T,
    generation: &'a ShadowGeneration,
    answers: &'a mut Answers<bool>,
}

impl<T: LaneTracer> Kernel for OccludedBundle<'_, T> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for i in 0..self.generation.len() {
            let before = Before::of(self.tracer);
            let occluded = self.tracer.occluded_on(simd, &self.generation.query(i));
            self.answers.values.push(occluded);
            before.record(self.tracer, &mut self.answers.work);
        }
    }
}
