//! The rays that leave the hits of a level, gathered into columns of their own.

use std::ops::Range;

use rayset_bvh::Left;
use rayset_scene::{LightId, ObjectId};
use rayset_simd::{Kernel, LaneMask, Lanes, MAX_LANES, Simd};

use crate::intersection_tree::{Level, Run};
use crate::lanes::{Numbers, ROWS, Vectors, lengthen, load, load3, n_blocks, place};
use crate::lights::{LEAST_COSINE, Seen};
use crate::spawning::{LEAST_WEIGHT, Spawning};
use crate::{Generation, Hit, ShadowGeneration, Slot};

/// The light rays of a level: slot by slot, and light by light.
pub(crate) struct LightRays<'a> {
    pub(crate) level: &'a Level,
    /// How many there are at most.
    pub(crate) n_facing: usize,
    pub(crate) shadow: &'a mut ShadowGeneration,
    /// The row whose hit each ray leaves.
    pub(crate) rows: &'a mut Vec<u32>,
}

impl Kernel for LightRays<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { level, n_facing, shadow, rows } = self;
        let rays = &mut shadow.rays;
        rays.make_room(n_facing);
        lengthen(rows, n_facing + MAX_LANES, 0);
        let mut n = 0;
        for Run { slot, rows: of_slot } in &level.runs {
            for light in 0..level.n_lights {
                let of_block = |block: usize| {
                    let seen = &level.lights[block * level.n_lights + light];
                    let Seen { cosines, directions, distances } = seen;
                    Leaving { numbers: cosines, directions, kept: Kept::UpTo(distances) }
                };
                let mut ends = std::mem::take(&mut rays.ends);
                let end =
                    gather(simd, level, of_slot.clone(), LEAST_COSINE, of_block, (rays, &mut ends), rows, n);
                rays.ends = ends;
                fill_in(rays, &rows[n..end], level, *slot, false);
                let light = LightId(u32::try_from(light).expect("fewer than 2^32 lights"));
                shadow.lights.resize(end, light);
                n = end;
            }
        }
    }
}

/// The reflected and refracted rays of a level: slot by slot, those that are reflected first.
pub(crate) struct Children<'a> {
    pub(crate) level: &'a Level,
    /// How many there are at most.
    pub(crate) n_sent: usize,
    pub(crate) next: &'a mut Level,
}

impl Kernel for Children<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { level, n_sent, next } = self;
        next.make_room(n_sent);
        let Level { rays, runs, weights, parents, .. } = next;
        lengthen(parents, n_sent + MAX_LANES, 0);
        let mut n = 0;
        for Run { slot, rows } in &level.runs {
            for is_refracted in [false, true] {
                let of_block = |block: usize| {
                    let sent: &Spawning = &level.spawning[block];
                    let directions = if is_refracted { &sent.refracted } else { &sent.reflected };
                    Leaving { numbers: sent.weights(is_refracted), directions, kept: Kept::Numbers }
                };
                let end =
                    gather(simd, level, rows.clone(), LEAST_WEIGHT, of_block, (rays, weights), parents, n);
                if end == n {
                    continue;
                }
                let slot = if is_refracted { slot.refracted() } else { slot.reflected() };
                fill_in(rays, &parents[n..end], level, slot, is_refracted);
                runs.push(Run { slot, rows: n..end });
                n = end;
            }
        }
        rays.ends[..n].fill(f64::INFINITY);
    }
}

/// Whether rays of a slot, which is not that of initial rays, were refracted.
#[inline(always)]
pub(crate) fn is_refracted(slot: Slot) -> bool {
    !slot.0.is_multiple_of(2)
}

/// Rays that leave the hits of a block of rows.
struct Leaving<'a> {
    /// A ray leaves where the number of its row is large enough.
    numbers: &'a Numbers,
    directions: &'a Vectors,
    kept: Kept<'a>,
}

/// What else is kept of rays that leave.
enum Kept<'a> {
    /// The numbers by which they do.
    Numbers,
    /// Where their spans end, by how far away it is what they are sent to.
    UpTo(&'a Numbers),
}

/// Gathers the rays that leave some rows, those whose number is at least `least`, and what else is kept of them, into columns
/// that have room for them, from `n` on; returns where they end.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "a loop of its callers, written once")]
#[expect(clippy::cast_possible_truncation, reason = "a row of a block")]
fn gather<'a, S: Simd>(
    simd: S,
    level: &'a Level,
    rows: Range<usize>,
    least: f64,
    of_block: impl Fn(usize) -> Leaving<'a>,
    (rays, kept): (&mut Generation, &mut [f64]),
    places: &mut [u32],
    mut n: usize,
) -> usize {
    let least = simd.splat_f64(least);
    for block in rows.start / ROWS..n_blocks(rows.end) {
        let Leaving { numbers, directions, kept: keeps } = of_block(block);
        let surfaces = &level.surfaces[block];
        let mut leaving = 0;
        for i in 0..ROWS / S::F64::LANES {
            let row = i * S::F64::LANES;
            leaving |= load(simd, numbers, row).ge(least).bits() << row;
        }
        leaving &= among(&rows, block);
        if leaving == 0 {
            continue;
        }
        let first = number(block * ROWS);
        let all: [u32; ROWS] = std::array::from_fn(|row| first + row as u32);
        let mut end = n;
        for i in 0..ROWS / S::F32::LANES {
            let row = i * S::F32::LANES;
            let lanes = leaving >> row & (u32::MAX >> (32 - S::F32::LANES));
            simd.compress_u32(simd.mask_f32(lanes), &all[row..], &mut places[end..]);
            end += lanes.count_ones() as usize;
        }
        for i in 0..ROWS / S::F64::LANES {
            let row = i * S::F64::LANES;
            let lanes = leaving >> row & (u32::MAX >> (32 - S::F64::LANES));
            if lanes == 0 {
                continue;
            }
            let mask = simd.mask_f64(lanes);
            let (point, direction) = (load3(simd, &surfaces.points, row), load3(simd, directions, row));
            let start = load(simd, &surfaces.starts, row);
            for k in 0..3 {
                point[k].compress(mask, &mut rays.origins[k][n..]);
                direction[k].compress(mask, &mut rays.directions[k][n..]);
            }
            start.compress(mask, &mut rays.starts[n..]);
            let number = match keeps {
                Kept::Numbers => load(simd, numbers, row),
                Kept::UpTo(distances) => load(simd, distances, row) - start,
            };
            number.compress(mask, &mut kept[n..]);
            n += lanes.count_ones() as usize;
        }
    }
    n
}

/// The rows of a block that are among some, which end in it or behind it, as bits.
#[inline(always)]
pub(crate) fn among(rows: &Range<usize>, block: usize) -> u32 {
    let first = block * ROWS;
    u32::MAX << rows.start.saturating_sub(first).min(ROWS) & !(u32::MAX << (rows.end - first).min(ROWS))
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "asserted")]
fn number(row: usize) -> u32 {
    assert!(row < u32::MAX as usize - ROWS, "a bundle holds fewer than 2^32 rays");
    row as u32
}

/// Fills in what needs no lanes, of the next rays of a slot: those that leave the hits in some rows, through the surface or to
/// the side that they came from.
fn fill_in(rays: &mut Generation, rows: &[u32], level: &Level, slot: Slot, is_refracted: bool) {
    rays.slots.resize(rays.slots.len() + rows.len(), slot);
    rays.leaves_anything |= !rows.is_empty();
    let (ray_sets, hits, surfaces) = (level.rays.ray_sets(), &level.answers.values[..], level.surfaces());
    rays.ray_sets.extend(rows.iter().map(|&row| ray_sets[row as usize]));
    let first = rays.left.len();
    rays.left.resize(first + rows.len(), Left::NOTHING);
    rays.left_objects.resize(first + rows.len(), ObjectId(0));
    let places = rays.left[first..].iter_mut().zip(&mut rays.left_objects[first..]);
    for ((left, left_object), &row) in places.zip(rows) {
        let Some(Hit { object, primitive, .. }) = hits[row as usize] else { continue };
        let (block, row) = place(row as usize);
        let side = surfaces[block].side(row);
        *left = Left::new(primitive.0, if is_refracted { side.opposite() } else { side });
        *left_object = object;
    }
}
