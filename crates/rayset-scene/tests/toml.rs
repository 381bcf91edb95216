//! Scene files: what each table becomes.
#![cfg(feature = "toml")]

use approx::abs_diff_eq;
use std::path::{Path, PathBuf};

use rayset_scene::geometry::{PrimitiveKind, Sides};
use rayset_scene::glam::{DVec3, dvec3};
use rayset_scene::{
    Camera, Color, LoadOptions, LoadedScene, Material, PrimitiveId, RandomSpheres, Scene, SphereSize,
    VolumeId, load_scene, read_toml,
};

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures")
}

fn load(text: &str) -> LoadedScene {
    read_toml(text, Path::new("scene.toml"), &LoadOptions::default())
        .unwrap_or_else(|error| panic!("{error}"))
}

fn scene(text: &str) -> Scene {
    load(text).scene
}

fn names(scene: &Scene) -> Vec<&str> {
    scene.objects().iter().map(|object| object.name.as_str()).collect()
}

const BALL: &str = "[[sphere]]\ncenter = [1, 2, 3]\nradius = 2\n";

#[test]
fn smallest_file_has_defaults() {
    let LoadedScene { scene, resolution, warnings } = load(BALL);
    assert_eq!((resolution, warnings), (None, vec![]));
    assert_eq!((scene.background(), scene.ambient()), (Color::splat(0.2), Color::splat(0.1)));
    assert_eq!(names(&scene), ["sphere 0"]);
    assert_eq!(scene.objects()[0].bounds.center, dvec3(1.0, 2.0, 3.0));
    assert_eq!(scene.materials(), [Material::default()]);
    assert_eq!(scene.lights().len(), 1);
    assert_eq!((scene.lights()[0].color(), scene.lights()[0].position()), (Color::splat(0.9), None));
    // From in front, a little from the right and from above; towards the middle.
    let (from, center) = (scene.camera().viewpoint(), dvec3(1.0, 2.0, 3.0));
    assert!((from - center).z > (from - center).x && (from - center).x > (from - center).y);
    let ray = scene.camera().ray(0.5, 0.5, 1, 1);
    assert!(ray.direction().distance((center - from).normalize()) < 1e-12);
}

#[test]
fn keys_of_the_scene_are_read() {
    let text = "resolution = [640, 0x1e0]\nbackground = [0.1, 0.2, 3]\nambient = 0\nlight = []\n";
    let LoadedScene { scene, resolution, .. } = load(&format!("{text}{BALL}"));
    assert_eq!(resolution, Some((640, 480)));
    assert_eq!((scene.background(), scene.ambient()), (dvec3(0.1, 0.2, 3.0), Color::ZERO));
    assert!(scene.lights().is_empty());
}

#[test]
fn option_wins_over_the_size_of_volumes_in_the_file() {
    let text = "max_volume_primitives = 2\n".to_owned() + &format!("{BALL}object = \"balls\"\n").repeat(8);
    let volumes = |max_volume_primitives| {
        let options = LoadOptions { max_volume_primitives, ..LoadOptions::default() };
        let loaded = read_toml(&text, Path::new("scene.toml"), &options).unwrap();
        assert_eq!(loaded.scene.objects().len(), 1);
        loaded.scene.volumes().len()
    };
    assert_eq!((volumes(None), volumes(Some(4))), (4, 2));
}

#[test]
fn camera_is_what_the_file_says() {
    let camera = |keys: &str| *scene(&format!("[camera]\n{keys}\n{BALL}")).camera();
    let (from, at) = (dvec3(0.0, 0.0, 5.0), dvec3(0.5, 0.0, 0.0));
    let expected = |up, angle| Camera::new(from, at, up, angle).unwrap();
    assert_eq!(camera("from = [0, 0, 5]\nat = [0.5, 0, 0]"), expected(DVec3::Y, 45.0));
    let all = camera("from = [0, 0, 5.0]\nat = [5e-1, 0, 0]\nup = [1, 1, 0]\nangle = 28");
    assert_eq!(all, expected(dvec3(1.0, 1.0, 0.0), 28.0));
}

#[test]
fn lights_are_points_or_directions() {
    let text = "[[light]]\nposition = [1, 2, 3]\n[[light]]\ntowards = [0, 3, 4]\ncolor = [1, 0.5, 0]\n\
        intensity = 0.5\n[[light]]\ntowards = [0, 1, 0]\ncolor = 0.25\n";
    let scene = scene(&format!("{text}{BALL}"));
    let lights = scene.lights();
    assert_eq!((lights[0].position(), lights[0].color()), (Some(dvec3(1.0, 2.0, 3.0)), Color::ONE));
    assert_eq!((lights[1].position(), lights[1].color()), (None, dvec3(0.5, 0.25, 0.0)));
    let seen = lights[1].seen_from(DVec3::ZERO).unwrap();
    assert_eq!((seen.direction, seen.distance), (dvec3(0.0, 0.6, 0.8), f64::INFINITY));
    assert_eq!(lights[2].color(), Color::splat(0.25));
}

#[test]
fn materials_are_found_by_name_in_any_order() {
    let text = format!(
        "{BALL}material = \"night light\"\n{BALL}material = 'red'\n{BALL}[material.red]\ndiffuse = [1, 0, 0]\n\
        specular = 0.5\nshininess = 20\nreflectance = 0.25\ntransmittance = [0.1, 0.2, 0.3]\nindex = 1.5\n\
        [material.\"night light\"]\nemission = 2\n"
    );
    let scene = scene(&text);
    let material = |i: usize| *scene.material_of(rayset_scene::ObjectId(u32::try_from(i).unwrap()));
    assert_eq!(material(0), Material { emission: Color::splat(2.0), ..Material::default() });
    let red = Material {
        diffuse: DVec3::X,
        specular: Color::splat(0.5),
        shininess: 20.0,
        reflectance: Color::splat(0.25),
        transmittance: dvec3(0.1, 0.2, 0.3),
        index: 1.5,
        emission: Color::ZERO,
    };
    assert_eq!(material(1), red);
    assert_eq!(material(2), Material::default());
}

#[test]
fn shapes_are_those_of_the_geometry() {
    let text = r#"
        [[sphere]]
        center = [1, 0, 0]
        radius = 0.5
        sides = "front"
        [[triangle]]
        corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
        normals = [[0, 0, 2], [0, 0, 2], [2, 0, 0]]
        sides = "back"
        [[polygon]]
        corners = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 0.4, 0], [0, 1, 0]]
        [[cone]]
        base = [0, 0, 0]
        base_radius = 1
        apex = [0, 2, 0]
        apex_radius = 0
        sides = "both"
    "#;
    let scene = scene(text);
    let kinds = |i: u32| scene.location(PrimitiveId(i)).kind;
    use PrimitiveKind::{Cone, Polygon, Sphere, Triangle};
    assert_eq!([0, 1, 2, 3].map(kinds), [Sphere, Triangle, Polygon, Cone]);
    let sides = |i: u32| scene.volume_runs(VolumeId(i))[0].sides;
    assert_eq!([0, 1, 2, 3].map(sides), [Sides::Front, Sides::Back, Sides::Both, Sides::Both]);
    assert_eq!(scene.primitives().triangle(0).vertices(), &[DVec3::ZERO, DVec3::X, DVec3::Y]);
    let shading = |x, y| scene.surface_at(PrimitiveId(1), dvec3(x, y, 0.0)).shading_normal;
    assert_eq!((shading(0.0, 0.0), shading(0.0, 1.0)), (DVec3::Z, DVec3::X));
    let bounds: Vec<_> = scene.objects().iter().map(|object| object.bounds).collect();
    assert!(abs_diff_eq!(bounds[0].radius, 0.5, epsilon = 1e-12), "{:?}", bounds[0]);
    // The circle round the base and the apex.
    assert!((bounds[3].center - dvec3(0.0, 0.75, 0.0)).length() < 1e-6, "{:?}", bounds[3]);
}

#[test]
fn primitives_share_an_object_and_objects_keep_the_order_of_the_file() {
    let ball = |keys: &str| format!("{BALL}{keys}\n");
    let text = [
        ball("object = 'a'"),
        "[[random_spheres]]\ncount = 2\n".to_owned(),
        ball(""),
        "[[triangle]]\ncorners = [[0,0,0],[1,0,0],[0,1,0]]\nobject = 'a'\nmaterial = 'red'\n".to_owned(),
        ball("object = 'b'"),
        ball("object = 'a'\nmaterial = 'red'"),
        "[material.red]\ndiffuse = [1, 0, 0]\n".to_owned(),
    ];
    let scene = scene(&text.concat());
    assert_eq!(names(&scene), ["a", "sphere 0", "sphere 1", "sphere 1", "b"]);
    assert_eq!(scene.objects()[0].primitives, 0..3);
    assert_eq!(scene.material_of(rayset_scene::ObjectId(0)).diffuse, DVec3::X);
    assert_eq!(scene.location(PrimitiveId(1)).kind, PrimitiveKind::Triangle);
}

#[test]
fn random_spheres_are_those_of_their_seed() {
    let objects = |keys: &str| scene(&format!("[[random_spheres]]\n{keys}\n")).objects().to_vec();
    let expected = |spheres: RandomSpheres| spheres.scene().unwrap().objects().to_vec();
    let default = RandomSpheres::default();
    assert_eq!(objects("count = 5"), expected(RandomSpheres { count: 5, ..default }));
    assert_eq!(
        objects("count = 3\nseed = 9\nradius = [0.1, 0.2]\nseparate = false"),
        expected(RandomSpheres {
            count: 3,
            seed: 9,
            size: SphereSize::Between(0.1, 0.2),
            separate: false,
            ..default
        })
    );
    assert_eq!(
        objects("count = 3\nradius = 0.1"),
        expected(RandomSpheres { count: 3, size: SphereSize::Between(0.1, 0.1), ..default })
    );
    assert_eq!(
        objects("count = 4\ncoverage = 0.25"),
        expected(RandomSpheres { count: 4, size: SphereSize::Coverage(0.25), ..default })
    );
    let clear = scene("[[random_spheres]]\ncount = 4\nreflectance = 0.125\ntransmittance = 0.75\n");
    assert_eq!(clear.materials()[3].transmittance, Color::splat(0.75));
    assert_eq!(clear.materials()[0].reflectance, Color::splat(0.125));
}

#[test]
fn tables_may_be_written_inline_and_lines_may_end_with_cr_lf() {
    let inline = "\u{feff}camera = { from = [0, 0, 9], at = [0, 0, 0] }\r\nlight = [{ position = [1, 2, 3] }]\r\n\
        material.red.diffuse = [1, 0, 0]\r\nsphere = [\r\n  { center = [1, 2, 3], radius = 2, material = 'red' },\r\n]\r\n";
    let scene = scene(inline);
    assert_eq!(scene.camera().viewpoint(), dvec3(0.0, 0.0, 9.0));
    assert_eq!(scene.material_of(rayset_scene::ObjectId(0)).diffuse, DVec3::X);
}

#[test]
fn fixture_of_random_spheres_is_the_scene_of_table_1() {
    let loaded = load_scene(&fixtures().join("scenes/spheres.toml"), &LoadOptions::default()).unwrap();
    let expected = RandomSpheres { count: 8, seed: 1, ..RandomSpheres::default() }.scene().unwrap();
    assert_eq!(loaded.scene.objects(), expected.objects());
    assert_eq!(loaded.scene.materials(), expected.materials());
    assert_eq!(loaded.scene.lights(), expected.lights());
    assert_eq!(loaded.scene.camera(), expected.camera());
    assert_eq!(loaded.scene.background(), expected.background());
    assert_eq!(loaded.scene.ambient(), expected.ambient());
}

#[test]
fn fixture_of_glass_has_a_lamp_of_three_primitives() {
    let loaded = load_scene(&fixtures().join("scenes/glass.toml"), &LoadOptions::default()).unwrap();
    assert_eq!(loaded.resolution, Some((640, 480)));
    assert_eq!(names(&loaded.scene), ["table", "glass ball", "mirror ball", "lamp", "sphere 2"]);
    assert_eq!(loaded.scene.objects()[3].primitives.len(), 3);
    let table = loaded.scene.surface_at(PrimitiveId(0), DVec3::ZERO);
    assert_eq!(table.normal, DVec3::Y, "the table lies face up");
}

#[cfg(not(feature = "obj"))]
#[test]
fn meshes_need_their_feature() {
    let text = "\n[[obj]]\nfile = \"a.obj\"\n";
    let error = read_toml(text, Path::new("a.toml"), &LoadOptions::default()).unwrap_err();
    let expected = "a.toml:2: [[obj]] needs the feature `obj`, without which this program was built";
    assert_eq!(error.to_string(), expected);
}

#[cfg(feature = "obj")]
#[test]
fn every_block_of_the_document_loads() {
    let document = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/scene-files.md");
    let document = std::fs::read_to_string(document).unwrap();
    let blocks: Vec<_> =
        document.split("```toml\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    assert!(blocks.len() >= 10, "{}", blocks.len());
    for block in blocks {
        let loaded = read_toml(block, &fixtures().join("document.toml"), &LoadOptions::default());
        let loaded = loaded.unwrap_or_else(|error| panic!("{error}:\n{block}"));
        assert!(!loaded.scene.objects().is_empty());
    }
}
