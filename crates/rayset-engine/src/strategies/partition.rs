//! The partition of a region and the tests of what it leaves: shared by the strategies of the paper.

use rayset_geometry::{ColumnRun, Departure, PARTITION_MARGIN, Probe, RayLanes};
use rayset_scene::{Scene, VolumeId};
use rayset_simd::{Lanes, Simd};

use crate::{Hit, Originating, Work};

/// The sets I and N of a partition.
///
/// Source: Speer et al. 1985, section 2.1.
#[derive(Debug, Default)]
pub(super) struct Partition {
    /// I, in increasing order.
    pub(super) intersected: Vec<VolumeId>,
    /// N, in increasing order; only if it is retained.
    pub(super) not_intersected: Vec<NotIntersected>,
}

/// A member of N, with what the partition computed for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct NotIntersected {
    pub(super) volume: VolumeId,
    /// The signed distance of its centre from the bounding plane, in world units.
    pub(super) along: f64,
    /// The squared distance of its centre from the ray's line.
    pub(super) lateral_squared: f64,
}

impl Partition {
    /// Partitions all volumes of a scene by a ray; retains N only where asked to.
    #[inline(always)]
    pub(super) fn of<S: Simd, const RETAIN_N: bool>(
        &mut self,
        simd: S,
        scene: &Scene,
        probe: &Probe<S>,
        work: &mut Work,
    ) {
        let volumes = scene.volumes();
        let ray = probe.ray();
        let lanes = RayLanes::splat(simd, ray);
        let slack = PARTITION_MARGIN * (ray.origin().abs().max_element() + scene.extent());
        work.partitions += 1;
        work.volumes_classified += volumes.len() as u64;
        self.intersected.clear();
        self.not_intersected.clear();
        for i in (0..volumes.len()).step_by(S::F64::LANES) {
            let classified = volumes.classify(simd, &lanes, slack, i);
            let mut bits = classified.intersected;
            while bits != 0 {
                self.intersected.push(volume(i, bits.trailing_zeros()));
                bits &= bits - 1;
            }
            if RETAIN_N {
                let mut bits = classified.not_intersected;
                while bits != 0 {
                    let lane = bits.trailing_zeros();
                    bits &= bits - 1;
                    self.not_intersected.push(NotIntersected {
                        volume: volume(i, lane),
                        along: classified.along.lane(lane as usize),
                        lateral_squared: classified.lateral_squared.lane(lane as usize),
                    });
                }
            }
        }
    }
}

impl Partition {
    /// Partitions, and finds the least hit among the primitives of all volumes in I.
    ///
    /// Source: Speer et al. 1985, section 2.2.
    #[inline(always)]
    pub(super) fn nearest<S: Simd, const RETAIN_N: bool>(
        &mut self,
        simd: S,
        scene: &Scene,
        probe: &Probe<S>,
        departure: Option<Departure>,
        work: &mut Work,
    ) -> Option<Hit> {
        self.of::<S, RETAIN_N>(simd, scene, probe, work);
        let mut nearest: Option<Hit> = None;
        for &volume in &self.intersected {
            if let Some(hit) = nearest_in(scene, probe, volume, departure, work)
                && nearest.is_none_or(|nearest| hit.precedes(&nearest))
            {
                nearest = Some(hit);
            }
        }
        nearest
    }

    /// Partitions, and says whether any primitive of the volumes in I is hit.
    #[inline(always)]
    pub(super) fn any<S: Simd>(
        &mut self,
        simd: S,
        scene: &Scene,
        probe: &Probe<S>,
        departure: Option<Departure>,
        work: &mut Work,
    ) -> bool {
        self.of::<S, false>(simd, scene, probe, work);
        // A loop and not `Iterator::any`: the lanes of a closure are compiled without the backend's instructions.
        for &volume in &self.intersected {
            if any_in(scene, probe, volume, departure, work) {
                return true;
            }
        }
        false
    }
}

/// The volume in a lane; volumes are numbered in 32 bits.
#[expect(clippy::cast_possible_truncation, reason = "a scene has fewer than 2^32 volumes")]
fn volume(i: usize, lane: u32) -> VolumeId {
    VolumeId(i as u32 + lane)
}

/// The primitive a ray leaves, as the columns know it.
#[inline]
pub(super) fn departure(scene: &Scene, originating: Option<Originating>) -> Option<Departure> {
    originating.map(|originating| {
        let location = scene.location(originating.primitive);
        Departure { kind: location.kind, index: location.index, side: originating.side }
    })
}

/// The least hit among the primitives of a volume.
#[inline(always)]
pub(super) fn nearest_in<S: Simd>(
    scene: &Scene,
    probe: &Probe<S>,
    volume: VolumeId,
    departure: Option<Departure>,
    work: &mut Work,
) -> Option<Hit> {
    let object = scene.volume_object(volume);
    let mut nearest: Option<Hit> = None;
    for run in scene.volume_runs(volume) {
        work.primitive_tests += u64::from(run.range.end - run.range.start);
        if let Some(hit) = scene.primitives().nearest(probe, run, departure) {
            let hit = Hit { t: hit.t, object, primitive: scene.primitive_id(run.kind, hit.index) };
            if nearest.is_none_or(|nearest| hit.precedes(&nearest)) {
                nearest = Some(hit);
            }
        }
    }
    nearest
}

/// The first primitive of a volume, in the order of its runs, that is hit, as a run of one; the tests counted are those of
/// a scalar loop that stops there.
#[inline(always)]
pub(super) fn first_in<S: Simd>(
    scene: &Scene,
    probe: &Probe<S>,
    volume: VolumeId,
    departure: Option<Departure>,
    work: &mut Work,
) -> Option<ColumnRun> {
    for run in scene.volume_runs(volume) {
        match scene.primitives().any(probe, run, departure) {
            Some(hit) => {
                work.primitive_tests += u64::from(hit.index + 1 - run.range.start);
                return Some(ColumnRun { range: hit.index..hit.index + 1, ..run.clone() });
            }
            None => work.primitive_tests += u64::from(run.range.end - run.range.start),
        }
    }
    None
}

/// Whether any primitive of a volume is hit.
#[inline(always)]
pub(super) fn any_in<S: Simd>(
    scene: &Scene,
    probe: &Probe<S>,
    volume: VolumeId,
    departure: Option<Departure>,
    work: &mut Work,
) -> bool {
    first_in(scene, probe, volume, departure, work).is_some()
}
