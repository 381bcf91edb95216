//! Packets through a tree.
//!
//! Under a shaft a node's boxes are tested in one go. Before one is opened it is tested once more: against all rays of a
//! packet that is by itself, or against the shafts of all packets of a tile. What a wide shaft lets through ends where
//! none of them goes; and where few do, the shaft is not worth its steps and is given up.
//!
//! Source: Wald, Benthin, Wagner and Slusallek 2001, "Interactive rendering with coherent ray tracing", for the test of a
//! packet's rays; Reshetov, Soupikov and Hurley 2005 for the shaft before it.

use rayset_simd::{LaneMask, Part, Simd};

use crate::exact::Exact;
use crate::hierarchy::Scratch;
use crate::leaf::{Asking, Progress};
use crate::node::{Child, Tree};
use crate::packet::Packet;
use crate::shaft::Shaft;
use crate::together::Question;

/// A packet goes on as long as it has taken no more than so many quarters of the steps of its rays by themselves: a step
/// of a packet takes less time than one of a ray, which guesses its way.
const PACKET_QUARTERS: u64 = 10;
/// And a tile, of the steps of its packets by themselves.
const TILE_QUARTERS: u64 = 3;

/// Takes packets through the tree under one shaft, until they come to an end or turn out not to be worth it.
///
/// What it is worth is counted on the way: whatever enters a box, rays or packets, would have gone there by itself.
pub(crate) struct Descent<'a, S: Simd, Q, const W: usize> {
    pub(crate) shaft: &'a Shaft<S>,
    pub(crate) packets: &'a mut [Packet<S, W>],
    pub(crate) asked: &'a mut [Q],
    pub(crate) tree: &'a Tree<W>,
    pub(crate) exact: &'a Exact<'a, W>,
    /// How many steps it may take, whatever they are worth.
    pub(crate) most: u64,
    pub(crate) scratch: &'a mut Scratch,
}

/// A descent of several packets.
pub(crate) struct OfTile<'a, S: Simd, Q, const W: usize>(pub(crate) Descent<'a, S, Q, W>);

/// A descent of one packet.
pub(crate) struct OfPacket<'a, S: Simd, Q, const W: usize>(pub(crate) Descent<'a, S, Q, W>);

/// How a descent ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outcome {
    /// Whether it came to an end, or was given up.
    pub(crate) is_done: bool,
    /// The steps it took.
    pub(crate) spent: u64,
    /// The steps its rays, or its packets, would have taken by themselves, as far as it came.
    pub(crate) worth: u64,
}

/// A child that is still to visit.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pending {
    /// The node whose child it is, and which.
    pub(crate) node: u32,
    pub(crate) lane: u32,
    /// How far along the axis its box begins.
    pub(crate) begin: f32,
}

impl<S: Simd, Q: Question<S, W>, const W: usize> Part<S> for OfTile<'_, S, Q, W> {
    type Output = Outcome;

    #[inline(always)]
    fn run(self, simd: S) -> Outcome {
        self.0.run::<false>(simd)
    }
}

impl<S: Simd, Q: Question<S, W>, const W: usize> Part<S> for OfPacket<'_, S, Q, W> {
    type Output = Outcome;

    #[inline(always)]
    fn run(self, simd: S) -> Outcome {
        self.0.run::<true>(simd)
    }
}

impl<S: Simd, Q: Question<S, W>, const W: usize> Descent<'_, S, Q, W> {
    #[inline(always)]
    fn run<const ALONE: bool>(self, simd: S) -> Outcome {
        let Self { shaft, packets, asked, tree, exact, most, scratch } = self;
        let Scratch { stack, steps, primitive_tests, .. } = scratch;
        let stack = stack.together.as_mut_slice();
        let slabs = packets[0].slabs(simd, shaft.unit);
        let progress = Progress::new(simd, shaft, packets);
        let packets = if ALONE { &mut packets[..1] } else { packets };
        let mut asking = Asking { exact, shaft, packets, asked, progress };
        let (mut height, mut nodes, mut leaves, mut box_tests) = (0, 0, 0, 0);
        // A packet by itself tests a box before it is opened.
        let mut worth = if ALONE { asking.packets[0].len } else { 2 * asking.packets.len() } as u64;
        let mut current = tree.root;
        let is_done = loop {
            if current.is_leaf() {
                leaves += 1;
                asking.leaf::<ALONE>(simd, current.index());
            } else {
                nodes += 1;
                height = shaft.push_children(simd, tree, current, asking.progress.reach, stack, height);
            }
            let next = loop {
                if height == 0 {
                    break None;
                }
                height -= 1;
                let Pending { node, lane, begin } = stack[height];
                if begin > asking.progress.reach {
                    continue;
                }
                let (node, lane) = (&tree.nodes[node as usize], lane as usize % W);
                box_tests += 1;
                let entered = if ALONE {
                    let Packet { start, ends, .. } = asking.packets[0];
                    slabs.enter(simd, node.bounds(lane), start, ends).0.bits().count_ones()
                } else {
                    2 * shaft.packets_that_meet(simd, node.bounds(lane), asking.progress.reaches).count_ones()
                };
                if entered == 0 {
                    continue;
                }
                worth += u64::from(entered);
                break Some(Child(node.children[lane]));
            };
            let Some(next) = next else { break true };
            let progress = &asking.progress;
            let (steps, tests) = (nodes + leaves + box_tests + progress.shaft_tests, progress.tests());
            let is_worth_it = if ALONE {
                4 * (steps + tests) <= PACKET_QUARTERS * worth
            } else {
                4 * steps <= TILE_QUARTERS * worth
            };
            if !is_worth_it || steps + tests > most {
                break false;
            }
            current = next;
        };
        let progress = &asking.progress;
        steps.nodes += nodes + progress.shaft_tests + box_tests;
        steps.leaves += leaves;
        *primitive_tests += progress.ray_tests;
        let spent = nodes + leaves + box_tests + progress.shaft_tests + progress.tests();
        if !ALONE {
            // Packets by themselves test their rays against the same primitives.
            worth = (worth + progress.tests()).min(most);
        }
        Outcome { is_done, spent, worth }
    }
}
