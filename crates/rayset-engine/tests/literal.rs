//! `speer-1985`, case by case: what it does, what each choice of reading changes, and where the text is wrong.
//!
//! In most scenes the target, a unit sphere round (0, 0, 10), is hit by rays along +z that start in the plane z = 0;
//! the first ray hits it at a distance of 9 and builds a cylinder of that length.

mod scenes;

use rayset_engine::geometry::glam::{DVec3, dvec3};
use rayset_engine::geometry::{Ray, Side, Span, Sphere, Triangle, unit};
use rayset_engine::scene::{LightId, Material, ObjectId, Part, PrimitiveId, Scene, SceneBuilder};
use rayset_engine::{
    Backend, BlockerRule, CoherenceCounts, EndPlaneRule, InheritanceRule, IntersectionStrategy, LightRule,
    MatchRule, MissRule, Originating, OriginatingRule, RayQuery, RaySetIndex, Recording, RenderOptions,
    ShadowQuery, SlabRule, Slot, Speer1985, Speer1985Options, Stats, render,
};

const LITERAL: Speer1985Options = Speer1985Options {
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

const TARGET: (DVec3, f64) = (DVec3::new(0.0, 0.0, 10.0), 1.0);

/// A scene of spheres, an object each, and of a triangle as the last object if there is one.
fn scene_with(spheres: &[(DVec3, f64)], triangle: Option<Triangle>) -> Scene {
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

fn spheres(spheres: &[(DVec3, f64)]) -> Scene {
    scene_with(spheres, None)
}

/// The initial ray of ray-set `n`.
fn initial(n: u32, origin: DVec3, direction: DVec3) -> RayQuery {
    let ray = Ray::new(origin, direction);
    RayQuery { ray_set: RaySetIndex(n), slot: Slot::ROOT, originating: None, ray, span: Span::FORWARD }
}

/// The initial ray of ray-set `n` along +z, from (x, 0, 0).
fn along_z(n: u32, x: f64) -> RayQuery {
    initial(n, dvec3(x, 0.0, 0.0), DVec3::Z)
}

/// The ray as it leaves an object of one primitive.
fn leaving(query: RayQuery, object: u32, side: Side) -> RayQuery {
    let originating = Originating { object: ObjectId(object), primitive: PrimitiveId(object), side };
    RayQuery { slot: Slot(2), originating: Some(originating), ..query }
}

/// The ray as a light ray of the first light, leaving object 0, up to the light at distance `end`.
fn to_light(query: RayQuery, end: f64) -> ShadowQuery {
    let RayQuery { ray_set, slot, ray, .. } = query;
    let originating = Originating { object: ObjectId(0), primitive: PrimitiveId(0), side: Side::Front };
    ShadowQuery { ray_set, slot, light: LightId(0), originating, ray, span: Span { start: 0.0, end } }
}

/// Which objects the rays are said to hit.
fn hits(
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
fn blocked(
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

fn assert_consistent(stats: &Stats, rays: usize) {
    let total = stats.coherence.total();
    assert_eq!(total.coherent + stats.work.partitions, rays as u64, "{stats}");
    assert_eq!(total.guided, total.predicted_missed + total.pierced + total.coherent, "{stats}");
    assert!(total.false_coherence <= total.pierced && total.wrong <= total.coherent, "{stats}");
}

// What the text says.

#[test]
fn ray_that_hits_the_predicted_object_inside_the_cylinder_is_coherent() {
    let scene = spheres(&[TARGET, (dvec3(3.0, 0.0, 5.0), 1.0)]);
    let (hits, counts, stats) = hits(&scene, LITERAL, &[along_z(0, 0.0), along_z(1, 0.1)]);
    assert_eq!(hits, [Some(0), Some(0)]);
    assert_eq!(counts, CoherenceCounts { guided: 1, coherent: 1, ..CoherenceCounts::default() });
    assert_eq!((stats.work.partitions, stats.work.volumes_classified), (1, 2));
    // The target twice; the other sphere is the one member of N.
    assert_eq!((stats.work.primitive_tests, stats.work.pierce_checks), (2, 1));
    assert_eq!((stats.work.cylinders_built, stats.work.radius_comparisons), (1, 1));
    // Radius 2 and length 9, in units of the extent 11.
    let bin = |histogram: &rayset_engine::Histogram| {
        histogram.bins().map(|(low, high, n)| (low..high, n)).next().unwrap()
    };
    let ((radius, n_radii), (length, n_lengths)) = (bin(&stats.radii), bin(&stats.lengths));
    assert!(radius.contains(&(2.0 / 11.0)) && length.contains(&(9.0 / 11.0)), "{radius:?} {length:?}");
    assert_eq!((n_radii, n_lengths), (1, 1));
}

#[test]
fn ray_that_misses_the_predicted_object_is_partitioned() {
    let scene = spheres(&[TARGET]);
    let (hits, counts, _) = hits(&scene, LITERAL, &[along_z(0, 0.0), along_z(1, 1.5), along_z(2, 0.0)]);
    assert_eq!(hits, [Some(0), None, Some(0)]);
    // The miss left nothing to guide the third.
    assert_eq!(counts, CoherenceCounts { guided: 1, predicted_missed: 1, ..CoherenceCounts::default() });
}

#[test]
fn ray_that_pierces_the_cylinder_is_partitioned_and_figure_2_is_caught() {
    // The small sphere limits the radius to 0.3.
    let scene = spheres(&[TARGET, (dvec3(0.6, 0.0, 5.0), 0.3)]);
    let (there, counts, _) = hits(&scene, LITERAL, &[along_z(0, 0.0), along_z(1, 0.35)]);
    assert_eq!(there, [Some(0), Some(1)], "the small sphere intercepts the ray");
    assert_eq!(
        counts,
        CoherenceCounts { guided: 1, pierced: 1, false_coherence: 1, ..CoherenceCounts::default() }
    );
    let (there, counts, _) = hits(&scene, LITERAL, &[along_z(0, 0.0), along_z(1, -0.35)]);
    assert_eq!(there, [Some(0), Some(0)], "nothing intercepts this one");
    assert_eq!(counts, CoherenceCounts { guided: 1, pierced: 1, ..CoherenceCounts::default() });
}

#[test]
fn either_end_of_the_segment_may_pierce() {
    let scene = spheres(&[TARGET, (dvec3(0.0, 2.0, 5.0), 1.5)]);
    let towards = |n: u32, from: DVec3, to: DVec3| initial(n, from, unit(to - from).unwrap());
    let front = dvec3(0.0, 0.0, 9.0);
    for (query, is_coherent) in [
        (towards(1, dvec3(0.45, 0.0, 0.0), front), true),
        (towards(1, dvec3(0.55, 0.0, 0.0), front), false),
        (towards(1, DVec3::ZERO, front + dvec3(0.45, 0.0, 0.1)), true),
        (towards(1, DVec3::ZERO, front + dvec3(0.55, 0.0, 0.2)), false),
    ] {
        let (_, counts, _) = hits(&scene, LITERAL, &[along_z(0, 0.0), query]);
        assert_eq!((counts.coherent == 1, counts.pierced == 0), (is_coherent, is_coherent), "{query:?}");
    }
}

#[test]
fn entry_guides_the_next_ray_set_only() {
    let scene = spheres(&[TARGET]);
    for (ray_sets, guided) in [([0, 1, 2], 2), ([0, 2, 3], 1), ([0, 2, 4], 0), ([7, 8, 10], 1)] {
        let (_, counts, _) = hits(&scene, LITERAL, &ray_sets.map(|n| along_z(n, 0.1)));
        assert_eq!((counts.guided, counts.coherent), (guided, guided), "{ray_sets:?}");
    }
}

#[test]
fn only_rays_of_one_slot_guide_each_other() {
    let scene = spheres(&[TARGET]);
    let slot = |query, slot| RayQuery { slot: Slot(slot), ..query };
    // A slot beyond those found by index, too.
    for (first, second, guided) in [(2, 2, 1), (2, 3, 0), (1 << 14, 1 << 14, 1), (1 << 14, 1 << 13, 0)] {
        let queries = [slot(along_z(0, 0.0), first), slot(along_z(1, 0.1), second)];
        let (_, counts, _) = hits(&scene, LITERAL, &queries);
        assert_eq!(counts.guided, guided, "{first} {second}");
    }
}

#[test]
fn light_rays_guide_each_other_by_slot_and_light() {
    let scene = scene_with_lights(2);
    let query = |n, slot, light| ShadowQuery {
        slot: Slot(slot),
        light: LightId(light),
        ..to_light(along_z(n, 0.0), 20.0)
    };
    for (first, second, guided) in
        [((1, 0), (1, 0), 1), ((1, 0), (1, 1), 0), ((1, 1), (2, 0), 0), ((3, 1), (3, 1), 1)]
    {
        let queries = [query(0, first.0, first.1), query(1, second.0, second.1)];
        let (there, counts, _) = blocked(&scene, LITERAL, &queries);
        assert_eq!((there, counts.guided), (vec![true, true], guided), "{first:?} {second:?}");
    }
}

/// Two spheres on the z axis, so that one is left and the other hit, and lights.
fn scene_with_lights(n: usize) -> Scene {
    let mut builder = SceneBuilder::new();
    let material = builder.add_material(Material::default());
    for (center, radius) in [(dvec3(0.0, 0.0, -1.0), 1.0), TARGET] {
        builder.add_object("sphere", material, [Sphere::new(center, radius)]);
    }
    (0..n).for_each(|_| {
        builder.add_light(rayset_engine::scene::Light::point(dvec3(0.0, 0.0, 20.0), DVec3::ONE));
    });
    builder.build().unwrap()
}

// What each choice changes.

#[test]
fn misses_are_coherent_only_with_a_cylinder_without_end() {
    let scene = spheres(&[(dvec3(3.0, 0.0, 5.0), 1.0)]);
    let tilted = initial(2, DVec3::ZERO, unit(dvec3(0.001, 0.0, 1.0)).unwrap());
    let queries = [along_z(0, 0.0), along_z(1, 0.5), tilted];
    let with_cylinder = Speer1985Options { misses: MissRule::Cylinder, ..LITERAL };
    for (options, expected) in [(LITERAL, (0, 0, 0)), (with_cylinder, (2, 1, 1))] {
        let (there, counts, stats) = hits(&scene, options, &queries);
        assert_eq!(there, [None, None, None]);
        assert_eq!((counts.guided, counts.coherent, counts.pierced), expected, "{options:?}");
        assert_eq!(stats.lengths.infinite(), stats.work.cylinders_built);
    }
    // With N empty the radius is infinite, and no direction pierces.
    let behind = spheres(&[(dvec3(0.0, 0.0, -5.0), 1.0)]);
    let (_, counts, _) = hits(&behind, with_cylinder, &queries);
    assert_eq!(counts.coherent, 2);
}

#[test]
fn light_rule_says_which_light_rays_are_coherent() {
    let scene = scene_with_lights(1);
    let blocked_rays = [to_light(along_z(0, 0.0), 20.0), to_light(along_z(1, 0.1), 20.0)];
    let free_rays = [to_light(along_z(0, 0.0), 8.0), to_light(along_z(1, 0.1), 8.0)];
    for (light_rays, coherent) in
        [(LightRule::Blocked, (1, 0)), (LightRule::All, (1, 1)), (LightRule::None, (0, 0))]
    {
        let options = Speer1985Options { light_rays, ..LITERAL };
        let (there, when_blocked, _) = blocked(&scene, options, &blocked_rays);
        assert_eq!(there, [true, true]);
        let (there, when_free, _) = blocked(&scene, options, &free_rays);
        assert_eq!(there, [false, false]);
        assert_eq!((when_blocked.coherent, when_free.coherent), coherent, "{light_rays:?}");
    }
}

#[test]
fn blocker_rule_says_which_blocker_is_predicted() {
    // Object 0 is left; object 1 is large and far, object 2 is small and near.
    let scene = spheres(&[(dvec3(0.0, 0.0, -1.0), 1.0), TARGET, (dvec3(0.0, 0.0, 5.0), 0.1)]);
    // The second ray misses the small blocker.
    let queries = [to_light(along_z(0, 0.0), 20.0), to_light(along_z(1, 0.2), 20.0)];
    for (blocker, missed, coherent) in [(BlockerRule::Nearest, 1, 0), (BlockerRule::First, 0, 1)] {
        let (there, counts, _) = blocked(&scene, Speer1985Options { blocker, ..LITERAL }, &queries);
        assert_eq!(there, [true, true]);
        assert_eq!((counts.predicted_missed, counts.coherent), (missed, coherent), "{blocker:?}");
    }
}

#[test]
fn slab_rule_says_which_volumes_limit_the_radius() {
    // A sphere that would limit the radius to 0.5, at several heights; the slab is from 0 to 9.
    for (name, z, expected) in [
        // Limits under: [Overlapping, Centre, Inside].
        ("inside", 5.0, [true, true, true]),
        ("over the far end, with its centre inside", 8.5, [true, true, false]),
        ("over the far end, with its centre outside", 9.5, [true, false, false]),
        ("beyond the far end", 10.5, [false, false, false]),
        ("over the bounding plane, with its centre in front", 0.5, [true, true, false]),
        ("over the bounding plane, with its centre behind", -0.5, [true, false, false]),
    ] {
        let scene = spheres(&[TARGET, (dvec3(0.0, 1.5, z), 1.0)]);
        for (slab, limits) in
            [SlabRule::Overlapping, SlabRule::Centre, SlabRule::Inside].into_iter().zip(expected)
        {
            // On the other side of the axis, so that every answer is right.
            let queries = [along_z(0, 0.0), initial(1, dvec3(0.0, -0.7, 0.0), DVec3::Z)];
            let (there, counts, _) = hits(&scene, Speer1985Options { slab, ..LITERAL }, &queries);
            assert_eq!(there, [Some(0), Some(0)]);
            assert_eq!(counts.pierced == 1, limits, "{name}, {slab:?}");
        }
    }
}

#[test]
fn closed_cylinder_is_pierced_through_its_ends() {
    let scene = spheres(&[TARGET]);
    let closed = Speer1985Options { end_planes: EndPlaneRule::Closed, ..LITERAL };
    let x_then_from = |x: f64, from: DVec3| [along_z(0, x), initial(1, from, DVec3::Z)];
    for (name, queries, coherent) in [
        ("hits farther than the formative ray", x_then_from(0.0, dvec3(0.5, 0.0, 0.1)), [1, 0]),
        ("starts behind the bounding plane", x_then_from(0.5, dvec3(0.4, 0.0, -0.1)), [1, 0]),
        ("starts on the bounding plane", x_then_from(0.5, dvec3(0.4, 0.0, 0.0)), [1, 0]),
        ("starts in front and hits nearer", x_then_from(0.5, dvec3(0.4, 0.0, 0.1)), [1, 1]),
    ] {
        let found = [LITERAL, closed].map(|options| hits(&scene, options, &queries).1.coherent);
        assert_eq!(found, coherent, "{name}: side only, closed");
    }
}

#[test]
fn match_rule_says_which_rays_correspond() {
    let scene = spheres(&[TARGET, (dvec3(0.0, 0.0, -1.0), 1.0), (dvec3(0.0, 0.0, -20.0), 1.0)]);
    let first = leaving(along_z(0, 0.0), 1, Side::Front);
    let rules = [MatchRule::AnyOrigin, MatchRule::SameObject, MatchRule::SameObjectAndSide];
    for (name, second, guided) in [
        ("the same", leaving(along_z(1, 0.1), 1, Side::Front), [1, 1, 1]),
        ("the other side", leaving(along_z(1, 0.1), 1, Side::Back), [1, 1, 0]),
        ("another object", leaving(along_z(1, 0.1), 2, Side::Front), [1, 0, 0]),
    ] {
        let found = rules.map(|matching| {
            hits(&scene, Speer1985Options { matching, ..LITERAL }, &[first, second]).1.guided
        });
        assert_eq!(found, guided, "{name}: {rules:?}");
    }
}

#[test]
fn inheritance_rule_says_whether_a_cylinder_serves_twice() {
    let scene = spheres(&[TARGET]);
    let queries = [0, 1, 2, 3, 4].map(|n| along_z(n, 0.1 * f64::from(n)));
    for (inheritance, coherent) in [(InheritanceRule::Formative, 4), (InheritanceRule::Nothing, 2)] {
        let (there, counts, _) = hits(&scene, Speer1985Options { inheritance, ..LITERAL }, &queries);
        assert_eq!(there, [Some(0); 5]);
        assert_eq!(counts.coherent, coherent, "{inheritance:?}");
    }
}

#[test]
fn inherited_cylinder_stays_that_of_the_formative_ray() {
    // The radius is 0.5: steps of 0.3 stay inside for one ray-set only, however near each is to the last.
    let scene = spheres(&[TARGET, (dvec3(0.0, 2.0, 5.0), 1.5)]);
    let (_, counts, stats) = hits(&scene, LITERAL, &[along_z(0, 0.0), along_z(1, 0.3), along_z(2, 0.6)]);
    assert_eq!((counts.coherent, counts.pierced, stats.work.partitions), (1, 1, 2));
}

#[test]
fn originating_rule_matters_where_the_partition_puts_the_originating_volume_into_n() {
    // The ray leaves object 1 at a distance of 0.1 from it.
    let scene = spheres(&[TARGET, (dvec3(1.1, 0.0, 1.0), 1.0)]);
    let queries = [leaving(along_z(0, 0.0), 1, Side::Front), leaving(along_z(1, -0.3), 1, Side::Front)];
    for (originating, coherent) in [(OriginatingRule::Excluded, 1), (OriginatingRule::Included, 0)] {
        let (there, counts, _) = hits(&scene, Speer1985Options { originating, ..LITERAL }, &queries);
        assert_eq!(there, [Some(0), Some(0)]);
        assert_eq!(counts.coherent, coherent, "{originating:?}");
    }
}

#[test]
fn originating_rule_changes_nothing_in_a_render() {
    // A ray starts inside the volume it leaves, within the margin of the partition: so that volume is in I.
    let options = RenderOptions { width: 24, height: 24, ..RenderOptions::default() };
    for test in &scenes::all() {
        let stats = [OriginatingRule::Excluded, OriginatingRule::Included].map(|originating| {
            let speer = Speer1985Options { originating, ..LITERAL };
            render(&Speer1985::on(&test.scene, Backend::active(), speer), &options).unwrap().stats
        });
        assert!(stats[0] == stats[1], "{}: {}{}", test.name, stats[0], stats[1]);
    }
}

// Where the text, taken literally, is wrong.

/// Fails unless the second ray is answered coherently with `said` where a partition finds `truth`, and the audit
/// counts it.
fn assert_wrong(
    scene: &Scene,
    options: Speer1985Options,
    queries: [RayQuery; 2],
    said: Option<u32>,
    truth: Option<u32>,
) {
    let (there, counts, _) = hits(scene, options, &queries);
    assert_eq!((there[1], counts.coherent, counts.wrong), (said, 1, 1));
    let (alone, ..) = hits(scene, options, &queries[1..]);
    assert_eq!(alone, [truth]);
}

#[test]
fn hole_a_ray_that_hits_beyond_the_end_plane_passes_what_was_not_checked() {
    // The small sphere begins beyond the end plane at 9, where the target curves away.
    let scene = spheres(&[TARGET, (dvec3(0.9, 0.0, 9.35), 0.2)]);
    assert_wrong(&scene, LITERAL, [along_z(0, 0.0), along_z(1, 0.85)], Some(0), Some(1));
    let closed = Speer1985Options { end_planes: EndPlaneRule::Closed, ..LITERAL };
    assert_eq!(hits(&scene, closed, &[along_z(0, 0.0), along_z(1, 0.85)]).1.wrong, 0);
}

#[test]
fn hole_b_intersected_volume_behind_the_hit_bulges_in_front_of_the_end_plane() {
    // The formative ray would leave the large sphere at 9.71, behind the hit at 9: it is in I and limits nothing.
    // At x = 0.9 it reaches to 8.33, in front of the end plane.
    let scene = spheres(&[TARGET, (dvec3(5.0, 0.0, 12.0), 5.5)]);
    assert_wrong(&scene, LITERAL, [along_z(0, 0.0), along_z(1, 0.9)], Some(0), Some(1));
}

#[test]
fn hole_c_intersected_volume_whose_contents_were_missed_limits_nothing() {
    // The formative ray passes the bounding sphere of the triangle, but not the triangle.
    let triangle = Triangle::new(dvec3(0.5, -1.0, 5.0), dvec3(0.5, 1.0, 5.0), dvec3(0.1, 1.0, 5.0));
    let scene = scene_with(&[TARGET], Some(triangle));
    let second = initial(1, dvec3(0.45, 0.2, 0.0), DVec3::Z);
    assert_wrong(&scene, LITERAL, [along_z(0, 0.0), second], Some(0), Some(1));
}

#[test]
fn hole_d_ray_that_starts_behind_the_bounding_plane_passes_what_was_discarded() {
    let scene = spheres(&[TARGET, (dvec3(0.5, 0.0, -2.0), 0.4)]);
    let second = initial(1, dvec3(0.5, 0.0, -5.0), DVec3::Z);
    assert_wrong(&scene, LITERAL, [along_z(0, 0.0), second], Some(0), Some(1));
}

#[test]
fn hole_e_ray_from_another_object_or_side_passes_what_the_formative_ray_left() {
    // The formative ray leaves object 1 at its pole (0, 0, 0): its volume is in I, and it cannot be hit again.
    let scene = spheres(&[TARGET, (dvec3(0.0, 0.0, -1.0), 1.0), (dvec3(0.0, 0.0, -20.0), 1.0)]);
    let first = leaving(along_z(0, 0.0), 1, Side::Front);
    // From object 2 behind it, the ray meets object 1; and so does one that crosses it from within.
    let from_behind = leaving(initial(1, dvec3(0.0, 0.0, -19.0), DVec3::Z), 2, Side::Front);
    let from_within = leaving(initial(1, dvec3(0.0, 0.0, -2.0), DVec3::Z), 1, Side::Back);
    for (second, cure) in [(from_behind, MatchRule::SameObject), (from_within, MatchRule::SameObjectAndSide)]
    {
        assert_wrong(&scene, LITERAL, [first, second], Some(0), Some(1));
        let cured = Speer1985Options { matching: cure, ..LITERAL };
        assert_eq!(hits(&scene, cured, &[first, second]).1.wrong, 0, "{cure:?}");
    }
}

#[test]
fn unblocked_light_ray_passes_a_blocker_beyond_the_reach_of_its_cylinder() {
    // The light of the second ray is farther away, and the blocker between lies beyond the end of the cylinder.
    let scene = scene_with_lights(1);
    let queries = [to_light(along_z(0, 0.0), 8.0), to_light(along_z(1, 0.0), 20.0)];
    let (there, counts, _) =
        blocked(&scene, Speer1985Options { light_rays: LightRule::All, ..LITERAL }, &queries);
    assert_eq!((there, counts.wrong), (vec![false, false], 1));
    assert_eq!(blocked(&scene, LITERAL, &queries).0, [false, true]);
}

#[test]
fn blocked_light_ray_is_never_wrong_whatever_the_cylinder() {
    // Any blocker is proof.
    let options = RenderOptions { width: 32, height: 32, ..RenderOptions::default() };
    let mut coherent = 0;
    for test in &scenes::all() {
        for slab in [SlabRule::Overlapping, SlabRule::Inside] {
            let speer = Speer1985Options { slab, ..LITERAL };
            let frame = render(&Speer1985::on(&test.scene, Backend::active(), speer), &options).unwrap();
            assert_eq!(frame.stats.coherence.shadow.wrong, 0, "{}", test.name);
            coherent += frame.stats.coherence.shadow.coherent;
        }
    }
    assert!(coherent > 0);
}

#[test]
fn every_ray_is_coherent_or_partitioned() {
    let options = RenderOptions { width: 32, height: 32, ..RenderOptions::default() };
    for test in &scenes::all() {
        let frame = render(&Speer1985::on(&test.scene, Backend::active(), LITERAL), &options).unwrap();
        let rays = usize::try_from(frame.counts.total().cast).unwrap();
        assert_consistent(&frame.stats, rays);
        for (kind, counts) in frame.stats.coherence.iter() {
            assert!(counts.guided <= frame.counts[kind].cast, "{}, {kind:?}", test.name);
            assert_eq!(counts.guided, counts.predicted_missed + counts.pierced + counts.coherent, "{kind:?}");
        }
    }
}
