//! One ray through a tree.

use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::descent::Pending;
use crate::faces::Face;
use crate::interval::splat;
use crate::node::{Child, Node, Tree};
use crate::ray::CullRay;

/// What a traversal asks of the leaves.
pub(crate) trait Visitor {
    /// Whether rays may leave faces behind.
    const FACES: bool;
    /// Whether what lies farthest along a ray comes first where any hit will do.
    const FARTHEST_FIRST: bool;
    /// Whether children are visited in the order in which they lie along the way that the ray runs where the nearest hit is
    /// asked for, and not in that in which the ray enters them.
    const BY_WAY: bool;

    /// Tests a leaf; the new end of the span in culling space, or `None` to stop.
    fn leaf(&mut self, leaf: usize) -> Option<f32>;
}

/// Where a traversal begins: with a child, and what it puts on the stack to visit later.
pub(crate) trait Begin<const W: usize> {
    /// For the nearest hit: the nearest child, and the others with their distances.
    fn nearest(&self, tree: &Tree<W>, stack: &mut [u64], height: &mut usize) -> Child;
    /// For any hit, by a ray that runs backwards along some axes: a child, if there is any, and the others.
    fn any<S: Simd>(
        &self,
        simd: S,
        tree: &Tree<W>,
        turned: u32,
        stack: &mut [u32],
        height: &mut usize,
    ) -> Option<Child>;
}

/// Begins at the root.
pub(crate) struct AtRoot;

impl<const W: usize> Begin<W> for AtRoot {
    #[inline(always)]
    fn nearest(&self, tree: &Tree<W>, _: &mut [u64], _: &mut usize) -> Child {
        tree.root
    }

    #[inline(always)]
    fn any<S: Simd>(&self, _: S, tree: &Tree<W>, _: u32, _: &mut [u32], _: &mut usize) -> Option<Child> {
        Some(tree.root)
    }
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
    pub(crate) children: Vec<u32>,
    /// The same of a packet, with distances along its axis.
    pub(crate) together: Vec<Pending>,
}

impl Stack {
    /// A stack that no traversal of the tree can overflow.
    pub(crate) fn of<const W: usize>(tree: &Tree<W>) -> Self {
        let len = tree.depth * (W - 1) + W;
        // Where any hit will do, a ray may begin with what it enters of all children of the root, and whole registers are
        // written.
        let children = vec![0; len + W * W];
        Self { entries: vec![0; len], children, together: vec![Pending::default(); len] }
    }
}

/// What of a ray the boxes of a node are tested with, in every lane.
#[derive(Clone, Copy)]
pub(crate) struct BoxRay<S: Simd> {
    near_planes: [usize; 3],
    far_planes: [usize; 3],
    inverse: [S::F32; 3],
    near_offset: [S::F32; 3],
    far_offset: [S::F32; 3],
    start: S::F32,
    face: Option<Face<S>>,
}

impl<S: Simd> BoxRay<S> {
    #[inline(always)]
    pub(crate) fn new<const W: usize>(simd: S, ray: CullRay<'_, W>, faces: bool) -> Self {
        let ([near_planes, far_planes], [near_offset, far_offset]) = (ray.planes(), ray.offsets());
        // Known here, so that no load has to ask.
        assert!(near_planes[0].max(near_planes[1]).max(near_planes[2]) < 6, "a node has six planes");
        assert!(far_planes[0].max(far_planes[1]).max(far_planes[2]) < 6, "a node has six planes");
        let mut face = None;
        if faces && let Some((axis, sense, place)) = ray.face() {
            face = Some(Face::new(simd, far_planes[axis], [sense, place]));
        }
        Self {
            near_planes,
            far_planes,
            inverse: splat(simd, ray.inverse()),
            near_offset: splat(simd, near_offset),
            far_offset: splat(simd, far_offset),
            start: simd.splat_f32(ray.start()),
            face,
        }
    }

    /// The boxes of a node that the ray enters, a bit each, and where.
    #[inline(always)]
    pub(crate) fn test<const W: usize>(&self, simd: S, node: &Node<W>, ends: S::F32) -> (u32, S::F32) {
        let sides = [load(simd, node, self.near_planes), load(simd, node, self.far_planes)];
        self.test_sides(simd, node, sides, ends)
    }

    /// The same, given the planes of all boxes that are near, and far, for rays that run its way.
    #[inline(always)]
    pub(crate) fn test_sides<const W: usize>(
        &self,
        simd: S,
        node: &Node<W>,
        [[near_x, near_y, near_z], [far_x, far_y, far_z]]: [[S::F32; 3]; 2],
        ends: S::F32,
    ) -> (u32, S::F32) {
        let ([ix, iy, iz], [nx, ny, nz], [fx, fy, fz]) = (self.inverse, self.near_offset, self.far_offset);
        let (near_x, far_x) = (near_x.mul_add(ix, nx), far_x.mul_add(ix, fx));
        let (near_y, far_y) = (near_y.mul_add(iy, ny), far_y.mul_add(iy, fy));
        let (near_z, far_z) = (near_z.mul_add(iz, nz), far_z.mul_add(iz, fz));
        let near = near_x.max(near_y).max(near_z.max(self.start));
        let far = far_x.min(far_y).min(far_z.min(ends));
        let mut entered = near.le(far);
        if let Some(face) = self.face {
            entered = entered & face.ahead(simd, &node.planes);
        }
        (entered.bits(), near)
    }
}

/// The child of a node that a ray enters first; the others that it enters are put on the stack, the nearest last.
#[inline(always)]
fn enter<S: Simd, const W: usize>(
    simd: S,
    node: &Node<W>,
    (ray, way): (&BoxRay<S>, Option<u32>),
    ends: S::F32,
    stack: &mut [u64],
    height: &mut usize,
) -> Option<Child> {
    let (bits, near) = ray.test(simd, node, ends);
    if bits == 0 {
        return None;
    }
    if bits & (bits - 1) == 0 {
        return Some(Child(node.children[bits.trailing_zeros() as usize % W]));
    }
    // Clamped, and so is what it is compared with: a distance below zero sorts as zero.
    let near = near.max(simd.splat_f32(0.0));
    let mut entries = Aligned([[0.0]; W]);
    near.store(entries.0.as_flattened_mut());
    if let Some(way) = way {
        return Some(put_by_way(
            simd,
            node,
            (bits, way),
            entries.0.as_flattened().try_into().expect("one column"),
            stack,
            height,
        ));
    }
    Some(put_by_distance(node, bits, (&entries.0, 0), stack, height))
}

/// Of the children of a node that a ray enters, one at least, gives the nearest, and puts the others on the stack, the
/// nearest last; their distances, zero at least, stand in a column.
#[inline(always)]
pub(crate) fn put_by_distance<const W: usize, const N: usize>(
    node: &Node<W>,
    mut bits: u32,
    (entries, column): (&[[f32; N]; W], usize),
    stack: &mut [u64],
    height: &mut usize,
) -> Child {
    let first = bits.trailing_zeros() as usize % W;
    bits &= bits - 1;
    if bits == 0 {
        return Child(node.children[first]);
    }
    let entry = |lane: usize| entry(node, entries[lane][column % N], lane);
    let second = bits.trailing_zeros() as usize % W;
    bits &= bits - 1;
    let (a, b) = (entry(first), entry(second));
    let (mut a, mut b) = (a.min(b), a.max(b));
    // A third that is not there lies behind all others; what is pushed after it takes its place.
    let third = bits.trailing_zeros() as usize % W;
    let has_third = bits != 0;
    bits &= bits.wrapping_sub(1);
    let mut c = if has_third { entry(third) } else { u64::MAX };
    (b, c) = (b.min(c), b.max(c));
    (a, b) = (a.min(b), a.max(b));
    let base = *height;
    stack[*height] = c;
    *height += usize::from(has_third);
    stack[*height] = b;
    *height += 1;
    while bits != 0 {
        let lane = bits.trailing_zeros() as usize % W;
        bits &= bits - 1;
        let other = entry(lane);
        let (nearer, other) = (a.min(other), a.max(other));
        a = nearer;
        // Insertion into what this node has pushed, the nearest last.
        let mut place = *height;
        while place > base && stack[place - 1] < other {
            stack[place] = stack[place - 1];
            place -= 1;
        }
        stack[place] = other;
        *height += 1;
    }
    child_of(a)
}

/// The same, but in the order in which the children lie along the way that the ray runs, whatever their distances.
#[inline(always)]
fn put_by_way<S: Simd, const W: usize>(
    simd: S,
    node: &Node<W>,
    (bits, way): (u32, u32),
    distances: &[f32; W],
    stack: &mut [u64],
    height: &mut usize,
) -> Child {
    let (order, len) = farthest_first(simd, node, way, bits);
    for &lane in &order[..len - 1] {
        let lane = lane as usize % W;
        stack[*height] = entry(node, distances[lane], lane);
        *height += 1;
    }
    Child(node.children[order[len - 1] as usize % W])
}

/// Of a node, the slots of children given by their bits in the order in which they lie along a way, the farthest first, and
/// how many they are; the way runs backwards along some axes, a bit each.
#[inline(always)]
pub(crate) fn farthest_first<S: Simd, const W: usize>(
    simd: S,
    node: &Node<W>,
    way: u32,
    mut children: u32,
) -> ([u32; W], usize) {
    let (mut order, mut len) = ([0; W], 0);
    if children & children.wrapping_sub(1) == 0 {
        order[0] = children.trailing_zeros();
        return (order, usize::from(children != 0));
    }
    let along = node.along(simd, way);
    let key = |lane: u32| (along.0[lane as usize % W].to_bits(), lane);
    while children != 0 {
        let lane = children.trailing_zeros();
        children &= children - 1;
        let mut place = len;
        while place > 0 && key(order[place - 1]) < key(lane) {
            order[place % W] = order[place - 1];
            place -= 1;
        }
        order[place % W] = lane;
        len += 1;
    }
    (order, len)
}

/// The next child on the stack that a ray enters before the end, given by its bits.
#[inline(always)]
fn next(stack: &[u64], height: &mut usize, end_bits: u32) -> Option<Child> {
    loop {
        if *height == 0 {
            return None;
        }
        *height -= 1;
        let entry = stack[*height];
        if (entry >> 32) as u32 <= end_bits {
            return Some(child_of(entry));
        }
    }
}

/// Visits the leaves whose boxes the ray may meet, the nearest first as far as boxes tell.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "a ray, what it is traced with, and what is done on the way")]
pub(crate) fn traverse<S: Simd, V: Visitor, const W: usize>(
    simd: S,
    tree: &Tree<W>,
    begin: &impl Begin<W>,
    stack: &mut Stack,
    ray: CullRay<'_, W>,
    end: f32,
    steps: &mut Steps,
    visitor: &mut V,
) {
    assert!(S::F32::LANES == W, "a node is as wide as the lanes");
    let way = if V::BY_WAY { Some(ray.turned()) } else { None };
    let ray = BoxRay::new(simd, ray, V::FACES);
    let mut ends = simd.splat_f32(end);
    let mut end_bits = end.max(0.0).to_bits();
    let stack = stack.entries.as_mut_slice();
    let mut height = 0;
    let mut current = begin.nearest(tree, stack, &mut height);
    let (mut nodes, mut leaves) = (0, 0);
    loop {
        if current.is_leaf() {
            leaves += 1;
            match visitor.leaf(current.leaf_index()) {
                None => break,
                Some(end) => {
                    ends = simd.splat_f32(end);
                    end_bits = end.max(0.0).to_bits();
                }
            }
        } else {
            nodes += 1;
            let node = &tree.nodes[current.node_index()];
            if let Some(child) = enter(simd, node, (&ray, way), ends, stack, &mut height) {
                current = child;
                continue;
            }
        }
        match next(stack, &mut height, end_bits) {
            Some(child) => current = child,
            None => break,
        }
    }
    steps.nodes += nodes;
    steps.leaves += leaves;
}

/// Of the children of a node that a ray enters, one at least, gives that which is visited first, and puts the others on the
/// stack: they are visited from the last to the first, or the other way round, whichever they are.
#[inline(always)]
pub(crate) fn put_all<S: Simd, const W: usize>(
    simd: S,
    (node, is_turned): (&Node<W>, bool),
    bits: u32,
    stack: &mut [u32],
    height: &mut usize,
) -> Child {
    let first = if is_turned { bits.trailing_zeros() } else { 31 - bits.leading_zeros() };
    let others = bits ^ 1 << first;
    let place = &mut stack[*height..*height + W];
    simd.compress_u32_either_way(simd.mask_f32(others), &node.children, is_turned, place);
    *height += others.count_ones() as usize;
    Child(node.children[first as usize % W])
}

/// Visits leaves whose boxes the ray may meet, in any order, until one says that the ray is stopped; whether one did.
///
/// What is met is put on the stack all at once: without distances there is no number of children to guess.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "as above")]
pub(crate) fn is_stopped<S: Simd, V: Visitor, const W: usize>(
    simd: S,
    tree: &Tree<W>,
    begin: &impl Begin<W>,
    stack: &mut Stack,
    ray: CullRay<'_, W>,
    end: f32,
    steps: &mut Steps,
    visitor: &mut V,
) -> bool {
    assert!(S::F32::LANES == W, "a node is as wide as the lanes");
    let ends = simd.splat_f32(end);
    let turned = if V::FARTHEST_FIRST { ray.turned() } else { 0 };
    let ray = BoxRay::new(simd, ray, V::FACES);
    let stack = stack.children.as_mut_slice();
    let mut height = 0;
    let Some(mut current) = begin.any(simd, tree, turned, stack, &mut height) else { return false };
    let (mut nodes, mut leaves) = (0, 0);
    let is_stopped = loop {
        if current.is_leaf() {
            leaves += 1;
            if visitor.leaf(current.leaf_index()).is_none() {
                break true;
            }
        } else {
            nodes += 1;
            let node = &tree.nodes[current.node_index()];
            let (bits, _) = ray.test(simd, node, ends);
            if bits != 0 {
                current = put_all(simd, (node, current.is_turned(turned)), bits, stack, &mut height);
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
fn entry<const W: usize>(node: &Node<W>, distance: f32, lane: usize) -> u64 {
    u64::from(distance.to_bits()) << 32 | u64::from(node.children[lane])
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the lower half")]
fn child_of(entry: u64) -> Child {
    Child(entry as u32)
}

/// The planes of all boxes of a node that are near, and far, for rays that run backwards along some axes, a bit each.
#[inline(always)]
pub(crate) fn sides<S: Simd, const W: usize>(simd: S, node: &Node<W>, turned: u32) -> [[S::F32; 3]; 2] {
    let upper = [0, 1, 2].map(|k| 3 * (turned >> k & 1) as usize);
    let near = [upper[0], 1 + upper[1], 2 + upper[2]];
    let far = [3 - upper[0], 4 - upper[1], 5 - upper[2]];
    [load(simd, node, near), load(simd, node, far)]
}

/// Three planes of all boxes of a node.
#[inline(always)]
fn load<S: Simd, const W: usize>(simd: S, node: &Node<W>, [x, y, z]: [usize; 3]) -> [S::F32; 3] {
    [simd.load_f32(&node.planes[x]), simd.load_f32(&node.planes[y]), simd.load_f32(&node.planes[z])]
}

/// The children of a node that a ray by itself enters, and where.
#[cfg(test)]
pub(crate) fn children_of<S: Simd, const W: usize>(
    simd: S,
    node: &Node<W>,
    ray: CullRay<'_, W>,
    end: f32,
) -> (u32, [f32; W]) {
    let (bits, near) = BoxRay::new(simd, ray, true).test(simd, node, simd.splat_f32(end));
    let mut distances = [0.0; W];
    near.store(&mut distances);
    (bits, distances)
}
