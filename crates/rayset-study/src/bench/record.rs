//! The rays of a Whitted tree, list by list, as the engine asks for them.

use std::fmt;

use rayset_engine::{
    Answers, Generation, Hit, IntersectionStrategy, PixelOrder, RayKind, RayQuery, RaySetIndex, RaySets,
    ShadowGeneration, ShadowQuery, Slot, Stats, Tracer, TreeOptions,
};

use super::View;

/// The greatest depth of the trees; the initial ray has depth 1.
const DEPTH: u32 = 3;

/// The rows of a band, which is a sweep.
const BAND: u32 = 32;

/// The order of pixels: that of the default strategy.
const ORDER: PixelOrder = PixelOrder::Morton(BAND);

/// How many pixels a bundle has: a tile of 16 x 16 of them.
const BUNDLE: u32 = 256;

/// The rays of one kind at one depth; a light ray has the depth of the ray that hit the point it leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Pass {
    /// The kind.
    pub kind: RayKind,
    /// The depth, from 1.
    pub depth: u32,
}

impl Pass {
    /// All lists of a tree, in the order of reports.
    pub const ALL: [Self; 8] = [
        Self { kind: RayKind::Initial, depth: 1 },
        Self { kind: RayKind::Shadow, depth: 1 },
        Self { kind: RayKind::Reflected, depth: 2 },
        Self { kind: RayKind::Refracted, depth: 2 },
        Self { kind: RayKind::Shadow, depth: 2 },
        Self { kind: RayKind::Reflected, depth: 3 },
        Self { kind: RayKind::Refracted, depth: 3 },
        Self { kind: RayKind::Shadow, depth: 3 },
    ];

    fn of(slot: Slot) -> Self {
        Self { kind: slot.kind(), depth: slot.depth() }
    }

    fn index(self) -> usize {
        Self::ALL.iter().position(|pass| *pass == self).expect("a tree of this depth has no other rays")
    }
}

impl fmt::Display for Pass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.kind.name(), self.depth)
    }
}

/// All rays of a view, and what they hit.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The lists that have rays, in the order of [`Pass::ALL`].
    pub passes: Vec<RecordedPass>,
}

/// A list of rays.
#[derive(Clone, Debug)]
pub struct RecordedPass {
    /// Which.
    pub pass: Pass,
    /// Its sweeps, bands of tiles from the top, each in parts.
    pub sweeps: Vec<Vec<RecordedPart>>,
}

/// How many rays a part of a sweep holds, or a bundle more: so few that they stay in the second cache of a core, where
/// rays are that were just made.
const PART: usize = 4096;

/// Rays of a list in one sweep, bundle by bundle, each with its answers.
#[derive(Clone, Debug)]
pub enum RecordedPart {
    /// Rays that ask for the nearest hit.
    Nearest(Vec<(Generation, Vec<Option<Hit>>)>),
    /// Rays that ask whether anything is between.
    Shadow(Vec<(ShadowGeneration, Vec<bool>)>),
}

impl RecordedPart {
    /// How many rays there are.
    #[must_use]
    pub fn rays(&self) -> usize {
        match self {
            Self::Nearest(bundles) => bundles.iter().map(|(rays, _)| rays.len()).sum(),
            Self::Shadow(bundles) => bundles.iter().map(|(rays, _)| rays.len()).sum(),
        }
    }

    /// How many of them hit, or are blocked.
    #[must_use]
    pub fn hits(&self) -> usize {
        match self {
            Self::Nearest(bundles) => bundles.iter().map(|(_, hits)| hits.iter().flatten().count()).sum(),
            Self::Shadow(bundles) => {
                bundles.iter().map(|(_, blocked)| blocked.iter().filter(|blocked| **blocked).count()).sum()
            }
        }
    }
}

impl RecordedPass {
    /// How many rays there are.
    #[must_use]
    pub fn rays(&self) -> u64 {
        self.sweeps.iter().flatten().map(|part| part.rays() as u64).sum()
    }

    /// How many of them hit, or are blocked.
    #[must_use]
    pub fn hits(&self) -> u64 {
        self.sweeps.iter().flatten().map(|part| part.hits() as u64).sum()
    }
}

impl Recording {
    /// Grows the trees of a view with a strategy and keeps every ray and answer: pixels come along Morton curves, a bundle is a
    /// tile of 16 x 16 of them, a sweep is a band of 32 rows. Nothing is cut off but by depth.
    #[must_use]
    pub fn of(strategy: &dyn IntersectionStrategy, view: &View) -> Self {
        let scene = strategy.scene();
        let options = TreeOptions { max_depth: DEPTH, cutoff: None };
        let crop = view.crop();
        let mut passes = Pass::ALL.map(|pass| RecordedPass { pass, sweeps: Vec::new() });
        let mut ray_sets = RaySets::default();
        let mut first = RaySetIndex(0);
        let mut pixels = Vec::new();
        for top in (0..crop.height).step_by(BAND as usize) {
            let mut recorder = Recorder {
                inner: strategy.begin_sweep(rayset_engine::Recording::Off),
                sweeps: Default::default(),
            };
            pixels.clear();
            ORDER.extend_with_pixels(&mut pixels, crop.width, top..(top + BAND).min(crop.height));
            for tile in pixels.chunks(BUNDLE as usize) {
                let rays = tile.iter().map(|&(x, y)| {
                    let place = |pixel: u32, first: u32| f64::from(first + pixel) + 0.5;
                    scene.camera().ray(place(x, crop.x), place(y, crop.y), view.image, view.image)
                });
                ray_sets.grow(scene, &mut recorder, first, rays, &options);
                first.0 += BUNDLE;
            }
            for (pass, sweep) in passes.iter_mut().zip(recorder.sweeps) {
                if !sweep.is_empty() {
                    pass.sweeps.push(sweep);
                }
            }
        }
        Self { passes: passes.into_iter().filter(|pass| !pass.sweeps.is_empty()).collect() }
    }
}

/// Answers as another tracer does, and keeps rays and answers.
struct Recorder<'s> {
    inner: Box<dyn Tracer + 's>,
    /// By [`Pass::index`].
    sweeps: [Vec<RecordedPart>; Pass::ALL.len()],
}

/// The part of a sweep that the next bundle goes to: another, where the last one is full.
fn part_of(sweep: &mut Vec<RecordedPart>, empty: RecordedPart) -> Option<&mut RecordedPart> {
    if sweep.last().is_none_or(|part| part.rays() >= PART) {
        sweep.push(empty);
    }
    sweep.last_mut()
}

impl Tracer for Recorder<'_> {
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
        self.inner.nearest(query)
    }

    fn occluded(&mut self, query: &ShadowQuery) -> bool {
        self.inner.occluded(query)
    }

    fn stats(&self) -> &Stats {
        self.inner.stats()
    }

    fn recording(&self) -> rayset_engine::Recording {
        self.inner.recording()
    }

    fn nearest_bundle(&mut self, generation: &Generation, answers: &mut Answers<Option<Hit>>) {
        let before = answers.values.len();
        self.inner.nearest_bundle(generation, answers);
        let mut bundles: [(Generation, Vec<Option<Hit>>); Pass::ALL.len()] = Default::default();
        for (i, hit) in answers.values[before..].iter().enumerate() {
            let (rays, hits) = &mut bundles[Pass::of(generation.slots()[i]).index()];
            rays.push(&generation.query(i));
            hits.push(*hit);
        }
        for (sweep, bundle) in self.sweeps.iter_mut().zip(bundles) {
            if !bundle.0.is_empty()
                && let Some(RecordedPart::Nearest(bundles)) =
                    part_of(sweep, RecordedPart::Nearest(Vec::new()))
            {
                bundles.push(bundle);
            }
        }
    }

    fn occluded_bundle(&mut self, generation: &ShadowGeneration, answers: &mut Answers<bool>) {
        let before = answers.values.len();
        self.inner.occluded_bundle(generation, answers);
        let Some(slot) = generation.rays().slots().first() else { return };
        let pass = Pass { kind: RayKind::Shadow, depth: slot.depth() };
        let sweep = &mut self.sweeps[pass.index()];
        if let Some(RecordedPart::Shadow(bundles)) = part_of(sweep, RecordedPart::Shadow(Vec::new())) {
            bundles.push((generation.clone(), answers.values[before..].to_vec()));
        }
    }
}

#[cfg(test)]
mod tests {
    use rayset_engine::{Hierarchical, RenderOptions, Standard, render};
    use rayset_scene::RandomSpheres;

    use super::*;

    #[test]
    fn the_rays_are_those_of_the_image() {
        let scene = RandomSpheres { count: 4, ..RandomSpheres::default() }.scene().unwrap();
        let view = View { image: 40, side: 40 };
        let recording = Recording::of(&Hierarchical::new(&scene), &view);
        let options = RenderOptions {
            width: 40,
            height: 40,
            max_depth: DEPTH,
            cutoff: None,
            order: Some(ORDER),
            ..RenderOptions::default()
        };
        let counts = render(&Standard::new(&scene), &options).unwrap().counts;
        for kind in RayKind::ALL {
            let of_kind = || recording.passes.iter().filter(|pass| pass.pass.kind == kind);
            let rays: u64 = of_kind().map(RecordedPass::rays).sum();
            let hits: u64 = of_kind().map(RecordedPass::hits).sum();
            assert_eq!((rays, hits), (counts[kind].cast, counts[kind].hit), "{kind:?}");
        }
        assert!(recording.passes.iter().all(|pass| pass.sweeps.len() <= 3));
    }
}
