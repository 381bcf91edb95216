//! How a surface answers light.

use std::collections::HashMap;

use rayset_geometry::glam::DVec3;

use crate::MaterialId;

/// Linear red, green and blue; 1 is the white of a light of unit intensity.
pub type Color = DVec3;

/// The terms of Whitted's shading rule, with Phong's highlight.
///
/// ```text
/// I = emission + Ia diffuse + sum_j I_j (diffuse (N . L_j) + specular (R . L_j)^shininess)
///   + reflectance S + transmittance T
/// ```
///
/// with the sum over the lights that are not hidden, `S` the intensity along the reflected ray and `T` along the
/// refracted one.
///
/// Source: Whitted 1980, "An improved illumination model for shaded display".
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Diffuse coefficient times colour.
    pub diffuse: Color,
    /// Coefficient of the highlight that a light leaves.
    pub specular: Color,
    /// Exponent of the highlight; not negative.
    pub shininess: f64,
    /// Coefficient of the reflected ray; black for none.
    pub reflectance: Color,
    /// Coefficient of the refracted ray; black for an opaque surface.
    pub transmittance: Color,
    /// Index of refraction of the back against the front; positive. 1 lets rays through unbent.
    pub index: f64,
    /// Light that the surface gives off by itself; it lights nothing else.
    pub emission: Color,
}

/// Which rays a surface sends out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spawns {
    /// None.
    Nothing,
    /// Reflected ones.
    Reflected,
    /// Reflected and refracted ones.
    Both {
        /// The index of refraction of the back against the front.
        index: f64,
    },
}

impl Default for Material {
    /// A matt grey.
    fn default() -> Self {
        Self {
            diffuse: Color::splat(0.5),
            specular: Color::ZERO,
            shininess: 1.0,
            reflectance: Color::ZERO,
            transmittance: Color::ZERO,
            index: 1.0,
            emission: Color::ZERO,
        }
    }
}

impl Material {
    /// Whether rays continue behind the surface.
    #[must_use]
    #[inline]
    pub fn is_transmissive(&self) -> bool {
        self.transmittance.max_element() > 0.0
    }

    /// Whether the surface sends out a reflected ray: every reflective one does, and every transmissive one.
    #[must_use]
    #[inline]
    pub fn is_reflective(&self) -> bool {
        self.reflectance.max_element() > 0.0 || self.is_transmissive()
    }

    /// What the surface does with rays.
    #[must_use]
    pub fn spawns(&self) -> Spawns {
        match (self.is_reflective(), self.is_transmissive()) {
            (_, true) => Spawns::Both { index: self.index },
            (true, false) => Spawns::Reflected,
            (false, false) => Spawns::Nothing,
        }
    }

    /// All that it is, bit by bit.
    fn bits(&self) -> [u64; 17] {
        let Self { diffuse, specular, shininess, reflectance, transmittance, index, emission } = self;
        let mut bits = [0; 17];
        let colors = [diffuse, specular, reflectance, transmittance, emission];
        let numbers = colors.into_iter().flat_map(|color| color.to_array()).chain([*shininess, *index]);
        for (bits, number) in bits.iter_mut().zip(numbers) {
            *bits = number.to_bits();
        }
        bits
    }

    /// Of each of some materials, the first that is the same, bit by bit: files often give every object one of its own.
    pub(crate) fn firsts(materials: &[Self]) -> Vec<MaterialId> {
        let mut firsts = HashMap::new();
        let ids = (0..).map(MaterialId);
        materials.iter().zip(ids).map(|(material, id)| *firsts.entry(material.bits()).or_insert(id)).collect()
    }

    /// What makes the material unusable, if anything.
    pub(crate) fn problem(&self) -> Option<&'static str> {
        let colors = [self.diffuse, self.specular, self.reflectance, self.transmittance, self.emission];
        if colors.iter().any(|color| !(color.is_finite() && color.min_element() >= 0.0)) {
            return Some("a colour is negative or not finite");
        }
        if !(self.index > 0.0 && self.index.is_finite()) {
            return Some("the index of refraction is not positive and finite");
        }
        if !(self.shininess >= 0.0 && self.shininess.is_finite()) {
            return Some("the shininess is negative or not finite");
        }
        None
    }
}
