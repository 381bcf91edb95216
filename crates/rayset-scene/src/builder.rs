//! Scenes made in code.

use rayset_geometry::glam::DVec3;
use rayset_geometry::{BoundingBox, Primitive, PrimitiveColumns, VolumeColumns};

use crate::layout::id;
use crate::light::Place;
use crate::patch::PatchNormals;
use crate::{Camera, Color, Light, LightId, Material, MaterialId, ObjectId, Part, Patch, Scene, SceneError};

/// The largest absolute coordinate a scene may have, in world units: beyond it squares of squares would overflow.
pub const MAX_COORDINATE: f64 = 1e60;

/// How many primitives a scene may have: neither hierarchies nor what rays leave are numbered beyond.
pub const MAX_PRIMITIVES: usize = (1 << 30) - 1;

/// Collects what a scene is made of, and checks it.
///
/// Ids are handed out in the order of the calls.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    camera: Camera,
    background: Color,
    ambient: Color,
    lights: Vec<Light>,
    materials: Vec<Material>,
    objects: Vec<(String, MaterialId, Vec<Part>)>,
    /// The vertex normals of objects made of patches, in the order of their parts; by increasing id.
    patches: Vec<(ObjectId, Vec<Vec<DVec3>>)>,
    max_volume_primitives: Option<u32>,
}

impl SceneBuilder {
    /// An empty scene: black background, no ambient light, the default camera.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the camera.
    pub fn camera(&mut self, camera: Camera) -> &mut Self {
        self.camera = camera;
        self
    }

    /// Sets what a ray that hits nothing sees.
    pub fn background(&mut self, color: Color) -> &mut Self {
        self.background = color;
        self
    }

    /// Sets the intensity of ambient light.
    pub fn ambient(&mut self, color: Color) -> &mut Self {
        self.ambient = color;
        self
    }

    /// Adds a light.
    pub fn add_light(&mut self, light: Light) -> LightId {
        self.lights.push(light);
        LightId(id(self.lights.len()))
    }

    /// Adds a material.
    pub fn add_material(&mut self, material: Material) -> MaterialId {
        self.materials.push(material);
        MaterialId(id(self.materials.len()))
    }

    /// Adds an object: primitives under one bounding volume.
    pub fn add_object<P: Into<Part>>(
        &mut self,
        name: impl Into<String>,
        material: MaterialId,
        parts: impl IntoIterator<Item = P>,
    ) -> ObjectId {
        let parts = parts.into_iter().map(Into::into).collect();
        self.objects.push((name.into(), material, parts));
        ObjectId(id(self.objects.len()))
    }

    /// Adds an object of polygons with vertex normals.
    pub fn add_patches(
        &mut self,
        name: impl Into<String>,
        material: MaterialId,
        patches: impl IntoIterator<Item = Patch>,
    ) -> ObjectId {
        let (parts, normals): (Vec<_>, Vec<_>) = patches.into_iter().map(Patch::split).unzip();
        let object = self.add_object(name, material, parts);
        self.patches.push((object, normals));
        object
    }

    /// Splits objects spatially for bounding, so that no volume holds more primitives than this; `None` for one volume
    /// an object, as in the paper.
    ///
    /// Object and primitive ids stay the same. Without it a mesh of one object makes the partition meaningless.
    pub fn max_volume_primitives(&mut self, max: Option<u32>) -> &mut Self {
        self.max_volume_primitives = max.map(|max| max.max(1));
        self
    }

    /// The smallest box that holds all that was added; empty if nothing was.
    #[must_use]
    pub fn bounds(&self) -> BoundingBox {
        let parts = self.objects.iter().flat_map(|(_, _, parts)| parts);
        parts.map(|part| part.primitive.bounding_box()).collect()
    }

    /// Checks everything and lays the primitives out for testing.
    ///
    /// # Errors
    ///
    /// [`SceneError::Invalid`] for a light, material or primitive with a value out of range, a coordinate beyond
    /// [`MAX_COORDINATE`], an unknown material, or an object without primitives; [`SceneError::TooMany`] beyond
    /// [`MAX_PRIMITIVES`].
    pub fn build(self) -> Result<Scene, SceneError> {
        self.check()?;
        let n_parts: usize = self.objects.iter().map(|(_, _, parts)| parts.len()).sum();
        check_count(n_parts)?;
        let mut scene = Scene {
            camera: self.camera,
            background: self.background,
            ambient: self.ambient,
            lights: self.lights,
            spawns: self.materials.iter().map(Material::spawns).collect(),
            materials: self.materials,
            objects: Vec::with_capacity(self.objects.len()),
            primitives: PrimitiveColumns::default(),
            locations: Vec::with_capacity(n_parts),
            ids: Default::default(),
            volumes: VolumeColumns::default(),
            volume_objects: Vec::new(),
            volume_runs: Vec::new(),
            runs: Vec::new(),
            surfaces: Vec::with_capacity(n_parts),
            vertex_normals: Vec::new(),
            vertex_normal_index: Vec::new(),
            patches: PatchNormals::default(),
            extent: 0.0,
            bounds: BoundingBox::EMPTY,
        };
        let firsts = Material::firsts(&scene.materials);
        let mut patches = self.patches.into_iter().peekable();
        for (i, (name, material, parts)) in self.objects.into_iter().enumerate() {
            let normals = patches.next_if(|(object, _)| object.index() == i);
            let normals = normals.map(|(_, normals)| normals).unwrap_or_default();
            let materials = (material, firsts[material.index()]);
            scene.push_object(name, materials, &parts, &normals, self.max_volume_primitives);
        }
        Ok(scene)
    }

    fn check(&self) -> Result<(), SceneError> {
        let invalid =
            |item: String, message: &str| Err(SceneError::Invalid { item, message: message.to_owned() });
        for color in [self.background, self.ambient] {
            if !(color.is_finite() && color.min_element() >= 0.0) {
                return invalid(
                    "scene".to_owned(),
                    "the background or ambient colour is negative or not finite",
                );
            }
        }
        for (i, light) in self.lights.iter().enumerate() {
            let place = match light.place {
                Place::Point(position) => position.is_finite() && within_range(position),
                Place::Directional(direction) => direction != DVec3::ZERO,
            };
            if !place {
                return invalid(
                    format!("light {i}"),
                    "its position or direction is zero, too large or not finite",
                );
            }
            if !(light.color.is_finite() && light.color.min_element() >= 0.0) {
                return invalid(format!("light {i}"), "its colour is negative or not finite");
            }
        }
        for (i, material) in self.materials.iter().enumerate() {
            if let Some(problem) = material.problem() {
                return invalid(format!("material {i}"), problem);
            }
        }
        self.camera.check()?;
        for (name, material, parts) in &self.objects {
            let item = || format!("object `{name}`");
            if material.index() >= self.materials.len() {
                return invalid(item(), "it has no such material");
            }
            if parts.is_empty() {
                return invalid(item(), "it has no primitives");
            }
            for part in parts {
                if part.primitive.extent() > MAX_COORDINATE {
                    return invalid(item(), "a coordinate exceeds 1e60");
                }
                if let Some(normals) = &part.normals {
                    if !matches!(part.primitive, Primitive::Triangle(_)) {
                        return invalid(item(), "only triangles have vertex normals");
                    }
                    if normals.iter().any(|normal| !normal.is_finite()) {
                        return invalid(item(), "a vertex normal is not finite");
                    }
                }
            }
        }
        for (object, normals) in &self.patches {
            let (name, _, parts) = &self.objects[object.index()];
            for (part, normals) in parts.iter().zip(normals) {
                let n_vertices = match &part.primitive {
                    Primitive::Polygon(polygon) => polygon.vertices().len(),
                    _ => normals.len(),
                };
                let item = || format!("object `{name}`");
                if normals.len() != n_vertices {
                    return invalid(item(), "a patch needs as many normals as it has vertices");
                }
                if normals.iter().any(|normal| !normal.is_finite()) {
                    return invalid(item(), "a vertex normal is not finite");
                }
            }
        }
        Ok(())
    }
}

fn check_count(n_parts: usize) -> Result<(), SceneError> {
    if n_parts > MAX_PRIMITIVES {
        return Err(SceneError::TooMany { what: "primitives", limit: MAX_PRIMITIVES as u64 });
    }
    Ok(())
}

fn within_range(point: DVec3) -> bool {
    point.abs().max_element() <= MAX_COORDINATE
}

#[cfg(test)]
mod tests {
    use rayset_geometry::{Sphere, Triangle};

    use super::*;
    use crate::PrimitiveId;

    fn sphere(x: f64) -> Part {
        Sphere::new(DVec3::new(x, 0.0, 0.0), 1.0).into()
    }

    fn triangle() -> Part {
        Triangle::new(DVec3::ZERO, DVec3::X, DVec3::Y).into()
    }

    #[test]
    fn vertex_normals_shade_and_do_not_turn_the_surface() {
        let mut builder = SceneBuilder::new();
        let material = builder.add_material(Material::default());
        let normals = Some([DVec3::Z, DVec3::X, DVec3::Z]);
        builder.add_object("a", material, [triangle(), Part { normals, ..triangle() }, triangle()]);
        let scene = builder.build().unwrap();
        let point = DVec3::new(0.5, 0.25, 0.0);
        assert_eq!(scene.surface_at(PrimitiveId(0), point).shading_normal, DVec3::Z);
        assert_eq!(scene.surface_at(PrimitiveId(2), point).shading_normal, DVec3::Z);
        let smooth = scene.surface_at(PrimitiveId(1), point);
        assert_eq!(smooth.normal, DVec3::Z);
        assert!((smooth.shading_normal - DVec3::new(1.0, 0.0, 1.0).normalize()).length() < 1e-15);
    }

    #[test]
    fn hits_know_the_first_of_materials_that_are_the_same() {
        let mut builder = SceneBuilder::new();
        let grey = Material::default();
        // What compares as equal is not always the same.
        let zero = Material { shininess: 0.0, ..grey };
        let negative = Material { shininess: -0.0, ..grey };
        for material in [grey, zero, negative, zero, Material { index: 1.5, ..grey }, grey] {
            let id = builder.add_material(material);
            builder.add_object("a", id, [sphere(0.0), triangle()]);
        }
        let scene = builder.build().unwrap();
        let found: Vec<u32> = (0..12).map(|i| scene.surface_of(PrimitiveId(i)).material.0).collect();
        assert_eq!(found, [0, 0, 1, 1, 2, 2, 1, 1, 4, 4, 0, 0]);
        assert_eq!(scene.material_id_of(ObjectId(5)), MaterialId(5));
    }

    #[test]
    fn more_primitives_than_can_be_numbered_are_refused() {
        check_count(MAX_PRIMITIVES).unwrap();
        let error = check_count(MAX_PRIMITIVES + 1).unwrap_err();
        assert_eq!(error.to_string(), "more than 1073741823 primitives");
    }

    #[test]
    fn nonsense_is_refused_with_its_name() {
        let refused = |change: fn(&mut SceneBuilder)| {
            let mut builder = SceneBuilder::new();
            builder.add_material(Material::default());
            change(&mut builder);
            builder.build().unwrap_err().to_string()
        };
        assert_eq!(
            refused(|b| {
                b.add_object("pot", MaterialId(0), Vec::<Part>::new());
            }),
            "object `pot`: it has no primitives"
        );
        assert_eq!(
            refused(|b| {
                b.add_object("pot", MaterialId(7), [sphere(0.0)]);
            }),
            "object `pot`: it has no such material"
        );
        assert_eq!(
            refused(|b| {
                b.add_object("pot", MaterialId(0), [sphere(1e61)]);
            }),
            "object `pot`: a coordinate exceeds 1e60"
        );
        assert!(
            refused(|b| {
                b.add_material(Material { index: 0.0, ..Material::default() });
            })
            .starts_with("material 1: the index")
        );
        assert!(
            refused(|b| {
                b.add_light(Light::point(DVec3::NAN, DVec3::ONE));
            })
            .starts_with("light 0: its position")
        );
        assert!(
            refused(|b| {
                b.add_light(Light::directional(DVec3::ZERO, DVec3::ONE));
            })
            .starts_with("light 0: its position or direction")
        );
    }
}
