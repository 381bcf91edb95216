//! The crate parry3d, one ray at a time: its mesh of triangles, or its hierarchy of boxes with its balls in them.

use std::time::Instant;

use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use parry3d::query::Ray;
use parry3d::query::details::ray_toi_with_ball;
use parry3d::shape::{CompositeShapeRef, TriMesh};

use crate::parts::{Narrow, Parts};
use crate::single::Library;

/// A scene of triangles alone, or of spheres alone.
pub(crate) struct Parry {
    shapes: Shapes,
    ids: Vec<u32>,
    build_seconds: f64,
}

enum Shapes {
    Mesh(Box<TriMesh>),
    Balls { hierarchy: Bvh, balls: Vec<(Vector, f32)> },
}

impl Parry {
    pub(crate) fn new(parts: &Parts) -> Result<Self, String> {
        let start = Instant::now();
        let (shapes, ids) = match (parts.triangles.is_empty(), parts.spheres.is_empty()) {
            (false, true) => (mesh(parts)?, parts.triangles.iter().map(|triangle| triangle.1).collect()),
            (true, false) => (balls(parts), parts.spheres.iter().map(|sphere| sphere.2).collect()),
            _ => return Err("triangles beside spheres, of which it has no fast set".to_owned()),
        };
        Ok(Self { shapes, ids, build_seconds: start.elapsed().as_secs_f64() })
    }

    /// The nearest hit from where the ray's span starts.
    fn hit(&self, ray: &Narrow) -> Option<(u32, f32)> {
        let [x, y, z] = ray.direction;
        let direction = Vector::new(x, y, z);
        let [x, y, z] = ray.origin;
        let origin = Vector::new(x, y, z) + direction * ray.span[0];
        let length = (ray.span[1] - ray.span[0]).min(f32::MAX);
        let ray = Ray::new(origin, direction);
        match &self.shapes {
            Shapes::Mesh(mesh) => CompositeShapeRef(&**mesh).cast_local_ray(&ray, length, true),
            Shapes::Balls { hierarchy, balls } => hierarchy.cast_ray(&ray, length, |i, end| {
                let (center, radius) = balls[i as usize];
                // Not solid: a ray that starts inside goes on to the surface.
                ray_toi_with_ball(center, radius, &ray, false).1.filter(|&t| t <= end)
            }),
        }
    }
}

fn mesh(parts: &Parts) -> Result<Shapes, String> {
    let corners = parts.triangles.iter().flat_map(|triangle| triangle.0);
    let corners = corners.map(|[x, y, z]| Vector::new(x, y, z)).collect();
    let count = u32::try_from(parts.triangles.len()).map_err(|_| "too many triangles".to_owned())?;
    let faces = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    TriMesh::new(corners, faces).map(|mesh| Shapes::Mesh(Box::new(mesh))).map_err(|error| error.to_string())
}

fn balls(parts: &Parts) -> Shapes {
    let ball = |&([x, y, z], radius, _): &([f32; 3], f32, u32)| (Vector::new(x, y, z), radius);
    let balls: Vec<_> = parts.spheres.iter().map(ball).collect();
    let bounds = balls.iter().map(|&(center, radius)| Aabb::from_half_extents(center, Vector::splat(radius)));
    let hierarchy = Bvh::from_leaves(BvhBuildStrategy::Binned, &bounds.collect::<Vec<_>>());
    Shapes::Balls { hierarchy, balls }
}

impl Library for Parry {
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
