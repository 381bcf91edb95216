//! The queries that a render asks.

use std::sync::Mutex;

use rayset_engine::scene::Scene;
use rayset_engine::{
    Hit, IntersectionStrategy, RayQuery, Recording, RenderOptions, ShadowQuery, Standard, Stats, Tracer,
    render,
};

/// A question to a tracer.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Query {
    /// What does this ray hit first?
    Nearest(RayQuery),
    /// Is this light hidden?
    Occluded(ShadowQuery),
}

/// All queries of a render, sweep by sweep, in the order in which they were asked.
///
/// The sweeps come in no particular order.
pub(crate) fn queries_of(scene: &Scene, options: &RenderOptions) -> Vec<Vec<Query>> {
    let noting = Noting { inner: Standard::new(scene), sweeps: Mutex::default() };
    render(&noting, options).unwrap();
    noting.sweeps.into_inner().unwrap()
}

/// Notes what the standard algorithm is asked.
struct Noting<'s> {
    inner: Standard<'s>,
    sweeps: Mutex<Vec<Vec<Query>>>,
}

impl IntersectionStrategy for Noting<'_> {
    fn name(&self) -> &'static str {
        "noting"
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn scene(&self) -> &Scene {
        self.inner.scene()
    }

    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_> {
        Box::new(NotingTracer {
            strategy: self,
            inner: self.inner.begin_sweep(recording),
            queries: Vec::new(),
        })
    }
}

struct NotingTracer<'s> {
    strategy: &'s Noting<'s>,
    inner: Box<dyn Tracer + 's>,
    queries: Vec<Query>,
}

impl Drop for NotingTracer<'_> {
    fn drop(&mut self) {
        self.strategy.sweeps.lock().unwrap().push(std::mem::take(&mut self.queries));
    }
}

impl Tracer for NotingTracer<'_> {
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
        self.queries.push(Query::Nearest(*query));
        self.inner.nearest(query)
    }

    fn occluded(&mut self, query: &ShadowQuery) -> bool {
        self.queries.push(Query::Occluded(*query));
        self.inner.occluded(query)
    }

    fn stats(&self) -> &Stats {
        self.inner.stats()
    }

    fn recording(&self) -> Recording {
        self.inner.recording()
    }
}
