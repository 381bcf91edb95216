//! What the entities of NFF files become, what is left out with a warning, and what is refused.

use approx::assert_abs_diff_eq;
use std::path::Path;

use rayset_scene::geometry::{PrimitiveKind, Sides};
use rayset_scene::glam::{DVec3, dvec3};
use rayset_scene::{
    Camera, Limits, LoadOptions, LoadedScene, ObjectId, PrimitiveId, SceneError, VolumeId, read_nff,
};

/// One of everything.
const ALL: &str = "\
# The whole format.
v
from 1 2 3
at 0 0 0
up 0 0 1
angle 45
hither 0.01
resolution 640 480
b 0.1 0.2 0.3
l 5 5 5
l 5 -5 5 1 0.5 0.25
f 1 0.5 0.25 0.8 0.2 30 0 0
s 0 0 0 1
c
2 0 0 0.5
2 0 1 0.25
p 4
-1 -1 -2
1 -1 -2
1 1 -2
-1 1 -2
f 1 1 1 0 0 1 0.9 1.5 # glass
pp 3
0 0 3 0 0 1
1 0 3 1 0 1
0 1 3 0 1 1
";

fn read_with(text: &[u8], options: &LoadOptions) -> Result<LoadedScene, SceneError> {
    read_nff(text, Path::new("a.nff"), options)
}

fn read(text: &str) -> LoadedScene {
    read_with(text.as_bytes(), &LoadOptions::default()).unwrap()
}

fn refused(text: &str) -> String {
    read_with(text.as_bytes(), &LoadOptions::default()).unwrap_err().to_string()
}

/// Entities after a view, a light and a fill, which fill the first line.
fn entities(text: &str) -> String {
    let before = "v from 0 0 9 at 0 0 0 up 0 1 0 angle 45 l 9 9 9 f 1 1 1 1 0 1 0 1";
    format!("{before}\n{text}")
}

fn sides(loaded: &LoadedScene) -> Vec<Sides> {
    let volumes = 0..u32::try_from(loaded.scene.volumes().len()).unwrap();
    volumes.map(|i| loaded.scene.volume_runs(VolumeId(i))[0].sides).collect()
}

fn warnings(loaded: &LoadedScene) -> Vec<String> {
    loaded.warnings.iter().map(ToString::to_string).collect()
}

#[test]
fn every_entity_becomes_what_it_says() {
    let loaded = read(ALL);
    assert_eq!(warnings(&loaded), [""; 0]);
    assert_eq!(loaded.resolution, Some((640, 480)));
    let scene = &loaded.scene;
    assert_eq!(scene.background(), dvec3(0.1, 0.2, 0.3));
    let lights: Vec<_> =
        scene.lights().iter().map(|light| (light.position().unwrap(), light.color())).collect();
    assert_eq!(
        lights,
        [
            (dvec3(5.0, 5.0, 5.0), DVec3::splat(1.0 / 2.0_f64.sqrt())),
            (dvec3(5.0, -5.0, 5.0), dvec3(1.0, 0.5, 0.25))
        ]
    );
    let names: Vec<_> = scene.objects().iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["sphere 1", "cone 1", "polygon 1", "polygon 2"]);
    assert_eq!(sides(&loaded), [Sides::Front, Sides::Front, Sides::Front, Sides::Both]);
    let kinds: Vec<_> = (0..4).map(|i| scene.location(PrimitiveId(i)).kind).collect();
    use PrimitiveKind::{Cone, Polygon, Sphere, Triangle};
    assert_eq!(kinds, [Sphere, Cone, Polygon, Triangle]);
    assert_abs_diff_eq!(scene.objects()[0].bounds.radius, 1.0, epsilon = 1e-12);

    let matt = scene.material_of(ObjectId(0));
    assert_eq!(matt.diffuse, dvec3(0.8, 0.4, 0.2));
    assert_eq!((matt.specular, matt.reflectance), (DVec3::splat(0.2), DVec3::splat(0.2)));
    assert_eq!((matt.shininess, matt.transmittance, matt.index), (30.0, DVec3::ZERO, 1.0));
    let glass = scene.material_of(ObjectId(3));
    assert_eq!((glass.transmittance, glass.index), (DVec3::splat(0.9), 1.5));
    let smooth = scene.surface_at(PrimitiveId(3), dvec3(1.0, 0.0, 3.0));
    assert_eq!(smooth.normal, DVec3::Z);
    assert!((smooth.shading_normal - dvec3(1.0, 0.0, 1.0).normalize()).length() < 1e-15);
}

#[test]
fn angle_is_between_the_middles_of_the_outer_rows() {
    let camera = *read(ALL).scene.camera();
    let (centre, top) = (camera.ray(320.0, 240.0, 640, 480), camera.ray(320.0, 0.5, 640, 480));
    let cosine = centre.direction().dot(top.direction());
    // The cosine of 22.5 degrees.
    let expected = (2.0 + 2.0_f64.sqrt()).sqrt() / 2.0;
    assert_abs_diff_eq!(cosine, expected, epsilon = 1e-14);
    // Of an image of unknown size only the edges are known.
    let without = *read(&ALL.replace("resolution 640 480", "")).scene.camera();
    assert_eq!(without, Camera::new(dvec3(1.0, 2.0, 3.0), DVec3::ZERO, DVec3::Z, 45.0).unwrap());
}

#[test]
fn order_of_view_lights_and_objects_does_not_matter() {
    let (view, rest) = ALL.split_at(ALL.find("b 0.1").unwrap());
    let (lights, objects) = rest.split_at(rest.find("f 1 0.5").unwrap());
    let loaded = read(&format!("{objects}{lights}{view}"));
    let usual = read(ALL);
    assert_eq!(warnings(&loaded), [""; 0]);
    assert_eq!(loaded.scene.objects(), usual.scene.objects());
    assert_eq!(loaded.scene.lights(), usual.scene.lights());
    assert_eq!(loaded.scene.camera(), usual.scene.camera());
    let shuffled = ALL.replace("from 1 2 3\nat 0 0 0\nup 0 0 1\n", "up 0 0 1 at 0 0 0 from 1 2 3 ");
    assert_eq!(read(&shuffled).scene.camera(), usual.scene.camera());
}

#[test]
fn layout_of_lines_and_comments_do_not_matter() {
    let usual = read(ALL);
    let one_word_a_line: String = ALL
        .lines()
        .flat_map(|line| line.split('#').next().unwrap().split_whitespace())
        .map(|word| format!("{word}# no number 1 2 3\r\n\t"))
        .collect();
    let loaded = read(&one_word_a_line);
    assert_eq!(loaded.scene.objects(), usual.scene.objects());
    assert_eq!(loaded.scene.materials(), usual.scene.materials());
    assert_eq!(loaded.scene.camera(), usual.scene.camera());
    assert_eq!(loaded.resolution, usual.resolution);
}

#[test]
fn negative_radii_show_the_inside_only() {
    let text = entities("s 0 0 0 -1\nc 0 0 0 -1 0 0 1 -2\nc 0 0 0 -1 0 0 1 0\nc 0 0 0 1 0 0 1 0\n");
    assert_eq!(sides(&read(&text)), [Sides::Back, Sides::Back, Sides::Back, Sides::Front]);
    assert_eq!(
        refused(&entities("\nc 0 0 0 -1\n0 0 1 1")),
        "a.nff:4: `c`: one radius is positive and one negative"
    );
    // Light that is let through needs both sides.
    assert_eq!(sides(&read(&entities("f 1 1 1 0 0 1 0.5 1.5 s 0 0 0 -1"))), [Sides::Both]);
    let options = LoadOptions { two_sided: true, ..LoadOptions::default() };
    let loaded = read_with(text.as_bytes(), &options).unwrap();
    assert_eq!(sides(&loaded), [Sides::Both; 4]);
}

#[test]
fn patches_of_more_than_three_vertices_have_normals() {
    let square = "pp 4  0 0 0 0 0 1  2 0 0 1 0 1  2 2 0 1 1 1  0 2 0 0 1 1";
    let loaded = read(&entities(square));
    let at = |x: f64, y: f64| loaded.scene.surface_at(PrimitiveId(0), dvec3(x, y, 0.0));
    assert_eq!(at(1.0, 1.0).normal, DVec3::Z);
    for (x, y) in [(0.0, 0.0), (2.0, 2.0), (1.0, 1.0), (0.3, 1.6), (2.0, 0.7)] {
        let expected = dvec3(x / 2.0, y / 2.0, 1.0).normalize();
        assert!((at(x, y).shading_normal - expected).length() < 1e-14, "({x}, {y})");
    }
    // Without normals beside one with them.
    let both =
        read(&entities(&format!("p 4 5 0 0  6 0 0  6 1 0  5 1 0\n{square}\np 4 8 0 0 9 0 0 9 1 0 8 1 0")));
    let shading = |i| both.scene.surface_at(PrimitiveId(i), dvec3(2.0, 2.0, 0.0)).shading_normal;
    assert_eq!([shading(0), shading(2)], [DVec3::Z; 2]);
    assert!((shading(1) - DVec3::ONE.normalize()).length() < 1e-15);
}

#[test]
fn what_has_no_surface_is_left_out_with_a_warning() {
    let text = entities(
        "s 1 1 1 0\nc 0 0 0 1 0 0 0 1\nc 0 0 0 0 0 0 1 0\np 3 0 0 0 1 1 1 2 2 2\npp 3 0 0 0 1 1 1 1 1 1 1 1 1 0 0 0 1 1 1\ns 0 0 0 1",
    );
    let loaded = read(&text);
    assert_eq!(loaded.scene.objects().len(), 1);
    assert_eq!(loaded.scene.objects()[0].name, "sphere 2", "the numbers are those of the file");
    let warned = [
        "a.nff:2: `s` left out: its radius is zero",
        "a.nff:3: `c` left out: its ends coincide or both radii are zero",
        "a.nff:4: `c` left out: its ends coincide or both radii are zero",
        "a.nff:5: `p` left out: it has no area",
        "a.nff:6: `pp` left out: it has no area",
    ];
    assert_eq!(warnings(&loaded), warned);
}

#[test]
fn what_is_missing_is_made_up_with_a_warning() {
    let loaded = read("s 0 0 0 1\n");
    let warned = [
        "a.nff:1: there is no `f` yet: matt grey is used",
        "a.nff: there is no `l`: only ambient light is left",
        "a.nff: there is no `v`: the camera is one that sees everything",
    ];
    assert_eq!(warnings(&loaded), warned);
    assert_eq!(loaded.resolution, None);
    let camera = loaded.scene.camera();
    assert!(camera.viewpoint().length() > 2.0);
    assert!((camera.ray(0.5, 0.5, 1, 1).direction() + camera.viewpoint().normalize()).length() < 1e-12);

    let odd = read(&entities(
        "v from 0 0 8 at 0 0 0 up 0 1 0 angle 30\nresolution 0.5 512\nf 1 1 1 -1 0 1 0.5 0\ns 0 0 0 1",
    ));
    let warned = [
        "a.nff:2: `v`: there is one already; the last one counts",
        "a.nff:3: `resolution` ignored: it is not two whole numbers from 1 to 65535",
        "a.nff:4: `f`: Kd is negative; taken as 0",
        "a.nff:4: `f`: the index of refraction is not positive; taken as 1",
    ];
    assert_eq!(warnings(&odd), warned);
    assert_eq!(odd.scene.camera().viewpoint(), dvec3(0.0, 0.0, 8.0));
    assert_eq!(odd.resolution, None);
}

#[test]
fn cameras_are_fitted_to_scenes_of_any_size_and_place() {
    for sphere in ["0 0 0 1e-300", "1e59 1e59 -1e59 1", "0 0 0 1e60", "9e59 9e59 9e59 9e58", "3 4 5 1e-20"] {
        let loaded = read(&format!("s {sphere}"));
        assert_eq!(loaded.scene.objects().len(), 1, "{sphere}");
    }
}

#[test]
fn what_cannot_be_trusted_is_refused_with_its_line() {
    for (text, message) in [
        ("\ns 0 0 nan 1", "3: `s`: `nan` is not a finite number"),
        ("s 0 0 0 1e999", "2: `s`: `1e999` is not a finite number"),
        ("s 0 0 1e61 1", "2: `s`: `1e61` exceeds 1e60"),
        ("s 0 0 9e59 9e59", "2: the sphere reaches beyond 1e60"),
        ("s 0 0 0 1\n\nmesh 1 2 3", "4: `mesh` is no entity of NFF"),
        ("s 0 0 0 1 7", "2: `7` is no entity of NFF"),
        ("p 2\n0 0 0\n1 0 0", "2: `p`: 2 vertices are no polygon"),
        ("p -3", "2: `p`: `-3` is not a count"),
        ("p 99999999999999999999999", "2: `p`: `99999999999999999999999` is not a count"),
        ("pp 4000000000", "2: `pp`: 4000000000 vertices are more than 65536"),
        ("p 3\n0 0 0\n1 0 0\n0 1", "5: the text ends inside of `p`"),
        ("p 3\n0 0 0\n1 0 0\ns 0 0 0 1", "5: `p`: `s` is not a finite number"),
        ("f 1 1 -1 1 0 1 0 1", "2: `f`: a colour is negative"),
        ("f 1e308 1 1 1e308 0 1 0 1", "2: `f`: Kd times the colour is not finite"),
        ("b 0 0 -1", "2: `b`: a colour is negative"),
        ("l 0 0 0 1 1", "2: the text ends inside of `l`"),
        ("\nv from 0 0 1 at 0 0 1 up 0 1 0 angle 45 s 0 0 0 1", "3: `v`: viewpoint and target coincide"),
        ("v from 0 0 1 up 0 1 0 angle 45 s 0 0 0 1", "2: `v`: no `at` belongs to it"),
        ("v from 0 0 1 at 0 0 0 up 0 1 0 angle 180 s 0 0 0 1", "2: `v`: the angle of view"),
        ("v from 0 0 1 at 0 0 0 up 0 0 1 angle 45 s 0 0 0 1", "2: `v`: the up vector is parallel"),
        ("\u{7f}\u{1b}[31m", "2: `\\u{7f}\\u{1b}[31m` is no entity of NFF"),
    ] {
        let message = format!("a.nff:{message}");
        let found = refused(&entities(text));
        assert!(found.starts_with(&message), "{text:?}: {found}");
    }
    assert_eq!(refused("# nothing\n"), "`a.nff` holds no face");
    assert_eq!(refused(""), "`a.nff` holds no face");
}

#[test]
fn limits_are_kept() {
    let with = |limits: Limits, text: &str| {
        let options = LoadOptions { limits, ..LoadOptions::default() };
        read_with(entities(text).as_bytes(), &options).map(|loaded| warnings(&loaded).len())
    };
    let message = |limits: Limits, text: &str| with(limits, text).unwrap_err().to_string();
    let usual = Limits::default();
    let two = "s 0 0 0 1\ns 3 0 0 1";
    assert_eq!(with(Limits { faces: 2, ..usual }, two).unwrap(), 0);
    let found = message(Limits { faces: 1, ..usual }, two);
    assert_eq!(found, "a.nff:3: there are more than 1 primitives");
    let found = message(Limits { memory_bytes: 2500, ..usual }, two);
    assert_eq!(found, "a.nff:3: the scene takes more than 2500 bytes of memory");
    let found = message(Limits { memory_bytes: 10_000, ..usual }, "p 100 0 0 0");
    assert_eq!(found, "a.nff:2: the scene takes more than 10000 bytes of memory", "before it is taken");
    let found = message(Limits { corners: 3, ..usual }, "p 4 0 0 0 1 0 0 1 1 0 0 1 0");
    assert_eq!(found, "a.nff:2: `p`: 4 vertices are more than 3");
    let found = message(Limits { line_bytes: 80, ..usual }, &format!("{}{two}", " ".repeat(81)));
    assert_eq!(found, "a.nff:2: the line is longer than 80 bytes");
    let bad = "s 0 0 0 0\n".repeat(10) + two;
    assert_eq!(with(Limits { warnings: 3, ..usual }, &bad).unwrap(), 4, "and one that counts the others");
}

#[test]
fn text_cut_off_anywhere_is_read_or_refused_with_its_name() {
    for end in 0..ALL.len() {
        match read_with(&ALL.as_bytes()[..end], &LoadOptions::default()) {
            Ok(loaded) => assert!(!loaded.scene.objects().is_empty()),
            Err(error) => assert!(error.to_string().contains("a.nff"), "{error}"),
        }
    }
}

#[test]
fn any_byte_may_be_wrong() {
    for at in 0..ALL.len() {
        for byte in [0, b'#', b'-', b'9', b'e', b'\n', 0xff] {
            let mut text = ALL.as_bytes().to_vec();
            text[at] = byte;
            if let Err(error) = read_with(&text, &LoadOptions::default()) {
                assert!(error.to_string().contains("a.nff"), "{error}");
            }
        }
    }
}
