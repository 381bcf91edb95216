//! Whitted's shading rule: from trees to radiance.

use rayset_geometry::glam::DVec3;
use rayset_scene::{Color, Material, Scene};

use crate::intersection_tree::Lit;
use crate::{Branch, IntersectionTrees, Node};

/// The radiance of every ray-set of a bundle, in order: a pure function of the trees and the scene.
///
/// `scratch` is overwritten; pass the same one again to save allocations.
///
/// Source: Whitted 1980, "An improved illumination model for shaded display"; the highlight after Phong 1975.
pub fn shade(trees: &IntersectionTrees, scene: &Scene, scratch: &mut Vec<Color>, radiance: &mut Vec<Color>) {
    scratch.clear();
    scratch.extend(trees.nodes().iter().map(|node| match &node.hit {
        None => scene.background(),
        Some((_, surface)) => {
            let material = &scene.materials()[surface.material.index()];
            material.emission + scene.ambient() * material.diffuse
        }
    }));
    for lit in &trees.lit {
        scratch[lit.node as usize] += direct(scene, &trees.nodes()[lit.node as usize], lit);
    }
    // Children stand behind their parents.
    for (i, node) in trees.nodes().iter().enumerate().rev() {
        if let Some((_, surface)) = &node.hit {
            let material = &scene.materials()[surface.material.index()];
            scratch[i] = with_children(node, material, scratch[i], scratch);
        }
    }
    let roots = trees.nodes().iter().take_while(|node| node.slot == crate::Slot::ROOT).count();
    radiance.extend_from_slice(&scratch[..roots]);
}

/// Exponents that are whole numbers up to this are multiplied out.
const LARGEST_WHOLE: f64 = 1024.0;

/// The power of a number from 0 to about 1: by squaring where the exponent is a small whole number, as most are.
#[inline]
fn power(base: f64, exponent: f64) -> f64 {
    if !(0.0..=LARGEST_WHOLE).contains(&exponent) || exponent.fract() != 0.0 {
        return libm::pow(base, exponent);
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole, and small")]
    let mut rest = exponent as u32;
    let (mut power, mut square) = (1.0, base);
    while rest != 0 {
        if rest & 1 == 1 {
            power *= square;
        }
        square *= square;
        rest >>= 1;
    }
    power
}

/// What a light that shines on the hit of a node adds.
#[inline]
fn direct(scene: &Scene, node: &Node, &Lit { light, direction, .. }: &Lit) -> Color {
    let Some((_, surface)) = &node.hit else { return Color::ZERO };
    let material = &scene.materials()[surface.material.index()];
    let cosine = surface.shading_normal.dot(direction);
    let mut answer = material.diffuse * cosine;
    if material.specular.max_element() > 0.0 {
        let mirrored = 2.0 * cosine * surface.shading_normal - direction;
        let towards_eye = mirrored.dot(-node.direction);
        if towards_eye > 0.0 {
            answer += material.specular * power(towards_eye, material.shininess);
        }
    }
    scene.lights()[light.index()].color() * answer
}

/// Adds what the rays bring that a surface sent out.
#[inline]
fn with_children(node: &Node, material: &Material, mut sum: Color, radiance: &[Color]) -> Color {
    if let Branch::Node(child) = node.reflected {
        let mut share: DVec3 = material.reflectance;
        if node.refracted == Branch::TotalReflection {
            share += material.transmittance;
        }
        sum += share * radiance[child as usize];
    }
    if let Branch::Node(child) = node.refracted {
        sum += material.transmittance * radiance[child as usize];
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_multiplied_out_are_those_of_the_library() {
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
