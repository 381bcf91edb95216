//! Coherence over the hierarchy: the rays of a bundle that correspond are traced in packets under one shaft, and one by
//! one where they part.
//!
//! It is the paper's idea turned round. The cylinder of section 2.3.1 is built round one ray and asked again by each
//! that follows; the shaft is built round all rays of a packet at once, and what it proves, that they miss a box, holds
//! for all of them. Counters decide which rays are worth a shaft, and never a clock.
//!
//! Source: Reshetov, Soupikov and Hurley 2005, "Multi-level ray tracing algorithm".

use rayset_bvh::{BundleScratch, Bundled, Hierarchy, RayColumns};
use rayset_geometry::Side;
use rayset_scene::{LightId, ObjectId, Scene};
use rayset_simd::{Backend, Kernel, Lanes, Simd};

use super::hierarchical::{hierarchy_of, hit_of, objects_of};
use crate::{
    Answers, Generation, Hit, IntersectionStrategy, Originating, PixelOrder, QueryWork, RayKind, RayQuery,
    Recording, ShadowGeneration, ShadowQuery, Slot, StageCounts, Stats, Tracer, Work,
};

/// Traces rays in packets through a hierarchy of all primitives.
#[derive(Debug)]
pub struct Bundle<'s> {
    scene: &'s Scene,
    hierarchy: Hierarchy,
    /// The object of each primitive.
    objects: Vec<ObjectId>,
}

impl<'s> Bundle<'s> {
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

impl Bundle<'_> {
    /// The hierarchy, and the object of each primitive.
    pub(super) fn parts(&self) -> (&Hierarchy, &[ObjectId]) {
        (&self.hierarchy, &self.objects)
    }
}

impl IntersectionStrategy for Bundle<'_> {
    fn name(&self) -> &'static str {
        "bundle"
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn scene(&self) -> &Scene {
        self.scene
    }

    /// A tile.
    fn preferred_bundle_len(&self) -> usize {
        256
    }

    /// Squares of 32 x 32 pixels, of which a bundle is a quarter and a packet of 16 rays a square of 4 x 4; a sweep, in which
    /// it is found out what pays, is 32 rows.
    fn preferred_order(&self) -> PixelOrder {
        PixelOrder::Morton(32)
    }

    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_> {
        Box::new(BundleTracer::new(&self.hierarchy, &self.objects, recording))
    }
}

pub(super) struct BundleTracer<'s> {
    hierarchy: &'s Hierarchy,
    objects: &'s [ObjectId],
    scratch: BundleScratch,
    /// What each ray of a generation leaves.
    left: Vec<Option<(u32, Side)>>,
    hits: Vec<Option<rayset_bvh::Hit>>,
    recording: Recording,
    stats: Stats,
}

/// The classes of rays that ask for the nearest hit; as many ask whether there is any.
const CLASSES: usize = 32;

impl<'s> BundleTracer<'s> {
    pub(super) fn new(hierarchy: &'s Hierarchy, objects: &'s [ObjectId], recording: Recording) -> Self {
        let scratch = hierarchy.bundle_scratch();
        let (left, hits) = (Vec::new(), Vec::new());
        Self { hierarchy, objects, scratch, left, hits, recording, stats: Stats::default() }
    }

    /// What the rays leave; nothing if they are initial rays.
    fn find_left(&mut self, rays: &Generation) {
        self.left.clear();
        if rays.originating().first().is_some_and(Option::is_some) {
            let left = |originating: &Originating| (originating.primitive.0, originating.side);
            self.left.extend(rays.originating().iter().map(|originating| originating.as_ref().map(left)));
        }
    }

    /// Takes over what the hierarchy has counted; returns what is new.
    fn count(&mut self, kind: RayKind, lanes: usize) -> Work {
        let before = self.stats.work;
        let Bundled { tiles, packets, alone } = std::mem::take(&mut self.scratch.bundled);
        self.stats.stages[kind] += StageCounts { tiles, packets, alone };
        self.stats.work.boxes_tested = self.scratch.single.steps.nodes * lanes as u64;
        self.stats.work.primitive_tests = self.scratch.single.primitive_tests;
        self.stats.work - before
    }
}

/// Shares out work evenly; what is left over goes to the first rays.
fn record(column: &mut [QueryWork], work: Work) {
    let n = column.len() as u64;
    for (place, query) in (0..).zip(column) {
        let mut share = work;
        for (_, count) in share.counts_mut() {
            *count = *count / n + u64::from(place < *count % n);
        }
        query.work = share;
    }
}

/// Where the answers of a generation go.
enum Places<'a> {
    Hits(&'a mut [Option<rayset_bvh::Hit>]),
    /// And the light of each ray.
    Occluded(&'a mut [bool], &'a [LightId]),
}

impl Places<'_> {
    /// How many rays from `first` on correspond: those of a slot, and of a light.
    fn group(&self, slots: &[Slot], first: usize) -> usize {
        let slot = slots[first];
        let same = |i: &usize| match self {
            Self::Hits(_) => slots[*i] == slot,
            Self::Occluded(_, lights) => slots[*i] == slot && lights[*i] == lights[first],
        };
        (first..slots.len()).take_while(same).count()
    }
}

struct Answering<'a, 's> {
    tracer: &'a mut BundleTracer<'s>,
    generation: &'a Generation,
    places: Places<'a>,
    work: &'a mut Vec<QueryWork>,
}

impl Kernel for Answering<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { tracer, generation, mut places, work } = self;
        let ([ox, oy, oz], [dx, dy, dz]) = (generation.origins(), generation.directions());
        let left = std::mem::take(&mut tracer.left);
        let rays = RayColumns {
            origins: [ox, oy, oz],
            directions: [dx, dy, dz],
            spans: generation.spans(),
            left: &left,
        };
        let lanes = S::F32::LANES;
        // Shaft by shaft where their work is asked for.
        let step = if tracer.recording == Recording::Off { usize::MAX } else { lanes * lanes };
        let slots = generation.slots();
        let before = work.len();
        if tracer.recording == Recording::PerQuery {
            work.resize(before + generation.len(), QueryWork::default());
        }
        let mut first = 0;
        while first < slots.len() {
            let end = first + places.group(slots, first);
            let class = slots[first].0 as usize % CLASSES;
            let kind = match places {
                Places::Hits(_) => slots[first].kind(),
                Places::Occluded(..) => RayKind::Shadow,
            };
            while first < end {
                let range = first..first + step.min(end - first);
                first = range.end;
                let scratch = &mut tracer.scratch;
                match &mut places {
                    Places::Hits(hits) => {
                        tracer.hierarchy.nearest_bundle_on(simd, &rays, range.clone(), class, hits, scratch);
                    }
                    Places::Occluded(occluded, _) => {
                        let (class, range) = (CLASSES + class, range.clone());
                        tracer.hierarchy.occluded_bundle_on(simd, &rays, range, class, occluded, scratch);
                    }
                }
                let new = tracer.count(kind, lanes);
                if tracer.recording == Recording::PerQuery {
                    record(&mut work[before..][range], new);
                }
            }
        }
        tracer.left = left;
    }
}

impl Tracer for BundleTracer<'_> {
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
        let mut generation = Generation::default();
        generation.push(query);
        let mut answers = Answers::default();
        self.nearest_bundle(&generation, &mut answers);
        answers.values[0]
    }

    fn occluded(&mut self, query: &ShadowQuery) -> bool {
        let mut generation = ShadowGeneration::default();
        generation.push(query);
        let mut answers = Answers::default();
        self.occluded_bundle(&generation, &mut answers);
        answers.values[0]
    }

    fn stats(&self) -> &Stats {
        &self.stats
    }

    fn recording(&self) -> Recording {
        self.recording
    }

    fn nearest_bundle(&mut self, generation: &Generation, answers: &mut Answers<Option<Hit>>) {
        self.find_left(generation);
        let mut hits = std::mem::take(&mut self.hits);
        hits.clear();
        hits.resize(generation.len(), None);
        let backend = self.hierarchy.backend();
        let places = Places::Hits(&mut hits);
        backend.run(Answering { tracer: self, generation, places, work: &mut answers.work });
        let objects = self.objects;
        answers.values.extend(hits.iter().map(|hit| hit.map(|hit| hit_of(objects, hit))));
        self.hits = hits;
    }

    fn occluded_bundle(&mut self, generation: &ShadowGeneration, answers: &mut Answers<bool>) {
        let rays = generation.rays();
        self.find_left(rays);
        let first = answers.values.len();
        answers.values.resize(first + rays.len(), false);
        let backend = self.hierarchy.backend();
        let places = Places::Occluded(&mut answers.values[first..], generation.lights());
        backend.run(Answering { tracer: self, generation: rays, places, work: &mut answers.work });
    }
}
