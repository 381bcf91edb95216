//! The first step of rays that are traced one by one, taken together.
//!
//! Every ray of a list tests the same node first. As many rays as there are lanes test one child after the other, which
//! waits for nothing and guesses nothing; then each ray goes on from the children that it enters, and most rays that meet
//! nothing end here.

use rayset_simd::{CullLanes, Lanes, Simd};

use crate::node::{Child, Node, Tree};
use crate::ray::CullRays;
use crate::traverse::{Begin, put_all, put_by_distance};

/// The children of the root that rays enter.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Entrance<const W: usize> {
    /// By child, where the ray of each lane enters it, or nearer; zero at least.
    near: [[f32; W]; W],
    /// By ray, the sum of `2^child` over the children that it enters: exact, since there are at most 16.
    entered: [f32; W],
}

impl<const W: usize> Entrance<W> {
    /// No ray enters anything.
    pub(crate) const NONE: Self = Self { near: [[0.0; W]; W], entered: [0.0; W] };

    /// Prepared rays enter a tree, up to the ends of their spans; whether there is a node that they test. The root may be a
    /// leaf, which rays enter untested.
    #[inline(always)]
    pub(crate) fn begin<S: Simd>(
        &mut self,
        simd: S,
        tree: &Tree<W>,
        rays: &CullRays<W>,
        ends: &[f32; W],
    ) -> bool {
        if tree.root.is_leaf() {
            // It stands in the first slot of the first node.
            (self.near[0], self.entered) = ([0.0; W], [1.0; W]);
            return false;
        }
        self.test(simd, &tree.nodes[0], rays, ends);
        true
    }

    /// Tests prepared rays, up to the ends of their spans, against the boxes of a node.
    #[inline(always)]
    fn test<S: Simd>(&mut self, simd: S, node: &Node<W>, rays: &CullRays<W>, ends: &[f32; W]) {
        let (rays, ends) = (rays.slabs(simd), simd.load_f32(ends));
        let zero = simd.splat_f32(0.0);
        let mut entered = zero;
        let mut bit = 1.0;
        for (child, near) in self.near.iter_mut().enumerate() {
            // The slots in use stand first.
            if node.is_empty(child) {
                break;
            }
            let [mut enter, mut leave] = [rays.start, ends];
            for k in 0..3 {
                let (low, high) = (node.planes[k][child], node.planes[3 + k][child]);
                let (low, high) = (simd.splat_f32(low), simd.splat_f32(high));
                let (first, last) = (high.select(rays.turned[k], low), low.select(rays.turned[k], high));
                enter = enter.max(first.mul_add(rays.inverse[k], rays.near_offset[k]));
                leave = leave.min(last.mul_add(rays.inverse[k], rays.far_offset[k]));
            }
            let sum = entered + simd.splat_f32(bit);
            entered = sum.select(enter.le(leave), entered);
            enter.max(zero).store(near);
            bit *= 2.0;
        }
        entered.store(&mut self.entered);
    }

    /// The children that a ray enters, a bit each.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a sum of small powers of two"
    )]
    pub(crate) fn of(&self, ray: usize) -> u32 {
        self.entered[ray] as u32
    }
}

/// Goes on from the children of the root that a ray enters, of which there is one at least.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entered<'a, const W: usize> {
    pub(crate) entrance: &'a Entrance<W>,
    pub(crate) ray: usize,
}

impl<const W: usize> Begin<W> for Entered<'_, W> {
    #[inline(always)]
    fn nearest(&self, tree: &Tree<W>, stack: &mut [u64], height: &mut usize) -> Child {
        let Self { entrance, ray } = *self;
        put_by_distance(&tree.nodes[0], entrance.of(ray), (&entrance.near, ray), stack, height)
    }

    #[inline(always)]
    fn any<S: Simd>(&self, simd: S, tree: &Tree<W>, stack: &mut [u32], height: &mut usize) -> Child {
        put_all(simd, &tree.nodes[0], self.entrance.of(self.ray), stack, height)
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use rayset_geometry::glam::{DVec3, dvec3};
    use rayset_geometry::{BoundingBox, Ray, unit};
    use rayset_simd::{Backend, Kernel};

    use super::*;
    use crate::columns::RayColumns;
    use crate::frame::Frame;
    use crate::ray::Targets;
    use crate::traverse::children_of;

    /// Whether each of many rays enters the same children together as by itself, and as far away.
    struct Together;

    impl Kernel for Together {
        type Output = (usize, usize);

        fn run<S: Simd>(self, simd: S) -> (usize, usize) {
            if S::F32::LANES == 16 { compare::<S, 16>(simd) } else { compare::<S, 8>(simd) }
        }
    }

    fn compare<S: Simd, const W: usize>(simd: S) -> (usize, usize) {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut point = |size: f64| {
            let mut number = || size * (f64::from(rng.next_u32()) / f64::from(u32::MAX) * 2.0 - 1.0);
            dvec3(number(), number(), number())
        };
        let frame = Frame::of(&BoundingBox { min: DVec3::NEG_ONE, max: DVec3::ONE });
        let (mut entrance, mut prepared) = (Entrance::<W>::NONE, CullRays::<W>::NONE);
        let (mut entered, mut missed) = (0, 0);
        for case in 0..400 {
            let mut node = Node::<W>::EMPTY;
            for slot in 0..(case % W) + 1 {
                let (a, b) = (point(1.0), point(1.0));
                let bounds = BoundingBox { min: a.min(b), max: a.max(b) };
                node.set(slot, &frame.cull_box(&bounds), Child::leaf(slot));
            }
            let rays: Vec<_> = (0..W)
                .map(|i| {
                    let origin = point(1.5);
                    let toward = unit(point(0.5) - origin).unwrap_or(DVec3::X);
                    // Along an axis, both ways, where nothing but zeros is across.
                    let along = [DVec3::X, DVec3::NEG_Y, dvec3(0.0, -0.0, -1.0)][i % 3];
                    let direction = if i % 4 == 0 { along } else { toward };
                    Ray::new(origin, direction)
                })
                .collect();
            let of = |at: &dyn Fn(&Ray) -> f64| rays.iter().map(at).collect::<Vec<_>>();
            let origins = [0, 1, 2].map(|k| of(&|ray| ray.origin()[k]));
            let directions = [0, 1, 2].map(|k| of(&|ray| ray.direction()[k]));
            let starts: Vec<f64> = (0..W).map(|i| [0.0, 0.3][i % 2]).collect();
            let ends: Vec<f64> = (0..W).map(|i| [f64::INFINITY, 1.0, f64::NAN][i % 3]).collect();
            let columns = RayColumns {
                origins: [&origins[0], &origins[1], &origins[2]],
                directions: [&directions[0], &directions[1], &directions[2]],
                spans: (&starts, &ends),
                left: &[],
            };
            prepared.prepare(simd, &frame, &columns, (0, W), Targets::default());
            entrance.test(simd, &node, &prepared, prepared.ends());
            for i in 0..W {
                let Some(cull) = prepared.ray(i) else { continue };
                let (bits, near) = children_of(simd, &node, cull, prepared.ends()[i]);
                assert_eq!(entrance.of(i), bits, "case {case}, ray {i}");
                for (child, near) in near.iter().enumerate().filter(|(child, _)| bits >> child & 1 == 1) {
                    assert_eq!(entrance.near[child][i].to_bits(), near.max(0.0).to_bits());
                }
                entered += bits.count_ones() as usize;
                missed += usize::from(bits == 0);
            }
        }
        (entered, missed)
    }

    #[test]
    fn rays_enter_together_what_each_enters_alone() {
        for &backend in Backend::available() {
            let (entered, missed) = backend.run(Together);
            assert!(entered > 1000 && missed > 500, "{backend}: {entered}, {missed}");
        }
    }
}
