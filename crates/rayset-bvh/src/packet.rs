//! As many rays as there are lanes, traced together while they stay together.
//!
//! One shaft holds all rays of a packet: the tree is traversed once, a node's boxes are tested against the shaft in
//! one go, and so are the primitives of a leaf; what is left is tested against all rays at a time. It is the paper's
//! cylinder once more, built once for a packet and good for every box of the tree.
//!
//! Source: Reshetov, Soupikov and Hurley 2005, "Multi-level ray tracing algorithm", for traversal by a frustum; the
//! form with one dominant axis is that of Boulos, Wald and Benthin 2008, "Adaptive ray packet reordering".

use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::frame::{Frame, round_down, round_up};
use crate::node::{Child, Node};
use crate::ray::{HIT_MARGIN, SINGLE};

/// Origins farther out than this are traced one by one.
const FAR: f32 = 4.0;
/// How much of a direction must go along the common axis.
const LEAST_ALONG: f32 = 0.2;
/// Where the shaft's far plane lies: beyond the scene.
const FAR_PLANE: f32 = 2.0;
/// How far the shaft's lines are moved outwards, in units of a coordinate's rounding: for the line, and for its slope.
pub const SHAFT_MARGIN: [f32; 2] = [160.0, 40.0];

/// Rays as columns, of which a packet takes some.
#[derive(Clone, Copy, Debug)]
pub struct RayColumns<'a> {
    /// The x, y and z of the origins, in world space.
    pub origins: [&'a [f64]; 3],
    /// The x, y and z of the unit directions.
    pub directions: [&'a [f64]; 3],
    /// Where each span starts and ends, in world units.
    pub spans: (&'a [f64], &'a [f64]),
}

/// A line in the plane of the common axis and another: `a + b z`, with `z` at the end of a box that is the worse.
#[derive(Clone, Copy, Debug)]
struct Line<S: Simd> {
    at: S::F32,
    slope: S::F32,
    /// Which of a node's planes `z` is.
    plane: usize,
}

impl<S: Simd> Line<S> {
    /// The line through two points `[z, x]`, moved outwards: up (1) or down (-1).
    #[inline(always)]
    fn through(simd: S, from: [f32; 2], to: [f32; 2], axis: usize, outwards: f32, unit: f32) -> Self {
        let slope = (to[1] - from[1]) / (to[0] - from[0]);
        let slack = unit * (SHAFT_MARGIN[0] + SHAFT_MARGIN[1] * slope.abs());
        let at = from[1] - slope * from[0] + outwards * slack;
        // The upper line is highest where z is largest if it rises; the lower one lowest where z is least.
        let plane = if (slope > 0.0) == (outwards > 0.0) { 3 + axis } else { axis };
        Self { at: simd.splat_f32(at), slope: simd.splat_f32(slope), plane }
    }
}

/// Rays in culling space, a lane each, and the shaft that holds them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Packet<S: Simd> {
    pub(crate) origin: [S::F32; 3],
    pub(crate) direction: [S::F32; 3],
    /// The spans, outwards and inwards; lanes without a ray have none.
    pub(crate) start: S::F32,
    pub(crate) start_above: S::F32,
    pub(crate) end: S::F32,
    pub(crate) end_below: S::F32,
    /// The rounding of a coordinate, of the worst ray.
    pub(crate) unit: f32,
    /// Which axes play x, y and z, as in a shear.
    pub(crate) axes: [usize; 3],
    /// The shear: `d_x / d_z`, `d_y / d_z` and `1 / d_z`.
    pub(crate) factors: [S::F32; 3],
    /// World units to units of culling space.
    scale: f64,
    /// 1 if the rays go up the axis, else -1.
    towards: f32,
    /// Where the rays begin along the axis, times `towards`.
    first: f32,
    /// Above and below, for the x and y of the shear.
    lines: [[Line<S>; 2]; 2],
}

impl<S: Simd> Packet<S> {
    /// The rays of a list whose indices are `members`; `None` if no shaft holds them, or one starts far off.
    ///
    /// `W` is the number of lanes; there are 1 to `W` members.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the margins make up for the rounding")]
    pub(crate) fn new<const W: usize>(
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        members: &[u32],
    ) -> Option<Self> {
        let mut numbers = [0_usize; W];
        for (lane, number) in numbers.iter_mut().enumerate() {
            *number = members[lane.min(members.len() - 1)] as usize;
        }
        let zero = simd.splat_f32(0.0);
        let (mut origin, mut direction) = ([zero; 3], [zero; 3]);
        let mut size = zero;
        for k in 0..3 {
            let (center, scale) = (frame.center[k], frame.scale);
            let (mut o, mut d) = ([0.0_f32; W], [0.0_f32; W]);
            for lane in 0..W {
                o[lane] = ((rays.origins[k][numbers[lane]] - center) * scale) as f32;
                d[lane] = rays.directions[k][numbers[lane]] as f32;
            }
            origin[k] = simd.load_f32(&o);
            direction[k] = simd.load_f32(&d);
            size = size.max(origin[k].abs());
        }
        let size = size.greatest();
        let center = frame.center.abs().max_element() * frame.scale;
        let hit_slack = HIT_MARGIN * (2.0 * (f64::from(size) + center) + 1.0);
        if !(size <= FAR && hit_slack < 1e-3) {
            return None;
        }
        let unit = (f64::from(1.0 + size) * SINGLE + hit_slack) as f32;

        // The axis along which the first, the middle and the last ray go most.
        let mut d = [[0.0; W]; 3];
        for k in 0..3 {
            direction[k].store(&mut d[k]);
        }
        let sum = |k: usize| d[k][0] + d[k][W / 2] + d[k][W - 1];
        let sums = [sum(0), sum(1), sum(2)];
        let mut z = usize::from(sums[1].abs() > sums[0].abs());
        if sums[2].abs() > sums[z].abs() {
            z = 2;
        }
        let towards = if sums[z] < 0.0 { -1.0_f32 } else { 1.0 };
        let signed = simd.splat_f32(towards);
        let all = u32::MAX >> (32 - W);
        if (direction[z] * signed).ge(simd.splat_f32(LEAST_ALONG)).bits() != all {
            return None;
        }
        let along = origin[z] * signed;
        let first = along.least();
        if FAR_PLANE - first < 0.5 {
            return None;
        }
        // A mirrored axis would turn triangles round.
        let (x, y) = if towards < 0.0 { ((z + 2) % 3, (z + 1) % 3) } else { ((z + 1) % 3, (z + 2) % 3) };
        let inverse = simd.splat_f32(1.0) / direction[z];
        let factors = [direction[x] * inverse, direction[y] * inverse, inverse];

        let (near, far) = (towards * first, towards * FAR_PLANE);
        let (to_near, to_far) = (simd.splat_f32(near) - origin[z], simd.splat_f32(far) - origin[z]);
        let mut lines = [[Line { at: zero, slope: zero, plane: 0 }; 2]; 2];
        for (side, axis) in [x, y].into_iter().enumerate() {
            let at_near = to_near.mul_add(factors[side], origin[axis]);
            let at_far = to_far.mul_add(factors[side], origin[axis]);
            lines[side] = [
                Line::through(simd, [near, at_near.greatest()], [far, at_far.greatest()], z, 1.0, unit),
                Line::through(simd, [near, at_near.least()], [far, at_far.least()], z, -1.0, unit),
            ];
        }

        let (mut starts, mut ends) = ([0.0_f32; W], [0.0_f32; W]);
        for lane in 0..W {
            starts[lane] = (rays.spans.0[numbers[lane]] * frame.scale) as f32;
            ends[lane] = (rays.spans.1[numbers[lane]] * frame.scale) as f32;
        }
        let (starts, ends) =
            (simd.load_f32(&starts).max(zero), simd.load_f32(&ends).min(simd.splat_f32(1e30)));
        let rounding = simd.splat_f32(1.0 / 4_194_304.0);
        let slack = simd.splat_f32(unit);
        let (start_slack, end_slack) = (starts.abs() * rounding + slack, ends.abs() * rounding + slack);
        let is_ray = simd.mask_f32(u32::MAX >> (32 - members.len()));
        let nowhere = simd.splat_f32(-1e30);
        Some(Self {
            origin,
            direction,
            start: starts - start_slack,
            start_above: starts + start_slack,
            end: (ends + end_slack).select(is_ray, nowhere),
            end_below: ends - end_slack,
            unit,
            axes: [x, y, z],
            factors,
            scale: frame.scale,
            towards,
            first: first - SHAFT_MARGIN[0] * unit,
            lines,
        })
    }

    /// A vertex that is the same in every lane, sheared along each ray.
    #[inline(always)]
    pub(crate) fn shear(&self, [vx, vy, vz]: [S::F32; 3]) -> [S::F32; 3] {
        let [x, y, z] = self.axes;
        let [sx, sy, _] = self.factors;
        let depth = vz - self.origin[z];
        [(vx - self.origin[x]) - sx * depth, (vy - self.origin[y]) - sy * depth, depth]
    }

    /// A distance in culling space that is not below, or not above, `t` in world units.
    #[inline(always)]
    pub(crate) fn above(&self, t: f64) -> f32 {
        round_up(t * self.scale)
    }
    #[inline(always)]
    pub(crate) fn below(&self, t: f64) -> f32 {
        round_down(t * self.scale)
    }

    /// How far along the axis any ray may still find something, times `towards`.
    #[inline(always)]
    pub(crate) fn reach(&self, simd: S, ends: S::F32) -> f32 {
        let z = self.axes[2];
        let deepest = ends.mul_add(self.direction[z], self.origin[z]) * simd.splat_f32(self.towards);
        (deepest.greatest() + SHAFT_MARGIN[0] * self.unit).min(FAR_PLANE)
    }

    /// Which of several boxes the shaft meets, and how far along the axis each begins.
    #[inline(always)]
    fn meets(&self, simd: S, planes: &impl Planes<S>, reach: f32) -> (<S::F32 as Lanes>::Mask, S::F32) {
        let [x, y, z] = self.axes;
        let towards = simd.splat_f32(self.towards);
        let (near, far) = if self.towards > 0.0 { (z, 3 + z) } else { (3 + z, z) };
        let begin = planes.plane(simd, near) * towards;
        let end = planes.plane(simd, far) * towards;
        let mut met = end.ge(simd.splat_f32(self.first)) & begin.le(simd.splat_f32(reach));
        let [above, below] = &self.lines[0];
        met = met & planes.plane(simd, x).le(planes.plane(simd, above.plane).mul_add(above.slope, above.at));
        met = met
            & planes.plane(simd, 3 + x).ge(planes.plane(simd, below.plane).mul_add(below.slope, below.at));
        let [above, below] = &self.lines[1];
        met = met & planes.plane(simd, y).le(planes.plane(simd, above.plane).mul_add(above.slope, above.at));
        met = met
            & planes.plane(simd, 3 + y).ge(planes.plane(simd, below.plane).mul_add(below.slope, below.at));
        (met, begin)
    }

    /// The children of a node that the shaft meets, pushed so that the nearest comes last; returns the new height.
    #[inline(always)]
    pub(crate) fn push_children<const W: usize>(
        &self,
        simd: S,
        node: &Node<W>,
        reach: f32,
        stack: &mut [(Child, f32)],
        height: usize,
    ) -> usize {
        let (met, begin) = self.meets(simd, node, reach);
        let mut bits = met.bits();
        if bits == 0 {
            return height;
        }
        let mut begins = [0.0; W];
        begin.store(&mut begins);
        let base = height;
        let mut height = height;
        while bits != 0 {
            let lane = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let entry = (Child(node.children[lane]), begins[lane]);
            let mut place = height;
            while place > base && stack[place - 1].1 < entry.1 {
                stack[place] = stack[place - 1];
                place -= 1;
            }
            stack[place] = entry;
            height += 1;
        }
        height
    }

    /// The primitives of a block that the shaft meets.
    #[inline(always)]
    pub(crate) fn candidates(&self, simd: S, block: &impl Planes<S>, reach: f32) -> u32 {
        self.meets(simd, block, reach).0.bits()
    }
}

/// Boxes in lanes, by their six planes: lower x, y, z, then upper.
pub(crate) trait Planes<S: Simd> {
    /// A plane of every box.
    fn plane(&self, simd: S, plane: usize) -> S::F32;
}

impl<S: Simd, const W: usize> Planes<S> for Node<W> {
    #[inline(always)]
    fn plane(&self, simd: S, plane: usize) -> S::F32 {
        simd.load_f32(&self.planes[plane])
    }
}
