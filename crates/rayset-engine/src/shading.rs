//! Whitted's shading rule: from trees to radiance.

use rayset_geometry::glam::DVec3;
use rayset_scene::{Color, Material, Scene};
use rayset_simd::{Backend, Kernel, LaneMask, Lanes, MAX_LANES, Simd};

use crate::IntersectionTrees;
use crate::intersection_tree::{Level, Run};
use crate::lanes::{ROWS, Vectors, dot, load, load3, n_blocks, place, select, splat3, store3, tail3, vector};
use crate::surfaces::NOTHING;

/// What shading needs, to be kept from one bundle to the next.
#[derive(Clone, Debug)]
pub struct Shading {
    backend: Backend,
    /// The radiance along every ray, level by level.
    levels: Vec<Vec<Vectors>>,
}

impl Default for Shading {
    /// Works on the lanes of [`Backend::active`].
    fn default() -> Self {
        Self::on(Backend::active())
    }
}

impl Shading {
    /// Works on the lanes of a backend; the bits are the same.
    #[must_use]
    pub fn on(backend: Backend) -> Self {
        Self { backend, levels: Vec::new() }
    }
}

/// The radiance of every ray-set of a bundle, in order: a pure function of the trees and the scene.
///
/// `shading` is overwritten; pass the same one again to save allocations.
///
/// Source: Whitted 1980, "An improved illumination model for shaded display"; the highlight after Phong 1975.
pub fn shade(trees: &IntersectionTrees, scene: &Scene, shading: &mut Shading, radiance: &mut Vec<Color>) {
    let levels = trees.levels();
    if shading.levels.len() < levels.len() {
        shading.levels.resize_with(levels.len(), Vec::new);
    }
    for (level, colors) in levels.iter().zip(&mut shading.levels) {
        colors.resize(n_blocks(level.len()), Vectors::default());
        shading.backend.run(Local { scene, level, colors });
    }
    for i in (1..levels.len()).rev() {
        let (before, colors) = shading.levels.split_at_mut(i);
        add_children(scene, &levels[i], &colors[0], &levels[i - 1], &mut before[i - 1]);
    }
    if let Some((roots, colors)) = levels.first().zip(shading.levels.first()) {
        radiance.extend((0..roots.len()).map(|row| vector(&colors[row / ROWS], row % ROWS)));
    }
}

/// Adds what the rays of a level bring to the hits that they leave.
fn add_children(scene: &Scene, level: &Level, brought: &[Vectors], before: &Level, colors: &mut [Vectors]) {
    for Run { slot, rows } in &level.runs {
        let is_reflected = slot.0.is_multiple_of(2);
        for i in rows.clone() {
            let parent = level.parents[i] as usize;
            let (block, row) = place(parent);
            let material = &scene.materials()[before.surfaces[block].materials[row] as usize];
            let share: DVec3 = if !is_reflected {
                material.transmittance
            } else if before.reflects_totally(parent) {
                material.reflectance + material.transmittance
            } else {
                material.reflectance
            };
            let brought = vector(&brought[i / ROWS], i % ROWS);
            let [x, y, z] = &mut colors[block];
            x[row] += share.x * brought.x;
            y[row] += share.y * brought.y;
            z[row] += share.z * brought.z;
        }
    }
}

/// What the surfaces of a level send back along the rays by themselves and of the lights.
struct Local<'a> {
    scene: &'a Scene,
    level: &'a Level,
    colors: &'a mut [Vectors],
}

impl Kernel for Local<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { scene, level, colors } = self;
        let background = splat3(simd, scene.background());
        for (block, colors) in colors.iter_mut().enumerate() {
            let surfaces = &level.surfaces[block];
            for i in 0..ROWS / S::F64::LANES {
                let row = i * S::F64::LANES;
                let mut color = background;
                let materials = &surfaces.materials[row..row + S::F64::LANES];
                // The lanes of one material after the other: mostly there is only one.
                let mut rest = lanes_where(materials, |material| material != NOTHING);
                while rest != 0 {
                    let number = materials[rest.trailing_zeros() as usize];
                    let lanes = lanes_where(materials, |material| material == number);
                    rest &= !lanes;
                    let Some(material) = scene.materials().get(number as usize) else { continue };
                    let sent = local(simd, scene, level, (block, row), material);
                    color = select::<S>(simd.mask_f64(lanes), sent, color);
                }
                store3::<S>(color, colors, row);
            }
        }
    }
}

/// The lanes for whose number something holds, as bits.
#[inline(always)]
fn lanes_where(numbers: &[u32], holds: impl Fn(u32) -> bool) -> u32 {
    numbers.iter().enumerate().fold(0, |bits, (lane, &number)| bits | u32::from(holds(number)) << lane)
}

/// What the surfaces of some rows send back, if all are of one material.
#[inline(always)]
fn local<S: Simd>(
    simd: S,
    scene: &Scene,
    level: &Level,
    (block, row): (usize, usize),
    material: &Material,
) -> [S::F64; 3] {
    let mut color = splat3(simd, material.emission + scene.ambient() * material.diffuse);
    let is_shiny = material.specular.max_element() > 0.0;
    for (light, seen) in scene.lights().iter().zip(&level.lights[block * level.n_lights..]) {
        let cosine = load(simd, &seen.cosines, row);
        let shines = cosine.gt(simd.splat_f64(0.0));
        if !shines.any() {
            continue;
        }
        let diffuse = splat3(simd, material.diffuse);
        let mut answer = [diffuse[0] * cosine, diffuse[1] * cosine, diffuse[2] * cosine];
        if is_shiny {
            let normal = load3(simd, &level.surfaces[block].shading, row);
            let direction = load3(simd, &seen.directions, row);
            let along = simd.splat_f64(2.0) * cosine;
            let mirrored = [
                along * normal[0] - direction[0],
                along * normal[1] - direction[1],
                along * normal[2] - direction[2],
            ];
            let [dx, dy, dz] = tail3(simd, level.rays.directions(), block * ROWS + row);
            let towards_eye = dot(mirrored, [-dx, -dy, -dz]);
            let highlights = shines & towards_eye.gt(simd.splat_f64(0.0));
            if highlights.any() {
                let power = powers(simd, towards_eye, material.shininess, highlights);
                let specular = splat3(simd, material.specular);
                let shiny = [
                    answer[0] + specular[0] * power,
                    answer[1] + specular[1] * power,
                    answer[2] + specular[2] * power,
                ];
                answer = select::<S>(highlights, shiny, answer);
            }
        }
        let light = splat3(simd, light.color());
        let lit = [
            color[0] + light[0] * answer[0],
            color[1] + light[1] * answer[1],
            color[2] + light[2] * answer[2],
        ];
        color = select::<S>(shines, lit, color);
    }
    color
}

/// Exponents that are whole numbers up to this are multiplied out.
const LARGEST_WHOLE: f64 = 1024.0;

/// The powers of numbers from 0 to about 1, in the lanes that are wanted: by squaring where the exponent is a small whole number, as most are.
#[inline(always)]
fn powers<S: Simd>(simd: S, base: S::F64, exponent: f64, wanted: <S::F64 as Lanes>::Mask) -> S::F64 {
    if !(0.0..=LARGEST_WHOLE).contains(&exponent) || exponent.fract() != 0.0 {
        let mut powers = [0.0; MAX_LANES];
        base.store(&mut powers);
        let mut wanted = wanted.bits();
        while wanted != 0 {
            let power = &mut powers[wanted.trailing_zeros() as usize];
            *power = libm::pow(*power, exponent);
            wanted &= wanted - 1;
        }
        return simd.load_f64(&powers);
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole, and small")]
    let mut rest = exponent as u32;
    let (mut power, mut square) = (simd.splat_f64(1.0), base);
    while rest != 0 {
        if rest & 1 == 1 {
            power = power * square;
        }
        square = square * square;
        rest >>= 1;
    }
    power
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Powers(f64, f64);

    impl Kernel for Powers {
        type Output = f64;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> f64 {
            powers(simd, simd.splat_f64(self.0), self.1, simd.mask_f64(1)).lane(0)
        }
    }

    #[test]
    fn powers_multiplied_out_are_those_of_the_library() {
        for &backend in Backend::available() {
            let power = |base, exponent| backend.run(Powers(base, exponent));
            for exponent in [0.0, 1.0, 2.0, 5.0, 20.0, 63.0, 100.0, 1000.0, 1024.0, 1025.0, 2.5, 1e9] {
                for i in 1..=1000 {
                    let base = f64::from(i) * 1e-3;
                    let (found, expected) = (power(base, exponent), libm::pow(base, exponent));
                    // Each of fewer than 2 n products is off by half a unit.
                    let bound = 2.0 * f64::EPSILON * exponent.max(1.0) * expected + f64::MIN_POSITIVE;
                    assert!((found - expected).abs() <= bound, "{base}^{exponent}: {found}, {expected}");
                }
            }
            assert_eq!(power(0.5, 1025.0).to_bits(), libm::pow(0.5, 1025.0).to_bits());
        }
    }
}
