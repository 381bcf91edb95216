//! What is kept of the rays of a slot.

use std::collections::HashMap;

use rayset_geometry::{ColumnRun, Ray};
use rayset_scene::{Scene, VolumeId};

use super::certificate::{Certificate, LoneSphere};
use crate::RaySetIndex;

/// How many certificates a slot keeps: those of the surfaces that take turns along a row.
pub(super) const N_WAYS: usize = 3;

/// If certificates serve fewer rays than this, the step they were built for is taken to be too short.
const SERVED_BY_A_GOOD_STEP: u32 = 4;

/// The ray of a slot that was partitioned last, as a certificate sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Last {
    pub(super) ray_set: RaySetIndex,
    pub(super) ray: Ray,
    /// How far along the ray the answer reaches, in world units.
    pub(super) length: f64,
    /// The volume whose contents were hit.
    pub(super) predicted: Option<VolumeId>,
}

/// How far corresponding rays of one step are apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub(super) spread: f64,
    pub(super) divergence: f64,
    pub(super) lengthening: f64,
}

impl Step {
    fn grown(self) -> Self {
        Self {
            spread: 1.5 * self.spread,
            divergence: 1.5 * self.divergence,
            lengthening: 1.5 * self.lengthening,
        }
    }
}

/// A primitive that hid a light.
#[derive(Clone, Debug)]
pub(super) enum Blocker {
    Sphere(LoneSphere),
    /// Of one primitive.
    Run(ColumnRun),
}

impl Blocker {
    pub(super) fn of_run(scene: &Scene, run: ColumnRun) -> Self {
        LoneSphere::of_run(scene, &run).map_or(Self::Run(run), Self::Sphere)
    }
}

/// The state of a slot, or of a slot and a light.
#[derive(Clone, Debug, Default)]
pub(super) struct SlotState {
    /// The certificates; which of them served last says `order`.
    ways: Vec<Certificate>,
    /// The places of the certificates in `ways`, the one that served last first.
    order: [usize; N_WAYS],
    /// How many rays the certificates have served since one was built last.
    pub(super) n_served: u32,
    pub(super) last: Option<Last>,
    pub(super) step: Option<Step>,
    /// Certificates to be left unbuilt after those that did not serve.
    pub(super) skip: u32,
    /// How many to leave out when the next one does not serve either, as a power of two.
    pub(super) caution: u32,
    /// The primitive that hid the light last.
    pub(super) blocker: Option<Blocker>,
    /// Whether the last light ray was blocked.
    pub(super) was_blocked: bool,
}

impl SlotState {
    /// How many certificates there are.
    #[inline(always)]
    pub(super) fn n_ways(&self) -> usize {
        self.ways.len()
    }

    /// A certificate, by how long it has not served.
    #[inline(always)]
    pub(super) fn way(&self, rank: usize) -> Option<&Certificate> {
        self.ways.get(self.order[rank])
    }

    /// The certificate of a rank has served.
    #[inline(always)]
    pub(super) fn serve(&mut self, rank: usize) {
        if rank > 0 {
            self.order[..=rank].rotate_right(1);
        }
        self.n_served += 1;
    }

    /// Notes the ray partitioned last.
    #[inline(always)]
    pub(super) fn note(&mut self, ray_set: RaySetIndex, ray: &Ray, length: f64, predicted: Option<VolumeId>) {
        self.last = Some(Last { ray_set, ray: *ray, length, predicted });
    }

    /// Learns how far corresponding rays are apart, if the last one was of the ray-set before and met the same.
    #[inline(always)]
    pub(super) fn measure_step(
        &mut self,
        ray_set: RaySetIndex,
        ray: &Ray,
        length: f64,
        predicted: Option<VolumeId>,
    ) {
        let is_next =
            |last: &&Last| last.ray_set.0.wrapping_add(1) == ray_set.0 && last.predicted == predicted;
        let Some(last) = self.last.as_ref().filter(is_next) else {
            // Certificates that served few may have been built for too short a step.
            if self.n_served < SERVED_BY_A_GOOD_STEP {
                self.step = self.step.map(Step::grown);
            }
            return;
        };
        let spread = ray.origin().distance(last.ray.origin());
        let divergence = ray.direction().distance(last.ray.direction());
        let widening = if length < f64::INFINITY { spread + divergence * length } else { 0.0 };
        let lengthening =
            if length < f64::INFINITY { (length - last.length).abs().max(widening) } else { 0.0 };
        let step = Step { spread, divergence, lengthening };
        // A jump to the next row says little; but steps do grow.
        self.step = Some(match self.step {
            Some(old) if step.divergence > 3.0 * old.divergence && step.spread > 3.0 * old.spread => {
                old.grown()
            }
            _ => step,
        });
    }

    /// Keeps a certificate in place of the one that has not served longest.
    pub(super) fn keep(&mut self, certificate: Certificate) {
        let rank = self.ways.len().min(N_WAYS - 1);
        if rank == self.ways.len() {
            self.order[rank] = rank;
            self.ways.push(certificate);
        } else {
            self.ways[self.order[rank]] = certificate;
        }
        self.order[..=rank].rotate_right(1);
        self.n_served = 0;
    }

    /// Whether a certificate may be built now: after ones that served fewer than two rays, fewer are built.
    pub(super) fn may_build(&mut self) -> bool {
        if self.skip > 0 {
            self.skip -= 1;
            return false;
        }
        if self.ways.is_empty() || self.n_served >= 2 {
            self.caution = 0;
        } else {
            self.caution = (self.caution + 1).min(7);
            self.skip = (1 << self.caution) - 1;
        }
        true
    }
}

/// The state of every slot that was used.
#[derive(Debug, Default)]
pub(super) struct Slots {
    near: Vec<SlotState>,
    far: HashMap<u64, SlotState>,
}

/// Slots below this number are found by index, those above by hashing: a deep tree must not take memory for all the
/// slots it could have.
const N_NEAR: u64 = 1 << 10;

impl Slots {
    #[inline(always)]
    pub(super) fn at(&mut self, place: u64) -> &mut SlotState {
        if place >= N_NEAR {
            return self.far.entry(place).or_default();
        }
        let place = usize::try_from(place).expect("a small number");
        if place >= self.near.len() {
            self.near.resize_with(place + 1, SlotState::default);
        }
        &mut self.near[place]
    }
}
