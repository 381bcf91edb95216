//! What holds several rays: four lines along an axis.
//!
//! A [`Shaft`](crate::shaft::Shaft) has one round all its packets. Round a whole tile it can be had sooner, from the
//! extremes of the rays' columns alone: often a little wider, but enough to see that a tile misses everything, before its
//! packets are made.
//!
//! Source: Reshetov, Soupikov and Hurley 2005, "Multi-level ray tracing algorithm", for one bound of the directions of many
//! rays; the form with one dominant axis is that of Boulos, Wald and Benthin 2008, "Adaptive ray packet reordering".

use std::ops::Range;

use rayset_simd::{CullLanes, LaneMask, Lanes, Part, Simd};

use crate::columns::RayColumns;
use crate::frame::Frame;
use crate::node::{Child, Tree};
use crate::packet::hit_slack;
use crate::ray::SINGLE;
use crate::shear::MOST_PARTS;
use crate::traverse::{Stack, Steps};

/// How much of a direction must go along the common axis.
pub(crate) const LEAST_ALONG: f32 = 0.2;
/// A plane across the axis beyond the scene.
pub(crate) const BEYOND: f32 = 2.0;
/// How far the lines are moved outwards, in units of a coordinate's rounding: for the line, and for its slope.
pub const SHAFT_MARGIN: [f32; 2] = [160.0, 40.0];
/// More than any coordinate of a direction: where one is greater, or infinite, no line holds the rays.
const MOST_ALONG: f32 = 2.0;
/// No beam is made of rays whose coordinates are rounded by more: one begins some 1700 times the scene's size away.
const MOST_UNIT: f64 = 1e-4;

/// A line in the plane of the common axis and another: `at + slope z`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line<S: Simd> {
    pub(crate) at: S::F32,
    pub(crate) slope: S::F32,
}

impl<S: Simd> Line<S> {
    /// The line moved outwards: up (1) or down (-1).
    #[inline(always)]
    pub(crate) fn moved(self, simd: S, outwards: f32, unit: f32) -> Self {
        let [fixed, steep] = SHAFT_MARGIN;
        let fixed = simd.splat_f32(outwards * unit * fixed);
        let slack = self.slope.abs().mul_add(simd.splat_f32(outwards * unit * steep), fixed);
        Self { at: self.at + slack, ..self }
    }
}

/// Four lines that hold rays, and where these begin.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beam<S: Simd> {
    /// Which axes play x, y and z, as in a shear.
    pub(crate) axes: [usize; 3],
    /// 1 if the rays go up the axis, else -1.
    pub(crate) towards: f32,
    /// Where the rays begin along the axis, times `towards`, or before.
    pub(crate) first: f32,
    /// Above and below, for the x and y of the shear; and at which of a box's ends along the axis each is the worse.
    pub(crate) lines: [[Line<S>; 2]; 2],
    pub(crate) worse: [[usize; 2]; 2],
}

impl<S: Simd> Beam<S> {
    /// Which of several boxes the rays may meet, and how far along the axis each begins.
    #[inline(always)]
    pub(crate) fn meets(
        &self,
        simd: S,
        planes: &impl Planes<S>,
        reach: f32,
    ) -> (<S::F32 as Lanes>::Mask, S::F32) {
        let [x, y, z] = self.axes;
        let towards = simd.splat_f32(self.towards);
        let (near, far) = if self.towards > 0.0 { (z, 3 + z) } else { (3 + z, z) };
        let begin = planes.plane(simd, near) * towards;
        let end = planes.plane(simd, far) * towards;
        let mut met = end.ge(simd.splat_f32(self.first)) & begin.le(simd.splat_f32(reach));
        for (side, axis) in [x, y].into_iter().enumerate() {
            let [above, below] = &self.lines[side];
            let [at_above, at_below] = self.worse[side];
            let above = planes.plane(simd, at_above).mul_add(above.slope, above.at);
            let below = planes.plane(simd, at_below).mul_add(below.slope, below.at);
            met = met & planes.plane(simd, axis).le(above) & planes.plane(simd, 3 + axis).ge(below);
        }
        (met, begin)
    }
}

/// Boxes in lanes, by their six planes: lower x, y, z, then upper.
pub(crate) trait Planes<S: Simd> {
    /// A plane of every box.
    fn plane(&self, simd: S, plane: usize) -> S::F32;
}

/// The least and the greatest of each coordinate of some rays in culling space: of origins, and of directions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extremes {
    origins: [[f32; 3]; 2],
    directions: [[f32; 3]; 2],
}

impl Extremes {
    /// Those of `W` rays of columns, or more.
    #[inline(always)]
    pub(crate) fn of<S: Simd, const W: usize>(
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        range: Range<usize>,
    ) -> Self {
        let mut origins = [[simd.splat_f32(0.0); 4]; 2];
        let mut directions = origins;
        for k in 0..3 {
            let place = (frame.center[k], frame.scale);
            let [low, high] = extremes::<S, W>(simd, &rays.origins[k][range.clone()], place);
            (origins[0][k], origins[1][k]) = (-low, high);
            let [low, high] = extremes::<S, W>(simd, &rays.directions[k][range.clone()], (0.0, 1.0));
            (directions[0][k], directions[1][k]) = (-low, high);
        }
        let [ox, oy, oz, _, px, py, pz, _] = simd.greatest_of_eight(&origins);
        let [dx, dy, dz, _, ex, ey, ez, _] = simd.greatest_of_eight(&directions);
        Self { origins: [[-ox, -oy, -oz], [px, py, pz]], directions: [[-dx, -dy, -dz], [ex, ey, ez]] }
    }

    /// The rounding of a coordinate of the rays; `None` if one begins so far off that the margin is not small.
    #[inline(always)]
    pub(crate) fn unit(&self, frame: &Frame) -> Option<f32> {
        let [low, high] = self.origins;
        let size = (0..3).fold(0.0_f32, |size, k| size.max(-low[k]).max(high[k]));
        let unit = f64::from((1.0 + size) * SINGLE) + hit_slack(frame, size.into());
        #[expect(clippy::cast_possible_truncation, reason = "the margin makes up for the rounding")]
        (unit < MOST_UNIT).then_some(unit as f32)
    }

    /// The beam round the rays, whose coordinates are rounded by a unit; `None` if they go along no axis together.
    #[inline(always)]
    pub(crate) fn beam<S: Simd>(&self, simd: S, unit: f32) -> Option<Beam<S>> {
        let Self { origins: [low, high], directions: [least, most] } = *self;
        // How much of each direction goes along an axis, at least.
        let along = |k: usize| least[k].max(-most[k]);
        let mut z = usize::from(along(1) > along(0));
        if along(2) > along(z) {
            z = 2;
        }
        let longest = (0..3).fold(0.0_f32, |longest, k| longest.max(-least[k]).max(most[k]));
        if !(along(z) >= LEAST_ALONG && longest <= MOST_ALONG && low[z] <= high[z]) {
            return None;
        }
        let [x, y] = [(z + 1) % 3, (z + 2) % 3];
        let towards = if least[z] > 0.0 { 1.0_f32 } else { -1.0 };
        // Of `|d_z|`.
        let (a, b) = (along(z), most[z].max(-least[z]));
        let none = Line { at: simd.splat_f32(0.0), slope: simd.splat_f32(0.0) };
        let (mut lines, mut worse) = ([[none; 2]; 2], [[0; 2]; 2]);
        for (side, axis) in [x, y].into_iter().enumerate() {
            for (i, outwards) in [1.0_f32, -1.0].into_iter().enumerate() {
                // The steepest outwards, as seen along the rays.
                let across = if i == 0 { most[axis] } else { -least[axis] };
                let slope = towards * outwards * (across / if across > 0.0 { a } else { b });
                let rises = slope * outwards > 0.0;
                let start = if i == 0 { high[axis] } else { low[axis] };
                let at = start - slope * if rises { low[z] } else { high[z] };
                let line = Line { at: simd.splat_f32(at), slope: simd.splat_f32(slope) };
                lines[side][i] = line.moved(simd, outwards, unit);
                worse[side][i] = if rises { 3 + z } else { z };
            }
        }
        let first = if towards > 0.0 { low[z] } else { -high[z] };
        Some(Beam { axes: [x, y, z], towards, first: first - SHAFT_MARGIN[0] * unit, lines, worse })
    }
}

/// The least and the greatest of a column, of `W` values or more, each moved and scaled: some lane has it.
#[inline(always)]
fn extremes<S: Simd, const W: usize>(simd: S, column: &[f64], (offset, scale): (f64, f64)) -> [S::F32; 2] {
    let parts = W / S::F64::LANES;
    let mut low = [simd.splat_f64(f64::INFINITY); MOST_PARTS];
    let mut high = [simd.splat_f64(f64::NEG_INFINITY); MOST_PARTS];
    let last = column.len() - W;
    let mut first = 0;
    loop {
        let values = &column[first..first + W];
        for part in 0..parts {
            let values = simd.load_f64(&values[part * S::F64::LANES..]);
            // What is not a number is passed over: nothing is hit by such a ray.
            low[part] = values.min(low[part]);
            high[part] = values.max(high[part]);
        }
        if first == last {
            break;
        }
        // The last are as many again, some of them for the second time.
        first = last.min(first + W);
    }
    let (offset, scale) = (simd.splat_f64(offset), simd.splat_f64(scale));
    for part in 0..parts {
        low[part] = (low[part] - offset) * scale;
        high[part] = (high[part] - offset) * scale;
    }
    [simd.join_f32(&low[..parts]), simd.join_f32(&high[..parts])]
}

/// Whether some rays of a list, `W` or more, surely meet no leaf.
pub(crate) struct Misses<'a, const W: usize> {
    pub(crate) tree: &'a Tree<W>,
    pub(crate) frame: &'a Frame,
    pub(crate) rays: &'a RayColumns<'a>,
    pub(crate) range: Range<usize>,
    pub(crate) stack: &'a mut Stack,
    pub(crate) steps: &'a mut Steps,
}

impl<S: Simd, const W: usize> Part<S> for Misses<'_, W> {
    type Output = bool;

    #[inline(always)]
    fn run(self, simd: S) -> bool {
        let Self { tree, frame, rays, range, stack, steps } = self;
        let extremes = Extremes::of::<S, W>(simd, frame, rays, range);
        let Some(beam) = extremes.unit(frame).and_then(|unit| extremes.beam(simd, unit)) else {
            return false;
        };
        let stack = stack.children.as_mut_slice();
        let (mut current, mut height) = (tree.root, 0);
        // Where there is a leaf, it is soon come to: what was met last is visited first.
        while !current.is_leaf() {
            steps.nodes += 1;
            let node = &tree.nodes[current.node_index()];
            let met = beam.meets(simd, node, BEYOND).0;
            simd.compress_u32(met, &node.children, &mut stack[height..height + W]);
            height += met.bits().count_ones() as usize;
            if height == 0 {
                return true;
            }
            height -= 1;
            current = Child(stack[height]);
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use rayset_geometry::glam::DVec3;
    use rayset_geometry::{BoundingBox, unit};
    use rayset_simd::{Backend, Kernel, Scalar};

    use super::*;
    use crate::node::Node;

    /// What beams say of boxes that one of their rays touches, and of boxes beside all of them.
    #[derive(Debug, Default)]
    struct Tally {
        /// Boxes that a ray touches.
        touched: u32,
        /// Those that are said to be missed.
        lost: u32,
        /// Boxes that no ray comes near.
        beside: u32,
        /// Those that are said to be missed.
        missed: u32,
    }

    struct Touching {
        /// By what the margin is multiplied.
        factor: f32,
    }

    impl Kernel for Touching {
        type Output = Tally;

        fn run<S: Simd>(self, simd: S) -> Tally {
            if S::F32::LANES == 16 {
                touching::<S, 16>(simd, self.factor)
            } else {
                touching::<S, 8>(simd, self.factor)
            }
        }
    }

    fn touching<S: Simd, const W: usize>(simd: S, factor: f32) -> Tally {
        let mut dice = ChaCha8Rng::seed_from_u64(11);
        let frame = Frame::of(&BoundingBox { min: DVec3::NEG_ONE, max: DVec3::ONE });
        let mut tally = Tally::default();
        for case in 0..6000 {
            let mut at = || 2.0 * f64::from(dice.next_u32()) / f64::from(u32::MAX) - 1.0;
            // Coordinates that single precision has exactly.
            let exactly = |x: f64| (x * 1024.0).round() / 1024.0;
            let touched = DVec3::new(exactly(0.7 * at()), exactly(0.5 * at()), exactly(0.8 * at()));
            let eye = DVec3::new(1.5 * at(), at(), -exactly(1.2 + at().abs()));
            // Some begin far off.
            let eye = if case / 24 % 3 == 0 { 30.0 * eye } else { eye };
            // All rays are the same; or the others go elsewhere; or begin elsewhere too; or only sooner, or later.
            let [apart, along, aside] =
                [[0.0, 0.0, 0.0], [0.0, 0.0, 0.05], [0.1, 0.1, 0.05], [0.0, 0.2, 0.0]][case % 4];
            let later = at().signum();
            let n = W + case / 4 % (3 * W);
            let touching = case % n;
            let (turn, mirrored) = (case / 4 % 3, DVec3::new(at().signum(), at().signum(), at().signum()));
            let place = |p: DVec3| {
                let p = (p * mirrored).to_array();
                DVec3::new(p[turn], p[(turn + 1) % 3], p[(turn + 2) % 3])
            };
            let mut columns: [Vec<f64>; 6] = Default::default();
            for i in 0..n {
                let (mut from, mut to) = (eye, touched);
                if i != touching {
                    let moved = DVec3::new(apart * at(), apart * at(), along * later * at().abs());
                    to += aside * DVec3::new(at(), at(), at());
                    from += moved;
                    if aside <= 0.0 {
                        to += moved;
                    }
                }
                let direction = place(unit(to - from).expect("they are apart"));
                let from = place(from);
                for k in 0..3 {
                    columns[k].push(from[k]);
                    columns[3 + k].push(direction[k]);
                }
            }
            let [ox, oy, oz, dx, dy, dz] = &columns;
            let spans = vec![0.0; n];
            let rays = RayColumns {
                origins: [ox, oy, oz],
                directions: [dx, dy, dz],
                spans: (&spans, &spans),
                left: &[],
            };
            // Flat across the axis; on one side of the touched point, or well beside all.
            let side = if case / 12 % 2 == 0 { 1.0 } else { -1.0 };
            let bounds = |beside: f64| {
                let corners = [beside, beside + 0.1].map(|x| side * x * DVec3::X + touched);
                let [a, b] = [place(corners[0] - 0.3 * DVec3::Y), place(corners[1] + 0.3 * DVec3::Y)];
                frame.cull_box(&BoundingBox { min: a.min(b), max: a.max(b) })
            };
            let mut node = Node::<W>::EMPTY;
            node.set(0, &bounds(0.0), Child::leaf(0));
            node.set(1, &bounds(0.6), Child::leaf(1));
            // It ends where the ray begins.
            let [a, b] = [-DVec3::ONE, DVec3::new(1.0, 1.0, 0.0)].map(|corner| place(eye + 0.3 * corner));
            node.set(2, &frame.cull_box(&BoundingBox { min: a.min(b), max: a.max(b) }), Child::leaf(2));
            let extremes = Extremes::of::<S, W>(simd, &frame, &rays, 0..n);
            let unit = extremes.unit(&frame).expect("they begin near enough");
            let Some(beam) = extremes.beam(simd, factor * unit) else { continue };
            let met = beam.meets(simd, &node, BEYOND).0.bits();
            assert_eq!(met & !7, 0, "{case}: nothing is met where there is no box");
            tally.touched += 1;
            tally.lost += u32::from(met & 5 != 5);
            if apart <= 0.0 {
                tally.beside += 1;
                tally.missed += u32::from(met & 2 == 0);
            }
        }
        tally
    }

    #[test]
    fn one_direction_that_is_none_makes_no_beam() {
        let origins = [[0.0; 3]; 2];
        let beam = |most: f32| {
            let directions = [[-0.1, 0.0, 0.9], [most, 0.1, 1.0]];
            Extremes { origins, directions }.beam(Scalar, 1e-7)
        };
        assert!(beam(0.2).is_some());
        assert!(beam(f32::INFINITY).is_none(), "its lines would hold nothing");
    }

    #[test]
    fn beams_lose_no_box_that_a_ray_touches() {
        for &backend in Backend::available() {
            let tally = backend.run(Touching { factor: 1.0 });
            assert_eq!(tally.lost, 0, "{backend}: {tally:?}");
            assert!(tally.touched > 3000, "{backend}: {tally:?}");
            assert!(tally.missed > tally.beside * 9 / 10, "{backend}: {tally:?}");
            let tally = backend.run(Touching { factor: 0.0 });
            assert!(tally.lost > 100, "{backend}: {tally:?}");
        }
    }
}
