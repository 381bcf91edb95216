//! Certificates: a pencil of rays, and the few volumes that such rays can meet.

use rayset_geometry::{Pencil, PencilLanes};
use rayset_scene::{PrimitiveId, Scene, VolumeId};
use rayset_simd::{Lanes, Scalar, Simd};

use super::condition::{Condition, Omitted};

/// The most volumes that are tested for every ray beside the predicted one.
pub(super) const MAX_GUESTS: usize = 4;

/// More volumes than this in the way of the widest pencil, and a narrower one is tried at once.
const MAX_IN_THE_WAY: usize = 12;

/// How many steps from one ray to the next a pencil is to reach, from the widest.
pub(super) const REACHES: [f64; 3] = [32.0, 10.0, 3.0];

/// The most tests that building a certificate takes: two a volume, and for those in the way two more at every reach.
pub(super) fn build_cost(scene: &Scene) -> u64 {
    2 * (scene.volumes().len() as u64 + 2 * (MAX_IN_THE_WAY as u64 + 1) * REACHES.len() as u64)
}

/// A proof about all rays of a pencil: beside the predicted volume and the guests they meet nothing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Certificate {
    /// The rays, and how far along them the proof goes.
    pub(super) pencil: Pencil,
    /// The volume whose contents the formative ray hit; `None` if nothing was.
    pub(super) predicted: Option<VolumeId>,
    /// A primitive that was left out since the ray that leaves it cannot meet it again: the proof holds only for rays
    /// that leave it on the same side.
    pub(super) excluded: Option<PrimitiveId>,
    guests: [VolumeId; MAX_GUESTS],
    n_guests: u8,
}

impl Certificate {
    /// The volumes to be tested for every ray: the predicted one and the guests.
    #[inline(always)]
    pub(super) fn volumes(&self, omitted: Omitted) -> impl Iterator<Item = VolumeId> + use<> {
        let guests = self.guests;
        let n_guests = if omitted.is(Condition::Guests) { 0 } else { self.n_guests };
        let predicted = self.predicted.filter(|_| !omitted.is(Condition::Predicted));
        predicted.into_iter().chain(guests.into_iter().take(usize::from(n_guests)))
    }
}

/// What a certificate is to be built from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    /// A pencil of reach 1: how far the next corresponding ray is expected to be from this one.
    pub(super) step: Pencil,
    /// How much longer the pencil is to be for each unit of reach.
    pub(super) lengthening: f64,
    pub(super) predicted: Option<VolumeId>,
    pub(super) excluded: Option<(PrimitiveId, VolumeId)>,
}

impl Plan {
    /// The pencil of a reach.
    #[inline(always)]
    fn pencil(&self, reach: f64) -> Pencil {
        Pencil {
            axis: self.step.axis,
            spread: self.step.spread * reach,
            divergence: (self.step.divergence * reach).min(0.5),
            length: self.step.length + self.lengthening * reach,
        }
    }
}

/// Volumes in the way of a pencil, each with the number of the first reach at which it is not.
#[derive(Debug, Default)]
pub(super) struct Builder {
    omitted: Omitted,
    in_the_way: Vec<(usize, VolumeId)>,
}

impl Builder {
    pub(super) fn new(omitted: Omitted) -> Self {
        Self { omitted, in_the_way: Vec::new() }
    }

    /// The certificate of the widest pencil there is room for, with as many guests as pay; counts the volumes tested.
    #[inline(always)]
    pub(super) fn build<S: Simd>(
        &mut self,
        simd: S,
        scene: &Scene,
        plan: &Plan,
        n_tested: &mut u64,
    ) -> Option<Certificate> {
        let axis = plan.step.axis;
        let omitted = self.omitted;
        let volumes = &*omitted.volumes(scene);
        let pencil = |level: usize| omitted.pencil_of_volumes(plan.pencil(REACHES[level]));
        let bounds = |volume: VolumeId| volumes.sphere(volume.index());
        let widest = pencil(0);
        let slack = omitted.margin() * (axis.origin().abs().max_element() + widest.spread + scene.extent());
        let left_out = [plan.predicted, plan.excluded.map(|(_, volume)| volume)];
        let mut level = 0;
        let mut lanes = PencilLanes::splat(simd, &widest, slack);
        self.in_the_way.clear();
        *n_tested += volumes.len() as u64;
        for i in (0..volumes.len()).step_by(S::F64::LANES) {
            let mut touched = lanes.touched(volumes, i);
            while touched != 0 {
                let volume = volume(i, touched.trailing_zeros());
                touched &= touched - 1;
                if left_out.contains(&Some(volume)) {
                    continue;
                }
                self.in_the_way.push((0, volume));
                if self.in_the_way.len() > MAX_IN_THE_WAY {
                    level += 1;
                    if level == REACHES.len() {
                        return None;
                    }
                    let narrower = pencil(level);
                    lanes = PencilLanes::splat(simd, &narrower, slack);
                    *n_tested += self.in_the_way.len() as u64;
                    self.in_the_way.retain(|&(_, volume)| !narrower.clears(&bounds(volume), slack));
                }
            }
        }
        // At which reach does each get out of the way?
        if !self.in_the_way.is_empty() {
            let lanes: [_; REACHES.len()] =
                std::array::from_fn(|level| PencilLanes::splat(Scalar, &pencil(level), slack));
            for (first_clear, volume) in &mut self.in_the_way {
                *first_clear = level;
                let sphere = bounds(*volume);
                while *first_clear < REACHES.len() && !lanes[*first_clear].clears(&sphere) {
                    *n_tested += 1;
                    *first_clear += 1;
                }
            }
        }
        if omitted.is(Condition::InTheWay) {
            self.in_the_way.retain(|&(first_clear, _)| first_clear < REACHES.len());
        }
        self.in_the_way.sort_unstable_by(|a, b| b.cmp(a));
        let never = self.in_the_way.partition_point(|&(first_clear, _)| first_clear == REACHES.len());
        if never > MAX_GUESTS {
            if !omitted.is(Condition::TooMany) {
                return None;
            }
            self.in_the_way.drain(MAX_GUESTS..never);
        }
        let never = never.min(MAX_GUESTS);
        // One more guest where that widens the pencil.
        let n_guests = if never < MAX_GUESTS { (never + 1).min(self.in_the_way.len()) } else { never };
        let level = self.in_the_way.get(n_guests).map_or(level, |&(first_clear, _)| first_clear);
        let mut guests = [VolumeId(0); MAX_GUESTS];
        for (guest, &(_, volume)) in guests.iter_mut().zip(&self.in_the_way[..n_guests]) {
            *guest = volume;
        }
        Some(Certificate {
            pencil: plan.pencil(REACHES[level]),
            predicted: plan.predicted,
            excluded: plan.excluded.map(|(primitive, _)| primitive),
            guests,
            n_guests: u8::try_from(n_guests).unwrap_or(0),
        })
    }
}

/// The volume in a lane; volumes are numbered in 32 bits.
#[expect(clippy::cast_possible_truncation, reason = "a scene has fewer than 2^32 volumes")]
fn volume(i: usize, lane: u32) -> VolumeId {
    VolumeId(i as u32 + lane)
}
