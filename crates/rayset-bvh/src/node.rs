//! The nodes of a wide tree.

use rayset_simd::{CullLanes, Lanes, Simd};

use crate::frame::CullBox;
use crate::traverse::Aligned;

/// How far an empty slot's box is turned inside out: finite, so that no product with it is NaN.
const NOWHERE: f32 = 1e18;

/// The bit of a child that says that it is a leaf.
const LEAF: u32 = 1 << 31;

/// Where the axis of a node stands in a child, and the bits of its number below.
const AXIS: u32 = 29;
const NODE: u32 = (1 << AXIS) - 1;

/// A child: another node, or a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub(crate) struct Child(pub(crate) u32);

impl Child {
    /// A node whose children stand along an axis.
    pub(crate) fn node(index: usize, axis: u32) -> Self {
        Self(checked(index, NODE) | axis << AXIS)
    }

    pub(crate) fn leaf(index: usize) -> Self {
        Self(checked(index, !LEAF) | LEAF)
    }

    #[inline(always)]
    pub(crate) fn is_leaf(self) -> bool {
        self.0 & LEAF != 0
    }

    /// Of a leaf.
    #[inline(always)]
    pub(crate) fn leaf_index(self) -> usize {
        (self.0 & !LEAF) as usize
    }

    /// Of a node.
    #[inline(always)]
    pub(crate) fn node_index(self) -> usize {
        self.node_number() as usize
    }

    /// The same as it is kept.
    #[inline(always)]
    pub(crate) fn node_number(self) -> u32 {
        self.0 & NODE
    }

    /// Of a node, whether a ray visits its children from the first to the last where any hit will do, given the axes along
    /// which it runs backwards, a bit each: what lies farthest along the ray comes first.
    #[inline(always)]
    pub(crate) fn is_turned(self, turned: u32) -> bool {
        turned >> (self.0 >> AXIS & 3) & 1 == 1
    }
}

/// An index that is not too large.
fn checked(index: usize, greatest: u32) -> u32 {
    u32::try_from(index).ok().filter(|&index| index <= greatest).expect("at most 2^29 nodes, and 2^31 leaves")
}

/// `W` boxes and what they hold.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node<const W: usize> {
    /// Lower x, y, z, then upper x, y, z, in culling space.
    pub(crate) planes: [[f32; W]; 6],
    pub(crate) children: [u32; W],
}

impl<const W: usize> Node<W> {
    /// A node without children: no ray meets its boxes.
    pub(crate) const EMPTY: Self = Self {
        planes: [[NOWHERE; W], [NOWHERE; W], [NOWHERE; W], [-NOWHERE; W], [-NOWHERE; W], [-NOWHERE; W]],
        children: [LEAF; W],
    };

    pub(crate) fn set(&mut self, slot: usize, bounds: &CullBox, child: Child) {
        for k in 0..3 {
            self.planes[k][slot] = bounds.low[k];
            self.planes[3 + k][slot] = bounds.high[k];
        }
        self.children[slot] = child.0;
    }

    /// How far the middles of boxes lie along a way, which runs backwards along some axes, a bit each: never below zero, so
    /// that bits are ordered as these are.
    #[inline(always)]
    pub(crate) fn along<S: Simd>(&self, simd: S, way: u32) -> Aligned<[f32; W]> {
        let mut sum = simd.splat_f32(16.0);
        for k in 0..3 {
            let sign = if way >> k & 1 == 1 { -1.0 } else { 1.0 };
            let doubled = simd.load_f32(&self.planes[k]) + simd.load_f32(&self.planes[3 + k]);
            sum = doubled.mul_add(simd.splat_f32(sign), sum);
        }
        let mut keys = Aligned([0.0; W]);
        sum.store(&mut keys.0);
        keys
    }

    /// Whether there is no child in a slot.
    #[inline(always)]
    pub(crate) fn is_empty(&self, slot: usize) -> bool {
        self.planes[0][slot] > self.planes[3][slot]
    }

    /// The box of a child.
    #[inline(always)]
    pub(crate) fn bounds(&self, slot: usize) -> [[f32; 3]; 2] {
        let plane = |k: usize| self.planes[k][slot];
        [[plane(0), plane(1), plane(2)], [plane(3), plane(4), plane(5)]]
    }
}

/// A tree over leaves that somebody else keeps.
#[derive(Clone, Debug)]
pub(crate) struct Tree<const W: usize> {
    /// Where a traversal starts: the first node, or the only leaf.
    pub(crate) root: Child,
    /// Never empty.
    pub(crate) nodes: Vec<Node<W>>,
    /// The longest way from the root to a leaf, in nodes.
    pub(crate) depth: usize,
}

impl<const W: usize> Tree<W> {
    /// Gives the leaves other numbers.
    pub(crate) fn relabel_leaves(&mut self, labels: &[u32]) {
        let children = self.nodes.iter_mut().flat_map(|node| &mut node.children);
        for child in children.chain([&mut self.root.0]) {
            // An empty slot has the number of a leaf that is never met.
            if Child(*child).is_leaf()
                && let Some(&label) = labels.get(Child(*child).leaf_index())
            {
                *child = Child::leaf(label as usize).0;
            }
        }
    }
}
