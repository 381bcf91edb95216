//! Coherence over the hierarchy: the rays of a bundle that correspond are traced in packets under one shaft, and one by
//! one where they part.
//!
//! It is the paper's idea turned round. The cylinder of section 2.3.1 is built round one ray and asked again by each
//! that follows; the shaft is built round all rays of a packet at once, and what it proves, that they miss a box, holds
//! for all of them. Counters decide which rays are worth a shaft, and never a clock.
//!
//! Source: Reshetov, Soupikov and Hurley 2005, "Multi-level ray tracing algorithm".

use rayset_bvh::{BundleScratch, Hierarchy, RayColumns};
use rayset_geometry::Side;
use rayset_scene::Scene;
use rayset_simd::{Backend, Kernel, Lanes, Simd};

use super::hierarchical::{hierarchy_of, hit_of};
use crate::{
    Answers, Generation, Hit, IntersectionStrategy, Originating, QueryWork, RayQuery, Recording,
    ShadowGeneration, ShadowQuery, Stats, Tracer, Work,
};

/// Traces rays in packets through a hierarchy of all primitives.
#[derive(Debug)]
pub struct Bundle<'s> {
    scene: &'s Scene,
    hierarchy: Hierarchy,
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
        Self { scene, hierarchy: hierarchy_of(scene, backend) }
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

    /// A tile of 16 x 16 pixels.
    fn preferred_bundle_len(&self) -> usize {
        256
    }

    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_> {
        Box::new(BundleTracer {
            scene: self.scene,
            hierarchy: &self.hierarchy,
            scratch: self.hierarchy.bundle_scratch(),
            left: Vec::new(),
            members: Vec::new(),
            hits: Vec::new(),
            occluded: Vec::new(),
            recording,
            stats: Stats::default(),
        })
    }
}

struct BundleTracer<'s> {
    scene: &'s Scene,
    hierarchy: &'s Hierarchy,
    scratch: BundleScratch,
    /// What each ray of a generation leaves.
    left: Vec<Option<(u32, Side)>>,
    /// The rays of a generation, corresponding ones together.
    members: Vec<u32>,
    hits: Vec<Option<rayset_bvh::Hit>>,
    occluded: Vec<bool>,
    recording: Recording,
    stats: Stats,
}

fn left(originating: &Originating) -> (u32, Side) {
    (originating.primitive.0, originating.side)
}

fn columns(generation: &Generation) -> RayColumns<'_> {
    let ([ox, oy, oz], [dx, dy, dz]) = (generation.origins(), generation.directions());
    RayColumns { origins: [ox, oy, oz], directions: [dx, dy, dz], spans: generation.spans() }
}

impl BundleTracer<'_> {
    /// Puts corresponding rays together: those of the same key, in increasing order.
    fn arrange<K: Ord>(&mut self, rays: &Generation, key: impl Fn(usize) -> K) {
        let n = rays.len();
        self.left.clear();
        self.left.extend(rays.originating().iter().map(|originating| originating.as_ref().map(left)));
        self.members.clear();
        self.members.extend((0_u32..).take(n));
        if !(1..n).all(|i| key(i - 1) <= key(i)) {
            self.members.sort_unstable_by_key(|&i| (key(i as usize), i));
        }
    }

    /// Takes over what the hierarchy has counted; returns what is new.
    fn count(&mut self, lanes: usize) -> Work {
        let before = self.stats.work;
        self.stats.work.boxes_tested = self.scratch.single.steps.nodes * lanes as u64;
        self.stats.work.primitive_tests = self.scratch.single.primitive_tests;
        self.stats.work - before
    }
}

/// Shares out work evenly; what is left over goes to the first rays.
fn record(column: &mut [QueryWork], members: &[u32], work: Work) {
    let n = members.len() as u64;
    for (place, &i) in (0..).zip(members) {
        let mut share = work;
        for (_, count) in share.counts_mut() {
            *count = *count / n + u64::from(place < *count % n);
        }
        column[i as usize].work = share;
    }
}

struct Nearest<'a, 's> {
    tracer: &'a mut BundleTracer<'s>,
    generation: &'a Generation,
    work: &'a mut Vec<QueryWork>,
}

impl Kernel for Nearest<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { tracer, generation, work } = self;
        let rays = columns(generation);
        let lanes = S::F32::LANES;
        let members = std::mem::take(&mut tracer.members);
        // Packet by packet where their work is asked for.
        let step = if tracer.recording == Recording::Off { members.len().max(1) } else { lanes };
        let slots = generation.slots();
        let first = work.len();
        if tracer.recording == Recording::PerQuery {
            work.resize(first + members.len(), QueryWork::default());
        }
        for members in members.chunk_by(|&a, &b| slots[a as usize] == slots[b as usize]) {
            let slot = slots[members[0] as usize].0 as usize % 32;
            for members in members.chunks(step) {
                let BundleTracer { hierarchy, left, hits, scratch, .. } = &mut *tracer;
                hierarchy.nearest_bundle_on(simd, &rays, left, members, slot, hits, scratch);
                let new = tracer.count(lanes);
                if tracer.recording == Recording::PerQuery {
                    record(&mut work[first..], members, new);
                }
            }
        }
        tracer.members = members;
    }
}

struct Occluded<'a, 's> {
    tracer: &'a mut BundleTracer<'s>,
    generation: &'a Generation,
    work: &'a mut Vec<QueryWork>,
}

impl Kernel for Occluded<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { tracer, generation, work } = self;
        let rays = columns(generation);
        let lanes = S::F32::LANES;
        let members = std::mem::take(&mut tracer.members);
        let step = if tracer.recording == Recording::Off { members.len().max(1) } else { lanes };
        let slots = generation.slots();
        let first = work.len();
        if tracer.recording == Recording::PerQuery {
            work.resize(first + members.len(), QueryWork::default());
        }
        for members in members.chunk_by(|&a, &b| slots[a as usize] == slots[b as usize]) {
            let slot = slots[members[0] as usize].0 as usize % 32;
            for members in members.chunks(step) {
                let BundleTracer { hierarchy, left, occluded, scratch, .. } = &mut *tracer;
                hierarchy.occluded_bundle_on(simd, &rays, left, members, slot + 32, occluded, scratch);
                let new = tracer.count(lanes);
                if tracer.recording == Recording::PerQuery {
                    record(&mut work[first..], members, new);
                }
            }
        }
        tracer.members = members;
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
        self.arrange(generation, |i| generation.slots()[i]);
        self.hits.clear();
        self.hits.resize(generation.len(), None);
        let backend = self.hierarchy.backend();
        backend.run(Nearest { tracer: self, generation, work: &mut answers.work });
        let scene = self.scene;
        answers.values.extend(self.hits.iter().map(|hit| hit.map(|hit| hit_of(scene, hit))));
    }

    fn occluded_bundle(&mut self, generation: &ShadowGeneration, answers: &mut Answers<bool>) {
        let rays = generation.rays();
        self.arrange(rays, |i| (generation.lights()[i], rays.slots()[i]));
        self.occluded.clear();
        self.occluded.resize(generation.len(), false);
        let backend = self.hierarchy.backend();
        backend.run(Occluded { tracer: self, generation: rays, work: &mut answers.work });
        answers.values.extend_from_slice(&self.occluded);
    }
}
