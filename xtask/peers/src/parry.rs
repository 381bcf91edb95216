//! The crate parry3d: a mesh of triangles, one ray at a time.

use std::time::Instant;

use parry3d::math::Vector;
use parry3d::query::Ray;
use parry3d::shape::{CompositeShapeRef, TriMesh};

use crate::parts::{Narrow, Parts};
use crate::single::Library;

/// A mesh.
pub(crate) struct Mesh {
    mesh: TriMesh,
    ids: Vec<u32>,
    build_seconds: f64,
}

impl Mesh {
    /// Builds it of the triangles alone.
    pub(crate) fn new(parts: &Parts) -> Result<Self, String> {
        let start = Instant::now();
        let corners = parts.triangles.iter().flat_map(|triangle| triangle.0);
        let corners = corners.map(|[x, y, z]| Vector::new(x, y, z)).collect();
        let count = u32::try_from(parts.triangles.len()).map_err(|_| "too many triangles".to_owned())?;
        let faces = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = TriMesh::new(corners, faces).map_err(|error| error.to_string())?;
        let ids = parts.triangles.iter().map(|triangle| triangle.1).collect();
        Ok(Self { mesh, ids, build_seconds: start.elapsed().as_secs_f64() })
    }

    /// The nearest hit from where the ray's span starts.
    fn hit(&self, ray: &Narrow) -> Option<(u32, f32)> {
        let [x, y, z] = ray.direction;
        let direction = Vector::new(x, y, z);
        let [x, y, z] = ray.origin;
        let origin = Vector::new(x, y, z) + direction * ray.span[0];
        let length = (ray.span[1] - ray.span[0]).min(f32::MAX);
        CompositeShapeRef(&self.mesh).cast_local_ray(&Ray::new(origin, direction), length, true)
    }
}

impl Library for Mesh {
    fn name(&self) -> &'static str {
        "parry3d"
    }

    fn family(&self) -> &'static str {
        "parry3d"
    }

    fn build_seconds(&self) -> f64 {
        self.build_seconds
    }

    fn nearest(&self, ray: &Narrow) -> Option<(f32, u32)> {
        self.hit(ray).map(|(i, t)| (t + ray.span[0], self.ids[i as usize]))
    }

    fn occluded(&self, ray: &Narrow) -> bool {
        self.hit(ray).is_some()
    }
}
