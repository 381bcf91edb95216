//! The coherent algorithm of 1985, as literally as its text allows.
//!
//! The intersection tree of a ray-set is retained to guide the next one. A ray that hits the object its
//! corresponding ray hit, without piercing the cylinder around that ray, is coherent and needs no partition. This is
//! not a proof that the object is hit first (see `docs/paper-map.md`): the strategy is kept for the record, and its
//! wrong answers are counted.
//!
//! Source: Speer et al. 1985, section 2.3.

mod options;
mod reading;
mod retained;

use rayset_geometry::{Cylinder, Departure, Probe, Ray};
use rayset_scene::{Scene, VolumeId};
use rayset_simd::{Backend, Simd};

pub use self::options::{
    BlockerRule, EndPlaneRule, InheritanceRule, LightRule, MatchRule, MissRule, OriginatingRule, SlabRule,
    Speer1985Options,
};
pub use self::reading::UnknownReading;
use self::retained::{Retained, RetainedTree};
use super::partition::{Partition, any_in, departure, nearest_in};
use crate::strategy::LaneTracer;
use crate::{
    Hit, IntersectionStrategy, Originating, RayKind, RayQuery, RaySetIndex, Recording, ShadowQuery, Stats,
    Tracer, Work,
};

/// The retained tree with cylinders, word by word.
#[derive(Debug)]
pub struct Speer1985<'s> {
    scene: &'s Scene,
    backend: Backend,
    options: Speer1985Options,
}

impl<'s> Speer1985<'s> {
    /// Binds the strategy to a scene, on the lanes of [`Backend::active`], with the default reading of the text.
    #[must_use]
    pub fn new(scene: &'s Scene) -> Self {
        Self::on(scene, Backend::active(), Speer1985Options::default())
    }

    /// Binds a reading of the text to a scene, on the lanes of a backend.
    #[must_use]
    pub fn on(scene: &'s Scene, backend: Backend, options: Speer1985Options) -> Self {
        Self { scene, backend, options }
    }

    /// The reading of the text.
    #[must_use]
    pub fn options(&self) -> &Speer1985Options {
        &self.options
    }
}

impl IntersectionStrategy for Speer1985<'_> {
    fn name(&self) -> &'static str {
        "speer-1985"
    }

    fn is_exact(&self) -> bool {
        false
    }

    fn scene(&self) -> &Scene {
        self.scene
    }

    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_> {
        Box::new(Speer1985Tracer {
            scene: self.scene,
            backend: self.backend,
            options: self.options,
            recording,
            tree: RetainedTree::default(),
            light_tree: RetainedTree::default(),
            partition: Partition::default(),
            stats: Stats::default(),
            certificate_radius: 0.0,
        })
    }
}

struct Speer1985Tracer<'s> {
    scene: &'s Scene,
    backend: Backend,
    options: Speer1985Options,
    recording: Recording,
    tree: RetainedTree,
    light_tree: RetainedTree,
    partition: Partition,
    stats: Stats,
    /// Of the query answered last.
    certificate_radius: f64,
}

/// What the guide of a ray led to.
enum Guidance {
    /// The answer stands.
    Coherent(Option<Hit>),
    /// A partition is required; the predicted volume and the hit in it, where it was hit but the cylinder pierced.
    Partition(Option<(VolumeId, Hit)>),
}

impl LaneTracer for Speer1985Tracer<'_> {
    #[inline(always)]
    fn nearest_on<S: Simd>(&mut self, simd: S, query: &RayQuery) -> Option<Hit> {
        let (scene, kind) = (self.scene, query.slot.kind());
        let probe = Probe::new(simd, &query.ray, query.span, scene.primitives().is_flat());
        let departure = departure(scene, query.originating);
        let place = u64::from(query.slot.0);
        let guide = self.guide(self.tree.get(place), query.ray_set, query.originating);
        let pierced = match self.follow(&guide, kind, &probe, departure) {
            Guidance::Coherent(hit) => {
                if self.options.audit && hit != self.audit(simd, &probe, departure) {
                    self.stats.coherence[kind].wrong += 1;
                }
                self.certificate_radius = guide.map_or(0.0, |guide| guide.zone.radius);
                inherit(&mut self.tree, place, query.ray_set, self.options.inheritance);
                return hit;
            }
            Guidance::Partition(pierced) => pierced,
        };
        let work = &mut self.stats.work;
        let hit = self.partition.nearest::<S, true>(simd, scene, &probe, departure, work);
        self.note_false_coherence(kind, pierced, hit);
        let predicted = hit.map(|hit| scene.location(hit.primitive).volume);
        let length = match (hit, self.options.misses) {
            (Some(hit), _) => Some(hit.t),
            (None, MissRule::Cylinder) => Some(f64::INFINITY),
            (None, MissRule::Partition) => None,
        };
        let entry = length.map(|length| Retained {
            ray_set: query.ray_set,
            originating: query.originating,
            zone: self.build_cylinder(&query.ray, length, query.originating),
            predicted,
        });
        self.certificate_radius = entry.map_or(0.0, |entry| entry.zone.radius);
        self.tree.set(place, entry);
        hit
    }

    #[inline(always)]
    fn occluded_on<S: Simd>(&mut self, simd: S, query: &ShadowQuery) -> bool {
        let (scene, kind) = (self.scene, RayKind::Shadow);
        let probe = Probe::new(simd, &query.ray, query.span, scene.primitives().is_flat());
        let originating = Some(query.originating);
        let departure = departure(scene, originating);
        let place = u64::from(query.slot.0) * scene.lights().len() as u64 + u64::from(query.light.0);
        let guide = self.guide(self.light_tree.get(place), query.ray_set, originating);
        let pierced = match self.follow(&guide, kind, &probe, departure) {
            Guidance::Coherent(blocker) => {
                if self.options.audit {
                    let hit = self.audit(simd, &probe, departure);
                    self.stats.coherence[kind].wrong += u64::from(hit.is_some() != blocker.is_some());
                }
                self.certificate_radius = guide.map_or(0.0, |guide| guide.zone.radius);
                inherit(&mut self.light_tree, place, query.ray_set, self.options.inheritance);
                return blocker.is_some();
            }
            Guidance::Partition(pierced) => pierced,
        };
        let blocker = match self.options.blocker {
            BlockerRule::Nearest => {
                self.partition.nearest::<S, true>(simd, scene, &probe, departure, &mut self.stats.work)
            }
            BlockerRule::First => self.first_blocker(simd, &probe, departure),
        };
        self.note_false_coherence(kind, pierced, blocker);
        let length = match (blocker, self.options.light_rays) {
            (_, LightRule::None) | (None, LightRule::Blocked) => None,
            (Some(blocker), _) => Some(blocker.t),
            (None, LightRule::All) => Some(query.span.end),
        };
        let entry = length.map(|length| Retained {
            ray_set: query.ray_set,
            originating,
            zone: self.build_cylinder(&query.ray, length, originating),
            predicted: blocker.map(|blocker| scene.location(blocker.primitive).volume),
        });
        self.certificate_radius = entry.map_or(0.0, |entry| entry.zone.radius);
        self.light_tree.set(place, entry);
        blocker.is_some()
    }

    fn lane_stats(&self) -> &Stats {
        &self.stats
    }

    fn lane_recording(&self) -> Recording {
        self.recording
    }

    fn lane_certificate_radius(&self) -> f64 {
        self.certificate_radius
    }

    fn backend(&self) -> Backend {
        self.backend
    }
}

impl Speer1985Tracer<'_> {
    /// The retained node that guides a ray: that of the corresponding ray of the last ray-set.
    #[inline(always)]
    fn guide(
        &self,
        entry: Option<&Retained>,
        ray_set: RaySetIndex,
        originating: Option<Originating>,
    ) -> Option<Retained> {
        let entry = entry.filter(|entry| entry.ray_set.0.checked_add(1) == Some(ray_set.0))?;
        let object = |originating: Option<Originating>| originating.map(|o| o.object);
        let side = |originating: Option<Originating>| originating.map(|o| o.side);
        let same_object = object(entry.originating) == object(originating);
        let corresponds = match self.options.matching {
            MatchRule::AnyOrigin => true,
            MatchRule::SameObject => same_object,
            MatchRule::SameObjectAndSide => same_object && side(entry.originating) == side(originating),
        };
        corresponds.then_some(*entry)
    }

    /// Tries to answer a ray by its guide.
    ///
    /// The predicted object is tested first, since the pierce check needs the point of intersection.
    #[inline(always)]
    fn follow<S: Simd>(
        &mut self,
        guide: &Option<Retained>,
        kind: RayKind,
        probe: &Probe<S>,
        departure: Option<Departure>,
    ) -> Guidance {
        let Some(guide) = guide else { return Guidance::Partition(None) };
        let counts = &mut self.stats.coherence[kind];
        let work = &mut self.stats.work;
        counts.guided += 1;
        let ray = probe.ray();
        let Some(predicted) = guide.predicted else {
            work.pierce_checks += 1;
            if self.options.is_pierced(&guide.zone, ray, probe.span().end) {
                counts.pierced += 1;
                return Guidance::Partition(None);
            }
            counts.coherent += 1;
            return Guidance::Coherent(None);
        };
        let Some(hit) = nearest_in(self.scene, probe, predicted, departure, work) else {
            counts.predicted_missed += 1;
            return Guidance::Partition(None);
        };
        work.pierce_checks += 1;
        if self.options.is_pierced(&guide.zone, ray, hit.t) {
            counts.pierced += 1;
            return Guidance::Partition(Some((predicted, hit)));
        }
        counts.coherent += 1;
        Guidance::Coherent(Some(hit))
    }

    /// What the standard algorithm answers, without counting its work.
    #[inline(always)]
    fn audit<S: Simd>(&mut self, simd: S, probe: &Probe<S>, departure: Option<Departure>) -> Option<Hit> {
        self.partition.nearest::<S, false>(simd, self.scene, probe, departure, &mut Work::default())
    }

    /// The nearest hit in the first volume, in order, that holds a blocker.
    #[inline(always)]
    fn first_blocker<S: Simd>(
        &mut self,
        simd: S,
        probe: &Probe<S>,
        departure: Option<Departure>,
    ) -> Option<Hit> {
        let work = &mut self.stats.work;
        self.partition.of::<S, true>(simd, self.scene, probe, work);
        // A loop and not `find`: the lanes of a closure are compiled without the backend's instructions.
        for &volume in &self.partition.intersected {
            if any_in(self.scene, probe, volume, departure, work) {
                return nearest_in(self.scene, probe, volume, departure, &mut Work::default());
            }
        }
        None
    }

    fn note_false_coherence(&mut self, kind: RayKind, pierced: Option<(VolumeId, Hit)>, hit: Option<Hit>) {
        if let (Some((predicted, there)), Some(hit)) = (pierced, hit)
            && hit.t < there.t
            && self.scene.location(hit.primitive).volume != predicted
        {
            self.stats.coherence[kind].false_coherence += 1;
        }
    }

    /// Builds the cylinder of a formative ray from the N of its partition.
    ///
    /// Source: Speer et al. 1985, section 2.3.2.
    #[inline(always)]
    fn build_cylinder(&mut self, ray: &Ray, length: f64, originating: Option<Originating>) -> Cylinder {
        let scene = self.scene;
        let left = match (self.options.originating, originating) {
            (OriginatingRule::Excluded, Some(originating)) => {
                Some(scene.location(originating.primitive).volume)
            }
            _ => None,
        };
        let (mut radius, mut farthest) = (f64::INFINITY, 0.0_f64);
        for member in &self.partition.not_intersected {
            self.stats.work.radius_comparisons += 1;
            let reach = scene.volumes().radius(member.volume.index());
            let (near, far) = (member.along - reach, member.along + reach);
            farthest = farthest.max(far);
            let is_between = match self.options.slab {
                SlabRule::Overlapping => near < length && far > 0.0,
                SlabRule::Centre => 0.0 < member.along && member.along < length,
                SlabRule::Inside => 0.0 < near && far < length,
            };
            // |l| - r < radius, without the root where it is not less.
            let sum = radius + reach;
            if is_between && member.lateral_squared < sum * sum && Some(member.volume) != left {
                radius = member.lateral_squared.sqrt() - reach;
                if radius <= 0.0 {
                    radius = 0.0;
                }
            }
        }
        // A ray that meets nothing needs protection only as far as there is anything.
        let length = if length < f64::INFINITY || radius == f64::INFINITY { length } else { farthest };
        self.stats.work.cylinders_built += 1;
        let unit = scene.extent();
        self.stats.radii.record(radius / unit);
        self.stats.lengths.record(length / unit);
        Cylinder { anchor: ray.origin(), axis: ray.direction(), length, radius }
    }
}

impl Speer1985Options {
    /// The pierce check for a ray up to distance `end`; if that is infinite, up to the end plane of the cylinder.
    #[inline(always)]
    fn is_pierced(&self, zone: &Cylinder, ray: &Ray, end: f64) -> bool {
        let from = ray.origin();
        let is_endless = end == f64::INFINITY;
        let end = if is_endless { zone.distance_to_end(ray) } else { end };
        if end == f64::INFINITY {
            // Nothing was in front of the formative ray: its cylinder has neither side nor end.
            return zone.radius < f64::INFINITY;
        }
        let to = ray.at(end);
        // A ray that goes on for ever is followed to the end plane, and leaves by it as it should.
        let leaves_by_an_end = self.end_planes == EndPlaneRule::Closed
            && !(zone.contains_axially(from) && (is_endless || zone.contains_axially(to)));
        leaves_by_an_end || zone.is_pierced_by(from, to)
    }
}

/// What a coherent ray leaves for the next ray-set.
#[inline(always)]
fn inherit(tree: &mut RetainedTree, place: u64, ray_set: RaySetIndex, rule: InheritanceRule) {
    match rule {
        InheritanceRule::Nothing => tree.set(place, None),
        InheritanceRule::Formative => {
            if let Some(entry) = tree.get_mut(place) {
                entry.ray_set = ray_set;
            }
        }
    }
}
