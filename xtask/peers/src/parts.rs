//! What peers are given: triangles and spheres, and rays, in single precision.

use rayset_engine::Generation;
use rayset_engine::geometry::{PrimitiveKind, Sides};
use rayset_engine::scene::glam::DVec3;
use rayset_engine::scene::{LightId, Scene, VolumeId};
use rayset_study::{Disagreements, RecordedPart};

/// Rays that leave a surface see others from here on, relative to the extent of the scene: single precision would else
/// see the surface itself. Ours leaves surfaces by their identity, at almost no distance.
const START: f64 = 2e-5;

/// Distances that differ by less, relative to the extent of the scene and the distance, are the same.
const SAME: f64 = 1.0 / 65536.0;

/// The primitives of a scene, with their ids.
#[derive(Default)]
pub(crate) struct Parts {
    pub(crate) triangles: Vec<([[f32; 3]; 3], u32)>,
    pub(crate) spheres: Vec<([f32; 3], f32, u32)>,
}

#[expect(clippy::cast_possible_truncation, reason = "peers decide in single precision")]
pub(crate) fn narrow(v: DVec3) -> [f32; 3] {
    v.to_array().map(|x| x as f32)
}

impl Parts {
    /// The primitives of a scene; an error says why there is something that peers do not have.
    pub(crate) fn of(scene: &Scene) -> Result<Self, String> {
        let mut parts = Self::default();
        for volume in (0..).map(VolumeId).take(scene.volumes().len()) {
            for run in scene.volume_runs(volume) {
                if run.sides != Sides::Both {
                    return Err("surfaces with one side".to_owned());
                }
                for index in run.range.clone() {
                    let id = scene.primitive_id(run.kind, index).0;
                    match run.kind {
                        PrimitiveKind::Triangle => {
                            let triangle = scene.primitives().triangle(index);
                            parts.triangles.push((triangle.vertices().map(narrow), id));
                        }
                        PrimitiveKind::Sphere => {
                            let sphere = scene.primitives().sphere(index);
                            #[expect(
                                clippy::cast_possible_truncation,
                                reason = "peers decide in single precision"
                            )]
                            let radius = sphere.radius() as f32;
                            parts.spheres.push((narrow(sphere.center()), radius, id));
                        }
                        kind => return Err(format!("primitives of kind {kind:?}").to_lowercase()),
                    }
                }
            }
        }
        // In the order of the scene, not of its volumes, so that ids are near where primitives are.
        parts.triangles.sort_by_key(|triangle| triangle.1);
        parts.spheres.sort_by_key(|sphere| sphere.2);
        Ok(parts)
    }
}

/// A ray in single precision.
#[derive(Clone, Copy)]
pub(crate) struct Narrow {
    pub(crate) origin: [f32; 3],
    pub(crate) direction: [f32; 3],
    pub(crate) span: [f32; 2],
}

/// Where a ray stands in a part: bundle and place.
pub(crate) type Place = (usize, usize);

/// Where rays that leave a surface, or do not, start at least, in world units.
pub(crate) fn floor(rays: &Generation, extent: f64) -> f64 {
    let leaves = !rays.is_empty() && rays.originating(0).is_some();
    debug_assert!(
        (0..rays.len()).all(|i| rays.originating(i).is_some() == leaves),
        "all of a list leave, or none"
    );
    if leaves { START * extent } else { 0.0 }
}

/// The rays of a part, bundle by bundle; within one by slot and light, then in the order of the image, a Morton
/// curve, so that 16 neighbours in the list are 4 by 4 pixels where none is missing.
#[expect(clippy::cast_possible_truncation, reason = "peers decide in single precision")]
pub(crate) fn rays(part: &RecordedPart, extent: f64) -> Vec<(Narrow, Place)> {
    let mut narrow = Vec::with_capacity(part.rays());
    let mut order = Vec::new();
    let mut append = |b: usize, rays: &Generation, lights: &[LightId]| {
        let light = |i: usize| lights.get(i).map_or(0, |light| light.0);
        order.clear();
        order.extend(0..rays.len());
        order.sort_by_key(|&i| (rays.slots()[i], light(i), rays.ray_sets()[i].0));
        let ([ox, oy, oz], [dx, dy, dz], (starts, ends)) = (rays.origins(), rays.directions(), rays.spans());
        let floor = floor(rays, extent);
        for &i in &order {
            let origin = [ox[i] as f32, oy[i] as f32, oz[i] as f32];
            let direction = [dx[i] as f32, dy[i] as f32, dz[i] as f32];
            let span = [starts[i].max(floor) as f32, ends[i] as f32];
            narrow.push((Narrow { origin, direction, span }, (b, i)));
        }
    };
    match part {
        RecordedPart::Nearest(bundles) => {
            bundles.iter().enumerate().for_each(|(b, (rays, _))| append(b, rays, &[]));
        }
        RecordedPart::Shadow(bundles) => {
            bundles.iter().enumerate().for_each(|(b, (rays, _))| append(b, rays.rays(), rays.lights()));
        }
    }
    narrow
}

/// What a peer said of a ray: distance and id of the hit, or whether something is between.
pub(crate) enum Said {
    Nearest(Option<(f32, u32)>),
    Blocked(bool),
}

/// Compares what a peer said with what is recorded.
pub(crate) fn judge(part: &RecordedPart, (b, i): Place, said: &Said, extent: f64, found: &mut Disagreements) {
    found.compared += 1;
    match (part, said) {
        (RecordedPart::Nearest(bundles), Said::Nearest(theirs)) => {
            let (rays, hits) = &bundles[b];
            let query = rays.query(i);
            let ours = hits[i].map(|hit| (hit.t, hit.primitive.0));
            let theirs = theirs.map(|(t, id)| (f64::from(t), id));
            let own = query.originating.map(|from| from.primitive.0);
            let start = if own.is_some() { START * extent } else { 0.0 };
            let same = |a: f64, b: f64| (a - b).abs() <= SAME * (extent + a.abs());
            let reason = match (ours, theirs) {
                (None, None) => return,
                (Some(ours), Some(theirs)) if ours.1 == theirs.1 && same(ours.0, theirs.0) => return,
                (Some(ours), _) if ours.0 <= 2.0 * start => "hit nearer than where single precision starts",
                (_, Some(theirs)) if Some(theirs.1) == own => "its own surface hit again, by rounding",
                (Some(ours), Some(theirs)) if ours.1 == theirs.1 => "same primitive, other distance: grazing",
                (Some(ours), Some(theirs)) if same(ours.0, theirs.0) => {
                    "other primitive at the same distance: an edge"
                }
                (Some(ours), None) if Some(ours.1) == own => "way out of its own surface not found: grazing",
                (Some(_), None) => "hit not found: an edge or a silhouette",
                (None, Some(_)) => "hit where there is none: an edge or a silhouette",
                (Some(ours), Some(theirs)) if ours.0 < theirs.0 => "farther hit: an edge or a silhouette",
                (Some(_), Some(_)) => "nearer hit: an edge or a silhouette",
            };
            found.add(reason, || {
                let (o, d) = (query.ray.origin(), query.ray.direction());
                format!("ray from {o} along {d}: ours {ours:?}, theirs {theirs:?}")
            });
        }
        (RecordedPart::Shadow(bundles), Said::Blocked(theirs)) => {
            let (rays, blocked) = &bundles[b];
            let reason = match (blocked[i], theirs) {
                (false, true) => "blocked, and ours is not: an edge, a silhouette or its own surface",
                (true, false) => "not blocked, and ours is: an edge, a silhouette or near the start",
                _ => return,
            };
            found.add(reason, || {
                let query = rays.query(i);
                format!("ray from {} along {}", query.ray.origin(), query.ray.direction())
            });
        }
        _ => unreachable!("a worker answers what it was asked"),
    }
}
