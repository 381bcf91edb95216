//! OBJ files that scene files name: where they end up, with which materials, and which are not read.
#![cfg(all(feature = "toml", feature = "obj"))]

use std::fs;
use std::path::PathBuf;

use rayset_scene::geometry::Triangle;
use rayset_scene::glam::{DVec3, dvec3};
use rayset_scene::{
    Color, Limits, LoadOptions, LoadedScene, Material, ObjectId, Scene, SceneError, load_obj, load_toml,
};

/// A folder of its own for each test, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("rayset-scene-toml-{name}-{}", std::process::id()));
        fs::create_dir_all(path.join("below")).unwrap();
        fs::write(path.join("cube.obj"), CUBE).unwrap();
        fs::write(path.join("cube.mtl"), "newmtl red\nKd 1 0 0\nnewmtl green\nKd 0 1 0\n").unwrap();
        Self(path)
    }

    fn load_with(&self, text: &str, options: &LoadOptions) -> Result<LoadedScene, SceneError> {
        fs::write(self.0.join("a.toml"), text).unwrap();
        load_toml(&self.0.join("a.toml"), options)
    }

    fn load(&self, text: &str) -> Scene {
        self.load_with(text, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}")).scene
    }

    /// The cube with some keys of its table.
    fn cube(&self, keys: &str) -> Scene {
        self.load(&format!("[[obj]]\nfile = \"cube.obj\"\n{keys}"))
    }

    fn refused(&self, text: &str) -> String {
        let error = self.load_with(text, &LoadOptions::default()).unwrap_err();
        error.to_string().replace(&format!("{}/", self.0.display()), "")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The cube from (0, 0, 0) to (1, 1, 1); its front and its right side have normals. Three groups.
const CUBE: &str = "mtllib cube.mtl
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
vn 0 0 1\nvn 2 0 0
o front\nusemtl red\nf 5//1 6//1 7//1 8//1
o right\nusemtl green\nf 2//2 3//2 7//2 6//2
o rest\nf 4 3 2 1\nf 1 5 8 4\nf 1 2 6 5\nf 4 8 7 3
";

/// A triangle with a normal for each corner.
const LEAF: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nvn 1 0 1\nvn 0 1 1\nf 1//1 2//2 3//3\n";

fn triangles(scene: &Scene) -> Vec<Triangle> {
    (0..u32::try_from(scene.n_primitives()).unwrap()).map(|i| scene.primitives().triangle(i)).collect()
}

/// The corner of the cube that ends up at a vertex, for the first triangle: 5, 6, 7 of the file.
fn first_triangle(scene: &Scene) -> [DVec3; 3] {
    *scene.primitives().triangle(0).vertices()
}

/// Whether every triangle of a convex mesh shows its front to the outside.
fn fronts_are_outside(scene: &Scene) -> bool {
    let triangles = triangles(scene);
    let corners = triangles.iter().flat_map(|triangle| *triangle.vertices());
    let middle = corners.fold(DVec3::ZERO, |sum, corner| sum + corner) / (3 * triangles.len()) as f64;
    triangles.iter().all(|triangle| triangle.normal().dot(triangle.vertices()[0] - middle) > 0.0)
}

/// The normal that shades a primitive at its first corner.
fn shading_normal(scene: &Scene, primitive: u32) -> DVec3 {
    let point = scene.primitives().triangle(primitive).vertices()[0];
    scene.surface_at(rayset_scene::PrimitiveId(primitive), point).shading_normal
}

#[test]
fn mesh_alone_is_the_scene_that_its_own_file_gives() {
    let folder = Folder::new("alone");
    let scene = folder.cube("");
    let options = LoadOptions::default();
    let expected =
        load_obj(&folder.0.join("cube.obj"), &options).unwrap().into_scene(&options).unwrap().scene;
    assert_eq!(scene.objects(), expected.objects());
    assert_eq!(scene.materials(), expected.materials());
    assert_eq!(scene.camera(), expected.camera());
    assert_eq!(scene.lights(), expected.lights());
    assert_eq!((scene.background(), scene.ambient()), (expected.background(), expected.ambient()));
    assert_eq!(triangles(&scene), triangles(&expected));
    assert!(fronts_are_outside(&scene));
}

#[test]
fn mesh_is_scaled_then_rotated_then_moved() {
    let folder = Folder::new("placed");
    // In whatever order the keys stand.
    let scene = folder
        .cube("translate = [10, 20, 30]\nrotate = { axis = [0, 0, 2], degrees = 90 }\nscale = [2, 3, 4]\n");
    // (0, 0, 1), (1, 0, 1), (1, 1, 1) scaled, and turned from x to y.
    assert_eq!(
        first_triangle(&scene),
        [dvec3(10.0, 20.0, 34.0), dvec3(10.0, 22.0, 34.0), dvec3(7.0, 22.0, 34.0)]
    );
    assert!(fronts_are_outside(&scene));
    assert_eq!((shading_normal(&scene, 0), shading_normal(&scene, 2)), (DVec3::Z, DVec3::Y));
}

#[test]
fn one_number_scales_all_axes() {
    let folder = Folder::new("uniform");
    let scene = folder.cube("scale = 2.5\n");
    assert_eq!(first_triangle(&scene), [dvec3(0.0, 0.0, 2.5), dvec3(2.5, 0.0, 2.5), DVec3::splat(2.5)]);
}

#[test]
fn rotations_follow_each_other() {
    let folder = Folder::new("rotations");
    let x = "{ axis = [1, 0, 0], degrees = 90 }";
    let y = "{ axis = [0, 1, 0], degrees = -270 }";
    // (1, 0, 1) about x: (1, -1, 0); that about y: (0, -1, -1). The other way round: (1, 0, -1), then (1, 1, 0).
    for (list, expected) in [([x, y], dvec3(0.0, -1.0, -1.0)), ([y, x], dvec3(1.0, 1.0, 0.0))] {
        let scene = folder.cube(&format!("rotate = [{}]\n", list.join(", ")));
        assert_eq!(first_triangle(&scene)[1], expected);
        assert!(fronts_are_outside(&scene));
    }
}

#[test]
fn rotation_about_any_axis_is_counterclockwise_from_its_tip() {
    let folder = Folder::new("axis");
    // A third of a turn about the diagonal: x to y to z to x.
    let scene = folder.cube("rotate = { axis = [1, 1, 1], degrees = 120 }\n");
    let [_, b, _] = first_triangle(&scene);
    assert!((b - dvec3(1.0, 1.0, 0.0)).length() < 1e-15, "{b}");
    assert!((shading_normal(&scene, 0) - DVec3::X).length() < 1e-15);
    let scene = folder.cube("rotate = { axis = [0, 0, 1], degrees = 30 }\n");
    let [_, b, _] = first_triangle(&scene);
    assert!((b - dvec3(0.75_f64.sqrt(), 0.5, 1.0)).length() < 1e-15, "{b}");
}

#[test]
fn mirrored_mesh_keeps_its_fronts_and_normals_outside() {
    let folder = Folder::new("mirrored");
    for scale in ["[-1, 1, 1]", "[1, -2, 1]", "[1, 1, -3]", "[-1, -1, 1]", "[-1, -1, -1]", "-2"] {
        let scene = folder.cube(&format!("scale = {scale}\n"));
        assert!(fronts_are_outside(&scene), "{scale}");
        for primitive in 0..4 {
            let normal = scene.primitives().triangle(primitive).normal();
            assert_eq!(shading_normal(&scene, primitive), normal, "{scale} {primitive}");
        }
    }
    // Normals go with their corners.
    fs::write(folder.0.join("leaf.obj"), LEAF).unwrap();
    let scene = folder.load("[[obj]]\nfile = \"leaf.obj\"\nscale = [-1, 1, 1]\n");
    let at = |x, y| scene.surface_at(rayset_scene::PrimitiveId(0), dvec3(x, y, 0.0)).shading_normal;
    let diagonal = 0.5_f64.sqrt();
    assert!((at(-1.0, 0.0) - dvec3(-diagonal, 0.0, diagonal)).length() < 1e-15, "{}", at(-1.0, 0.0));
    assert!((at(0.0, 1.0) - dvec3(0.0, diagonal, diagonal)).length() < 1e-15, "{}", at(0.0, 1.0));
}

#[test]
fn normals_stay_upright_where_axes_are_scaled_apart() {
    let folder = Folder::new("normals");
    // A slope of 45 degrees; stretched along x it is flatter, and its normal steeper.
    let slope = "v 0 1 0\nv 0 1 1\nv 1 0 0\nvn 1 1 0\nf 1//1 2//1 3//1\n";
    fs::write(folder.0.join("slope.obj"), slope).unwrap();
    // The reciprocals of the last ones are not finite.
    for scale in ["[4, 1, 1]", "[4e50, 1e50, 1e50]", "[4e-320, 1e-320, 1e-320]"] {
        let scene = folder.load(&format!("[[obj]]\nfile = \"slope.obj\"\nscale = {scale}\n"));
        let normal = shading_normal(&scene, 0);
        assert!((normal - dvec3(1.0, 4.0, 0.0).normalize()).length() < 1e-15, "{scale}: {normal}");
    }
}

#[test]
fn materials_are_replaced_all_or_by_name() {
    let folder = Folder::new("materials");
    let blue = "[material.blue]\ndiffuse = [0, 0, 1]\n";
    let diffuse = |scene: &Scene| [0, 1, 2].map(|i| scene.material_of(ObjectId(i)).diffuse);
    assert_eq!(diffuse(&folder.cube("")), [DVec3::X, DVec3::Y, DVec3::Y]);
    assert_eq!(diffuse(&folder.cube(&format!("material = \"blue\"\n{blue}"))), [DVec3::Z; 3]);
    let by_name = folder.cube(&format!("[obj.materials]\ngreen = \"blue\"\n{blue}"));
    assert_eq!(diffuse(&by_name), [DVec3::X, DVec3::Z, DVec3::Z]);
    // Each table its own.
    let twice = folder.load(&format!(
        "[[obj]]\nfile = \"cube.obj\"\n[obj.materials]\nred = \"blue\"\n[[obj]]\nfile = \"./cube.obj\"\n\
        translate = [2, 0, 0]\n[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\n{blue}"
    ));
    assert_eq!(twice.objects().len(), 7);
    assert_eq!(diffuse(&twice), [DVec3::Z, DVec3::Y, DVec3::Y]);
    assert_eq!(twice.material_of(ObjectId(3)).diffuse, DVec3::X);
    assert_eq!(*twice.material_of(ObjectId(6)), Material::default());
}

#[test]
fn warnings_of_meshes_are_passed_on_up_to_the_limit() {
    let folder = Folder::new("warnings");
    let curved = format!("curv 0 1\ncurv 0 1\n{}", CUBE.replace("mtllib cube.mtl\n", ""));
    fs::write(folder.0.join("curved.obj"), curved).unwrap();
    let limits = Limits { warnings: 3, ..Limits::default() };
    let options = LoadOptions { limits, ..LoadOptions::default() };
    let loaded = folder.load_with("[[obj]]\nfile = \"curved.obj\"\n", &options).unwrap();
    assert!(loaded.warnings[0].path.ends_with("curved.obj"));
    assert_eq!((loaded.warnings[0].line, loaded.warnings[1].line), (1, 2));
    let loaded = folder.load_with(&"[[obj]]\nfile = \"curved.obj\"\n".repeat(5), &options).unwrap();
    assert_eq!(loaded.warnings.len(), 4);
    let last = loaded.warnings.last().unwrap();
    assert!(
        last.path.ends_with("a.toml") && last.message.ends_with("further warnings are not shown"),
        "{last}"
    );
}

#[test]
fn what_makes_no_sense_is_refused_with_its_line() {
    let folder = Folder::new("refused");
    let cube =
        |keys: &str| folder.refused(&format!("\n[[obj]]\nfile = \"cube.obj\"\n{keys}\n[material.blue]\n"));
    for (keys, expected) in [
        ("scale = 0", "a.toml:4: `scale` is zero"),
        ("scale = [1, -0.0, 1]", "a.toml:4: `scale` is zero"),
        ("scale = inf", "a.toml:4: `scale` is not finite"),
        ("scale = [1, 1]", "a.toml:4: `scale` needs 3 numbers, not 2"),
        ("scale = 1e61", "a.toml:2: a transformed coordinate exceeds 1e60"),
        ("scale = 1e308\ntranslate = [1e60, 0, 0]", "a.toml:2: a transformed coordinate exceeds 1e60"),
        ("translate = [0, 0, 1e61]", "a.toml:4: `translate` exceeds 1e60"),
        ("rotate = 90", "a.toml:4: `rotate` is a number, not a table"),
        ("rotate = { axis = [0, 1, 0] }", "a.toml:4: rotate needs `degrees`"),
        ("rotate = [\n{ axis = [0, 0, 0], degrees = 1 }]", "a.toml:5: `axis` is zero"),
        (
            "rotate = { axis = [0, 1, 0], angle = 1 }",
            "a.toml:4: unknown key `angle` in rotate: it has `axis`, `degrees`",
        ),
        ("rotate = { axis = [0, 1, 0], degrees = nan }", "a.toml:4: `degrees` is not finite"),
        ("material = \"bleu\"", "a.toml:4: no material `bleu`: did you mean `blue`?"),
        ("materials = \"blue\"", "a.toml:4: `materials` is a string, not a table"),
        ("materials.red = \"bleu\"", "a.toml:4: no material `bleu`: did you mean `blue`?"),
        ("materials = { greem = \"blue\" }", "a.toml:4: no MTL material `greem`: did you mean `green`?"),
        ("materials = { wood = \"blue\" }", "a.toml:4: no MTL material `wood`: there is `green`, `red`"),
        (
            "material = \"blue\"\nmaterials.red = \"blue\"",
            "a.toml:5: [[obj]] has both `material` and `materials`",
        ),
    ] {
        assert_eq!(cube(keys), expected, "{keys}");
    }
    assert_eq!(folder.refused("[[obj]]\nscale = 1\n"), "a.toml:1: [[obj]] needs `file`");
    // Errors of the mesh are its own.
    fs::write(folder.0.join("bad.obj"), "v 0 0\n").unwrap();
    assert!(folder.refused("[[obj]]\nfile = \"bad.obj\"\n").starts_with("bad.obj:1: "));
}

#[test]
fn files_outside_the_folder_are_refused_unless_allowed() {
    let folder = Folder::new("outside");
    let outside = folder.0.join("leaf.obj");
    fs::write(&outside, LEAF).unwrap();
    let scene = folder.0.join("below/a.toml");
    let load = |file: &str, allow_outside| {
        fs::write(&scene, format!("\n[[obj]]\nfile = '{file}'\n")).unwrap();
        let options = LoadOptions { allow_outside, ..LoadOptions::default() };
        let loaded = load_toml(&scene, &options);
        loaded.map(|_| ()).map_err(|error| error.to_string().replace(&format!("{}/", folder.0.display()), ""))
    };
    for file in ["../leaf.obj", "x/../../leaf.obj", "/etc/passwd", "../none.obj"] {
        let expected = format!("below/a.toml:3: `{file}` lies outside the folder of the scene file");
        assert_eq!(load(file, false), Err(expected));
    }
    let absolute = outside.to_str().unwrap();
    assert!(load(absolute, false).unwrap_err().contains("outside the folder"));
    assert_eq!((load("../leaf.obj", true), load(absolute, true)), (Ok(()), Ok(())));
    assert_eq!(load("none.obj", false), Err("below/a.toml:3: there is no file `none.obj`".to_owned()));
    assert_eq!(load("", true), Err("below/a.toml:3: `` is no regular file".to_owned()));
    assert_eq!(load("..", true), Err("below/a.toml:3: `..` is no regular file".to_owned()));
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&outside, folder.0.join("below/link.obj")).unwrap();
        let expected = "below/a.toml:3: `link.obj` lies outside the folder of the scene file";
        assert_eq!(load("link.obj", false), Err(expected.to_owned()));
        assert_eq!(load("link.obj", true), Ok(()));
        assert_eq!(load("/dev/null", true), Err("below/a.toml:3: `/dev/null` is no regular file".to_owned()));
    }
}

#[test]
fn all_files_together_stay_within_the_limits() {
    let folder = Folder::new("limits");
    let within = |limits, n| {
        let options = LoadOptions { limits, ..LoadOptions::default() };
        let loaded = folder.load_with(&"[[obj]]\nfile = \"cube.obj\"\n".repeat(n), &options);
        loaded.map(|loaded| loaded.scene.n_primitives()).map_err(|error| error.to_string())
    };
    // A cube has 12 triangles, and 6 faces in its file.
    let faces = Limits { faces: 29, ..Limits::default() };
    assert_eq!(within(faces, 2), Ok(24));
    // The file is not read beyond what is left.
    let refused = within(faces, 3).unwrap_err();
    assert!(refused.contains("cube.obj:"), "{refused}");
    let memory = Limits { memory_bytes: 100_000, ..Limits::default() };
    assert_eq!(within(memory, 1), Ok(12));
    assert!(within(memory, 100).is_err());
    assert!(
        within(Limits::default(), 1001).unwrap_err().ends_with(":2001: a scene file may name 1000 files")
    );
}

#[test]
fn fixtures_with_meshes_load() {
    let fixtures = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures");
    let options = LoadOptions::default();
    let cornell = load_toml(&fixtures.join("cornell.toml"), &options).unwrap();
    let clear = cornell.scene.objects().iter().position(|object| object.name == "rightSphere").unwrap();
    let material = cornell.scene.material_of(ObjectId(u32::try_from(clear).unwrap()));
    assert_eq!(material.transmittance, Color::splat(0.9));
    let cows = load_toml(&fixtures.join("cows.toml"), &options).unwrap();
    assert_eq!(cows.scene.n_primitives(), 2 * 5856 + 1);
    assert_eq!(cows.scene.objects().len(), 3);
    assert!(cows.scene.volumes().len() > 2 * 5856 / 64);
    // Both stand on the floor.
    for object in &cows.scene.objects()[..2] {
        let corners = object.primitives.clone().flat_map(|i| *cows.scene.primitives().triangle(i).vertices());
        let lowest = corners.map(|corner| corner.y).fold(f64::INFINITY, f64::min);
        assert!(lowest.abs() < 1e-12, "{}: {lowest}", object.name);
    }
}
