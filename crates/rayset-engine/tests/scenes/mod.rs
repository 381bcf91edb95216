//! Small scenes with everything in them that strategies could disagree on, and the primitives they are made of.

use rayset_engine::geometry::glam::{DVec3, dvec3};
use rayset_engine::geometry::{Cone, Polygon, Sides, Sphere, Triangle};
use rayset_engine::scene::{
    Camera, Light, Material, MaterialId, ObjectId, Part, RandomSpheres, Scene, SceneBuilder, SphereSize,
};

/// A scene under test.
pub(crate) struct TestScene {
    /// What to call it in messages.
    pub(crate) name: String,
    /// The scene.
    pub(crate) scene: Scene,
    /// The primitives by their id, each with its object.
    pub(crate) primitives: Vec<(ObjectId, Part)>,
}

/// All of them.
pub(crate) fn all() -> Vec<TestScene> {
    let mut scenes: Vec<_> = [1, 2, 4, 8, 64].map(random_spheres).into();
    scenes.extend([all_kinds(), room(), coincident_spheres()]);
    for TestScene { name, scene, primitives } in &scenes {
        assert_eq!(primitives.len(), scene.n_primitives(), "{name}");
    }
    scenes
}

fn random_spheres(count: u32) -> TestScene {
    let spheres =
        RandomSpheres { count, seed: 5, size: SphereSize::Coverage(0.6), ..RandomSpheres::default() };
    let scene = spheres.scene().unwrap();
    // A single sphere is its own bounding volume.
    let sphere = |i: u32| {
        Sphere::new(scene.objects()[i as usize].bounds.center, scene.objects()[i as usize].bounds.radius)
    };
    let primitives = (0..count).map(|i| (ObjectId(i), sphere(i).into())).collect();
    TestScene { name: format!("{count} random spheres"), scene, primitives }
}

/// Adds objects to a scene and keeps a list of their primitives.
#[derive(Default)]
struct Maker {
    builder: SceneBuilder,
    primitives: Vec<(ObjectId, Part)>,
}

impl Maker {
    fn add<P: Into<Part>>(&mut self, material: MaterialId, parts: impl IntoIterator<Item = P>) {
        let parts: Vec<Part> = parts.into_iter().map(Into::into).collect();
        let object = self.builder.add_object("object", material, parts.clone());
        self.primitives.extend(parts.into_iter().map(|part| (object, part)));
    }

    fn matt(&mut self, r: f64, g: f64, b: f64) -> MaterialId {
        self.builder.add_material(Material { diffuse: dvec3(r, g, b), ..Material::default() })
    }

    fn mirror(&mut self) -> MaterialId {
        self.builder.add_material(Material {
            diffuse: dvec3(0.1, 0.1, 0.2),
            specular: DVec3::splat(0.5),
            shininess: 20.0,
            reflectance: DVec3::splat(0.7),
            ..Material::default()
        })
    }

    fn glass(&mut self, index: f64) -> MaterialId {
        self.builder.add_material(Material {
            diffuse: DVec3::splat(0.05),
            specular: DVec3::splat(0.3),
            shininess: 50.0,
            reflectance: DVec3::splat(0.2),
            transmittance: dvec3(0.7, 0.8, 0.7),
            index,
            ..Material::default()
        })
    }

    fn look(&mut self, from: DVec3, at: DVec3, angle: f64) {
        self.builder.camera(Camera::new(from, at, DVec3::Y, angle).unwrap());
        self.builder.background(dvec3(0.1, 0.2, 0.4)).ambient(DVec3::splat(0.1));
    }

    fn finish(self, name: &str) -> TestScene {
        TestScene { name: name.to_owned(), scene: self.builder.build().unwrap(), primitives: self.primitives }
    }
}

/// Every kind of primitive, seen from all sides or from one, in glass, mirrors and matt; a point light and the sun.
fn all_kinds() -> TestScene {
    let mut maker = Maker::default();
    maker.look(dvec3(0.5, 2.0, 7.0), dvec3(0.0, 0.5, 0.0), 45.0);
    maker.builder.add_light(Light::point(dvec3(-3.0, 5.0, 4.0), DVec3::splat(0.6)));
    maker.builder.add_light(Light::directional(dvec3(1.0, 2.0, 1.0), dvec3(0.5, 0.4, 0.3)));
    let (matt, mirror, glass) = (maker.matt(0.7, 0.3, 0.2), maker.mirror(), maker.glass(1.5));
    let unbent = maker.glass(1.0);

    // A floor with a notch: concave.
    let floor = [(-4, 3), (-1, 3), (0, 1), (1, 3), (4, 3), (4, -4), (-4, -4)];
    let corner = |(x, z): (i32, i32)| dvec3(f64::from(x), -0.5, f64::from(z));
    maker.add(matt, [Polygon::new(floor.map(corner).into()).unwrap()]);
    maker.add(glass, [Sphere::new(dvec3(-0.8, 0.3, 1.5), 0.7)]);
    maker.add(mirror, [Sphere::new(dvec3(1.5, 0.4, -0.5), 0.9)]);
    // Spheres seen from one side only: a bubble's inside, and a shell without one.
    maker.add(matt, [Part { sides: Sides::Back, ..Sphere::new(dvec3(-2.2, 0.6, -0.5), 0.8).into() }]);
    maker.add(unbent, [Part { sides: Sides::Front, ..Sphere::new(dvec3(0.3, 1.9, 0.2), 0.5).into() }]);
    // A mirroring tube and a hat, which is seen from outside only, under one volume.
    let tube = Cone::new(dvec3(0.2, -0.5, -1.5), 0.4, dvec3(0.4, 1.0, -1.7), 0.4).unwrap();
    let hat = Cone::new(dvec3(0.4, 1.0, -1.7), 0.7, dvec3(0.5, 2.0, -1.8), 0.0).unwrap();
    maker.add(mirror, [tube.into(), Part { sides: Sides::Front, ..hat.into() }]);
    // A smooth fan of triangles, and one that is seen from behind only.
    let (top, rim) =
        (dvec3(2.3, 1.2, 1.5), [dvec3(1.5, -0.3, 1.2), dvec3(2.4, -0.4, 2.0), dvec3(3.0, -0.3, 1.0)]);
    let smooth = |a: DVec3, b: DVec3| Part {
        normals: Some([DVec3::Z, DVec3::Z - 0.3 * DVec3::X, DVec3::Z + 0.3 * DVec3::X]),
        ..Triangle::new(top, a, b).into()
    };
    maker.add(matt, [smooth(rim[0], rim[1]), smooth(rim[1], rim[2])]);
    let blade = Triangle::new(dvec3(-3.0, 2.5, 0.0), dvec3(-1.0, 2.5, 0.0), dvec3(-2.0, 1.2, 0.5));
    maker.add(mirror, [Part { sides: Sides::Back, ..blade.into() }]);
    // A pane of glass, of two triangles and a polygon: a solid slab would be one more of everything.
    let pane = |x: f64, y: f64, z: f64| dvec3(0.2 + x, y, 2.5 + z);
    maker.add(
        glass,
        [
            Part::from(Triangle::new(pane(0.0, 0.0, 0.0), pane(0.8, 0.0, 0.0), pane(0.8, 0.8, 0.0))),
            Triangle::new(pane(0.0, 0.0, 0.0), pane(0.8, 0.8, 0.0), pane(0.0, 0.8, 0.0)).into(),
            Polygon::new(vec![
                pane(0.0, 0.0, -0.1),
                pane(0.0, 0.8, -0.1),
                pane(0.8, 0.8, -0.1),
                pane(0.8, 0.0, -0.1),
            ])
            .unwrap()
            .into(),
        ],
    );
    maker.finish("all kinds of primitives")
}

/// The twelve triangles of a box with these opposite corners, turned about the vertical by a rational angle.
fn block(low: DVec3, high: DVec3) -> Vec<Triangle> {
    let center = 0.5 * (low + high);
    let corner = |i: usize| {
        let pick = |k: usize| if i >> k & 1 == 0 { low[k] } else { high[k] };
        let (x, z) = (pick(0) - center.x, pick(2) - center.z);
        dvec3(center.x + 0.96 * x + 0.28 * z, pick(1), center.z - 0.28 * x + 0.96 * z)
    };
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let halves = |[a, b, c, d]: [usize; 4]| {
        [Triangle::new(corner(a), corner(b), corner(c)), Triangle::new(corner(a), corner(c), corner(d))]
    };
    faces.into_iter().flat_map(halves).collect()
}

/// A Cornell-like box: walls of triangles that share edges, two blocks and a lamp under the ceiling.
fn room() -> TestScene {
    let mut maker = Maker::default();
    maker.look(dvec3(0.0, 1.0, 4.4), dvec3(0.0, 1.0, 0.0), 40.0);
    maker.builder.add_light(Light::point(dvec3(0.0, 1.95, 0.1), DVec3::splat(0.8)));
    let (white, red, green) =
        (maker.matt(0.7, 0.7, 0.7), maker.matt(0.7, 0.1, 0.1), maker.matt(0.1, 0.7, 0.1));
    let (mirror, glass) = (maker.mirror(), maker.glass(1.5));
    let corner = |x: i32, y: i32, z: i32| dvec3(f64::from(x), f64::from(y), f64::from(z));
    let wall = |[a, b, c, d]: [DVec3; 4]| [Triangle::new(a, b, c), Triangle::new(a, c, d)];
    let floor = wall([corner(-1, 0, 1), corner(1, 0, 1), corner(1, 0, -1), corner(-1, 0, -1)]);
    let ceiling = wall([corner(-1, 2, 1), corner(-1, 2, -1), corner(1, 2, -1), corner(1, 2, 1)]);
    let back = wall([corner(-1, 0, -1), corner(1, 0, -1), corner(1, 2, -1), corner(-1, 2, -1)]);
    maker.add(white, [floor, ceiling, back].concat());
    maker.add(red, wall([corner(-1, 0, 1), corner(-1, 0, -1), corner(-1, 2, -1), corner(-1, 2, 1)]));
    maker.add(green, wall([corner(1, 0, 1), corner(1, 2, 1), corner(1, 2, -1), corner(1, 0, -1)]));
    maker.add(mirror, block(dvec3(-0.7, 0.0, -0.6), dvec3(-0.1, 1.2, 0.0)));
    maker.add(glass, block(dvec3(0.1, 0.0, 0.0), dvec3(0.6, 0.6, 0.5)));
    maker.finish("room of triangles")
}

/// Spheres that are doubled, touch, hold each other, or are points.
fn coincident_spheres() -> TestScene {
    let mut maker = Maker::default();
    maker.look(dvec3(0.0, 0.5, 6.0), DVec3::ZERO, 40.0);
    maker.builder.add_light(Light::point(dvec3(2.0, 5.0, 5.0), DVec3::splat(0.7)));
    maker.builder.add_light(Light::directional(-DVec3::X, DVec3::splat(0.3)));
    let (red, green) = (maker.matt(0.8, 0.1, 0.1), maker.matt(0.1, 0.8, 0.1));
    let (mirror, glass) = (maker.mirror(), maker.glass(1.3));
    let ball = |x: f64, y: f64, radius: f64| Sphere::new(dvec3(x, y, 0.0), radius);
    // Thrice the same: as an object, as another of glass, and as two primitives of a third.
    maker.add(red, [ball(-1.0, 0.0, 0.5)]);
    maker.add(glass, [ball(-1.0, 0.0, 0.5)]);
    maker.add(mirror, [ball(-1.0, 0.0, 0.5), ball(-1.0, 0.0, 0.5)]);
    // Two that touch, and one that holds two others that touch it from inside.
    maker.add(mirror, [ball(0.0, 0.0, 0.5)]);
    maker.add(green, [ball(0.0, 1.0, 0.5)]);
    maker.add(glass, [ball(1.25, 0.0, 0.75)]);
    maker.add(red, [ball(1.0, 0.0, 0.5)]);
    maker.add(glass, [ball(1.75, 0.0, 0.25)]);
    maker.add(green, [ball(0.25, -0.75, 0.0), ball(-0.25, -0.75, 0.25)]);
    maker.finish("doubled, touching and nested spheres")
}
