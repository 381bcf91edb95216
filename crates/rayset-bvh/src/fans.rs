//! Single-precision tests of polygons that have few vertices, each as a fan of triangles.
//!
//! The edges of a fan within the polygon are passed once in each direction: so a closed polygon winds round a point as
//! often as all triangles of its fan together, whether it is convex or not. A ray that passes all of them by misses the
//! polygon; one that surely hits a single one, and surely none of the others, hits it, since one is odd.
//! What is not sure is left to the `f64` test.

use rayset_geometry::glam::DVec3;
use rayset_simd::{LaneMask, Lanes, Simd};

use crate::interval::{Intervals, SpanLanes};
use crate::packet::Mask;
use crate::planes::{Plane, PlaneBlock};
use crate::ray::CullRay;
use crate::shear::Shearing;
use crate::triangles::{Sheared, Sides, TriangleBlock};

/// A polygon of more vertices is not tested as a fan: by its `f64` test alone it is as fast.
const MOST_VERTICES: usize = 8;

/// The fans of several polygons, a triangle a lane.
#[derive(Clone, Debug)]
pub(crate) struct FanBlock<const W: usize> {
    triangles: TriangleBlock<W>,
    /// The planes of the polygons that lanes are of.
    planes: PlaneBlock<W>,
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
    /// Those whose planes rise enough for distances to mean anything.
    steep: u32,
    /// Between which distances their polygons are hit, in culling space; anything, where [`Fans::steep`] says nothing.
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
        Self { triangles: TriangleBlock::EMPTY, planes: PlaneBlock::EMPTY, lanes: [0; W], owners: [0; W] };

    /// Adds a polygon, by its vertices in culling space and its normal, from a lane on; returns the lane after it.
    pub(crate) fn set(&mut self, first: usize, place: usize, points: &[DVec3], normal: DVec3) -> usize {
        let corner = |i: usize| points[i].to_array();
        let (plane, after) = (Plane::through(points, normal), first + points.len() - 2);
        for lane in first..after {
            let i = lane - first + 1;
            self.triangles.set(lane, [corner(0), corner(i), corner(i + 1)]);
            self.lanes[lane] = u16::try_from((1_u32 << after) - (1 << first)).expect("at most 16 lanes");
            self.planes.set(lane, &plane);
            self.owners[lane] = u8::try_from(place).expect("at most 16 polygons");
        }
        after
    }

    /// Tests a ray; `None` if it surely misses everything.
    #[inline(always)]
    pub(crate) fn test<S: Simd, const N: usize>(&self, simd: S, ray: CullRay<'_, N>) -> Option<Fans<W>> {
        let sheared = self.triangles.shear(simd, ray);
        let Sides { may_front, may_back, front, back, .. } = sheared.sides(simd, ray.rounding());
        let possible = (may_front | may_back).bits();
        if possible == 0 {
            return None;
        }
        let meeting = self.planes.load(simd, ray.axes).meet(simd, &ray.shears(simd), ray.rounding());
        let (mut lows, mut highs) = ([0.0; W], [0.0; W]);
        meeting.low.store(&mut lows);
        meeting.high.store(&mut highs);
        let steep = meeting.is_steep(simd).bits();
        Some(Fans { possible, front: front.bits(), back: back.bits(), steep, lows, highs })
    }

    /// Where rays, a lane each, hit the polygon at a place, which is `from` so far on, and whose front and back may be hit by
    /// some.
    #[inline(always)]
    pub(crate) fn all_intervals<S: Simd>(
        &self,
        simd: S,
        place: usize,
        rays: &impl Shearing<S>,
        (span, from): (&SpanLanes<S>, S::F32),
        (front, back): (Mask<S>, Mask<S>),
    ) -> Intervals<S> {
        let rounding = rays.rounding();
        // Rays for which one triangle is possible, for which several are, and for which one is sure.
        let none = simd.mask_f32(0);
        let (mut met, mut several, mut sure) = (none, none, none);
        let mut last = 0;
        for lane in 0..W {
            if self.lanes[lane] == 0 || usize::from(self.owners[lane]) != place {
                continue;
            }
            let [a, b, c] = self.triangles.vertices(lane);
            let sheared = Sheared::of([rays.shear(simd, a), rays.shear(simd, b), rays.shear(simd, c)]);
            let sides = sheared.sides(simd, rounding);
            let possible = sides.may_front | sides.may_back;
            several = several | (met & possible);
            met = met | possible;
            sure = sure | (sides.front & front) | (sides.back & back);
            last = lane;
        }
        let possible = met & (front | back);
        if !possible.any() {
            return Intervals::none(simd);
        }
        let meeting = self.planes.at(last).splat(simd, rays).meet(simd, rays.shears(), rounding);
        let steep = meeting.is_steep(simd);
        let (low, high) = (from.max(meeting.low.select(steep, from)), meeting.high);
        let possible = possible & (!steep | (low.le(span.ends) & high.ge(span.start)));
        let is_within = steep & low.gt(span.start_above) & high.lt(span.end_below);
        Intervals { possible, sure: sure & !several & is_within, low, high }
    }

    /// Takes a polygon that may be hit out of what is known.
    #[inline(always)]
    pub(crate) fn next(&self, fans: &mut Fans<W>) -> Option<Candidate> {
        if fans.possible == 0 {
            return None;
        }
        let first = fans.possible.trailing_zeros() as usize % W;
        let met = fans.possible & u32::from(self.lanes[first]);
        fans.possible &= !met;
        let (is_one, is_steep) = (met & (met - 1) == 0, fans.steep >> first & 1 == 1);
        let (low, high) = (fans.lows[first], fans.highs[first]);
        Some(Candidate {
            place: u32::from(self.owners[first]),
            is_front: is_one && fans.front & met != 0,
            is_back: is_one && fans.back & met != 0,
            low: if is_steep { low } else { f32::NEG_INFINITY },
            high: if is_steep { high } else { f32::INFINITY },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doubtful::{Aimed, tally_of};

    #[test]
    fn no_polygon_is_lost_and_no_sure_one_is_none() {
        for (backend, tally) in tally_of(&Aimed::at(4..=MOST_VERTICES)) {
            assert_eq!(tally.wrong(), [0; 3], "{backend}: {tally:?}");
            assert!(tally.hits > 5_000 && tally.sure > 1_000, "{backend}: {tally:?}");
        }
    }

    #[test]
    fn without_the_margins_polygons_are_lost() {
        for (backend, tally) in tally_of(&Aimed { factor: 0.0, ..Aimed::at(4..=MOST_VERTICES) }) {
            assert!(tally.wrong().iter().all(|&n| n > 0), "{backend}: {tally:?}");
        }
    }

    #[test]
    fn polygons_of_many_vertices_have_no_fan() {
        assert_eq!((fan_len(3, 16), fan_len(8, 8), fan_len(9, 16)), (Some(1), Some(6), None));
        assert_eq!(fan_len(8, 5), None);
    }
}
