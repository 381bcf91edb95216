//! The rays that leave the hits of a level, gathered into columns of their own.

use std::ops::Range;

use rayset_geometry::Side;
use rayset_scene::LightId;
use rayset_simd::{Kernel, LaneMask, Lanes, MAX_LANES, Simd};

use crate::intersection_tree::{Level, Run};
use crate::lanes::{Numbers, ROWS, Vectors, load, load3, n_blocks, place};
use crate::lights::LEAST_COSINE;
use crate::spawning::{LEAST_WEIGHT, Spawning};
use crate::{Generation, Originating, ShadowGeneration, Slot};

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
        make_room(rays, rows, n_facing);
        let mut n = 0;
        for Run { slot, rows: of_slot } in &level.runs {
            for light in 0..level.n_lights {
                let of_block = |block: usize| {
                    let seen = &level.lights[block * level.n_lights + light];
                    Leaving {
                        numbers: &seen.cosines,
                        directions: &seen.directions,
                        distances: Some(&seen.distances),
                    }
                };
                let end = gather(simd, level, of_slot.clone(), LEAST_COSINE, of_block, rays, rows, n);
                rays.slots.resize(end, *slot);
                let light = LightId(u32::try_from(light).expect("fewer than 2^32 lights"));
                shadow.lights.resize(end, light);
                n = end;
            }
        }
        finish(rays, rows, level, n, |_, side| side);
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
        let Self { level, n_sent, next: Level { rays, runs, weights, parents, .. } } = self;
        make_room(rays, parents, n_sent);
        let mut n = 0;
        for Run { slot, rows } in &level.runs {
            for is_refracted in [false, true] {
                let of_block = |block: usize| {
                    let sent: &Spawning = &level.spawning[block];
                    let directions = if is_refracted { &sent.refracted } else { &sent.reflected };
                    Leaving { numbers: sent.weights(is_refracted), directions, distances: None }
                };
                let end = gather(simd, level, rows.clone(), LEAST_WEIGHT, of_block, rays, parents, n);
                if end == n {
                    continue;
                }
                let slot = if is_refracted { slot.refracted() } else { slot.reflected() };
                rays.slots.resize(end, slot);
                weights.extend(parents[n..end].iter().map(|&row| {
                    let (block, row) = place(row as usize);
                    of_block(block).numbers[row]
                }));
                runs.push(Run { slot, rows: n..end });
                n = end;
            }
        }
        finish(rays, parents, level, n, |slot, side| if is_refracted(slot) { side.opposite() } else { side });
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
    /// How far away is what they are sent to, where they are: their spans end there.
    distances: Option<&'a Numbers>,
}

/// Gathers the rays that leave some rows, those whose number is at least `least`, into columns that have room for them, from
/// `n` on; returns where they end.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "a loop of its callers, written once")]
#[expect(clippy::cast_possible_truncation, reason = "a row of a block")]
fn gather<'a, S: Simd>(
    simd: S,
    level: &'a Level,
    rows: Range<usize>,
    least: f64,
    of_block: impl Fn(usize) -> Leaving<'a>,
    rays: &mut Generation,
    places: &mut [u32],
    mut n: usize,
) -> usize {
    let least = simd.splat_f64(least);
    for block in rows.start / ROWS..n_blocks(rows.end) {
        let Leaving { numbers, directions, distances } = of_block(block);
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
            if let Some(distances) = distances {
                (load(simd, distances, row) - start).compress(mask, &mut rays.ends[n..]);
            }
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

/// Makes room for so many rays and the rows that they leave, and for lanes beyond.
fn make_room(rays: &mut Generation, rows: &mut Vec<u32>, n: usize) {
    let [ox, oy, oz] = &mut rays.origins;
    let [dx, dy, dz] = &mut rays.directions;
    for column in [ox, oy, oz, dx, dy, dz, &mut rays.starts] {
        column.resize(n + MAX_LANES, 0.0);
    }
    rays.ends.resize(n + MAX_LANES, f64::INFINITY);
    rows.resize(n + MAX_LANES, 0);
}

/// Cuts the columns to the rays that were gathered, and fills those that need no lanes.
fn finish(
    rays: &mut Generation,
    rows: &mut Vec<u32>,
    level: &Level,
    n: usize,
    side: impl Fn(Slot, Side) -> Side,
) {
    let [ox, oy, oz] = &mut rays.origins;
    let [dx, dy, dz] = &mut rays.directions;
    for column in [ox, oy, oz, dx, dy, dz, &mut rays.starts, &mut rays.ends] {
        column.truncate(n);
    }
    rows.truncate(n);
    let ray_sets = level.rays.ray_sets();
    rays.ray_sets.extend(rows.iter().map(|&row| ray_sets[row as usize]));
    rays.originating.extend(rows.iter().zip(&rays.slots).map(|(&row, &slot)| {
        let from = level.originating(row as usize)?;
        Some(Originating { side: side(slot, from.side), ..from })
    }));
    rays.leaves_anything = n > 0;
}
