//! One ray through a tree.

use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::node::{Child, Node, Tree};
use crate::ray::CullRay;

/// What a traversal asks of the leaves.
pub(crate) trait Visitor {
    /// Tests a leaf; the new end of the span in culling space, or `None` to stop.
    fn leaf(&mut self, leaf: usize) -> Option<f32>;
}

/// What a traversal did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Steps {
    /// Nodes whose boxes were tested.
    pub nodes: u64,
    /// Leaves whose primitives were tested.
    pub leaves: u64,
}

/// What is still to visit: children, and where the ray enters them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stack {
    pub(crate) entries: Vec<(Child, f32)>,
}

impl Stack {
    /// A stack that no traversal of the tree can overflow.
    pub(crate) fn of<const W: usize>(tree: &Tree<W>) -> Self {
        Self { entries: vec![(Child(0), 0.0); tree.depth * (W - 1) + W] }
    }
}

/// Visits the leaves whose boxes the ray may meet, the nearest first as far as boxes tell.
#[inline(always)]
pub(crate) fn traverse<S: Simd, const W: usize>(
    simd: S,
    tree: &Tree<W>,
    stack: &mut Stack,
    ray: &CullRay,
    end: f32,
    steps: &mut Steps,
    visitor: &mut impl Visitor,
) {
    assert!(S::F32::LANES == W, "a node is as wide as the lanes");
    let [ix, iy, iz] = splat(simd, ray.inverse);
    let [nx, ny, nz] = splat(simd, ray.near_offset);
    let [fx, fy, fz] = splat(simd, ray.far_offset);
    let start = simd.splat_f32(ray.start);
    let mut end = end;
    let mut ends = simd.splat_f32(end);
    let stack = stack.entries.as_mut_slice();
    let mut height = 0;
    let mut current = Child::node(0);
    loop {
        if current.is_leaf() {
            steps.leaves += 1;
            match visitor.leaf(current.index()) {
                None => return,
                Some(new) => {
                    end = new;
                    ends = simd.splat_f32(end);
                }
            }
        } else {
            steps.nodes += 1;
            let node = &tree.nodes[current.index()];
            let [near_x, near_y, near_z] = load(simd, node, ray.near);
            let [far_x, far_y, far_z] = load(simd, node, ray.far);
            let (near_x, far_x) = (near_x.mul_add(ix, nx), far_x.mul_add(ix, fx));
            let (near_y, far_y) = (near_y.mul_add(iy, ny), far_y.mul_add(iy, fy));
            let (near_z, far_z) = (near_z.mul_add(iz, nz), far_z.mul_add(iz, fz));
            let near = near_x.max(near_y).max(near_z.max(start));
            let far = far_x.min(far_y).min(far_z.min(ends));
            let met = near.le(far);
            let mut bits = met.bits();
            if bits != 0 {
                let first = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                if bits == 0 {
                    current = Child(node.children[first]);
                    continue;
                }
                let mut entries = [0.0; W];
                near.store(&mut entries);
                let mut nearest = (Child(node.children[first]), entries[first]);
                let base = height;
                while bits != 0 {
                    let lane = bits.trailing_zeros() as usize;
                    bits &= bits - 1;
                    let mut other = (Child(node.children[lane]), entries[lane]);
                    if other.1 < nearest.1 {
                        std::mem::swap(&mut nearest, &mut other);
                    }
                    // Insertion into what this node has pushed, the nearest last.
                    let mut place = height;
                    while place > base && stack[place - 1].1 < other.1 {
                        stack[place] = stack[place - 1];
                        place -= 1;
                    }
                    stack[place] = other;
                    height += 1;
                }
                current = nearest.0;
                continue;
            }
        }
        // The next that the ray enters before the end.
        loop {
            if height == 0 {
                return;
            }
            height -= 1;
            if stack[height].1 <= end {
                current = stack[height].0;
                break;
            }
        }
    }
}

/// Three planes of all boxes of a node.
#[inline(always)]
fn load<S: Simd, const W: usize>(simd: S, node: &Node<W>, [x, y, z]: [usize; 3]) -> [S::F32; 3] {
    [simd.load_f32(&node.planes[x]), simd.load_f32(&node.planes[y]), simd.load_f32(&node.planes[z])]
}

#[inline(always)]
fn splat<S: Simd>(simd: S, [x, y, z]: [f32; 3]) -> [S::F32; 3] {
    [simd.splat_f32(x), simd.splat_f32(y), simd.splat_f32(z)]
}
