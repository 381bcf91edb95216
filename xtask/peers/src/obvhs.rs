//! The crate obvhs: its compressed wide tree and its binary tree, one ray at a time.

use std::time::{Duration, Instant};

use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, builder::build_bvh2};
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh};
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;
use obvhs::{Boundable, BvhBuildParams};

use crate::parts::{Narrow, Parts};
use crate::single::Library;

/// A primitive.
#[derive(Clone, Copy)]
pub(crate) enum Shape {
    Triangle(Triangle),
    Sphere(Vec3A, f32),
}

impl Boundable for Shape {
    fn aabb(&self) -> Aabb {
        match self {
            Self::Triangle(triangle) => triangle.aabb(),
            Self::Sphere(center, radius) => {
                let radius = Vec3A::splat(*radius);
                Aabb::new(*center - radius, *center + radius)
            }
        }
    }
}

impl Shape {
    /// The distance of the first hit within the span; infinite for none.
    #[inline(always)]
    pub(crate) fn intersect(&self, ray: &Ray) -> f32 {
        match self {
            Self::Triangle(triangle) => triangle.intersect(ray),
            Self::Sphere(center, radius) => {
                let to = *center - ray.origin;
                let middle = to.dot(ray.direction);
                let aside = to - middle * ray.direction;
                let square = radius * radius - aside.dot(aside);
                if square < 0.0 {
                    return f32::INFINITY;
                }
                let half = square.sqrt();
                let is_within = |t: f32| t >= ray.tmin && t <= ray.tmax;
                let times = [middle - half, middle + half];
                times.into_iter().find(|t| is_within(*t)).unwrap_or(f32::INFINITY)
            }
        }
    }
}

/// Primitives in the order of the leaves, with their ids.
struct Shapes(Vec<(Shape, u32)>);

/// The shapes of a scene, and their ids.
pub(crate) fn shapes(parts: &Parts) -> (Vec<Shape>, Vec<u32>) {
    let triangle = |corners: &[[f32; 3]; 3]| {
        let [v0, v1, v2] = corners.map(Vec3A::from_array);
        Shape::Triangle(Triangle { v0, v1, v2 })
    };
    let triangles = parts.triangles.iter().map(|(corners, id)| (triangle(corners), *id));
    let sphere = |center: [f32; 3], radius| Shape::Sphere(Vec3A::from_array(center), radius);
    let spheres = parts.spheres.iter().map(|(center, radius, id)| (sphere(*center, *radius), *id));
    triangles.chain(spheres).unzip()
}

impl Shapes {
    fn new(shapes: &[Shape], ids: &[u32], order: &[u32]) -> Self {
        Self(order.iter().map(|&i| (shapes[i as usize], ids[i as usize])).collect())
    }
}

pub(crate) fn ray(ray: &Narrow) -> Ray {
    let vector = Vec3A::from_array;
    Ray::new(vector(ray.origin), vector(ray.direction), ray.span[0], ray.span[1])
}

macro_rules! library {
    ($(#[$doc:meta])* $kind:ident, $tree:ty, $build:ident, $name:literal) => {
        $(#[$doc])*
        pub(crate) struct $kind {
            tree: $tree,
            shapes: Shapes,
            build_seconds: f64,
        }

        impl $kind {
            /// Builds the tree with the settings that are between fast and slow.
            pub(crate) fn new(parts: &Parts) -> Self {
                let (shapes, ids) = shapes(parts);
                let start = Instant::now();
                let tree = $build(&shapes, BvhBuildParams::medium_build(), &mut Duration::default());
                let shapes = Shapes::new(&shapes, &ids, &tree.primitive_indices);
                Self { tree, shapes, build_seconds: start.elapsed().as_secs_f64() }
            }
        }

        impl Library for $kind {
            fn name(&self) -> &'static str {
                $name
            }

            fn family(&self) -> &'static str {
                "obvhs"
            }

            fn build_seconds(&self) -> f64 {
                self.build_seconds
            }

            fn nearest(&self, narrow: &Narrow) -> Option<(f32, u32)> {
                let mut hit = RayHit::none();
                let shapes = &self.shapes.0;
                let is_hit = self.tree.ray_traverse(ray(narrow), &mut hit, |ray, i| shapes[i].0.intersect(ray));
                is_hit.then(|| (hit.t, shapes[hit.primitive_id as usize].1))
            }

            fn occluded(&self, narrow: &Narrow) -> bool {
                let shapes = &self.shapes.0;
                !self.tree.ray_traverse_miss(ray(narrow), |ray, i| shapes[i].0.intersect(ray))
            }
        }
    };
}

library!(
    /// The compressed wide tree.
    Wide, CwBvh, build_cwbvh, "obvhs cwbvh"
);
library!(
    /// The binary tree.
    Binary, Bvh2, build_bvh2, "obvhs bvh2"
);
