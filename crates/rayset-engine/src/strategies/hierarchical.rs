//! Single rays through a wide bounding volume hierarchy over all primitives.
//!
//! What the paper's "other algorithmic methods" became: section 1 cites Rubin and Whitted 1980 and others for
//! hierarchical subdivision. Each ray is traced by itself; nothing is retained.
//!
//! Source: Wald, Benthin and Boulos 2008, "Getting rid of packets", for wide nodes that one ray tests in lanes.

use rayset_bvh::{Hierarchy, Scratch};
use rayset_geometry::Sides;
use rayset_scene::{PrimitiveId, Scene, VolumeId};
use rayset_simd::{Backend, Lanes, Simd};

use crate::strategy::LaneTracer;
use crate::{Hit, IntersectionStrategy, Originating, RayQuery, Recording, ShadowQuery, Stats, Tracer};

/// Traces every ray by itself through a hierarchy of all primitives.
#[derive(Debug)]
pub struct Hierarchical<'s> {
    scene: &'s Scene,
    hierarchy: Hierarchy,
}

impl<'s> Hierarchical<'s> {
    /// Builds the hierarchy of a scene, on the lanes of [`Backend::active`].
    #[must_use]
    pub fn new(scene: &'s Scene) -> Self {
        Self::on(scene, Backend::active())
    }

    /// Builds the hierarchy of a scene, on the lanes of a backend.
    #[must_use]
    pub fn on(scene: &'s Scene, backend: Backend) -> Self {
        Self { scene, hierarchy: hierarchy_of(scene, backend) }
    }
}

/// A hierarchy of all primitives of a scene, numbered by their ids.
pub(super) fn hierarchy_of(scene: &Scene, backend: Backend) -> Hierarchy {
    let mut items: Vec<_> = (0..scene.n_primitives())
        .map(|id| {
            let location = scene.location(PrimitiveId(u32::try_from(id).expect("ids have 32 bits")));
            (location.kind, location.index, Sides::Both)
        })
        .collect();
    for volume in (0..).map(VolumeId).take(scene.volumes().len()) {
        for run in scene.volume_runs(volume) {
            for index in run.range.clone() {
                items[scene.primitive_id(run.kind, index).0 as usize].2 = run.sides;
            }
        }
    }
    Hierarchy::over(scene.primitives(), &items, backend)
}

impl IntersectionStrategy for Hierarchical<'_> {
    fn name(&self) -> &'static str {
        "hierarchical"
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn scene(&self) -> &Scene {
        self.scene
    }

    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_> {
        Box::new(HierarchicalTracer {
            scene: self.scene,
            hierarchy: &self.hierarchy,
            scratch: self.hierarchy.scratch(),
            recording,
            stats: Stats::default(),
        })
    }
}

struct HierarchicalTracer<'s> {
    scene: &'s Scene,
    hierarchy: &'s Hierarchy,
    scratch: Scratch,
    recording: Recording,
    stats: Stats,
}

/// A hit with its object.
#[inline(always)]
pub(super) fn hit_of(scene: &Scene, hit: rayset_bvh::Hit) -> Hit {
    let primitive = PrimitiveId(hit.primitive);
    Hit { t: hit.t, object: scene.volume_object(scene.location(primitive).volume), primitive }
}

impl HierarchicalTracer<'_> {
    /// Takes over what the hierarchy has counted.
    #[inline(always)]
    fn count<S: Simd>(&mut self) {
        let work = &mut self.stats.work;
        work.boxes_tested = self.scratch.steps.nodes * S::F32::LANES as u64;
        work.primitive_tests = self.scratch.primitive_tests;
    }
}

#[inline(always)]
fn from(originating: &Originating) -> (u32, rayset_geometry::Side) {
    (originating.primitive.0, originating.side)
}

impl LaneTracer for HierarchicalTracer<'_> {
    #[inline(always)]
    fn nearest_on<S: Simd>(&mut self, simd: S, query: &RayQuery) -> Option<Hit> {
        let from = query.originating.as_ref().map(from);
        let hit = self.hierarchy.nearest_on(simd, &query.ray, query.span, from, &mut self.scratch);
        self.count::<S>();
        Some(hit_of(self.scene, hit?))
    }

    #[inline(always)]
    fn occluded_on<S: Simd>(&mut self, simd: S, query: &ShadowQuery) -> bool {
        let from = from(&query.originating);
        let occluded =
            self.hierarchy.occluded_on(simd, &query.ray, query.span, Some(from), &mut self.scratch);
        self.count::<S>();
        occluded
    }

    fn lane_stats(&self) -> &Stats {
        &self.stats
    }

    fn lane_recording(&self) -> Recording {
        self.recording
    }

    fn backend(&self) -> Backend {
        self.hierarchy.backend()
    }
}
