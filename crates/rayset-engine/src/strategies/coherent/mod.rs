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
mod credit;
mod retained;
mod worker;

use rayset_geometry::{Probe, Ray};
use rayset_scene::Scene;
use rayset_simd::{Backend, Simd};

use self::retained::Slots;
use self::worker::Worker;
use super::partition::departure;
use super::standard::Standard;
use crate::strategy::LaneTracer;
use crate::{Hit, IntersectionStrategy, RayQuery, Recording, ShadowQuery, Stats, Tracer};

/// Retained certificates, exact.
#[derive(Debug)]
pub struct Coherent<'s> {
    standard: Standard<'s>,
    scene: &'s Scene,
    backend: Backend,
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
        Self { standard: Standard::on(scene, backend), scene, backend }
    }

    /// Whether there are so few volumes that a partition costs no more than checking a certificate.
    fn is_hopeless(&self) -> bool {
        let least = match self.backend {
            Backend::Scalar => 6,
            _ => 40,
        };
        self.scene.volumes().len() < least
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
        if self.is_hopeless() {
            return self.standard.begin_sweep(recording);
        }
        Box::new(CoherentTracer {
            backend: self.backend,
            recording,
            worker: Worker::new(self.scene),
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

impl LaneTracer for CoherentTracer<'_> {
    #[inline(always)]
    fn nearest_on<S: Simd>(&mut self, simd: S, query: &RayQuery) -> Option<Hit> {
        let (worker, kind) = (&mut self.worker, query.slot.kind());
        let probe = Probe::new(simd, &query.ray, query.span, worker.scene.primitives().is_flat());
        let departure = departure(worker.scene, query.originating);
        let state = self.slots.at(u64::from(query.slot.0));
        worker.tested.clear();
        let hit = match worker.follow(state, kind, &probe, departure, query.originating) {
            Some(hit) => hit,
            None => {
                let hit = worker.partition(simd, &probe, departure);
                worker.learn(simd, state, query, hit);
                hit
            }
        };
        state.note(query.ray_set, &query.ray, hit.map_or(f64::INFINITY, |hit| hit.t), worker.volume_of(hit));
        hit
    }

    #[inline(always)]
    fn occluded_on<S: Simd>(&mut self, simd: S, query: &ShadowQuery) -> bool {
        let worker = &mut self.worker;
        let lights = worker.scene.lights();
        let probe = Probe::new(simd, &query.ray, query.span, worker.scene.primitives().is_flat());
        let departure = departure(worker.scene, Some(query.originating));
        let place = u64::from(query.slot.0) * lights.len() as u64 + u64::from(query.light.0);
        let state = self.light_slots.at(place);
        // Rays to a point light all end there: seen from it they are a pencil without spread.
        let (axis, length) = match lights[query.light.index()].position() {
            Some(position) => (Ray::new(position, -query.ray.direction()), query.span.end + query.span.start),
            None => (query.ray, f64::INFINITY),
        };
        worker.tested.clear();
        if state.was_blocked && worker.is_still_blocked(state, &probe, departure) {
            return true;
        }
        if let Some(blocked) = worker.follow_to_light(state, &axis, length, &probe, departure, query.originating) {
            state.note(query.ray_set, &axis, length, None);
            return blocked;
        }
        if !state.was_blocked && worker.is_still_blocked(state, &probe, departure) {
            state.was_blocked = true;
            return true;
        }
        state.blocker = worker.partition_to_light(simd, &probe, departure).or(state.blocker.take());
        state.was_blocked = worker.is_blocked;
        if !state.was_blocked {
            worker.learn_light(simd, state, query, &axis, length);
            state.note(query.ray_set, &axis, length, None);
        }
        state.was_blocked
    }

    fn lane_stats(&self) -> &Stats {
        &self.worker.stats
    }

    fn lane_recording(&self) -> Recording {
        self.recording
    }

    fn lane_certificate_radius(&self) -> f64 {
        self.worker.certificate_radius
    }

    fn backend(&self) -> Backend {
        self.backend
    }
}
