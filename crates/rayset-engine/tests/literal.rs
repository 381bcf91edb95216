//! `speer-1985`, case by case: what it does, and what each choice of reading changes.

mod rays;
mod scenes;

use rays::{
    LITERAL, TARGET, along_z, assert_consistent, blocked, hits, initial, leaving, scene_with_lights, spheres,
    to_light,
};
use rayset_engine::geometry::glam::{DVec3, dvec3};
use rayset_engine::geometry::{Side, unit};
use rayset_engine::scene::LightId;
use rayset_engine::{
    Backend, BlockerRule, CoherenceCounts, EndPlaneRule, Histogram, InheritanceRule, LightRule, MatchRule,
    MissRule, OriginatingRule, RayQuery, RenderOptions, ShadowQuery, SlabRule, Slot, Speer1985,
    Speer1985Options, render,
};

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
    let bin = |histogram: &Histogram| histogram.bins().map(|(low, high, n)| (low..high, n)).next().unwrap();
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

// What each choice changes.

#[test]
fn misses_are_coherent_only_with_a_cylinder() {
    // The radius is 2, and the cylinder ends behind the sphere at 6.
    let scene = spheres(&[(dvec3(3.0, 0.0, 5.0), 1.0)]);
    let tilted = |n, x: f64| initial(n, DVec3::ZERO, unit(dvec3(-x, 0.0, 6.0)).unwrap());
    let queries = [along_z(0, 0.0), along_z(1, -1.9), tilted(2, 1.9), tilted(3, 2.1), tilted(4, -0.1)];
    let with_cylinder = Speer1985Options { misses: MissRule::Cylinder, ..LITERAL };
    for (options, expected) in [(LITERAL, (0, 0, 0)), (with_cylinder, (4, 3, 1))] {
        let (there, counts, stats) = hits(&scene, options, &queries);
        assert_eq!(there, [None; 5]);
        assert_eq!((counts.guided, counts.coherent, counts.pierced), expected, "{options:?}");
        assert_eq!(stats.work.cylinders_built, if options.misses == MissRule::Cylinder { 2 } else { 0 });
    }
    // With N empty the radius is infinite, and no direction pierces.
    let behind = spheres(&[(dvec3(0.0, 0.0, -5.0), 1.0)]);
    let (_, counts, stats) = hits(&behind, with_cylinder, &[along_z(0, 0.0), initial(1, DVec3::X, DVec3::Y)]);
    assert_eq!((counts.coherent, counts.wrong), (1, 0));
    assert_eq!((stats.radii.infinite(), stats.lengths.infinite()), (1, 1));
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
