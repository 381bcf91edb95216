//! Coherence over the hierarchy: the rays of a bundle that correspond are traced in packets under one shaft, and one by
//! one where they part.
//!
//! It is the paper's idea turned round. The cylinder of section 2.3.1 is built round one ray and asked again by each
//! that follows; the shaft is built round all rays of a packet at once, and what it proves, that they miss a box, holds
//! for all of them. Counters decide which rays are worth a shaft, and never a clock.
//!
//! Source: Reshetov, Soupikov and Hurley 2005, "Multi-level ray tracing algorithm".

use rayset_bvh::{BundleScratch, Bundled, Group, Hierarchy, HitOrNone, PartOfList, Spent};
use rayset_scene::{LightId, ObjectId, Scene};
use rayset_simd::Backend;

use super::hierarchical::{columns_of, extend_with_objects, hierarchy_of, objects_of};
use crate::query::run_len;
use crate::{
    Answers, Generation, Hit, IntersectionStrategy, PixelOrder, QueryWork, RayKind, RayQuery, Recording,
    ShadowGeneration, ShadowQuery, Slot, StageCounts, Stats, Tracer, Work,
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
    groups: Vec<Group>,
    hits: Vec<HitOrNone>,
    recording: Recording,
    stats: Stats,
    /// Rays that count as answered alone and had their answer at once: see [`Bundled::at_once`].
    at_once: u64,
}

/// The classes of rays that ask for the nearest hit; as many ask whether there is any.
const CLASSES: usize = 32;

impl<'s> BundleTracer<'s> {
    pub(super) fn new(hierarchy: &'s Hierarchy, objects: &'s [ObjectId], recording: Recording) -> Self {
        let mut scratch = hierarchy.bundle_scratch();
        scratch.parts = (recording == Recording::PerQuery).then(Vec::new);
        let (groups, hits, stats) = (Vec::new(), Vec::new(), Stats::default());
        Self { hierarchy, objects, scratch, groups, hits, recording, stats, at_once: 0 }
    }

    /// How many rays were answered together so far, and how many by themselves that had to look for their answer.
    pub(super) fn fared(&self) -> (u64, u64) {
        let stages = self.stats.stages.iter().map(|(_, stages)| stages);
        let (together, alone) = stages
            .fold((0, 0), |(together, alone), stages| (together + stages.together(), alone + stages.alone));
        (together, alone - self.at_once)
    }

    /// Takes over how the rays of a class were answered.
    fn count(&mut self, class: usize, kind: RayKind) {
        let Bundled { tiles, packets, blockers, alone, at_once } = self.scratch.take_bundled(class);
        self.at_once += at_once;
        self.stats.stages[kind] += StageCounts { tiles, packets, blockers, alone };
    }

    /// Answers the rays of a generation, those that correspond as one group.
    fn answer(&mut self, generation: &Generation, places: Places<'_>, work: &mut Vec<QueryWork>) {
        let rays = columns_of(generation);
        let slots = generation.slots();
        self.groups.clear();
        let mut first = 0;
        while first < slots.len() {
            let range = first..first + places.group(slots, first);
            first = range.end;
            let class = places.class(slots[range.start]);
            self.groups.push(Group { range, class });
        }
        let are_shadow = matches!(places, Places::Occluded(..));
        let Self { hierarchy, scratch, groups, .. } = self;
        match places {
            Places::Hits(hits) => hierarchy.nearest_bundle(&rays, groups, hits, scratch),
            Places::Occluded(occluded, _) => hierarchy.occluded_bundle(&rays, groups, occluded, scratch),
        }
        for i in 0..self.groups.len() {
            let Group { range, class } = &self.groups[i];
            let kind = if are_shadow { RayKind::Shadow } else { slots[range.start].kind() };
            self.count(*class, kind);
        }
        self.stats.work.boxes_tested = self.scratch.single.steps.nodes * self.hierarchy.lanes() as u64;
        self.stats.work.primitive_tests = self.scratch.single.primitive_tests;
        if let Some(parts) = &mut self.scratch.parts {
            let before = work.len();
            work.resize(before + generation.len(), QueryWork::default());
            for PartOfList { range, spent: Spent { nodes, primitive_tests } } in parts.drain(..) {
                let boxes_tested = nodes * self.hierarchy.lanes() as u64;
                record(&mut work[before..][range], Work { boxes_tested, primitive_tests, ..Work::default() });
            }
        }
    }
}

/// Adds work to that of some rays, evenly; what is left over goes to the first.
fn record(column: &mut [QueryWork], work: Work) {
    let n = column.len() as u64;
    for (place, query) in (0..).zip(column) {
        let mut share = work;
        for (_, count) in share.counts_mut() {
            *count = *count / n + u64::from(place < *count % n);
        }
        query.work += share;
    }
}

/// Where the answers of a generation go.
enum Places<'a> {
    Hits(&'a mut [HitOrNone]),
    /// And the light of each ray.
    Occluded(&'a mut [bool], &'a [LightId]),
}

impl Places<'_> {
    /// How many rays from `first` on correspond: those of a slot, and of a light.
    fn group(&self, slots: &[Slot], first: usize) -> usize {
        let n = run_len(&slots[first..]);
        match self {
            Self::Hits(_) => n,
            Self::Occluded(_, lights) => run_len(&lights[first..first + n]),
        }
    }

    /// The class of the rays of a slot.
    fn class(&self, slot: Slot) -> usize {
        let class = slot.0 as usize % CLASSES;
        match self {
            Self::Hits(_) => class,
            Self::Occluded(..) => CLASSES + class,
        }
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
        let mut hits = std::mem::take(&mut self.hits);
        hits.resize(generation.len(), HitOrNone::NONE);
        self.answer(generation, Places::Hits(&mut hits), &mut answers.work);
        extend_with_objects(&mut answers.values, self.objects, &hits);
        self.hits = hits;
    }

    fn occluded_bundle(&mut self, generation: &ShadowGeneration, answers: &mut Answers<bool>) {
        let rays = generation.rays();
        let first = answers.values.len();
        answers.values.resize(first + rays.len(), false);
        let places = Places::Occluded(&mut answers.values[first..], generation.lights());
        self.answer(rays, places, &mut answers.work);
    }
}
