//! Packets through a tree.
//!
//! Under the shaft of a tile a node's boxes are tested in one go, and nothing else is known of them. A packet by itself
//! does that too, and before a box is opened its rays are tested against it, all at once: what a wide shaft lets through
//! is given up where no ray of the packet goes.
//!
//! Source: Wald, Benthin, Wagner and Slusallek 2001, "Interactive rendering with coherent ray tracing", for the test of a
//! packet's rays; Reshetov, Soupikov and Hurley 2005 for the shaft before it.

use rayset_simd::{LaneMask, Part, Simd};

use crate::exact::Exact;
use crate::hierarchy::Scratch;
use crate::node::{Child, Tree};
use crate::packet::Packet;
use crate::shaft::Shaft;
use crate::together::{Progress, Question};

/// What it costs to test a primitive against the rays of a packet, in steps.
const PACKET_TEST_STEPS: u64 = 2;

/// Takes packets through the tree under one shaft; whether they came to an end, and the steps spent.
pub(crate) struct Descent<'a, S: Simd, Q, const W: usize> {
    pub(crate) shaft: &'a Shaft<S>,
    pub(crate) packets: &'a mut [Packet<S, W>],
    pub(crate) asked: &'a mut [Q],
    pub(crate) tree: &'a Tree<W>,
    pub(crate) exact: &'a Exact<'a, W>,
    /// How many steps it may take.
    pub(crate) budget: u64,
    pub(crate) scratch: &'a mut Scratch,
}

/// A descent of several packets.
pub(crate) struct OfTile<'a, S: Simd, Q, const W: usize>(pub(crate) Descent<'a, S, Q, W>);

/// A descent of one packet.
pub(crate) struct OfPacket<'a, S: Simd, Q, const W: usize>(pub(crate) Descent<'a, S, Q, W>);

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
    type Output = (bool, u64);

    #[inline(always)]
    fn run(self, simd: S) -> (bool, u64) {
        self.0.run::<false>(simd)
    }
}

impl<S: Simd, Q: Question<S, W>, const W: usize> Part<S> for OfPacket<'_, S, Q, W> {
    type Output = (bool, u64);

    #[inline(always)]
    fn run(self, simd: S) -> (bool, u64) {
        self.0.run::<true>(simd)
    }
}

impl<S: Simd, Q: Question<S, W>, const W: usize> Descent<'_, S, Q, W> {
    #[inline(always)]
    fn run<const ALONE: bool>(self, simd: S) -> (bool, u64) {
        let Self { shaft, packets, asked, tree, exact, budget, scratch } = self;
        let Scratch { stack, steps, primitive_tests } = scratch;
        let stack = stack.together.as_mut_slice();
        let slabs = packets[0].slabs(simd, shaft.unit);
        let mut progress = Progress::new(simd, shaft, packets);
        let (mut height, mut nodes, mut leaves, mut box_tests) = (0, 0, 0, 0);
        let mut current = tree.root;
        let is_done = loop {
            if current.is_leaf() {
                leaves += 1;
                exact.ask(simd, current.index(), shaft, packets, asked, &mut progress);
            } else {
                nodes += 1;
                height = shaft.push_children(simd, tree, current, progress.reach, stack, height);
            }
            let next = loop {
                if height == 0 {
                    break None;
                }
                height -= 1;
                let Pending { node, lane, begin } = stack[height];
                if begin > progress.reach {
                    continue;
                }
                let (node, lane) = (&tree.nodes[node as usize], lane as usize % W);
                let child = Child(node.children[lane]);
                if ALONE {
                    box_tests += 1;
                    let packet = &packets[0];
                    if !slabs.enter(simd, node.bounds(lane), packet.start, packet.ends).0.any() {
                        continue;
                    }
                }
                break Some(child);
            };
            let Some(next) = next else { break true };
            if nodes + leaves + box_tests + progress.steps(PACKET_TEST_STEPS) > budget {
                break false;
            }
            current = next;
        };
        steps.nodes += nodes + progress.shaft_tests + box_tests;
        steps.leaves += leaves;
        *primitive_tests += progress.ray_tests;
        (is_done, nodes + leaves + box_tests + progress.steps(PACKET_TEST_STEPS))
    }
}
