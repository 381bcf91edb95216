//! Where edges cross the x axis of sheared space, and the depth of the ray between two crossings.

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
    #[inline(always)]
    pub(crate) fn add_left(&mut self, crossing: Crossing) {
        Crossing::keep(&mut self.left, crossing);
    }

    #[inline(always)]
    pub(crate) fn add_right(&mut self, crossing: Crossing) {
        Crossing::keep(&mut self.right, crossing);
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
        let mut add = |crossing: Crossing| {
            if crossing.x <= 0.0 {
                crossings.add_left(crossing);
            }
            if crossing.x >= 0.0 {
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
                let depth = pz - py / rise * (qz - pz);
                let depth = depth.max(pz.min(qz)).min(pz.max(qz));
                add(Crossing { x: (px * qy - py * qx) / rise, depth });
            } else {
                // The edge lies on the x axis.
                add(Crossing { x: px, depth: pz });
                add(Crossing { x: qx, depth: qz });
            }
        }
        crossings.depth_of_ray()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert!((depth - 10.0).abs() < 1e-15, "{depth}");
    }
}
