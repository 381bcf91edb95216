//! What holds the rays of one or several packets.
//!
//! A shaft holds all rays of its packets: the tree is traversed once, a node's boxes are tested against the shaft in one
//! go, and so are the primitives of a leaf. A primitive that the shaft meets is tested against the shafts of all its
//! packets in one go, and where it meets one, against all rays of that packet at a time. It is the paper's cylinder once
//! more, built once for many rays and good for every box of the tree.
//!
//! Source: Reshetov, Soupikov and Hurley 2005, "Multi-level ray tracing algorithm", for traversal by a frustum; the
//! form with one dominant axis is that of Boulos, Wald and Benthin 2008, "Adaptive ray packet reordering".

use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::beam::{BEYOND, Beam, LEAST_ALONG, Line, Planes, SHAFT_MARGIN};
use crate::frame::CullBox;
use crate::node::Node;
use crate::packet::{Approach, Packet, Units};
use crate::triangles::{Rounding, VERTEX_MARGIN};

/// How long a shaft is at least.
const LEAST_LENGTH: f32 = 0.5;

/// The lines through pairs of points at two planes, moved outwards: up (1) or down (-1).
#[inline(always)]
fn through<S: Simd>(
    simd: S,
    [near, far]: [f32; 2],
    at_near: S::F32,
    at_far: S::F32,
    outwards: f32,
    unit: f32,
) -> Line<S> {
    let slope = (at_far - at_near) * simd.splat_f32(1.0 / (far - near));
    Line { at: at_near - slope * simd.splat_f32(near), slope }.moved(simd, outwards, unit)
}

/// What holds all rays of some packets, and of each packet by itself.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shaft<S: Simd> {
    /// Round all.
    pub(crate) beam: Beam<S>,
    /// The axes along which its middle runs backwards, a bit each.
    pub(crate) turned: u32,
    /// The rounding of a coordinate, of the worst ray.
    pub(crate) unit: f32,
    /// How far tests along its axis may be off.
    pub(crate) rounding: Rounding,
    /// The lines of the beam round each packet, a lane each.
    of_each: [[Line<S>; 2]; 2],
}

impl<S: Simd> Shaft<S> {
    /// The shaft of packets of the same rounding, whose shears it sets; `None` if none holds them.
    #[inline(always)]
    pub(crate) fn around<const W: usize>(
        simd: S,
        packets: &mut [Packet<S, W>],
        units: Units,
        approach: &Approach<'_>,
    ) -> Option<Self> {
        let unit = units.of_rays;
        let [x, y, z] = approach.axes;
        // Turned if the rays go against the axis.
        let towards = if y == (z + 1) % 3 { -1.0_f32 } else { 1.0 };
        let signed = simd.splat_f32(towards);
        let mut alongs = simd.splat_f32(1.0);
        let mut firsts = simd.splat_f32(BEYOND);
        let mut reaches = simd.splat_f32(-BEYOND);
        for packet in packets.iter() {
            let along = packet.direction[z] * signed;
            let origin = packet.origin[z] * signed;
            alongs = alongs.min(along);
            firsts = firsts.min(origin);
            reaches = reaches.max(packet.ends.mul_add(along, origin));
        }
        let first = firsts.least();
        if !(alongs.least() >= LEAST_ALONG && BEYOND - first >= LEAST_LENGTH) {
            return None;
        }
        // Beyond the farthest end no line is needed.
        let last = reaches.greatest() + SHAFT_MARGIN[0] * unit;
        let last = last.min(BEYOND).max(first + LEAST_LENGTH);
        let (near, far) = (towards * first, towards * last);
        let one = simd.splat_f32(1.0);
        let of_scene = simd.splat_f32(units.of_scene);
        let (mut steepness, mut distances) = (one, simd.splat_f32(0.0));
        // Near and far, of x and y, greatest and the negative of the least, of each packet; unused lanes are as the first.
        let mut extremes = [[[[0.0_f32; W]; 2]; 2]; 2];
        for (p, packet) in packets.iter_mut().enumerate() {
            packet.turn(simd, approach);
            let shears = packet.shears;
            steepness = steepness.max(shears.factors[0].max_abs(shears.factors[1]));
            distances = distances.max(shears.distance_slack(simd, of_scene));
            let mut ends = [[one; 4]; 2];
            for (end, plane) in [near, far].into_iter().enumerate() {
                let [x, y] = packet.at_plane(simd, plane, approach.is_flat);
                ends[end] = [x, -x, y, -y];
            }
            let [near, far] = ends;
            let greatest = simd.greatest_of_eight(&[near, far]);
            for (lanes, value) in extremes.as_flattened_mut().as_flattened_mut().iter_mut().zip(greatest) {
                lanes[p] = value;
            }
        }
        for lanes in extremes.as_flattened_mut().as_flattened_mut() {
            let value = lanes[0];
            lanes[packets.len()..].fill(value);
        }
        let none = Line { at: one, slope: one };
        let (mut lines, mut of_each, mut worse) = ([[none; 2]; 2], [[none; 2]; 2], [[0; 2]; 2]);
        let mut turned = u32::from(towards < 0.0) << z;
        for side in 0..2 {
            let mut across = 0.0;
            for (i, outwards) in [1.0, -1.0].into_iter().enumerate() {
                let sense = simd.splat_f32(outwards);
                let at_near = sense * simd.load_f32(&extremes[0][side][i]);
                let at_far = sense * simd.load_f32(&extremes[1][side][i]);
                of_each[side][i] = through(simd, [near, far], at_near, at_far, outwards, unit);
                let (n, f) = if i == 0 {
                    (at_near.greatest(), at_far.greatest())
                } else {
                    (at_near.least(), at_far.least())
                };
                let line = through(simd, [near, far], simd.splat_f32(n), simd.splat_f32(f), outwards, unit);
                // The upper line is highest where z is largest if it rises; the lower one lowest where z is least.
                let rises = (f - n) * (far - near) * outwards > 0.0;
                worse[side][i] = if rises { 3 + z } else { z };
                lines[side][i] = line;
                across += f - n;
            }
            turned |= u32::from(across < 0.0) << [x, y][side];
        }
        let steepness = steepness.greatest();
        Some(Self {
            beam: Beam { axes: [x, y, z], towards, first: first - SHAFT_MARGIN[0] * unit, lines, worse },
            turned,
            unit,
            rounding: Rounding {
                vertex: VERTEX_MARGIN * units.of_scene * steepness,
                steepness,
                distance: distances.greatest(),
            },
            of_each,
        })
    }

    /// How far along the axis any ray of a packet may still find something, times the sense of the axis.
    #[inline(always)]
    pub(crate) fn reach<const W: usize>(&self, simd: S, packet: &Packet<S, W>) -> f32 {
        let z = self.beam.axes[2];
        let deepest =
            packet.ends.mul_add(packet.direction[z], packet.origin[z]) * simd.splat_f32(self.beam.towards);
        (deepest.greatest() + SHAFT_MARGIN[0] * self.unit).min(BEYOND)
    }

    /// Which packets may meet a box, of those that still reach it.
    #[inline(always)]
    pub(crate) fn packets_that_meet(&self, simd: S, [low, high]: [[f32; 3]; 2], reaches: S::F32) -> u32 {
        let [x, y, z] = self.beam.axes;
        let begin = if self.beam.towards > 0.0 { low[z] } else { -high[z] };
        let mut met = simd.splat_f32(begin).le(reaches);
        let (lower, upper) = (simd.splat_f32(low[z]), simd.splat_f32(high[z]));
        for (side, axis) in [x, y].into_iter().enumerate() {
            let [above, below] = &self.of_each[side];
            let top = (lower * above.slope).max(upper * above.slope) + above.at;
            let bottom = (lower * below.slope).min(upper * below.slope) + below.at;
            met = met & simd.splat_f32(low[axis]).le(top) & simd.splat_f32(high[axis]).ge(bottom);
        }
        met.bits()
    }

    /// The primitives of a block that the shaft meets.
    #[inline(always)]
    pub(crate) fn candidates(&self, simd: S, block: &impl Planes<S>, reach: f32) -> u32 {
        self.beam.meets(simd, block, reach).0.bits()
    }
}

/// The boxes of primitives that no other block tells the boxes of.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct BoxBlock<const W: usize> {
    planes: [[f32; W]; 6],
}

impl<const W: usize> BoxBlock<W> {
    /// A block without boxes: no comparison with NaN holds.
    pub(crate) const EMPTY: Self = Self { planes: [[f32::NAN; W]; 6] };

    /// Sets the lower and upper planes of all boxes along an axis.
    #[inline(always)]
    pub(crate) fn set_all<S: Simd>(&mut self, axis: usize, [low, high]: [S::F32; 2]) {
        low.store(&mut self.planes[axis]);
        high.store(&mut self.planes[3 + axis]);
    }

    pub(crate) fn set(&mut self, lane: usize, bounds: &CullBox) {
        for k in 0..3 {
            self.planes[k][lane] = bounds.low[k];
            self.planes[3 + k][lane] = bounds.high[k];
        }
    }

    /// The box of a primitive.
    #[inline(always)]
    pub(crate) fn bounds(&self, lane: usize) -> [[f32; 3]; 2] {
        let plane = |k: usize| self.planes[k][lane % W];
        [[plane(0), plane(1), plane(2)], [plane(3), plane(4), plane(5)]]
    }
}

impl<S: Simd, const W: usize> Planes<S> for BoxBlock<W> {
    #[inline(always)]
    fn plane(&self, simd: S, plane: usize) -> S::F32 {
        simd.load_f32(&self.planes[plane])
    }
}

impl<S: Simd, const W: usize> Planes<S> for Node<W> {
    #[inline(always)]
    fn plane(&self, simd: S, plane: usize) -> S::F32 {
        simd.load_f32(&self.planes[plane])
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use rayset_geometry::glam::DVec3;
    use rayset_geometry::{BoundingBox, unit};
    use rayset_simd::{Backend, Kernel};

    use super::*;
    use crate::columns::RayColumns;
    use crate::frame::Frame;
    use crate::packet::{Approach, level};

    /// One box, the same in every lane.
    struct One(CullBox);

    impl<S: Simd> Planes<S> for One {
        fn plane(&self, simd: S, plane: usize) -> S::F32 {
            simd.splat_f32(if plane < 3 { self.0.low[plane] } else { self.0.high[plane - 3] })
        }
    }

    /// How many boxes that the outermost ray of a packet touches are said to be missed by the packet's shaft, and by the
    /// packet's own lane of a shaft, and by the test of its rays, if margins are multiplied by `factor`.
    struct Grazing {
        factor: f32,
    }

    impl Kernel for Grazing {
        type Output = [usize; 3];

        fn run<S: Simd>(self, simd: S) -> [usize; 3] {
            if S::F32::LANES == 16 {
                grazing::<S, 16>(simd, self.factor)
            } else {
                grazing::<S, 8>(simd, self.factor)
            }
        }
    }

    fn grazing<S: Simd, const W: usize>(simd: S, factor: f32) -> [usize; 3] {
        let frame = Frame::of(&BoundingBox { min: DVec3::NEG_ONE, max: DVec3::ONE });
        let (mut by_shaft, mut by_packet, mut by_rays) = (0, 0, 0);
        for i in 0..3000 {
            let at = |k: f64| (f64::from(i) * k).fract();
            // Coordinates that single precision has exactly.
            let exactly = |x: f64| (x * 1024.0).round() / 1024.0;
            let eye = DVec3::new(3.0 * at(0.618_033_9) - 1.5, at(0.754_877_7) - 0.5, -1.2 - at(0.569_840_3));
            let touched = DVec3::new(
                exactly(1.4 * at(0.819_172_5) - 0.7),
                exactly(at(0.671_043_6) - 0.5),
                exactly(1.6 * at(0.549_700_4) - 0.8),
            );
            let mut columns: [Vec<f64>; 6] = Default::default();
            for lane in 0..2 * W {
                // The first touches; the others pass on the side of lower x, about as high.
                let aside = 0.02 * (lane as f64) * (1.0 + at(0.320_471_1));
                let target = touched - DVec3::new(aside, 0.3 * aside * (at(0.438_579_2) - 0.5), 0.0);
                let direction = unit(target - eye).expect("they are apart");
                for k in 0..3 {
                    columns[k].push(eye[k]);
                    columns[3 + k].push(direction[k]);
                }
            }
            let (starts, ends) = (vec![0.0; 2 * W], vec![f64::INFINITY; 2 * W]);
            let [ox, oy, oz, dx, dy, dz] = &columns;
            let rays = RayColumns {
                origins: [ox, oy, oz],
                directions: [dx, dy, dz],
                spans: (&starts, &ends),
                left: &[],
            };
            // Of flat shapes, and of others.
            let approach = Approach::of(&frame, &rays, 0..2 * W, i % 2 == 0);
            let mut packets = [0, W].map(|first| Packet::<S, W>::new(simd, first, W, &approach));
            let units = level(simd, &mut packets, &approach).expect("they start nearby");
            let units = Units { of_rays: factor * units.of_rays, of_scene: factor * units.of_scene };
            let Some(shaft) = Shaft::around(simd, &mut packets, units, &approach) else { continue };
            // Flat across the axis, so that no end of the box is worse than the other.
            let corner = touched + DVec3::new(0.1, 0.0, 0.0);
            let (low, high) = (touched - 0.3 * DVec3::Y, corner + 0.3 * DVec3::Y);
            let bounds = frame.cull_box(&BoundingBox { min: low, max: high });
            let reaches = simd.splat_f32(BEYOND);
            by_shaft += usize::from(shaft.candidates(simd, &One(bounds), BEYOND) & 1 == 0);
            let met = shaft.packets_that_meet(simd, [bounds.low, bounds.high], reaches);
            by_packet += usize::from(met & 1 == 0);
            let Packet { start, ends, .. } = packets[0];
            let slabs = packets[0].slabs(simd, units.of_rays);
            let (entered, _) = slabs.enter(simd, [bounds.low, bounds.high], start, ends);
            by_rays += usize::from(entered.bits() & 1 == 0);
        }
        [by_shaft, by_packet, by_rays]
    }

    #[test]
    fn shaft_margin_is_needed() {
        for &backend in Backend::available() {
            assert_eq!(backend.run(Grazing { factor: 1.0 }), [0; 3], "{backend}");
            let missed = backend.run(Grazing { factor: 0.0 });
            assert!(missed.iter().all(|&missed| missed > 30), "{backend}: {missed:?}");
        }
    }

    /// How many packets of rays with one direction go together, and how many of their shafts do not go their way.
    struct Ways;

    impl Kernel for Ways {
        type Output = [usize; 2];

        fn run<S: Simd>(self, simd: S) -> [usize; 2] {
            if S::F32::LANES == 16 { ways::<S, 16>(simd) } else { ways::<S, 8>(simd) }
        }
    }

    fn ways<S: Simd, const W: usize>(simd: S) -> [usize; 2] {
        let frame = Frame::of(&BoundingBox { min: DVec3::NEG_ONE, max: DVec3::ONE });
        let mut dice = ChaCha8Rng::seed_from_u64(7);
        let (mut together, mut wrong) = (0, 0);
        for case in 0..1000 {
            let mut at = || 2.0 * f64::from(dice.next_u32()) / f64::from(u32::MAX) - 1.0;
            let mut point = || DVec3::new(at(), at(), at());
            let direction = unit(point()).expect("it has a length").to_array();
            let origins: Vec<_> = (0..W).map(|_| (0.3 * point()).to_array()).collect();
            let [ox, oy, oz] = [0, 1, 2].map(|k| origins.iter().map(|origin| origin[k]).collect::<Vec<_>>());
            let [dx, dy, dz] = direction.map(|x| vec![x; W]);
            let (starts, ends) = (vec![0.0; W], vec![f64::INFINITY; W]);
            let (origins, directions) = ([&ox[..], &oy, &oz], [&dx[..], &dy, &dz]);
            let rays = RayColumns { origins, directions, spans: (&starts, &ends), left: &[] };
            let approach = Approach::of(&frame, &rays, 0..W, case % 2 == 0);
            let mut packet = [Packet::<S, W>::new(simd, 0, W, &approach)];
            let units = level(simd, &mut packet, &approach).expect("they start nearby");
            let Some(shaft) = Shaft::around(simd, &mut packet, units, &approach) else { continue };
            let backwards = (0..3).map(|k| u32::from(direction[k] < 0.0) << k).sum::<u32>();
            // Too slight a way across is lost in rounding.
            let is_clear = direction.iter().all(|x| x.abs() > 1e-4);
            together += usize::from(is_clear);
            wrong += usize::from(is_clear && shaft.turned != backwards);
        }
        [together, wrong]
    }

    #[test]
    fn a_shaft_goes_the_way_of_its_rays() {
        for &backend in Backend::available() {
            let [together, wrong] = backend.run(Ways);
            assert!(together > 500, "{backend}: {together}");
            assert_eq!(wrong, 0, "{backend}");
        }
    }
}
