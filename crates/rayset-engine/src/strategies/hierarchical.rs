//! Single rays through a wide bounding volume hierarchy over all primitives.
//!
//! What the paper's "other algorithmic methods" became: section 1 cites Rubin and Whitted 1980 and others for
//! hierarchical subdivision. Each ray is traced by itself; nothing is retained.
//!
//! Source: Wald, Benthin and Boulos 2008, "Getting rid of packets", for wide nodes that one ray tests in lanes.

use rayset_bvh::{Hierarchy, RayColumns, RayList, Scratch};
use rayset_geometry::{Ray, Side, Sides, Span};
use rayset_scene::{ObjectId, PrimitiveId, Scene, VolumeId};
use rayset_simd::{Backend, Kernel, Lanes, Simd};

use crate::query::Columns;
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
    recording: Recording,
    stats: Stats,
}

/// A hit with its object.
#[inline(always)]
pub(super) fn hit_of(objects: &[ObjectId], hit: rayset_bvh::Hit) -> Hit {
    let primitive = PrimitiveId(hit.primitive);
    Hit { t: hit.t, object: objects[hit.primitive as usize], primitive }
}

impl<'s> HierarchicalTracer<'s> {
    pub(super) fn new(hierarchy: &'s Hierarchy, objects: &'s [ObjectId], recording: Recording) -> Self {
        Self { hierarchy, objects, scratch: hierarchy.scratch(), recording, stats: Stats::default() }
    }
}

impl HierarchicalTracer<'_> {
    #[inline(always)]
    fn nearest_on<S: Simd>(
        &mut self,
        simd: S,
        ray: &Ray,
        span: Span,
        from: Option<&Originating>,
    ) -> Option<Hit> {
        let from = from.map(|from| (from.primitive.0, from.side));
        let hit = self.hierarchy.nearest_on(simd, ray, span, from, &mut self.scratch)?;
        Some(hit_of(self.objects, hit))
    }

    #[inline(always)]
    fn occluded_on<S: Simd>(&mut self, simd: S, ray: &Ray, span: Span, from: Option<&Originating>) -> bool {
        let from = from.map(|from| (from.primitive.0, from.side));
        self.hierarchy.occluded_on(simd, ray, span, from, &mut self.scratch)
    }

    /// Takes over what the hierarchy has counted.
    #[inline(always)]
    fn count<S: Simd>(&mut self) {
        let work = &mut self.stats.work;
        work.boxes_tested = self.scratch.steps.nodes * S::F32::LANES as u64;
        work.primitive_tests = self.scratch.primitive_tests;
    }
}

impl Tracer for HierarchicalTracer<'_> {
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
        self.hierarchy.backend().run(NearestOne { tracer: self, query })
    }

    fn occluded(&mut self, query: &ShadowQuery) -> bool {
        self.hierarchy.backend().run(OccludedOne { tracer: self, query })
    }

    fn stats(&self) -> &Stats {
        &self.stats
    }

    fn recording(&self) -> Recording {
        self.recording
    }

    fn nearest_bundle(&mut self, generation: &Generation, answers: &mut Answers<Option<Hit>>) {
        if self.recording == Recording::Off {
            self.hierarchy.backend().run(NearestBundle { tracer: self, generation, answers });
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
            self.hierarchy.backend().run(OccludedBundle { tracer: self, generation, answers });
            return;
        }
        for i in 0..generation.len() {
            let before = Before::of(self);
            answers.values.push(self.occluded(&generation.query(i)));
            before.record(self, &mut answers.work);
        }
    }
}

struct NearestOne<'a, 's> {
    tracer: &'a mut HierarchicalTracer<'s>,
    query: &'a RayQuery,
}

impl Kernel for NearestOne<'_, '_> {
    type Output = Option<Hit>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<Hit> {
        let RayQuery { ray, span, originating, .. } = self.query;
        let hit = self.tracer.nearest_on(simd, ray, *span, originating.as_ref());
        self.tracer.count::<S>();
        hit
    }
}

struct OccludedOne<'a, 's> {
    tracer: &'a mut HierarchicalTracer<'s>,
    query: &'a ShadowQuery,
}

impl Kernel for OccludedOne<'_, '_> {
    type Output = bool;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        let ShadowQuery { ray, span, originating, .. } = self.query;
        let occluded = self.tracer.occluded_on(simd, ray, *span, Some(originating));
        self.tracer.count::<S>();
        occluded
    }
}

struct NearestBundle<'a, 's> {
    tracer: &'a mut HierarchicalTracer<'s>,
    generation: &'a Generation,
    answers: &'a mut Answers<Option<Hit>>,
}

impl Kernel for NearestBundle<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { tracer, generation, answers } = self;
        let HierarchicalTracer { hierarchy, objects, scratch, .. } = &mut *tracer;
        let columns = Columns::of(generation);
        answers.values.reserve(columns.slots.len());
        let mut rays = NearestRays { columns, objects, answers: &mut answers.values };
        hierarchy.nearest_each(simd, &mut rays, scratch);
        tracer.count::<S>();
    }
}

struct OccludedBundle<'a, 's> {
    tracer: &'a mut HierarchicalTracer<'s>,
    generation: &'a ShadowGeneration,
    answers: &'a mut Answers<bool>,
}

impl Kernel for OccludedBundle<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { tracer, generation, answers } = self;
        let HierarchicalTracer { hierarchy, scratch, .. } = &mut *tracer;
        let columns = Columns::of(generation.rays());
        answers.values.reserve(columns.slots.len());
        hierarchy.occluded_each(simd, &mut ShadowRays { columns, answers: &mut answers.values }, scratch);
        tracer.count::<S>();
    }
}

/// What a ray of a bundle leaves.
#[inline(always)]
fn left_by(columns: &Columns<'_>, i: usize) -> Option<(u32, Side)> {
    columns.originating[i].as_ref().map(|from| (from.primitive.0, from.side))
}

/// The rays of a bundle that ask for the nearest hit.
struct NearestRays<'a> {
    columns: Columns<'a>,
    objects: &'a [ObjectId],
    answers: &'a mut Vec<Option<Hit>>,
}

impl<'r> RayList<'r, Option<rayset_bvh::Hit>> for NearestRays<'r> {
    #[inline(always)]
    fn columns(&self) -> RayColumns<'r> {
        self.columns.rays()
    }
    #[inline(always)]
    fn left(&self, i: usize) -> Option<(u32, Side)> {
        left_by(&self.columns, i)
    }
    #[inline(always)]
    fn answer(&mut self, hit: Option<rayset_bvh::Hit>) {
        self.answers.push(hit.map(|hit| hit_of(self.objects, hit)));
    }
}

/// The rays of a bundle that ask whether anything is between.
struct ShadowRays<'a> {
    columns: Columns<'a>,
    answers: &'a mut Vec<bool>,
}

impl<'r> RayList<'r, bool> for ShadowRays<'r> {
    #[inline(always)]
    fn columns(&self) -> RayColumns<'r> {
        self.columns.rays()
    }
    #[inline(always)]
    fn left(&self, i: usize) -> Option<(u32, Side)> {
        left_by(&self.columns, i)
    }
    #[inline(always)]
    fn answer(&mut self, is_hit: bool) {
        self.answers.push(is_hit);
    }
}
