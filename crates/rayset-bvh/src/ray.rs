//! A ray in culling space.

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Ray, Span};
use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::columns::RayColumns;
use crate::faces::{Beginning, lost};
use crate::frame::{Frame, round_up};
use crate::interval::{SpanLanes, splat};
use crate::packet::narrow;
use crate::shear::{Along, Doubles, Room, Shearing, Shears, turn_axes};
use crate::triangles::{Rounding, VERTEX_MARGIN};

mod one;
#[cfg(test)]
mod tests;

pub(crate) use one::CullRay;

/// How far planes of boxes are moved outwards, in units of the rounding of a coordinate: of a ray in culling space.
///
/// Covers the rounding of single precision in the origin, the direction, its inverse and the distance to a plane.
/// Derived in `docs/numerics.md`.
pub const SLAB_MARGIN: f32 = 96.0;

/// The rounding of single precision.
pub(crate) const SINGLE: f32 = 1.0 / 16_777_216.0;

/// How far a computed hit may lie off its primitive's box, relative to the coordinates involved, in double precision:
/// twice `PARTITION_MARGIN`.
pub(crate) const HIT_MARGIN: f64 = 2.0 * rayset_geometry::PARTITION_MARGIN;

/// An origin farther out than this is moved along the ray first; in units of culling space.
pub(crate) const FAR: f32 = 4.0;

/// What counts as the end of a span that has none: rounding infinity down would give NaN, which no hit lies before.
const LAST: f32 = 1e38;

/// Components of the direction of a smaller size count as this.
pub(crate) const LEAST_COMPONENT: f32 = 1e-18;

/// The axes of a shear: those across and the one along, by the latter, and by whether the ray runs against it, since a
/// mirrored axis would turn the triangles round.
const SHEAR_AXES: [[[usize; 3]; 2]; 3] =
    [[[1, 2, 0], [2, 1, 0]], [[2, 0, 1], [0, 2, 1]], [[0, 1, 2], [1, 0, 2]]];

/// What rays will be tested against.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Targets {
    /// Flat shapes, for which they are sheared.
    pub(crate) are_flat: bool,
    /// Boxes of which many are flat along an axis, so that it is worth finding the faces that rays leave behind.
    pub(crate) have_faces: bool,
}

#[cfg(test)]
impl Targets {
    /// Flat shapes, of whose faces nothing is asked.
    pub(crate) const FLAT: Self = Self { are_flat: true, have_faces: false };
}

/// As many rays as there are lanes, prepared for culling, which only discards what the `f64` rays cannot hit.
///
/// They are prepared together, since that takes as long as preparing one, and traced one by one.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct CullRays<const W: usize> {
    /// One over the directions.
    inverse: [[f32; W]; 3],
    /// What is added to the distance of a near or far plane.
    near_offset: [[f32; W]; 3],
    far_offset: [[f32; W]; 3],
    /// Of the face that each leaves behind, the axis across, the sense in which it does, 0 if there is none, and the
    /// coordinate times that.
    face_axis: [f32; W],
    face_sense: [f32; W],
    face_place: [f32; W],
    /// The origins in culling space, moved along the rays if they were far off, and the directions; rounded.
    origin: [[f32; W]; 3],
    direction: [[f32; W]; 3],
    /// The factors of the shears, `-d_x / d_z`, `-d_y / d_z` and `1 / d_z`, and where `z` is 0: x, y and the distance.
    factors: [[f32; W]; 3],
    crossings: [[f32; W]; 3],
    /// Where each span starts, or less, and or more.
    start: [f32; W],
    start_above: [f32; W],
    /// Where each span ends, or less, and or more.
    end_below: [f32; W],
    end_above: [f32; W],
    /// The rounding of a coordinate: `2^-24 (1 + the origin's largest coordinate)` and what `f64` adds.
    pub(crate) unit: [f32; W],
    /// How far tests of flat shapes may be off: vertices, and distances.
    vertex_slack: [f32; W],
    distance_slack: [f32; W],
    /// How far the origins were moved along the rays, in units of culling space.
    advance: [f64; W],
    /// World units to units of culling space.
    scale: f64,
    /// The lanes whose direction is negative along each axis.
    turned: [u32; 3],
    /// The lanes that are sheared along the first axis, and along the last.
    along_first: u32,
    along_last: u32,
    /// The lanes that are so far off that they cannot hit anything.
    lost: u32,
}

/// What of rays boxes are tested with, a lane each: as of a [`CullRay`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct SlabsOfRays<S: Simd> {
    pub(crate) inverse: [S::F32; 3],
    pub(crate) near_offset: [S::F32; 3],
    pub(crate) far_offset: [S::F32; 3],
    /// Whose upper planes are near, along each axis.
    pub(crate) turned: [<S::F32 as Lanes>::Mask; 3],
    pub(crate) start: S::F32,
}

/// The faces that rays leave behind, a lane each, by axis: none along an axis where the sense is 0, and the place below that.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FacesOfRays<S: Simd> {
    pub(crate) sense: [S::F32; 3],
    pub(crate) place: [S::F32; 3],
}

/// What of prepared rays one primitive is tested with, a lane each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedLanes<S: Simd> {
    pub(crate) origin: [S::F32; 3],
    pub(crate) direction: [S::F32; 3],
    /// Each along an axis of its own.
    shears: Shears<S>,
    /// Which are sheared along the first axis, which along the last, and which against theirs.
    along_first: <S::F32 as Lanes>::Mask,
    along_last: <S::F32 as Lanes>::Mask,
    turned: <S::F32 as Lanes>::Mask,
    /// The greatest rounding of a coordinate.
    pub(crate) unit: f32,
    rounding: Rounding,
    pub(crate) span: SpanLanes<S>,
}

impl<S: Simd> Shearing<S> for PreparedLanes<S> {
    #[inline(always)]
    fn shears(&self) -> &Shears<S> {
        &self.shears
    }

    #[inline(always)]
    fn rounding(&self) -> Rounding {
        self.rounding
    }

    #[inline(always)]
    fn in_order(&self, simd: S, vector: [f32; 3]) -> [S::F32; 3] {
        turn_axes(splat(simd, vector), self.along_first, self.along_last, self.turned)
    }
}

/// Three columns.
#[inline(always)]
fn load_three<S: Simd, const W: usize>(simd: S, [x, y, z]: &[[f32; W]; 3]) -> [S::F32; 3] {
    [simd.load_f32(x), simd.load_f32(y), simd.load_f32(z)]
}

/// Rays some of which start far off, brought near.
struct Approached<const W: usize> {
    origins: [[f64; W]; 3],
    starts: [f64; W],
    ends: [f64; W],
    hit_slacks: [f32; W],
}

/// How far the `f64` hit may be off, by the largest coordinate of the origin as it was: it grows with that, and with
/// those of the scene.
#[inline(always)]
fn hit_slack<S: Simd>(simd: S, frame: &Frame, size: S::F32) -> S::F32 {
    #![expect(clippy::cast_possible_truncation, reason = "the margin makes up for the rounding")]
    let least = HIT_MARGIN * (2.0 * frame.remoteness + 1.0);
    size * simd.splat_f32((2.0 * HIT_MARGIN) as f32) + simd.splat_f32(least as f32)
}

/// Values from `first` on, one a lane; lanes that are not asked for may hold what comes next.
#[inline(always)]
fn narrow_some<S: Simd, const W: usize>(
    simd: S,
    column: &[f64],
    (first, len): (usize, usize),
    (offset, scale): (f64, f64),
) -> S::F32 {
    match column.get(first..first + W) {
        Some(values) => simd.narrow_f32(values, offset, scale),
        None => narrow::<S, W>(simd, column, (first, len), (offset, scale), None),
    }
}

impl<const W: usize> CullRays<W> {
    /// No rays.
    pub(crate) const NONE: Self = Self {
        inverse: [[0.0; W]; 3],
        near_offset: [[0.0; W]; 3],
        far_offset: [[0.0; W]; 3],
        face_axis: [0.0; W],
        face_sense: [0.0; W],
        face_place: [0.0; W],
        origin: [[0.0; W]; 3],
        direction: [[0.0; W]; 3],
        factors: [[0.0; W]; 3],
        crossings: [[0.0; W]; 3],
        start: [0.0; W],
        start_above: [0.0; W],
        end_below: [0.0; W],
        end_above: [0.0; W],
        unit: [0.0; W],
        vertex_slack: [0.0; W],
        distance_slack: [0.0; W],
        advance: [0.0; W],
        scale: 1.0,
        turned: [0; 3],
        along_first: 0,
        along_last: 0,
        lost: u32::MAX,
    };

    /// Prepares the rays of columns from `first` on, 1 to `W` of them.
    #[inline(always)]
    pub(crate) fn prepare<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        place: (usize, usize),
        targets: Targets,
    ) {
        let (zero, one) = (simd.splat_f32(0.0), simd.splat_f32(1.0));
        let (mut origin, mut direction) = ([zero; 3], [zero; 3]);
        let mut sheared = None;
        if targets.are_flat {
            let room;
            let doubles = if rays.len() - place.0 >= W {
                Doubles::of(frame, rays, place.0..place.0 + W)
            } else {
                room = Room::<W>::of(frame, rays, place, 0.0);
                Doubles::within(&room)
            };
            let (ways, along) = doubles.ways_of_each::<S, W>(simd);
            (origin, direction) = (ways.origin, ways.direction);
            sheared = Some((ways.shears, along));
        } else {
            for k in 0..3 {
                let moved = (frame.center[k], frame.scale);
                origin[k] = narrow_some::<S, W>(simd, rays.origins[k], place, moved);
                direction[k] = narrow_some::<S, W>(simd, rays.directions[k], place, (0.0, 1.0));
            }
        }
        let start = narrow_some::<S, W>(simd, rays.spans.0, place, (0.0, frame.scale));
        let mut end = narrow_some::<S, W>(simd, rays.spans.1, place, (0.0, frame.scale));
        // Nothing is between NaN and anything.
        let is_span = start.le(end);
        // What lies behind an origin is no hit.
        let mut start = start.max(zero);
        let largest = |[x, y, z]: [S::F32; 3]| x.abs().max(y.abs()).max(z.abs());
        let mut size = largest(origin);
        let mut hit_slack = hit_slack(simd, frame, size);
        self.scale = frame.scale;
        self.lost = 0;
        self.advance = [0.0; W];
        let is_near = size.le(simd.splat_f32(FAR)) & hit_slack.lt(one);
        if (!is_near).bits() & (u32::MAX >> (32 - place.1)) != 0 {
            let mut slacks = [0.0; W];
            hit_slack.store(&mut slacks);
            let near = self.approach(frame, rays, place, slacks);
            for (coordinate, column) in origin.iter_mut().zip(&near.origins) {
                *coordinate = simd.narrow_f32(column, 0.0, 1.0);
            }
            if targets.are_flat {
                let room = Room { origins: near.origins, ..Room::<W>::of(frame, rays, place, 0.0) };
                let (ways, along) = Doubles::within(&room).ways_of_each::<S, W>(simd);
                sheared = Some((ways.shears, along));
            }
            start = simd.narrow_f32(&near.starts, 0.0, 1.0);
            end = simd.narrow_f32(&near.ends, 0.0, 1.0);
            size = largest(origin);
            hit_slack = simd.load_f32(&near.hit_slacks);
        }
        self.lost |= (!is_span).bits();
        let unit = (one + size) * simd.splat_f32(SINGLE) + hit_slack;
        unit.store(&mut self.unit);
        // As `round_up` and `round_down` do.
        let rounding = |value: S::F32| {
            value.abs() * simd.splat_f32(1.0 / 4_194_304.0) + simd.splat_f32(f32::MIN_POSITIVE)
        };
        let begin = start - rounding(start);
        begin.store(&mut self.start);
        (start + rounding(start)).store(&mut self.start_above);
        let last = end.min(simd.splat_f32(LAST));
        (last - rounding(last)).store(&mut self.end_below);
        (end + rounding(end)).store(&mut self.end_above);
        let slack = simd.splat_f32(SLAB_MARGIN) * unit;
        let (least, most) = (simd.splat_f32(LEAST_COMPONENT), simd.splat_f32(1.0 / LEAST_COMPONENT));
        for k in 0..3 {
            let (o, d) = (origin[k], direction[k]);
            let inverse = (one / d).select(d.abs().ge(least), most);
            let is_turned = inverse.lt(zero);
            let towards = (-slack).select(is_turned, slack);
            ((-o - towards) * inverse).store(&mut self.near_offset[k]);
            ((towards - o) * inverse).store(&mut self.far_offset[k]);
            inverse.store(&mut self.inverse[k]);
            o.store(&mut self.origin[k]);
            d.store(&mut self.direction[k]);
            self.turned[k] = is_turned.bits();
        }
        if let Some((shears, along)) = &sheared {
            self.keep_shears(simd, shears, *along, simd.splat_f32(SINGLE * frame.reach) + hit_slack);
        }
        if !targets.have_faces {
            return;
        }
        zero.store(&mut self.face_sense);
        // Initial rays leave nothing.
        if begin.gt(zero).any() {
            self.find_faces(simd, frame, rays, place, [origin, direction], [begin, hit_slack]);
        }
    }

    /// Finds the faces that the rays leave behind: of several, the one that is farthest behind.
    #[inline(always)]
    fn find_faces<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame,
        rays: &RayColumns<'_>,
        place: (usize, usize),
        [origin, direction]: [[S::F32; 3]; 2],
        [begin, hit_slack]: [S::F32; 2],
    ) {
        let (zero, one) = (simd.splat_f32(0.0), simd.splat_f32(1.0));
        let (mut axis, mut sense, mut face, mut farthest) = (zero, zero, zero, zero);
        let mut number = zero;
        for k in 0..3 {
            let lost = lost::<S, W>(simd, frame, k, rays.origins[k], place);
            let (is_passed, past) =
                Beginning::<S> { lost, start: begin, direction: direction[k], hit_slack }.passed(simd);
            let is_farther = is_passed & past.gt(farthest);
            farthest = past.select(is_farther, farthest);
            axis = number.select(is_farther, axis);
            let towards = (-one).select(direction[k].lt(zero), one);
            sense = towards.select(is_farther, sense);
            face = (towards * origin[k]).select(is_farther, face);
            number = number + one;
        }
        axis.store(&mut self.face_axis);
        sense.store(&mut self.face_sense);
        face.store(&mut self.face_place);
    }

    /// Keeps how the rays are sheared, and how far tests of flat shapes may then be off.
    #[inline(always)]
    fn keep_shears<S: Simd>(&mut self, simd: S, shears: &Shears<S>, along: Along, unit: S::F32) {
        for k in 0..3 {
            shears.factors[k].store(&mut self.factors[k]);
            shears.crossings[k].store(&mut self.crossings[k]);
        }
        (self.along_first, self.along_last) = (along.first, along.last);
        (simd.splat_f32(VERTEX_MARGIN) * unit).store(&mut self.vertex_slack);
        shears.distance_slack(simd, unit).store(&mut self.distance_slack);
    }

    /// Brings near what starts far off, each ray for itself.
    #[inline(never)]
    #[expect(clippy::cast_possible_truncation, reason = "as the lanes compare it")]
    fn approach(
        &mut self,
        frame: &Frame,
        rays: &RayColumns<'_>,
        (first, len): (usize, usize),
        hit_slacks: [f32; W],
    ) -> Approached<W> {
        let mut near = Approached { origins: [[0.0; W]; 3], starts: [0.0; W], ends: [0.0; W], hit_slacks };
        for lane in 0..W {
            let (ray, span) = rays.ray(first + lane.min(len - 1));
            let mut origin = frame.point(ray.origin());
            let (mut start, mut advance) = (span.start * frame.scale, 0.0);
            if near.hit_slacks[lane].is_nan() || near.hit_slacks[lane] >= 1.0 {
                // So far off that a hit's error is larger than the scene: every box is met.
                (origin, near.hit_slacks[lane], start) = (DVec3::ZERO, 1e6, f64::NEG_INFINITY);
            } else if origin.abs().max_element() as f32 > FAR {
                // Nothing lies nearer than the distance to a sphere round the unit cube.
                advance = (origin.length() - f64::from(FAR)).max(0.0);
                origin += advance * ray.direction();
                self.lost |= u32::from(origin.abs().max_element() > f64::from(4.0 * FAR)) << lane;
            }
            for k in 0..3 {
                near.origins[k][lane] = origin[k];
            }
            near.starts[lane] = start - advance;
            near.ends[lane] = span.end * frame.scale - advance;
            self.advance[lane] = advance;
        }
        near
    }

    /// What boxes are tested with.
    #[inline(always)]
    pub(crate) fn slabs<S: Simd>(&self, simd: S) -> SlabsOfRays<S> {
        let (zero, none) = (simd.splat_f32(0.0), simd.mask_f32(0));
        let mut slabs = SlabsOfRays {
            inverse: [zero; 3],
            near_offset: [zero; 3],
            far_offset: [zero; 3],
            turned: [none; 3],
            start: simd.load_f32(&self.start),
        };
        for k in 0..3 {
            slabs.inverse[k] = simd.load_f32(&self.inverse[k]);
            slabs.near_offset[k] = simd.load_f32(&self.near_offset[k]);
            slabs.far_offset[k] = simd.load_f32(&self.far_offset[k]);
            slabs.turned[k] = simd.mask_f32(self.turned[k]);
        }
        slabs
    }

    /// The faces that they leave behind.
    #[inline(always)]
    #[expect(clippy::cast_precision_loss, reason = "the number of an axis")]
    pub(crate) fn faces<S: Simd>(&self, simd: S) -> FacesOfRays<S> {
        let zero = simd.splat_f32(0.0);
        let below = simd.splat_f32(-1.0);
        let (axis, sense) = (simd.load_f32(&self.face_axis), simd.load_f32(&self.face_sense));
        let mut faces = FacesOfRays { sense: [zero; 3], place: [below; 3] };
        for k in 0..3 {
            let here = axis.eq(simd.splat_f32(k as f32)) & sense.abs().gt(zero);
            faces.sense[k] = sense.select(here, zero);
            faces.place[k] = simd.load_f32(&self.face_place).select(here, below);
        }
        faces
    }

    /// What a primitive is tested with.
    #[inline(always)]
    pub(crate) fn lanes<S: Simd>(&self, simd: S) -> PreparedLanes<S> {
        let factors = load_three(simd, &self.factors);
        PreparedLanes {
            origin: load_three(simd, &self.origin),
            direction: load_three(simd, &self.direction),
            shears: Shears { factors, crossings: load_three(simd, &self.crossings) },
            along_first: simd.mask_f32(self.along_first),
            along_last: simd.mask_f32(self.along_last),
            turned: factors[2].lt(simd.splat_f32(0.0)),
            unit: simd.load_f32(&self.unit).greatest(),
            rounding: Rounding {
                vertex: simd.load_f32(&self.vertex_slack).greatest(),
                steepness: 1.0,
                distance: simd.load_f32(&self.distance_slack).greatest(),
            },
            span: SpanLanes {
                start: simd.load_f32(&self.start),
                start_above: simd.load_f32(&self.start_above),
                end_below: simd.load_f32(&self.end_below),
                ends: simd.load_f32(&self.end_above),
            },
        }
    }

    /// Multiplies how far tests of primitives may be off.
    #[cfg(test)]
    pub(crate) fn loosen(&mut self, factor: f32) {
        for slacks in [&mut self.unit, &mut self.vertex_slack, &mut self.distance_slack] {
            *slacks = slacks.map(|slack| slack * factor);
        }
    }

    /// The lanes whose rays run backwards along some axes, a bit each, and along no others.
    #[inline(always)]
    pub(crate) fn turned(&self, axes: u32) -> u32 {
        let [x, y, z] = [0, 1, 2].map(|k| self.turned[k] ^ (axes >> k & 1).wrapping_sub(1));
        x & y & z
    }

    /// The lanes, of the first so many, whose rays may hit something.
    #[inline(always)]
    pub(crate) fn found(&self, len: usize) -> u32 {
        !self.lost & (u32::MAX >> (32 - len))
    }

    /// Where each span ends, or more.
    #[inline(always)]
    pub(crate) fn ends(&self) -> &[f32; W] {
        &self.end_above
    }

    /// A distance in culling space that is not below `t` in world units.
    #[inline(always)]
    pub(crate) fn end(&self, lane: usize, t: f64) -> f32 {
        round_up(t * self.scale - self.advance[lane])
    }

    /// A ray; `None` if it is so far off, or its span such, that it cannot hit anything.
    #[inline(always)]
    pub(crate) fn ray(&self, lane: usize) -> Option<CullRay<'_, W>> {
        if self.lost >> lane & 1 == 1 {
            return None;
        }
        let along =
            if self.along_last >> lane & 1 == 1 { 2 } else { 1 - (self.along_first >> lane & 1) as usize };
        let turned = (self.turned[along] >> lane & 1) as usize;
        Some(CullRay { rays: self, lane, axes: SHEAR_AXES[along][turned] })
    }

    /// Prepares one ray, of which there are as many copies as lanes.
    #[inline(always)]
    pub(crate) fn alone<S: Simd>(simd: S, frame: &Frame, copies: &RayColumns<'_>, targets: Targets) -> Self {
        let mut rays = Self::NONE;
        rays.prepare(simd, frame, copies, (0, W), targets);
        rays
    }
}

/// A ray as columns of copies.
#[derive(Clone, Debug)]
pub(crate) struct Copies<const W: usize> {
    origins: [[f64; W]; 3],
    directions: [[f64; W]; 3],
    spans: ([f64; W], [f64; W]),
}

impl<const W: usize> Copies<W> {
    #[inline(always)]
    pub(crate) fn of(ray: &Ray, span: Span) -> Self {
        Self {
            origins: ray.origin().to_array().map(|x| [x; W]),
            directions: ray.direction().to_array().map(|x| [x; W]),
            spans: ([span.start; W], [span.end; W]),
        }
    }

    #[inline(always)]
    pub(crate) fn columns(&self) -> RayColumns<'_> {
        let ([ox, oy, oz], [dx, dy, dz]) = (&self.origins, &self.directions);
        RayColumns {
            origins: [ox, oy, oz],
            directions: [dx, dy, dz],
            spans: (&self.spans.0, &self.spans.1),
            left: &[],
        }
    }
}
