//! The answers that `coherent` gives without a partition, in every scene and whatever they cost, against a loop over
//! all primitives: a small share of what `cargo xtask prove` does.

mod scenes;

use std::sync::{Mutex, PoisonError};

use rayset_engine::geometry::Sphere;
use rayset_engine::geometry::glam::{DVec3, dvec3};
use rayset_engine::scene::{Camera, Light, Material, PrimitiveId, Scene, SceneBuilder};
use rayset_engine::{
    Backend, ByKind, Coherent, Hit, IntersectionStrategy, PixelOrder, RayKind, RayQuery, Recording,
    RenderOptions, ShadowQuery, Standard, Stats, SweepLength, Tracer, render,
};
use scenes::TestScene;

/// What was found, by kind of ray.
#[derive(Default)]
struct Findings {
    rays: ByKind<u64>,
    accepted: ByKind<u64>,
    first_violation: Option<String>,
}

/// Passes on what `coherent` answers.
struct Watched<'s> {
    inner: Coherent<'s>,
    test: &'s TestScene,
    findings: Mutex<Findings>,
}

impl IntersectionStrategy for Watched<'_> {
    fn name(&self) -> &'static str {
        "watched"
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn scene(&self) -> &Scene {
        &self.test.scene
    }

    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_> {
        let inner = self.inner.begin_sweep(recording);
        Box::new(WatchedTracer { strategy: self, inner, findings: Findings::default() })
    }
}

struct WatchedTracer<'s> {
    strategy: &'s Watched<'s>,
    inner: Box<dyn Tracer + 's>,
    findings: Findings,
}

impl WatchedTracer<'_> {
    fn check<A: PartialEq + std::fmt::Debug>(
        &mut self,
        kind: RayKind,
        before: u64,
        answer: &A,
        query: &impl std::fmt::Debug,
        truth: impl FnOnce(&TestScene) -> A,
    ) {
        self.findings.rays[kind] += 1;
        if self.inner.stats().coherence[kind].coherent == before {
            return;
        }
        self.findings.accepted[kind] += 1;
        let truth = truth(self.strategy.test);
        if *answer != truth {
            let radius = self.inner.certificate_radius();
            self.findings.first_violation.get_or_insert_with(|| {
                format!("{answer:?}, should be {truth:?}; certificate radius {radius:e}: {query:?}")
            });
        }
    }
}

impl Drop for WatchedTracer<'_> {
    fn drop(&mut self) {
        let mut findings = self.strategy.findings.lock().unwrap_or_else(PoisonError::into_inner);
        findings.rays += self.findings.rays;
        findings.accepted += self.findings.accepted;
        let violation = self.findings.first_violation.take();
        findings.first_violation = findings.first_violation.take().or(violation);
    }
}

impl Tracer for WatchedTracer<'_> {
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
        let kind = query.slot.kind();
        let before = self.inner.stats().coherence[kind].coherent;
        let answer = self.inner.nearest(query);
        self.check(kind, before, &answer, query, |test| nearest(test, query));
        answer
    }

    fn occluded(&mut self, query: &ShadowQuery) -> bool {
        let before = self.inner.stats().coherence.shadow.coherent;
        let answer = self.inner.occluded(query);
        self.check(RayKind::Shadow, before, &answer, query, |test| occluded(test, query));
        answer
    }

    fn stats(&self) -> &Stats {
        self.inner.stats()
    }

    fn recording(&self) -> Recording {
        self.inner.recording()
    }
}

/// The least hit of all primitives, in the order of `(t, object, primitive)`.
fn nearest(test: &TestScene, query: &RayQuery) -> Option<Hit> {
    let hits = test.primitives.iter().zip(0..).filter_map(|((object, part), id)| {
        let primitive = PrimitiveId(id);
        let left = query.originating.filter(|o| o.primitive == primitive).map(|o| o.side);
        let t = part.primitive.intersect(&query.ray, query.span, part.sides, left)?;
        Some(Hit { t, object: *object, primitive })
    });
    hits.reduce(|least, hit| if hit.precedes(&least) { hit } else { least })
}

fn occluded(test: &TestScene, query: &ShadowQuery) -> bool {
    test.primitives.iter().zip(0..).any(|((_, part), id)| {
        let left = (query.originating.primitive == PrimitiveId(id)).then_some(query.originating.side);
        part.primitive.intersect(&query.ray, query.span, part.sides, left).is_some()
    })
}

#[test]
fn every_answer_without_a_partition_is_that_of_brute_force() {
    let (mut rays, mut accepted) = (ByKind::<u64>::default(), ByKind::<u64>::default());
    for test in &scenes::all() {
        for &backend in Backend::available() {
            for (order, bundle_len) in [(PixelOrder::Scanline, 64), (PixelOrder::Tiles(8), 1)] {
                let inner = Coherent::on(&test.scene, backend).unlimited();
                let watched = Watched { inner, test, findings: Mutex::default() };
                let options = RenderOptions {
                    width: 311,
                    height: 61,
                    order: Some(order),
                    sweep: SweepLength::Rows(16),
                    bundle_len: Some(bundle_len),
                    ..RenderOptions::default()
                };
                let frame = render(&watched, &options).unwrap();
                let findings = watched.findings.into_inner().unwrap();
                assert_eq!(findings.first_violation, None, "{}, {backend}, {order:?}", test.name);
                for (kind, tally) in frame.counts.iter() {
                    assert_eq!(findings.rays[kind], tally.cast, "{}, {kind:?}", test.name);
                }
                rays += findings.rays;
                accepted += findings.accepted;
            }
        }
    }
    // Else nothing was tested.
    for (kind, rays) in rays.iter() {
        assert!(3 * accepted[kind] > *rays, "of {rays} {} rays only {}", kind.name(), accepted[kind]);
    }
}

#[test]
fn nothing_is_certified_where_squares_underflow() {
    // 2^-480, below which there are no certificates, and 1e-162, at which they would err.
    for (scale, is_certified) in [(1e-140, true), (1e-150, false), (1e-162, false)] {
        let mut builder = SceneBuilder::new();
        let at = scale * dvec3(0.1, 0.0, 0.0);
        builder.camera(Camera::new(5.0 * scale * DVec3::Z, at, DVec3::Y, 30.0).unwrap());
        builder.add_light(Light::point(scale * dvec3(3.0, 4.0, 5.0), DVec3::ONE));
        let mirror = builder.add_material(Material { reflectance: DVec3::splat(0.5), ..Material::default() });
        for i in 0..30 {
            let center = dvec3(f64::from(i % 3), f64::from(i * 7 % 5), f64::from(i % 7)) - DVec3::splat(1.5);
            builder.add_object("ball", mirror, [Sphere::new(0.5 * scale * center, 0.2 * scale)]);
        }
        let scene = builder.build().unwrap();
        let options = RenderOptions { width: 200, height: 60, ..RenderOptions::default() };
        for &backend in Backend::available() {
            let expected = render(&Standard::on(&scene, backend), &options).unwrap();
            let actual = render(&Coherent::on(&scene, backend).unlimited(), &options).unwrap();
            assert_eq!(expected.differing_pixels(&actual), 0, "{scale:e}, {backend}");
            assert_eq!(actual.stats.coherence.total().coherent > 0, is_certified, "{scale:e}, {backend}");
        }
    }
}
