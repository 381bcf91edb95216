//! From the tables of a scene file to a scene.

use std::collections::HashMap;
use std::path::Path;

use rayset_geometry::glam::DVec3;
use toml::de::DeTable;

use super::budget::Budget;
use super::fields::{Fault, Field, Fields, excerpt, suggestion};
use super::keys;
use super::shapes::{self, ReadShape, SHAPES};
use crate::warnings::Warnings;
use crate::{
    Camera, Color, Light, LoadOptions, LoadedScene, Material, MaterialId, Part, RandomSpheres, SceneBuilder,
    SceneError, view,
};

/// Pixels across or down.
const MAX_PIXELS_A_SIDE: u32 = 1 << 16;

/// Pixels of an image.
const MAX_PIXELS: u64 = 1 << 28;

/// Reads a whole scene file.
pub(super) fn read(text: &str, path: &Path, options: &LoadOptions) -> Result<LoadedScene, Fault> {
    let table = DeTable::parse(text).map_err(|error| syntax(text, &error))?;
    let scene = Fields::new(table.get_ref(), 0, &keys::SCENE)?;
    let mut builder = SceneBuilder::new();
    let resolution = scene.get("resolution").map(resolution).transpose()?;
    builder.background(scene.or("background", view::BACKGROUND, Field::color)?);
    builder.ambient(scene.or("ambient", view::AMBIENT, Field::color)?);
    let of_file = scene.get("max_volume_primitives").map(|field| field.integer_32(1..=u32::MAX));
    builder.max_volume_primitives(options.max_volume_primitives.or(of_file.transpose()?));
    let camera = scene.get("camera").map(camera).transpose()?;
    for light in lights(&scene)? {
        builder.add_light(light);
    }
    let materials = Materials::read(&scene, &mut builder)?;
    let mut contents = Contents { options, path, materials, things: Vec::new(), objects: HashMap::new() };
    let mut warnings = Warnings::new(options.limits.warnings);
    contents.read(&scene, &mut warnings)?;
    contents.add_to(&mut builder)?;
    let bounds = builder.bounds();
    if bounds.is_empty() {
        return Err(Fault::new(0, "the scene is empty: it needs a [[sphere]], an [[obj]] or the like"));
    }
    let camera = camera.map_or_else(|| view::camera(&bounds), Ok);
    builder.camera(camera.map_err(|error| fault(0, error))?);
    let scene = builder.build().map_err(|error| fault(0, error))?;
    Ok(LoadedScene { scene, resolution, warnings: warnings.into_vec(path) })
}

/// An error of something whose table begins at an offset, unless it knows its place better.
pub(super) fn fault(at: usize, error: SceneError) -> Fault {
    match error {
        SceneError::Invalid { .. } | SceneError::TooMany { .. } => Fault::new(at, error.to_string()),
        _ => Fault::Elsewhere(error),
    }
}

fn syntax(text: &str, error: &toml::de::Error) -> Fault {
    let message = match error.message() {
        // What the parser says of dotted keys, and of lists and tables.
        message if message.contains("recur") => "keys, lists or tables are nested too deeply",
        message => message,
    };
    // What follows the end of a text stands on no line.
    let at = error.span().map_or(0, |span| span.start).min(text.trim_end().len());
    Fault::new(at, message.chars().filter(|c| !c.is_control()).collect::<String>())
}

fn resolution(field: Field) -> Result<(u32, u32), Fault> {
    let [width, height] = field.list_of("numbers")?;
    let size = |field: Field| field.integer_32(1..=MAX_PIXELS_A_SIDE);
    let (width, height) = (size(width)?, size(height)?);
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(field.fault(format!("`resolution` has more than {MAX_PIXELS} pixels")));
    }
    Ok((width, height))
}

fn camera(field: Field) -> Result<Camera, Fault> {
    let fields = field.table(&keys::CAMERA)?;
    let from = fields.required("from")?.point()?;
    let at = fields.required("at")?.point()?;
    let up = fields.or("up", DVec3::Y, Field::vector)?;
    let angle = fields.or("angle", 45.0, Field::number)?;
    Camera::new(from, at, up, angle).map_err(|error| fault(fields.at(), error))
}

/// The lights; one beside the fitted camera if the file does not speak of lights.
fn lights(scene: &Fields) -> Result<Vec<Light>, Fault> {
    if scene.get("light").is_none() {
        return Ok(vec![view::light()]);
    }
    scene.tables("light", &keys::LIGHT)?.iter().map(light).collect()
}

fn light(fields: &Fields) -> Result<Light, Fault> {
    let color = fields.or("color", Color::ONE, Field::color)?;
    let color = color * fields.or("intensity", 1.0, Field::not_negative)?;
    if !color.is_finite() {
        return Err(Fault::new(fields.at(), "`color` times `intensity` is not finite"));
    }
    match fields.either("position", "towards")? {
        Some(field) if field.key() == "position" => Ok(Light::point(field.point()?, color)),
        Some(field) => match field.vector()? {
            DVec3::ZERO => Err(field.fault("`towards` is zero")),
            towards => Ok(Light::directional(towards, color)),
        },
        None => Err(Fault::new(fields.at(), "[[light]] needs `position` or `towards`")),
    }
}

fn material(field: Field) -> Result<Material, Fault> {
    let fields = field.table(&keys::MATERIAL)?;
    let default = Material::default();
    Ok(Material {
        diffuse: fields.or("diffuse", default.diffuse, Field::color)?,
        specular: fields.or("specular", default.specular, Field::color)?,
        shininess: fields.or("shininess", default.shininess, Field::not_negative)?,
        reflectance: fields.or("reflectance", default.reflectance, Field::color)?,
        transmittance: fields.or("transmittance", default.transmittance, Field::color)?,
        index: fields.or("index", default.index, Field::positive)?,
        emission: fields.or("emission", default.emission, Field::color)?,
    })
}

/// The materials by name.
pub(super) struct Materials<'t> {
    by_name: HashMap<&'t str, (MaterialId, Material)>,
}

impl<'t> Materials<'t> {
    fn read(scene: &Fields<'t>, builder: &mut SceneBuilder) -> Result<Self, Fault> {
        let mut by_name = HashMap::new();
        let entries = scene.get("material").map(|field| field.entries("material"));
        for (name, _, field) in entries.transpose()?.unwrap_or_default() {
            let material = material(field)?;
            by_name.insert(name, (builder.add_material(material), material));
        }
        Ok(Self { by_name })
    }

    /// The material that a string names.
    pub(super) fn named(&self, field: Field) -> Result<(MaterialId, Material), Fault> {
        let name = field.string()?;
        let known = self.by_name.get(name).copied();
        known.ok_or_else(|| field.fault(unknown("material", name, self.by_name.keys().copied())))
    }
}

/// Says that there is nothing of a name, and what there is.
pub(super) fn unknown<'a>(what: &str, name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let mut known: Vec<_> = known.collect();
    known.sort_unstable();
    let hint = match suggestion(name, known.iter().copied()) {
        Some(known) => format!("did you mean `{known}`?"),
        None if known.is_empty() => "there is none".to_owned(),
        None => {
            let names: Vec<_> = known.iter().take(8).map(|name| excerpt(name)).collect();
            let more = if known.len() > names.len() { " and others" } else { "" };
            format!("there is `{}`{more}", names.join("`, `"))
        }
    };
    format!("no {what} `{}`: {hint}", excerpt(name))
}

/// What a scene holds, in the order of the file.
struct Contents<'t> {
    options: &'t LoadOptions,
    path: &'t Path,
    materials: Materials<'t>,
    things: Vec<Thing>,
    /// The indices of the objects that were given names.
    objects: HashMap<&'t str, usize>,
}

/// Something that becomes one object or several.
enum Thing {
    Object {
        name: String,
        material: Option<MaterialId>,
        parts: Vec<Part>,
    },
    Random {
        spheres: RandomSpheres,
        at: usize,
    },
    #[cfg(feature = "obj")]
    Mesh(crate::ObjModel),
}

/// A table that stands for one or several.
enum Source {
    Shape { key: &'static str, index: usize, read: ReadShape },
    Random,
    Obj,
}

impl<'t> Contents<'t> {
    fn read(&mut self, scene: &Fields<'t>, warnings: &mut Warnings) -> Result<(), Fault> {
        let mut tables = Vec::new();
        for (key, section, read) in SHAPES {
            let all = scene.tables(key, section)?.into_iter().enumerate();
            tables.extend(all.map(|(index, fields)| (fields, Source::Shape { key, index, read })));
        }
        let random = scene.tables("random_spheres", &keys::RANDOM_SPHERES)?;
        tables.extend(random.into_iter().map(|fields| (fields, Source::Random)));
        let models = scene.tables("obj", &keys::OBJ)?;
        tables.extend(models.into_iter().map(|fields| (fields, Source::Obj)));
        tables.sort_by_key(|(fields, _)| fields.at());
        let mut budget = Budget::new(self.options.limits);
        for (fields, source) in tables {
            match source {
                Source::Shape { key, index, read } => {
                    budget.take(1, 1, fields.at())?;
                    self.add_shape(&fields, key, index, read)?;
                }
                Source::Random => {
                    let spheres = shapes::random_spheres(&fields)?;
                    budget.take(spheres.count.into(), spheres.count.into(), fields.at())?;
                    if spheres.separate {
                        budget.take_separate(spheres.count.into(), fields.at())?;
                    }
                    self.things.push(Thing::Random { spheres, at: fields.at() });
                }
                Source::Obj => self.add_model(&fields, &mut budget, warnings)?,
            }
        }
        Ok(())
    }

    fn add_shape(
        &mut self,
        fields: &Fields<'t>,
        key: &str,
        index: usize,
        read: ReadShape,
    ) -> Result<(), Fault> {
        let part = shapes::part(fields, read, &self.options.limits)?;
        let material = fields.get("material");
        let given = material.map(|field| self.materials.named(field)).transpose()?.map(|(id, _)| id);
        let object = fields.get("object").map(Field::string).transpose()?;
        let existing = object.and_then(|name| self.objects.get(name)).map(|&i| &mut self.things[i]);
        let Some(Thing::Object { material: agreed, parts, .. }) = existing else {
            if let Some(name) = object {
                self.objects.insert(name, self.things.len());
            }
            let name = object.map_or_else(|| format!("{key} {index}"), str::to_owned);
            self.things.push(Thing::Object { name, material: given, parts: vec![part] });
            return Ok(());
        };
        if let (Some(field), Some(given)) = (material, given)
            && *agreed.get_or_insert(given) != given
        {
            let name = excerpt(object.unwrap_or_default());
            return Err(
                field.fault(format!("object `{name}` has another material already, and may have one only"))
            );
        }
        parts.push(part);
        Ok(())
    }

    #[cfg(feature = "obj")]
    fn add_model(
        &mut self,
        fields: &Fields<'t>,
        budget: &mut Budget,
        warnings: &mut Warnings,
    ) -> Result<(), Fault> {
        let mut model = super::mesh::read(fields, self.path, self.options, &self.materials, budget)?;
        for warning in std::mem::take(&mut model.warnings) {
            warnings.push(&warning.path, warning.line, warning.message);
        }
        self.things.push(Thing::Mesh(model));
        Ok(())
    }

    #[cfg(not(feature = "obj"))]
    fn add_model(&self, fields: &Fields, _: &mut Budget, _: &mut Warnings) -> Result<(), Fault> {
        let _ = self.path;
        Err(Fault::new(fields.at(), "[[obj]] needs the feature `obj`, without which this program was built"))
    }

    fn add_to(self, builder: &mut SceneBuilder) -> Result<(), Fault> {
        let mut grey = None;
        for thing in self.things {
            match thing {
                Thing::Object { name, material, parts } => {
                    let material = material.unwrap_or_else(|| {
                        *grey.get_or_insert_with(|| builder.add_material(Material::default()))
                    });
                    builder.add_object(name, material, parts);
                }
                Thing::Random { spheres, at } => spheres.add_to(builder).map_err(|error| fault(at, error))?,
                #[cfg(feature = "obj")]
                Thing::Mesh(model) => {
                    model.add_to(builder);
                }
            }
        }
        Ok(())
    }
}
