//! What is done for one ray: following a certificate, or a partition and building one.

use rayset_geometry::{ColumnRun, PARTITION_MARGIN, Pencil, Probe, Ray, Span, VolumeSet};
use rayset_scene::{Scene, VolumeId};
use rayset_simd::{Scalar, Simd};

use super::certificate::{Builder, MAX_VOLUMES, Plan, build_cost, is_left, is_single};
use super::condition::{Condition, Omitted};
use super::credit::Credit;
use super::question::Question;
use super::retained::{Blocker, Last, Learns, N_WAYS, Prices, SlotState};
use crate::strategies::partition::{Partition, departure};
use crate::{Hit, Originating, RayKind, RayQuery, ShadowQuery, Stats};

/// What checking a certificate costs, in tests.
const CHECK: u64 = 2;

/// How many certificates a sweep may build before it has earned anything.
const LOAN: u64 = 3;

/// The most that [`Worker::serve`] spends, in tests.
const MOST_TO_SERVE: u64 = CHECK + MAX_VOLUMES as u64;

/// A ray as its certificates see it, and as it is tested.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked<'a> {
    pub(super) axis: &'a Ray,
    pub(super) ray: &'a Ray,
    pub(super) span: Span,
    pub(super) originating: Option<Originating>,
}

/// Everything of a tracer but its slots.
pub(super) struct Worker<'s> {
    pub(super) scene: &'s Scene,
    pub(super) stats: Stats,
    /// Of the query answered last, if it is recorded.
    pub(super) certificate_radius: f64,
    is_recording: bool,
    omitted: Omitted,
    /// The volumes that the ray in hand was tested against already.
    tested: Vec<VolumeId>,
    partition: Partition,
    builder: Builder,
    credit: Credit,
    /// Of the scene: the tests of a partition.
    n_volumes: u64,
    prices: Prices,
}

/// What a sweep may spend.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    /// Before anything is earned, in tests.
    pub(super) loan: u64,
    pub(super) prices: Prices,
}

impl Budget {
    /// Enough for a few certificates, and prices as they are.
    pub(super) fn of(scene: &Scene) -> Self {
        Self { loan: LOAN * build_cost(scene), prices: Prices::of(scene.volumes().len()) }
    }

    /// More than any sweep spends.
    pub(super) const UNLIMITED: Self = Self { loan: 1 << 50, prices: Prices::NONE };
}

impl<'s> Worker<'s> {
    pub(super) fn new(scene: &'s Scene, budget: Budget, is_recording: bool, omitted: Omitted) -> Self {
        let n_volumes = scene.volumes().len() as u64;
        Self {
            scene,
            tested: Vec::with_capacity(N_WAYS * MAX_VOLUMES),
            stats: Stats::default(),
            certificate_radius: 0.0,
            is_recording,
            partition: Partition::default(),
            omitted,
            builder: Builder::new(omitted),
            credit: Credit::new(budget.loan),
            n_volumes,
            prices: budget.prices,
        }
    }

    /// The volume that holds what was hit.
    #[inline(always)]
    fn volume_of(&self, hit: Option<Hit>) -> Option<VolumeId> {
        hit.map(|hit| self.scene.location(hit.primitive).volume)
    }

    /// Whether a volume is met; pays one test for finding out.
    ///
    /// A volume of one primitive is tested by that primitive; the contents of others only if the volume is in I, as
    /// `standard` would.
    #[inline(always)]
    fn is_met<S: Simd>(&mut self, probe: &Probe<S>, volume: VolumeId) -> bool {
        if is_single(self.scene, volume) {
            return true;
        }
        self.stats.work.volumes_classified += 1;
        let slack = PARTITION_MARGIN * (probe.ray().origin().abs().max_element() + self.scene.extent());
        let bounds = self.scene.volumes().sphere(volume.index());
        VolumeSet::of(probe.ray(), &bounds, slack) == VolumeSet::Intersected
    }

    /// Tries the certificate that served last, where it asks for spheres alone: the way of most rays.
    ///
    /// `None` if that settles the question; else [`Worker::follow`] is to go on from the rank that is returned.
    #[inline(always)]
    pub(super) fn serve<Q: Question>(
        &mut self,
        state: &mut SlotState,
        kind: RayKind,
        asked: &Asked<'_>,
        question: &mut Q,
    ) -> Option<usize> {
        self.tested.clear();
        let Some(certificate) = state.way(0) else { return Some(0) };
        let Some(spheres) = certificate.spheres() else { return Some(0) };
        if !question.is_covered(certificate, self.omitted) || !self.credit.covers(MOST_TO_SERVE) {
            return Some(0);
        }
        self.stats.coherence[kind].guided += 1;
        self.stats.work.pierce_checks += 1;
        if !certificate.admits(asked.axis, asked.originating, self.omitted) {
            self.credit.spend(CHECK);
            return Some(1);
        }
        let mut n_tests = 0;
        for sphere in spheres {
            n_tests += 1;
            if question.test_sphere(sphere, asked.ray, asked.span, asked.originating) {
                break;
            }
        }
        self.stats.work.primitive_tests += n_tests;
        self.credit.spend(CHECK + n_tests);
        if !question.is_settled(certificate, self.omitted) {
            self.stats.coherence[kind].predicted_missed += 1;
            self.tested.extend_from_slice(certificate.volumes());
            return Some(1);
        }
        self.answered(state, 0, kind, question.reach());
        None
    }

    /// Tries to settle a question by the certificates of a slot, from that of rank `first` on.
    #[inline(always)]
    pub(super) fn follow<S: Simd, Q: Question>(
        &mut self,
        state: &mut SlotState,
        first: usize,
        kind: RayKind,
        asked: &Asked<'_>,
        probe: &Probe<S>,
        question: &mut Q,
    ) -> bool {
        self.stats.coherence[kind].guided += u64::from(first == 0 && state.n_ways() > 0);
        for rank in first..state.n_ways() {
            let Some(certificate) = state.way(rank) else { break };
            if !question.is_covered(certificate, self.omitted) {
                continue;
            }
            if !self.credit.pay(CHECK) {
                break;
            }
            self.stats.work.pierce_checks += 1;
            if !certificate.admits(asked.axis, asked.originating, self.omitted) {
                continue;
            }
            let mut is_settled = false;
            let mut is_tested = true;
            for &volume in certificate.volumes() {
                if self.tested.contains(&volume) {
                    continue;
                }
                if !self.credit.pay(1) {
                    is_tested = self.omitted.is(Condition::AllTested);
                    break;
                }
                self.tested.push(volume);
                if self.is_met(probe, volume) {
                    let departure = departure(self.scene, asked.originating);
                    let work = &mut self.stats.work;
                    is_settled = question.test_volume(self.scene, probe, volume, departure, work);
                    if is_settled {
                        break;
                    }
                }
            }
            if is_settled || is_tested && question.is_settled(certificate, self.omitted) {
                self.answered(state, rank, kind, question.reach());
                return true;
            }
            self.stats.coherence[kind].predicted_missed += u64::from(is_tested);
        }
        false
    }

    /// Whether the primitive that hid the light last hides it again.
    #[inline(always)]
    pub(super) fn is_still_blocked(&mut self, state: &SlotState, asked: &Asked<'_>) -> bool {
        let Some(blocker) = &state.blocker else { return false };
        if !self.credit.pay(1) {
            return false;
        }
        self.stats.work.primitive_tests += 1;
        let blocks = match blocker {
            Blocker::Sphere(sphere) => sphere.hit(asked.ray, asked.span, asked.originating).is_some(),
            Blocker::Run(run) => self.blocks(run, asked),
        };
        let coherence = &mut self.stats.coherence.shadow;
        coherence.guided += 1;
        if !blocks && !self.omitted.is(Condition::Blocker) {
            coherence.predicted_missed += 1;
            return false;
        }
        coherence.coherent += 1;
        self.certificate_radius = 0.0;
        self.credit.save(self.n_volumes);
        true
    }

    /// Whether the primitive of a run hides the light.
    #[inline(never)]
    fn blocks(&self, run: &ColumnRun, asked: &Asked<'_>) -> bool {
        // One lane: it is one primitive.
        let primitives = self.scene.primitives();
        let probe = Probe::new(Scalar, asked.ray, asked.span, primitives.is_flat());
        primitives.any(&probe, run, departure(self.scene, asked.originating)).is_some()
    }

    /// Counts a coherent ray and what it saved.
    #[inline(always)]
    fn answered(&mut self, state: &mut SlotState, rank: usize, kind: RayKind, reach: f64) {
        if self.is_recording
            && let Some(certificate) = state.way(rank)
        {
            let Pencil { spread, divergence, .. } = certificate.pencil;
            self.certificate_radius = spread + divergence * reach.min(self.scene.extent());
        }
        self.stats.coherence[kind].coherent += 1;
        self.credit.save(self.n_volumes);
        state.serve(rank);
    }

    /// The partition, without what the ray was tested against already.
    #[inline(always)]
    pub(super) fn partition<S: Simd, Q: Question>(
        &mut self,
        simd: S,
        probe: &Probe<S>,
        originating: Option<Originating>,
        question: &mut Q,
    ) {
        let work = &mut self.stats.work;
        self.partition.of::<S, false>(simd, self.scene, probe, work);
        self.credit.earn(self.n_volumes);
        let departure = departure(self.scene, originating);
        for &volume in &self.partition.intersected {
            if !self.tested.contains(&volume)
                && question.test_volume(self.scene, probe, volume, departure, work)
            {
                break;
            }
        }
    }

    /// Builds a certificate round a ray that was partitioned, if that may pay.
    #[inline(always)]
    pub(super) fn learn<S: Simd>(
        &mut self,
        simd: S,
        state: &mut SlotState,
        query: &RayQuery,
        hit: Option<Hit>,
    ) {
        let length = hit.map_or(f64::INFINITY, |hit| hit.t);
        let seen = Last { ray_set: query.ray_set, ray: query.ray, length, predicted: self.volume_of(hit) };
        self.build(simd, state, seen, query.originating);
    }

    /// Builds a certificate round an unblocked ray to a light, if that may pay.
    #[inline(always)]
    pub(super) fn learn_light<S: Simd>(
        &mut self,
        simd: S,
        state: &mut SlotState,
        query: &ShadowQuery,
        axis: &Ray,
        length: f64,
    ) {
        let seen = Last { ray_set: query.ray_set, ray: *axis, length, predicted: None };
        self.build(simd, state, seen, Some(query.originating));
    }

    #[inline(always)]
    fn build<S: Simd>(
        &mut self,
        simd: S,
        state: &mut SlotState,
        seen: Last,
        originating: Option<Originating>,
    ) {
        self.certificate_radius = 0.0;
        let cost = build_cost(self.scene);
        if !self.credit.covers(cost) {
            return;
        }
        let learns = state.learns(self.prices);
        if learns == Learns::Nothing {
            return;
        }
        state.measure_step(&seen);
        let Last { ray: axis, length, predicted, .. } = seen;
        state.last = Some(seen);
        let Some(step) = state.step.filter(|_| learns == Learns::All) else { return };
        state.pay_building(self.prices);
        self.credit.spend(cost);
        let excluded = originating
            .filter(|left| is_left(left, self.omitted))
            .map(|left| left.primitive)
            .and_then(|primitive| {
                let location = self.scene.location(primitive);
                let is_alone =
                    is_single(self.scene, location.volume) || self.omitted.is(Condition::ExcludedAlone);
                is_alone.then_some((primitive, location.volume))
            });
        let pencil = Pencil { axis, spread: step.spread, divergence: step.divergence, length };
        let plan = Plan { step: pencil, lengthening: step.lengthening, predicted, excluded };
        let mut n_tested = 0;
        let certificate = self.builder.build(simd, self.scene, &plan, &mut n_tested);
        self.stats.work.radius_comparisons += 2 * n_tested;
        self.credit.refund(cost.saturating_sub(2 * n_tested));
        self.stats.work.cylinders_built += 1;
        if let Some(certificate) = certificate {
            let reach = if length < f64::INFINITY { length } else { self.scene.extent() };
            self.certificate_radius = certificate.pencil.spread + certificate.pencil.divergence * reach;
            let unit = self.scene.extent();
            self.stats.radii.record(self.certificate_radius / unit);
            self.stats.lengths.record(certificate.pencil.length / unit);
            state.keep(certificate);
        }
    }
}
