//! Where section 2.3, taken literally, is wrong: each known hole as a scene, and that the audit sees it.

mod rays;
mod scenes;

use rays::{
    LITERAL, TARGET, along_z, blocked, hits, initial, leaving, scene_with, scene_with_lights, spheres,
    to_light,
};
use rayset_engine::geometry::glam::{DVec3, dvec3};
use rayset_engine::geometry::{Side, Triangle};
use rayset_engine::scene::Scene;
use rayset_engine::{
    Backend, EndPlaneRule, LightRule, MatchRule, RayQuery, RenderOptions, SlabRule, Speer1985,
    Speer1985Options, render,
};

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
