//! Building a tree: a binary one by the surface area heuristic, collapsed into wide nodes at the least cost.

use std::ops::Range;

use crate::frame::CullBox;
use crate::node::{Child, Node, Tree};

/// How many bins a split is looked for in.
const BINS: usize = 16;
/// Below this many primitives a subtree is built on one thread.
const PARALLEL: usize = 8192;
/// From this depth on ranges are halved, which bounds the depth whatever the primitives are.
const DEPTH_OF_HALVING: u32 = 40;

/// A primitive's box and its number.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reference {
    pub(crate) bounds: CullBox,
    pub(crate) primitive: u32,
}

/// A subtree of the binary tree.
enum Binary {
    Leaf { bounds: CullBox, range: Range<u32> },
    Inner { bounds: CullBox, children: Box<[Binary; 2]>, costs: Box<Costs> },
}

/// What it costs to stand in a wide node with at most `i + 1` slots: the surface of the nodes below.
type Costs = [f32; MAX_WIDTH];

const MAX_WIDTH: usize = 16;

impl Binary {
    fn bounds(&self) -> &CullBox {
        match self {
            Self::Leaf { bounds, .. } | Self::Inner { bounds, .. } => bounds,
        }
    }

    /// The least cost with at most `slots` slots.
    fn cost(&self, slots: usize) -> f32 {
        match self {
            Self::Leaf { .. } => 0.0,
            Self::Inner { costs, .. } => costs[slots - 1],
        }
    }
}

/// The tree, and the leaves' ranges of the reordered references, by leaf number.
pub(crate) fn build<const W: usize>(
    references: &mut [Reference],
    leaf_len: usize,
) -> (Tree<W>, Vec<Range<u32>>) {
    let mut tree = Tree { root: Child::ROOT, nodes: vec![Node::EMPTY], depth: 1 };
    let mut leaves = Vec::new();
    if references.is_empty() {
        return (tree, leaves);
    }
    let root = split::<W>(references, 0, leaf_len, 0);
    if let Binary::Leaf { bounds, range } = &root {
        tree.nodes[0].set(0, bounds, Child::leaf(0));
        tree.root = Child::leaf(0);
        leaves.push(range.clone());
        return (tree, leaves);
    }
    tree.depth = emit(&root, 0, &mut tree, &mut leaves);
    (tree, leaves)
}

/// Fills a node with the best collapse of a binary subtree; returns how deep it goes.
fn emit<const W: usize>(
    binary: &Binary,
    node: usize,
    tree: &mut Tree<W>,
    leaves: &mut Vec<Range<u32>>,
) -> usize {
    let Binary::Inner { children, .. } = binary else { unreachable!("leaves stand in their parent's slots") };
    let mut slots = Vec::with_capacity(W);
    share(children, W, &mut slots);
    let mut depth = 0;
    for (slot, binary) in slots.into_iter().enumerate() {
        let child = match binary {
            Binary::Leaf { range, .. } => {
                leaves.push(range.clone());
                Child::leaf(leaves.len() - 1)
            }
            Binary::Inner { .. } => {
                tree.nodes.push(Node::EMPTY);
                let index = tree.nodes.len() - 1;
                depth = depth.max(emit(binary, index, tree, leaves));
                Child::node(index)
            }
        };
        tree.nodes[node].set(slot, binary.bounds(), child);
    }
    depth + 1
}

/// The subtrees that stand in a node's slots, given the two below it.
fn share<'b>(children: &'b [Binary; 2], slots: usize, out: &mut Vec<&'b Binary>) {
    let (left_slots, _) = best_share(children, slots);
    for (child, slots) in children.iter().zip([left_slots, slots - left_slots]) {
        place(child, slots, out);
    }
}

fn place<'b>(binary: &'b Binary, slots: usize, out: &mut Vec<&'b Binary>) {
    match binary {
        // A node of its own where that is as good as more slots.
        Binary::Inner { children, costs, .. } if costs[slots - 1] < costs[0] => share(children, slots, out),
        _ => out.push(binary),
    }
}

/// How many of the slots the left subtree gets, and the cost.
fn best_share(children: &[Binary; 2], slots: usize) -> (usize, f32) {
    let mut best = (1, f32::INFINITY);
    for left in 1..slots {
        let cost = children[0].cost(left) + children[1].cost(slots - left);
        if cost < best.1 {
            best = (left, cost);
        }
    }
    best
}

/// The costs of an inner subtree.
///
/// Source: Wald, Benthin, Boulos 2008 for the collapse; Ylitie, Karras, Laine 2017, section 3.1, for finding the best
/// one by dynamic programming.
fn costs_of<const W: usize>(bounds: &CullBox, children: &[Binary; 2]) -> Costs {
    let mut costs = [f32::INFINITY; MAX_WIDTH];
    costs[0] = bounds.half_area() + best_share(children, W).1;
    for slots in 2..=W {
        costs[slots - 1] = best_share(children, slots).1.min(costs[slots - 2]);
    }
    costs
}

/// Splits a range of references until a leaf holds them.
fn split<const W: usize>(references: &mut [Reference], start: u32, leaf_len: usize, depth: u32) -> Binary {
    let bounds = references.iter().fold(CullBox::EMPTY, |bounds, r| bounds.union(&r.bounds));
    let n = u32::try_from(references.len()).expect("at most 2^31 primitives");
    if references.len() <= leaf_len {
        return Binary::Leaf { bounds, range: start..start + n };
    }
    let middle = if depth < DEPTH_OF_HALVING { best_split(references, leaf_len) } else { None };
    let middle = middle.unwrap_or(references.len() / 2);
    let (left, right) = references.split_at_mut(middle);
    let right_start = start + u32::try_from(middle).expect("less than the whole");
    let (depth, is_large) = (depth + 1, left.len() + right.len() > PARALLEL);
    let mut build_left = || split::<W>(left, start, leaf_len, depth);
    let mut build_right = || split::<W>(right, right_start, leaf_len, depth);
    let (left, right) =
        if is_large { rayon::join(build_left, build_right) } else { (build_left(), build_right()) };
    let children = Box::new([left, right]);
    let costs = Box::new(costs_of::<W>(&bounds, &children));
    Binary::Inner { bounds, children, costs }
}

/// What lies in a bin.
#[derive(Clone, Copy)]
struct Bin {
    bounds: CullBox,
    count: u32,
}

/// Reorders the references so that a prefix and the rest have the least cost; the length of the prefix, or `None` if
/// all centres coincide.
fn best_split(references: &mut [Reference], leaf_len: usize) -> Option<usize> {
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for reference in references.iter() {
        for k in 0..3 {
            let center = reference.bounds.doubled_center(k);
            low[k] = low[k].min(center);
            high[k] = high[k].max(center);
        }
    }
    let scales: [f32; 3] = std::array::from_fn(|k| bin_scale(low[k], high[k]));
    let mut bins = [[Bin { bounds: CullBox::EMPTY, count: 0 }; BINS]; 3];
    for reference in references.iter() {
        for k in 0..3 {
            let bin = &mut bins[k][bin_of(reference.bounds.doubled_center(k), low[k], scales[k])];
            bin.bounds = bin.bounds.union(&reference.bounds);
            bin.count += 1;
        }
    }
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in 0..3 {
        if scales[axis] > 0.0 {
            for (cost, bin) in sweep(&bins[axis], leaf_len) {
                if best.is_none_or(|best| cost < best.0) {
                    best = Some((cost, axis, bin));
                }
            }
        }
    }
    let (_, axis, bin) = best?;
    let is_left =
        |reference: &Reference| bin_of(reference.bounds.doubled_center(axis), low[axis], scales[axis]) < bin;
    Some(partition(references, is_left))
}

/// The cost of a split before each bin that leaves something on both sides.
fn sweep(bins: &[Bin; BINS], leaf_len: usize) -> impl Iterator<Item = (f32, usize)> {
    let mut right = [(0.0, 0); BINS];
    let mut sum = Bin { bounds: CullBox::EMPTY, count: 0 };
    for i in (1..BINS).rev() {
        sum = Bin { bounds: sum.bounds.union(&bins[i].bounds), count: sum.count + bins[i].count };
        right[i] = (sum.bounds.half_area(), sum.count);
    }
    let mut left = Bin { bounds: CullBox::EMPTY, count: 0 };
    (1..BINS).filter_map(move |i| {
        left = Bin { bounds: left.bounds.union(&bins[i - 1].bounds), count: left.count + bins[i - 1].count };
        let (right_area, right_count) = right[i];
        let is_split = left.count > 0 && right_count > 0;
        let cost = left.bounds.half_area() * leaves(left.count, leaf_len)
            + right_area * leaves(right_count, leaf_len);
        is_split.then_some((cost, i))
    })
}

/// How many full leaves hold so many primitives: a leaf costs the same whether it is full or not.
#[expect(clippy::cast_precision_loss, reason = "a cost")]
fn leaves(count: u32, leaf_len: usize) -> f32 {
    (count as usize).div_ceil(leaf_len) as f32
}

/// Bins a unit of doubled centre; zero where all centres coincide.
fn bin_scale(low: f32, high: f32) -> f32 {
    let width = high - low;
    // A width so small that the scale overflows is no width.
    let scale = BINS as f32 * (1.0 - 1e-6) / width;
    if scale.is_finite() && width > 0.0 { scale } else { 0.0 }
}

#[inline]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to BINS - 1")]
fn bin_of(center: f32, low: f32, scale: f32) -> usize {
    (((center - low) * scale) as usize).min(BINS - 1)
}

/// Moves what is left to the front; returns how many that are. The order depends on the input alone.
fn partition(references: &mut [Reference], is_left: impl Fn(&Reference) -> bool) -> usize {
    let (mut i, mut j) = (0, references.len());
    loop {
        while i < j && is_left(&references[i]) {
            i += 1;
        }
        while i < j && !is_left(&references[j - 1]) {
            j -= 1;
        }
        if i >= j {
            return i;
        }
        references.swap(i, j - 1);
    }
}
