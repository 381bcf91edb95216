//! Wavefront OBJ and MTL files, parsed by tobj from what a guard makes of each statement.

mod context;
mod feed;
mod geometry;
mod groups;
mod libraries;
mod material;
mod mtl;
mod polygon;
mod runs;
mod statements;

use std::io::{self, BufRead};
use std::path::Path;

use self::context::Context;
use self::feed::Feed;
use self::geometry::ObjRules;
use self::libraries::{Libraries, Open};
use crate::folder::{Folder, open_regular};
use crate::{
    LoadOptions, LoadedScene, Material, MaterialId, ObjectId, Part, SceneBuilder, SceneError, Warning, view,
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

/// What a material library holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MtlLibrary {
    /// The materials by name, in the order of the file.
    pub materials: Vec<(String, Material)>,
    /// What was ignored.
    pub warnings: Vec<Warning>,
}

/// Reads an OBJ file and the libraries it names; every run between `o`, `g` and `usemtl` becomes a group.
///
/// Coordinates are taken as world units, right-handed, y up. Faces of any simple shape are triangulated, visible from
/// both sides. Normals (`vn`) shade where every corner of a face has one; they never move a hit. Texture coordinates
/// and maps are not read. How MTL terms become [`Material`] is described in the crate's README.
///
/// What is ignored or missing is a warning with file and line, a library or a material too. Only regular files are
/// opened, and only in the folder of the OBJ file or below unless [`LoadOptions::allow_outside`].
///
/// # Errors
///
/// [`SceneError::Read`] if a file is no regular file or fails while it is read, [`SceneError::Parse`] with the line
/// for a statement that cannot be understood or trusted (coordinates that are not finite, indices that are out of
/// range) or goes beyond [`LoadOptions::limits`], and [`SceneError::Empty`] if there is no face.
pub fn load_obj(path: &Path, options: &LoadOptions) -> Result<ObjModel, SceneError> {
    let reader = open_regular(path).map_err(|source| SceneError::Read { path: path.into(), source })?;
    let mut folder = Folder::of(path, options.allow_outside);
    read(reader, path, options, &mut |name: &Path| {
        let file = folder.open(name)?;
        Ok(file.map(|file| Box::new(file) as Box<dyn BufRead>))
    })
}

/// Reads OBJ text from anywhere, as [`load_obj`] does; `path` only names it in messages.
///
/// `open_library` gets the name of each library as the text has it, once, and decides what may be opened; if it
/// fails, that is a warning. Where a statement names several libraries, it first gets all of them as one name, since
/// names may have blanks.
///
/// # Errors
///
/// Those of [`load_obj`].
pub fn read_obj(
    reader: impl BufRead,
    path: &Path,
    options: &LoadOptions,
    mut open_library: impl FnMut(&Path) -> io::Result<Box<dyn BufRead>>,
) -> Result<ObjModel, SceneError> {
    read(reader, path, options, &mut |name: &Path| open_library(name).map(Some))
}

/// Reads MTL text from anywhere; `path` only names it in messages.
///
/// A value that cannot be read keeps its default, with a warning.
///
/// # Errors
///
/// [`SceneError::Read`] if reading fails, [`SceneError::Parse`] beyond [`LoadOptions::limits`].
pub fn read_mtl(reader: impl BufRead, path: &Path, options: &LoadOptions) -> Result<MtlLibrary, SceneError> {
    let mut context = Context::new(options.limits);
    mtl::read(reader, path, &mut context)?;
    Ok(MtlLibrary { materials: context.materials, warnings: context.warnings.into_vec(path) })
}

fn read(
    reader: impl BufRead,
    path: &Path,
    options: &LoadOptions,
    open: &mut Open<'_>,
) -> Result<ObjModel, SceneError> {
    let libraries = Libraries::new(path, Context::new(options.limits), open);
    let mut feed = Feed::new(reader, path, options.limits.line_bytes, ObjRules::new(libraries));
    // Libraries are read before tobj hears of them.
    let parsed = tobj::load_obj_buf(&mut feed, &tobj::LoadOptions::default(), |_| Ok(Default::default()));
    let ((models, _), rules) = feed.finish(parsed)?;
    if let Some(line) = rules.first_line
        && !rules.is_obj
    {
        let message = "the file is no OBJ file: it has no statement of that format".to_owned();
        return Err(SceneError::Parse { path: path.into(), line, message });
    }
    if rules.runs.all.is_empty() {
        return Err(SceneError::Empty { path: path.into() });
    }
    let mut context = rules.libraries.context;
    let resolved = rules.runs.resolve(path, &mut context);
    let (groups, fanned) = groups::from_models(models, rules.runs.all, &resolved);
    for (count, reason) in
        [(fanned.crossed, "cross themselves"), (fanned.skipped, "have too many corners, all together")]
    {
        if count > 0 {
            context.warn(path, 0, format!("faces cut into fans of triangles because they {reason}: {count}"));
        }
    }
    Ok(ObjModel { groups, materials: context.materials, warnings: context.warnings.into_vec(path) })
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
        builder.background(view::BACKGROUND).ambient(view::AMBIENT);
        builder.camera(view::camera(&builder.bounds())?);
        builder.add_light(view::light());
        Ok(LoadedScene { scene: builder.build()?, resolution: None, warnings })
    }
}
