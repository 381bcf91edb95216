//! Tiny scenes and hand-made rays for `speer-1985`.
//!
//! In most scenes the target, a unit sphere round (0, 0, 10), is hit by rays along +z that start in the plane z = 0;
//! the first ray hits it at a distance of 9 and builds a cylinder of that length.

use rayset_engine::geometry::glam::{DVec3, dvec3};
use rayset_engine::geometry::{Ray, Side, Span, Sphere, Triangle};
use rayset_engine::scene::{Light, LightId, Material, ObjectId, Part, PrimitiveId, Scene, SceneBuilder};
use rayset_engine::{
    Backend, BlockerRule, CoherenceCounts, EndPlaneRule, InheritanceRule, IntersectionStrategy, LightRule,
    MatchRule, MissRule, Originating, OriginatingRule, RayQuery, RaySetIndex, Recording, ShadowQuery,
    SlabRule, Slot, Speer1985, Speer1985Options, Stats,
};

pub(crate) const LITERAL: Speer1985Options = Speer1985Options {
    misses: MissRule::Partition,
    light_rays: LightRule::Blocked,
    blocker: BlockerRule::Nearest,
    slab: SlabRule::Overlapping,
    end_planes: EndPlaneRule::SideOnly,
    matching: MatchRule::AnyOrigin,
    inheritance: InheritanceRule::Formative,
    originating: OriginatingRule::Excluded,
    audit: true,
};

pub(crate) const TARGET: (DVec3, f64) = (DVec3::new(0.0, 0.0, 10.0), 1.0);

/// A scene of spheres, an object each, and of a triangle as the last object if there is one.
pub(crate) fn scene_with(spheres: &[(DVec3, f64)], triangle: Option<Triangle>) -> Scene {
    let mut builder = SceneBuilder::new();
    let material = builder.add_material(Material::default());
    for &(center, radius) in spheres {
        builder.add_object("sphere", material, [Sphere::new(center, radius)]);
    }
    if let Some(triangle) = triangle {
        builder.add_object("triangle", material, [Part::from(triangle)]);
    }
    builder.build().unwrap()
}

pub(crate) fn spheres(spheres: &[(DVec3, f64)]) -> Scene {
    scene_with(spheres, None)
}

/// The initial ray of ray-set `n`.
pub(crate) fn initial(n: u32, origin: DVec3, direction: DVec3) -> RayQuery {
    let ray = Ray::new(origin, direction);
    RayQuery { ray_set: RaySetIndex(n), slot: Slot::ROOT, originating: None, ray, span: Span::FORWARD }
}

/// The initial ray of ray-set `n` along +z, from (x, 0, 0).
pub(crate) fn along_z(n: u32, x: f64) -> RayQuery {
    initial(n, dvec3(x, 0.0, 0.0), DVec3::Z)
}

/// The ray as it leaves an object of one primitive.
pub(crate) fn leaving(query: RayQuery, object: u32, side: Side) -> RayQuery {
    let originating = Originating { object: ObjectId(object), primitive: PrimitiveId(object), side };
    RayQuery { slot: Slot(2), originating: Some(originating), ..query }
}

/// The ray as a light ray of the first light, leaving object 0, up to the light at distance `end`.
pub(crate) fn to_light(query: RayQuery, end: f64) -> ShadowQuery {
    let RayQuery { ray_set, slot, ray, .. } = query;
    let originating = Originating { object: ObjectId(0), primitive: PrimitiveId(0), side: Side::Front };
    ShadowQuery { ray_set, slot, light: LightId(0), originating, ray, span: Span { start: 0.0, end } }
}

/// Which objects the rays are said to hit.
pub(crate) fn hits(
    scene: &Scene,
    options: Speer1985Options,
    queries: &[RayQuery],
) -> (Vec<Option<u32>>, CoherenceCounts, Stats) {
    let strategy = Speer1985::on(scene, Backend::Scalar, options);
    let mut tracer = strategy.begin_sweep(Recording::Off);
    let hits = queries.iter().map(|query| tracer.nearest(query).map(|hit| hit.object.0)).collect();
    let stats = tracer.stats().clone();
    assert_consistent(&stats, queries.len());
    (hits, stats.coherence.total(), stats)
}

/// Which light rays are said to be blocked.
pub(crate) fn blocked(
    scene: &Scene,
    options: Speer1985Options,
    queries: &[ShadowQuery],
) -> (Vec<bool>, CoherenceCounts, Stats) {
    let strategy = Speer1985::on(scene, Backend::Scalar, options);
    let mut tracer = strategy.begin_sweep(Recording::Off);
    let blocked = queries.iter().map(|query| tracer.occluded(query)).collect();
    let stats = tracer.stats().clone();
    assert_consistent(&stats, queries.len());
    (blocked, stats.coherence.total(), stats)
}

pub(crate) fn assert_consistent(stats: &Stats, rays: usize) {
    let total = stats.coherence.total();
    assert_eq!(total.coherent + stats.work.partitions, rays as u64, "{stats}");
    assert_eq!(total.guided, total.predicted_missed + total.pierced + total.coherent, "{stats}");
    assert!(total.false_coherence <= total.pierced && total.wrong <= total.coherent, "{stats}");
}

/// Two spheres on the z axis, so that one is left and the other hit, and lights.
pub(crate) fn scene_with_lights(n: usize) -> Scene {
    let mut builder = SceneBuilder::new();
    let material = builder.add_material(Material::default());
    for (center, radius) in [(dvec3(0.0, 0.0, -1.0), 1.0), TARGET] {
        builder.add_object("sphere", material, [Sphere::new(center, radius)]);
    }
    (0..n).for_each(|_| {
        builder.add_light(Light::point(dvec3(0.0, 0.0, 20.0), DVec3::ONE));
    });
    builder.build().unwrap()
}
