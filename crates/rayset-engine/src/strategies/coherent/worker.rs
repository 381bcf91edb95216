//! What is done for one ray: following a certificate, or a partition and building one.

use rayset_geometry::{ColumnRun, PARTITION_MARGIN, Pencil, Probe, Ray, Side, VolumeSet};
use rayset_scene::{PrimitiveId, Scene, VolumeId};
use rayset_simd::Simd;

use super::certificate::{Builder, Certificate, MAX_GUESTS, Plan, build_cost};
use super::condition::{Condition, Omitted};
use super::credit::Credit;
use super::retained::SlotState;
use crate::strategies::partition::{Partition, departure, first_in, nearest_in};
use crate::{Hit, Originating, RayKind, RayQuery, ShadowQuery, Stats};

/// Everything of a tracer but its slots.
pub(super) struct Worker<'s> {
    pub(super) scene: &'s Scene,
    pub(super) tested: Tested,
    pub(super) stats: Stats,
    /// Of the query answered last.
    pub(super) certificate_radius: f64,
    omitted: Omitted,
    partition: Partition,
    builder: Builder,
    credit: Credit,
}

/// What the ray in hand was tested against already.
#[derive(Debug, Default)]
pub(super) struct Tested {
    volumes: Vec<VolumeId>,
    least: Option<Hit>,
}

impl Tested {
    pub(super) fn clear(&mut self) {
        self.volumes.clear();
        self.least = None;
    }
}

impl<'s> Worker<'s> {
    /// `loan` is what may be spent before anything is earned, in tests.
    pub(super) fn new(scene: &'s Scene, loan: u64, omitted: Omitted) -> Self {
        Self {
            scene,
            tested: Tested { volumes: Vec::with_capacity(4 * MAX_GUESTS), least: None },
            stats: Stats::default(),
            certificate_radius: 0.0,
            partition: Partition::default(),
            omitted,
            builder: Builder::new(omitted),
            credit: Credit::new(loan),
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

    /// Tries to answer a ray by the certificates of its slot.
    #[inline(always)]
    pub(super) fn follow<S: Simd>(
        &mut self,
        state: &mut SlotState,
        kind: RayKind,
        probe: &Probe<S>,
        originating: Option<Originating>,
    ) -> Option<Option<Hit>> {
        if state.ways.is_empty() {
            return None;
        }
        self.stats.coherence[kind].guided += 1;
        for way in 0..state.ways.len() {
            if !self.check(&state.ways[way], probe.ray(), originating) {
                continue;
            }
            let certificate = &state.ways[way];
            let mut is_tested = true;
            for volume in certificate.volumes(self.omitted) {
                if self.tested.volumes.contains(&volume) {
                    continue;
                }
                if !self.credit.pay(1) {
                    is_tested = self.omitted.is(Condition::AllTested);
                    break;
                }
                self.tested.volumes.push(volume);
                if self.is_met(probe, volume)
                    && let Some(hit) = nearest_in(
                        self.scene,
                        probe,
                        volume,
                        departure(self.scene, originating),
                        &mut self.stats.work,
                    )
                    && self.tested.least.is_none_or(|least| hit.precedes(&least))
                {
                    self.tested.least = Some(hit);
                }
            }
            let reaches = |t: f64| t <= certificate.pencil.length || self.omitted.is(Condition::HitLength);
            if is_tested && reaches(self.tested.least.map_or(f64::INFINITY, |hit| hit.t)) {
                let hit = self.tested.least;
                self.answered(state, way, kind, hit.map_or(self.scene.extent(), |hit| hit.t));
                return Some(hit);
            }
            self.stats.coherence[kind].predicted_missed += 1;
        }
        None
    }

    /// Tries to answer a ray to a light by the certificates of its slot; `axis` is the ray as they see it.
    #[inline(always)]
    pub(super) fn follow_to_light<S: Simd>(
        &mut self,
        state: &mut SlotState,
        axis: &Ray,
        length: f64,
        probe: &Probe<S>,
        originating: Option<Originating>,
    ) -> Option<bool> {
        if state.ways.is_empty() {
            return None;
        }
        self.stats.coherence.shadow.guided += 1;
        for way in 0..state.ways.len() {
            let is_long_enough =
                length <= state.ways[way].pencil.length || self.omitted.is(Condition::LightLength);
            if !is_long_enough || !self.check(&state.ways[way], axis, originating) {
                continue;
            }
            let mut is_tested = true;
            for volume in state.ways[way].volumes(self.omitted) {
                if self.tested.volumes.contains(&volume) {
                    continue;
                }
                if !self.credit.pay(1) {
                    is_tested = self.omitted.is(Condition::AllTested);
                    break;
                }
                self.tested.volumes.push(volume);
                if self.is_met(probe, volume)
                    && let Some(blocker) = first_in(
                        self.scene,
                        probe,
                        volume,
                        departure(self.scene, originating),
                        &mut self.stats.work,
                    )
                {
                    state.blocker = Some(blocker);
                    self.answered(state, way, RayKind::Shadow, length.min(self.scene.extent()));
                    return Some(true);
                }
            }
            if is_tested {
                self.answered(state, way, RayKind::Shadow, length.min(self.scene.extent()));
                return Some(false);
            }
        }
        None
    }

    /// Whether the primitive that hid the light last hides it again.
    #[inline(always)]
    pub(super) fn is_still_blocked<S: Simd>(
        &mut self,
        state: &SlotState,
        probe: &Probe<S>,
        originating: Option<Originating>,
    ) -> bool {
        let Some(blocker) = &state.blocker else { return false };
        if !self.credit.pay(1) {
            return false;
        }
        let coherence = &mut self.stats.coherence.shadow;
        coherence.guided += 1;
        self.stats.work.primitive_tests += 1;
        let blocks =
            self.scene.primitives().any(probe, blocker, departure(self.scene, originating)).is_some();
        if !blocks && !self.omitted.is(Condition::Blocker) {
            coherence.predicted_missed += 1;
            return false;
        }
        coherence.coherent += 1;
        self.certificate_radius = 0.0;
        let n = self.scene.volumes().len() as u64;
        self.credit.save(n);
        true
    }

    /// Whether a certificate holds for a ray; pays two tests for finding out.
    #[inline(always)]
    fn check(&mut self, certificate: &Certificate, ray: &Ray, originating: Option<Originating>) -> bool {
        if !self.credit.pay(2) {
            return false;
        }
        self.stats.work.pierce_checks += 1;
        let omitted = self.omitted;
        let leaves_it = |excluded: PrimitiveId| {
            omitted.is(Condition::ExcludedIsLeft)
                || originating.is_some_and(|o| o.primitive == excluded && is_left(&o, omitted))
        };
        omitted.pencil_of_rays(&certificate.pencil).contains(ray)
            && certificate.excluded.is_none_or(leaves_it)
    }

    /// Counts a coherent ray and what it saved.
    #[inline(always)]
    fn answered(&mut self, state: &mut SlotState, way: usize, kind: RayKind, reach: f64) {
        let Pencil { spread, divergence, .. } = state.ways[way].pencil;
        self.certificate_radius = spread + divergence * reach;
        self.stats.coherence[kind].coherent += 1;
        let n = self.scene.volumes().len() as u64;
        self.credit.save(n);
        state.serve(way);
    }

    /// The partition, without what the ray was tested against already.
    #[inline(always)]
    pub(super) fn partition<S: Simd>(
        &mut self,
        simd: S,
        probe: &Probe<S>,
        originating: Option<Originating>,
    ) -> Option<Hit> {
        let work = &mut self.stats.work;
        self.partition.of::<S, false>(simd, self.scene, probe, work);
        self.credit.earn(self.scene.volumes().len() as u64);
        let departure = departure(self.scene, originating);
        let mut nearest = self.tested.least;
        for &volume in &self.partition.intersected {
            if !self.tested.volumes.contains(&volume)
                && let Some(hit) = nearest_in(self.scene, probe, volume, departure, work)
                && nearest.is_none_or(|nearest| hit.precedes(&nearest))
            {
                nearest = Some(hit);
            }
        }
        nearest
    }

    /// The partition towards a light, without what the ray was tested against already: the first blocker.
    #[inline(always)]
    pub(super) fn partition_to_light<S: Simd>(
        &mut self,
        simd: S,
        probe: &Probe<S>,
        originating: Option<Originating>,
    ) -> Option<ColumnRun> {
        let work = &mut self.stats.work;
        self.partition.of::<S, false>(simd, self.scene, probe, work);
        self.credit.earn(self.scene.volumes().len() as u64);
        let volumes =
            self.partition.intersected.iter().filter(|volume| !self.tested.volumes.contains(volume));
        let departure = departure(self.scene, originating);
        let mut blocker = None;
        for &volume in volumes {
            blocker = first_in(self.scene, probe, volume, departure, work);
            if blocker.is_some() {
                break;
            }
        }
        blocker
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
        let predicted = self.volume_of(hit);
        state.measure_step(query.ray_set, &query.ray, length, predicted);
        state.note(query.ray_set, &query.ray, length, predicted);
        self.build(simd, state, &query.ray, length, predicted, query.originating);
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
        state.measure_step(query.ray_set, axis, length, None);
        state.note(query.ray_set, axis, length, None);
        self.build(simd, state, axis, length, None, Some(query.originating));
    }

    #[inline(always)]
    fn build<S: Simd>(
        &mut self,
        simd: S,
        state: &mut SlotState,
        axis: &Ray,
        length: f64,
        predicted: Option<VolumeId>,
        originating: Option<Originating>,
    ) {
        self.certificate_radius = 0.0;
        let Some(step) = state.step else { return };
        let cost = build_cost(self.scene);
        if !state.may_build() || !self.credit.pay(cost) {
            return;
        }
        let excluded = originating
            .filter(|left| is_left(left, self.omitted))
            .map(|left| left.primitive)
            .and_then(|primitive| {
                let location = self.scene.location(primitive);
                let is_alone =
                    is_single(self.scene, location.volume) || self.omitted.is(Condition::ExcludedAlone);
                is_alone.then_some((primitive, location.volume))
            });
        let pencil = Pencil { axis: *axis, spread: step.spread, divergence: step.divergence, length };
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

/// Whether a volume holds one primitive.
#[inline(always)]
fn is_single(scene: &Scene, volume: VolumeId) -> bool {
    matches!(scene.volume_runs(volume), [run] if run.range.end - run.range.start == 1)
}

/// Whether a ray cannot meet the primitive it leaves again: see [`Departure`].
#[inline(always)]
fn is_left(originating: &Originating, omitted: Omitted) -> bool {
    originating.side == Side::Front || omitted.is(Condition::ExcludedFront)
}
