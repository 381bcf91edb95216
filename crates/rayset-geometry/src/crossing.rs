//! Where edges cross the x axis of sheared space, and the depth of the ray between two crossings.

use std::cmp::Ordering;

use crate::compare_products;

/// A point of the x axis of sheared space (see [`crate::Shear`]), with its distance along the ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossing {
    pub(crate) x: f64,
    pub(crate) depth: f64,
}

/// The crossings nearest to the ray on either side of it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Crossings {
    left: Option<Crossing>,
    right: Option<Crossing>,
}

impl Crossing {
    /// Keeps the crossing nearest to the ray; of equally near ones the one of least depth.
    #[inline(always)]
    fn keep(nearest: &mut Option<Self>, candidate: Self) {
        let key = |crossing: &Self| (crossing.x.abs(), crossing.depth);
        if nearest.as_ref().is_none_or(|nearest| key(&candidate) < key(nearest)) {
            *nearest = Some(candidate);
        }
    }
}

impl Crossings {
    /// Adds a crossing that exact comparison has found on the left, or on the ray; its rounded x counts as no farther
    /// right than that.
    #[inline(always)]
    pub(crate) fn add_left(&mut self, crossing: Crossing) {
        Crossing::keep(&mut self.left, Crossing { x: crossing.x.min(0.0), ..crossing });
    }

    /// Adds a crossing on the right, or on the ray.
    #[inline(always)]
    pub(crate) fn add_right(&mut self, crossing: Crossing) {
        Crossing::keep(&mut self.right, Crossing { x: crossing.x.max(0.0), ..crossing });
    }

    /// The distance at which the ray passes between the nearest crossings; `None` if there is none on one side.
    ///
    /// The distance lies between those of the two crossings. However badly the interpolation is conditioned, the
    /// point of the ray is as near to the segment between them as the crossings are accurate: an error in the
    /// fraction moves the point along the segment, which matters only by the error in x that caused it.
    #[inline(always)]
    pub(crate) fn depth_of_ray(&self) -> Option<f64> {
        let (left, right) = (self.left?, self.right?);
        let width = right.x - left.x;
        let fraction = if width > 0.0 { -left.x / width } else { 0.0 };
        let depth = left.depth + fraction * (right.depth - left.depth);
        Some(depth.max(left.depth.min(right.depth)).min(left.depth.max(right.depth)))
    }

    /// The distance at which the ray passes a triangle in sheared space that it is known to hit, on an edge or not.
    ///
    /// A vertex is sheared x, y and the distance along the ray. `None` only if the ray misses.
    pub(crate) fn depth_in_triangle(vertices: [[f64; 3]; 3]) -> Option<f64> {
        let mut crossings = Self::default();
        let mut add = |crossing, side: Ordering| {
            if side.is_le() {
                crossings.add_left(crossing);
            }
            if side.is_ge() {
                crossings.add_right(crossing);
            }
        };
        for i in 0..3 {
            let ([px, py, pz], [qx, qy, qz]) = (vertices[i], vertices[(i + 1) % 3]);
            let rise = qy - py;
            if (py > 0.0 && qy > 0.0) || (py < 0.0 && qy < 0.0) {
                continue;
            }
            if rise.abs() > 0.0 {
                let fraction = -py / rise;
                let side = match compare_products(px, qy, py, qx) {
                    order if rise > 0.0 => order,
                    order => order.reverse(),
                };
                let (x, depth) = (between(px, qx, fraction), between(pz, qz, fraction));
                add(Crossing { x, depth }, side);
            } else {
                // The edge lies on the x axis.
                add(Crossing { x: px, depth: pz }, side_of(px));
                add(Crossing { x: qx, depth: qz }, side_of(qx));
            }
        }
        crossings.depth_of_ray()
    }
}

/// The sign of a number; both zeros are the ray itself.
fn side_of(x: f64) -> Ordering {
    x.partial_cmp(&0.0).unwrap_or(Ordering::Equal)
}

/// The value a fraction of the way from `p` to `q`, never beyond them.
fn between(p: f64, q: f64, fraction: f64) -> f64 {
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
