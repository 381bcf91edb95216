//! Single rays through a wide bounding volume hierarchy over all primitives.
//!
//! What the paper's "other algorithmic methods" became: section 1 cites Rubin and Whitted 1980 and others for
//! hierarchical subdivision. Each ray is traced by itself; nothing is retained.
//!
//! Source: Wald, Benthin and Boulos 2008, "Getting rid of packets", for wide nodes that one ray tests in lanes.

use rayset_bvh::{Hierarchy, HitOrNone, Query, RayColumns, Scratch};
use rayset_geometry::{Side, Sides};
use rayset_scene::{ObjectId, PrimitiveId, Scene, VolumeId};
use rayset_simd::Backend;

use crate::strategy::Before;
use crate::{
    Answers, Generation, Hit, IntersectionStrategy, Originating, RayQuery, Recording, ShadowGeneration,
    ShadowQuery, Stats, Tracer,
};

/// Traces every ray by itself through a hierarchy of all primitives.
#[derive(Debug)]
pub struct Hierarchical<'s> {
    scene: &'s Scene,
    hierarchy: Hierarchy,
    /// The object of each primitive.
    objects: Vec<ObjectId>,
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
        Self { scene, hierarchy: hierarchy_of(scene, backend), objects: objects_of(scene) }
    }
}

/// The object of each primitive.
pub(super) fn objects_of(scene: &Scene) -> Vec<ObjectId> {
    let ids = (0..).map(PrimitiveId).take(scene.n_primitives());
    ids.map(|id| scene.volume_object(scene.location(id).volume)).collect()
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
        Box::new(HierarchicalTracer::new(&self.hierarchy, &self.objects, recording))
    }
}

pub(super) struct HierarchicalTracer<'s> {
    hierarchy: &'s Hierarchy,
    objects: &'s [ObjectId],
    scratch: Scratch,
    hits: Vec<HitOrNone>,
    recording: Recording,
    stats: Stats,
}

/// The rays of a generation as the hierarchy reads them.
pub(super) fn columns_of(rays: &Generation) -> RayColumns<'_> {
    let ([ox, oy, oz], [dx, dy, dz]) = (rays.origins(), rays.directions());
    RayColumns { origins: [ox, oy, oz], directions: [dx, dy, dz], spans: rays.spans(), left: rays.left() }
}

#[inline(always)]
fn left_by(originating: &Originating) -> (u32, Side) {
    (originating.primitive.0, originating.side)
}

/// A hit with its object.
#[inline(always)]
pub(super) fn hit_of(objects: &[ObjectId], hit: rayset_bvh::Hit) -> Hit {
    let primitive = PrimitiveId(hit.primitive);
    Hit { t: hit.t, object: objects[hit.primitive as usize], primitive }
}

/// Appends hits with their objects.
///
/// What is no hit is looked up too, the last object for it, so that there is no branch to guess.
pub(super) fn extend_with_objects(values: &mut Vec<Option<Hit>>, objects: &[ObjectId], hits: &[HitOrNone]) {
    let Some(last) = objects.len().checked_sub(1) else {
        values.extend(hits.iter().map(|_| None));
        return;
    };
    values.extend(hits.iter().map(|&HitOrNone { t, primitive }| {
        let hit = Hit { t, object: objects[last.min(primitive as usize)], primitive: PrimitiveId(primitive) };
        (primitive != HitOrNone::NONE.primitive).then_some(hit)
    }));
}

impl<'s> HierarchicalTracer<'s> {
    pub(super) fn new(hierarchy: &'s Hierarchy, objects: &'s [ObjectId], recording: Recording) -> Self {
        let (scratch, hits) = (hierarchy.scratch(), Vec::new());
        Self { hierarchy, objects, scratch, hits, recording, stats: Stats::default() }
    }

    /// Takes over what the hierarchy has counted.
    fn count(&mut self) {
        let work = &mut self.stats.work;
        work.boxes_tested = self.scratch.steps.nodes * self.hierarchy.lanes() as u64;
        work.primitive_tests = self.scratch.primitive_tests;
    }
}

impl Tracer for HierarchicalTracer<'_> {
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
        let from = query.originating.as_ref().map(left_by);
        let asked = Query { ray: query.ray, span: query.span, from };
        let hit = self.hierarchy.nearest_with(&asked, &mut self.scratch);
        self.count();
        hit.map(|hit| hit_of(self.objects, hit))
    }

    fn occluded(&mut self, query: &ShadowQuery) -> bool {
        let asked = Query { ray: query.ray, span: query.span, from: Some(left_by(&query.originating)) };
        let occluded = self.hierarchy.occluded_with(&asked, &mut self.scratch);
        self.count();
        occluded
    }

    fn stats(&self) -> &Stats {
        &self.stats
    }

    fn recording(&self) -> Recording {
        self.recording
    }

    fn nearest_bundle(&mut self, generation: &Generation, answers: &mut Answers<Option<Hit>>) {
        if self.recording == Recording::Off {
            let Self { hierarchy, objects, scratch, hits, .. } = self;
            hits.resize(generation.len(), HitOrNone::NONE);
            hierarchy.nearest_each(&columns_of(generation), hits, scratch);
            extend_with_objects(&mut answers.values, objects, hits);
            self.count();
            return;
        }
        for i in 0..generation.len() {
            let before = Before::of(self);
            answers.values.push(self.nearest(&generation.query(i)));
            before.record(self, &mut answers.work);
        }
    }

    fn occluded_bundle(&mut self, generation: &ShadowGeneration, answers: &mut Answers<bool>) {
        if self.recording == Recording::Off {
            let Self { hierarchy, scratch, .. } = self;
            let rays = generation.rays();
            let first = answers.values.len();
            answers.values.resize(first + rays.len(), false);
            hierarchy.occluded_each(&columns_of(rays), &mut answers.values[first..], scratch);
            self.count();
            return;
        }
        for i in 0..generation.len() {
            let before = Before::of(self);
            answers.values.push(self.occluded(&generation.query(i)));
            before.record(self, &mut answers.work);
        }
    }
}
