//! Where the hits of a level reflect and refract rays.

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Side, unit, unit_lanes};
use rayset_scene::Scene;
use rayset_simd::{LaneMask, Lanes, Simd};

use crate::Surface;
use crate::lanes::{Numbers, ROWS, Vectors, dot, load, select, store3, vector};
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
        let leads_in = reflects & !dot(aimed, normal).gt(zero);
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
        let leads_out = refracts & !(goes_on | is_total | dot(aimed, normal).lt(zero));
        if leads_out.any() {
            refract_astray(row, leads_out.bits(), stored::<S>(direction), surfaces, &mut self.refracted);
        }
    }

    /// Finds the weights, and notes which hits reflect totally; `weights` are those of the rays that arrive. Returns how many
    /// rays are sent.
    pub(crate) fn weigh(
        &mut self,
        scene: &Scene,
        surfaces: &Surfaces,
        weights: &[f64],
        cutoff: Option<f64>,
    ) -> usize {
        self.reflected_weights = [NOT_SENT; ROWS];
        self.refracted_weights = [NOT_SENT; ROWS];
        self.total = 0;
        let mut n_sent = 0;
        let mut unless_cut_off = |weight: f64| {
            let is_sent = cutoff.is_none_or(|cutoff| weight >= cutoff);
            n_sent += usize::from(is_sent);
            if is_sent { weight } else { NOT_SENT }
        };
        let mut sending = surfaces.sending;
        while sending != 0 {
            let row = sending.trailing_zeros() as usize % ROWS;
            sending &= sending - 1;
            let material = &scene.materials()[surfaces.materials[row] as usize];
            let mut share = material.reflectance;
            if surfaces.indices[row] > ONLY_REFLECTS {
                if vector(&self.refracted, row) == DVec3::ZERO {
                    self.total |= 1 << row;
                    share += material.transmittance;
                } else {
                    let weight = weights[row] * material.transmittance.max_element();
                    self.refracted_weights[row] = unless_cut_off(weight);
                }
            }
            let weight = weights[row] * share.max_element();
            self.reflected_weights[row] = unless_cut_off(weight);
        }
        n_sent
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

fn put([xs, ys, zs]: &mut Vectors, row: usize, vector: DVec3) {
    (xs[row], ys[row], zs[row]) = vector.into();
}

/// `d - 2 (n . d) n`.
fn mirrored(d: DVec3, n: DVec3) -> DVec3 {
    d - 2.0 * n.dot(d) * n
}

/// As [`mirrored`], a ray a lane.
#[inline(always)]
fn mirrored_lanes<S: Simd>(simd: S, d: [S::F64; 3], n: [S::F64; 3]) -> [S::F64; 3] {
    let along = simd.splat_f64(2.0) * dot(n, d);
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
    let cosine = -dot(n, d);
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
