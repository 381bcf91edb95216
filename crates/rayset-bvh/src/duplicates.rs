//! Primitives that stand in one place, bit by bit.
//!
//! Of exact duplicates (the same kind, bits and sides) only the first two can be an answer. Let their numbers be
//! `d_0 < d_1 < d_2 ...`, and let a ray hit them at `t`. If the ray leaves none of them, `d_0` wins the tie. If it
//! leaves `d_0`, that may be hit later than `t` or not at all, and `d_1` wins. If it leaves `d_i` with `i >= 1`, that
//! is hit at `t' >= t` or not at all, since what a ray may hit of the primitive that it leaves is a part of what it
//! may hit of another; and `d_0` wins, by its distance or by its number. So all after the second are left out, and a
//! ray that leaves one of these leaves nothing. A million coincident primitives cost no more than two.
//!
//! Primitives that coincide up to a rounding are kept: each may be the nearest for some ray. No tree tells them
//! apart, so a ray that meets `m` of them tests `m`; the depth of the tree stays bounded (see [`crate::build`]).

use rayon::prelude::*;
use rayset_geometry::{PrimitiveColumns, PrimitiveKind, Sides};

/// Bits of the table a primitive: one primitive in so many is looked at twice though it has no duplicate.
const SLOTS: usize = 16;

/// The numbers of all primitives that are the third of their kind in one place, or a later one.
pub(crate) fn superfluous(columns: &PrimitiveColumns, items: &[(PrimitiveKind, u32, Sides)]) -> Vec<u32> {
    let hashes: Vec<u64> = items.par_iter().with_min_len(4096).map(|item| hash_of(columns, item)).collect();
    let mut candidates = in_company(&hashes);
    candidates.par_sort_unstable();
    let mut superfluous = Vec::new();
    for group in candidates.chunk_by(|a, b| a.0 == b.0) {
        // What has the hash of the first but not its bits is kept, which is always right.
        let first = &items[group[0].1 as usize];
        let same = group[1..].iter().map(|&(_, number)| number);
        let same = same.filter(|&number| is_same(columns, first, &items[number as usize]));
        superfluous.extend(same.skip(1));
    }
    superfluous
}

/// The hashes, with their numbers, that share a slot of a table with others.
fn in_company(hashes: &[u64]) -> Vec<(u64, u32)> {
    let n_bits = (SLOTS * hashes.len()).next_power_of_two().max(64);
    let (mut some, mut more) = (vec![0_u64; n_bits / 64], vec![0_u64; n_bits / 64]);
    let slot = |hash: u64| {
        let slot = usize::try_from(hash & (n_bits as u64 - 1)).expect("less than their number");
        (slot / 64, 1_u64 << (slot % 64))
    };
    for &hash in hashes {
        let (word, bit) = slot(hash);
        more[word] |= some[word] & bit;
        some[word] |= bit;
    }
    let numbered = hashes.iter().copied().zip(0..);
    numbered
        .filter(|&(hash, _)| {
            let (word, bit) = slot(hash);
            more[word] & bit != 0
        })
        .collect()
}

fn hash_of(columns: &PrimitiveColumns, &(kind, index, sides): &(PrimitiveKind, u32, Sides)) -> u64 {
    let start = 4 * kind as u64 + sides as u64 + 1;
    columns.bits(kind, index).fold(start, |hash, bits| {
        // A step of splitmix64.
        let mixed = (hash ^ bits).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (mixed ^ mixed >> 31).wrapping_add(0x9e37_79b9_7f4a_7c15)
    })
}

fn is_same(
    columns: &PrimitiveColumns,
    a: &(PrimitiveKind, u32, Sides),
    b: &(PrimitiveKind, u32, Sides),
) -> bool {
    (a.0, a.2) == (b.0, b.2) && columns.bits(a.0, a.1).eq(columns.bits(b.0, b.1))
}

#[cfg(test)]
mod tests {
    use rayset_geometry::glam::DVec3;
    use rayset_geometry::{Cone, Polygon, Primitive, Sphere, Triangle};

    use super::*;

    #[test]
    fn all_but_two_of_each_kind_and_visibility_are_superfluous() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let shapes: [Primitive; 6] = [
            Sphere::new(x, 1.0).into(),
            Sphere::new(x, 1.0_f64.next_up()).into(),
            Triangle::new(x, y, z).into(),
            Triangle::new(y, z, x).into(),
            Polygon::new(vec![x, y, z]).unwrap().into(),
            Cone::new(x, 1.0, y, 0.5).unwrap().into(),
        ];
        let mut columns = PrimitiveColumns::default();
        let mut items = Vec::new();
        for _ in 0..4 {
            for shape in &shapes {
                for sides in [Sides::Both, Sides::Front] {
                    let run = columns.push(shape, sides);
                    items.push((run.kind, run.range.start, sides));
                }
            }
        }
        let mut found = superfluous(&columns, &items);
        found.sort_unstable();
        assert_eq!(found, (24..48).collect::<Vec<_>>());
        assert_eq!(superfluous(&columns, &items[..24]), [0; 0]);
        assert_eq!(superfluous(&columns, &[]), [0; 0]);
    }
}
