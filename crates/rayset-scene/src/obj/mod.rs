//! Wavefront OBJ and MTL files, parsed by tobj behind a guard that reads each line first.

mod guard;
mod material;

use std::cell::RefCell;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Sides, Triangle};

use self::guard::{Guard, ObjRules, Report};
use crate::{
    Camera, Color, Light, LoadOptions, LoadedScene, Material, MaterialId, ObjectId, Part, SceneBuilder,
    SceneError, Warning,
};

/// Triangles that share a material: a run between `o`, `g` and `usemtl` statements.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjGroup {
    /// The name of the last `o` or `g`; `unnamed_object` before the first.
    pub name: String,
    /// The index of its material in [`ObjModel::materials`], if it has one.
    pub material: Option<usize>,
    /// Its triangles, in the order of the file.
    pub triangles: Vec<Part>,
}

/// What an OBJ file and its material libraries hold.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ObjModel {
    /// The groups, in the order of the file.
    pub groups: Vec<ObjGroup>,
    /// The materials by name, in the order of the libraries.
    pub materials: Vec<(String, Material)>,
    /// What was ignored.
    pub warnings: Vec<Warning>,
}

/// Reads an OBJ file and the libraries it names; every run between `o`, `g` and `usemtl` becomes a group.
///
/// Coordinates are taken as world units, right-handed, y up. Faces are triangulated as fans, visible from both
/// sides. Normals (`vn`) shade where every corner of a face has one; they never move a hit. Texture coordinates and
/// maps are ignored, maps with a warning. How MTL terms become [`Material`] is described in the crate's README.
///
/// # Errors
///
/// [`SceneError::Read`] if the file or a library cannot be read, [`SceneError::Parse`] with the line for a statement
/// that cannot be understood or trusted (numbers that are not finite, indices that are out of range), and
/// [`SceneError::Empty`] if there is no face.
pub fn load_obj(path: &Path, _options: &LoadOptions) -> Result<ObjModel, SceneError> {
    let report = RefCell::new(Report::default());
    let mut reader = Guard::new(open(path)?, path, &report, ObjRules::default());
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    let loaded = tobj::load_obj_buf(&mut reader, &options, |library| load_library(path, library, &report));
    let line = reader.line();
    drop(reader);
    let mut report = report.into_inner();
    if let Some(error) = report.error.take() {
        return Err(error);
    }
    let parse =
        |error: tobj::LoadError| SceneError::Parse { path: path.into(), line, message: error.to_string() };
    let (models, materials) = loaded.map_err(parse)?;
    let materials = materials.map_err(parse)?;
    let groups: Vec<_> = models.into_iter().map(group).filter(|group| !group.triangles.is_empty()).collect();
    if groups.is_empty() {
        return Err(SceneError::Empty { path: path.into() });
    }
    let materials = materials.iter().map(|m| (m.name.clone(), material::from_mtl(m))).collect();
    Ok(ObjModel { groups, materials, warnings: report.warnings })
}

impl ObjModel {
    /// Adds the groups as objects, with their materials, to a scene; a group without one is matt grey.
    pub fn add_to(self, builder: &mut SceneBuilder) -> Vec<ObjectId> {
        let ids: Vec<MaterialId> = self.materials.iter().map(|(_, m)| builder.add_material(*m)).collect();
        let mut grey = None;
        let mut objects = Vec::with_capacity(self.groups.len());
        for group in self.groups {
            let material = match group.material {
                Some(index) => ids[index],
                None => *grey.get_or_insert_with(|| builder.add_material(Material::default())),
            };
            objects.push(builder.add_object(group.name, material, group.triangles));
        }
        objects
    }
}

impl ObjModel {
    /// A scene of the model alone, seen by a camera that shows all of it, lit by one light beside the camera.
    ///
    /// # Errors
    ///
    /// Those of [`SceneBuilder::build`].
    pub fn into_scene(mut self, options: &LoadOptions) -> Result<LoadedScene, SceneError> {
        let mut builder = SceneBuilder::new();
        let warnings = std::mem::take(&mut self.warnings);
        self.add_to(&mut builder);
        builder.max_volume_primitives(options.max_volume_primitives);
        builder.ambient(Color::splat(0.1));
        builder.background(Color::splat(0.2));
        let bounds = builder.bounds();
        let towards = DVec3::new(0.5, 0.35, 1.0);
        builder.camera(Camera::fitted(
            bounds.center(),
            0.5 * bounds.diagonal().length(),
            towards,
            DVec3::Y,
            40.0,
        )?);
        builder.add_light(Light::directional(DVec3::new(-0.2, 0.8, 1.0), Color::splat(0.9)));
        Ok(LoadedScene { scene: builder.build()?, resolution: None, warnings })
    }
}

fn open(path: &Path) -> Result<BufReader<File>, SceneError> {
    File::open(path).map(BufReader::new).map_err(|source| SceneError::Read { path: path.into(), source })
}

/// Reads one library; whatever is wrong with it is noted in the report, which knows the place better than tobj.
fn load_library(obj: &Path, library: &Path, report: &RefCell<Report>) -> tobj::MTLLoadResult {
    let path = obj.parent().unwrap_or(Path::new("")).join(library);
    let file = match open(&path) {
        Ok(file) => file,
        Err(error) => {
            report.borrow_mut().fail(error);
            return Err(tobj::LoadError::OpenFileFailed);
        }
    };
    let mut reader = Guard::new(file, &path, report, guard::MtlRules::default());
    let loaded = tobj::load_mtl_buf(&mut reader);
    let line = reader.line();
    match &loaded {
        Err(error) => {
            report.borrow_mut().fail(SceneError::Parse { path, line, message: error.to_string() });
        }
        Ok((materials, _)) if materials.is_empty() => {
            let message = "the library holds no material".to_owned();
            report.borrow_mut().fail(SceneError::Parse { path, line: line.max(1), message });
        }
        Ok(_) => {}
    }
    loaded
}

fn group(model: tobj::Model) -> ObjGroup {
    let mesh = model.mesh;
    let vector = |values: &[f64], index: u32| {
        let start = index as usize * 3;
        DVec3::new(values[start], values[start + 1], values[start + 2])
    };
    let corners = mesh.indices.chunks_exact(3).zip(mesh.normal_indices.chunks_exact(3));
    let triangles = corners.map(|(vertices, normals)| {
        let [a, b, c] = [vertices[0], vertices[1], vertices[2]].map(|index| vector(&mesh.positions, index));
        let normals = [normals[0], normals[1], normals[2]].map(|index| vector(&mesh.normals, index));
        let has_normals = normals.iter().all(|normal| *normal != DVec3::ZERO);
        Part {
            primitive: Triangle::new(a, b, c).into(),
            sides: Sides::Both,
            normals: has_normals.then_some(normals),
        }
    });
    ObjGroup { name: model.name, material: mesh.material_id, triangles: triangles.collect() }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::float_cmp, reason = "numbers that no rounding touches")]

    use std::fs;
    use std::path::PathBuf;

    use super::*;

    /// A folder of its own for each test, removed at the end.
    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Self {
            let path = std::env::temp_dir().join(format!("rayset-scene-{name}-{}", std::process::id()));
            fs::create_dir_all(&path).unwrap();
            Self(path)
        }

        fn load(&self, obj: &str, mtl: &str) -> Result<ObjModel, SceneError> {
            fs::write(self.0.join("a.obj"), obj).unwrap();
            fs::write(self.0.join("a.mtl"), mtl).unwrap();
            load_obj(&self.0.join("a.obj"), &LoadOptions::default())
        }

        fn refused(&self, obj: &str, mtl: &str) -> String {
            self.load(obj, mtl).unwrap_err().to_string().replace(&format!("{}/", self.0.display()), "")
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn groups_and_materials_become_objects() {
        let folder = Folder::new("groups");
        let obj = format!(
            "mtllib a.mtl\n{SQUARE}g one\nusemtl red\nf 1 2 3\nusemtl glass\nf 1 3 4\no two\nf -4 -3 -2 -1\n"
        );
        let model =
            folder.load(&obj, "newmtl red\nKd 1 0 0\nnewmtl glass\nillum 7\nd 0.25\nNi 1.5\n").unwrap();
        let shape: Vec<_> =
            model.groups.iter().map(|g| (g.name.as_str(), g.material, g.triangles.len())).collect();
        assert_eq!(shape, [("one", Some(0), 1), ("one", Some(1), 1), ("two", Some(1), 2)]);
        assert_eq!(model.materials[0].1.diffuse, DVec3::X);
        assert_eq!(model.materials[1].1.transmittance, DVec3::splat(0.75));
        assert_eq!(model.materials[1].1.index, 1.5);
        let mut builder = SceneBuilder::new();
        model.add_to(&mut builder);
        assert_eq!(builder.build().unwrap().objects().len(), 3);
    }

    #[test]
    fn normals_are_kept_only_where_every_corner_has_one() {
        let folder = Folder::new("normals");
        let with = folder.load(&format!("{SQUARE}vn 0 0 1\nf 1//1 2//1 3//1\n"), "").unwrap();
        assert_eq!(with.groups[0].triangles[0].normals, Some([DVec3::Z; 3]));
        let without = folder.load(&format!("{SQUARE}vn 0 0 1\nf 1 2 3\n"), "").unwrap();
        assert_eq!(without.groups[0].triangles[0].normals, None);
        let mixed = folder.load(&format!("{SQUARE}vn 0 0 1\nf 1//1 2//1 3//1\nf 1 3 4\n"), "").unwrap();
        let normals: Vec<_> = mixed.groups[0].triangles.iter().map(|part| part.normals.is_some()).collect();
        assert_eq!(normals, [true, false]);
    }

    #[test]
    fn what_cannot_be_trusted_is_refused_with_its_line() {
        let folder = Folder::new("refused");
        for (obj, mtl, expected) in [
            ("", "", "`a.obj` holds no face"),
            ("v 0 0 0\n", "", "`a.obj` holds no face"),
            ("v 0 0\n", "", "a.obj:1: `v` needs 3 numbers"),
            ("v 0 0 nan\n", "", "a.obj:1: `nan` is not a finite number"),
            ("v 0 0 1e999\n", "", "a.obj:1: `1e999` is not a finite number"),
            ("v 0 0 inf\n", "", "a.obj:1: `inf` is not a finite number"),
            ("v 0 0 1e61\n", "", "a.obj:1: `1e61` exceeds 1e60"),
            ("v 0 0 0x\n", "", "a.obj:1: `0x` is not a finite number"),
            ("v 0 0 0\nv 1 0 0\nf 1 2\n", "", "a.obj:3: a face needs 3 corners"),
            ("v 0 0 0\nf 1 1 2\n", "", "a.obj:2: vertex 2 is out of range: there are 1"),
            ("v 0 0 0\nf 0 1 1\n", "", "a.obj:2: vertex 0 is out of range: there are 1"),
            ("v 0 0 0\nf 1 1 -2\n", "", "a.obj:2: vertex -2 is out of range: there are 1"),
            ("v 0 0 0\nf 1/9 1/9 1/9\n", "", "a.obj:2: texture coordinate 9 is out of range: there are 0"),
            ("v 0 0 0\nf 1 1 99999999999999999999\n", "", "a.obj:2: `99999999999999999999` is not an index"),
            ("v 0 0 0\nf 1 1 x\n", "", "a.obj:2: `x` is not an index"),
            ("mtllib none.mtl\n", "", "cannot read `none.mtl`"),
            ("mtllib a.mtl\n", "", "a.mtl:1: the library holds no material"),
            ("mtllib a.mtl\n", "newmtl a\nKd 1 0 x\n", "a.mtl:2: `x` is not a finite number"),
            ("mtllib a.mtl\n", "newmtl a\nKd 1 0 NaN\n", "a.mtl:2: `NaN` is not a finite number"),
            ("mtllib a.mtl\n", "newmtl a\nNi\n", "a.mtl:2: `Ni` needs a number"),
            ("mtllib a.mtl\n", "newmtl a\nillum two\n", "a.mtl:2: `two` is not an illumination model"),
        ] {
            assert_eq!(folder.refused(obj, mtl), expected, "{obj:?} {mtl:?}");
        }
        let missing = load_obj(&folder.0.join("missing.obj"), &LoadOptions::default()).unwrap_err();
        assert!(matches!(missing, SceneError::Read { .. }), "{missing}");
    }

    #[test]
    fn what_is_ignored_is_a_warning() {
        let folder = Folder::new("ignored");
        let obj = format!("mtllib a.mtl\n{SQUARE}curv 0 1\nl 1 2 3\nusemtl gold\nf 1 2 3\n");
        let model = folder.load(&obj, "newmtl red\nmap_Kd wood.png\nKd 0.5\n").unwrap();
        let warnings: Vec<_> = model.warnings.iter().map(|w| (w.line, w.message.as_str())).collect();
        assert_eq!(
            warnings,
            [
                (2, "`map_Kd` ignored: textures are not supported"),
                (6, "`curv` ignored"),
                (7, "`l` ignored: only faces are read"),
                (8, "no material `gold`: the default is used"),
            ]
        );
        assert_eq!(model.materials[0].1.diffuse, DVec3::splat(0.5), "one number means grey");
        assert_eq!(model.groups[0].material, None);
    }

    #[test]
    fn unknown_material_ends_the_run_of_the_one_before() {
        let folder = Folder::new("unknown");
        let obj = format!("mtllib a.mtl\n{SQUARE}usemtl red\nf 1 2 3\nusemtl gold\nf 1 3 4\n");
        let model = folder.load(&obj, "newmtl red\nKd 1 0 0\n").unwrap();
        let materials: Vec<_> = model.groups.iter().map(|group| group.material).collect();
        assert_eq!(materials, [Some(0), None]);
        assert_eq!(model.warnings[0].message, "no material `gold`: the default is used");
    }

    #[test]
    fn libraries_outside_the_folder_are_not_read() {
        let folder = Folder::new("outside");
        for library in ["/etc/passwd", "../a.mtl", "b/../../a.mtl"] {
            let model = folder.load(&format!("mtllib {library}\n{SQUARE}f 1 2 3\n"), "newmtl a\n").unwrap();
            assert!(model.materials.is_empty());
            assert!(model.warnings[0].message.contains("outside"), "{}", model.warnings[0]);
        }
    }

    #[test]
    fn truncated_file_is_refused_or_loads_what_is_whole() {
        let folder = Folder::new("truncated");
        let whole = format!("{SQUARE}f 1 2 3\nf 1 3 4\n");
        for end in 0..whole.len() {
            if let Ok(model) = folder.load(&whole[..end], "") {
                assert!(model.groups[0].triangles.len() <= 2, "{end}");
            }
        }
    }
}
