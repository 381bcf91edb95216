//! Numbers and vectors of sixteen rows, in lanes.

use rayset_geometry::glam::DVec3;
use rayset_simd::{Lanes, MAX_LANES, Simd};

/// How many rows a block holds.
pub(crate) const ROWS: usize = MAX_LANES;

/// A number a row.
pub(crate) type Numbers = [f64; ROWS];

/// The x, y and z of a vector a row.
pub(crate) type Vectors = [Numbers; 3];

/// The block that holds a row, and the row's place in it.
#[inline(always)]
pub(crate) fn place(row: usize) -> (usize, usize) {
    (row / ROWS, row % ROWS)
}

/// How many blocks hold so many rows.
#[inline(always)]
pub(crate) fn n_blocks(rows: usize) -> usize {
    rows.div_ceil(ROWS)
}

/// The vector of a row of a block.
#[inline(always)]
pub(crate) fn vector([x, y, z]: &Vectors, row: usize) -> DVec3 {
    DVec3::new(x[row], y[row], z[row])
}

/// Writes the vector of a row of a block.
#[inline(always)]
pub(crate) fn put([xs, ys, zs]: &mut Vectors, row: usize, vector: DVec3) {
    (xs[row], ys[row], zs[row]) = vector.into();
}

/// Makes a column at least so long; none shrinks.
#[inline(always)]
pub(crate) fn lengthen<T: Clone>(column: &mut Vec<T>, n: usize, value: T) {
    if column.len() < n {
        column.resize(n, value);
    }
}

/// The vectors of columns, which have room for lanes beyond, from a row on.
#[inline(always)]
pub(crate) fn column3<S: Simd>(simd: S, [x, y, z]: &[Vec<f64>; 3], row: usize) -> [S::F64; 3] {
    [simd.load_f64(&x[row..]), simd.load_f64(&y[row..]), simd.load_f64(&z[row..])]
}

/// The numbers of a block from a row on.
#[inline(always)]
pub(crate) fn load<S: Simd>(simd: S, numbers: &Numbers, row: usize) -> S::F64 {
    simd.load_f64(&numbers[row..row + S::F64::LANES])
}

/// The vectors of a block from a row on.
#[inline(always)]
pub(crate) fn load3<S: Simd>(simd: S, [x, y, z]: &Vectors, row: usize) -> [S::F64; 3] {
    [load(simd, x, row), load(simd, y, row), load(simd, z, row)]
}

/// Writes numbers of a block from a row on.
#[inline(always)]
pub(crate) fn store<S: Simd>(lanes: S::F64, numbers: &mut Numbers, row: usize) {
    lanes.store(&mut numbers[row..row + S::F64::LANES]);
}

/// Writes vectors of a block from a row on.
#[inline(always)]
pub(crate) fn store3<S: Simd>([x, y, z]: [S::F64; 3], [xs, ys, zs]: &mut Vectors, row: usize) {
    store::<S>(x, xs, row);
    store::<S>(y, ys, row);
    store::<S>(z, zs, row);
}

/// `a` in the lanes of a mask, `b` in the others.
#[inline(always)]
pub(crate) fn select<S: Simd>(mask: <S::F64 as Lanes>::Mask, a: [S::F64; 3], b: [S::F64; 3]) -> [S::F64; 3] {
    [a[0].select(mask, b[0]), a[1].select(mask, b[1]), a[2].select(mask, b[2])]
}

/// The same vector in every lane.
#[inline(always)]
pub(crate) fn splat3<S: Simd>(simd: S, vector: DVec3) -> [S::F64; 3] {
    [simd.splat_f64(vector.x), simd.splat_f64(vector.y), simd.splat_f64(vector.z)]
}

/// The lanes of one number after the other, each as bits: mostly all have the same.
pub(crate) struct Alike<'a> {
    numbers: &'a [u32],
    rest: u32,
}

/// Goes through some lanes of numbers, those of one number after the other.
#[inline(always)]
pub(crate) fn alike(numbers: &[u32], lanes: u32) -> Alike<'_> {
    Alike { numbers, rest: lanes }
}

impl Iterator for Alike<'_> {
    type Item = (u32, u32);

    #[inline(always)]
    fn next(&mut self) -> Option<(u32, u32)> {
        if self.rest == 0 {
            return None;
        }
        let number = *self.numbers.get(self.rest.trailing_zeros() as usize)?;
        let lanes = lanes_where(self.numbers, |other| other == number);
        self.rest &= !lanes;
        Some((number, lanes))
    }
}

/// The lanes for whose number something holds, as bits.
#[inline(always)]
pub(crate) fn lanes_where(numbers: &[u32], holds: impl Fn(u32) -> bool) -> u32 {
    numbers.iter().enumerate().fold(0, |bits, (lane, &number)| bits | u32::from(holds(number)) << lane)
}
