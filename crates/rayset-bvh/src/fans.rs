//! Single-precision tests of polygons that have few vertices, each as a fan of triangles.
//!
//! The edges of a fan within the polygon are passed once in each direction: so a closed polygon winds round a point as
//! often as all triangles of its fan together, whether it is convex or not. A ray that passes all of them by misses the
//! polygon; one that surely hits a single one, and surely none of the others, hits it, since one is odd.
//! What is not sure is left to the `f64` test.

use rayset_geometry::glam::DVec3;
use rayset_simd::{LaneMask, Lanes, Simd};

use crate::frame::Frame;
use crate::interval::Intervals;
use crate::packet::Packet;
use crate::ray::CullRay;
use crate::shaft::Shaft;
use crate::triangles::{Sheared, Sides, TriangleBlock};

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
    pub(crate) const EMPTY: Self = Self { triangles: TriangleBlock::EMPTY, lanes: [0; W], owners: [0; W] };

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
    pub(crate) fn test<S: Simd, const N: usize>(&self, simd: S, ray: CullRay<'_, N>) -> Option<Fans<W>> {
        let sheared = self.triangles.shear(simd, ray);
        let Sides { may_front, may_back, front, back, .. } = sheared.sides(simd, ray.rounding());
        let possible = (may_front | may_back).bits();
        if possible == 0 {
            return None;
        }
        let [nearest, farthest] = sheared.within(&ray.shears(simd));
        let slack = ray.rounding().of_distances(simd, [nearest, farthest]);
        let (mut lows, mut highs) = ([0.0; W], [0.0; W]);
        (nearest - slack).store(&mut lows);
        (farthest + slack).store(&mut highs);
        Some(Fans { possible, front: front.bits(), back: back.bits(), lows, highs })
    }

    /// Where the rays of a packet, a lane each, hit the polygon at a place, whose front and back may be hit by some; spans
    /// are left to the caller.
    #[inline(always)]
    pub(crate) fn all_intervals<S: Simd>(
        &self,
        simd: S,
        place: usize,
        shaft: &Shaft<S>,
        packet: &Packet<S, W>,
        (front, back): (<S::F32 as Lanes>::Mask, <S::F32 as Lanes>::Mask),
    ) -> Intervals<S> {
        // Rays for which one triangle is possible, for which several are, and for which one is sure.
        let none = simd.mask_f32(0);
        let (mut met, mut several, mut sure) = (none, none, none);
        let (mut low, mut high) = (simd.splat_f32(f32::INFINITY), simd.splat_f32(f32::NEG_INFINITY));
        for lane in 0..W {
            if self.lanes[lane] == 0 || usize::from(self.owners[lane]) != place {
                continue;
            }
            let [a, b, c] = self.triangles.one(simd, lane, shaft.beam.axes);
            let vertices = [packet.shears.of(a), packet.shears.of(b), packet.shears.of(c)];
            let sheared = Sheared::of(vertices);
            let sides = sheared.sides(simd, shaft.rounding);
            let possible = sides.may_front | sides.may_back;
            several = several | (met & possible);
            met = met | possible;
            sure = sure | (sides.front & front) | (sides.back & back);
            let [nearest, farthest] = sheared.within(&packet.shears);
            low = low.min(nearest);
            high = high.max(farthest);
        }
        let slack = shaft.rounding.of_distances(simd, [low, high]);
        let possible = met & (front | back);
        Intervals { possible, sure: sure & !several, low: low - slack, high: high + slack }
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

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use rayset_geometry::{BoundingBox, Polygon, Primitive, Ray, Side, Sides, Span};
    use rayset_simd::{Backend, Kernel, Scalar};

    use super::*;
    use crate::columns::RayColumns;
    use crate::packet::{Approach, level};
    use crate::ray::{Copies, CullRays, Targets};

    /// How often the single-precision answer contradicts the exact one, and how often it is sure.
    #[derive(Debug, Default)]
    struct Tally {
        lost: u32,
        false_sure: u32,
        out_of_interval: u32,
        sure: u32,
        hits: u32,
    }

    struct Dice(ChaCha8Rng);

    impl Dice {
        fn within(&mut self, low: f64, high: f64) -> f64 {
            low + (high - low) * f64::from(self.0.next_u32()) / f64::from(u32::MAX)
        }
        fn point(&mut self) -> DVec3 {
            DVec3::from_array(std::array::from_fn(|_| self.within(-1.0, 1.0)))
        }
        fn pick<const N: usize>(&mut self, values: [f64; N]) -> f64 {
            values[self.0.next_u32() as usize % N]
        }
    }

    /// Rays aimed at the edges, outer ones and those of the fan, of polygons that are convex, concave, or cross
    /// themselves.
    struct Doubtful {
        /// By what the margins are multiplied.
        factor: f32,
    }

    impl Kernel for Doubtful {
        type Output = Tally;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Tally {
            let mut dice = Dice(ChaCha8Rng::seed_from_u64(7));
            let mut tally = Tally::default();
            for case in 0..60_000 {
                let (scale, shift) = (dice.pick([1.0, 0.3, 1e4]), dice.point() * dice.pick([0.0, 1.0, 1e3]));
                let place = |p: DVec3| scale * (p + shift);
                let frame = Frame::of(&BoundingBox { min: place(DVec3::NEG_ONE), max: place(DVec3::ONE) });
                let n = 4 + case % (MOST_VERTICES - 3);
                let size = 0.3 * dice.pick([1.0, 0.1, 1e-2]);
                let (center, mut x, mut y) = (0.6 * dice.point(), size * dice.point(), size * dice.point());
                if case % 7 == 0 {
                    // Seen from above or below, all its vertices have one depth.
                    (x.z, y.z) = (0.0, 0.0);
                }
                let mut angle = 0.0;
                let corners: Vec<DVec3> = (0..n)
                    .map(|_| {
                        angle += dice.within(0.0, 2.0);
                        let reach = if case % 2 == 0 { 1.0 } else { dice.within(0.1, 1.0) };
                        // As good a circle as any.
                        let (c, s) = (1.0 - angle * angle / 8.0, angle * (1.0 - angle / 6.0));
                        center + reach * (c * x + s * y)
                    })
                    .collect();
                let Some(polygon) = Polygon::new(corners.iter().map(|&corner| place(corner)).collect())
                else {
                    continue;
                };
                let pair = [dice.0.next_u32() as usize % n, dice.0.next_u32() as usize % n];
                let (p, q) = (corners[pair[0]], corners[if case % 3 == 0 { 0 } else { pair[1] }]);
                let offset = dice.pick([0.0, 1e-8, -1e-8, 1e-7, -1e-7, 1e-6, 1e-3, 0.1]);
                let target = p + dice.within(0.0, 1.0) * (q - p) + offset * (center - p);
                let far = dice.pick([1.0, 3.0, 50.0]) * dice.point();
                // From nearby, where coordinates are long beside distances.
                let eye = if case % 7 == 0 { target + 1e-2 * (DVec3::Z + 0.5 * dice.point()) } else { far };
                let Some(ray) = Ray::between(place(eye), place(target)) else { continue };
                let copies = Copies::<8>::of(&ray, Span::FORWARD);
                let mut rays = CullRays::<8>::alone(Scalar, &frame, &copies.columns(), Targets::FLAT);
                rays.loosen(self.factor);
                let Some(cull) = rays.ray(0) else { continue };
                let vertices = polygon.vertices();
                let found = if S::F32::LANES == 16 {
                    candidate::<S, 16>(simd, cull, vertices, &frame)
                } else {
                    candidate::<S, 8>(simd, cull, vertices, &frame)
                };
                let primitive = Primitive::from(polygon.clone());
                let hit = |sides| primitive.intersect(&ray, Span::FORWARD, sides, None);
                let exact = hit(Sides::Both);
                tally.hits += u32::from(exact.is_some());
                for (sides, exact) in [(Sides::Both, exact), (Sides::Front, hit(Sides::Front))] {
                    if S::F32::LANES == 16 {
                        tally.together::<S, 16>(simd, &ray, vertices, &frame, (self.factor, sides), exact);
                    } else {
                        tally.together::<S, 8>(simd, &ray, vertices, &frame, (self.factor, sides), exact);
                    }
                }
                let Some(found) = found else {
                    tally.lost += u32::from(exact.is_some());
                    continue;
                };
                let side = match (found.is_front, found.is_back) {
                    (true, _) => Some(Side::Front),
                    (_, true) => Some(Side::Back),
                    _ => None,
                };
                tally.sure += u32::from(side.is_some());
                let is_ahead = found.low > 0.0;
                if let Some(side) = side
                    && is_ahead
                {
                    let sides = if side == Side::Front { Sides::Front } else { Sides::Back };
                    tally.false_sure += u32::from(hit(sides).is_none());
                }
                if let Some(t) = exact {
                    let is_within = found.low <= cull.end(t) && found.high >= cull.below(t);
                    tally.out_of_interval += u32::from(!is_within);
                }
            }
            tally
        }
    }

    impl Tally {
        /// The same of a packet, whose last ray it is and others go the same way.
        fn together<S: Simd, const W: usize>(
            &mut self,
            simd: S,
            ray: &Ray,
            vertices: &[DVec3],
            frame: &Frame,
            (factor, sides): (f32, Sides),
            exact: Option<f64>,
        ) {
            let column = |value: f64| [value; W];
            let (origins, directions) =
                (ray.origin().to_array().map(column), ray.direction().to_array().map(column));
            let rays = RayColumns {
                origins: origins.each_ref().map(|column| &column[..]),
                directions: directions.each_ref().map(|column| &column[..]),
                spans: (&[0.0; W], &[f64::INFINITY; W]),
                left: &[],
            };
            let approach = Approach::of(frame, &rays, 0..W, true);
            let mut packet = [Packet::<S, W>::new(simd, 0, W, &approach)];
            let Some(units) = level(simd, &mut packet, &approach) else { return };
            let Some(mut shaft) = Shaft::around(simd, &mut packet, units, &approach) else { return };
            shaft.rounding = shaft.rounding.times(factor);
            let packet = &packet[0];
            let mut block = FanBlock::<W>::EMPTY;
            block.set(1, 3, vertices, frame);
            let (all, none) = (simd.mask_f32(u32::MAX >> (32 - W)), simd.mask_f32(0));
            let may = (all, if sides == Sides::Front { none } else { all });
            let found = block.all_intervals(simd, 3, &shaft, packet, may);
            let is = |lanes: <S::F32 as Lanes>::Mask| lanes.bits() >> (W - 1) == 1;
            let (possible, sure) = (is(found.possible), is(found.sure));
            let (low, high) = (found.low.lane(W - 1), found.high.lane(W - 1));
            self.lost += u32::from(exact.is_some() && !possible);
            self.false_sure += u32::from(exact.is_none() && sure && low > 0.0);
            self.sure += u32::from(sure);
            if let Some(t) = exact {
                let is_within = low <= packet.above(frame, t) && high >= packet.below(frame, t);
                self.out_of_interval += u32::from(!is_within);
            }
        }
    }

    #[inline(always)]
    fn candidate<S: Simd, const W: usize>(
        simd: S,
        cull: CullRay<'_, 8>,
        vertices: &[DVec3],
        frame: &Frame,
    ) -> Option<Candidate> {
        let mut block = FanBlock::<W>::EMPTY;
        let after = block.set(1, 3, vertices, frame);
        assert_eq!(after, vertices.len() - 1);
        let mut fans = block.test(simd, cull)?;
        let candidate = block.next(&mut fans);
        assert!(candidate.is_none_or(|candidate| candidate.place == 3));
        assert!(block.next(&mut fans).is_none(), "there is one polygon");
        candidate
    }

    #[test]
    fn no_polygon_is_lost_and_no_sure_one_is_none() {
        for &backend in Backend::available() {
            let tally = backend.run(Doubtful { factor: 1.0 });
            assert_eq!(
                (tally.lost, tally.false_sure, tally.out_of_interval),
                (0, 0, 0),
                "{backend}: {tally:?}"
            );
            assert!(tally.hits > 5_000 && tally.sure > 1_000, "{backend}: {tally:?}");
        }
    }

    #[test]
    fn without_the_margins_polygons_are_lost() {
        for &backend in Backend::available() {
            let tally = backend.run(Doubtful { factor: 0.0 });
            assert!(
                tally.lost > 0 && tally.false_sure > 0 && tally.out_of_interval > 0,
                "{backend}: {tally:?}"
            );
        }
    }

    #[test]
    fn polygons_of_many_vertices_have_no_fan() {
        assert_eq!((fan_len(3, 16), fan_len(8, 8), fan_len(9, 16)), (Some(1), Some(6), None));
        assert_eq!(fan_len(8, 5), None);
    }
}
