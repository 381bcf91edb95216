//! Triangles of a leaf that share an edge, two and two, so that packets test both at once.
//!
//! A mesh's triangles are halves of quadrilaterals more often than not, and a packet that may meet one half may meet the
//! other: together they have four vertices to shear and five edge functions, instead of six and six.

use crate::triangles::TriangleBlock;

/// The partner of each lane of a block, in four bits: of a triangle without one, its own lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Pairs(u64);

impl Pairs {
    /// No lane has a partner.
    pub(crate) const NONE: Self = Self(0xfedc_ba98_7654_3210);

    fn join(&mut self, a: usize, b: usize) {
        let [i, j] = [a as u64, b as u64];
        let difference = i ^ j;
        self.0 ^= difference << (4 * i) | difference << (4 * j);
    }

    /// The partner of a lane.
    #[inline(always)]
    pub(crate) fn of(self, lane: u32) -> u32 {
        (self.0 >> (4 * lane) & 15) as u32
    }
}

/// Edge `i` of a triangle, which is edge `j` of another the other way round.
struct Shared {
    other: usize,
    i: usize,
    j: usize,
    /// The square of its length.
    length: f32,
}

impl<const W: usize> TriangleBlock<W> {
    /// Pairs the first so many triangles, each with the later one with which it shares its longest edge; turns their
    /// vertices so that the first of two, by lane, is `a b c` and the second `a c d`.
    pub(crate) fn pair_up(&mut self, len: usize) -> Pairs {
        let mut pairs = Pairs::NONE;
        let mut hashes = [[0; 3]; W];
        for (lane, hashes) in hashes[..len].iter_mut().enumerate() {
            *hashes = [self.hash(lane, 0), self.hash(lane, 1), self.hash(lane, 2)];
        }
        let mut open = u32::MAX >> (32 - W);
        for first in 0..len {
            if open >> first & 1 == 0 {
                continue;
            }
            let others = (first + 1..len).filter(|&other| open >> other & 1 == 1);
            let shared = others.filter_map(|other| self.shared(&hashes, first, other));
            let longest = shared.max_by(|p, q| p.length.total_cmp(&q.length).then(q.other.cmp(&p.other)));
            if let Some(Shared { other, i, j, .. }) = longest {
                // The edge goes from c to a in the first, and from a to c in the second.
                self.turn(first, (i + 1) % 3);
                self.turn(other, j);
                pairs.join(first, other);
                open &= !(1 << other);
            }
        }
        pairs
    }

    fn hash(&self, lane: usize, vertex: usize) -> u32 {
        let mix = |hash: u32, bits: u32| (hash ^ bits).wrapping_mul(0x9e37_79b1).rotate_left(13);
        self.bits(lane, vertex).into_iter().fold(0, mix)
    }

    /// The bits of a vertex; both zeros are the same.
    fn bits(&self, lane: usize, vertex: usize) -> [u32; 3] {
        self.at(lane, vertex).map(|x| (x + 0.0).to_bits())
    }

    /// The longest edge that two triangles share, each the other way round.
    fn shared(&self, hashes: &[[u32; 3]; W], first: usize, other: usize) -> Option<Shared> {
        let mut longest: Option<Shared> = None;
        for i in 0..3 {
            let after = (i + 1) % 3;
            for j in 0..3 {
                let before = (j + 1) % 3;
                let is_alike = |a: usize, b: usize| {
                    hashes[first][a] == hashes[other][b] && self.bits(first, a) == self.bits(other, b)
                };
                if is_alike(i, before) && is_alike(after, j) {
                    let (p, q) = (self.at(first, i), self.at(first, after));
                    let length = (0..3).map(|k| (p[k] - q[k]) * (p[k] - q[k])).sum();
                    if longest.as_ref().is_none_or(|longest| length > longest.length) {
                        longest = Some(Shared { other, i, j, length });
                    }
                }
            }
        }
        longest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_of_a_face_are_paired_across_the_longest_edge() {
        let [a, b, c, d] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.5], [0.0, 1.0, 0.5]];
        let e = [0.5, -0.5, 3.0];
        let mut block = TriangleBlock::<8>::EMPTY;
        // The first shares an edge with all others: the third way round, the longest with the last.
        for (lane, vertices) in
            [[b, c, a], [c, b, e], [b, a, e], [d, a, c], [a, b, c]].into_iter().enumerate()
        {
            block.set(lane, vertices);
        }
        let pairs = block.pair_up(5);
        assert_eq!((0..8).map(|lane| pairs.of(lane)).collect::<Vec<_>>(), [3, 2, 1, 0, 4, 5, 6, 7]);
        let at = |lane| [0, 1, 2].map(|vertex| block.at(lane, vertex).map(f64::from));
        assert_eq!((at(0), at(3)), ([a, b, c], [a, c, d]));
        assert_eq!((at(1), at(2)), ([e, c, b], [e, b, a]));
        let mut empty = TriangleBlock::<16>::EMPTY;
        assert_eq!(empty.pair_up(0), Pairs::NONE);
    }
}
