//! From MTL's terms to Whitted's.

use rayset_geometry::glam::DVec3;

use crate::{Color, Material};

/// The material that an MTL entry describes; see the crate's README for the table.
pub(super) fn from_mtl(mtl: &tobj::Material) -> Material {
    let color = |value: Option<[f64; 3]>| value.map(DVec3::from_array).map(|c| c.max(Color::ZERO));
    let extra = |key: &str| {
        let text = mtl.unknown_param.get(key)?;
        let numbers: Vec<f64> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        (!numbers.is_empty()).then_some(numbers)
    };
    let model = mtl.illumination_model.unwrap_or(2);
    let highlight = color(mtl.specular).unwrap_or(Color::ZERO);
    // `d` wins over `Tr`, which some programs write the other way round.
    let opacity = mtl.dissolve.or_else(|| extra("Tr").map(|tr| 1.0 - tr[0])).unwrap_or(1.0).clamp(0.0, 1.0);
    let filter = match extra("Tf").as_deref() {
        Some([r, g, b, ..]) => Some(DVec3::new(*r, *g, *b).clamp(Color::ZERO, Color::ONE)),
        _ => None,
    };
    let refracts = matches!(model, 6 | 7);
    let glass = matches!(model, 4 | 6 | 7 | 9);
    let transmittance = match (glass, filter) {
        // Glass says by its filter what it lets through; a dissolve below 1 lowers that further.
        (true, Some(filter)) if opacity >= 1.0 => filter,
        (_, Some(filter)) => (1.0 - opacity) * filter,
        (_, None) => Color::splat(1.0 - opacity),
    };
    Material {
        diffuse: color(mtl.diffuse).unwrap_or(Color::splat(0.5)) * opacity,
        specular: if model >= 2 { highlight } else { Color::ZERO },
        shininess: mtl.shininess.unwrap_or(1.0).max(0.0),
        reflectance: if (3..=7).contains(&model) { highlight } else { Color::ZERO },
        transmittance,
        index: if refracts { mtl.optical_density.filter(|&index| index > 0.0).unwrap_or(1.0) } else { 1.0 },
        emission: color(mtl.emissive).unwrap_or(Color::ZERO),
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::float_cmp, reason = "numbers that no rounding touches")]

    use super::*;

    fn material(model: u8, change: impl Fn(&mut tobj::Material)) -> Material {
        let mut mtl = tobj::Material {
            diffuse: Some([0.4, 0.2, 0.1]),
            specular: Some([0.3; 3]),
            shininess: Some(20.0),
            optical_density: Some(1.5),
            illumination_model: Some(model),
            ..tobj::Material::default()
        };
        change(&mut mtl);
        from_mtl(&mtl)
    }

    #[test]
    fn illumination_models_choose_the_terms() {
        for (model, highlight, reflects, index) in [
            (0, false, false, 1.0),
            (1, false, false, 1.0),
            (2, true, false, 1.0),
            (3, true, true, 1.0),
            (4, true, true, 1.0),
            (5, true, true, 1.0),
            (6, true, true, 1.5),
            (7, true, true, 1.5),
            (8, true, false, 1.0),
        ] {
            let material = material(model, |_| {});
            assert_eq!(material.specular.x > 0.0, highlight, "{model}");
            assert_eq!(material.reflectance.x > 0.0, reflects, "{model}");
            assert_eq!(material.index, index, "{model}");
            assert_eq!(
                material.transmittance,
                Color::ZERO,
                "{model} is opaque unless d, Tr or Tf say otherwise"
            );
        }
    }

    #[test]
    fn dissolve_and_filter_let_light_through() {
        assert_eq!(material(2, |m| m.dissolve = Some(0.25)).transmittance, Color::splat(0.75));
        let tr = |value: &str| {
            material(2, |m| {
                m.unknown_param.insert("Tr".into(), value.into());
            })
        };
        assert_eq!(tr("0.75  0").transmittance, Color::splat(0.75));
        assert_eq!(tr("0 0").transmittance, Color::ZERO);
        let filtered = |model| {
            material(model, |m| {
                m.unknown_param.insert("Tf".into(), "0.1 0.5 1".into());
            })
        };
        assert_eq!(filtered(7).transmittance, DVec3::new(0.1, 0.5, 1.0));
        assert_eq!(filtered(2).transmittance, Color::ZERO);
        assert_eq!(material(2, |m| m.dissolve = Some(0.25)).diffuse, DVec3::new(0.1, 0.05, 0.025));
    }
}
