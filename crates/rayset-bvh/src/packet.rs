//! As many rays as there are lanes, in culling space.

use std::ops::Range;

use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::columns::{HitOrNone, Left, RayColumns};
use crate::frame::{Frame, round_down, round_up};
use crate::interval::SpanLanes;
use crate::ray::{FAR, HIT_MARGIN, LEAST_COMPONENT, SINGLE, SLAB_MARGIN};
use crate::shear::{Doubles, Room, Shears, Ways};

/// Where a lane without a ray ends, and one that asks for nothing more.
const NOWHERE: f32 = -1e30;
/// How far from the middle of culling space the nearest ray of a packet is brought, if it starts far off: before the
/// sphere round all there is, and so that others do not end up beyond [`FAR`].
const BEFORE: f64 = 2.0;

/// A mask over the lanes of a packet.
pub(crate) type Mask<S> = <<S as Simd>::F32 as Lanes>::Mask;

/// Rays in culling space, a lane each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Packet<S: Simd, const W: usize> {
    /// Where its rays begin in the columns, and how many there are.
    pub(crate) first: usize,
    pub(crate) len: usize,
    /// How far its rays were moved along their directions.
    advance: f64,
    pub(crate) origin: [S::F32; 3],
    pub(crate) direction: [S::F32; 3],
    /// The shears along the last of the axes in an order.
    pub(crate) shears: Shears<S>,
    pub(crate) axes: [usize; 3],
    /// The spans, outwards and inwards; lanes without a ray have none.
    pub(crate) start: S::F32,
    pub(crate) start_above: S::F32,
    pub(crate) end_below: S::F32,
    /// What is still to be found lies before these.
    pub(crate) ends: S::F32,
    /// What each ray leaves, and the lanes that leave it into its front; if any leaves anything.
    left: [u32; W],
    left_front: u32,
    leaves: bool,
    /// The lanes of which a hit is known.
    pub(crate) known: u32,
}

/// What the distances of a packet's rays to planes across the axes are made of: `plane inverse + offset`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slabs<S: Simd> {
    inverse: [S::F32; 3],
    /// For the lower planes, and the upper.
    low: [S::F32; 3],
    high: [S::F32; 3],
}

impl<S: Simd> Slabs<S> {
    /// The rays that meet a box between where they start and end, and where they enter it, or nearer.
    #[inline(always)]
    pub(crate) fn enter(
        &self,
        simd: S,
        [low, high]: [[f32; 3]; 2],
        start: S::F32,
        end: S::F32,
    ) -> (<S::F32 as Lanes>::Mask, S::F32) {
        let (mut near, mut far) = (start, end);
        for k in 0..3 {
            let a = simd.splat_f32(low[k]).mul_add(self.inverse[k], self.low[k]);
            let b = simd.splat_f32(high[k]).mul_add(self.inverse[k], self.high[k]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near.le(far), near)
    }
}

/// Rays of a list, and how those that start far off are brought near before single precision sees them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Approach<'a> {
    pub(crate) frame: &'a Frame,
    rays: &'a RayColumns<'a>,
    /// The axis along which the rays go most, last of the axes in an order.
    pub(crate) axes: [usize; 3],
    /// Whether they meet flat shapes, for which they are sheared.
    pub(crate) is_flat: bool,
    /// How far all are moved along their directions, in units of culling space.
    advance: f64,
    /// The largest coordinate of an origin that was moved.
    size: f64,
}

impl<'a> Approach<'a> {
    /// That of some rays of a list: they are moved only if the first starts far off.
    #[inline(always)]
    pub(crate) fn of(frame: &'a Frame, rays: &'a RayColumns<'a>, range: Range<usize>, is_flat: bool) -> Self {
        let axes = common_axes(rays, range.clone());
        let approach = Self { frame, rays, axes, is_flat, advance: 0.0, size: 0.0 };
        let is_far = frame.point(rays.origin(range.start)).abs().max_element() > f64::from(FAR);
        if is_far { approach.brought_near(range) } else { approach }
    }

    #[inline(never)]
    fn brought_near(self, range: Range<usize>) -> Self {
        let (mut nearest, mut size) = (f64::INFINITY, 0.0_f64);
        for i in range {
            let origin = self.frame.point(self.rays.origin(i));
            nearest = nearest.min(origin.length());
            size = size.max(origin.abs().max_element());
        }
        Self { advance: (nearest - BEFORE).max(0.0), size, ..self }
    }

    /// The same, with the axis along which some of the rays go most.
    #[inline(always)]
    pub(crate) fn by<S: Simd, const W: usize>(self, packet: &Packet<S, W>) -> Self {
        Self { axes: common_axes(self.rays, packet.first..packet.first + packet.len), ..self }
    }

    /// The rays from `first` on, 1 to `W` of them, and their shears.
    #[inline(always)]
    pub(crate) fn ways<S: Simd, const W: usize>(&self, simd: S, (first, len): (usize, usize)) -> Ways<S> {
        let Self { frame, rays, axes, advance, .. } = *self;
        let room;
        let doubles = if advance.abs() > 0.0 || len < W {
            room = Room::<W>::of(frame, rays, (first, len), advance);
            Doubles::within(&room)
        } else {
            Doubles::of(frame, rays, first..first + W)
        };
        doubles.ways::<S, W>(simd, axes)
    }
}

/// The axes in an order such that the first, a middle and the last of some rays go most along the last; turned the other
/// way if they go against it, since a mirrored axis would turn triangles round.
#[inline(always)]
fn common_axes(rays: &RayColumns<'_>, range: Range<usize>) -> [usize; 3] {
    let middle = range.start + range.len() / 2;
    let sum = rays.direction(range.start) + rays.direction(middle) + rays.direction(range.end - 1);
    let size = sum.abs();
    let mut z = usize::from(size.y > size.x);
    if size.z > size[z] {
        z = 2;
    }
    if sum[z] < 0.0 { [(z + 2) % 3, (z + 1) % 3, z] } else { [(z + 1) % 3, (z + 2) % 3, z] }
}

/// How far coordinates may be off in culling space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Units {
    /// Those of origins: the rounding of single precision for the largest, and what `f64` adds.
    pub(crate) of_rays: f32,
    /// Those of what lies in the scene.
    pub(crate) of_scene: f32,
}

/// Values from `first` on, one a lane; where fewer are left, the last again. If rays are moved, with what is added to
/// each: the move along a direction, or less, for distances, where there are no directions.
#[inline(always)]
pub(crate) fn narrow<S: Simd, const W: usize>(
    simd: S,
    column: &[f64],
    (first, len): (usize, usize),
    (offset, scale): (f64, f64),
    moved: Option<(&[f64], f64)>,
) -> S::F32 {
    if let Some(values) = column.get(first..first + W)
        && len == W
        && moved.is_none()
    {
        return simd.narrow_f32(values, offset, scale);
    }
    let mut values = [0.0; W];
    for (lane, value) in values.iter_mut().enumerate() {
        let i = first + lane.min(len - 1);
        *value = (column[i] - offset) * scale;
        if let Some((directions, advance)) = moved {
            *value += advance * directions.get(i).copied().unwrap_or(-1.0);
        }
    }
    simd.narrow_f32(&values, 0.0, 1.0)
}

impl<S: Simd, const W: usize> Packet<S, W> {
    /// Without rays; there are `W` of these where packets are made, in their place.
    #[inline(always)]
    pub(crate) fn none(simd: S) -> Self {
        let zero = simd.splat_f32(0.0);
        Self {
            first: 0,
            len: 0,
            advance: 0.0,
            origin: [zero; 3],
            direction: [zero; 3],
            shears: Shears::none(simd),
            axes: [0, 1, 2],
            start: zero,
            start_above: zero,
            end_below: zero,
            ends: zero,
            left: [Left::NOBODY; W],
            left_front: 0,
            leaves: false,
            known: 0,
        }
    }

    /// The rays of columns from `first` on: 1 to `W` of them.
    #[cfg(test)]
    pub(crate) fn new(simd: S, first: usize, len: usize, approach: &Approach<'_>) -> Self {
        let mut packet = Self::none(simd);
        packet.take(simd, (first, len), approach);
        packet
    }

    /// Takes rays of columns from `first` on: 1 to `W` of them.
    #[inline(always)]
    pub(crate) fn take(&mut self, simd: S, (first, len): (usize, usize), approach: &Approach<'_>) {
        let Approach { frame, rays, advance, .. } = *approach;
        let moved = advance > 0.0;
        let zero = simd.splat_f32(0.0);
        let place = (first, len);
        if approach.is_flat {
            let ways = approach.ways::<S, W>(simd, place);
            (self.origin, self.direction, self.shears) = (ways.origin, ways.direction, ways.shears);
            self.axes = approach.axes;
        } else {
            for k in 0..3 {
                let along = moved.then_some((rays.directions[k], advance));
                let column = rays.origins[k];
                self.origin[k] = narrow::<S, W>(simd, column, place, (frame.center[k], frame.scale), along);
                self.direction[k] = narrow::<S, W>(simd, rays.directions[k], place, (0.0, 1.0), None);
            }
        }
        // Spans begin where the origins now are.
        let back = moved.then_some((&[][..], advance));
        let starts = narrow::<S, W>(simd, rays.spans.0, place, (0.0, frame.scale), back);
        let ends = narrow::<S, W>(simd, rays.spans.1, place, (0.0, frame.scale), back);
        // Nothing is between NaN and anything.
        let is_ray = simd.mask_f32(u32::MAX >> (32 - len)) & starts.le(ends);
        let starts = starts.max(zero);
        self.leaves = !rays.left.is_empty();
        if self.leaves {
            let mut left = [Left::NOTHING; W];
            match rays.left.get(first..first + W) {
                Some(all) => left.copy_from_slice(all),
                None => left[..len].copy_from_slice(&rays.left[first..first + len]),
            }
            (self.left, self.left_front) = Left::split(simd, &left);
        }
        (self.first, self.len, self.advance, self.known) = (first, len, advance, 0);
        (self.start, self.end_below) = (starts, ends);
        self.ends = ends.min(simd.splat_f32(1e30)).select(is_ray, simd.splat_f32(NOWHERE));
    }

    /// Prepares its rays for boxes, whose planes are moved outwards by [`SLAB_MARGIN`] of a unit.
    #[inline(always)]
    pub(crate) fn slabs(&self, simd: S, unit: f32) -> Slabs<S> {
        let slack = simd.splat_f32(SLAB_MARGIN * unit);
        let least = simd.splat_f32(LEAST_COMPONENT);
        let (one, most) = (simd.splat_f32(1.0), simd.splat_f32(1.0 / LEAST_COMPONENT));
        let zero = simd.splat_f32(0.0);
        let mut slabs = Slabs { inverse: [zero; 3], low: [zero; 3], high: [zero; 3] };
        for k in 0..3 {
            let inverse = (one / self.direction[k]).select(self.direction[k].abs().ge(least), most);
            slabs.inverse[k] = inverse;
            slabs.low[k] = (zero - self.origin[k] - slack) * inverse;
            slabs.high[k] = (slack - self.origin[k]) * inverse;
        }
        slabs
    }

    /// Shears its rays along the axis of a shaft, where that is another.
    #[inline(always)]
    pub(crate) fn turn(&mut self, simd: S, approach: &Approach<'_>) {
        let [x, y, z] = approach.axes;
        if !approach.is_flat {
            // Nothing is sheared but the lines of the shaft.
            let inverse = simd.splat_f32(1.0) / self.direction[z];
            let factors = [-self.direction[x] * inverse, -self.direction[y] * inverse, inverse];
            self.shears = Shears { factors, ..self.shears };
        } else if self.axes[0] != x || self.axes[1] != y {
            self.shears = approach.ways::<S, W>(simd, (self.first, self.len)).shears;
        }
        self.axes = approach.axes;
    }

    /// Where its rays cross a plane across the axis of a shaft: in x and in y.
    #[inline(always)]
    pub(crate) fn at_plane(&self, simd: S, plane: f32, is_flat: bool) -> [S::F32; 2] {
        let [x, y, z] = self.axes;
        let [sx, sy, _] = self.shears.factors;
        let plane = simd.splat_f32(plane);
        if is_flat {
            let [ox, oy, _] = self.shears.crossings;
            [-plane.mul_sub(sx, ox), -plane.mul_sub(sy, oy)]
        } else {
            let depth = self.origin[z] - plane;
            [depth.mul_add(sx, self.origin[x]), depth.mul_add(sy, self.origin[y])]
        }
    }

    /// The largest coordinate of each origin.
    #[inline(always)]
    fn sizes(&self) -> S::F32 {
        self.origin[0].abs().max(self.origin[1].abs()).max(self.origin[2].abs())
    }

    /// A distance in culling space that is not below, or not above, `t` in world units.
    #[inline(always)]
    pub(crate) fn above(&self, frame: &Frame, t: f64) -> f32 {
        round_up(t * frame.scale - self.advance)
    }
    #[inline(always)]
    pub(crate) fn below(&self, frame: &Frame, t: f64) -> f32 {
        round_down(t * frame.scale - self.advance)
    }

    /// Rounds the spans outwards and inwards.
    #[inline(always)]
    fn widen(&mut self, simd: S, unit: f32) {
        let (rounding, slack) = (simd.splat_f32(1.0 / 4_194_304.0), simd.splat_f32(unit));
        let start_slack = self.start.abs() * rounding + slack;
        self.start_above = self.start + start_slack;
        self.start = self.start - start_slack;
        let end_slack = self.ends.abs() * rounding + slack;
        self.end_below = self.end_below - end_slack;
        self.ends = self.ends + end_slack;
    }

    /// The lanes that leave a primitive, as far as they may not hit its front, and not its back.
    #[inline(always)]
    pub(crate) fn leaving(&self, simd: S, primitive: u32) -> (u32, u32) {
        if !self.leaves {
            return (0, 0);
        }
        let lanes = simd.equal_u32(&self.left, primitive).bits();
        (lanes, lanes & self.left_front)
    }

    /// The same in lanes, of the primitive at a place of some numbers; `None` if the rays leave nothing.
    #[inline(always)]
    pub(crate) fn lanes_that_leave(
        &self,
        simd: S,
        numbers: &[u32],
        place: usize,
    ) -> Option<(Mask<S>, Mask<S>)> {
        if !self.leaves {
            return None;
        }
        let lanes = simd.equal_u32(&self.left, numbers[place]);
        Some((lanes, lanes & simd.mask_f32(self.left_front)))
    }

    /// The spans of its rays.
    #[inline(always)]
    pub(crate) fn span(&self) -> SpanLanes<S> {
        let Self { start, start_above, end_below, ends, .. } = *self;
        SpanLanes { start, start_above, end_below, ends }
    }

    /// What is known of the rays, each a hit or none: it bounds what is still to be found. A sphere that a ray leaves into
    /// its inside and is known to hit is not asked again.
    #[inline(always)]
    pub(crate) fn know(&mut self, simd: S, frame: &Frame, known: &[HitOrNone]) {
        let (mut ends, mut lanes) = ([0.0; W], 0);
        for (lane, hit) in known.iter().enumerate() {
            if let Some(hit) = hit.get() {
                ends[lane] = self.above(frame, hit.t);
                lanes |= 1 << lane;
                if self.leaves && self.left[lane] == hit.primitive {
                    self.left_front |= 1 << lane;
                }
            }
        }
        self.ends.min(simd.load_f32(&ends)).put(simd.mask_f32(lanes), &mut self.ends);
        self.known = lanes;
    }

    /// The lanes that are answered ask for nothing more.
    #[inline(always)]
    pub(crate) fn close(&mut self, simd: S, lanes: u32) {
        simd.splat_f32(NOWHERE).put(simd.mask_f32(lanes), &mut self.ends);
    }
}

/// How far the `f64` hit may be off, by the largest coordinate of an origin as it was: it grows with that, and with those of
/// the scene.
#[inline(always)]
pub(crate) fn hit_slack(frame: &Frame, size: f64) -> f64 {
    HIT_MARGIN * (2.0 * (size + frame.remoteness) + 1.0)
}

/// Brings packets to the same rounding; `None` if an origin is far off.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the margins make up for the rounding")]
pub(crate) fn level<S: Simd, const W: usize>(
    simd: S,
    packets: &mut [Packet<S, W>],
    approach: &Approach<'_>,
) -> Option<Units> {
    let mut sizes = simd.splat_f32(0.0);
    for packet in packets.iter() {
        sizes = sizes.max(packet.sizes());
    }
    let size = sizes.greatest();
    // The error of a hit grows with the coordinates of the origin as it was.
    let hit_slack = hit_slack(approach.frame, f64::from(size).max(approach.size));
    if !(size <= FAR && hit_slack < 1e-3) {
        return None;
    }
    let of_rays = (f64::from((1.0 + size) * SINGLE) + hit_slack) as f32;
    let of_scene = (f64::from(approach.frame.reach * SINGLE) + hit_slack) as f32;
    for packet in packets {
        packet.widen(simd, of_rays);
    }
    Some(Units { of_rays, of_scene })
}
