//! Whitted's shading rule: from trees to radiance.

use rayset_geometry::dot_lanes;
use rayset_scene::{Color, Material, Scene};
use rayset_simd::{Backend, Kernel, LaneMask, Lanes, MAX_LANES, Simd};

use crate::intersection_tree::{Level, Run};
use crate::lanes::{ROWS, alike, column3, lanes_where, lengthen, load, load3, n_blocks, select, splat3};
use crate::leaving::{among, is_refracted};
use crate::powers::powers;
use crate::spawning::LEAST_WEIGHT;
use crate::surfaces::NOTHING;
use crate::{IntersectionTrees, Slot};

/// What shading needs, to be kept from one bundle to the next.
#[derive(Clone, Debug)]
pub struct Shading {
    backend: Backend,
    /// The radiance along every ray, level by level.
    levels: Vec<Radiance>,
}

/// The radiance along the rays of a level, as columns, with room for lanes beyond.
type Radiance = [Vec<f64>; 3];

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
        shading.levels.resize_with(levels.len(), Radiance::default);
    }
    let Shading { backend, levels: colors } = shading;
    for (level, colors) in levels.iter().zip(&mut *colors) {
        let n = ROWS * n_blocks(level.len()) + MAX_LANES;
        colors.iter_mut().for_each(|column| lengthen(column, n, 0.0));
        backend.run(Local { scene, level, colors });
    }
    for i in (1..levels.len()).rev() {
        let (before, behind) = colors.split_at_mut(i);
        let (colors, brought) = (&mut before[i - 1], &behind[0]);
        backend.run(Brought { scene, level: &levels[i - 1], children: &levels[i], brought, colors });
    }
    if let Some((roots, [x, y, z])) = levels.first().zip(colors.first()) {
        radiance.extend((0..roots.len()).map(|row| Color::new(x[row], y[row], z[row])));
    }
}

/// Adds what the rays of the next level bring to the hits that they leave.
struct Brought<'a> {
    scene: &'a Scene,
    level: &'a Level,
    children: &'a Level,
    brought: &'a Radiance,
    colors: &'a mut Radiance,
}

impl Kernel for Brought<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { scene, level, children, brought, colors } = self;
        let least = simd.splat_f64(LEAST_WEIGHT);
        // They stand as they were gathered: see `Children`.
        let mut runs = children.runs.iter().peekable();
        for Run { slot, rows } in &level.runs {
            for sent in [slot.reflected(), slot.refracted()] {
                let Some(run) = runs.next_if(|run| run.slot == sent) else { continue };
                let mut n = run.rows.start;
                for block in rows.start / ROWS..n_blocks(rows.end) {
                    let among = among(rows, block);
                    for i in 0..ROWS / S::F64::LANES {
                        let row = i * S::F64::LANES;
                        let weights = level.spawning[block].weights(is_refracted(sent));
                        let lanes = load(simd, weights, row).ge(least).bits() & among >> row;
                        if lanes == 0 {
                            continue;
                        }
                        let mask = simd.mask_f64(lanes);
                        let share = share::<S>(simd, scene, level, (block, row), (sent, lanes));
                        for ((column, brought), share) in colors.iter_mut().zip(brought).zip(share) {
                            let place = &mut column[block * ROWS + row..];
                            let color = simd.load_f64(place);
                            let more = share * simd.expand_f64(mask, &brought[n..]);
                            (color + more).select(mask, color).store(place);
                        }
                        n += lanes.count_ones() as usize;
                    }
                }
                debug_assert_eq!(n, run.rows.end, "all that was sent brings something");
            }
        }
    }
}

/// What share of what the rays of a slot bring, which some lanes have sent, goes on along the rays that arrive.
#[inline(always)]
fn share<S: Simd>(
    simd: S,
    scene: &Scene,
    level: &Level,
    (block, row): (usize, usize),
    (sent, lanes): (Slot, u32),
) -> [S::F64; 3] {
    let total = simd.mask_f64(level.spawning[block].total >> row);
    let materials = &level.surfaces[block].materials[row..row + S::F64::LANES];
    let mut shares = [simd.splat_f64(0.0); 3];
    for (number, lanes) in alike(materials, lanes) {
        let Some(material) = scene.materials().get(number as usize) else { continue };
        let share = if is_refracted(sent) {
            splat3(simd, material.transmittance)
        } else {
            let all = splat3(simd, material.reflectance + material.transmittance);
            select::<S>(total, all, splat3(simd, material.reflectance))
        };
        shares = select::<S>(simd.mask_f64(lanes), share, shares);
    }
    shares
}

/// What the surfaces of a level send back along the rays by themselves and of the lights.
struct Local<'a> {
    scene: &'a Scene,
    level: &'a Level,
    colors: &'a mut Radiance,
}

impl Kernel for Local<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { scene, level, colors } = self;
        let background = splat3(simd, scene.background());
        for (block, surfaces) in level.surfaces().iter().enumerate() {
            for i in 0..ROWS / S::F64::LANES {
                let row = i * S::F64::LANES;
                let mut color = background;
                let materials = &surfaces.materials[row..row + S::F64::LANES];
                for (number, lanes) in
                    alike(materials, lanes_where(materials, |material| material != NOTHING))
                {
                    let Some(material) = scene.materials().get(number as usize) else { continue };
                    let sent = local(simd, scene, level, (block, row), material);
                    color = select::<S>(simd.mask_f64(lanes), sent, color);
                }
                for (column, color) in colors.iter_mut().zip(color) {
                    color.store(&mut column[block * ROWS + row..]);
                }
            }
        }
    }
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
            let [dx, dy, dz] = column3(simd, &level.rays.directions, block * ROWS + row);
            let towards_eye = dot_lanes(mirrored, [-dx, -dy, -dz]);
            let highlights = shines & towards_eye.gt(simd.splat_f64(0.0));
            if highlights.any() {
                // Of what is raised in vain, any number.
                let base = towards_eye.select(highlights, simd.splat_f64(1.0));
                let power = powers(simd, base, material.shininess);
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
