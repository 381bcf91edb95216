//! The finished scene.

use std::ops::Range;

use rayset_geometry::glam::DVec3;
use rayset_geometry::{
    BoundingBox, BoundingSphere, ColumnRun, Outward, PrimitiveColumns, PrimitiveKind, VolumeColumns, unit,
};

use crate::patch::PatchNormals;
use crate::{
    Camera, Color, Light, LightId, Material, MaterialId, ObjectId, PrimitiveId, SceneError, Spawns, VolumeId,
};

/// Primitives with one material, under bounding volumes.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// The name it was added under; need not be unique.
    pub name: String,
    /// How all its primitives are shaded.
    pub material: MaterialId,
    /// A sphere that holds the whole object.
    pub bounds: BoundingSphere,
    /// The ids of its primitives, as numbers.
    pub primitives: Range<u32>,
}

/// Where a primitive is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PrimitiveLocation {
    /// Its kind.
    pub kind: PrimitiveKind,
    /// Its index in the columns of that kind.
    pub index: u32,
    /// The bounding volume that holds it.
    pub volume: VolumeId,
}

/// The normals at a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The unit normal of the front of the primitive: it decides sides.
    pub normal: DVec3,
    /// The unit normal to shade with: interpolated between vertices where they have normals, else the same.
    pub shading_normal: DVec3,
}

/// What is asked of a primitive at every hit, packed together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrimitiveSurface {
    /// The unit normal of the front of what is flat, the centre of a sphere, nothing of a cone.
    pub vector: DVec3,
    /// The first of the scene's materials that is the same as its object's, bit by bit.
    pub material: MaterialId,
    /// How its normals are found.
    pub form: SurfaceForm,
}

/// How the normals of a primitive are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SurfaceForm {
    /// Flat: everywhere the same.
    Flat,
    /// Flat, and shaded with the normals between those of the vertices.
    Smooth,
    /// A sphere: away from its centre.
    Sphere,
    /// A cone or cylinder.
    Cone,
}

/// An immutable scene: objects under bounding volumes, materials, lights and a camera.
#[derive(Debug)]
pub struct Scene {
    pub(crate) camera: Camera,
    pub(crate) background: Color,
    pub(crate) ambient: Color,
    pub(crate) lights: Vec<Light>,
    pub(crate) materials: Vec<Material>,
    /// What each material does with rays, packed: it is asked for at every hit.
    pub(crate) spawns: Vec<Spawns>,
    pub(crate) objects: Vec<Object>,
    pub(crate) primitives: PrimitiveColumns,
    pub(crate) locations: Vec<PrimitiveLocation>,
    pub(crate) ids: [Vec<PrimitiveId>; 4],
    pub(crate) volumes: VolumeColumns,
    pub(crate) volume_objects: Vec<ObjectId>,
    pub(crate) volume_runs: Vec<Range<u32>>,
    pub(crate) runs: Vec<ColumnRun>,
    /// By primitive.
    pub(crate) surfaces: Vec<PrimitiveSurface>,
    pub(crate) vertex_normals: Vec<[DVec3; 3]>,
    /// By triangle index; `u32::MAX` for none. Empty if no triangle has normals.
    pub(crate) vertex_normal_index: Vec<u32>,
    pub(crate) patches: PatchNormals,
    pub(crate) extent: f64,
    pub(crate) bounds: BoundingBox,
}

impl Scene {
    /// The camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The same scene seen by another camera.
    ///
    /// # Errors
    ///
    /// [`SceneError::Invalid`] if the viewpoint lies beyond [`MAX_COORDINATE`](crate::MAX_COORDINATE).
    pub fn with_camera(mut self, camera: Camera) -> Result<Self, SceneError> {
        camera.check()?;
        self.camera = camera;
        Ok(self)
    }

    /// The smallest box that holds all primitives, in world space; empty if there are none.
    #[must_use]
    pub fn bounds(&self) -> BoundingBox {
        self.bounds
    }

    /// What a ray that hits nothing sees.
    #[must_use]
    #[inline]
    pub fn background(&self) -> Color {
        self.background
    }

    /// The intensity of ambient light.
    #[must_use]
    #[inline]
    pub fn ambient(&self) -> Color {
        self.ambient
    }

    /// The lights, by [`LightId`].
    #[must_use]
    #[inline]
    pub fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// One light.
    ///
    /// # Panics
    ///
    /// If there is no such light.
    #[must_use]
    pub fn light(&self, id: LightId) -> &Light {
        &self.lights[id.index()]
    }

    /// The objects, by [`ObjectId`].
    #[must_use]
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// The materials, by [`MaterialId`].
    #[must_use]
    #[inline]
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// The material of an object.
    ///
    /// # Panics
    ///
    /// If there is no such object.
    #[must_use]
    #[inline]
    pub fn material_of(&self, object: ObjectId) -> &Material {
        &self.materials[self.material_id_of(object).index()]
    }

    /// The id of the material of an object.
    ///
    /// # Panics
    ///
    /// If there is no such object.
    #[must_use]
    #[inline]
    pub fn material_id_of(&self, object: ObjectId) -> MaterialId {
        self.objects[object.index()].material
    }

    /// What a material does with rays: [`Material::spawns`].
    ///
    /// # Panics
    ///
    /// If there is no such material.
    #[must_use]
    #[inline]
    pub fn spawns_of(&self, material: MaterialId) -> Spawns {
        self.spawns[material.index()]
    }

    /// All primitives, as columns for testing.
    #[must_use]
    pub fn primitives(&self) -> &PrimitiveColumns {
        &self.primitives
    }

    /// How many primitives there are.
    #[must_use]
    pub fn n_primitives(&self) -> usize {
        self.locations.len()
    }

    /// Where a primitive is stored.
    ///
    /// # Panics
    ///
    /// If there is no such primitive.
    #[must_use]
    #[inline]
    pub fn location(&self, id: PrimitiveId) -> PrimitiveLocation {
        self.locations[id.index()]
    }

    /// The id of a stored primitive.
    ///
    /// # Panics
    ///
    /// If there is no such primitive.
    #[must_use]
    #[inline]
    pub fn primitive_id(&self, kind: PrimitiveKind, index: u32) -> PrimitiveId {
        self.ids[kind as usize][index as usize]
    }

    /// The bounding volumes, by [`VolumeId`], as columns for a partition.
    #[must_use]
    pub fn volumes(&self) -> &VolumeColumns {
        &self.volumes
    }

    /// The object that a volume bounds, or bounds a piece of.
    ///
    /// # Panics
    ///
    /// If there is no such volume.
    #[must_use]
    #[inline]
    pub fn volume_object(&self, volume: VolumeId) -> ObjectId {
        self.volume_objects[volume.index()]
    }

    /// The primitives inside a volume.
    ///
    /// # Panics
    ///
    /// If there is no such volume.
    #[must_use]
    #[inline]
    pub fn volume_runs(&self, volume: VolumeId) -> &[ColumnRun] {
        let runs = &self.volume_runs[volume.index()];
        &self.runs[runs.start as usize..runs.end as usize]
    }

    /// The largest absolute coordinate of anything a ray can hit, in world units.
    #[must_use]
    #[inline]
    pub fn extent(&self) -> f64 {
        self.extent
    }

    /// What is asked of a primitive at every hit.
    ///
    /// # Panics
    ///
    /// If there is no such primitive.
    #[must_use]
    #[inline(always)]
    pub fn surface_of(&self, primitive: PrimitiveId) -> &PrimitiveSurface {
        &self.surfaces[primitive.index()]
    }

    /// The normals of a primitive at a point of it, in world space.
    ///
    /// # Panics
    ///
    /// If there is no such primitive.
    #[must_use]
    pub fn surface_at(&self, primitive: PrimitiveId, point: DVec3) -> SurfacePoint {
        let PrimitiveLocation { kind, index, .. } = self.location(primitive);
        let &PrimitiveSurface { vector, form, .. } = self.surface_of(primitive);
        let normal = match form {
            SurfaceForm::Flat | SurfaceForm::Smooth => vector,
            SurfaceForm::Sphere | SurfaceForm::Cone => self.primitives.normal_at(kind, index, point),
        };
        let interpolated = match (form, kind) {
            (SurfaceForm::Smooth, PrimitiveKind::Triangle) => self.triangle_normal_at(index, point),
            (SurfaceForm::Smooth, _) => self.patches.at(index, normal, point),
            _ => None,
        };
        let shading_normal = interpolated.and_then(unit).unwrap_or(normal);
        SurfacePoint { normal, shading_normal }
    }

    /// The normal of a curved primitive at a point of it, not yet scaled; `None` of what is flat, however it is shaded: see
    /// [`PrimitiveColumns::outward_at`].
    ///
    /// # Panics
    ///
    /// If there is no such primitive.
    #[must_use]
    #[inline(always)]
    pub fn outward_at(&self, primitive: PrimitiveId, point: DVec3) -> Option<Outward> {
        let PrimitiveLocation { kind, index, .. } = self.location(primitive);
        self.primitives.outward_at(kind, index, point)
    }

    /// The normal of any length between those of a triangle's vertices, if they have any.
    fn triangle_normal_at(&self, index: u32, point: DVec3) -> Option<DVec3> {
        let i = *self.vertex_normal_index.get(index as usize)?;
        let [a, b, c] = self.vertex_normals.get(i as usize)?;
        let [u, v, w] = self.primitives.triangle(index).barycentric(point);
        Some(u * *a + v * *b + w * *c)
    }
}
