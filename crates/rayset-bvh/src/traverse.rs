//! One ray through a tree.

use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::descent::Pending;
use crate::interval::splat;
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

/// Lanes in memory.
///
/// Aligned, and so is then what the compiler keeps beside it: without anything that asks for it, the registers that a loop
/// has no room for lie across the lines of the cache.
#[repr(align(64))]
pub(crate) struct Aligned<T>(pub(crate) T);

/// What is still to visit: children, and where the ray enters them.
///
/// An entry is a child in the lower half of a word, and in the upper the bits of a distance that is not negative: such
/// bits are ordered as the numbers are, so that comparing entries compares distances.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stack {
    entries: Vec<u64>,
    /// The children alone, for who asks for no distances.
    children: Vec<u32>,
    /// The same of a packet, with distances along its axis.
    pub(crate) together: Vec<Pending>,
}

impl Stack {
    /// A stack that no traversal of the tree can overflow.
    pub(crate) fn of<const W: usize>(tree: &Tree<W>) -> Self {
        let len = tree.depth * (W - 1) + W;
        Self { entries: vec![0; len], children: vec![0; len + W], together: vec![Pending::default(); len] }
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
    // Known here, so that no load has to ask.
    let (near_planes, far_planes) = (ray.near, ray.far);
    assert!(near_planes[0].max(near_planes[1]).max(near_planes[2]) < 6, "a node has six planes");
    assert!(far_planes[0].max(far_planes[1]).max(far_planes[2]) < 6, "a node has six planes");
    let [ix, iy, iz] = splat(simd, ray.inverse);
    let [nx, ny, nz] = splat(simd, ray.near_offset);
    let [fx, fy, fz] = splat(simd, ray.far_offset);
    let start = simd.splat_f32(ray.start);
    let mut ends = simd.splat_f32(end);
    let mut end_bits = end.max(0.0).to_bits();
    let stack = stack.entries.as_mut_slice();
    let mut height = 0;
    let mut current = tree.root;
    let (mut nodes, mut leaves) = (0, 0);
    'visit: loop {
        if current.is_leaf() {
            leaves += 1;
            match visitor.leaf(current.index()) {
                None => break 'visit,
                Some(end) => {
                    ends = simd.splat_f32(end);
                    end_bits = end.max(0.0).to_bits();
                }
            }
        } else {
            nodes += 1;
            let node = &tree.nodes[current.index()];
            let [near_x, near_y, near_z] = load(simd, node, near_planes);
            let [far_x, far_y, far_z] = load(simd, node, far_planes);
            let (near_x, far_x) = (near_x.mul_add(ix, nx), far_x.mul_add(ix, fx));
            let (near_y, far_y) = (near_y.mul_add(iy, ny), far_y.mul_add(iy, fy));
            let (near_z, far_z) = (near_z.mul_add(iz, nz), far_z.mul_add(iz, fz));
            let near = near_x.max(near_y).max(near_z.max(start));
            let far = far_x.min(far_y).min(far_z.min(ends));
            let met = near.le(far);
            let mut bits = met.bits();
            if bits != 0 {
                let first = bits.trailing_zeros() as usize % W;
                bits &= bits - 1;
                if bits == 0 {
                    current = Child(node.children[first]);
                    continue;
                }
                // Clamped, and so is what it is compared with: a distance below zero sorts as zero.
                let near = near.max(simd.splat_f32(0.0));
                let mut entries = Aligned([0.0; W]);
                near.store(&mut entries.0);
                let entries = &entries.0;
                let second = bits.trailing_zeros() as usize % W;
                bits &= bits - 1;
                let (a, b) = (entry(node, entries, first), entry(node, entries, second));
                let (mut a, mut b) = (a.min(b), a.max(b));
                // A third that is not there lies behind all others; what is pushed after it takes its place.
                let third = bits.trailing_zeros() as usize % W;
                let has_third = bits != 0;
                bits &= bits.wrapping_sub(1);
                let mut c = if has_third { entry(node, entries, third) } else { u64::MAX };
                (b, c) = (b.min(c), b.max(c));
                (a, b) = (a.min(b), a.max(b));
                let base = height;
                stack[height] = c;
                height += usize::from(has_third);
                stack[height] = b;
                height += 1;
                while bits != 0 {
                    let lane = bits.trailing_zeros() as usize % W;
                    bits &= bits - 1;
                    let other = entry(node, entries, lane);
                    let (nearer, other) = (a.min(other), a.max(other));
                    a = nearer;
                    // Insertion into what this node has pushed, the nearest last.
                    let mut place = height;
                    while place > base && stack[place - 1] < other {
                        stack[place] = stack[place - 1];
                        place -= 1;
                    }
                    stack[place] = other;
                    height += 1;
                }
                current = child_of(a);
                continue;
            }
        }
        // The next that the ray enters before the end.
        loop {
            if height == 0 {
                break 'visit;
            }
            height -= 1;
            let entry = stack[height];
            if (entry >> 32) as u32 <= end_bits {
                current = child_of(entry);
                break;
            }
        }
    }
    steps.nodes += nodes;
    steps.leaves += leaves;
}

/// Visits leaves whose boxes the ray may meet, in any order, until one says that the ray is stopped; whether one did.
///
/// What is met is put on the stack all at once: without an order there is no number of children to guess.
#[inline(always)]
pub(crate) fn is_stopped<S: Simd, const W: usize>(
    simd: S,
    tree: &Tree<W>,
    stack: &mut Stack,
    ray: &CullRay,
    end: f32,
    steps: &mut Steps,
    visitor: &mut impl Visitor,
) -> bool {
    assert!(S::F32::LANES == W, "a node is as wide as the lanes");
    let (near_planes, far_planes) = (ray.near, ray.far);
    assert!(near_planes[0].max(near_planes[1]).max(near_planes[2]) < 6, "a node has six planes");
    assert!(far_planes[0].max(far_planes[1]).max(far_planes[2]) < 6, "a node has six planes");
    let [ix, iy, iz] = splat(simd, ray.inverse);
    let [nx, ny, nz] = splat(simd, ray.near_offset);
    let [fx, fy, fz] = splat(simd, ray.far_offset);
    let (start, end) = (simd.splat_f32(ray.start), simd.splat_f32(end));
    let stack = stack.children.as_mut_slice();
    let mut height = 0;
    let mut current = tree.root;
    let (mut nodes, mut leaves) = (0, 0);
    let is_stopped = loop {
        if current.is_leaf() {
            leaves += 1;
            if visitor.leaf(current.index()).is_none() {
                break true;
            }
        } else {
            nodes += 1;
            let node = &tree.nodes[current.index()];
            let [near_x, near_y, near_z] = load(simd, node, near_planes);
            let [far_x, far_y, far_z] = load(simd, node, far_planes);
            let (near_x, far_x) = (near_x.mul_add(ix, nx), far_x.mul_add(ix, fx));
            let (near_y, far_y) = (near_y.mul_add(iy, ny), far_y.mul_add(iy, fy));
            let (near_z, far_z) = (near_z.mul_add(iz, nz), far_z.mul_add(iz, fz));
            let met = near_x.max(near_y).max(near_z.max(start)).le(far_x.min(far_y).min(far_z.min(end)));
            let bits = met.bits();
            if bits != 0 {
                let others = bits & (bits - 1);
                current = Child(node.children[bits.trailing_zeros() as usize % W]);
                simd.compress_u32(simd.mask_f32(others), &node.children, &mut stack[height..height + W]);
                height += others.count_ones() as usize;
                continue;
            }
        }
        if height == 0 {
            break false;
        }
        height -= 1;
        current = Child(stack[height]);
    };
    steps.nodes += nodes;
    steps.leaves += leaves;
    is_stopped
}

#[inline(always)]
fn entry<const W: usize>(node: &Node<W>, entries: &[f32; W], lane: usize) -> u64 {
    u64::from(entries[lane].to_bits()) << 32 | u64::from(node.children[lane])
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the lower half")]
fn child_of(entry: u64) -> Child {
    Child(entry as u32)
}

/// Three planes of all boxes of a node.
#[inline(always)]
fn load<S: Simd, const W: usize>(simd: S, node: &Node<W>, [x, y, z]: [usize; 3]) -> [S::F32; 3] {
    [simd.load_f32(&node.planes[x]), simd.load_f32(&node.planes[y]), simd.load_f32(&node.planes[z])]
}
