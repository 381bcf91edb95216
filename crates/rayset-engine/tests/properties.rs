//! What holds for random scenes, rays and readings of the text.

mod pixels;
mod queries;

use pixels::assert_same_pixels;
use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::RngSeed;
use queries::{Query, queries_of};
use rayset_engine::geometry::glam::DVec3;
use rayset_engine::geometry::{Polygon, Span, Sphere, Triangle, unit};
use rayset_engine::scene::{Camera, Light, Material, Part, Scene, SceneBuilder};
use rayset_engine::{
    Backend, BlockerRule, ByKind, CoherenceCounts, DEPARTURE_MARGIN, EndPlaneRule, EyeRays, InheritanceRule,
    IntersectionStrategy, LightRule, MatchRule, MissRule, OriginatingRule, PixelOrder, RayKind, RayQuery,
    RayTally, Recording, RenderOptions, ShadowQuery, SlabRule, Slot, Speer1985, Speer1985Options, Standard,
    StrategyKind, SweepLength, render,
};

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(1985), ..ProptestConfig::default() }
}

/// A vector in the cube around the origin.
fn vector() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-1.0..1.0).prop_map(DVec3::from_array)
}

fn unit_vector() -> impl Strategy<Value = DVec3> {
    vector().prop_filter_map("the zero vector", unit)
}

fn material() -> impl Strategy<Value = Material> {
    let share = || select(vec![0.0, 0.0, 0.3, 0.9]);
    (share(), share(), share(), select(vec![1.0, 1.5, 0.7, 1e-3, 1e3])).prop_map(
        |(specular, mirror, glass, index)| Material {
            specular: DVec3::splat(specular),
            shininess: 8.0,
            reflectance: DVec3::splat(mirror),
            transmittance: DVec3::splat(glass),
            index,
            ..Material::default()
        },
    )
}

/// A few spheres, or a few triangles around a place, up to `size` large.
fn parts(size: f64) -> impl Strategy<Value = Vec<Part>> {
    let sphere =
        (vector(), 0.0..1.0).prop_map(move |(center, radius)| Sphere::new(center, size * radius).into());
    let triangle = (vector(), vector(), vector(), vector()).prop_map(move |(center, a, b, c)| {
        Triangle::new(center + size * a, center + size * b, center + size * c).into()
    });
    prop_oneof![sphere.prop_map(|sphere| vec![sphere]), prop::collection::vec(triangle, 1..12),]
}

/// A scene seen from somewhere, now and then from inside an object.
fn scene() -> impl Strategy<Value = Scene> {
    let objects = prop::collection::vec((material(), parts(0.5)), 0..12);
    let lights = prop::collection::vec((any::<bool>(), vector()), 0..3);
    (objects, lights, vector(), select(vec![0.5, 2.0, 4.0])).prop_filter_map(
        "no camera",
        |(objects, lights, from, far)| {
            let mut builder = SceneBuilder::new();
            builder.camera(Camera::new(far * from, DVec3::ZERO, DVec3::new(0.1, 1.0, 0.2), 50.0).ok()?);
            builder.background(DVec3::new(0.1, 0.2, 0.3));
            for (material, parts) in objects {
                let material = builder.add_material(material);
                builder.add_object("object", material, parts);
            }
            for (is_point, place) in lights {
                let color = DVec3::splat(0.5);
                builder.add_light(if is_point {
                    Light::point(4.0 * place, color)
                } else {
                    Light::directional(place, color)
                });
            }
            builder.build().ok()
        },
    )
}

fn reading() -> impl Strategy<Value = Speer1985Options> {
    (
        select(vec![MissRule::Partition, MissRule::Cylinder]),
        select(vec![LightRule::Blocked, LightRule::All, LightRule::None]),
        select(vec![BlockerRule::Nearest, BlockerRule::First]),
        select(vec![SlabRule::Overlapping, SlabRule::Centre, SlabRule::Inside]),
        select(vec![EndPlaneRule::SideOnly, EndPlaneRule::Closed]),
        select(vec![MatchRule::AnyOrigin, MatchRule::SameObject, MatchRule::SameObjectAndSide]),
        select(vec![InheritanceRule::Formative, InheritanceRule::Nothing]),
        select(vec![OriginatingRule::Excluded, OriginatingRule::Included]),
    )
        .prop_map(
            |(misses, light_rays, blocker, slab, end_planes, matching, inheritance, originating)| {
                Speer1985Options {
                    misses,
                    light_rays,
                    blocker,
                    slab,
                    end_planes,
                    matching,
                    inheritance,
                    originating,
                    audit: false,
                }
            },
        )
}

fn options() -> impl Strategy<Value = RenderOptions> {
    let order = select(vec![PixelOrder::Scanline, PixelOrder::Serpentine, PixelOrder::Tiles(8)]);
    let sweep = select(vec![SweepLength::Rows(3), SweepLength::WholeImage]);
    let cutoff = select(vec![None, Some(0.0), Some(0.2)]);
    let eye_rays = select(vec![EyeRays::default(), EyeRays::Centers { samples: 2 }, EyeRays::Corners]);
    (1..20_u32, 1..20_u32, 1..6_u32, order, sweep, cutoff, eye_rays).prop_map(
        |(width, height, max_depth, order, sweep, cutoff, eye_rays)| RenderOptions {
            width,
            height,
            max_depth,
            cutoff,
            order: Some(order),
            sweep,
            bundle_len: None,
            layers: rayset_engine::Layers::BEAUTY,
            eye_rays,
            crop: None,
        },
    )
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn audit_changes_no_answer_and_no_other_count((scene, reading, options) in (scene(), reading(), options())) {
        let frame = |audit| {
            let speer = Speer1985::on(&scene, Backend::active(), Speer1985Options { audit, ..reading });
            render(&speer, &options).unwrap()
        };
        let (silent, mut audited) = (frame(false), frame(true));
        assert_same_pixels(&silent, &audited, "with an audit");
        prop_assert_eq!(silent.counts, audited.counts);
        prop_assert_eq!(silent.stats.coherence.total().wrong, 0);
        if audited.stats.coherence.total().wrong == 0 {
            let standard = render(&Standard::new(&scene), &options).unwrap();
            assert_same_pixels(&standard, &audited, "nothing wrong");
            prop_assert_eq!(standard.counts, audited.counts);
        }
        let ByKind { initial, reflected, refracted, shadow } = &mut audited.stats.coherence;
        for counts in [initial, reflected, refracted, shadow] {
            counts.wrong = 0;
        }
        prop_assert!(silent.stats == audited.stats, "{}{}", silent.stats, audited.stats);
    }

    #[test]
    fn counts_add_up((scene, reading, options) in (scene(), reading(), options())) {
        let n = scene.volumes().len() as u64;
        let pixels = options.n_ray_sets();
        let standard = Standard::new(&scene);
        let speer = Speer1985::on(&scene, Backend::active(), reading);
        for strategy in [&standard as &dyn IntersectionStrategy, &speer] {
            let frame = render(strategy, &options).unwrap();
            let (work, total) = (frame.stats.work, frame.stats.coherence.total());
            prop_assert_eq!(work.volumes_classified, work.partitions * n);
            prop_assert_eq!(work.partitions + total.coherent, frame.counts.total().cast);
            prop_assert_eq!(frame.stats.radii.count(), work.cylinders_built);
            prop_assert_eq!(frame.stats.lengths.count(), work.cylinders_built);
            prop_assert!(work.cylinders_built <= work.partitions);
            prop_assert!(work.radius_comparisons <= work.cylinders_built * n);
            prop_assert_eq!(work.pierce_checks, total.pierced + total.coherent);
            prop_assert_eq!(frame.counts.initial.cast, pixels);
            for (kind, counts) in frame.stats.coherence.iter() {
                prop_assert!(frame.counts[kind].hit <= frame.counts[kind].cast);
                prop_assert!(counts.guided <= frame.counts[kind].cast);
                prop_assert_eq!(counts.guided, counts.predicted_missed + counts.pierced + counts.coherent);
                prop_assert!(counts.false_coherence <= counts.pierced);
            }
            // A light ray needs a hit, and one hit casts at most one a light.
            let hits = frame.counts.initial.hit + frame.counts.reflected.hit + frame.counts.refracted.hit;
            prop_assert!(frame.counts.shadow.cast <= hits * scene.lights().len() as u64);
            prop_assert!(frame.counts.reflected.cast <= hits && frame.counts.refracted.cast <= hits);
        }
        let work = render(&standard, &options).unwrap().stats;
        prop_assert_eq!(work.coherence, ByKind::<CoherenceCounts>::default());
        prop_assert_eq!((work.work.pierce_checks, work.work.cylinders_built, work.work.radius_comparisons), (0, 0, 0));
    }

    #[test]
    fn exact_strategies_agree_on_random_scenes((scene, options, bundle_len) in (scene(), options(), 1..100_usize)) {
        let expected = render(&Standard::on(&scene, Backend::Scalar), &options).unwrap();
        for (kind, backend) in StrategyKind::ALL.iter().flat_map(|kind| Backend::available().iter().map(move |b| (kind, *b))) {
            let strategy = kind.bind_on(&scene, backend);
            if strategy.is_exact() {
                let options = RenderOptions { bundle_len: Some(bundle_len), ..options };
                let actual = render(strategy.as_ref(), &options).unwrap();
                assert_same_pixels(&expected, &actual, format!("{kind}, {backend}"));
                prop_assert_eq!(expected.counts, actual.counts, "{}", kind);
            }
        }
    }
}

/// The layers of a plane that two objects share.
#[derive(Clone, Copy, Debug)]
struct Layers {
    /// Where the plane is, in world units.
    center: DVec3,
    normal: DVec3,
    /// A quarter of the width of what is in the plane.
    size: f64,
    /// Whether the layers are cut up differently, one a polygon.
    mixed: bool,
    /// The direction to the light, from the plane.
    to_light: DVec3,
}

fn layers() -> impl Strategy<Value = Layers> {
    let center = (vector(), select(vec![0.0, 1.0, 1e3, 1e6])).prop_map(|(place, far)| far * place);
    (center, unit_vector(), select(vec![0.1, 1.0, 100.0]), any::<bool>(), unit_vector()).prop_filter_map(
        "light too low",
        |(center, normal, size, mixed, to_light)| {
            (to_light.dot(normal) > 0.02).then_some(Layers { center, normal, size, mixed, to_light })
        },
    )
}

impl Layers {
    /// Two objects in one plane, each covering what the camera sees of it, lit by a point light.
    fn scene(&self) -> Option<Scene> {
        let Self { center, normal, size, mixed, to_light } = *self;
        let x = size * normal.any_orthonormal_vector();
        let y = normal.cross(x);
        let corner = |u: f64, v: f64| center + u * x + v * y;
        let quad = [corner(-2.0, -2.0), corner(2.0, -2.0), corner(2.0, 2.0), corner(-2.0, 2.0)];
        let triangles = [Triangle::new(quad[0], quad[1], quad[2]), Triangle::new(quad[0], quad[2], quad[3])];
        let other = match mixed {
            false => triangles.map(Part::from).into(),
            true => vec![Part::from(Polygon::new(quad.into())?)],
        };
        let mut builder = SceneBuilder::new();
        let half = DVec3::splat(0.5);
        let glass = Material { reflectance: half, transmittance: half, index: 1.5, ..Material::default() };
        let glass = builder.add_material(glass);
        builder.add_object("below", glass, triangles);
        builder.add_object("above", glass, other);
        let eye = center + 3.0 * size * unit(normal + 0.3 * normal.any_orthonormal_vector())?;
        builder.camera(Camera::new(eye, center, normal.any_orthogonal_vector(), 25.0).ok()?);
        builder.add_light(Light::point(center + 4.0 * size * to_light, DVec3::ONE));
        builder.build().ok()
    }
}

/// 256 rays, and no tree is cut off before it shows whether a ray that leaves one layer meets the other.
const SMALL: RenderOptions = RenderOptions {
    width: 16,
    height: 16,
    max_depth: 5,
    cutoff: None,
    order: Some(PixelOrder::Scanline),
    sweep: SweepLength::WholeImage,
    bundle_len: None,
    layers: rayset_engine::Layers::BEAUTY,
    eye_rays: EyeRays::Centers { samples: 1 },
    crop: None,
};

proptest! {
    #![proptest_config(config(2_000))]

    #[test]
    fn rays_that_leave_a_surface_do_not_meet_another_in_the_same_place(layers in layers()) {
        let Some(scene) = layers.scene() else { return Err(TestCaseError::reject("no scene")) };
        let counts = render(&Standard::new(&scene), &SMALL).unwrap().counts;
        for (kind, tally) in counts.iter() {
            let expected = RayTally { cast: 256, hit: if kind == RayKind::Initial { 256 } else { 0 } };
            prop_assert_eq!(*tally, expected, "{:?}", kind);
        }
    }
}

#[test]
fn without_the_departure_margin_they_would() {
    let (mut n, mut n_hits) = (0, 0);
    for (size, far) in [(0.1, 0.0), (1.0, 3.0), (1.0, 1e3), (100.0, 1e6)] {
        for mixed in [false, true] {
            let normal = DVec3::new(0.36, 0.48, 0.8);
            let center = far * DVec3::new(0.7, -0.3, 0.9);
            let scene = Layers { center, normal, size, mixed, to_light: normal }.scene().unwrap();
            let strategy = Standard::new(&scene);
            let mut tracer = strategy.begin_sweep(Recording::Off);
            for query in queries_of(&scene, &SMALL).concat() {
                let is_hit = match query {
                    Query::Nearest(query) if query.slot == Slot::ROOT => continue,
                    Query::Nearest(query) => {
                        let span = Span { start: 0.0, ..query.span };
                        tracer.nearest(&RayQuery { span, ..query }).is_some()
                    }
                    Query::Occluded(query) => {
                        let span = Span { start: 0.0, ..query.span };
                        tracer.occluded(&ShadowQuery { span, ..query })
                    }
                };
                n += 1;
                n_hits += u32::from(is_hit);
            }
        }
    }
    assert_eq!(n, 8 * 3 * 256);
    assert!(n_hits > n / 8, "{n_hits} of {n}");
}

#[test]
fn departure_margin_grows_with_the_coordinates() {
    let start = |far: f64| {
        let layers =
            Layers { center: far * DVec3::X, normal: DVec3::Z, size: 1.0, mixed: false, to_light: DVec3::Z };
        let queries = queries_of(&layers.scene().unwrap(), &SMALL).concat();
        let starts = queries.iter().filter_map(|query| match query {
            Query::Nearest(_) => None,
            Query::Occluded(query) => Some(query.span.start),
        });
        starts.fold(0.0, f64::max)
    };
    // The eye is about 3 from the plane and at most 1 beside it; the plane reaches 2 from its centre.
    for (far, least, most) in [(0.0, 4.0, 6.0), (1e6, 2e6, 2.000_01e6)] {
        let units = start(far) / DEPARTURE_MARGIN;
        assert!((least..most).contains(&units), "{units}");
    }
}
