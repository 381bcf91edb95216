//! A single-precision test of cones and cylinders: how far their axes pass from a ray.

use rayset_geometry::glam::DVec3;
use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::frame::{Frame, round_up};
use crate::interval::{LeafRay, splat};

/// How far the distance of two lines, times the sine between them, may be off, in units of the rounding of a coordinate.
pub const AXIS_MARGIN: f32 = 40.0;

/// `W` axes, and how far from each a hit may lie.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct AxisBlock<const W: usize> {
    base: [[f32; W]; 3],
    direction: [[f32; W]; 3],
    reach: [f32; W],
}

impl<const W: usize> AxisBlock<W> {
    /// A block without axes: no comparison with NaN holds.
    pub(crate) const EMPTY: Self =
        Self { base: [[f32::NAN; W]; 3], direction: [[f32::NAN; W]; 3], reach: [f32::NAN; W] };

    #[expect(clippy::cast_possible_truncation, reason = "the margin makes up for the rounding")]
    pub(crate) fn set(&mut self, lane: usize, (base, direction, reach): (DVec3, DVec3, f64), frame: &Frame) {
        let base = frame.point(base);
        for k in 0..3 {
            self.base[k][lane] = base[k] as f32;
            self.direction[k][lane] = direction[k] as f32;
        }
        self.reach[lane] = round_up(reach * frame.scale);
    }

    /// The lanes that a ray may hit: those whose axis passes within reach of its line.
    #[inline(always)]
    pub(crate) fn candidates<S: Simd>(&self, ray: &LeafRay<S>) -> u32 {
        let simd = ray.simd;
        let (base, direction) = (self.load(simd, &self.base), self.load(simd, &self.direction));
        let ray_lanes = (splat(simd, ray.origin), splat(simd, ray.direction));
        is_near(simd, (base, direction), simd.load_f32(&self.reach), ray_lanes, ray.unit).bits()
    }

    /// The rays, a lane each, that may hit one.
    #[inline(always)]
    pub(crate) fn rays_that_meet<S: Simd>(
        &self,
        simd: S,
        lane: usize,
        rays: ([S::F32; 3], [S::F32; 3]),
        unit: f32,
    ) -> <S::F32 as Lanes>::Mask {
        let one = |[x, y, z]: &[[f32; W]; 3]| [x[lane], y[lane], z[lane]];
        let axis = (splat(simd, one(&self.base)), splat(simd, one(&self.direction)));
        is_near(simd, axis, simd.splat_f32(self.reach[lane]), rays, unit)
    }

    #[inline(always)]
    fn load<S: Simd>(&self, simd: S, [x, y, z]: &[[f32; W]; 3]) -> [S::F32; 3] {
        [simd.load_f32(x), simd.load_f32(y), simd.load_f32(z)]
    }
}

/// Whether axes pass within reach of the lines of rays, a pair a lane.
#[inline(always)]
fn is_near<S: Simd>(
    simd: S,
    ([bx, by, bz], [ax, ay, az]): ([S::F32; 3], [S::F32; 3]),
    reach: S::F32,
    ([ox, oy, oz], [dx, dy, dz]): ([S::F32; 3], [S::F32; 3]),
    unit: f32,
) -> <S::F32 as Lanes>::Mask {
    let (x, y, z) = (bx - ox, by - oy, bz - oz);
    let (nx, ny, nz) = (dy * az - dz * ay, dz * ax - dx * az, dx * ay - dy * ax);
    let apart = x.mul_add(nx, y.mul_add(ny, z * nz)).abs() - simd.splat_f32(AXIS_MARGIN * unit);
    let apart = apart.max(simd.splat_f32(0.0));
    (apart * apart).le(reach * reach * nx.mul_add(nx, ny.mul_add(ny, nz * nz)))
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use rayset_geometry::{BoundingBox, Cone, Primitive, PrimitiveColumns, Ray, Sides, Span};
    use rayset_simd::{Backend, Kernel, Scalar};

    use super::*;
    use crate::ray::CullRay;

    /// How many hits of rays that graze cylinders and cones are lost, and how many rays are passed over.
    struct Grazing {
        /// By what the margin is multiplied.
        factor: f32,
    }

    impl Kernel for Grazing {
        type Output = (u32, u32);

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> (u32, u32) {
            let mut dice = ChaCha8Rng::seed_from_u64(5);
            let (mut lost, mut passed) = (0, 0);
            for case in 0..60_000 {
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
                // Past the thicker end, as near as can be, or nearly along the axis.
                let on_axis = base + pick([0.0, 1e-6, 1e-4, 0.1, 0.5, 1.0]) * (apex - base);
                let across = (on_axis - eye).cross(apex - base).normalize_or_zero();
                let offset = pick([1.0, 1.0 - 1e-7, 1.0 - 1e-6, 1.0 - 1e-5, 0.5, 1.1]);
                let eye = if case % 5 == 0 { on_axis - 0.3 * (apex - base) + 1e-3 * aside } else { eye };
                let Some(ray) = Ray::between(place(eye), place(on_axis + offset * radius * across)) else {
                    continue;
                };
                let frame = Frame::of(&BoundingBox { min: place(DVec3::NEG_ONE), max: place(DVec3::ONE) });
                let Some(cull) = CullRay::new::<_, 8>(Scalar, &frame, &ray, Span::FORWARD, true) else {
                    continue;
                };
                let mut leaf = LeafRay::new(simd, &cull);
                leaf.unit *= self.factor;
                let mut columns = PrimitiveColumns::default();
                let run = columns.push(&cone.into(), Sides::Both);
                let axis = columns.cone_axis(run.range.start);
                let (mut narrow, mut wide) = (AxisBlock::<8>::EMPTY, AxisBlock::<16>::EMPTY);
                narrow.set(3, axis, &frame);
                wide.set(3, axis, &frame);
                let candidates =
                    if S::F32::LANES == 16 { wide.candidates(&leaf) } else { narrow.candidates(&leaf) };
                assert_eq!(candidates & !8, 0, "an empty lane is never hit");
                let hit = Primitive::from(cone).intersect(&ray, Span::FORWARD, Sides::Both, None);
                lost += u32::from(candidates == 0 && hit.is_some());
                passed += u32::from(candidates == 0);
            }
            (lost, passed)
        }
    }

    #[test]
    fn no_cone_is_lost() {
        for &backend in Backend::available() {
            let (lost, passed) = backend.run(Grazing { factor: 1.0 });
            assert!(lost == 0 && passed > 2_000, "{backend}: {lost} lost, {passed} passed over");
        }
    }

    #[test]
    fn without_the_margin_cones_are_lost() {
        for &backend in Backend::available() {
            let (lost, _) = backend.run(Grazing { factor: 0.0 });
            assert!(lost > 10, "{backend}: {lost}");
        }
    }
}
