//! Packets through a tree.
//!
//! Under a shaft a node's boxes are tested in one go. What it meets is tested once more: at once against all rays of a
//! packet that is by itself, or, when its turn comes, against the shafts of all packets of a tile. What a wide shaft lets
//! through ends where none of them goes; and where few do, the shaft is not worth its steps and is given up.
//!
//! Which boxes are met and entered, and in what order, no processor can guess, and a wrong guess takes as long as the test
//! of a box. So a packet branches on none of its tests, and nothing is sorted by comparing one with another; where any hit
//! will do, nothing is sorted.
//!
//! Source: Wald, Benthin, Wagner and Slusallek 2001, "Interactive rendering with coherent ray tracing", for the test of a
//! packet's rays; Reshetov, Soupikov and Hurley 2005 for the shaft before it.

use rayset_simd::{LaneMask, Lanes, Part, Simd};

use crate::exact::Exact;
use crate::hierarchy::Scratch;
use crate::leaf::{Asking, Progress};
use crate::node::{Child, Tree};
use crate::packet::Packet;
use crate::shaft::Shaft;
use crate::together::Question;
use crate::traverse::Aligned;

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
    /// How many rays of a packet that is by itself enter it; who is asked later, has one here.
    pub(crate) entered: u32,
}

/// Children of a node that are to be visited, a bit each.
struct Children<'a, S: Simd, const W: usize> {
    node: u32,
    bits: u32,
    begin: S::F32,
    entered: &'a [u32; W],
    /// Whether the first is visited first where it is not asked where hits are, and not the last.
    is_turned: bool,
}

impl<S: Simd, const W: usize> Children<'_, S, W> {
    /// Puts them on the stack, the nearest last if it is asked where a hit is; the new height.
    ///
    /// The place of each follows from how many lie farther: sorting them would be one guess after the other.
    #[inline(always)]
    fn push<Q: Question<S, W>>(self, simd: S, stack: &mut [Pending], height: usize) -> usize {
        let Self { node, bits, begin, entered, is_turned } = self;
        let mut begins = Aligned([0.0; W]);
        begin.store(&mut begins.0);
        let (mut rest, mut n) = (bits, 0);
        let all = bits.count_ones() as usize;
        while rest != 0 {
            let lane = rest.trailing_zeros();
            rest &= rest - 1;
            let at = begins.0[lane as usize % W];
            let mut place = n;
            if Q::EXACT {
                let others = simd.splat_f32(at);
                let farther = begin.gt(others).bits() | begin.eq(others).bits() & ((1 << lane) - 1);
                place = (farther & bits).count_ones() as usize;
            } else if is_turned {
                place = all - 1 - n;
            }
            let entered = entered[lane as usize % W];
            stack[height + place] = Pending { node, lane, begin: at, entered };
            n += 1;
        }
        height + n
    }
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
                asking.leaf::<ALONE>(simd, current.leaf_index());
            } else {
                nodes += 1;
                let node = &tree.nodes[current.node_index()];
                let (met, begin) = shaft.beam.meets(simd, node, asking.progress.reach);
                let mut bits = met.bits();
                let mut entered = Aligned([1; W]);
                if ALONE {
                    box_tests += u64::from(bits.count_ones());
                    let Packet { start, ends, .. } = asking.packets[0];
                    let mut rest = bits;
                    while rest != 0 {
                        let lane = rest.trailing_zeros() as usize % W;
                        rest &= rest - 1;
                        let rays = slabs.enter(simd, node.bounds(lane), start, ends).0.bits().count_ones();
                        entered.0[lane] = rays;
                        bits &= !(u32::from(rays == 0) << lane);
                    }
                }
                let (node, is_turned) = (current.node_number(), current.is_turned(shaft.turned));
                let children = Children { node, bits, begin, entered: &entered.0, is_turned };
                height = children.push::<Q>(simd, stack, height);
            }
            let next = loop {
                if height == 0 {
                    break None;
                }
                height -= 1;
                let Pending { node, lane, begin, mut entered } = stack[height];
                if begin > asking.progress.reach {
                    continue;
                }
                let (node, lane) = (&tree.nodes[node as usize], lane as usize % W);
                if !ALONE {
                    box_tests += 1;
                    let reaches = asking.progress.reaches;
                    entered = 2 * shaft.packets_that_meet(simd, node.bounds(lane), reaches).count_ones();
                    if entered == 0 {
                        continue;
                    }
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

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use rayset_simd::{Backend, Kernel};

    use super::*;
    use crate::together::{Hidden, Nearest};

    /// What is pushed of one node's children, given where they begin: their lanes, from the bottom up.
    struct Pushed {
        begins: [f32; 16],
        bits: u32,
        nearest: bool,
        is_turned: bool,
    }

    impl Kernel for Pushed {
        type Output = Vec<u32>;

        fn run<S: Simd>(self, simd: S) -> Vec<u32> {
            if S::F32::LANES == 16 { self.push::<S, 16>(simd) } else { self.push::<S, 8>(simd) }
        }
    }

    impl Pushed {
        fn push<S: Simd, const W: usize>(self, simd: S) -> Vec<u32> {
            let bits = self.bits & (u32::MAX >> (32 - W));
            let entered = std::array::from_fn(|lane| u32::try_from(lane).expect("it is small") + 1);
            let begin = simd.load_f32(&self.begins[..W]);
            let is_turned = self.is_turned;
            let children = Children::<S, W> { node: 7, bits, begin, entered: &entered, is_turned };
            // Something lies below.
            let mut stack = vec![Pending::default(); 1 + W];
            let height = if self.nearest {
                children.push::<Nearest<S>>(simd, &mut stack, 1)
            } else {
                children.push::<Hidden>(simd, &mut stack, 1)
            };
            assert_eq!(stack[0].node, 0, "what lay below is left alone");
            let check = |pending: &Pending| {
                let at = self.begins[pending.lane as usize];
                assert_eq!((pending.node, pending.begin, pending.entered), (7, at, pending.lane + 1));
                pending.lane
            };
            stack[1..height].iter().map(check).collect()
        }
    }

    #[test]
    fn children_lie_with_the_nearest_on_top_and_none_is_lost() {
        let mut dice = ChaCha8Rng::seed_from_u64(5);
        for &backend in Backend::available() {
            for _ in 0..500 {
                // Few values, so that many begin at the same place.
                let begins: [f32; 16] =
                    std::array::from_fn(|_| [-0.5, -0.0, 0.0, 0.25, 1.0][dice.next_u32() as usize % 5]);
                let bits = dice.next_u32() & 0xffff;
                let pushed = |nearest, is_turned| backend.run(Pushed { begins, bits, nearest, is_turned });
                let [all, mut turned] = [false, true].map(|is_turned| pushed(false, is_turned));
                assert!(all.is_sorted(), "{backend}: without an order, as they stand in the node: {all:?}");
                turned.reverse();
                assert_eq!(turned, all, "{backend}: or the other way round");
                let ordered = pushed(true, dice.next_u32() % 2 == 0);
                // Those that begin at the same place, zeros of both signs among them, stay as they were.
                let mut expected = all;
                expected
                    .sort_by(|&a, &b| begins[b as usize].partial_cmp(&begins[a as usize]).expect("numbers"));
                assert_eq!(ordered, expected, "{backend}");
            }
        }
    }
}
