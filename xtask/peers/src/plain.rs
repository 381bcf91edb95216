//! The crate bvh: its binary tree, one ray at a time.
//!
//! Its iterators know no nearest hit so far; a query that does makes the trees before it prune by distance.

use std::cell::Cell;
use std::time::Instant;

use bvh::aabb::{Aabb, Bounded, IntersectsAabb};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::Bvh;
use nalgebra::Point3;
use obvhs::Boundable;
use obvhs::ray::Ray;

use crate::obvhs::{Shape, ray, shapes};
use crate::parts::{Narrow, Parts};
use crate::single::Library;

/// A primitive, its id, and its node.
struct Item {
    shape: Shape,
    id: u32,
    node: usize,
}

impl Bounded<f32, 3> for Item {
    fn aabb(&self) -> Aabb<f32, 3> {
        let bounds = self.shape.aabb();
        let point = |v: glam::Vec3A| Point3::new(v.x, v.y, v.z);
        Aabb::with_bounds(point(bounds.min), point(bounds.max))
    }
}

impl BHShape<f32, 3> for Item {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

/// A ray that ends at the nearest hit so far.
struct Shrinking {
    ray: Ray,
    end: Cell<f32>,
}

impl IntersectsAabb<f32, 3> for Shrinking {
    #[inline(always)]
    fn intersects_aabb(&self, bounds: &Aabb<f32, 3>) -> bool {
        let (mut near, mut far) = (self.ray.tmin, self.end.get());
        for k in 0..3 {
            let low = (bounds.min[k] - self.ray.origin[k]) * self.ray.inv_direction[k];
            let high = (bounds.max[k] - self.ray.origin[k]) * self.ray.inv_direction[k];
            near = near.max(low.min(high));
            far = far.min(low.max(high));
        }
        near <= far
    }
}

/// The tree.
pub(crate) struct Plain {
    tree: Bvh<f32, 3>,
    items: Vec<Item>,
    build_seconds: f64,
}

impl Plain {
    pub(crate) fn new(parts: &Parts) -> Self {
        let (shapes, ids) = shapes(parts);
        let start = Instant::now();
        let items = shapes.into_iter().zip(ids).map(|(shape, id)| Item { shape, id, node: 0 });
        let mut items: Vec<_> = items.collect();
        let tree = Bvh::build(&mut items);
        Self { tree, items, build_seconds: start.elapsed().as_secs_f64() }
    }
}

impl Library for Plain {
    fn name(&self) -> &'static str {
        "bvh"
    }

    fn family(&self) -> &'static str {
        "bvh"
    }

    fn build_seconds(&self) -> f64 {
        self.build_seconds
    }

    fn nearest(&self, narrow: &Narrow) -> Option<(f32, u32)> {
        let query = Shrinking { ray: ray(narrow), end: Cell::new(narrow.span[1]) };
        let mut nearest = None;
        for item in self.tree.traverse_iterator(&query, &self.items) {
            let t = item.shape.intersect(&query.ray);
            if t < query.end.get() {
                query.end.set(t);
                nearest = Some((t, item.id));
            }
        }
        nearest
    }

    fn occluded(&self, narrow: &Narrow) -> bool {
        let query = Shrinking { ray: ray(narrow), end: Cell::new(narrow.span[1]) };
        self.tree
            .traverse_iterator(&query, &self.items)
            .any(|item| item.shape.intersect(&query.ray).is_finite())
    }
}
