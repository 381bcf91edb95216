//! A single-precision test of cones and cylinders: how far their axes pass from a ray, and where along both.

use rayset_geometry::ConeAxis;
use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::frame::{Frame, round_up};
use crate::interval::splat;
use crate::ray::CullRay;

/// How far the distance of two lines, times the sine between them, may be off, in units of the rounding of a coordinate.
pub const AXIS_MARGIN: f32 = 40.0;
/// How far the ends of the part of a line that is within reach of another may be off, along either, where the sine between
/// them is at least a half; in units of the rounding of a coordinate.
pub const REACH_MARGIN: f32 = 400.0;

/// `W` axes, and how far from each a hit may lie.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct AxisBlock<const W: usize> {
    base: [[f32; W]; 3],
    direction: [[f32; W]; 3],
    height: [f32; W],
    reach: [f32; W],
}

/// The rays that axes are tested with, a pair a lane.
#[derive(Clone, Copy)]
pub(crate) struct AxisRays<S: Simd> {
    origin: [S::F32; 3],
    direction: [S::F32; 3],
    /// Where each span starts, or less, and ends, or more.
    start: S::F32,
    ends: S::F32,
    /// [`AXIS_MARGIN`] and [`REACH_MARGIN`], times the rounding of a coordinate.
    margins: [f32; 2],
}

impl<S: Simd> AxisRays<S> {
    /// Rays, by where they begin and go, their spans, and the rounding of a coordinate.
    #[inline(always)]
    pub(crate) fn new([origin, direction]: [[S::F32; 3]; 2], [start, ends]: [S::F32; 2], unit: f32) -> Self {
        Self { origin, direction, start, ends, margins: [AXIS_MARGIN * unit, REACH_MARGIN * unit] }
    }

    /// A ray in every lane, which ends at `end`.
    #[inline(always)]
    fn of<const N: usize>(simd: S, ray: CullRay<'_, N>, end: f32) -> Self {
        let ways = [splat(simd, ray.origin()), splat(simd, ray.direction())];
        Self::new(ways, [simd.splat_f32(ray.start()), simd.splat_f32(end)], ray.unit())
    }
}

impl<const W: usize> AxisBlock<W> {
    /// A block without axes: no comparison with NaN holds.
    pub(crate) const EMPTY: Self = Self {
        base: [[f32::NAN; W]; 3],
        direction: [[f32::NAN; W]; 3],
        height: [f32::NAN; W],
        reach: [f32::NAN; W],
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
    }

    /// The lanes that a ray may hit before `end`.
    #[inline(always)]
    pub(crate) fn candidates<S: Simd>(&self, simd: S, ray: CullRay<'_, W>, end: f32) -> u32 {
        self.met_by(simd, &AxisRays::of(simd, ray, end))
    }

    /// The lanes that a ray, which stands in every lane, may hit.
    #[inline(always)]
    fn met_by<S: Simd>(&self, simd: S, ray: &AxisRays<S>) -> u32 {
        let (base, direction) = (load(simd, &self.base), load(simd, &self.direction));
        let (height, reach) = (simd.load_f32(&self.height), simd.load_f32(&self.reach));
        may_hit(simd, (base, direction), [height, reach], ray).bits()
    }

    /// The rays, a lane each, that may hit one.
    #[inline(always)]
    pub(crate) fn rays_that_meet<S: Simd>(
        &self,
        simd: S,
        lane: usize,
        rays: &AxisRays<S>,
    ) -> <S::F32 as Lanes>::Mask {
        let one = |[x, y, z]: &[[f32; W]; 3]| [x[lane], y[lane], z[lane]];
        let axis = (splat(simd, one(&self.base)), splat(simd, one(&self.direction)));
        let [height, reach] = [simd.splat_f32(self.height[lane]), simd.splat_f32(self.reach[lane])];
        may_hit(simd, axis, [height, reach], rays)
    }
}

#[inline(always)]
fn load<S: Simd, const W: usize>(simd: S, [x, y, z]: &[[f32; W]; 3]) -> [S::F32; 3] {
    [simd.load_f32(x), simd.load_f32(y), simd.load_f32(z)]
}

#[inline(always)]
fn dot<L: CullLanes>([ax, ay, az]: [L; 3], [bx, by, bz]: [L; 3]) -> L {
    ax.mul_add(bx, ay.mul_add(by, az * bz))
}

/// Whether rays may hit cones: whether their lines pass within reach of the axes and, unless they are nearly parallel,
/// that part of a line lies between the circles and in the span.
#[inline(always)]
fn may_hit<S: Simd>(
    simd: S,
    (base, axis): ([S::F32; 3], [S::F32; 3]),
    [height, reach]: [S::F32; 2],
    rays: &AxisRays<S>,
) -> <S::F32 as Lanes>::Mask {
    let ([ox, oy, oz], [dx, dy, dz]) = (rays.origin, rays.direction);
    let [ax, ay, az] = axis;
    let to_base = [base[0] - ox, base[1] - oy, base[2] - oz];
    let across = [dy * az - dz * ay, dz * ax - dx * az, dx * ay - dy * ax];
    let zero = simd.splat_f32(0.0);
    let apart = dot(to_base, across).abs() - simd.splat_f32(rays.margins[0]);
    let apart = apart.max(zero);
    let squared = dot(across, across);
    let widest = reach * reach * squared;
    let is_near = (apart * apart).le(widest);
    if !is_near.any() {
        return is_near;
    }
    let is_oblique = squared.ge(simd.splat_f32(0.25));
    let cosine = dot(rays.direction, axis);
    let (along_ray, along_axis) = (dot(to_base, rays.direction), dot(to_base, axis));
    let inverse = simd.splat_f32(1.0) / squared;
    let margin = simd.splat_f32(rays.margins[1]);
    // Where the lines are nearest, along both, and how far from there the ray is within reach.
    let t = (along_ray - cosine * along_axis) * inverse;
    let m = (cosine * along_ray - along_axis) * inverse;
    let half = (widest - apart * apart).max(zero).sqrt() * inverse;
    let (half_t, half_m) = (half + margin, half.mul_add(cosine.abs(), margin));
    let is_there = (t + half_t).ge(rays.start)
        & (t - half_t).le(rays.ends)
        & (m + half_m).ge(zero)
        & (m - half_m).le(height);
    is_near & (is_there | !is_oblique)
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use rayset_geometry::glam::DVec3;
    use rayset_geometry::{BoundingBox, Cone, Primitive, PrimitiveColumns, Ray, Sides, Span};
    use rayset_simd::{Backend, Kernel, Scalar};

    use super::*;
    use crate::ray::{Copies, CullRays, Targets};

    /// How many hits of rays that graze cylinders and cones, meet them at their ends, or end there are lost, and how many
    /// rays are passed over.
    struct Doubtful {
        /// By what each margin is multiplied.
        factors: [f32; 2],
    }

    impl Kernel for Doubtful {
        type Output = (u32, u32);

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> (u32, u32) {
            let mut dice = ChaCha8Rng::seed_from_u64(5);
            let (mut lost, mut passed) = (0, 0);
            for case in 0..120_000 {
                let mut unit = || f64::from(dice.next_u32()) / f64::from(u32::MAX);
                let mut point = || DVec3::from_array(std::array::from_fn(|_| 2.0 * unit() - 1.0));
                let (base, apex, eye, aside) = (0.8 * point(), 0.8 * point(), point(), point());
                let mut pick = |values: [f64; 6]| values[dice.next_u32() as usize % 6];
                let radius = pick([0.1, 0.03, 1e-2, 1e-3, 1e-4, 1e-5]);
                let place = |p: DVec3| p * 30.0 + DVec3::splat(100.0);
                let apex_radius = if case % 2 == 0 { 30.0 * radius } else { 0.0 };
                let Some(cone) = Cone::new(place(base), 30.0 * radius, place(apex), apex_radius) else {
                    continue;
                };
                let on_axis = base + pick([0.0, 1e-7, 1e-4, 0.5, 1.0 - 1e-7, 1.0]) * (apex - base);
                let is_grazing = case / 2 % 2 == 0;
                let eye = match case / 4 % 5 {
                    // Nearly along the axis.
                    0 => on_axis - 0.3 * (apex - base) + 1e-3 * aside,
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
                    pick([1.0, 1.0 - 1e-7, 1.0 - 1e-6, 1.0 - 1e-5, 0.5, 1.1])
                } else {
                    pick([0.0, 0.1, 0.5, 0.9, 0.99, 0.999])
                };
                let Some(ray) = Ray::between(place(eye), place(on_axis + offset * radius * across)) else {
                    continue;
                };
                let hit = |span| Primitive::from(cone).intersect(&ray, span, Sides::Both, None);
                // A span that ends or begins where the ray hits.
                let mut span = Span::FORWARD;
                if let Some(t) = hit(span) {
                    match case / 20 % 3 {
                        0 => span.end = t * (1.0 + pick([0.0, 0.0, 1e-12, 1e-9, 1e-8, 1e-7])),
                        1 => span.start = t * (1.0 - pick([0.0, 0.0, 1e-12, 1e-9, 1e-8, 1e-7])),
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
                let candidates =
                    if S::F32::LANES == 16 { wide.met_by(simd, &rays) } else { narrow.met_by(simd, &rays) };
                assert_eq!(candidates & !8, 0, "an empty lane is never hit");
                lost += u32::from(candidates == 0 && hit(span).is_some());
                passed += u32::from(candidates == 0);
            }
            (lost, passed)
        }
    }

    #[test]
    fn no_cone_is_lost() {
        for &backend in Backend::available() {
            let (lost, passed) = backend.run(Doubtful { factors: [1.0; 2] });
            assert!(lost == 0 && passed > 2_000, "{backend}: {lost} lost, {passed} passed over");
        }
    }

    #[test]
    fn without_the_margins_cones_are_lost() {
        for &backend in Backend::available() {
            for factors in [[0.0, 1.0], [1.0, 0.0]] {
                let (lost, _) = backend.run(Doubtful { factors });
                assert!(lost > 10, "{backend}, {factors:?}: {lost}");
            }
        }
    }
}
