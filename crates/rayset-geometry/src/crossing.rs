//! Where edges cross the x axis of sheared space, and the depth of the ray between two crossings.

use std::cmp::Ordering;

use rayset_simd::{LaneMask, Lanes};

use crate::compare_products;

/// Points of the x axis of sheared space (see [`crate::Shear`]), a lane each, with their distances along the rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossing<L> {
    pub(crate) x: L,
    pub(crate) depth: L,
}

/// Edges that cross the x axis of sheared space, a lane each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossed<L> {
    /// By how much y grows.
    pub(crate) rise: L,
    /// Its sign, and that of the rise, tell on which side of the ray; zero where rounding leaves it in doubt.
    pub(crate) numerator: L,
    pub(crate) at: Crossing<L>,
}

impl<L: Lanes<Scalar = f64>> Crossed<L> {
    /// The edges from `p` to `q`, which are sheared x, y and the distance along the ray.
    #[inline(always)]
    pub(crate) fn of([px, py, pz]: [L; 3], [qx, qy, qz]: [L; 3]) -> Self {
        let rise = qy - py;
        let fraction = -py / rise;
        // x is no quotient of the numerator, which may have lost its digits to underflow.
        let at = Crossing { x: between(fraction, px, qx), depth: between(fraction, pz, qz) };
        Self { rise, numerator: px * qy - py * qx, at }
    }
}

/// The crossings nearest to rays, a lane each, on either side of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossings<L> {
    left: Crossing<L>,
    right: Crossing<L>,
}

impl<L: Lanes<Scalar = f64>> Crossing<L> {
    /// Keeps the crossing nearest to the ray, where one is given; of equally near ones the one of least depth.
    #[inline(always)]
    fn keep(&mut self, given: L::Mask, candidate: Self) {
        let (x, nearest) = (candidate.x.abs(), self.x.abs());
        let is_nearer = x.lt(nearest) | (x.eq(nearest) & candidate.depth.lt(self.depth));
        let is_kept = given & is_nearer;
        if !is_kept.any() {
            return;
        }
        self.x = candidate.x.select(is_kept, self.x);
        self.depth = candidate.depth.select(is_kept, self.depth);
    }
}

impl<L: Lanes<Scalar = f64>> Crossings<L> {
    /// None yet; `far` is infinite.
    #[inline(always)]
    pub(crate) fn none(far: L) -> Self {
        let none = Crossing { x: far, depth: far };
        Self { left: none, right: none }
    }

    /// Adds crossings that exact comparison has found on the left, or on the ray, where they are given; their rounded x
    /// counts as no farther right than that.
    #[inline(always)]
    pub(crate) fn add_left(&mut self, given: L::Mask, crossing: Crossing<L>, zero: L) {
        self.left.keep(given, Crossing { x: crossing.x.min(zero), ..crossing });
    }

    /// Adds crossings on the right, or on the ray.
    #[inline(always)]
    pub(crate) fn add_right(&mut self, given: L::Mask, crossing: Crossing<L>, zero: L) {
        self.right.keep(given, Crossing { x: crossing.x.max(zero), ..crossing });
    }

    /// The distance at which the ray passes between the nearest crossings, of which there is one on either side.
    ///
    /// The distance lies between those of the two crossings. However badly the interpolation is conditioned, the
    /// point of the ray is as near to the segment between them as the crossings are accurate: an error in the
    /// fraction moves the point along the segment, which matters only by the error in x that caused it.
    #[inline(always)]
    pub(crate) fn depth_of_ray(&self, zero: L) -> L {
        let Self { left, right } = *self;
        let width = right.x - left.x;
        let fraction = (-left.x / width).select(width.gt(zero), zero);
        between(fraction, left.depth, right.depth)
    }
}

impl Crossings<f64> {
    /// The distance at which the ray passes a triangle in sheared space that it is known to hit, on an edge or not.
    ///
    /// A vertex is sheared x, y and the distance along the ray. `None` only if the ray misses.
    pub(crate) fn depth_in_triangle(vertices: [[f64; 3]; 3]) -> Option<f64> {
        let mut crossings = Self::none(f64::INFINITY);
        let (mut is_left, mut is_right) = (false, false);
        let mut add = |crossing, side: Ordering| {
            crossings.add_left(side.is_le(), crossing, 0.0);
            crossings.add_right(side.is_ge(), crossing, 0.0);
            is_left |= side.is_le();
            is_right |= side.is_ge();
        };
        for i in 0..3 {
            let ([px, py, pz], [qx, qy, qz]) = (vertices[i], vertices[(i + 1) % 3]);
            let rise = qy - py;
            if (py > 0.0 && qy > 0.0) || (py < 0.0 && qy < 0.0) {
                continue;
            }
            if rise.abs() > 0.0 {
                let side = match compare_products(px, qy, py, qx) {
                    order if rise > 0.0 => order,
                    order => order.reverse(),
                };
                add(Crossed::of(vertices[i], vertices[(i + 1) % 3]).at, side);
            } else {
                // The edge lies on the x axis.
                add(Crossing { x: px, depth: pz }, side_of(px));
                add(Crossing { x: qx, depth: qz }, side_of(qx));
            }
        }
        (is_left && is_right).then(|| crossings.depth_of_ray(0.0))
    }
}

/// The sign of a number; both zeros are the ray itself.
fn side_of(x: f64) -> Ordering {
    x.partial_cmp(&0.0).unwrap_or(Ordering::Equal)
}

/// A fraction of the way from `p` to `q`; where rounding leads beyond the ends, the clamp keeps the bound exact.
#[inline(always)]
fn between<L: Lanes>(fraction: L, p: L, q: L) -> L {
    (p + fraction * (q - p)).max(p.min(q)).min(p.max(q))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn depth_is_interpolated_between_the_crossings() {
        let upright = [[-1.0, -1.0, 2.0], [3.0, -1.0, 6.0], [-1.0, 3.0, 2.0]];
        assert_eq!(Crossings::depth_in_triangle(upright), Some(3.0));
    }

    #[test]
    fn ray_through_an_edge_or_a_vertex_has_a_depth() {
        let on_edge = [[-1.0, 0.0, 2.0], [1.0, 0.0, 4.0], [0.0, 1.0, 9.0]];
        assert_eq!(Crossings::depth_in_triangle(on_edge), Some(3.0));
        let on_vertex = [[0.0, 0.0, 2.0], [1.0, 1.0, 4.0], [-1.0, 1.0, 9.0]];
        assert_eq!(Crossings::depth_in_triangle(on_vertex), Some(2.0));
    }

    #[test]
    fn sliver_gives_a_depth_of_its_own_there() {
        // Seen edge-on, up to rounding: a line of depth 10 + x.
        let sliver = [[-1.0, 1e-17, 9.0], [1.0, -1e-17, 11.0], [4.0, 0.0, 14.0]];
        let depth = Crossings::depth_in_triangle(sliver).unwrap();
        assert_abs_diff_eq!(depth, 10.0, epsilon = 1e-15);
    }
}
