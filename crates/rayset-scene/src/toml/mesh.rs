//! OBJ files that a scene file names.

use std::collections::HashMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::budget::Budget;
use super::fields::{Fault, Field, Fields, excerpt};
use super::reader::{Materials, unknown};
use super::transform::Transform;
use crate::folder::Folder;
use crate::{LoadOptions, MAX_COORDINATE, ObjModel, load_obj};

/// Reads the OBJ file of a table, puts it in its place and gives it the materials of the scene file.
pub(super) fn read(
    fields: &Fields,
    scene: &Path,
    options: &LoadOptions,
    materials: &Materials,
    budget: &mut Budget,
) -> Result<ObjModel, Fault> {
    let file = fields.required("file")?;
    let transform = Transform::read(fields)?;
    let path = resolve(file, scene, options.allow_outside)?;
    let limits = budget.take_file(fields.at())?;
    let options = LoadOptions { limits, ..options.clone() };
    let mut model = load_obj(&path, &options).map_err(Fault::Elsewhere)?;
    let n_triangles: usize = model.groups.iter().map(|group| group.triangles.len()).sum();
    budget.take(n_triangles as u64, model.groups.len() as u64, fields.at())?;
    if let Some(transform) = transform {
        for part in model.groups.iter_mut().flat_map(|group| &mut group.triangles) {
            *part = transform.apply(part).ok_or_else(|| {
                Fault::new(fields.at(), format!("a transformed coordinate exceeds {MAX_COORDINATE:e}"))
            })?;
        }
    }
    replace_materials(&mut model, fields, materials)?;
    Ok(model)
}

/// The path of a file, once it is known to be one that may be read.
fn resolve(field: Field, scene: &Path, allow_outside: bool) -> Result<PathBuf, Fault> {
    let file = field.string()?;
    let name = excerpt(file);
    let failed = |error: io::Error| match error.kind() {
        // Ours, and not the system's, has a message of its own.
        io::ErrorKind::PermissionDenied if error.get_ref().is_some() => {
            field.fault(format!("`{name}` lies outside the folder of the scene file"))
        }
        io::ErrorKind::NotFound => field.fault(format!("there is no file `{name}`")),
        _ => field.fault(format!("cannot read `{name}`: {error}")),
    };
    let path = Folder::of(scene, allow_outside).resolve(Path::new(file)).map_err(failed)?;
    match fs::metadata(&path).map_err(failed)?.is_file() {
        true => Ok(path),
        false => Err(field.fault(format!("`{name}` is no regular file"))),
    }
}

fn replace_materials(model: &mut ObjModel, fields: &Fields, materials: &Materials) -> Result<(), Fault> {
    let Some(field) = fields.either("material", "materials")? else { return Ok(()) };
    if field.key() == "material" {
        let (_, material) = materials.named(field)?;
        model.materials = vec![("material".to_owned(), material)];
        for group in &mut model.groups {
            group.material = Some(0);
        }
        return Ok(());
    }
    let mut known: HashMap<&str, Vec<usize>> = HashMap::new();
    for (i, (name, _)) in model.materials.iter().enumerate() {
        known.entry(name).or_default().push(i);
    }
    let mut replaced = Vec::new();
    for (name, at, field) in field.entries("materials")? {
        let (_, material) = materials.named(field)?;
        let Some(places) = known.get(name) else {
            return Err(Fault::new(at, unknown("MTL material", name, known.keys().copied())));
        };
        replaced.extend(places.iter().map(|&i| (i, material)));
    }
    for (i, material) in replaced {
        model.materials[i].1 = material;
    }
    Ok(())
}
