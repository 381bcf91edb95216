//! What holds for every scene that is built, whatever it is made of.

use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::RngSeed;
use rayset_scene::geometry::{
    Cone, Polygon, Primitive, PrimitiveKind, Ray, Sides, Span, Sphere, Triangle, unit,
};
use rayset_scene::glam::DVec3;
use rayset_scene::{
    Material, MaterialId, ObjectId, Part, PrimitiveId, RandomSpheres, Scene, SceneBuilder, SphereSize,
    VolumeId,
};

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(1985), ..ProptestConfig::default() }
}

fn vector() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-1.0..1.0).prop_map(DVec3::from_array)
}

fn primitive(center: DVec3) -> impl Strategy<Value = Primitive> {
    let point = move || vector().prop_map(move |offset| center + offset);
    let sphere = (point(), 0.0..1.0).prop_map(|(center, radius)| Sphere::new(center, radius).into());
    let triangle = (point(), point(), point()).prop_map(|(a, b, c)| Triangle::new(a, b, c).into());
    let polygon = (point(), vector(), vector()).prop_filter_map("no area", |(a, x, y)| {
        // A notch makes it concave.
        let corners = vec![a, a + x, a + 0.5 * (x + y), a + y, a - x];
        Polygon::new(corners).map(Primitive::from)
    });
    let cone = (point(), 0.0..0.5, point(), 0.0..0.5)
        .prop_filter_map("no cone", |(base, base_radius, apex, radius)| {
            Cone::new(base, base_radius, apex, radius).map(Primitive::from)
        });
    prop_oneof![sphere, triangle, polygon, cone]
}

fn part(center: DVec3) -> impl Strategy<Value = Part> {
    let sides = select(vec![Sides::Front, Sides::Back, Sides::Both]);
    let normals = prop::option::of(prop::array::uniform3(vector()));
    (primitive(center), sides, normals).prop_map(|(primitive, sides, normals)| {
        let normals = normals.filter(|_| primitive.kind() == PrimitiveKind::Triangle);
        Part { primitive, sides, normals }
    })
}

/// What objects are made of: their materials and parts.
fn objects() -> impl Strategy<Value = Vec<(MaterialId, Vec<Part>)>> {
    (vector(), select(vec![0.0, 1.0, 1e3, 1e6])).prop_flat_map(|(place, far)| {
        let parts = prop::collection::vec(part(far * place), 1..8);
        prop::collection::vec(((0..3_u32).prop_map(MaterialId), parts), 0..8)
    })
}

fn built(objects: &[(MaterialId, Vec<Part>)]) -> Scene {
    let mut builder = SceneBuilder::new();
    for _ in 0..3 {
        builder.add_material(Material::default());
    }
    for (i, (material, parts)) in objects.iter().enumerate() {
        let id = builder.add_object(format!("object {i}"), *material, parts.clone());
        assert_eq!(id.index(), i);
    }
    builder.build().unwrap()
}

proptest! {
    #![proptest_config(config(500))]

    #[test]
    fn ids_are_consistent(objects in objects(), point in vector()) {
        let scene = built(&objects);
        let parts: Vec<(usize, &Part)> =
            objects.iter().enumerate().flat_map(|(i, (_, parts))| parts.iter().map(move |part| (i, part))).collect();
        prop_assert_eq!(scene.objects().len(), objects.len());
        prop_assert_eq!(scene.n_primitives(), parts.len());
        let mut next = 0;
        for (i, (object, (material, parts))) in scene.objects().iter().zip(&objects).enumerate() {
            prop_assert_eq!(&object.name, &format!("object {i}"));
            prop_assert_eq!(object.material, *material);
            prop_assert_eq!(&object.primitives, &(next..next + u32::try_from(parts.len()).unwrap()));
            next = object.primitives.end;
        }
        for (id, (object, part)) in (0..).map(PrimitiveId).zip(&parts) {
            let place = scene.location(id);
            prop_assert_eq!(place.kind, part.primitive.kind());
            prop_assert_eq!(scene.primitive_id(place.kind, place.index), id);
            prop_assert_eq!(scene.volume_object(place.volume).index(), *object);
            // The columns hold this very primitive.
            prop_assert_eq!(scene.surface_at(id, point).normal, part.primitive.normal_at(point));
            if let Primitive::Triangle(triangle) = &part.primitive {
                prop_assert_eq!(&scene.primitives().triangle(place.index), triangle);
            }
            if part.normals.is_none() {
                let surface = scene.surface_at(id, point);
                prop_assert_eq!(surface.shading_normal, surface.normal);
            }
        }
    }

    #[test]
    fn every_primitive_is_in_one_run_of_its_sides_in_its_volume(objects in objects()) {
        let scene = built(&objects);
        let parts: Vec<&Part> = objects.iter().flat_map(|(_, parts)| parts).collect();
        let mut seen = vec![false; scene.n_primitives()];
        for volume in (0..scene.volumes().len()).map(|i| VolumeId(u32::try_from(i).unwrap())) {
            let runs = scene.volume_runs(volume);
            prop_assert!(!runs.is_empty());
            for run in runs {
                for index in run.range.clone() {
                    let id = scene.primitive_id(run.kind, index);
                    prop_assert_eq!(scene.location(id).volume, volume);
                    prop_assert_eq!(run.sides, parts[id.index()].sides);
                    prop_assert!(!std::mem::replace(&mut seen[id.index()], true), "{} is in two runs", id);
                }
                // Of equally near hits a kernel finds the one of least index, which must have the least id.
                let ids: Vec<_> = run.range.clone().map(|index| scene.primitive_id(run.kind, index)).collect();
                prop_assert!(ids.is_sorted(), "{:?}", ids);
            }
        }
        prop_assert!(seen.iter().all(|&seen| seen));
    }

    #[test]
    fn bounds_hold_all_primitives(objects in objects(), aims in prop::collection::vec((vector(), vector()), 32)) {
        let scene = built(&objects);
        for (i, object) in scene.objects().iter().enumerate() {
            prop_assert_eq!(scene.volume_object(VolumeId(u32::try_from(i).unwrap())), ObjectId(u32::try_from(i).unwrap()));
            prop_assert_eq!(scene.volumes().radius(i).to_bits(), object.bounds.radius.to_bits());
            for part in &objects[i].1 {
                prop_assert!(part.primitive.extent() <= scene.extent());
                let own = part.primitive.bounding_sphere();
                for (origin, target) in &aims {
                    let Some(ray) = Ray::between(own.center + 3.0 * *origin, own.center + own.radius * *target) else { continue };
                    let Some(t) = part.primitive.intersect(&ray, Span::FORWARD, Sides::Both, None) else { continue };
                    let outside = ray.at(t).distance(object.bounds.center) - object.bounds.radius;
                    prop_assert!(outside <= 1e-13 * (scene.extent() + 3.0), "{} outside", outside);
                }
            }
        }
    }

    #[test]
    fn shading_normals_are_unit_vectors_between_those_of_the_vertices(
        normals in prop::array::uniform3(vector()), weights in prop::array::uniform3(0.01..1.0),
    ) {
        let [a, b, c] = [DVec3::ZERO, DVec3::new(2.0, 0.0, 1.0), DVec3::new(0.0, 3.0, -1.0)];
        let part = Part { normals: Some(normals), ..Triangle::new(a, b, c).into() };
        let scene = built(&[(MaterialId(0), vec![part])]);
        let sum: f64 = weights.iter().fold(0.0, |sum, weight| sum + weight);
        let [u, v, w] = weights.map(|weight| weight / sum);
        let surface = scene.surface_at(PrimitiveId(0), u * a + v * b + w * c);
        let Some(expected) = unit(u * normals[0] + v * normals[1] + w * normals[2]) else { return Ok(()) };
        prop_assert!((surface.shading_normal - expected).length() < 1e-9, "{}", surface.shading_normal);
        prop_assert!((surface.shading_normal.length() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn random_spheres_keep_to_what_was_asked(
        count in 0..40_u32, seed in any::<u64>(), least in 0.01..0.3, spread in 0.0..0.3, separate in any::<bool>(),
    ) {
        let size = SphereSize::Between(least, least + spread);
        let make = || RandomSpheres { count, seed, size, separate, ..RandomSpheres::default() }.scene().unwrap();
        let (scene, again) = (make(), make());
        prop_assert_eq!(scene.objects(), again.objects());
        prop_assert_eq!(scene.objects().len(), count as usize);
        for (i, object) in scene.objects().iter().enumerate() {
            prop_assert!((least..=least + spread).contains(&object.bounds.radius));
            prop_assert!(object.bounds.center.abs().max_element() <= 1.0);
            let material = &scene.materials()[object.material.index()];
            prop_assert_eq!(material.is_transmissive(), i % 4 == 3);
        }
    }
}
