//! Scenes made in code.

use std::cmp::Ordering;

use rayset_geometry::glam::DVec3;
use rayset_geometry::{
    BoundingBox, BoundingSphere, ColumnRun, Primitive, PrimitiveColumns, PrimitiveKind, VolumeColumns,
    enclosing_sphere,
};

use crate::light::Place;
use crate::{
    Camera, Color, Light, LightId, Material, MaterialId, Object, ObjectId, Part, PrimitiveId,
    PrimitiveLocation, Scene, SceneError, VolumeId,
};

/// The largest absolute coordinate a scene may have, in world units: beyond it squares of squares would overflow.
pub const MAX_COORDINATE: f64 = 1e60;

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
    /// 2^32 - 1 primitives.
    pub fn build(self) -> Result<Scene, SceneError> {
        self.check()?;
        let n_parts: usize = self.objects.iter().map(|(_, _, parts)| parts.len()).sum();
        if n_parts >= u32::MAX as usize {
            return Err(SceneError::TooMany { what: "primitives", limit: u64::from(u32::MAX) - 1 });
        }
        let mut scene = Scene {
            camera: self.camera,
            background: self.background,
            ambient: self.ambient,
            lights: self.lights,
            materials: self.materials,
            objects: Vec::with_capacity(self.objects.len()),
            primitives: PrimitiveColumns::default(),
            locations: Vec::with_capacity(n_parts),
            ids: Default::default(),
            volumes: VolumeColumns::default(),
            volume_objects: Vec::new(),
            volume_runs: Vec::new(),
            runs: Vec::new(),
            vertex_normals: Vec::new(),
            vertex_normal_index: Vec::new(),
            extent: 0.0,
        };
        for (name, material, parts) in self.objects {
            scene.push_object(name, material, parts, self.max_volume_primitives);
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
        if !within_range(self.camera.viewpoint()) {
            return invalid("camera".to_owned(), "the viewpoint is too far away");
        }
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
        Ok(())
    }
}

/// Halves a set of parts, across the longest side of the box round their middles, until no piece exceeds `max`.
fn for_each_piece(parts: &[Part], piece: &mut [usize], max: usize, visit: &mut impl FnMut(&mut [usize])) {
    if piece.len() <= max {
        visit(piece);
        return;
    }
    let middle = |i: usize| parts[i].primitive.bounding_box().center();
    let size = piece.iter().map(|&i| middle(i)).collect::<BoundingBox>().diagonal();
    let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b]).then(b.cmp(&a))).unwrap_or(0);
    piece.sort_by_cached_key(|&i| (OrderedBits(middle(i)[axis]), i));
    // Pieces of equal size, as few as can be.
    let n_pieces = piece.len().div_ceil(max);
    let cut = piece.len() * (n_pieces / 2) / n_pieces;
    let (low, high) = piece.split_at_mut(cut);
    for_each_piece(parts, low, max, visit);
    for_each_piece(parts, high, max, visit);
}

/// A float in its total order.
struct OrderedBits(f64);

impl Ord for OrderedBits {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for OrderedBits {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for OrderedBits {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for OrderedBits {}

fn within_range(point: DVec3) -> bool {
    point.abs().max_element() <= MAX_COORDINATE
}

/// The id of the last of `len` things.
fn id(len: usize) -> u32 {
    u32::try_from(len - 1).expect("fewer than 2^32 of anything")
}

impl Scene {
    /// Appends an object under one volume, or several if it has more primitives than a volume may hold.
    fn push_object(
        &mut self,
        name: String,
        material: MaterialId,
        parts: Vec<Part>,
        max_volume_primitives: Option<u32>,
    ) {
        let object = ObjectId(id(self.objects.len() + 1));
        let first = id(self.locations.len() + 1);
        let nowhere = PrimitiveLocation { kind: PrimitiveKind::Sphere, index: 0, volume: VolumeId(0) };
        self.locations.resize(self.locations.len() + parts.len(), nowhere);
        let mut all: Vec<usize> = (0..parts.len()).collect();
        let max = max_volume_primitives.map_or(usize::MAX, |max| max as usize);
        let mut only = None;
        for_each_piece(&parts, &mut all, max, &mut |piece| {
            let bounds = self.push_volume(object, first, &parts, piece);
            only = (piece.len() == parts.len()).then_some(bounds);
        });
        let bounds = only.unwrap_or_else(|| enclosing_sphere(parts.iter().map(|part| &part.primitive)));
        let primitives = first..id(self.locations.len() + 1);
        self.objects.push(Object { name, material, bounds, primitives });
    }

    /// Appends a volume round a piece of an object; columns are sorted by kind and sides, so that every run is
    /// uniform.
    fn push_volume(
        &mut self,
        object: ObjectId,
        first: u32,
        parts: &[Part],
        piece: &mut [usize],
    ) -> BoundingSphere {
        let volume = VolumeId(id(self.volumes.len() + 1));
        piece.sort_unstable_by_key(|&i| (parts[i].primitive.kind(), parts[i].sides, i));
        let first_run = id(self.runs.len() + 1);
        for &i in &*piece {
            let part = &parts[i];
            self.extent = self.extent.max(part.primitive.extent());
            let run = self.primitives.push(&part.primitive, part.sides);
            let primitive = first + id(i + 1);
            self.locations[primitive as usize] =
                PrimitiveLocation { kind: run.kind, index: run.range.start, volume };
            self.ids[run.kind as usize].push(PrimitiveId(primitive));
            if let Some(normals) = part.normals {
                self.vertex_normal_index.resize(run.range.start as usize, u32::MAX);
                self.vertex_normal_index.push(id(self.vertex_normals.len() + 1));
                self.vertex_normals.push(normals);
            }
            self.extend_runs(first_run, run);
        }
        let bounds = enclosing_sphere(piece.iter().map(|&i| &parts[i].primitive));
        self.volumes.push(&bounds);
        self.volume_objects.push(object);
        self.volume_runs.push(first_run..id(self.runs.len() + 1));
        bounds
    }

    fn extend_runs(&mut self, first_run: u32, run: ColumnRun) {
        match self.runs[first_run as usize..].last_mut() {
            Some(last)
                if (last.kind, last.sides, last.range.end) == (run.kind, run.sides, run.range.start) =>
            {
                last.range.end = run.range.end;
            }
            _ => self.runs.push(run),
        }
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::float_cmp, reason = "numbers that no rounding touches")]

    use rayset_geometry::{PrimitiveKind, Sides, Sphere, Triangle};

    use super::*;

    fn sphere(x: f64) -> Part {
        Sphere::new(DVec3::new(x, 0.0, 0.0), 1.0).into()
    }

    fn triangle() -> Part {
        Triangle::new(DVec3::ZERO, DVec3::X, DVec3::Y).into()
    }

    #[test]
    fn primitives_are_numbered_by_object_whatever_their_kind() {
        let mut builder = SceneBuilder::new();
        let material = builder.add_material(Material::default());
        builder.add_object("a", material, [triangle(), sphere(0.0), triangle()]);
        builder.add_object("b", material, [sphere(3.0)]);
        let scene = builder.build().unwrap();
        assert_eq!(scene.objects()[0].primitives, 0..3);
        assert_eq!(scene.objects()[1].primitives, 3..4);
        for i in 0..4 {
            let PrimitiveLocation { kind, index, .. } = scene.location(PrimitiveId(i));
            assert_eq!(scene.primitive_id(kind, index), PrimitiveId(i));
        }
        assert_eq!(scene.location(PrimitiveId(2)).kind, PrimitiveKind::Triangle);
        let runs = scene.volume_runs(VolumeId(0));
        assert_eq!(runs.len(), 2);
        assert_eq!((runs[0].kind, runs[0].range.clone()), (PrimitiveKind::Sphere, 0..1));
        assert_eq!((runs[1].kind, runs[1].range.clone()), (PrimitiveKind::Triangle, 0..2));
        assert_eq!(scene.volume_runs(VolumeId(1))[0].range, 1..2);
        assert_eq!(scene.volume_object(VolumeId(1)), ObjectId(1));
        assert_eq!(scene.extent(), 4.0);
    }

    #[test]
    fn split_objects_keep_their_ids_and_every_volume_is_small() {
        let build = |max| {
            let mut builder = SceneBuilder::new();
            let material = builder.add_material(Material::default());
            // 23 spheres in two rows, out of order along x, and triangles between them.
            let ball = |i: u32| sphere(f64::from(i * 7 % 23));
            builder.add_object("a", material, (0..23).map(ball).chain([triangle(), triangle()]));
            builder.add_object("b", material, [sphere(30.0)]);
            builder.max_volume_primitives(max);
            builder.build().unwrap()
        };
        let (whole, split) = (build(None), build(Some(4)));
        assert_eq!((whole.volumes().len(), split.volumes().len()), (2, 8));
        assert_eq!(whole.objects(), split.objects());
        for i in 0..26 {
            let id = PrimitiveId(i);
            let primitive = |scene: &Scene| {
                let PrimitiveLocation { kind, index, volume } = scene.location(id);
                assert_eq!(scene.primitive_id(kind, index), id);
                assert_eq!(scene.volume_object(volume), ObjectId(u32::from(i == 25)));
                let is_inside = scene
                    .volume_runs(volume)
                    .iter()
                    .any(|run| run.kind == kind && run.range.contains(&index));
                assert!(is_inside, "{i}");
                // Tells spheres apart by their centres.
                scene.primitives().normal_at(kind, index, DVec3::splat(100.0))
            };
            assert_eq!(primitive(&whole), primitive(&split), "{i}");
        }
        let size = |volume: u32| -> u32 {
            split.volume_runs(VolumeId(volume)).iter().map(|run| run.range.end - run.range.start).sum()
        };
        assert_eq!((0..8).map(size).collect::<Vec<_>>(), [3, 3, 4, 3, 4, 4, 4, 1]);
    }

    #[test]
    fn runs_have_one_kind_of_sides() {
        let mut builder = SceneBuilder::new();
        let material = builder.add_material(Material::default());
        let front = Part { sides: Sides::Front, ..sphere(1.0) };
        builder.add_object("a", material, [sphere(0.0), front, sphere(2.0)]);
        let scene = builder.build().unwrap();
        let runs = scene.volume_runs(VolumeId(0));
        assert_eq!(runs.iter().map(|run| run.sides).collect::<Vec<_>>(), [Sides::Front, Sides::Both]);
        assert_eq!(scene.primitive_id(PrimitiveKind::Sphere, 0), PrimitiveId(1));
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
