//! Vectors as columns.

use glam::DVec3;
use rayset_simd::{Backend, Kernel, LaneMask, Lanes, MAX_LANES, Part, Simd};

use crate::ray::{UNIT_RANGE, unit};

/// Vectors in columns, to be scaled to unit length several at a time.
///
/// ```
/// use rayset_geometry::{VectorColumns, glam::DVec3};
///
/// let mut vectors = VectorColumns::default();
/// vectors.push(DVec3::new(3.0, 0.0, -4.0));
/// vectors.push(DVec3::ZERO);
/// vectors.normalize();
/// assert_eq!((vectors.get(0), vectors.length(0)), (DVec3::new(0.6, 0.0, -0.8), 5.0));
/// assert_eq!(vectors.get(1), DVec3::ZERO);
/// ```
#[derive(Clone, Debug, Default)]
pub struct VectorColumns {
    columns: [Vec<f64>; 3],
    lengths: Vec<f64>,
}

impl VectorColumns {
    /// How many vectors there are.
    #[must_use]
    #[inline]
    pub fn len(&self) -> usize {
        self.columns[0].len()
    }

    /// Whether there is none.
    #[must_use]
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Removes all vectors and keeps the memory.
    pub fn clear(&mut self) {
        self.columns.iter_mut().for_each(Vec::clear);
        self.lengths.clear();
    }

    /// Adds a vector.
    #[inline]
    pub fn push(&mut self, vector: DVec3) {
        for (column, coordinate) in self.columns.iter_mut().zip(vector.to_array()) {
            column.push(coordinate);
        }
    }

    /// Adds vectors, without asking for each whether there is room.
    #[inline]
    pub fn extend(&mut self, vectors: impl ExactSizeIterator<Item = DVec3>) {
        let (first, len) = (self.len(), self.len() + vectors.len());
        let [xs, ys, zs] = self.columns.each_mut().map(|column| {
            column.resize(len, 0.0);
            &mut column[first..]
        });
        for (((x, y), z), vector) in xs.iter_mut().zip(ys).zip(zs).zip(vectors) {
            (*x, *y, *z) = vector.into();
        }
    }

    /// A vector.
    ///
    /// # Panics
    ///
    /// If there is no such vector.
    #[must_use]
    #[inline]
    pub fn get(&self, i: usize) -> DVec3 {
        let [x, y, z] = &self.columns;
        DVec3::new(x[i], y[i], z[i])
    }

    /// How long the vectors were before [`VectorColumns::normalize`]; none if it was not called.
    #[must_use]
    #[inline]
    pub fn lengths(&self) -> &[f64] {
        &self.lengths
    }

    /// How long a vector was before [`VectorColumns::normalize`].
    ///
    /// # Panics
    ///
    /// If there was no such vector then.
    #[must_use]
    #[inline]
    pub fn length(&self, i: usize) -> f64 {
        self.lengths[i]
    }

    /// Scales every vector to unit length, with the bits of [`unit`](crate::unit()); what has no direction becomes zero.
    pub fn normalize(&mut self) {
        self.normalize_on(Backend::active());
    }

    /// Scales every vector to unit length, on the lanes of a backend; the bits are the same.
    pub fn normalize_on(&mut self, backend: Backend) {
        let len = self.len();
        if len == 0 {
            return;
        }
        let padded = len.next_multiple_of(MAX_LANES);
        self.columns.iter_mut().chain([&mut self.lengths]).for_each(|column| column.resize(padded, 1.0));
        backend.run(Normalize { vectors: self });
        self.columns.iter_mut().chain([&mut self.lengths]).for_each(|column| column.truncate(len));
    }
}

struct Normalize<'a> {
    vectors: &'a mut VectorColumns,
}

impl Kernel for Normalize<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let VectorColumns { columns: [xs, ys, zs], lengths } = self.vectors;
        let n = S::F64::LANES;
        for (((xs, ys), zs), lengths) in xs
            .chunks_exact_mut(n)
            .zip(ys.chunks_exact_mut(n))
            .zip(zs.chunks_exact_mut(n))
            .zip(lengths.chunks_exact_mut(n))
        {
            let ([x, y, z], length) =
                unit_lanes(simd, [simd.load_f64(xs), simd.load_f64(ys), simd.load_f64(zs)]);
            length.store(lengths);
            x.store(xs);
            y.store(ys);
            z.store(zs);
        }
    }
}

/// Vectors scaled to unit length, one a lane, with the bits of [`unit`](crate::unit()), and how long they were; what has
/// no direction becomes zero.
#[must_use]
#[inline(always)]
pub fn unit_lanes<S: Simd>(simd: S, [x, y, z]: [S::F64; 3]) -> ([S::F64; 3], S::F64) {
    let (least, most) = (simd.splat_f64(UNIT_RANGE.start), simd.splat_f64(UNIT_RANGE.end));
    let squared = x * x + y * y + z * z;
    let length = squared.sqrt();
    let scaled = [x / length, y / length, z / length];
    let others = !(squared.ge(least) & squared.lt(most));
    if others.any() {
        return (simd.outline(UnitOneByOne { vectors: [x, y, z], scaled, others: others.bits() }), length);
    }
    (scaled, length)
}

/// Scales those of some lanes one by one.
struct UnitOneByOne<S: Simd> {
    vectors: [S::F64; 3],
    scaled: [S::F64; 3],
    others: u32,
}

impl<S: Simd> Part<S> for UnitOneByOne<S> {
    type Output = [S::F64; 3];

    #[inline(always)]
    fn run(self, simd: S) -> [S::F64; 3] {
        let Self { vectors: [x, y, z], scaled, mut others } = self;
        let mut stored = [[0.0; MAX_LANES]; 3];
        for (lanes, stored) in scaled.into_iter().zip(&mut stored) {
            lanes.store(stored);
        }
        while others != 0 {
            let i = others.trailing_zeros() as usize;
            others &= others - 1;
            let vector = unit(DVec3::new(x.lane(i), y.lane(i), z.lane(i))).unwrap_or(DVec3::ZERO);
            for (stored, coordinate) in stored.iter_mut().zip(vector.to_array()) {
                stored[i] = coordinate;
            }
        }
        [simd.load_f64(&stored[0]), simd.load_f64(&stored[1]), simd.load_f64(&stored[2])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_have_the_bits_of_one_vector_at_a_time_on_every_backend() {
        let mut all = Vec::new();
        for scale in [1.0, 1e-3, 1e-99, 1e-100, 1e-101, 1e99, 1e100, 1e101, 1e-308, 5e-324, 1e307] {
            for i in 0..7_i32 {
                let i = f64::from(i);
                all.push(scale * DVec3::new(0.3 - i, i / 7.0, 1.0 / (i + 0.1)));
            }
        }
        let nowhere = [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY, DVec3::new(1.0, f64::NEG_INFINITY, 0.0)];
        all.extend(nowhere);
        for &backend in Backend::available() {
            for n in 0..all.len() {
                let mut columns = VectorColumns::default();
                // One, and all others at once.
                all[n..].iter().take(1).for_each(|&vector| columns.push(vector));
                columns.extend(all[n..].iter().skip(1).copied());
                assert!(columns.lengths().is_empty());
                columns.normalize_on(backend);
                assert_eq!(columns.len(), all.len() - n);
                for (i, vector) in all[n..].iter().enumerate() {
                    let expected = unit(*vector).unwrap_or(DVec3::ZERO);
                    let bits = |v: DVec3| v.to_array().map(f64::to_bits);
                    assert_eq!(bits(columns.get(i)), bits(expected), "{backend}, {vector}");
                    let (length, expected) = (columns.length(i), vector.length());
                    assert!(length.to_bits() == expected.to_bits() || length.is_nan() && expected.is_nan());
                }
            }
        }
    }
}
