//! Building a tree: a binary one by the surface area heuristic, collapsed into wide nodes at the least cost.

use std::ops::Range;

use rayon::prelude::*;
use rayset_simd::large_page_vec;

use crate::frame::{CullBox, side};
use crate::node::{Child, Node, Tree};

/// How many bins a split is looked for in.
const BINS: usize = 16;
/// Below this many primitives a subtree is built on one thread.
const PARALLEL: usize = 8192;
/// From this depth on ranges are halved, which bounds the depth whatever the primitives are.
const DEPTH_OF_HALVING: u32 = 40;

/// Four numbers, of which boxes use three: so that a box takes two registers and no shuffling.
type Four = [f32; 4];

/// A primitive's box and its number.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Reference {
    /// The fourth number is the primitive's, bit by bit.
    low: Four,
    /// The fourth is the primitive's weight, and [`TOO_HEAVY`] for each group before its own. It is 1 at least, so that the
    /// sum of both is no subnormal number: they take a hundred times longer to multiply.
    high: Four,
}

/// How many groups of primitives are told apart, at most: those that lanes test together.
const GROUPS: usize = 4;
/// No primitive weighs as much.
const TOO_HEAVY: u16 = 256;

/// How much primitives take of a leaf: of the lanes of each group's block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Load([u32; GROUPS]);

impl Reference {
    /// By its box and number, the group of those that lanes test together, and how many of these lanes it takes, one at
    /// least.
    pub(crate) fn new(bounds: &CullBox, primitive: u32, group: u8, weight: u8) -> Self {
        let ([x, y, z], [a, b, c]) = (bounds.low, bounds.high);
        let load = TOO_HEAVY * u16::from(group) + u16::from(weight);
        Self { low: [x, y, z, f32::from_bits(primitive)], high: [a, b, c, f32::from(load)] }
    }

    #[inline]
    pub(crate) fn primitive(&self) -> u32 {
        self.low[3].to_bits()
    }

    /// Its group, and how many lanes it takes.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small whole number")]
    fn load(&self) -> (usize, u32) {
        let (load, too_heavy) = (self.high[3] as u32, u32::from(TOO_HEAVY));
        ((load / too_heavy) as usize % GROUPS, load % too_heavy)
    }

    /// Whether its box has no thickness along an axis.
    pub(crate) fn is_flat(&self) -> bool {
        (0..3).any(|k| self.low[k] >= self.high[k])
    }

    /// Twice the middle.
    #[inline(always)]
    fn doubled_center(&self) -> Four {
        std::array::from_fn(|k| self.low[k] + self.high[k])
    }
}

/// A box of four numbers.
#[derive(Clone, Copy)]
#[repr(C, align(32))]
struct FourBox {
    low: Four,
    high: Four,
}

impl FourBox {
    const EMPTY: Self = Self { low: [f32::INFINITY; 4], high: [f32::NEG_INFINITY; 4] };

    /// Nothing here is NaN, but for the fourth number, which nobody asks for.
    #[inline(always)]
    fn add(&mut self, low: &Four, high: &Four) {
        for k in 0..4 {
            self.low[k] = if low[k] < self.low[k] { low[k] } else { self.low[k] };
            self.high[k] = if high[k] > self.high[k] { high[k] } else { self.high[k] };
        }
    }

    /// Half the surface; zero for the empty box.
    #[inline(always)]
    fn half_area(&self) -> f32 {
        let side = |k: usize| side(self.low[k], self.high[k]);
        let (x, y, z) = (side(0), side(1), side(2));
        x * y + y * z + z * x
    }

    fn cull_box(&self) -> CullBox {
        let ([x, y, z, _], [a, b, c, _]) = (self.low, self.high);
        CullBox { low: [x, y, z], high: [a, b, c] }
    }
}

impl Load {
    const NONE: Self = Self([0; GROUPS]);

    #[inline(always)]
    fn add(&mut self, (group, weight): (usize, u32)) {
        self.0[group] += weight;
    }

    #[inline(always)]
    fn add_all(&mut self, other: &Self) {
        for (sum, weight) in self.0.iter_mut().zip(other.0) {
            *sum += weight;
        }
    }

    /// How many blocks of so many lanes, a power of two, hold it: each costs the same whether it is full or not.
    #[inline(always)]
    fn blocks(&self, lanes: usize) -> u32 {
        let shift = lanes.trailing_zeros();
        let last = (1 << shift) - 1;
        self.0.iter().map(|weight| (weight + last) >> shift).sum()
    }

    /// Whether one block of each group holds it.
    fn fits(&self, lanes: usize) -> bool {
        self.0.iter().all(|&weight| weight as usize <= lanes)
    }
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
    // More room than there will be nodes; what is not written is not there.
    let mut nodes = large_page_vec(1 + references.len() / leaf_len);
    nodes.push(Node::EMPTY);
    let mut tree = Tree { root: Child::node(0, 0), nodes, depth: 1 };
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
    (tree.root, tree.depth) = emit(&root, 0, &mut tree, &mut leaves);
    (tree, leaves)
}

/// Fills a node with the best collapse of a binary subtree; returns the node as a child, and how deep it goes.
fn emit<const W: usize>(
    binary: &Binary,
    node: usize,
    tree: &mut Tree<W>,
    leaves: &mut Vec<Range<u32>>,
) -> (Child, usize) {
    let Binary::Inner { children, .. } = binary else { unreachable!("leaves stand in their parent's slots") };
    let mut slots = Vec::with_capacity(W);
    share(children, W, &mut slots);
    let axis = put_along_axis(&mut slots);
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
                let (child, below) = emit(binary, index, tree, leaves);
                depth = depth.max(below);
                child
            }
        };
        tree.nodes[node].set(slot, binary.bounds(), child);
    }
    (Child::node(node, axis), depth + 1)
}

/// The axis along which subtrees lie most one behind the other in the order in which they stand; they are turned round if
/// they do so backwards.
#[expect(clippy::cast_precision_loss, reason = "there are few")]
fn put_along_axis(slots: &mut [&Binary]) -> u32 {
    let middle = (slots.len() as f32 - 1.0) / 2.0;
    let along = [0, 1, 2].map(|k| {
        let doubled_center = |binary: &Binary| binary.bounds().low[k] + binary.bounds().high[k];
        slots.iter().enumerate().map(|(i, binary)| (i as f32 - middle) * doubled_center(binary)).sum::<f32>()
    });
    let [x, y, z] = along.map(f32::abs);
    let axis = if x >= y && x >= z { 0 } else { 2 - u32::from(y >= z) };
    if along[axis as usize] < 0.0 {
        slots.reverse();
    }
    axis
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

/// Splits a range of references until a leaf holds them; within a leaf they stand in the order of their numbers.
fn split<const W: usize>(references: &mut [Reference], start: u32, leaf_len: usize, depth: u32) -> Binary {
    let extent = Extent::of(references);
    let bounds = extent.bounds.cull_box();
    let n = u32::try_from(references.len()).expect("at most 2^31 primitives");
    if fits(references, leaf_len) {
        references.sort_unstable_by_key(Reference::primitive);
        return Binary::Leaf { bounds, range: start..start + n };
    }
    let middle = if depth < DEPTH_OF_HALVING { best_split(references, &extent, leaf_len) } else { None };
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

/// Whether a leaf holds references; it holds any single one.
fn fits(references: &[Reference], leaf_len: usize) -> bool {
    if references.len() > GROUPS * leaf_len {
        return false;
    }
    let mut load = Load::NONE;
    references.iter().for_each(|reference| load.add(reference.load()));
    references.len() == 1 || load.fits(leaf_len)
}

/// The boxes of references, and of their doubled centres.
#[derive(Clone, Copy)]
struct Extent {
    bounds: FourBox,
    centers: FourBox,
}

impl Extent {
    fn of(references: &[Reference]) -> Self {
        in_parts(references, Self { bounds: FourBox::EMPTY, centers: FourBox::EMPTY }, Self::with, Self::join)
    }

    #[inline(always)]
    fn with(mut self, references: &[Reference]) -> Self {
        for reference in references {
            let center = reference.doubled_center();
            self.bounds.add(&reference.low, &reference.high);
            self.centers.add(&center, &center);
        }
        self
    }

    fn join(mut self, other: Self) -> Self {
        self.bounds.add(&other.bounds.low, &other.bounds.high);
        self.centers.add(&other.centers.low, &other.centers.high);
        self
    }
}

/// Sums up references, in parts on several threads where they are many. Least and greatest values and counts do not
/// depend on how they are divided.
fn in_parts<T: Copy + Send + Sync>(
    references: &[Reference],
    nothing: T,
    with: impl Fn(T, &[Reference]) -> T + Sync,
    join: impl Fn(T, T) -> T + Sync + Send,
) -> T {
    if references.len() < 4 * PARALLEL {
        return with(nothing, references);
    }
    references.par_chunks(PARALLEL).map(|part| with(nothing, part)).reduce(|| nothing, join)
}

/// How the doubled centres along the three axes are put into bins.
#[derive(Clone, Copy)]
struct Binning {
    low: Four,
    scale: Four,
}

impl Binning {
    fn of(centers: &FourBox) -> Self {
        let scale = |k: usize| if k < 3 { bin_scale(centers.low[k], centers.high[k]) } else { 0.0 };
        let low = |k: usize| if k < 3 { centers.low[k] } else { 0.0 };
        Self { low: std::array::from_fn(low), scale: std::array::from_fn(scale) }
    }

    /// The bins of a reference along the axes.
    ///
    /// Without a conversion: of a number to which `2^23` was added, the lowest bits are its nearest integer, from 0 to
    /// `BINS - 1` here.
    #[inline(always)]
    fn bins(&self, reference: &Reference) -> [usize; 4] {
        let center = reference.doubled_center();
        std::array::from_fn(|k| {
            let place = (center[k] - self.low[k]) * self.scale[k] - 0.5;
            let place = if place > 0.0 { place } else { 0.0 };
            (place + 8_388_608.0).to_bits() as usize % BINS
        })
    }
}

/// What lies in the bins along the three axes.
#[derive(Clone, Copy)]
struct Bins {
    bounds: [[FourBox; BINS]; 3],
    loads: [[Load; BINS]; 3],
}

impl Bins {
    const EMPTY: Self = Self { bounds: [[FourBox::EMPTY; BINS]; 3], loads: [[Load::NONE; BINS]; 3] };

    #[inline(always)]
    fn with(mut self, references: &[Reference], binning: &Binning) -> Self {
        for reference in references {
            let (bins, load) = (binning.bins(reference), reference.load());
            for (k, &bin) in bins[..3].iter().enumerate() {
                self.bounds[k][bin].add(&reference.low, &reference.high);
                self.loads[k][bin].add(load);
            }
        }
        self
    }

    fn join(mut self, other: Self) -> Self {
        for k in 0..3 {
            for i in 0..BINS {
                self.bounds[k][i].add(&other.bounds[k][i].low, &other.bounds[k][i].high);
                self.loads[k][i].add_all(&other.loads[k][i]);
            }
        }
        self
    }
}

/// Reorders the references so that a prefix and the rest have the least cost; the length of the prefix, or `None` if
/// all centres coincide.
fn best_split(references: &mut [Reference], extent: &Extent, leaf_len: usize) -> Option<usize> {
    let binning = Binning::of(&extent.centers);
    let bins = in_parts(references, Bins::EMPTY, |bins, part| bins.with(part, &binning), Bins::join);
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in 0..3 {
        if binning.scale[axis] > 0.0 {
            for (cost, bin) in sweep(&bins.bounds[axis], &bins.loads[axis], leaf_len) {
                if best.is_none_or(|best| cost < best.0) {
                    best = Some((cost, axis, bin));
                }
            }
        }
    }
    let (_, axis, bin) = best?;
    Some(partition(references, |reference| binning.bins(reference)[axis] < bin))
}

/// The cost of a split before each bin that leaves something on both sides.
#[expect(clippy::cast_precision_loss, reason = "a cost")]
fn sweep(
    bounds: &[FourBox; BINS],
    loads: &[Load; BINS],
    leaf_len: usize,
) -> impl Iterator<Item = (f32, usize)> {
    let mut right = [(0.0, 0); BINS];
    let (mut sum, mut load) = (FourBox::EMPTY, Load::NONE);
    for i in (1..BINS).rev() {
        sum.add(&bounds[i].low, &bounds[i].high);
        load.add_all(&loads[i]);
        right[i] = (sum.half_area(), load.blocks(leaf_len));
    }
    let (mut sum, mut load) = (FourBox::EMPTY, Load::NONE);
    (1..BINS).filter_map(move |i| {
        sum.add(&bounds[i - 1].low, &bounds[i - 1].high);
        load.add_all(&loads[i - 1]);
        let ((right_area, right_blocks), blocks) = (right[i], load.blocks(leaf_len));
        let cost = sum.half_area() * blocks as f32 + right_area * right_blocks as f32;
        (blocks > 0 && right_blocks > 0).then_some((cost, i))
    })
}

/// Bins a unit of doubled centre; zero where all centres coincide.
fn bin_scale(low: f32, high: f32) -> f32 {
    let width = high - low;
    // A width so small that the scale overflows is no width.
    let scale = BINS as f32 * (1.0 - 1e-6) / width;
    if scale.is_finite() && width > 0.0 { scale } else { 0.0 }
}

/// Moves what is left to the front; returns how many that are. The order depends on the input alone.
///
/// Without a branch to guess: what is right of the front is always moved on by one, and the front grows or not.
fn partition(references: &mut [Reference], is_left: impl Fn(&Reference) -> bool) -> usize {
    let mut front = 0;
    for i in 0..references.len() {
        let reference = references[i];
        references.swap(i, front);
        front += usize::from(is_left(&reference));
    }
    front
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Boxes strewn by a multiplicative hash, many of them on top of each other.
    #[expect(clippy::cast_precision_loss, reason = "strewn")]
    fn strewn(n: u32, groups: u32) -> Vec<Reference> {
        let at = |i: u32, k: u32| ((i / 3).wrapping_mul(k) >> 8) as f32 / 16_777_216.0;
        (0..n)
            .map(|i| {
                let low = [at(i, 2_654_435_761), at(i, 2_246_822_519), at(i, 3_266_489_917)];
                let group = u8::try_from(i % groups).expect("few");
                Reference::new(&CullBox { low, high: low.map(|x| x + 0.01) }, i, group, 1)
            })
            .collect()
    }

    #[test]
    fn tree_is_the_same_for_any_number_of_threads() {
        let trees = [1, 2, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut references = strewn(100_000, 2);
            let (tree, leaves) = pool.install(|| build::<8>(&mut references, 8));
            let planes: Vec<u32> =
                tree.nodes.iter().flat_map(|node| node.planes.as_flattened()).map(|x| x.to_bits()).collect();
            let children: Vec<u32> = tree.nodes.iter().flat_map(|node| node.children).collect();
            let order: Vec<u32> = references.iter().map(Reference::primitive).collect();
            (planes, children, leaves, order)
        });
        assert!(trees[0] == trees[1] && trees[0] == trees[2]);
    }

    #[test]
    fn every_primitive_is_in_one_leaf_and_in_its_box() {
        let mut references = strewn(10_000, 1);
        let (tree, leaves) = build::<16>(&mut references, 16);
        let mut seen = vec![0; references.len()];
        for (node, slot) in tree.nodes.iter().flat_map(|node| (0..16).map(move |slot| (node, slot))) {
            let child = Child(node.children[slot]);
            if !child.is_leaf() || node.planes[0][slot] > node.planes[3][slot] {
                continue;
            }
            for i in leaves[child.leaf_index()].clone() {
                let reference = &references[i as usize];
                seen[reference.primitive() as usize] += 1;
                for k in 0..3 {
                    assert!(node.planes[k][slot] <= reference.low[k]);
                    assert!(node.planes[3 + k][slot] >= reference.high[k]);
                }
            }
        }
        assert!(seen.iter().all(|&times| times == 1));
    }

    #[test]
    fn subtrees_stand_one_behind_the_other_along_their_axis() {
        let leaf = |at: [f32; 3]| Binary::Leaf { bounds: CullBox { low: at, high: at }, range: 0..1 };
        // Places along each axis, the way in which they stand along another, and whether they are turned round.
        for (places, axis, are_turned) in [
            ([[0.0, 0.0, 0.0], [1.0, 0.5, 0.5], [2.0, -0.5, 1.0]], 0, false),
            ([[0.0, 3.0, 0.0], [0.5, 1.0, 0.5], [1.0, 0.0, 0.0]], 1, true),
            ([[0.5, 0.0, 1.0], [0.0, 0.5, 0.0], [0.5, 0.5, -1.0]], 2, true),
        ] {
            let subtrees = places.map(leaf);
            let mut slots: Vec<_> = subtrees.iter().collect();
            assert_eq!(put_along_axis(&mut slots), axis);
            let order: Vec<_> = slots.iter().map(|slot| slot.bounds().low.map(f32::to_bits)).collect();
            let mut expected: Vec<_> = places.iter().map(|place| place.map(f32::to_bits)).collect();
            if are_turned {
                expected.reverse();
            }
            assert_eq!(order, expected);
        }
    }

    #[test]
    fn a_leaf_holds_a_block_of_each_group() {
        let leaves = [1, 2].map(|groups| {
            let mut references = strewn(10_000, groups);
            let (_, leaves) = build::<16>(&mut references, 16);
            for leaf in &leaves {
                let mut load = Load::NONE;
                references[leaf.start as usize..leaf.end as usize]
                    .iter()
                    .for_each(|reference| load.add(reference.load()));
                assert!(load.fits(16), "{load:?}");
            }
            leaves.len()
        });
        assert!(10 * leaves[1] < 7 * leaves[0], "{leaves:?}");
    }
}
