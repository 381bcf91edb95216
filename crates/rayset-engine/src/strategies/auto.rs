//! Whichever way is fast: chosen by what the scene holds and by counters, never by a clock.
//!
//! All ways share one hierarchy, which single rays and bundles both go through, so nothing is built twice. Rays are given
//! to `bundle`, which finds out by itself whether shafts pay; where it has found that they do not, for the rays of a kind
//! and depth, those go to `hierarchical` for a while, which spends nothing on finding out. Among one or two spheres all
//! rays do.

use rayset_scene::Scene;
use rayset_simd::Backend;

use super::bundle::{Bundle, BundleTracer};
use super::hierarchical::HierarchicalTracer;
use crate::query::run_len;
use crate::{
    Answers, ByKind, Generation, Hit, IntersectionStrategy, PixelOrder, RayKind, RayQuery, Recording,
    ShadowGeneration, ShadowQuery, StageCounts, Stats, Tracer,
};

/// Traces rays in bundles where that pays, and one by one elsewhere.
#[derive(Debug)]
pub struct Auto<'s> {
    bundle: Bundle<'s>,
}

impl<'s> Auto<'s> {
    /// Builds the hierarchy of a scene, on the lanes of [`Backend::active`].
    #[must_use]
    pub fn new(scene: &'s Scene) -> Self {
        Self::on(scene, Backend::active())
    }

    /// Builds the hierarchy of a scene, on the lanes of a backend.
    #[must_use]
    pub fn on(scene: &'s Scene, backend: Backend) -> Self {
        Self { bundle: Bundle::on(scene, backend) }
    }
}

impl IntersectionStrategy for Auto<'_> {
    fn name(&self) -> &'static str {
        "auto"
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn scene(&self) -> &Scene {
        self.bundle.scene()
    }

    fn preferred_bundle_len(&self) -> usize {
        self.bundle.preferred_bundle_len()
    }

    fn preferred_order(&self) -> PixelOrder {
        self.bundle.preferred_order()
    }

    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_> {
        let (hierarchy, objects) = self.bundle.parts();
        if !hierarchy.suits_bundles() {
            return Box::new(HierarchicalTracer::new(hierarchy, objects, recording));
        }
        Box::new(AutoTracer {
            bundle: BundleTracer::new(hierarchy, objects, recording),
            single: HierarchicalTracer::new(hierarchy, objects, recording),
            choices: [Choice::default(); 2 * DEPTHS],
            alone: ByKind::default(),
            stats: Stats::default(),
        })
    }
}

/// Depths that are told apart: rays of greater depth share the last.
const DEPTHS: usize = 8;
/// Rays in bundles are worth it if at least one in so many is answered under a shaft.
const WORTH: u64 = 12;
/// After how many generations at most bundles are tried again.
const LONGEST_WAIT: u32 = 8;

/// How the rays of a kind and depth are traced.
#[derive(Clone, Copy, Debug, Default)]
struct Choice {
    /// How many generations go one by one.
    wait: u32,
    /// How many will, after the next that was not worth it.
    next_wait: u32,
}

impl Choice {
    /// Whether the next generation is traced in bundles.
    fn is_bundled(&mut self) -> bool {
        let is_bundled = self.wait == 0;
        self.wait = self.wait.saturating_sub(1);
        is_bundled
    }

    /// Takes in how the rays of a generation fared in bundles, by [`BundleTracer::fared`] before and after.
    fn end(&mut self, before: (u64, u64), after: (u64, u64)) {
        let (together, alone) = (after.0 - before.0, after.1 - before.1);
        if WORTH * together >= together + alone {
            self.next_wait = 0;
        } else {
            self.next_wait = (2 * self.next_wait).clamp(1, LONGEST_WAIT);
            self.wait = self.next_wait;
        }
    }
}

struct AutoTracer<'s> {
    bundle: BundleTracer<'s>,
    single: HierarchicalTracer<'s>,
    /// By depth, for rays that ask for the nearest hit; then for shadow rays.
    choices: [Choice; 2 * DEPTHS],
    /// Rays that were not given to bundles.
    alone: ByKind<StageCounts>,
    stats: Stats,
}

impl AutoTracer<'_> {
    /// Whether a generation is traced in bundles, and whose choice that is; all its rays have one depth.
    fn choose(&mut self, rays: &Generation, kind: usize) -> (bool, usize) {
        let depth = rays.slots().first().map_or(1, |slot| slot.depth() as usize);
        let choice = kind * DEPTHS + (depth - 1).min(DEPTHS - 1);
        (self.choices[choice].is_bundled(), choice)
    }

    /// Both tracers' counts.
    fn sum_up(&mut self) {
        let (bundle, single) = (self.bundle.stats(), self.single.stats());
        self.stats.work = bundle.work;
        self.stats.work += single.work;
        self.stats.stages = bundle.stages;
        self.stats.stages += self.alone;
    }

    /// Counts rays that went one by one.
    fn count_alone(&mut self, rays: &Generation, kind: Option<RayKind>) {
        let mut slots = rays.slots();
        while let Some(slot) = slots.first() {
            let n = if kind.is_some() { slots.len() } else { run_len(slots) };
            self.alone[kind.unwrap_or(slot.kind())].alone += n as u64;
            slots = &slots[n..];
        }
    }
}

impl Tracer for AutoTracer<'_> {
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
        let hit = self.single.nearest(query);
        self.sum_up();
        hit
    }

    fn occluded(&mut self, query: &ShadowQuery) -> bool {
        let occluded = self.single.occluded(query);
        self.sum_up();
        occluded
    }

    fn stats(&self) -> &Stats {
        &self.stats
    }

    fn recording(&self) -> Recording {
        self.bundle.recording()
    }

    fn nearest_bundle(&mut self, generation: &Generation, answers: &mut Answers<Option<Hit>>) {
        let (is_bundled, choice) = self.choose(generation, 0);
        if is_bundled {
            let before = self.bundle.fared();
            self.bundle.nearest_bundle(generation, answers);
            self.choices[choice].end(before, self.bundle.fared());
        } else {
            self.single.nearest_bundle(generation, answers);
            self.count_alone(generation, None);
        }
        self.sum_up();
    }

    fn occluded_bundle(&mut self, generation: &ShadowGeneration, answers: &mut Answers<bool>) {
        let (is_bundled, choice) = self.choose(generation.rays(), 1);
        if is_bundled {
            let before = self.bundle.fared();
            self.bundle.occluded_bundle(generation, answers);
            self.choices[choice].end(before, self.bundle.fared());
        } else {
            self.single.occluded_bundle(generation, answers);
            self.count_alone(generation.rays(), Some(RayKind::Shadow));
        }
        self.sum_up();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bundles_that_are_not_worth_it_are_tried_less_and_less() {
        let mut choice = Choice::default();
        let mut tried = Vec::new();
        for generation in 0..60 {
            if choice.is_bundled() {
                tried.push(generation);
                choice.end((0, 0), (0, 100));
            }
        }
        assert_eq!(tried, [0, 2, 5, 10, 19, 28, 37, 46, 55]);
        // Once they are worth it, every generation is traced in bundles.
        choice = Choice { wait: 0, next_wait: 8 };
        for _ in 0..10 {
            assert!(choice.is_bundled());
            choice.end((0, 0), (90, 10));
        }
    }
}
