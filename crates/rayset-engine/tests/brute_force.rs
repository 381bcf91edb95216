//! Every answer against a loop over all primitives, one at a time: no volumes, no partition, no lanes.

mod pixels;
mod scenes;

use std::sync::Mutex;

use pixels::assert_same_pixels;
use rayset_engine::geometry::{Ray, Span};
use rayset_engine::scene::{ObjectId, Part, PrimitiveId, Scene};
use rayset_engine::{
    Answers, Backend, ByKind, EyeRays, Generation, Hit, IntersectionStrategy, Layers, Originating,
    PixelOrder, RayKind, RayQuery, Recording, RenderOptions, ShadowGeneration, ShadowQuery, Speer1985,
    Speer1985Options, Standard, Stats, StrategyKind, SweepLength, Tracer, render,
};
use scenes::TestScene;

const OPTIONS: RenderOptions = RenderOptions {
    width: 37,
    height: 31,
    max_depth: 5,
    cutoff: Some(1.0 / 256.0),
    order: Some(PixelOrder::Scanline),
    sweep: SweepLength::WholeImage,
    bundle_len: Some(16),
    layers: Layers::BEAUTY,
    eye_rays: EyeRays::Centers { samples: 1 },
    crop: None,
};

/// A strategy from outside the crate: tests every primitive.
struct BruteForce<'s> {
    scene: &'s Scene,
    primitives: &'s [(ObjectId, Part)],
}

impl BruteForce<'_> {
    /// All hits, in the order of the primitives' ids.
    fn hits(&self, ray: &Ray, span: Span, originating: Option<Originating>) -> impl Iterator<Item = Hit> {
        self.primitives.iter().zip(0..).filter_map(move |((object, part), id)| {
            let primitive = PrimitiveId(id);
            let left = originating.filter(|o| o.primitive == primitive).map(|o| o.side);
            let t = part.primitive.intersect(ray, span, part.sides, left)?;
            Some(Hit { t, object: *object, primitive })
        })
    }

    fn nearest(&self, query: &RayQuery) -> Option<Hit> {
        let key = |hit: &Hit| (hit.object, hit.primitive);
        self.hits(&query.ray, query.span, query.originating)
            .min_by(|a, b| a.t.total_cmp(&b.t).then(key(a).cmp(&key(b))))
    }

    fn occluded(&self, query: &ShadowQuery) -> bool {
        self.hits(&query.ray, query.span, Some(query.originating)).next().is_some()
    }
}

impl IntersectionStrategy for BruteForce<'_> {
    fn name(&self) -> &'static str {
        "brute-force"
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn scene(&self) -> &Scene {
        self.scene
    }

    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_> {
        Box::new(BruteForceTracer { strategy: self, recording, stats: Stats::default() })
    }
}

struct BruteForceTracer<'s> {
    strategy: &'s BruteForce<'s>,
    recording: Recording,
    stats: Stats,
}

impl Tracer for BruteForceTracer<'_> {
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
        self.strategy.nearest(query)
    }

    fn occluded(&mut self, query: &ShadowQuery) -> bool {
        self.strategy.occluded(query)
    }

    fn stats(&self) -> &Stats {
        &self.stats
    }

    fn recording(&self) -> Recording {
        self.recording
    }
}

/// What watching a strategy found.
#[derive(Default)]
struct Findings {
    answers: ByKind<u64>,
    wrong: ByKind<u64>,
    first: Option<String>,
}

/// Passes a strategy's answers on, and compares each with brute force.
struct Watched<'s> {
    inner: Box<dyn IntersectionStrategy + 's>,
    truth: BruteForce<'s>,
    findings: Mutex<Findings>,
}

impl<'s> Watched<'s> {
    fn new(inner: Box<dyn IntersectionStrategy + 's>, test: &'s TestScene) -> Self {
        let truth = BruteForce { scene: &test.scene, primitives: &test.primitives };
        Self { inner, truth, findings: Mutex::default() }
    }

    fn check<A: PartialEq + std::fmt::Debug>(
        &self,
        kind: RayKind,
        answer: &A,
        truth: &A,
        query: impl std::fmt::Debug,
    ) {
        let mut findings = self.findings.lock().unwrap();
        findings.answers[kind] += 1;
        if answer != truth {
            findings.wrong[kind] += 1;
            findings.first.get_or_insert_with(|| format!("{answer:?}, should be {truth:?}: {query:?}"));
        }
    }
}

impl IntersectionStrategy for Watched<'_> {
    fn name(&self) -> &'static str {
        "watched"
    }

    fn is_exact(&self) -> bool {
        self.inner.is_exact()
    }

    fn scene(&self) -> &Scene {
        self.inner.scene()
    }

    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_> {
        Box::new(WatchedTracer { strategy: self, inner: self.inner.begin_sweep(recording) })
    }
}

struct WatchedTracer<'s> {
    strategy: &'s Watched<'s>,
    inner: Box<dyn Tracer + 's>,
}

impl Tracer for WatchedTracer<'_> {
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
        let answer = self.inner.nearest(query);
        self.strategy.check(query.slot.kind(), &answer, &self.strategy.truth.nearest(query), query);
        answer
    }

    fn occluded(&mut self, query: &ShadowQuery) -> bool {
        let answer = self.inner.occluded(query);
        self.strategy.check(RayKind::Shadow, &answer, &self.strategy.truth.occluded(query), query);
        answer
    }

    fn stats(&self) -> &Stats {
        self.inner.stats()
    }

    fn recording(&self) -> Recording {
        self.inner.recording()
    }

    fn nearest_bundle(&mut self, generation: &Generation, answers: &mut Answers<Option<Hit>>) {
        self.inner.nearest_bundle(generation, answers);
        for (i, answer) in answers.values.iter().enumerate() {
            let query = generation.query(i);
            self.strategy.check(query.slot.kind(), answer, &self.strategy.truth.nearest(&query), query);
        }
    }

    fn occluded_bundle(&mut self, generation: &ShadowGeneration, answers: &mut Answers<bool>) {
        self.inner.occluded_bundle(generation, answers);
        for (i, answer) in answers.values.iter().enumerate() {
            let query = generation.query(i);
            self.strategy.check(RayKind::Shadow, answer, &self.strategy.truth.occluded(&query), query);
        }
    }
}

#[test]
fn strategy_from_outside_with_two_methods_renders_the_same_image() {
    for test in &scenes::all() {
        let brute_force = BruteForce { scene: &test.scene, primitives: &test.primitives };
        let expected = render(&Standard::new(&test.scene), &OPTIONS).unwrap();
        let actual = render(&brute_force, &OPTIONS).unwrap();
        assert_same_pixels(&expected, &actual, &test.name);
        assert_eq!(expected.counts, actual.counts, "{}", test.name);
    }
}

#[test]
fn every_answer_of_an_exact_strategy_is_that_of_brute_force() {
    for test in &scenes::all() {
        for &kind in StrategyKind::ALL.iter().filter(|kind| kind.bind(&test.scene).is_exact()) {
            for &backend in Backend::available() {
                let watched = Watched::new(kind.bind_on(&test.scene, backend), test);
                let frame = render(&watched, &OPTIONS).unwrap();
                let findings = watched.findings.into_inner().unwrap();
                assert_eq!(findings.first, None, "{kind}, {}, {backend}", test.name);
                for (ray_kind, tally) in frame.counts.iter() {
                    assert_eq!(findings.answers[ray_kind], tally.cast, "{kind}, {}, {ray_kind:?}", test.name);
                }
            }
        }
    }
}

#[test]
fn audit_counts_every_wrong_answer_and_no_other() {
    let options = [Speer1985Options::default(), permissive()];
    let mut total = ByKind::<u64>::default();
    for (test, options) in scenes::all().iter().flat_map(|test| options.map(|options| (test, options))) {
        let options = Speer1985Options { audit: true, ..options };
        let speer = Box::new(Speer1985::on(&test.scene, Backend::active(), options));
        let watched = Watched::new(speer, test);
        let frame = render(&watched, &OPTIONS).unwrap();
        let findings = watched.findings.into_inner().unwrap();
        for (kind, counts) in frame.stats.coherence.iter() {
            assert_eq!(counts.wrong, findings.wrong[kind], "{}, {kind:?} rays, {options:?}", test.name);
        }
        total += findings.wrong;
    }
    // Else nothing was tested.
    assert!(total.iter().all(|(_, wrong)| *wrong > 0), "{total:?}");
}

/// The reading that makes the most rays coherent, and the most of them wrongly.
fn permissive() -> Speer1985Options {
    use rayset_engine::{LightRule, MissRule, SlabRule};
    Speer1985Options {
        misses: MissRule::Cylinder,
        light_rays: LightRule::All,
        slab: SlabRule::Inside,
        ..Speer1985Options::default()
    }
}
