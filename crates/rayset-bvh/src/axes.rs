//! Single-precision tests of cones and cylinders: how far their axes pass from a ray, and where along both.
//!
//! A ray that passes so near the axis that it must go through the cylinder inside, at heights of the cone all the way from
//! where it may enter the cylinder outside, surely hits the cone between the two.

use rayset_geometry::ConeAxis;
use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::frame::{Frame, round_up};
use crate::interval::{Intervals, SpanLanes, splat};
use crate::ray::CullRay;

/// How far the distance of two lines, times the sine between them, may be off, in units of the rounding of a coordinate.
pub const AXIS_MARGIN: f32 = 40.0;
/// How far the ends of the part of a line that is within reach of another may be off, along either, where the sine between
/// them is at least a half; in units of the rounding of a coordinate. Where it is less, over four times its square.
pub const REACH_MARGIN: f32 = 400.0;

/// Where the square of the sine between a ray and an axis is less, nothing is said of where they are near.
const LEAST_SQUARE: f32 = 1.0 / 256.0;
/// Cones whose radius is nowhere below this, in culling space, have sure hits.
const SURE_RADIUS: f64 = 1.0 / 16384.0;

/// `W` axes, how far from each a hit may lie, and how near to it a ray is inside.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct AxisBlock<const W: usize> {
    base: [[f32; W]; 3],
    direction: [[f32; W]; 3],
    height: [f32; W],
    reach: [f32; W],
    inside: [f32; W],
    /// From which square of the sine on a hit may be sure.
    sure_from: [f32; W],
}

/// A cone, or several, a lane each.
#[derive(Clone, Copy)]
struct Axes<S: Simd> {
    base: [S::F32; 3],
    direction: [S::F32; 3],
    height: S::F32,
    reach: S::F32,
    inside: S::F32,
    sure_from: S::F32,
}

/// The rays that axes are tested with, a pair a lane.
#[derive(Clone, Copy)]
pub(crate) struct AxisRays<S: Simd> {
    origin: [S::F32; 3],
    direction: [S::F32; 3],
    span: SpanLanes<S>,
    /// [`AXIS_MARGIN`] and [`REACH_MARGIN`], times the rounding of a coordinate.
    margins: [f32; 2],
}

impl<S: Simd> AxisRays<S> {
    /// Rays, by where they begin and go, their spans, and the rounding of a coordinate.
    #[inline(always)]
    pub(crate) fn new([origin, direction]: [[S::F32; 3]; 2], span: SpanLanes<S>, unit: f32) -> Self {
        Self { origin, direction, span, margins: [AXIS_MARGIN * unit, REACH_MARGIN * unit] }
    }

    /// A ray in every lane, which ends at `end`.
    #[inline(always)]
    fn of<const N: usize>(simd: S, ray: CullRay<'_, N>, end: f32) -> Self {
        let ways = [splat(simd, ray.origin()), splat(simd, ray.direction())];
        Self::new(ways, SpanLanes::of(simd, ray, end), ray.unit())
    }
}

impl<const W: usize> AxisBlock<W> {
    /// A block without axes: no comparison with NaN holds.
    pub(crate) const EMPTY: Self = Self {
        base: [[f32::NAN; W]; 3],
        direction: [[f32::NAN; W]; 3],
        height: [f32::NAN; W],
        reach: [f32::NAN; W],
        inside: [0.0; W],
        sure_from: [f32::INFINITY; W],
    };

    #[expect(clippy::cast_possible_truncation, reason = "the margins make up for the rounding")]
    pub(crate) fn set(&mut self, lane: usize, axis: &ConeAxis, frame: &Frame) {
        let base = frame.point(axis.base);
        for k in 0..3 {
            self.base[k][lane] = base[k] as f32;
            self.direction[k][lane] = axis.direction[k] as f32;
        }
        self.height[lane] = round_up(axis.height * frame.scale);
        self.reach[lane] = round_up(axis.reach * frame.scale);
        let inside = axis.least_radius * frame.scale;
        self.inside[lane] = inside as f32;
        let sure_from = if inside >= SURE_RADIUS { 2.0 * axis.slope * axis.slope } else { f64::INFINITY };
        self.sure_from[lane] = LEAST_SQUARE.max(round_up(sure_from));
    }

    /// Where a ray hits the cones before `end`, of which the front and the back may be hit by the bits of `sides`.
    #[inline(always)]
    pub(crate) fn intervals<S: Simd>(
        &self,
        simd: S,
        ray: CullRay<'_, W>,
        end: f32,
        (front, back): (u32, u32),
    ) -> Intervals<S> {
        let sides = (simd.mask_f32(front), simd.mask_f32(back));
        self.met_by(simd, &AxisRays::of(simd, ray, end), sides)
    }

    /// Where a ray, which stands in every lane, hits the cones.
    #[inline(always)]
    fn met_by<S: Simd>(
        &self,
        simd: S,
        ray: &AxisRays<S>,
        sides: (<S::F32 as Lanes>::Mask, <S::F32 as Lanes>::Mask),
    ) -> Intervals<S> {
        let axes = Axes {
            base: load(simd, &self.base),
            direction: load(simd, &self.direction),
            height: simd.load_f32(&self.height),
            reach: simd.load_f32(&self.reach),
            inside: simd.load_f32(&self.inside),
            sure_from: simd.load_f32(&self.sure_from),
        };
        axes.met_by(simd, ray, sides)
    }

    /// Where rays, a lane each, hit one, of which the front and the back may be hit by some.
    #[inline(always)]
    pub(crate) fn intervals_of_rays<S: Simd>(
        &self,
        simd: S,
        lane: usize,
        rays: &AxisRays<S>,
        sides: (<S::F32 as Lanes>::Mask, <S::F32 as Lanes>::Mask),
    ) -> Intervals<S> {
        let one = |[x, y, z]: &[[f32; W]; 3]| [x[lane], y[lane], z[lane]];
        let axis = Axes {
            base: splat(simd, one(&self.base)),
            direction: splat(simd, one(&self.direction)),
            height: simd.splat_f32(self.height[lane]),
            reach: simd.splat_f32(self.reach[lane]),
            inside: simd.splat_f32(self.inside[lane]),
            sure_from: simd.splat_f32(self.sure_from[lane]),
        };
        axis.met_by(simd, rays, sides)
    }
}

#[inline(always)]
fn load<S: Simd, const W: usize>(simd: S, [x, y, z]: &[[f32; W]; 3]) -> [S::F32; 3] {
    [simd.load_f32(x), simd.load_f32(y), simd.load_f32(z)]
}

/// Where both are between two others.
#[inline(always)]
fn is_within<L: CullLanes>([a, b]: [L; 2], low: L, high: L) -> L::Mask {
    a.min(b).ge(low) & a.max(b).le(high)
}

#[inline(always)]
fn dot<L: CullLanes>([ax, ay, az]: [L; 3], [bx, by, bz]: [L; 3]) -> L {
    ax.mul_add(bx, ay.mul_add(by, az * bz))
}

impl<S: Simd> Axes<S> {
    /// Where rays hit cones, a pair a lane.
    ///
    /// They may if their lines pass within reach of the axes and, unless they are nearly parallel, that part of a line lies
    /// between the circles and in the span. They surely do if they pass through the cylinder inside, and from where they
    /// may enter the one outside up to where they are in that one, or from where they leave that one on, are at heights of
    /// the cone.
    #[inline(always)]
    fn met_by(
        &self,
        simd: S,
        rays: &AxisRays<S>,
        (front, back): (<S::F32 as Lanes>::Mask, <S::F32 as Lanes>::Mask),
    ) -> Intervals<S> {
        let AxisRays { origin: [ox, oy, oz], direction, span, margins: [axis_margin, reach_margin] } = *rays;
        let Self { base, direction: axis, height, reach, inside, sure_from } = *self;
        let ([dx, dy, dz], [ax, ay, az]) = (direction, axis);
        let to_base = [base[0] - ox, base[1] - oy, base[2] - oz];
        let across = [dy * az - dz * ay, dz * ax - dx * az, dx * ay - dy * ax];
        let (zero, axis_margin) = (simd.splat_f32(0.0), simd.splat_f32(axis_margin));
        let apart = dot(to_base, across).abs();
        let (least, greatest) = ((apart - axis_margin).max(zero), apart + axis_margin);
        let squared = dot(across, across);
        let widest = reach * reach * squared;
        let is_near = (least * least).le(widest) & (front | back);
        if !is_near.any() {
            return Intervals::none(simd);
        }
        let is_oblique = squared.ge(simd.splat_f32(LEAST_SQUARE));
        let cosine = dot(direction, axis);
        let (along_ray, along_axis) = (dot(to_base, direction), dot(to_base, axis));
        let inverse = simd.splat_f32(1.0) / squared;
        let margin = (inverse * simd.splat_f32(0.25 * reach_margin)).max(simd.splat_f32(reach_margin));
        // Where the lines are nearest, along both, and how far from there the ray is within reach, and inside.
        let t = (along_ray - cosine * along_axis) * inverse;
        let m = (cosine * along_ray - along_axis) * inverse;
        let half = (widest - least * least).max(zero).sqrt() * inverse;
        let (half_t, half_m) = (half + margin, half.mul_add(cosine.abs(), margin));
        let is_there = (t + half_t).ge(span.start)
            & (t - half_t).le(span.ends)
            & (m + half_m).ge(zero)
            & (m - half_m).le(height);
        let possible = is_near & (is_there | !is_oblique);
        if !possible.any() {
            return Intervals::none(simd);
        }
        let deep = inside * inside * squared - greatest * greatest;
        let (lowest, highest) = (margin, height - margin);
        let is_inside = possible & squared.ge(sure_from) & deep.gt(zero);
        let none = Intervals { possible, sure: simd.mask_f32(0), low: zero, high: zero };
        if !is_inside.any() {
            let low = (t - half_t).select(is_oblique, span.start);
            return Intervals { low, ..none };
        }
        let narrow = deep.max(zero).sqrt() * inverse - margin;
        // The heights where it meets the cylinder outside and the one inside.
        let (outer, inner) = (half * cosine, narrow * cosine);
        let (front_m, back_m) = ([m - outer, m - inner], [m + outer, m + inner]);
        let is_front_there = is_within(front_m, lowest, highest);
        let is_back_there = is_within(back_m, lowest, highest);
        let (front_low, front_high) = (t - half_t, t - narrow);
        let (back_low, back_high) = (t + narrow, t + half_t);
        let may_enter = front & front_high.ge(span.start) & front_low.le(span.ends);
        let enters = is_inside
            & front
            & is_front_there
            & front_low.gt(span.start_above)
            & front_high.lt(span.end_below);
        let leaves =
            is_inside & back & is_back_there & back_low.gt(span.start_above) & back_high.lt(span.end_below);
        // Where only the back is sure, the hit lies between where the front may be met, if it may, and there.
        let low = back_low.select(is_inside & !may_enter, front_low).select(is_oblique, span.start);
        Intervals { possible, sure: enters | leaves, low, high: front_high.select(enters, back_high) }
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use rayset_geometry::glam::DVec3;
    use rayset_geometry::{BoundingBox, Cone, Primitive, PrimitiveColumns, Ray, Side, Sides, Span};
    use rayset_simd::{Backend, Kernel, Scalar};

    use super::*;
    use crate::ray::{Copies, CullRays, Targets};

    /// How often single precision contradicts the exact test of a cone.
    #[derive(Debug, Default)]
    struct Tally {
        lost: u32,
        false_sure: u32,
        out_of_interval: u32,
        /// How many rays are passed over, and how many hits are sure.
        passed: u32,
        sure: u32,
    }

    /// Rays that graze cylinders and cones, meet them at their ends, or end there.
    struct Doubtful {
        /// By what each margin is multiplied.
        factors: [f32; 2],
    }

    impl Kernel for Doubtful {
        type Output = Tally;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Tally {
            let mut dice = ChaCha8Rng::seed_from_u64(5);
            let mut tally = Tally::default();
            for case in 0..120_000 {
                let mut unit = || f64::from(dice.next_u32()) / f64::from(u32::MAX);
                let mut point = || DVec3::from_array(std::array::from_fn(|_| 2.0 * unit() - 1.0));
                let (base, apex, eye, aside) = (0.8 * point(), 0.8 * point(), point(), point());
                let mut pick = |values: &[f64]| values[dice.next_u32() as usize % values.len()];
                let radius = pick(&[0.1, 0.03, 1e-2, 1e-3, 1e-4, 1e-5]);
                let place = |p: DVec3| p * 30.0 + DVec3::splat(100.0);
                let apex_radius = 30.0 * radius * if case % 2 == 0 { 1.0 } else { pick(&[0.0, 0.5, 0.99]) };
                let Some(cone) = Cone::new(place(base), 30.0 * radius, place(apex), apex_radius) else {
                    continue;
                };
                let on_axis = base + pick(&[0.0, 1e-7, 1e-4, 0.5, 1.0 - 1e-7, 1.0]) * (apex - base);
                let is_grazing = case / 2 % 2 == 0;
                let eye = match case / 4 % 5 {
                    // Nearly along the axis, or by a small angle.
                    0 => on_axis - 0.3 * (apex - base) + pick(&[1e-3, 0.03, 0.1]) * aside,
                    // Nearly perpendicular to it, so that all of the ray is at one height.
                    1 | 2 if !is_grazing => {
                        let along = (apex - base).normalize_or_zero();
                        eye - (eye - on_axis).dot(along) * along
                    }
                    _ => eye,
                };
                let across = (on_axis - eye).cross(apex - base).normalize_or_zero();
                // Past the thicker end, as near as can be, or through.
                let offset = if is_grazing {
                    pick(&[
                        1.0,
                        1.0 - 1e-7,
                        1.0 - 1e-6,
                        1.0 - 1e-5,
                        1.0 + 1e-7,
                        1.0 + 1e-6,
                        1.0 + 1e-5,
                        0.5,
                        1.1,
                    ])
                } else {
                    pick(&[0.0, 0.1, 0.5, 0.9, 0.99, 0.999])
                };
                // Where the ray is nearest to the axis, or where it meets the wall, so that either is at the end.
                let is_wall = case / 60 % 2 == 0 && offset < 1.0;
                let (along, to_eye) = ((apex - base).normalize_or_zero(), eye - on_axis);
                let towards = (to_eye - to_eye.dot(along) * along).normalize_or_zero();
                let towards = if is_wall { (1.0 - offset * offset).sqrt() } else { 0.0 } * towards;
                let target = on_axis + radius * (offset * across + towards);
                let Some(ray) = Ray::between(place(eye), place(target)) else { continue };
                // How far beyond a hit spans end, or before it, where they do not miss it.
                let near = pick(&[0.0, 0.0, 1e-12, 1e-9, 1e-8, 1e-7, -1e-9, -1e-7]);
                let sides = [Sides::Both, Sides::Front, Sides::Back][dice.next_u32() as usize % 3];
                let hit = |span| Primitive::from(cone).intersect(&ray, span, sides, None);
                // A span that ends or begins where the ray hits.
                let mut span = Span::FORWARD;
                if let Some(t) = hit(span) {
                    match case / 20 % 3 {
                        0 => span.end = t * (1.0 + near),
                        1 => span.start = t * (1.0 - near),
                        _ => {}
                    }
                }
                let frame = Frame::of(&BoundingBox { min: place(DVec3::NEG_ONE), max: place(DVec3::ONE) });
                let alone = CullRays::<8>::alone(
                    Scalar,
                    &frame,
                    &Copies::<8>::of(&ray, span).columns(),
                    Targets::FLAT,
                );
                let Some(cull) = alone.ray(0) else { continue };
                let mut rays = AxisRays::of(simd, cull, cull.end_above());
                for (margin, factor) in rays.margins.iter_mut().zip(self.factors) {
                    *margin *= factor;
                }
                let mut columns = PrimitiveColumns::default();
                let run = columns.push(&cone.into(), Sides::Both);
                let axis = columns.cone_axis(run.range.start);
                let (mut narrow, mut wide) = (AxisBlock::<8>::EMPTY, AxisBlock::<16>::EMPTY);
                narrow.set(3, &axis, &frame);
                wide.set(3, &axis, &frame);
                let (all, none) = (simd.mask_f32(u32::MAX), simd.mask_f32(0));
                let may = |side| if sides.include(side) { all } else { none };
                let sides = (may(Side::Front), may(Side::Back));
                let found = if S::F32::LANES == 16 {
                    wide.met_by(simd, &rays, sides)
                } else {
                    narrow.met_by(simd, &rays, sides)
                };
                let (possible, sure) = (found.possible.bits(), found.sure.bits());
                assert_eq!(possible & !8, 0, "an empty lane is never hit");
                assert_eq!(sure & !possible, 0, "what is sure is possible");
                tally.lost += u32::from(possible == 0 && hit(span).is_some());
                tally.passed += u32::from(possible == 0);
                tally.sure += u32::from(sure != 0);
                tally.false_sure += u32::from(sure != 0 && hit(span).is_none());
                if possible != 0
                    && let Some(t) = hit(span)
                {
                    let is_before = found.low.lane(3) > cull.end(t);
                    let is_beyond = sure != 0 && found.high.lane(3) < cull.below(t);
                    tally.out_of_interval += u32::from(is_before || is_beyond);
                }
            }
            tally
        }
    }

    #[test]
    fn no_cone_is_lost_and_no_sure_one_is_none() {
        for &backend in Backend::available() {
            let tally = backend.run(Doubtful { factors: [1.0; 2] });
            let Tally { lost, false_sure, out_of_interval, passed, sure } = tally;
            let wrong = (lost, false_sure, out_of_interval);
            assert!(wrong == (0, 0, 0) && passed > 2_000 && sure > 3_000, "{backend}: {tally:?}");
        }
    }

    #[test]
    fn without_the_margins_cones_are_lost_and_sure_ones_are_none() {
        for &backend in Backend::available() {
            for factors in [[0.0, 1.0], [1.0, 0.0]] {
                let tally = backend.run(Doubtful { factors });
                assert!(tally.lost > 10 && tally.false_sure > 10, "{backend}, {factors:?}: {tally:?}");
            }
        }
    }
}
