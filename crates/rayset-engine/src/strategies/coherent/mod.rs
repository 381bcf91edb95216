//! Coherence with proof: certificates that hold for whole pencils of rays.
//!
//! The partition of a ray leaves a [`Pencil`](rayset_geometry::Pencil) around it that no volume reaches into, but the
//! one that was hit and a few guests. A corresponding ray of a later ray-set that belongs to the pencil needs no
//! partition: it is tested against those alone. Rays that hit nothing and rays to lights leave such certificates too;
//! a light that was hidden is looked for behind its last blocker first.
//!
//! Source: Speer et al. 1985, section 2.3, with containers that are sound: see `docs/certificates.md`. The last blocker
//! first: Haines, Greenberg 1986, "The light buffer".

mod certificate;
mod condition;
mod credit;
mod question;
mod retained;
mod worker;

use rayset_geometry::{Probe, Ray, Span};
use rayset_scene::{LightId, Scene};
use rayset_simd::{Backend, Kernel, Simd};

#[cfg(feature = "mutations")]
pub use self::condition::Condition;
use self::condition::Omitted;
use self::question::{Hidden, Nearest};
use self::retained::Slots;
use self::worker::{Asked, Budget, Worker};
use super::standard::Standard;
use crate::query::Columns;
use crate::strategy::Before;
use crate::{
    Answers, Generation, Hit, IntersectionStrategy, Originating, RayKind, RayQuery, Recording,
    ShadowGeneration, ShadowQuery, Slot, Stats, Tracer,
};

/// In smaller scenes nothing is certified: squares of distances that underflow are off by up to 2^-537 as distances, which
/// is far below the margin of a certificate only if that is above 2^-524.
const LEAST_EXTENT: f64 = f64::from_bits((1023 - 480) << 52);

/// In scenes of fewer volumes a partition takes no longer than finding out, in small images, that no certificate serves.
const LEAST_VOLUMES: usize = 5;

/// Retained certificates, exact.
#[derive(Debug)]
pub struct Coherent<'s> {
    standard: Standard<'s>,
    scene: &'s Scene,
    backend: Backend,
    is_unlimited: bool,
    omitted: Omitted,
}

impl<'s> Coherent<'s> {
    /// Binds the strategy to a scene, on the lanes of [`Backend::active`].
    #[must_use]
    pub fn new(scene: &'s Scene) -> Self {
        Self::on(scene, Backend::active())
    }

    /// Binds the strategy to a scene, on the lanes of a backend.
    #[must_use]
    pub fn on(scene: &'s Scene, backend: Backend) -> Self {
        let standard = Standard::on(scene, backend);
        Self { standard, scene, backend, is_unlimited: false, omitted: Omitted::default() }
    }

    /// The same strategy, trying for coherence in every scene and whatever it costs: so that its proofs can be put to
    /// the test where it would not bother.
    #[must_use]
    pub fn unlimited(self) -> Self {
        Self { is_unlimited: true, ..self }
    }

    /// The same strategy, leaving out a condition of its proofs: its answers will be wrong.
    #[cfg(feature = "mutations")]
    #[must_use]
    pub fn without(self, condition: Condition) -> Self {
        Self { omitted: Omitted { condition: Some(condition) }, ..self }
    }

    /// Whether there are so few volumes that a partition costs no more than checking a certificate.
    fn is_hopeless(&self) -> bool {
        self.scene.volumes().len() < LEAST_VOLUMES
    }
}

impl IntersectionStrategy for Coherent<'_> {
    fn name(&self) -> &'static str {
        "coherent"
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn scene(&self) -> &Scene {
        self.scene
    }

    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_> {
        if self.is_hopeless() && !self.is_unlimited || self.scene.extent() < LEAST_EXTENT {
            return self.standard.begin_sweep(recording);
        }
        let budget = if self.is_unlimited { Budget::UNLIMITED } else { Budget::of(self.scene) };
        Box::new(CoherentTracer {
            backend: self.backend,
            recording,
            worker: Worker::new(self.scene, budget, recording == Recording::PerQuery, self.omitted),
            slots: Slots::default(),
            light_slots: Slots::default(),
        })
    }
}

struct CoherentTracer<'s> {
    backend: Backend,
    recording: Recording,
    worker: Worker<'s>,
    slots: Slots,
    light_slots: Slots,
}

impl Tracer for CoherentTracer<'_> {
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
        let mut hit = None;
        self.find_nearest(query.slot, &query.ray, query.span, query.originating, &mut hit, || *query);
        hit
    }

    fn occluded(&mut self, query: &ShadowQuery) -> bool {
        let originating = Some(query.originating);
        self.is_hidden((query.slot, query.light), &query.ray, query.span, originating, || *query)
    }

    fn stats(&self) -> &Stats {
        &self.worker.stats
    }

    fn recording(&self) -> Recording {
        self.recording
    }

    fn certificate_radius(&self) -> f64 {
        self.worker.certificate_radius
    }

    fn nearest_bundle(&mut self, generation: &Generation, answers: &mut Answers<Option<Hit>>) {
        let columns = Columns::of(generation);
        let first = answers.values.len();
        answers.values.resize(first + generation.len(), None);
        for (i, answer) in answers.values[first..].iter_mut().enumerate() {
            let before = Before::of(self);
            let (ray, span) = (columns.ray(i), columns.span(i));
            self.find_nearest(columns.slots[i], &ray, span, generation.originating(i), answer, || {
                generation.query(i)
            });
            before.record(self, &mut answers.work);
        }
    }

    fn occluded_bundle(&mut self, generation: &ShadowGeneration, answers: &mut Answers<bool>) {
        let columns = Columns::of(generation.rays());
        let lights = &generation.lights()[..generation.len()];
        let first = answers.values.len();
        answers.values.resize(first + generation.len(), false);
        for (i, answer) in answers.values[first..].iter_mut().enumerate() {
            let before = Before::of(self);
            let originating = generation.rays().originating(i);
            let (ray, span) = (columns.ray(i), columns.span(i));
            *answer = self
                .is_hidden((columns.slots[i], lights[i]), &ray, span, originating, || generation.query(i));
            before.record(self, &mut answers.work);
        }
    }
}

/// The state of a slot and a light.
#[inline(always)]
fn light_place(scene: &Scene, slot: Slot, light: LightId) -> u64 {
    u64::from(slot.0) * scene.lights().len() as u64 + u64::from(light.0)
}

/// A ray to a light as certificates see it, and its length.
///
/// Rays to a point light all end there: seen from it they are a pencil without spread.
#[inline(always)]
fn light_axis(scene: &Scene, light: LightId, ray: &Ray, span: Span) -> (Ray, f64) {
    match scene.light(light).position() {
        Some(position) => (Ray::new(position, -ray.direction()), span.end + span.start),
        None => (*ray, f64::INFINITY),
    }
}

impl CoherentTracer<'_> {
    /// The way of a coherent ray is short and takes no lanes; all else is a call, which alone needs the whole query.
    ///
    /// The answer is written where it belongs, so that it passes through no other memory.
    #[inline(always)]
    fn find_nearest(
        &mut self,
        slot: Slot,
        ray: &Ray,
        span: Span,
        originating: Option<Originating>,
        answer: &mut Option<Hit>,
        query: impl FnOnce() -> RayQuery,
    ) {
        let state = self.slots.at(u64::from(slot.0));
        let asked = Asked { axis: ray, ray, span, originating };
        let mut question = Nearest::default();
        match self.worker.serve(state, slot.kind(), &asked, &mut question) {
            None => *answer = question.hit,
            Some(first) => self.find_nearest_beyond(first, &query(), question.hit, answer),
        }
    }

    /// As [`CoherentTracer::find_nearest`].
    #[inline(always)]
    fn is_hidden(
        &mut self,
        (slot, light): (Slot, LightId),
        ray: &Ray,
        span: Span,
        originating: Option<Originating>,
        query: impl FnOnce() -> ShadowQuery,
    ) -> bool {
        let worker = &mut self.worker;
        let state = self.light_slots.at(light_place(worker.scene, slot, light));
        let (axis, length) = light_axis(worker.scene, light, ray, span);
        let asked = Asked { axis: &axis, ray, span, originating };
        if state.was_blocked && worker.is_still_blocked(state, &asked) {
            return true;
        }
        let mut question = Hidden { length, blocker: None };
        match worker.serve(state, RayKind::Shadow, &asked, &mut question) {
            None if question.blocker.is_none() => false,
            None => {
                state.blocker = question.blocker;
                true
            }
            Some(first) => self.is_hidden_beyond(first, &query()),
        }
    }

    /// What the certificate that served last does not answer; `least` is the least hit that its volumes gave.
    #[inline(never)]
    fn find_nearest_beyond(
        &mut self,
        first: usize,
        query: &RayQuery,
        least: Option<Hit>,
        answer: &mut Option<Hit>,
    ) {
        *answer = self.backend.run(NearestBeyond { tracer: self, first, query, least });
    }

    /// As [`CoherentTracer::find_nearest_beyond`].
    #[inline(never)]
    fn is_hidden_beyond(&mut self, first: usize, query: &ShadowQuery) -> bool {
        self.backend.run(HiddenBeyond { tracer: self, first, query })
    }
}

struct NearestBeyond<'a, 's> {
    tracer: &'a mut CoherentTracer<'s>,
    first: usize,
    query: &'a RayQuery,
    least: Option<Hit>,
}

impl Kernel for NearestBeyond<'_, '_> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<Hit> {
        let (worker, mut question) = (&mut self.tracer.worker, Nearest { hit: self.least });
        let RayQuery { slot, originating, span, ref ray, .. } = *self.query;
        let probe = Probe::new(simd, ray, span, worker.scene.primitives().is_flat());
        let state = self.tracer.slots.at(u64::from(slot.0));
        let asked = Asked { axis: ray, ray, span, originating };
        if !worker.follow(state, self.first, slot.kind(), &asked, &probe, &mut question) {
            worker.partition(simd, &probe, originating, &mut question);
            worker.learn(simd, state, self.query, question.hit);
        }
        question.hit
    }
}

struct HiddenBeyond<'a, 's> {
    tracer: &'a mut CoherentTracer<'s>,
    first: usize,
    query: &'a ShadowQuery,
}

impl Kernel for HiddenBeyond<'_, '_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        let worker = &mut self.tracer.worker;
        let ShadowQuery { slot, light, originating, span, ref ray, .. } = *self.query;
        let probe = Probe::new(simd, ray, span, worker.scene.primitives().is_flat());
        let (axis, length) = light_axis(worker.scene, light, ray, span);
        let mut question = Hidden { length, blocker: None };
        let state = self.tracer.light_slots.at(light_place(worker.scene, slot, light));
        let asked = Asked { axis: &axis, ray, span, originating: Some(originating) };
        if worker.follow(state, self.first, RayKind::Shadow, &asked, &probe, &mut question) {
            let is_hidden = question.blocker.is_some();
            if is_hidden {
                state.blocker = question.blocker;
            }
            return is_hidden;
        }
        if !state.was_blocked && worker.is_still_blocked(state, &asked) {
            state.was_blocked = true;
            return true;
        }
        worker.partition(simd, &probe, asked.originating, &mut question);
        state.was_blocked = question.blocker.is_some();
        if state.was_blocked {
            state.blocker = question.blocker;
        } else {
            worker.learn_light(simd, state, self.query, &axis, length);
        }
        state.was_blocked
    }
}
