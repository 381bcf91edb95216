//! How the lights are seen from the hits of a level.

use rayset_geometry::glam::DVec3;
use rayset_geometry::{dot_lanes, unit_lanes};
use rayset_scene::Light;
use rayset_simd::{LaneMask, Lanes, Simd};

use crate::LightState;
use crate::lanes::{Numbers, Vectors, splat3, store, store3};

/// How a light is seen from the hits of sixteen rays.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seen {
    /// The unit vectors towards it.
    pub(crate) directions: Vectors,
    /// How far away it is, in world units.
    pub(crate) distances: Numbers,
    /// Of the angle at which its light arrives, where the surface faces it; zero where it does not. Turned negative where
    /// something lies between.
    pub(crate) cosines: Numbers,
}

/// The least cosine of a surface that faces a light: the least number above zero.
pub(crate) const LEAST_COSINE: f64 = f64::from_bits(1);

impl Seen {
    /// Looks from those points that are hit, with their normals and those to shade with, to a light; returns how many face it.
    #[inline(always)]
    pub(crate) fn look<S: Simd>(
        &mut self,
        simd: S,
        row: usize,
        light: &Light,
        point: [S::F64; 3],
        [normal, shading]: [[S::F64; 3]; 2],
        hit: <S::F64 as Lanes>::Mask,
    ) -> usize {
        let zero = simd.splat_f64(0.0);
        // As `Light::seen_from`; zero at the light, from where no side of a surface is lit.
        let (direction, distance) = match light.position() {
            Some(position) => {
                let to = splat3(simd, position);
                unit_lanes(simd, [to[0] - point[0], to[1] - point[1], to[2] - point[2]])
            }
            None => {
                // Seen alike from everywhere.
                let seen = light.seen_from(DVec3::ZERO);
                let direction = seen.map_or(DVec3::ZERO, |seen| seen.direction);
                (splat3(simd, direction), simd.splat_f64(f64::INFINITY))
            }
        };
        // Light reaches a surface from the side of both normals, or not at all.
        let cosine = dot_lanes(shading, direction);
        let faces = hit & dot_lanes(normal, direction).gt(zero) & cosine.gt(zero);
        store::<S>(cosine.select(faces, zero), &mut self.cosines, row);
        store::<S>(distance, &mut self.distances, row);
        store3::<S>(direction, &mut self.directions, row);
        faces.bits().count_ones() as usize
    }

    /// Takes in whether the light is hidden from the hit in a row that faces it.
    #[inline(always)]
    pub(crate) fn hide(&mut self, row: usize, is_hidden: bool) {
        let cosine = &mut self.cosines[row];
        // The sign bit, turned or not: so that there is no branch to guess.
        *cosine = f64::from_bits(cosine.to_bits() ^ u64::from(is_hidden) << 63);
    }

    /// How the light stands to the hit in a row.
    pub(crate) fn state(&self, row: usize) -> LightState {
        match self.cosines[row] {
            cosine if cosine > 0.0 => LightState::Visible,
            cosine if cosine < 0.0 => LightState::Hidden,
            _ => LightState::FacesAway,
        }
    }
}
