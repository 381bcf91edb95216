//! Trees and radiance have the bits of the arithmetic written one ray at a time, on the lanes of every backend.
//!
//! What rays hit is made up, so that surfaces are met where no ray would find them: in the centre of a sphere, on the axis
//! of a cone, and far beside triangles, whose interpolated normals then lean over in every way.

use rayset_engine::geometry::glam::{DVec3, dvec3};
use rayset_engine::geometry::{Cone, Polygon, Ray, Side, Sphere, Triangle, unit};
use rayset_engine::scene::{Color, Light, LightId, Material, Patch, PrimitiveId, Scene, SceneBuilder};
use rayset_engine::{
    Backend, DEPARTURE_MARGIN, Hit, IntersectionTrees, LightState, Node, RayQuery, RaySetIndex, RaySets,
    Recording, Shading, ShadowQuery, Slot, Stats, Surface, Tracer, TreeOptions, shade,
};

/// Numbers from 0 to 1 that look like chance, of what they are asked for: `SplitMix64`.
fn chance(seed: [u32; 3]) -> f64 {
    let mut z = seed.iter().fold(0_u64, |z, &part| (z + u64::from(part)).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

fn direction(seed: u32) -> DVec3 {
    let coordinate = |axis| chance([seed, axis, 77]) - 0.5;
    unit(dvec3(coordinate(0), coordinate(1), coordinate(2))).unwrap()
}

/// One of everything: each kind of surface in matt, shiny, mirror, glass, and glass that bends nothing.
fn scene() -> Scene {
    let shiny = Material { specular: dvec3(0.4, 0.0, 0.2), shininess: 20.0, ..Material::default() };
    let mirror = Material { reflectance: dvec3(0.7, 0.8, 0.1), shininess: 3.0827, ..shiny };
    let glass = Material {
        reflectance: dvec3(0.1, 0.2, 0.0),
        transmittance: dvec3(0.9, 0.3, 0.6),
        index: 1.5,
        emission: dvec3(0.0, 0.01, 0.0),
        ..Material::default()
    };
    let air = Material { index: 1.0, ..glass };
    let mut builder = SceneBuilder::new();
    builder.background(dvec3(0.2, 0.3, 0.5)).ambient(dvec3(0.1, 0.2, 0.3));
    builder.add_light(Light::point(dvec3(3.0, 2.0, 1.0), dvec3(0.5, 0.6, 0.7)));
    builder.add_light(Light::directional(dvec3(-1.0, 2.0, 0.5), dvec3(0.3, 0.1, 0.9)));
    // In the way of rays along z, which may hit something just there.
    builder.add_light(Light::point(dvec3(0.0, 0.0, 2.0), dvec3(0.1, 0.1, 0.1)));
    for material in [Material::default(), shiny, mirror, glass, air] {
        let material = builder.add_material(material);
        builder.add_object("sphere", material, vec![Sphere::new(dvec3(0.0, 0.0, 2.0), 1.0)]);
        let cone = Cone::new(DVec3::ZERO, 1.0, dvec3(0.0, 0.0, 3.0), 0.0).unwrap();
        let cylinder = Cone::new(dvec3(1.0, 0.0, 0.0), 0.5, dvec3(1.0, 2.0, 0.0), 0.5).unwrap();
        builder.add_object("cones", material, vec![cone, cylinder]);
        let corners = [dvec3(-1.0, -1.0, 1.0), dvec3(1.0, -1.0, 1.0), dvec3(0.0, 1.0, 1.5)];
        builder.add_object("triangle", material, vec![Triangle::new(corners[0], corners[1], corners[2])]);
        let polygon = Polygon::new(corners.to_vec()).unwrap();
        let normals = vec![dvec3(0.9, 0.0, 0.1), dvec3(-1.0, 0.5, 0.1), dvec3(0.0, -1.0, -2.0)];
        let patch = Patch { polygon, sides: rayset_engine::geometry::Sides::Both, normals };
        builder.add_patches("patch", material, vec![patch]);
    }
    builder.build().unwrap()
}

/// What a ray is said to hit.
fn made_up(scene: &Scene, ray_set: u32, slot: Slot) -> Option<Hit> {
    let chance = |what| chance([ray_set, slot.0, what]);
    let n = u32::try_from(scene.n_primitives()).unwrap();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to n")]
    let primitive = PrimitiveId((chance(0) * f64::from(n)) as u32);
    let object = scene.volume_object(scene.location(primitive).volume);
    // In the middle of the sphere, where the rays along z are.
    let t = if ray_set.is_multiple_of(5) { 2.0 } else { 3.0 * chance(1) };
    (chance(2) < 0.85).then_some(Hit { t, object, primitive })
}

fn is_hidden(ray_set: u32, slot: Slot, light: LightId) -> bool {
    chance([ray_set, slot.0, 100 + light.0]) < 0.3
}

struct MadeUp<'s> {
    scene: &'s Scene,
    stats: Stats,
}

impl Tracer for MadeUp<'_> {
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
        made_up(self.scene, query.ray_set.0, query.slot)
    }

    fn occluded(&mut self, query: &ShadowQuery) -> bool {
        let surface = query.originating;
        assert_eq!(made_up(self.scene, query.ray_set.0, query.slot).unwrap().primitive, surface.primitive);
        is_hidden(query.ray_set.0, query.slot, query.light)
    }

    fn stats(&self) -> &Stats {
        &self.stats
    }

    fn recording(&self) -> Recording {
        Recording::Off
    }
}

fn bits(vector: DVec3) -> [u64; 3] {
    vector.to_array().map(f64::to_bits)
}

fn surface_at(scene: &Scene, ray: &Ray, hit: &Hit) -> Surface {
    let point = ray.at(hit.t);
    let front = scene.surface_at(hit.primitive, point);
    let side = if front.normal.dot(ray.direction()) > 0.0 { Side::Back } else { Side::Front };
    let turned = |normal: DVec3| if side == Side::Back { -normal } else { normal };
    let (normal, shading) = (turned(front.normal), turned(front.shading_normal));
    let leans_over = shading.dot(ray.direction()) > 0.0;
    let shading_normal = if leans_over { normal } else { shading };
    Surface { point, normal, shading_normal, side, material: scene.material_id_of(hit.object) }
}

fn reflect(d: DVec3, surface: &Surface) -> DVec3 {
    let about = |n: DVec3| unit(d - 2.0 * n.dot(d) * n).unwrap_or(n);
    let direction = about(surface.shading_normal);
    if direction.dot(surface.normal) > 0.0 { direction } else { about(surface.normal) }
}

fn refract(d: DVec3, surface: &Surface, index: f64) -> Option<DVec3> {
    if index.to_bits() == 1.0_f64.to_bits() {
        return Some(d);
    }
    let eta = if surface.side == Side::Front { 1.0 / index } else { index };
    let about = |n: DVec3| {
        let cosine = -n.dot(d);
        let discriminant = 1.0 - eta * eta * (1.0 - cosine * cosine);
        (discriminant >= 0.0).then(|| eta * d + (eta * cosine - discriminant.sqrt()) * n).and_then(unit)
    };
    let direction = about(surface.shading_normal)?;
    if direction.dot(surface.normal) < 0.0 { Some(direction) } else { about(surface.normal) }
}

/// How often each way was taken that few rays take.
#[derive(Debug, Default)]
struct Ways {
    without_normal: u32,
    reflected_astray: u32,
    refracted_astray: u32,
    total: u32,
    straight: u32,
    at_a_light: u32,
}

/// Checks a tree from a node on, and returns its radiance.
fn check(
    scene: &Scene,
    trees: &IntersectionTrees,
    nodes: &[Node],
    (i, origin): (usize, DVec3),
    options: &TreeOptions,
    ways: &mut Ways,
) -> Color {
    let node = &nodes[i];
    let children: Vec<usize> = (i..nodes.len()).filter(|&child| nodes[child].parent == Some(i)).collect();
    let expected = made_up(scene, node.ray_set, node.slot);
    assert_eq!(node.hit.map(|(hit, _)| hit), expected);
    let Some((hit, found)) = node.hit else {
        assert!(children.is_empty());
        return scene.background();
    };
    let surface = surface_at(scene, &Ray::new(origin, node.direction), &hit);
    assert_eq!(bits(found.point), bits(surface.point));
    assert_eq!(bits(found.normal), bits(surface.normal), "{hit:?}");
    assert_eq!(bits(found.shading_normal), bits(surface.shading_normal), "{hit:?}");
    assert_eq!((found.side, found.material), (surface.side, surface.material));
    if let Some(outward) = scene.outward_at(hit.primitive, surface.point) {
        ways.without_normal += u32::from(unit(outward.away).is_none());
    }

    let material = &scene.materials()[surface.material.index()];
    let mut color = material.emission + scene.ambient() * material.diffuse;
    for ((light, id), state) in scene.lights().iter().zip(0..).zip(trees.lights_of(i)) {
        let Some(seen) = light.seen_from(surface.point) else {
            assert_eq!(state, LightState::FacesAway);
            ways.at_a_light += 1;
            continue;
        };
        let cosine = surface.shading_normal.dot(seen.direction);
        let faces = surface.normal.dot(seen.direction) > 0.0 && cosine > 0.0;
        let expected = match (faces, is_hidden(node.ray_set, node.slot, LightId(id))) {
            (false, _) => LightState::FacesAway,
            (true, true) => LightState::Hidden,
            (true, false) => LightState::Visible,
        };
        assert_eq!(state, expected);
        if state == LightState::Visible {
            let mut answer = material.diffuse * cosine;
            let towards_eye = (2.0 * cosine * surface.shading_normal - seen.direction).dot(-node.direction);
            if material.specular.max_element() > 0.0 && towards_eye > 0.0 {
                let power = power(towards_eye, material.shininess);
                answer += material.specular * power;
            }
            color += light.color() * answer;
        }
    }

    let mut expected = Vec::new();
    let mut share = material.reflectance;
    let is_sent = |weight: f64| options.cutoff.is_none_or(|cutoff| weight >= cutoff);
    if node.slot.depth() < options.max_depth && material.is_reflective() {
        let refracted = refract(node.direction, &surface, material.index);
        if material.is_transmissive() {
            let about_shading = refract(
                node.direction,
                &Surface { normal: surface.shading_normal, ..surface },
                material.index,
            );
            let is_bent = material.index > 1.0;
            let astray = about_shading.is_some_and(|direction| direction.dot(surface.normal) >= 0.0);
            ways.refracted_astray += u32::from(is_bent && astray);
            ways.straight += u32::from(!is_bent);
            ways.total += u32::from(refracted.is_none());
            assert_eq!(node.reflects_totally, refracted.is_none());
            if refracted.is_none() {
                share += material.transmittance;
            }
        }
        let reflected = reflect(node.direction, &surface);
        let n = surface.shading_normal;
        let mirrored = unit(node.direction - 2.0 * n.dot(node.direction) * n);
        ways.reflected_astray +=
            u32::from(mirrored.is_none_or(|direction| direction.dot(surface.normal) <= 0.0));
        let weight = node.weight * share.max_element();
        if is_sent(weight) {
            expected.push((node.slot.reflected(), reflected, weight, share));
        }
        let weight = node.weight * material.transmittance.max_element();
        if let Some(direction) = refracted.filter(|_| material.is_transmissive() && is_sent(weight)) {
            expected.push((node.slot.refracted(), direction, weight, material.transmittance));
        }
    }
    assert_eq!(children.len(), expected.len());
    for (child, (slot, direction, weight, share)) in children.into_iter().zip(expected) {
        let node = &nodes[child];
        assert_eq!((node.slot, node.weight.to_bits()), (slot, weight.to_bits()));
        assert_eq!(bits(node.direction), bits(direction), "{slot:?}");
        color += share * check(scene, trees, nodes, (child, surface.point), options, ways);
    }
    color
}

/// As the engine has it: small whole exponents are multiplied out, others go by the binary logarithm.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small and whole")]
fn power(base: f64, exponent: f64) -> f64 {
    if exponent > 1024.0 || exponent.fract() != 0.0 {
        return exp2(exponent * log2(base));
    }
    let (mut power, mut square) = (1.0, base);
    let exponent = exponent as u32;
    for bit in 0..32 {
        if exponent >> bit & 1 == 1 {
            power *= square;
        }
        square *= square;
    }
    power
}

/// Of a normal number.
fn log2(x: f64) -> f64 {
    let (mut fraction, mut whole) = (x, 0.0);
    while fraction < 0.5_f64.sqrt() {
        (fraction, whole) = (2.0 * fraction, whole - 1.0);
    }
    assert!(fraction < 2.0_f64.sqrt(), "about 1 at most");
    let z = (fraction - 1.0) / (fraction + 1.0);
    let term = |k: u32| 2.0 * std::f64::consts::LOG2_E / f64::from(2 * k + 1);
    whole + z * (0..11).rev().fold(0.0, |sum, k| sum * (z * z) + term(k))
}

fn exp2(y: f64) -> f64 {
    if y < -1022.0 {
        return 0.0;
    }
    let whole = y.round_ties_even();
    let mut terms = [1.0; 14];
    for n in 1..14_u8 {
        terms[usize::from(n)] = terms[usize::from(n) - 1] * std::f64::consts::LN_2 / f64::from(n);
    }
    terms.iter().rev().fold(0.0, |sum, term| sum * (y - whole) + term) * whole.exp2()
}

#[test]
fn trees_and_radiance_have_the_bits_of_one_ray_at_a_time_on_every_backend() {
    let scene = scene();
    let rays: Vec<Ray> = (0..507)
        .map(|i| match i % 5 {
            0 => Ray::new(DVec3::ZERO, DVec3::Z),
            _ => Ray::new(2.0 * direction(2 * i + 1), direction(2 * i)),
        })
        .collect();
    for &backend in Backend::available() {
        let mut ray_sets = RaySets::on(backend);
        let mut shading = Shading::on(backend);
        let mut ways = Ways::default();
        // The memory of the first bundles is used for the next, which are shorter and longer.
        for (n, options) in [
            (507, TreeOptions { max_depth: 4, cutoff: None }),
            (3, TreeOptions { max_depth: 1, cutoff: None }),
            (50, TreeOptions { max_depth: 5, cutoff: Some(0.2) }),
            (333, TreeOptions { max_depth: 3, cutoff: Some(0.5) }),
        ] {
            let mut tracer = MadeUp { scene: &scene, stats: Stats::default() };
            let rays = rays[..n].iter().copied();
            let trees = ray_sets.grow(&scene, &mut tracer, RaySetIndex(0), rays.clone(), &options);
            let nodes: Vec<Node> = trees.nodes().collect();
            assert_eq!(nodes.len(), trees.len());
            for (i, node) in nodes.iter().enumerate() {
                let (found, place) = (trees.node(i), |node: &Node| (node.ray_set, node.slot, node.parent));
                assert_eq!(place(&found), place(node), "node {i} by itself");
                assert_eq!(bits(found.direction), bits(node.direction));
            }
            let mut radiance = Vec::new();
            shade(trees, &scene, &mut shading, &mut radiance);
            assert_eq!(radiance.len(), n);
            for (i, ray) in rays.enumerate() {
                assert_eq!((nodes[i].slot, nodes[i].parent), (Slot::ROOT, None));
                assert_eq!(bits(nodes[i].direction), bits(ray.direction()));
                let expected = check(&scene, trees, &nodes, (i, ray.origin()), &options, &mut ways);
                assert_eq!(bits(radiance[i]), bits(expected), "{backend}, ray {i}");
            }
        }
        let Ways { without_normal, reflected_astray, refracted_astray, total, straight, at_a_light } = ways;
        for way in [without_normal, reflected_astray, refracted_astray, total, straight, at_a_light] {
            assert!(way > 0, "{backend}: a way that no ray took: {ways:?}");
        }
    }
}

#[test]
fn rays_that_leave_begin_beyond_their_margin_and_end_at_the_light() {
    struct Spans<'s>(MadeUp<'s>, u32);

    impl Tracer for Spans<'_> {
        fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
            if query.slot != Slot::ROOT {
                assert!(query.originating.is_some() && query.span.end.is_infinite());
                assert!(query.span.start > 0.0);
            }
            self.0.nearest(query)
        }

        fn occluded(&mut self, query: &ShadowQuery) -> bool {
            let scene = self.0.scene;
            let seen = scene.light(query.light).seen_from(query.ray.origin()).unwrap();
            assert_eq!(bits(query.ray.direction()), bits(seen.direction));
            assert_eq!(query.span.end.to_bits(), (seen.distance - query.span.start).to_bits());
            if query.slot == Slot::ROOT {
                // Of the ray that arrived.
                let start = DEPARTURE_MARGIN * (0.25 + scene.extent());
                assert_eq!(query.span.start.to_bits(), start.to_bits());
            }
            self.1 += 1;
            self.0.occluded(query)
        }

        fn stats(&self) -> &Stats {
            self.0.stats()
        }

        fn recording(&self) -> Recording {
            Recording::Off
        }
    }

    let scene = scene();
    let rays = (1..40).map(|i| Ray::new(dvec3(0.125, -0.25, 0.0), direction(i)));
    for &backend in Backend::available() {
        let mut tracer = Spans(MadeUp { scene: &scene, stats: Stats::default() }, 0);
        let options = TreeOptions { max_depth: 3, cutoff: None };
        RaySets::on(backend).grow(&scene, &mut tracer, RaySetIndex(0), rays.clone(), &options);
        assert!(tracer.1 > 50);
    }
}
