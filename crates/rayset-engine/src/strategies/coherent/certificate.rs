//! Certificates: a pencil of rays, and the few volumes that such rays can meet.

use rayset_geometry::{
    ColumnRun, Pencil, PencilGate, PencilLanes, PrimitiveKind, Ray, Side, Sides, Span, Sphere,
};
use rayset_scene::{ObjectId, PrimitiveId, Scene, VolumeId};
use rayset_simd::{Lanes, Scalar, Simd};

use super::condition::{Condition, Omitted};
use crate::{Hit, Originating};

/// The most volumes that are tested for every ray beside the predicted one.
pub(super) const MAX_GUESTS: usize = 4;

/// More volumes than this in the way of the widest pencil, and a narrower one is tried at once.
const MAX_IN_THE_WAY: usize = 12;

/// How many steps from one ray to the next a pencil is to reach, from the widest.
pub(super) const REACHES: [f64; 3] = [32.0, 10.0, 3.0];

/// The most that building a certificate costs, in tests: two a volume, and for those in the way two more at every
/// narrower reach, of which there are never more than it takes to go on to that reach.
pub(super) fn build_cost(scene: &Scene) -> u64 {
    let n = scene.volumes().len() as u64;
    let narrower = REACHES.len() as u64 - 1;
    let most = (MAX_IN_THE_WAY as u64 + 1) * narrower * (narrower + 1) / 2;
    2 * (n + most.min(narrower * n))
}

/// The most volumes that are tested for a ray: the predicted one and the guests.
pub(super) const MAX_VOLUMES: usize = MAX_GUESTS + 1;

/// A proof about all rays of a pencil: beside a few volumes they meet nothing.
///
/// What most rays need stands first, and stands here: a coherent ray reads this and nothing of the scene.
#[derive(Clone, Debug)]
#[repr(C)]
pub(super) struct Certificate {
    gate: PencilGate,
    /// How far along its rays the proof goes, in world units.
    pub(super) length: f64,
    /// A primitive that was left out since the ray that leaves it cannot meet it again: the proof holds only for rays
    /// that leave it on the same side.
    excluded: Option<PrimitiveId>,
    n_volumes: u8,
    is_of_spheres: bool,
    /// The contents of the volumes, if each of them is one sphere.
    spheres: [Option<LoneSphere>; MAX_VOLUMES],
    /// The one whose contents the formative ray hit, if it did, and the guests.
    volumes: [VolumeId; MAX_VOLUMES],
    pub(super) pencil: Pencil,
}

impl Certificate {
    fn new(scene: &Scene, omitted: Omitted, pencil: Pencil, plan: &Plan, guests: &[VolumeId]) -> Self {
        let predicted = plan.predicted.filter(|_| !omitted.is(Condition::Predicted));
        let guests = if omitted.is(Condition::Guests) { &[] } else { guests };
        let mut certificate = Self {
            gate: omitted.pencil_of_rays(pencil).gate(),
            length: pencil.length,
            excluded: plan.excluded.map(|(primitive, _)| primitive),
            n_volumes: 0,
            is_of_spheres: true,
            spheres: [None; MAX_VOLUMES],
            volumes: [VolumeId(0); MAX_VOLUMES],
            pencil,
        };
        for (i, volume) in predicted.iter().chain(guests).enumerate() {
            certificate.volumes[i] = *volume;
            certificate.spheres[i] = LoneSphere::of(scene, *volume);
            certificate.is_of_spheres &= certificate.spheres[i].is_some();
            certificate.n_volumes += 1;
        }
        certificate
    }

    /// The volumes to be tested for every ray.
    #[inline(always)]
    pub(super) fn volumes(&self) -> &[VolumeId] {
        &self.volumes[..usize::from(self.n_volumes).min(MAX_VOLUMES)]
    }

    /// The contents of the volumes to be tested, if each is one sphere.
    #[inline(always)]
    pub(super) fn spheres(&self) -> Option<impl Iterator<Item = &LoneSphere>> {
        let spheres = &self.spheres[..usize::from(self.n_volumes).min(MAX_VOLUMES)];
        self.is_of_spheres.then(|| spheres.iter().flatten())
    }

    /// Whether a ray belongs to the pencil, and leaves what the proof left out.
    #[inline(always)]
    pub(super) fn admits(&self, ray: &Ray, originating: Option<Originating>, omitted: Omitted) -> bool {
        let leaves_it = |excluded: PrimitiveId| {
            omitted.is(Condition::ExcludedIsLeft)
                || originating.is_some_and(|o| o.primitive == excluded && is_left(&o, omitted))
        };
        self.gate.admits(ray) && self.excluded.is_none_or(leaves_it)
    }
}

/// Whether a ray cannot meet the primitive it leaves again: see [`Departure`](rayset_geometry::Departure).
#[inline(always)]
pub(super) fn is_left(originating: &Originating, omitted: Omitted) -> bool {
    originating.side == Side::Front || omitted.is(Condition::ExcludedFront)
}

/// Whether a volume holds one primitive.
#[inline(always)]
pub(super) fn is_single(scene: &Scene, volume: VolumeId) -> bool {
    matches!(scene.volume_runs(volume), [run] if run.range.end - run.range.start == 1)
}

/// A sphere that is alone in its volume, and all that a hit of it needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoneSphere {
    sphere: Sphere,
    sides: Sides,
    object: ObjectId,
    primitive: PrimitiveId,
}

impl LoneSphere {
    fn of(scene: &Scene, volume: VolumeId) -> Option<Self> {
        match scene.volume_runs(volume) {
            [run] if run.range.end - run.range.start == 1 => Self::of_run(scene, run),
            _ => None,
        }
    }

    /// The sphere that a run of one holds, if it does.
    pub(super) fn of_run(scene: &Scene, run: &ColumnRun) -> Option<Self> {
        let primitive = scene.primitive_id(run.kind, run.range.start);
        let volume = scene.location(primitive).volume;
        (run.kind == PrimitiveKind::Sphere).then(|| Self {
            sphere: scene.primitives().sphere(run.range.start),
            sides: run.sides,
            object: scene.volume_object(volume),
            primitive,
        })
    }

    /// Where a ray hits it.
    #[inline(always)]
    pub(super) fn hit(&self, ray: &Ray, span: Span, originating: Option<Originating>) -> Option<Hit> {
        let departure = originating.filter(|left| left.primitive == self.primitive).map(|left| left.side);
        let t = self.sphere.intersect(ray, span, self.sides, departure)?;
        Some(Hit { t, object: self.object, primitive: self.primitive })
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

/// Volumes in the way of the widest pencil, each with the number of the first reach at which it is not.
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
        let pencils = REACHES.map(|reach| omitted.pencil_of_volumes(plan.pencil(reach)));
        let slack =
            omitted.margin() * (axis.origin().abs().max_element() + pencils[0].spread + scene.extent());
        let alone = pencils.each_ref().map(|pencil| PencilLanes::splat(Scalar, pencil, slack));
        let left_out = [plan.predicted, plan.excluded.map(|(_, volume)| volume)];
        // The widest reach that may still do, and how many volumes are in the way at every reach.
        let (mut level, mut never) = (0, 0);
        let mut lanes = PencilLanes::splat(simd, &pencils[0], slack);
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
                // At which reach does it get out of the way?
                let sphere = volumes.sphere(volume.index());
                let mut first_clear = level + 1;
                while first_clear < REACHES.len() && {
                    *n_tested += 1;
                    !alone[first_clear].clears(&sphere)
                } {
                    first_clear += 1;
                }
                if first_clear == REACHES.len() {
                    if omitted.is(Condition::InTheWay) {
                        continue;
                    }
                    never += 1;
                    if never > MAX_GUESTS {
                        if !omitted.is(Condition::TooMany) {
                            return None;
                        }
                        continue;
                    }
                }
                self.in_the_way.push((first_clear, volume));
                if self.in_the_way.len() > MAX_IN_THE_WAY {
                    level += 1;
                    lanes = PencilLanes::splat(simd, &pencils[level], slack);
                    self.in_the_way.retain(|&(first_clear, _)| first_clear > level);
                    // As if the lanes that remain were looked at only now, so that counts depend on no lanes.
                    touched &= lanes.touched(volumes, i);
                }
            }
        }
        // One more guest than must be where that widens the pencil.
        self.in_the_way.sort_unstable_by(|a, b| b.cmp(a));
        let never = never.min(MAX_GUESTS);
        let n_guests = if never < MAX_GUESTS { (never + 1).min(self.in_the_way.len()) } else { never };
        let level = self.in_the_way.get(n_guests).map_or(level, |&(first_clear, _)| first_clear);
        let mut guests = [VolumeId(0); MAX_GUESTS];
        for (guest, &(_, volume)) in guests.iter_mut().zip(&self.in_the_way[..n_guests]) {
            *guest = volume;
        }
        let pencil = plan.pencil(REACHES[level]);
        Some(Certificate::new(scene, omitted, pencil, plan, &guests[..n_guests]))
    }
}

/// The volume in a lane; volumes are numbered in 32 bits.
#[expect(clippy::cast_possible_truncation, reason = "a scene has fewer than 2^32 volumes")]
fn volume(i: usize, lane: u32) -> VolumeId {
    VolumeId(i as u32 + lane)
}
