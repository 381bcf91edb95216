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
    /// How many of them `account` does not know yet.
    n_unpaid: u32,
    /// What certificates have saved, less what building them took, in tests as they take time.
    account: i64,
    pub(super) last: Option<Last>,
    pub(super) step: Option<Step>,
    /// How many partitioned rays to learn nothing from, since certificates did not earn what they cost.
    wait: u32,
    /// For how many to wait next time, as a power of two.
    caution: u32,
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
        self.n_unpaid += 1;
    }

    /// Learns how far corresponding rays are apart, if the last one was of the ray-set before and met the same.
    #[inline(always)]
    pub(super) fn measure_step(&mut self, seen: &Last) {
        let is_next = |last: &&Last| {
            last.ray_set.0.wrapping_add(1) == seen.ray_set.0 && last.predicted == seen.predicted
        };
        let Some(last) = self.last.as_ref().filter(is_next) else {
            // Certificates that served few may have been built for too short a step.
            if self.n_served < SERVED_BY_A_GOOD_STEP {
                self.step = self.step.map(Step::grown);
            }
            return;
        };
        let Last { ref ray, length, .. } = *seen;
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

    /// Whether the slot is to learn from a ray that was partitioned.
    ///
    /// A slot whose certificates do not earn what they cost waits for ever longer, and then costs next to nothing.
    #[inline(always)]
    pub(super) fn learns(&mut self, prices: Prices) -> Learns {
        let served = i64::from(std::mem::take(&mut self.n_unpaid));
        self.account = (self.account + served * prices.saving).min(MOST_SAVED * prices.building);
        if self.account >= 0 || self.wait == 0 {
            return Learns::All;
        }
        self.wait -= 1;
        // The ray before the one to be certified shows the step.
        if self.wait == 0 { Learns::Step } else { Learns::Nothing }
    }

    /// A certificate is being built.
    pub(super) fn pay_building(&mut self, prices: Prices) {
        if self.account >= 0 {
            self.caution = 0;
        } else {
            self.caution = (self.caution + 1).clamp(LEAST_CAUTION, MOST_CAUTION);
            self.wait = 1 << self.caution;
            self.account = 0;
            if self.n_served == 0 {
                // Certificates that served none since are not worth a check either.
                self.ways.clear();
            }
        }
        self.account -= prices.building;
    }
}

/// What a slot learns from a ray that was partitioned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Learns {
    Nothing,
    /// How far apart corresponding rays are.
    Step,
    /// That, and it may build a certificate.
    All,
}

/// What building a certificate takes and what a ray that it serves saves, in tests as they take time: of some four
/// nanoseconds each, where this was measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prices {
    building: i64,
    saving: i64,
}

impl Prices {
    /// Building costs nothing, so that nothing keeps a slot from it.
    pub(super) const NONE: Self = Self { building: 0, saving: 0 };

    /// Those of a scene of `n` volumes.
    pub(super) fn of(n: usize) -> Self {
        let n = i64::try_from(n).unwrap_or(i64::MAX / 8);
        // Building takes about two and a half tests a volume, and as long as 150 tests besides: half a microsecond,
        // in which a few more rays are partitioned that another certificate might have served. A partition takes one
        // test a volume, and a little more than serving a ray besides.
        Self { building: 150 + 5 * n / 2, saving: n + 4 }
    }
}

/// How many certificates a slot may build from what it saved, before it has to save again.
const MOST_SAVED: i64 = 8;

/// A slot waits for two to this power of partitioned rays at first, and at most.
const LEAST_CAUTION: u32 = 4;
const MOST_CAUTION: u32 = 7;

/// The state of every slot that was used.
#[derive(Debug)]
pub(super) struct Slots {
    near: Vec<SlotState>,
    far: HashMap<u64, SlotState>,
}

impl Default for Slots {
    /// With room for the slots of most trees, so that few are moved.
    fn default() -> Self {
        Self { near: Vec::with_capacity(64), far: HashMap::new() }
    }
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
