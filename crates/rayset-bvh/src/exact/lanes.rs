//! Rays of columns, a lane each, as the exact tests want them.

use rayset_geometry::{AxesLanes, AxesOrder, RayLanes, ShearedLanes, Triangle};
use rayset_simd::{Lanes, Simd};

use crate::columns::RayColumns;

/// Rays of columns, a lane each, and where their spans start and end.
pub(super) struct LanesOfColumns<S: Simd> {
    pub(super) rays: RayLanes<S>,
    pub(super) span: [S::F64; 2],
}

impl RayColumns<'_> {
    /// The rays from one on, of which there are as many as there are lanes.
    #[inline(always)]
    pub(super) fn lanes<S: Simd>(&self, simd: S, at: usize) -> LanesOfColumns<S> {
        let zero = simd.splat_f64(0.0);
        let mut rays = RayLanes { origin: [zero; 3], direction: [zero; 3] };
        for k in 0..3 {
            rays.origin[k] = simd.load_f64(&self.origins[k][at..]);
            rays.direction[k] = simd.load_f64(&self.directions[k][at..]);
        }
        // A ray is a half-line.
        let start = simd.load_f64(&self.spans.0[at..]).max(zero);
        LanesOfColumns { rays, span: [start, simd.load_f64(&self.spans.1[at..])] }
    }
}

/// The vertices of a triangle, in every lane, for rays that want their coordinates in some order.
#[inline(always)]
pub(super) fn in_order<S: Simd>(simd: S, order: &AxesOrder<S>, triangle: &Triangle) -> [[S::F64; 3]; 3] {
    match order {
        AxesOrder::Common(axes) => triangle.splat(simd, *axes),
        AxesOrder::Own(axes) => axes.order_all(triangle.splat(simd, WORLD)),
    }
}

/// The world's axes, in their order.
const WORLD: [usize; 3] = [0, 1, 2];

impl RayColumns<'_> {
    /// The same sheared, and the order of their axes: most often all have the same.
    #[inline(always)]
    pub(super) fn sheared<S: Simd>(&self, simd: S, at: usize) -> (ShearedLanes<S>, AxesOrder<S>) {
        let LanesOfColumns { rays: RayLanes { origin, direction }, span } = self.lanes(simd, at);
        let axes = AxesLanes::of(simd, &direction);
        let rays = RayLanes { origin: axes.order(origin), direction: axes.order(direction) };
        (ShearedLanes::of(simd, rays, span), AxesOrder::of(axes))
    }
}
