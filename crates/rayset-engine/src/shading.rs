//! Whitted's shading rule: from trees to radiance.

use rayset_geometry::glam::DVec3;
use rayset_scene::{Color, Scene};

use crate::{Branch, IntersectionTrees, LightState, Node, Surface};

/// The radiance of every ray-set of a bundle, in order: a pure function of the trees and the scene.
///
/// `scratch` is overwritten; pass the same one again to save allocations.
///
/// Source: Whitted 1980, "An improved illumination model for shaded display"; the highlight after Phong 1975.
pub fn shade(trees: &IntersectionTrees, scene: &Scene, scratch: &mut Vec<Color>, radiance: &mut Vec<Color>) {
    scratch.clear();
    scratch.resize(trees.nodes().len(), Color::ZERO);
    // Children stand behind their parents.
    for (i, node) in trees.nodes().iter().enumerate().rev() {
        scratch[i] = match &node.hit {
            None => scene.background(),
            Some((_, surface)) => shade_hit(trees, scene, i, node, surface, scratch),
        };
    }
    let roots = trees.nodes().iter().take_while(|node| node.slot == crate::Slot::ROOT).count();
    radiance.extend_from_slice(&scratch[..roots]);
}

fn shade_hit(
    trees: &IntersectionTrees,
    scene: &Scene,
    i: usize,
    node: &Node,
    surface: &Surface,
    radiance: &[Color],
) -> Color {
    let material = &scene.materials()[surface.material.index()];
    let mut sum = material.emission + scene.ambient() * material.diffuse;
    for (light, state) in scene.lights().iter().zip(trees.lights_of(i)) {
        if *state != LightState::Visible {
            continue;
        }
        let Some(illumination) = light.seen_from(surface.point) else { continue };
        let cosine = surface.shading_normal.dot(illumination.direction);
        let mut answer = material.diffuse * cosine;
        if material.specular.max_element() > 0.0 {
            let mirrored = 2.0 * cosine * surface.shading_normal - illumination.direction;
            let towards_eye = mirrored.dot(-node.direction);
            if towards_eye > 0.0 {
                answer += material.specular * libm::pow(towards_eye, material.shininess);
            }
        }
        sum += light.color() * answer;
    }
    let mut share: DVec3 = material.reflectance;
    if node.refracted == Branch::TotalReflection {
        share += material.transmittance;
    }
    if let Branch::Node(child) = node.reflected {
        sum += share * radiance[child as usize];
    }
    if let Branch::Node(child) = node.refracted {
        sum += material.transmittance * radiance[child as usize];
    }
    sum
}
