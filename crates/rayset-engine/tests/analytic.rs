//! Radiance that is known in closed form.

use rayset_engine::geometry::glam::{DVec3, dvec3};
use rayset_engine::geometry::{Polygon, Ray, Sides, Sphere, Triangle};
use rayset_engine::scene::{Light, Material, Part, Scene, SceneBuilder};
use rayset_engine::{
    IntersectionTrees, LightState, RayCounts, RaySetIndex, RaySets, Recording, Shading, StrategyKind,
    TreeOptions, shade,
};

const BACKGROUND: DVec3 = DVec3::new(0.2, 0.3, 0.5);

/// No cut-off, and depth enough for all that is worked out here.
const DEEP: TreeOptions = TreeOptions { max_depth: 6, cutoff: None };

/// Nothing but what is asked for.
const BLACK: Material = Material {
    diffuse: DVec3::ZERO,
    specular: DVec3::ZERO,
    shininess: 1.0,
    reflectance: DVec3::ZERO,
    transmittance: DVec3::ZERO,
    index: 1.0,
    emission: DVec3::ZERO,
};

/// Objects with a material each, and lights.
fn scene(objects: Vec<(Material, Vec<Part>)>, lights: &[Light]) -> Scene {
    let mut builder = SceneBuilder::new();
    builder.background(BACKGROUND);
    for (material, parts) in objects {
        let material = builder.add_material(material);
        builder.add_object("object", material, parts);
    }
    for light in lights {
        builder.add_light(*light);
    }
    builder.build().unwrap()
}

/// The radiance along one ray, the tree it comes from, and the rays it took; the same for every strategy.
fn trace(scene: &Scene, ray: Ray, options: &TreeOptions) -> (DVec3, IntersectionTrees, RayCounts) {
    let results = StrategyKind::ALL.iter().map(|kind| {
        let strategy = kind.bind(scene);
        let mut tracer = strategy.begin_sweep(Recording::Off);
        let mut ray_sets = RaySets::default();
        let trees = ray_sets.grow(scene, tracer.as_mut(), RaySetIndex(0), [ray], options).clone();
        let mut radiance = Vec::new();
        shade(&trees, scene, &mut Shading::default(), &mut radiance);
        (radiance[0], trees, *ray_sets.counts())
    });
    let mut results: Vec<_> = results.collect();
    for (radiance, _, counts) in &results[1..] {
        assert_eq!(radiance.to_array().map(f64::to_bits), results[0].0.to_array().map(f64::to_bits));
        assert_eq!(*counts, results[0].2);
    }
    results.swap_remove(0)
}

/// Fails unless two vectors agree to a few roundings.
fn assert_close(actual: DVec3, expected: DVec3) {
    assert!((actual - expected).length() <= 1e-14 * expected.length(), "{actual}, should be {expected}");
}

fn ball(material: Material, center: DVec3, radius: f64) -> (Material, Vec<Part>) {
    (material, vec![Sphere::new(center, radius).into()])
}

/// The ray that comes down the z axis at a distance `x` from it.
fn down(x: f64) -> Ray {
    Ray::new(dvec3(x, 0.0, 5.0), -DVec3::Z)
}

const MIRROR: Material = Material {
    diffuse: DVec3::new(0.3, 0.2, 0.1),
    specular: DVec3::new(0.5, 0.25, 0.125),
    shininess: 2.0,
    reflectance: DVec3::new(0.4, 0.5, 0.6),
    ..BLACK
};

#[test]
fn mirror_sphere_adds_diffuse_highlight_and_what_it_mirrors() {
    // The ray meets the unit sphere at P = (0.6, 0, 0.8) = N. The light is at P + 5 L with L = (0, 0.6, 0.8), so
    // N . L = 0.64, and R = 2 (N . L) N - L = (0.768, -0.6, 0.224), so R . V = 0.224 for V = (0, 0, 1).
    // The mirrored ray leaves along d - 2 (N . d) N = (0.96, 0, 0.28) and sees the background.
    let light = Light::point(dvec3(0.6, 3.0, 4.8), dvec3(1.0, 2.0, 3.0));
    let (radiance, trees, counts) =
        trace(&scene(vec![ball(MIRROR, DVec3::ZERO, 1.0)], &[light]), down(0.6), &DEEP);
    let answer = MIRROR.diffuse * 0.64 + MIRROR.specular * (0.224 * 0.224);
    assert_close(radiance, light.color() * answer + MIRROR.reflectance * BACKGROUND);
    assert_close(trees.node(1).direction, dvec3(0.96, 0.0, 0.28));
    assert_eq!((counts.initial.hit, counts.reflected.cast, counts.reflected.hit), (1, 1, 0));
    assert_eq!((counts.refracted.cast, counts.shadow.cast, counts.shadow.hit), (0, 1, 0));
}

#[test]
fn highlight_more_than_a_right_angle_from_the_mirror_direction_is_dark() {
    // At the pole N = (0, 1, 0) with L = (-0.28, 0.96, 0): N . L = 0.96 and R = (0.28, 0.96, 0).
    // V = (-0.8, 0.6, 0) has R . V = 0.352; V along (-20, 1, 0) has R . V < 0, whose square would shine.
    let light = Light::directional(dvec3(-0.28, 0.96, 0.0), DVec3::ONE);
    let material = Material { reflectance: DVec3::ZERO, ..MIRROR };
    let scene = scene(vec![ball(material, DVec3::ZERO, 1.0)], &[light]);
    for (towards_eye, highlight) in
        [(dvec3(-0.8, 0.6, 0.0), 0.352 * 0.352), (dvec3(-20.0, 1.0, 0.0) / 401.0_f64.sqrt(), 0.0)]
    {
        let ray = Ray::new(DVec3::Y + 5.0 * towards_eye, -towards_eye);
        let (radiance, ..) = trace(&scene, ray, &DEEP);
        let expected = material.diffuse * 0.96 + material.specular * highlight;
        // The grazing ray finds the pole with an error of some 20 roundings.
        assert!((radiance - expected).length() < 1e-13, "{radiance}, should be {expected}");
    }
}

#[test]
fn emission_and_ambient_light_need_no_light() {
    let material = Material { emission: dvec3(0.1, 0.2, 0.3), diffuse: dvec3(0.5, 0.4, 0.3), ..BLACK };
    let mut builder = SceneBuilder::new();
    let glowing = builder.add_material(material);
    builder.ambient(dvec3(0.2, 0.4, 0.6)).add_object("ball", glowing, [Sphere::new(DVec3::ZERO, 1.0)]);
    let (radiance, ..) = trace(&builder.build().unwrap(), down(0.3), &DEEP);
    assert_close(radiance, dvec3(0.1 + 0.2 * 0.5, 0.2 + 0.4 * 0.4, 0.3 + 0.6 * 0.3));
}

#[test]
fn light_that_is_hidden_or_behind_the_surface_adds_nothing() {
    let matt = Material { diffuse: DVec3::splat(0.5), ..BLACK };
    // Seen from (0, 0, 1), where the normal is +z.
    let light = |z: f64| Light::point(dvec3(0.0, 3.0, z), DVec3::ONE);
    let cosine = |z: f64| (z - 1.0) / f64::sqrt(9.0 + (z - 1.0) * (z - 1.0));
    let target = || ball(matt, DVec3::ZERO, 1.0);
    // Spheres on the line from (0, 0, 1) to (0, 3, 5), before and behind the light, and before the point.
    let on_the_line = |s: f64| ball(BLACK, dvec3(0.0, 3.0 * s, 1.0 + 4.0 * s), 0.4);
    let lit = DVec3::splat(0.5 * cosine(5.0));
    for (name, objects, light, expected, cast, hidden) in [
        ("nothing between", vec![target()], light(5.0), lit, 1, 0),
        ("a sphere between", vec![target(), on_the_line(0.5)], light(5.0), DVec3::ZERO, 1, 1),
        ("a sphere behind the light", vec![target(), on_the_line(1.2)], light(5.0), lit, 1, 0),
        ("the light in a sphere", vec![target(), on_the_line(1.0)], light(5.0), DVec3::ZERO, 1, 1),
        ("a sphere on the other side", vec![target(), on_the_line(-0.8)], light(5.0), lit, 1, 0),
        ("the light below the horizon", vec![target()], light(0.5), DVec3::ZERO, 0, 0),
        ("the light in the tangent plane", vec![target()], light(1.0), DVec3::ZERO, 0, 0),
        (
            "a sphere before a directional light",
            vec![target(), on_the_line(50.0)],
            Light::directional(dvec3(0.0, 3.0, 4.0), DVec3::ONE),
            DVec3::ZERO,
            1,
            1,
        ),
    ] {
        let scene = scene(objects, &[light]);
        let (radiance, trees, counts) = trace(&scene, down(0.0), &DEEP);
        assert!((radiance - expected).length() < 1e-14, "{name}: {radiance}, should be {expected}");
        assert_eq!((counts.shadow.cast, counts.shadow.hit), (cast, hidden), "{name}");
        let state = match (cast, hidden) {
            (0, _) => LightState::FacesAway,
            (_, 0) => LightState::Visible,
            _ => LightState::Hidden,
        };
        assert_eq!(trees.lights_of(0), [state], "{name}");
    }
}

#[test]
fn blocker_hides_a_light_only_on_the_sides_from_which_it_is_visible() {
    let matt = Material { diffuse: DVec3::splat(0.5), ..BLACK };
    let light = Light::point(dvec3(0.0, 0.0, 9.0), DVec3::ONE);
    // Counterclockwise for an eye above, where the light is: rays from below come to its back.
    let pane = Triangle::new(dvec3(-1.0, -1.0, 4.0), dvec3(1.0, -1.0, 4.0), dvec3(0.0, 1.0, 4.0));
    for (sides, is_hidden) in [(Sides::Front, false), (Sides::Back, true), (Sides::Both, true)] {
        let blocker = (BLACK, vec![Part { sides, ..pane.into() }]);
        let scene = scene(vec![ball(matt, DVec3::ZERO, 1.0), blocker], &[light]);
        let ray = Ray::between(dvec3(3.0, 0.0, 2.0), DVec3::Z).unwrap();
        let (_, _, counts) = trace(&scene, ray, &DEEP);
        assert_eq!(counts.shadow.hit == 1, is_hidden, "{sides:?}");
    }
}

const GLASS: Material = Material { transmittance: DVec3::new(0.9, 0.8, 0.7), index: 1.5, ..BLACK };

/// No ray that adds nothing is spawned.
const NO_EMPTY_RAYS: TreeOptions = TreeOptions { max_depth: 6, cutoff: Some(1e-9) };

#[test]
fn central_ray_goes_straight_through_a_glass_sphere() {
    let (radiance, trees, counts) =
        trace(&scene(vec![ball(GLASS, DVec3::ZERO, 1.0)], &[]), down(0.0), &NO_EMPTY_RAYS);
    assert_close(radiance, GLASS.transmittance * GLASS.transmittance * BACKGROUND);
    assert!(trees.nodes().all(|node| node.direction == -DVec3::Z));
    assert_eq!((counts.refracted.cast, counts.refracted.hit, counts.reflected.cast), (2, 1, 0));
}

#[test]
fn ray_off_the_centre_follows_snells_law_through_both_surfaces() {
    // At a distance 0.6 from the axis sin(i) = 0.6 and, with index 1.5, sin(r) = 0.4: cos(i) = 0.8 and
    // cos(r) = sqrt(0.84). Each surface turns the ray by i - r towards the axis.
    let (cos_r, sin_r) = (0.84_f64.sqrt(), 0.4);
    let (cos_turn, sin_turn) = (0.8 * cos_r + 0.6 * sin_r, 0.6 * cos_r - 0.8 * sin_r);
    let inside = dvec3(-sin_turn, 0.0, -cos_turn);
    // Twice the angle: cos 2a = c^2 - s^2, sin 2a = 2 s c.
    let outside = dvec3(-2.0 * sin_turn * cos_turn, 0.0, sin_turn * sin_turn - cos_turn * cos_turn);
    // Inside it runs along a chord of length 2 cos(r).
    let exit = dvec3(0.6, 0.0, 0.8) + 2.0 * cos_r * inside;

    // A matt wall at z = -3 with a light at (0, 6, 0) shows where the ray arrives: N . L there depends on x.
    let matt = Material { diffuse: DVec3::ONE, ..BLACK };
    let corner = |x: f64, y: f64| dvec3(x, y, -3.0);
    let corners = vec![corner(-9.0, -9.0), corner(9.0, -9.0), corner(9.0, 9.0), corner(-9.0, 9.0)];
    let wall = (matt, vec![Polygon::new(corners).unwrap().into()]);
    let light = Light::point(dvec3(0.0, 6.0, 0.0), DVec3::ONE);
    let scene = scene(vec![ball(GLASS, DVec3::ZERO, 1.0), wall], &[light]);
    let (radiance, trees, _) = trace(&scene, down(0.6), &NO_EMPTY_RAYS);

    let directions: Vec<DVec3> = trees.nodes().map(|node| node.direction).collect();
    assert_eq!(directions.len(), 3);
    assert_close(directions[1], inside);
    assert_close(directions[2], outside);
    assert_close(trees.node(1).hit.unwrap().1.point, exit);
    let arrival = exit + (-3.0 - exit.z) / outside.z * outside;
    assert!((trees.node(2).hit.unwrap().1.point - arrival).length() < 1e-14);
    let to_light = dvec3(0.0, 6.0, 0.0) - arrival;
    let cosine = to_light.z / to_light.length();
    assert_close(radiance, GLASS.transmittance * GLASS.transmittance * cosine);
    assert_eq!(trees.lights_of(2), [LightState::Visible]);
}

#[test]
fn index_of_one_bends_nothing() {
    let glass = Material { index: 1.0, ..GLASS };
    let (radiance, trees, _) =
        trace(&scene(vec![ball(glass, DVec3::ZERO, 1.0)], &[]), down(0.7), &NO_EMPTY_RAYS);
    assert_close(radiance, GLASS.transmittance * GLASS.transmittance * BACKGROUND);
    assert!(trees.nodes().all(|node| node.direction == -DVec3::Z));
}

/// A prism whose section in the plane z = 0 is the triangle (0, 0), (1, 0), (0, 1): three faces of two triangles.
fn prism() -> Vec<Part> {
    let corner = |x: f64, y: f64, z: f64| dvec3(x, y, z);
    let face = |a: (f64, f64), b: (f64, f64)| {
        // Outwards when the section is walked counterclockwise.
        let [a0, b0, b1, a1] =
            [corner(a.0, a.1, -2.0), corner(b.0, b.1, -2.0), corner(b.0, b.1, 2.0), corner(a.0, a.1, 2.0)];
        [Part::from(Triangle::new(a0, b0, b1)), Triangle::new(a0, b1, a1).into()]
    };
    let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)];
    (0..3).flat_map(|i| face(corners[i], corners[(i + 1) % 3])).collect()
}

#[test]
fn prism_reflects_totally_at_its_long_face() {
    // The ray enters the face x = 0 at a right angle, meets the face x + y = 1 at 45 degrees, where
    // 1.5 sin(45) > 1, turns down, and leaves through the face y = 0 at a right angle.
    let glass =
        Material { reflectance: DVec3::splat(0.1), transmittance: DVec3::splat(0.8), index: 1.5, ..BLACK };
    let options = TreeOptions { max_depth: 4, cutoff: None };
    let ray = Ray::new(dvec3(-3.0, 0.3, 0.125), DVec3::X);
    let (radiance, trees, counts) = trace(&scene(vec![(glass, prism())], &[]), ray, &options);
    // Outside, the entering ray reflects 0.1 of the background. Inside, all 0.9 go on along the one reflected ray.
    // Where it leaves, 0.8 of the background come in; what is reflected there hits the glass at depth 4: black.
    assert_close(radiance, (0.1 + 0.8 * 0.9 * 0.8) * BACKGROUND);
    let total: Vec<_> = trees.nodes().filter(|node| node.reflects_totally).collect();
    assert_eq!(total.len(), 1);
    assert_close(total[0].hit.unwrap().1.point, dvec3(0.7, 0.3, 0.125));
    assert_eq!((counts.reflected.cast, counts.refracted.cast), (3, 2));
    let last = trees.nodes().last().unwrap();
    assert!((last.direction + DVec3::Y).length() < 1e-15 && last.hit.is_none(), "{}", last.direction);
}

#[test]
fn prism_of_thin_glass_lets_the_ray_out_at_its_long_face() {
    // 1.2 sin(45) = 0.8485: sin(r)^2 = 0.72, and the ray turns towards the face.
    let glass = Material { index: 1.2, ..GLASS };
    let ray = Ray::new(dvec3(-3.0, 0.3, 0.125), DVec3::X);
    let (radiance, trees, _) = trace(&scene(vec![(glass, prism())], &[]), ray, &NO_EMPTY_RAYS);
    assert_close(radiance, GLASS.transmittance * GLASS.transmittance * BACKGROUND);
    let (along_normal, along_face) = (0.28_f64.sqrt(), 0.72_f64.sqrt());
    let [normal, face] = [dvec3(1.0, 1.0, 0.0), dvec3(1.0, -1.0, 0.0)].map(|v| v * 0.5_f64.sqrt());
    assert_close(trees.node(2).direction, along_normal * normal + along_face * face);
}

#[test]
fn reflections_inside_a_sphere_add_up_until_depth_or_cut_off() {
    // From the centre every ray comes back: emission e, reflectance 1/2, so e (1 + 1/2 + 1/4 + ...).
    let glowing = Material { emission: dvec3(1.0, 2.0, 4.0), reflectance: DVec3::splat(0.5), ..BLACK };
    let scene = scene(vec![ball(glowing, DVec3::ZERO, 1.0)], &[]);
    let ray = Ray::new(DVec3::ZERO, DVec3::X);
    for (max_depth, cutoff, sum) in [
        (1, None, 1.0),
        (3, None, 1.75),
        (6, None, 1.96875),
        // The ray of weight 1/4 is still cast, the one of 1/8 no more.
        (6, Some(0.25), 1.75),
        (6, Some(0.250_000_1), 1.5),
        (2, Some(0.25), 1.5),
    ] {
        let (radiance, ..) = trace(&scene, ray, &TreeOptions { max_depth, cutoff });
        assert_close(radiance, sum * glowing.emission);
    }
}
