//! The standard algorithm: every ray partitions all bounding volumes.
//!
//! Source: Speer et al. 1985, section 2.2; Whitted 1980.

use rayset_geometry::Probe;
use rayset_scene::Scene;
use rayset_simd::{Backend, Simd};

use super::partition::{Partition, any_in, departure};
use crate::strategy::LaneTracer;
use crate::{Hit, IntersectionStrategy, RayQuery, Recording, ShadowQuery, Stats, Tracer};

/// Partitions the region for every ray and tests what is inside the volumes in I.
#[derive(Debug)]
pub struct Standard<'s> {
    scene: &'s Scene,
    backend: Backend,
}

impl<'s> Standard<'s> {
    /// Binds the strategy to a scene, on the lanes of [`Backend::active`].
    #[must_use]
    pub fn new(scene: &'s Scene) -> Self {
        Self::on(scene, Backend::active())
    }

    /// Binds the strategy to a scene, on the lanes of a backend.
    #[must_use]
    pub fn on(scene: &'s Scene, backend: Backend) -> Self {
        Self { scene, backend }
    }
}

impl IntersectionStrategy for Standard<'_> {
    fn name(&self) -> &'static str {
        "standard"
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn scene(&self) -> &Scene {
        self.scene
    }

    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_> {
        Box::new(StandardTracer {
            scene: self.scene,
            backend: self.backend,
            recording,
            partition: Partition::default(),
            stats: Stats::default(),
        })
    }
}

struct StandardTracer<'s> {
    scene: &'s Scene,
    backend: Backend,
    recording: Recording,
    partition: Partition,
    stats: Stats,
}

impl LaneTracer for StandardTracer<'_> {
    #[inline(always)]
    fn nearest_on<S: Simd>(&mut self, simd: S, query: &RayQuery) -> Option<Hit> {
        let (scene, work) = (self.scene, &mut self.stats.work);
        let probe = Probe::new(simd, &query.ray, query.span, scene.primitives().is_flat());
        let departure = departure(scene, query.originating);
        self.partition.nearest::<S, false>(simd, scene, &probe, departure, work)
    }

    #[inline(always)]
    fn occluded_on<S: Simd>(&mut self, simd: S, query: &ShadowQuery) -> bool {
        let (scene, work) = (self.scene, &mut self.stats.work);
        let probe = Probe::new(simd, &query.ray, query.span, scene.primitives().is_flat());
        let departure = departure(scene, Some(query.originating));
        self.partition.of::<S, false>(simd, scene, &probe, work);
        // A loop and not `any`: the lanes of a closure are compiled without the backend's instructions.
        for &volume in &self.partition.intersected {
            if any_in(scene, &probe, volume, departure, work) {
                return true;
            }
        }
        false
    }

    fn lane_stats(&self) -> &Stats {
        &self.stats
    }

    fn lane_recording(&self) -> Recording {
        self.recording
    }

    fn backend(&self) -> Backend {
        self.backend
    }
}
