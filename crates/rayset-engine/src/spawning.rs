//! Where the hits of a level reflect and refract rays.

use std::ops::Range;

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Side, dot_lanes, unit, unit_lanes};
use rayset_scene::Scene;
use rayset_simd::{LaneMask, Lanes, Simd};

use crate::Surface;
use crate::lanes::{Numbers, ROWS, Vectors, alike, load, load3, put, select, store, store3, vector};
use crate::surfaces::{ONLY_REFLECTS, Surfaces};

/// Where the hits of sixteen rays reflect and refract rays, and with what weight.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spawning {
    /// The unit directions.
    pub(crate) reflected: Vectors,
    /// The unit directions; zero under total internal reflection.
    pub(crate) refracted: Vectors,
    /// The greatest shares of intensity that reach the pixel; [`NOT_SENT`] where no ray is sent.
    pub(crate) reflected_weights: Numbers,
    pub(crate) refracted_weights: Numbers,
    /// The rows that would refract, and reflect totally, as bits.
    pub(crate) total: u32,
}

/// Below all weights.
const NOT_SENT: f64 = -1.0;

/// The least weight of a ray that is sent.
pub(crate) const LEAST_WEIGHT: f64 = 0.0;

impl Spawning {
    /// Finds the directions in which rays of some directions go on, from surfaces with the given normals and those to shade
    /// with.
    #[inline(always)]
    pub(crate) fn aim<S: Simd>(
        &mut self,
        simd: S,
        row: usize,
        direction: [S::F64; 3],
        [normal, shading]: [[S::F64; 3]; 2],
        surfaces: &Surfaces,
    ) {
        let (zero, one) = (simd.splat_f64(0.0), simd.splat_f64(1.0));
        let index = load(simd, &surfaces.indices, row);
        let reflects = index.ge(simd.splat_f64(ONLY_REFLECTS));
        if !reflects.any() {
            return;
        }
        let (aimed, _) = unit_lanes(simd, mirrored_lanes(simd, direction, shading));
        store3::<S>(aimed, &mut self.reflected, row);
        let leads_in = reflects & !dot_lanes(aimed, normal).gt(zero);
        if leads_in.any() {
            reflect_astray(row, leads_in.bits(), stored::<S>(direction), surfaces, &mut self.reflected);
        }
        let refracts = index.gt(simd.splat_f64(ONLY_REFLECTS));
        if !refracts.any() {
            return;
        }
        let eta = index.select(simd.mask_f64(surfaces.backs >> row), one / index);
        let (bent, is_total) = bent_lanes(simd, direction, shading, eta);
        // What is not bent keeps a direction that has a length.
        let (aimed, _) = unit_lanes(simd, select::<S>(refracts & !is_total, bent, direction));
        let goes_on = index.eq(one);
        let found = select::<S>(goes_on, direction, select::<S>(is_total, [zero; 3], aimed));
        store3::<S>(found, &mut self.refracted, row);
        let leads_out = refracts & !(goes_on | is_total | dot_lanes(aimed, normal).lt(zero));
        if leads_out.any() {
            refract_astray(row, leads_out.bits(), stored::<S>(direction), surfaces, &mut self.refracted);
        }
    }

    /// The weights of what is refracted, or reflected.
    #[inline(always)]
    pub(crate) fn weights(&self, is_refracted: bool) -> &Numbers {
        if is_refracted { &self.refracted_weights } else { &self.reflected_weights }
    }

    /// Notes that some rows send no rays.
    #[inline(always)]
    pub(crate) fn send_nothing(&mut self, rows: Range<usize>) {
        self.reflected_weights[rows.clone()].fill(NOT_SENT);
        self.refracted_weights[rows].fill(NOT_SENT);
    }

    /// Finds the weights of what some rows send, and notes which of them reflect totally; `weights` are those of the rays
    /// that arrive, and none is sent below `cutoff`. Returns how many rays are sent.
    #[inline(always)]
    pub(crate) fn weigh<S: Simd>(
        &mut self,
        simd: S,
        row: usize,
        scene: &Scene,
        surfaces: &Surfaces,
        (weights, cutoff): (S::F64, S::F64),
    ) -> usize {
        let not_sent = simd.splat_f64(NOT_SENT);
        let (mut reflected, mut refracted) = (not_sent, not_sent);
        let mut total = simd.mask_f64(0);
        let materials = &surfaces.materials[row..row + S::F64::LANES];
        let sending = simd.mask_f64(surfaces.sending >> row);
        if sending.any() {
            let zero = simd.splat_f64(0.0);
            let [x, y, z] = load3(simd, &self.refracted, row);
            let refracts = load(simd, &surfaces.indices, row).gt(simd.splat_f64(ONLY_REFLECTS)) & sending;
            total = refracts & x.eq(zero) & y.eq(zero) & z.eq(zero);
            let goes_through = refracts & !total;
            let unless_cut_off = |weight: S::F64| weight.select(weight.ge(cutoff), not_sent);
            for (number, lanes) in alike(materials, sending.bits()) {
                let Some(material) = scene.materials().get(number as usize) else { continue };
                let lanes = simd.mask_f64(lanes);
                let [through, back] = [material.transmittance, material.reflectance];
                let all = simd.splat_f64((back + through).max_element());
                let share = all.select(total, simd.splat_f64(back.max_element()));
                reflected = unless_cut_off(weights * share).select(lanes, reflected);
                let weight = unless_cut_off(weights * simd.splat_f64(through.max_element()));
                refracted = weight.select(lanes & goes_through, refracted);
            }
        }
        store::<S>(reflected, &mut self.reflected_weights, row);
        store::<S>(refracted, &mut self.refracted_weights, row);
        self.total |= total.bits() << row;
        let least = simd.splat_f64(LEAST_WEIGHT);
        (reflected.ge(least).bits().count_ones() + refracted.ge(least).bits().count_ones()) as usize
    }
}

/// Vectors in lanes, written out.
#[inline(always)]
fn stored<S: Simd>(lanes: [S::F64; 3]) -> Vectors {
    let mut vectors = Vectors::default();
    store3::<S>(lanes, &mut vectors, 0);
    vectors
}

/// Directions that would lead into the surface they are reflected from: one by one.
#[cold]
fn reflect_astray(first: usize, lanes: u32, incoming: Vectors, surfaces: &Surfaces, aimed: &mut Vectors) {
    for lane in (0..ROWS - first).filter(|lane| lanes >> lane & 1 == 1) {
        let surface = surfaces.surface(first + lane);
        let direction = reflect(vector(&incoming, lane), &surface);
        put(aimed, first + lane, direction);
    }
}

/// Directions that would not lead through the surface they are refracted at: one by one.
#[cold]
fn refract_astray(first: usize, lanes: u32, incoming: Vectors, surfaces: &Surfaces, aimed: &mut Vectors) {
    for lane in (0..ROWS - first).filter(|lane| lanes >> lane & 1 == 1) {
        let surface = surfaces.surface(first + lane);
        let direction = refract(vector(&incoming, lane), &surface, surfaces.indices[first + lane]);
        put(aimed, first + lane, direction.unwrap_or(DVec3::ZERO));
    }
}

/// `d - 2 (n . d) n`.
fn mirrored(d: DVec3, n: DVec3) -> DVec3 {
    d - 2.0 * n.dot(d) * n
}

/// As [`mirrored`], a ray a lane.
#[inline(always)]
fn mirrored_lanes<S: Simd>(simd: S, d: [S::F64; 3], n: [S::F64; 3]) -> [S::F64; 3] {
    let along = simd.splat_f64(2.0) * dot_lanes(n, d);
    [d[0] - along * n[0], d[1] - along * n[1], d[2] - along * n[2]]
}

/// The reflected direction, about the surface's own normal where the shading normal would lead into it.
fn reflect(d: DVec3, surface: &Surface) -> DVec3 {
    let about = |n: DVec3| unit(mirrored(d, n)).unwrap_or(n);
    let direction = about(surface.shading_normal);
    if direction.dot(surface.normal) > 0.0 { direction } else { about(surface.normal) }
}

/// The refracted direction, of about unit length, by Snell's law; `None` under total internal reflection.
///
/// With `eta` the ratio of the indices and `c = -n . d`: `eta d + (eta c - sqrt(1 - eta^2 (1 - c^2))) n`.
fn bent_by(d: DVec3, n: DVec3, eta: f64) -> Option<DVec3> {
    let cosine = -n.dot(d);
    let discriminant = 1.0 - eta * eta * (1.0 - cosine * cosine);
    if discriminant < 0.0 {
        return None;
    }
    Some(eta * d + (eta * cosine - discriminant.sqrt()) * n)
}

/// As [`bent_by`], a ray a lane, and the lanes with total internal reflection.
#[inline(always)]
fn bent_lanes<S: Simd>(
    simd: S,
    d: [S::F64; 3],
    n: [S::F64; 3],
    eta: S::F64,
) -> ([S::F64; 3], <S::F64 as Lanes>::Mask) {
    let one = simd.splat_f64(1.0);
    let cosine = -dot_lanes(n, d);
    let discriminant = one - eta * eta * (one - cosine * cosine);
    let along = eta * cosine - discriminant.sqrt();
    let bent = [eta * d[0] + along * n[0], eta * d[1] + along * n[1], eta * d[2] + along * n[2]];
    (bent, discriminant.lt(simd.splat_f64(0.0)))
}

/// The refracted direction, about the surface's own normal where the shading normal would lead out of it; `None` under
/// total internal reflection.
fn refract(d: DVec3, surface: &Surface, index: f64) -> Option<DVec3> {
    if (index - 1.0).abs() <= 0.0 {
        return Some(d);
    }
    // The ratio of the indices of refraction where a ray enters or leaves.
    let eta = match surface.side {
        Side::Front => 1.0 / index,
        Side::Back => index,
    };
    let about = |n: DVec3| bent_by(d, n, eta).and_then(unit);
    let direction = about(surface.shading_normal)?;
    if direction.dot(surface.normal) < 0.0 { Some(direction) } else { about(surface.normal) }
}
