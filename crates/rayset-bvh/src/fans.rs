//! Single-precision tests of polygons that have few vertices, each as a fan of triangles.
//!
//! The edges of a fan within the polygon are passed once in each direction: so a closed polygon winds round a point as
//! often as all triangles of its fan together, whether it is convex or not. A ray that passes all of them by misses the
//! polygon; one that surely hits a single one, and surely none of the others, hits it, since one is odd.
//! What is not sure is left to the `f64` test.

use rayset_geometry::glam::DVec3;
use rayset_simd::{LaneMask, Lanes, Simd};

use crate::frame::Frame;
use crate::interval::{DEPTH_MARGIN, Edges, LeafRay, TriangleBlock, VERTEX_MARGIN};

/// A polygon of more vertices is not tested as a fan: by its `f64` test alone it is as fast.
const MOST_VERTICES: usize = 8;

/// The fans of several polygons, a triangle a lane.
#[derive(Clone, Debug)]
pub(crate) struct FanBlock<const W: usize> {
    triangles: TriangleBlock<W>,
    /// The lanes of the polygon that a lane is of.
    lanes: [u16; W],
    /// Its place among the polygons of the block.
    owners: [u8; W],
}

/// What single precision knows of a ray and the polygons of a block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fans<const W: usize> {
    /// The lanes whose triangles may be hit.
    possible: u32,
    /// Those whose front, and whose back, must be.
    front: u32,
    back: u32,
    /// Between which distances their corners lie, in culling space.
    lows: [f32; W],
    highs: [f32; W],
}

/// A polygon that a ray may hit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// Its place among the polygons of the block.
    pub(crate) place: u32,
    /// Whether its front, or its back, is surely hit, if the distance counts.
    pub(crate) is_front: bool,
    pub(crate) is_back: bool,
    /// Between which distances a hit lies.
    pub(crate) low: f32,
    pub(crate) high: f32,
}

/// How many triangles the fan of a polygon with so many vertices has; `None` if it is not tested as a fan of up to
/// `lanes`.
pub(crate) fn fan_len(vertices: usize, lanes: usize) -> Option<usize> {
    let len = vertices.saturating_sub(2);
    (vertices <= MOST_VERTICES && len <= lanes).then_some(len)
}

impl<const W: usize> FanBlock<W> {
    pub(crate) const EMPTY: Self =
        Self { triangles: TriangleBlock::EMPTY, lanes: [0; W], owners: [0; W] };

    /// Adds a polygon from a lane on; returns the lane after it.
    pub(crate) fn set(&mut self, first: usize, place: usize, vertices: &[DVec3], frame: &Frame) -> usize {
        let corner = |i: usize| frame.point(vertices[i]).to_array();
        let after = first + vertices.len() - 2;
        for lane in first..after {
            let i = lane - first + 1;
            self.triangles.set(lane, [corner(0), corner(i), corner(i + 1)]);
            self.lanes[lane] = u16::try_from((1_u32 << after) - (1 << first)).expect("at most 16 lanes");
            self.owners[lane] = u8::try_from(place).expect("at most 16 polygons");
        }
        after
    }

    /// Tests a ray; `None` if it surely misses everything.
    #[inline(always)]
    pub(crate) fn test<S: Simd>(&self, ray: &LeafRay<S>) -> Option<Fans<W>> {
        let simd = ray.simd;
        let [a, b, c] =
            [self.triangles.vertex(ray, 0), self.triangles.vertex(ray, 3), self.triangles.vertex(ray, 6)];
        let edges = Edges::of(simd, [[a[0], a[1]], [b[0], b[1]], [c[0], c[1]]], VERTEX_MARGIN * ray.unit);
        let Edges { error, least, greatest, .. } = edges;
        let possible = (least.ge(-error) | greatest.le(error)).bits();
        if possible == 0 {
            return None;
        }
        let twice = error + error;
        let sz = simd.splat_f32(ray.factors[2]);
        let (a, b, c) = (sz * a[2], sz * b[2], sz * c[2]);
        let slack = simd.splat_f32(DEPTH_MARGIN * ray.unit);
        let (mut lows, mut highs) = ([0.0; W], [0.0; W]);
        (a.min(b).min(c) - slack).store(&mut lows);
        (a.max(b).max(c) + slack).store(&mut highs);
        let (front, back) = (least.gt(twice).bits(), greatest.lt(-twice).bits());
        Some(Fans { possible, front, back, lows, highs })
    }

    /// Takes a polygon that may be hit out of what is known.
    #[inline(always)]
    pub(crate) fn next(&self, fans: &mut Fans<W>) -> Option<Candidate> {
        if fans.possible == 0 {
            return None;
        }
        let first = fans.possible.trailing_zeros() as usize % W;
        let mut lanes = u32::from(self.lanes[first]);
        let met = fans.possible & lanes;
        fans.possible &= !lanes;
        let is_one = met & (met - 1) == 0;
        let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % W;
            lanes &= lanes - 1;
            low = low.min(fans.lows[lane]);
            high = high.max(fans.highs[lane]);
        }
        Some(Candidate {
            place: u32::from(self.owners[first]),
            is_front: is_one && fans.front & met != 0,
            is_back: is_one && fans.back & met != 0,
            low,
            high,
        })
    }
}
