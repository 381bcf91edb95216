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

    /// Tests prepared rays, up to the ends of their spans, against the boxes of a node.
    #[inline(always)]
    pub(crate) fn test<S: Simd>(&mut self, simd: S, node: &Node<W>, rays: &CullRays<W>, ends: &[f32; W]) {
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
