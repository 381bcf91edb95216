//! Single-precision tests that say between which distances a ray hits, if it does.
//!
//! A lane is *possible* if the `f64` test may report a hit there, and *sure* if it must. The hit then lies between
//! `low` and `high`, in culling space. All margins are multiples of one number, [`CullRay::unit`]: the rounding of a
//! coordinate. They are derived in `docs/numerics.md`.

use rayset_simd::{CullLanes, LaneMask, Lanes, Simd};

use crate::ray::CullRay;
use crate::shaft::BoxBlock;

/// How far the perpendicular from a sphere's centre may be off, in units of the rounding of a coordinate.
pub const SPHERE_MARGIN: f32 = 34.0;
/// How far a distance to a sphere may be off, apart from its half chord.
const SPHERE_DISTANCE_MARGIN: f32 = 20.0;

/// Where a ray hits the primitives of a block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Intervals<S: Simd> {
    pub(crate) possible: <S::F32 as Lanes>::Mask,
    pub(crate) sure: <S::F32 as Lanes>::Mask,
    pub(crate) low: S::F32,
    /// Meaningful where a lane is sure.
    pub(crate) high: S::F32,
}

/// The spans of rays, a lane each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpanLanes<S: Simd> {
    /// Where each starts, or less, and or more.
    pub(crate) start: S::F32,
    pub(crate) start_above: S::F32,
    /// Where each ends, or less.
    pub(crate) end_below: S::F32,
    /// Where each ends for what is still to be found.
    pub(crate) ends: S::F32,
}

impl<S: Simd> SpanLanes<S> {
    /// That of a ray, in every lane, as long as it goes on to `end`.
    #[inline(always)]
    pub(crate) fn of<const N: usize>(simd: S, ray: CullRay<'_, N>, end: f32) -> Self {
        Self {
            start: simd.splat_f32(ray.start()),
            start_above: simd.splat_f32(ray.start_above()),
            end_below: simd.splat_f32(ray.end_below()),
            ends: simd.splat_f32(end),
        }
    }
}

/// Three numbers, each in every lane.
#[inline(always)]
pub(crate) fn splat<S: Simd>(simd: S, [x, y, z]: [f32; 3]) -> [S::F32; 3] {
    [simd.splat_f32(x), simd.splat_f32(y), simd.splat_f32(z)]
}

/// `W` spheres.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct SphereBlock<const W: usize> {
    center: [[f32; W]; 3],
    radius: [f32; W],
}

impl<const W: usize> SphereBlock<W> {
    /// A block without spheres: no comparison with NaN holds.
    pub(crate) const EMPTY: Self = Self { center: [[f32::NAN; W]; 3], radius: [f32::NAN; W] };

    #[expect(clippy::cast_possible_truncation, reason = "the margins make up for the rounding")]
    pub(crate) fn set(&mut self, lane: usize, center: [f64; 3], radius: f64) {
        for (column, coordinate) in self.center.iter_mut().zip(center) {
            column[lane] = coordinate as f32;
        }
        self.radius[lane] = radius as f32;
    }

    /// Where a ray hits the spheres whose `front` and `back` may be hit.
    #[inline(always)]
    pub(crate) fn intervals<S: Simd, const N: usize>(
        &self,
        simd: S,
        ray: CullRay<'_, N>,
        end: f32,
        front: u32,
        back: u32,
    ) -> Intervals<S> {
        let [x, y, z] = &self.center;
        let center = [simd.load_f32(x), simd.load_f32(y), simd.load_f32(z)];
        let sphere = (center, simd.load_f32(&self.radius));
        let span = SpanLanes::of(simd, ray, end);
        let (front, back) = (simd.mask_f32(front), simd.mask_f32(back));
        Chords::of(simd, sphere, splat(simd, ray.origin()), splat(simd, ray.direction()), ray.unit())
            .intervals(simd, &span, front, back)
    }

    /// The boxes of the spheres.
    #[inline(always)]
    pub(crate) fn boxes<S: Simd>(&self, simd: S, boxes: &mut BoxBlock<W>) {
        let radius = simd.load_f32(&self.radius);
        for k in 0..3 {
            let center = simd.load_f32(&self.center[k]);
            boxes.set_all::<S>(k, [center - radius, center + radius]);
        }
    }

    /// A sphere, the same in every lane: centre and radius.
    #[inline(always)]
    pub(crate) fn one<S: Simd>(&self, simd: S, lane: usize) -> ([S::F32; 3], S::F32) {
        let [x, y, z] = &self.center;
        let center = [simd.splat_f32(x[lane]), simd.splat_f32(y[lane]), simd.splat_f32(z[lane])];
        (center, simd.splat_f32(self.radius[lane]))
    }
}

/// The chords of rays in spheres, a pair a lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chords<S: Simd> {
    radius: S::F32,
    /// How far along the ray its middle lies.
    along: S::F32,
    /// How much the perpendicular from the centre, squared, exceeds the radius, squared, and how far these may be off.
    beyond: S::F32,
    /// How far the perpendicular from the centre may be off.
    error: f32,
    unit: f32,
}

impl<S: Simd> Chords<S> {
    /// By centre and radius, origin and direction, and the rounding of a coordinate.
    #[inline(always)]
    pub(crate) fn of(
        simd: S,
        (center, radius): ([S::F32; 3], S::F32),
        [ox, oy, oz]: [S::F32; 3],
        [dx, dy, dz]: [S::F32; 3],
        unit: f32,
    ) -> Self {
        let (x, y, z) = (center[0] - ox, center[1] - oy, center[2] - oz);
        let along = x.mul_add(dx, y.mul_add(dy, z * dz));
        let (lx, ly, lz) = (along.mul_sub(dx, x), along.mul_sub(dy, y), along.mul_sub(dz, z));
        let error = SPHERE_MARGIN * unit;
        // r^2 - l^2 is off by 2 E r, rounded up, and what is left of second order: nothing of it waits for the ray.
        let reach = radius + simd.splat_f32(3.0 * error);
        let reach = radius.mul_add(reach, simd.splat_f32(5.0 * error * error));
        let beyond = lx.mul_add(lx, ly.mul_add(ly, lz.mul_sub(lz, reach)));
        Self { radius, along, beyond, error, unit }
    }

    /// The pairs of which the ray may meet the sphere, before or behind.
    #[inline(always)]
    pub(crate) fn are_real(&self, simd: S) -> <S::F32 as Lanes>::Mask {
        self.beyond.le(simd.splat_f32(0.0))
    }

    /// Where the rays hit the spheres, of which the front and the back may be hit by some.
    #[inline(always)]
    pub(crate) fn intervals(
        &self,
        simd: S,
        span: &SpanLanes<S>,
        front: <S::F32 as Lanes>::Mask,
        back: <S::F32 as Lanes>::Mask,
    ) -> Intervals<S> {
        let Self { radius, along, beyond, error, unit } = *self;
        let zero = simd.splat_f32(0.0);
        let real = self.are_real(simd) & (front | back);
        // Most leaves are done with here, and the roots are what costs most.
        if !real.any() {
            return Intervals { possible: real, sure: real, low: zero, high: zero };
        }
        let slack = simd.splat_f32(SPHERE_DISTANCE_MARGIN * unit);
        let (below, above) = (along - slack, along + slack);
        let ends = span.ends;
        let wide = zero - beyond;
        // Twice as far off as it may be in one direction.
        let narrow = wide - radius.mul_add(simd.splat_f32(6.0 * error), simd.splat_f32(10.0 * error * error));
        let surely_real = narrow.gt(zero);
        let (widest, narrowest) = (wide.max(zero).sqrt(), narrow.max(zero).sqrt());
        let (near_low, near_high) = (below - widest, above - narrowest);
        let (far_low, far_high) = (below + narrowest, above + widest);
        // The front counts if it lies in the span, else the back.
        let may_enter = real & front & near_high.ge(span.start) & near_low.le(ends);
        let may_leave = real & back & far_high.ge(span.start) & far_low.le(ends);
        let enters = surely_real & front & near_low.gt(span.start_above) & near_high.lt(span.end_below);
        let leaves =
            surely_real & !may_enter & back & far_low.gt(span.start_above) & far_high.lt(span.end_below);
        Intervals {
            possible: may_enter | may_leave,
            sure: enters | leaves,
            low: near_low.select(may_enter, far_low),
            high: near_high.select(enters, far_high),
        }
    }
}

impl<S: Simd> Intervals<S> {
    /// None is possible.
    #[inline(always)]
    pub(crate) fn none(simd: S) -> Self {
        let (none, zero) = (simd.mask_f32(0), simd.splat_f32(0.0));
        Self { possible: none, sure: none, low: zero, high: zero }
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use rayset_geometry::glam::{DVec3, dvec3};
    use rayset_geometry::{BoundingBox, Probe, Ray, Sides, Span, Sphere, Triangle, unit};
    use rayset_simd::{Backend, Kernel, Scalar};

    use super::*;
    use crate::frame::Frame;
    use crate::ray::{Copies, CullRays, Targets};
    use crate::triangles::TriangleBlock;

    /// How often the single-precision answer contradicts the exact one, and how often it is unsure.
    #[derive(Debug, Default)]
    struct Tally {
        lost: u32,
        false_sure: u32,
        out_of_interval: u32,
        unsure: u32,
        hits: u32,
    }

    struct Dice(ChaCha8Rng);

    impl Dice {
        fn unit(&mut self) -> f64 {
            f64::from(self.0.next_u32()) / f64::from(u32::MAX)
        }
        fn within(&mut self, low: f64, high: f64) -> f64 {
            low + (high - low) * self.unit()
        }
        fn point(&mut self) -> DVec3 {
            dvec3(self.within(-1.0, 1.0), self.within(-1.0, 1.0), self.within(-1.0, 1.0))
        }
        fn pick<const N: usize>(&mut self, values: [f64; N]) -> f64 {
            values[self.0.next_u32() as usize % N]
        }
    }

    /// Rays aimed at where it is in doubt whether a shape is hit.
    struct Doubtful {
        /// By what the margins are multiplied.
        factor: f32,
        cases: u32,
        seed: u64,
    }

    impl Kernel for Doubtful {
        type Output = Tally;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Tally {
            let mut dice = Dice(ChaCha8Rng::seed_from_u64(self.seed));
            let mut tally = Tally::default();
            let cube = BoundingBox { min: DVec3::splat(-1.0), max: DVec3::ONE };
            for case in 0..self.cases {
                // The scene is moved and scaled, so that single precision has something to round.
                let (scale, shift) = (dice.pick([1.0, 0.3, 1e4]), dice.point() * dice.pick([0.0, 1.0, 1e3]));
                let place = |p: DVec3| scale * (p + shift);
                let frame = Frame::of(&BoundingBox { min: place(cube.min), max: place(cube.max) });
                let size = dice.pick([1.0, 0.1, 1e-2, 1e-3]);
                let eye = match case % 3 {
                    0 => dice.point(),
                    1 => 3.0 * dice.point(),
                    _ => 50.0 * dice.point(),
                };
                let offset = dice.pick([0.0, 1e-8, -1e-8, 1e-7, -1e-7, 1e-6, -1e-6, 1e-4, -1e-2]);
                let (target, triangle, sphere) = if case % 2 == 0 {
                    let a = dice.point() * 0.9;
                    let corners = [a, a + size * 0.1 * dice.point(), a + size * 0.1 * dice.point()];
                    let w = dice.unit();
                    let edge = corners[1] + w * (corners[2] - corners[1]);
                    let target = edge + offset * (corners[0] - edge);
                    (
                        target,
                        Some(Triangle::new(place(corners[0]), place(corners[1]), place(corners[2]))),
                        None,
                    )
                } else {
                    let (center, radius) = (0.7 * dice.point(), 0.3 * size);
                    let across = unit((center - eye).cross(dice.point())).unwrap_or(DVec3::X);
                    let target = center + (1.0 + offset) * radius * across;
                    (target, None, Some(Sphere::new(place(center), scale * radius)))
                };
                let Some(ray) = Ray::between(place(eye), place(target)) else { continue };
                // Sometimes the span ends about there.
                let distance = (place(target) - place(eye)).length();
                let end =
                    dice.pick([f64::INFINITY, distance, distance * (1.0 + 1e-7), distance * (1.0 - 1e-7)]);
                let span = Span { start: dice.pick([0.0, distance * (1.0 - 1e-7)]), end };
                let mut rays = CullRays::<8>::alone(
                    Scalar,
                    &frame,
                    &Copies::<8>::of(&ray, span).columns(),
                    Targets::FLAT,
                );
                rays.loosen(self.factor);
                let Some(cull) = rays.ray(0) else {
                    tally.lost += 1;
                    continue;
                };
                let probe = Probe::new(Scalar, &ray, span, true);
                let (found, exact) = if let Some(triangle) = triangle {
                    let mut block = TriangleBlock::<8>::EMPTY;
                    let mut wide = TriangleBlock::<16>::EMPTY;
                    let vertices = triangle.vertices().map(|vertex| frame.point(vertex).to_array());
                    block.set(3, vertices);
                    wide.set(3, vertices);
                    let end = cull.end(span.end);
                    let rounding = cull.rounding();
                    let (mut found, near) = if S::F32::LANES == 16 {
                        let error =
                            rounding.of_edges(simd, wide.boxes(simd, &mut BoxBlock::<16>::EMPTY.clone()));
                        let found = wide.intervals(simd, cull, end, u32::MAX, u32::MAX);
                        (found, wide.shear(simd, cull).near(error))
                    } else {
                        let error =
                            rounding.of_edges(simd, block.boxes(simd, &mut BoxBlock::<8>::EMPTY.clone()));
                        let found = block.intervals(simd, cull, end, u32::MAX, u32::MAX);
                        (found, block.shear(simd, cull).near(error))
                    };
                    (found.possible, found.sure) = (found.possible & near, found.sure & near);
                    (found, triangle.intersect(&probe, Sides::Both, None))
                } else if let Some(sphere) = sphere {
                    let mut block = SphereBlock::<8>::EMPTY;
                    let mut wide = SphereBlock::<16>::EMPTY;
                    let center = frame.point(sphere.center()).to_array();
                    block.set(3, center, sphere.radius() * frame.scale);
                    wide.set(3, center, sphere.radius() * frame.scale);
                    let end = cull.end(span.end);
                    let found = if S::F32::LANES == 16 {
                        wide.intervals(simd, cull, end, u32::MAX, u32::MAX)
                    } else {
                        block.intervals(simd, cull, end, u32::MAX, u32::MAX)
                    };
                    (found, sphere.intersect(&ray, span, Sides::Both, None))
                } else {
                    continue;
                };
                assert_eq!((found.possible | found.sure).bits() & !8, 0, "an empty lane is never hit");
                let (possible, sure) = (found.possible.bits() != 0, found.sure.bits() != 0);
                assert!(possible || !sure);
                tally.hits += u32::from(exact.is_some());
                tally.unsure += u32::from(possible && !sure);
                tally.lost += u32::from(exact.is_some() && !possible);
                tally.false_sure += u32::from(exact.is_none() && sure);
                if let Some(t) = exact
                    && possible
                {
                    let (low, high) = (found.low.lane(3), found.high.lane(3));
                    let is_within = low <= cull.end(t) && (!sure || high >= cull.below(t));
                    tally.out_of_interval += u32::from(!is_within);
                }
            }
            tally
        }
    }

    #[test]
    fn no_hit_is_lost_and_no_sure_one_is_none() {
        for &backend in Backend::available() {
            let tally = backend.run(Doubtful { factor: 1.0, cases: 100_000, seed: 1 });
            assert_eq!(
                (tally.lost, tally.false_sure, tally.out_of_interval),
                (0, 0, 0),
                "{backend}: {tally:?}"
            );
            assert!(tally.hits > 10_000 && tally.unsure > 1_000, "{backend}: {tally:?}");
        }
    }

    #[test]
    fn without_the_margins_hits_are_lost() {
        for &backend in Backend::available() {
            let tally = backend.run(Doubtful { factor: 0.0, cases: 100_000, seed: 1 });
            assert!(
                tally.lost > 0 && tally.false_sure > 0 && tally.out_of_interval > 0,
                "{backend}: {tally:?}"
            );
        }
    }
}
