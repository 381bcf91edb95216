//! Cones round rays, which show spheres that none of them can meet.
//!
//! Where there is no tree, whose boxes a shaft could pass by, a cone is the container that fits: from a ball that holds
//! the origins, about the mean of some directions, as wide as the farthest of all. It is the paper's cylinder (section
//! 2.3.1) with an end that opens, built once for a block of rays. It culls in double precision.
//!
//! Source: Amanatides 1984, "Ray tracing with cones", for a cone's test against a sphere.

use std::ops::Range;

use rayset_simd::{LaneMask, Lanes, Simd};

use crate::columns::RayColumns;

/// How far a computed distance from a cone may be off, relative to the distances involved; see `docs/numerics.md`.
pub const CONE_MARGIN: f64 = 1.0 / (1_u64 << 46) as f64;
/// How far the cosine of a cone's angle may be off.
pub const COSINE_MARGIN: f64 = 1.0 / (1_u64 << 48) as f64;
/// What is added to the distances that the margin is relative to, in world units: where squares underflow, hits are
/// displaced by up to 2^-537, however small the scene.
const LEAST_SIZE: f64 = f64::from_bits((1023 - 480) << 52);
/// The least cosine of a cone that is worth asking: of 60 degrees.
const LEAST_COSINE: f64 = 0.5;

/// What holds some rays: all start within `radius` of `apex`, and go within an angle of `axis`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    apex: [f64; 3],
    radius: f64,
    axis: [f64; 3],
    cosine: f64,
    sine: f64,
}

impl Cone {
    /// A cone round some rays; `None` if they are fewer than lanes, or part too far.
    ///
    /// The margin of its angle is multiplied by `factor`.
    #[inline(always)]
    pub(crate) fn around<S: Simd>(
        simd: S,
        columns: &RayColumns<'_>,
        range: Range<usize>,
        factor: f64,
    ) -> Option<Self> {
        let (n, lanes) = (range.len(), S::F64::LANES);
        if n < lanes {
            return None;
        }
        let axis = mean(columns, [range.start, range.start + n / 3, range.start + 2 * n / 3, range.end - 1])?;
        let axes = [simd.splat_f64(axis[0]), simd.splat_f64(axis[1]), simd.splat_f64(axis[2])];
        let (mut low, mut high) =
            ([simd.splat_f64(f64::INFINITY); 3], [simd.splat_f64(f64::NEG_INFINITY); 3]);
        let mut cosine = simd.splat_f64(1.0);
        for first in range.clone().step_by(lanes) {
            // The last ones overlap with those before.
            let first = first.min(range.end - lanes);
            for k in 0..3 {
                let origin = simd.load_f64(&columns.origins[k][first..]);
                low[k] = origin.min(low[k]);
                high[k] = origin.max(high[k]);
            }
            let [x, y, z] = columns.directions;
            let [x, y, z] =
                [simd.load_f64(&x[first..]), simd.load_f64(&y[first..]), simd.load_f64(&z[first..])];
            cosine = (x * axes[0] + y * axes[1] + z * axes[2]).min(cosine);
        }
        let least = |lanes: S::F64| fold(lanes, |a, b| if a < b { a } else { b });
        let greatest = |lanes: S::F64| fold(lanes, |a, b| if a > b { a } else { b });
        let cosine = least(cosine) - factor * COSINE_MARGIN;
        if cosine < LEAST_COSINE {
            return None;
        }
        let (mut apex, mut radius) = ([0.0; 3], 0.0);
        for k in 0..3 {
            let (low, high) = (least(low[k]), greatest(high[k]));
            apex[k] = 0.5 * (low + high);
            radius += 0.5 * (high - low);
        }
        // Of what is 1 to the last bit, the square may be greater.
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        Some(Self { apex, radius, axis, cosine, sine })
    }

    /// The spheres, as bits, that a ray may meet, of as many as there are lanes; the margin is multiplied by `factor`.
    #[inline(always)]
    pub(crate) fn may_meet<S: Simd>(&self, simd: S, centers: [S::F64; 3], radii: S::F64, factor: f64) -> u32 {
        let splat = |value| simd.splat_f64(value);
        let apex = self.apex;
        let axis = [splat(self.axis[0]), splat(self.axis[1]), splat(self.axis[2])];
        let zero = splat(0.0);
        let v = [centers[0] - splat(apex[0]), centers[1] - splat(apex[1]), centers[2] - splat(apex[2])];
        let along = v[0] * axis[0] + v[1] * axis[1] + v[2] * axis[2];
        let l = [v[0] - along * axis[0], v[1] - along * axis[1], v[2] - along * axis[2]];
        let across = (l[0] * l[0] + l[1] * l[1] + l[2] * l[2]).sqrt();
        // Of a centre that is behind, the distance from the plane across the apex is a bound too.
        let from_side = across * splat(self.cosine) - along.max(zero) * splat(self.sine);
        let distance = from_side.max(-along);
        let size = apex[0].abs() + apex[1].abs() + apex[2].abs() + self.radius + LEAST_SIZE;
        let error = (across + along.abs() + radii + splat(size)) * splat(factor * CONE_MARGIN);
        // Where a square overflows, the error is as infinite as the distance, and nothing is greater.
        let misses = distance.gt(radii + splat(self.radius) + error);
        (!misses).bits()
    }
}

/// The direction in the middle of some; `None` if they part too far to tell.
#[inline(always)]
fn mean(columns: &RayColumns<'_>, rays: [usize; 4]) -> Option<[f64; 3]> {
    let mut sum = [0.0; 3];
    for (sum, column) in sum.iter_mut().zip(columns.directions) {
        *sum = (column[rays[0]] + column[rays[1]]) + (column[rays[2]] + column[rays[3]]);
    }
    let length = (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]).sqrt();
    (length > 1.0).then_some([sum[0] / length, sum[1] / length, sum[2] / length])
}

/// All lanes as one.
#[inline(always)]
fn fold<L: Lanes<Scalar = f64>>(lanes: L, join: impl Fn(f64, f64) -> f64) -> f64 {
    let mut values = [0.0; rayset_simd::MAX_LANES];
    lanes.store(&mut values);
    let mut n = L::LANES;
    while n > 1 {
        n /= 2;
        for i in 0..n {
            values[i] = join(values[i], values[n + i]);
        }
    }
    values[0]
}

#[cfg(test)]
mod tests {
    use rayset_geometry::glam::DVec3;
    use rayset_geometry::{Primitive, Ray, Sides, Span, Sphere, unit};
    use rayset_simd::{Backend, Kernel};

    use super::*;

    /// How many spheres that the outermost ray of a block just hits are said to be missed, of how many, if the margins of
    /// the angle and of the distance are multiplied by `factors`.
    struct Grazing {
        factors: [f64; 2],
        /// The size of the scene, and how far radii are searched, relative to the one that touches.
        scale: f64,
        within: f64,
    }

    impl Kernel for Grazing {
        type Output = (usize, usize);

        fn run<S: Simd>(self, simd: S) -> (usize, usize) {
            let (mut lost, mut hits) = (0, 0);
            for i in 1..=4000 {
                let at = |k: f64| (f64::from(i) * k).fract();
                let any =
                    |j: f64| DVec3::new(at(0.618_033_9 + j), at(0.754_877_7 + j), at(0.569_840_3 + j)) - 0.5;
                let axis = unit(any(0.012_345_7)).expect("not nothing");
                let across = unit(axis.cross(any(0.037_123_4))).expect("not parallel");
                let (eye, t) = (self.scale * 4.0 * any(0.0), self.scale * 5.0 * at(0.671_043_6));
                // From nearly parallel rays to some that part by 110 degrees; or parallel ones side by side, far from the
                // origin of the scene.
                let tangent = 1.4 / f64::from(1 << (i % 17));
                let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
                let sine = tangent * cosine;
                let (origins, directions, touched, outwards) = if i % 3 > 0 {
                    let directions = [1.0, -1.0].map(|side| axis * cosine + side * sine * across);
                    let directions = directions.map(|direction| unit(direction).expect("not nothing"));
                    let outwards = across * cosine - axis * sine;
                    ([eye; 2], directions, eye + t * directions[0], outwards)
                } else {
                    let eye = eye + self.scale * 1000.0;
                    let direction = unit(DVec3::new(0.0, axis.y, axis.z)).expect("not nothing");
                    ([eye, eye - DVec3::X * t], [direction; 2], eye + self.scale * 1e-9 * direction, DVec3::X)
                };
                // Half of the rays are alike, and the other half; the first of all touches.
                let mut columns: [Vec<f64>; 6] = Default::default();
                for half in 0..2 {
                    for k in 0..3 {
                        columns[k].extend([origins[half][k]; 8]);
                        columns[3 + k].extend([directions[half][k]; 8]);
                    }
                }
                let (starts, ends) = ([0.0; 16], [f64::INFINITY; 16]);
                let [ox, oy, oz, dx, dy, dz] = &columns;
                let columns = RayColumns {
                    origins: [ox, oy, oz],
                    directions: [dx, dy, dz],
                    spans: (&starts, &ends),
                    left: &[],
                };
                let radius = self.scale * (0.05 + at(0.819_172_5));
                let center = touched + radius * outwards;
                // The least radius that is hit, by halving.
                let ray = Ray::new(origins[0], directions[0]);
                let (mut missed, mut radius) = (radius * (1.0 - self.within), radius * (1.0 + self.within));
                for _ in 0..if self.within < 0.1 { 22 } else { 52 } {
                    let middle = 0.5 * (missed + radius);
                    let sphere = Primitive::from(Sphere::new(center, middle));
                    match sphere.intersect(&ray, Span::FORWARD, Sides::Both, None) {
                        Some(_) => radius = middle,
                        None => missed = middle,
                    }
                }
                let Some(cone) = Cone::around(simd, &columns, 0..16, self.factors[0]) else { continue };
                let centers = [simd.splat_f64(center.x), simd.splat_f64(center.y), simd.splat_f64(center.z)];
                let met = cone.may_meet(simd, centers, simd.splat_f64(radius), self.factors[1]);
                hits += 1;
                lost += usize::from(met & 1 == 0);
            }
            (lost, hits)
        }
    }

    /// How many spheres that only the last ray of a block hits are said to be missed.
    struct LastRay;

    impl Kernel for LastRay {
        type Output = usize;

        fn run<S: Simd>(self, simd: S) -> usize {
            let mut lost = 0;
            for n in S::F64::LANES..=3 * S::F64::LANES {
                for (aside, towards) in [(0.0, DVec3::new(0.6, 0.0, 0.8)), (3.0, DVec3::Z)] {
                    let mut columns: [Vec<f64>; 6] = std::array::from_fn(|_| vec![0.0; n]);
                    columns[5].fill(1.0);
                    columns[0][n - 1] = aside;
                    (columns[3][n - 1], columns[5][n - 1]) = (towards.x, towards.z);
                    let [ox, oy, oz, dx, dy, dz] = &columns;
                    let (starts, ends) = (vec![0.0; n], vec![f64::INFINITY; n]);
                    let columns = RayColumns {
                        origins: [ox, oy, oz],
                        directions: [dx, dy, dz],
                        spans: (&starts, &ends),
                        left: &[],
                    };
                    let center = DVec3::new(aside, 0.0, 0.0) + 10.0 * towards;
                    let cone = Cone::around(simd, &columns, 0..n, 1.0).expect("not too wide");
                    let centers = [center.x, center.y, center.z].map(|x| simd.splat_f64(x));
                    lost += usize::from(cone.may_meet(simd, centers, simd.splat_f64(0.1), 1.0) & 1 == 0);
                }
            }
            lost
        }
    }

    #[test]
    fn the_last_rays_are_in_the_cone() {
        for &backend in Backend::available() {
            assert_eq!(backend.run(LastRay), 0, "{backend}");
        }
    }

    #[test]
    fn no_sphere_that_is_hit_is_missed() {
        for &backend in Backend::available() {
            // Of the second, squares lose digits to underflow.
            for (scale, within) in [(1.0, 1e-10), (1e-160, 0.9)] {
                let (lost, hits) = backend.run(Grazing { factors: [1.0; 2], scale, within });
                assert!(lost == 0 && hits > 3500, "{backend}, {scale:e}: {lost} of {hits}");
            }
        }
    }

    #[test]
    fn without_the_margins_spheres_are_lost() {
        for &backend in Backend::available() {
            for factors in [[0.0, 1.0], [1.0, 0.0]] {
                let (lost, _) = backend.run(Grazing { factors, scale: 1.0, within: 1e-10 });
                assert!(lost > 10, "{backend}, {factors:?}: {lost}");
            }
        }
    }
}
