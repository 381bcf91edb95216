//! What the paper leaves open, as factors with levels.

use rayset_engine::{PixelOrder, Speer1985Options};
use rayset_scene::glam::DVec3;
use rayset_scene::{Camera, Color, Light, RandomSpheres, Scene, SceneBuilder, SphereSize};

use crate::StudyError;

/// Every factor with its levels; the first is the default of `repro-table1`.
///
/// The first seven are options of `speer-1985`, by their own names.
pub(crate) const FACTORS: [(&str, &[&str]); N_FACTORS] = [
    ("misses", &["partition", "cylinder"]),
    ("light_rays", &["blocked", "all", "none"]),
    ("blocker", &["nearest", "first"]),
    ("slab", &["overlapping", "centre", "inside"]),
    ("end_planes", &["side-only", "closed"]),
    ("matching", &["any-origin", "same-object", "same-object-and-side"]),
    ("inheritance", &["formative", "nothing"]),
    ("order", &["scanline", "serpentine", "tiles-8"]),
    ("resolution", &["512", "320", "256", "192", "128", "96", "64", "48"]),
    // Radii from and to in world units, or the fraction that the spheres cover of the cube they are in.
    ("size", SIZES),
    ("reflectance", &["0.3", "0", "0.8"]),
    // The transmittance of every fourth sphere.
    ("glass", &["0.6", "0"]),
    ("cutoff", &["1/256", "off", "0.05", "0.2"]),
    ("lights", &["2", "1", "0"]),
];

const SIZES: &[&str] = &[
    "0.35-0.6",
    "0.2-0.35",
    "0.6-0.9",
    "0.9-1.3",
    "cover-0.2",
    "cover-0.3",
    "cover-0.4",
    "cover-0.5",
    "cover-0.6",
    "cover-0.7",
    "cover-0.8",
    "cover-0.9",
];

pub(super) const N_FACTORS: usize = 14;
const N_OPTIONS: usize = 7;

/// A level of every factor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Setting(pub(super) [u8; N_FACTORS]);

impl Setting {
    /// The level of a factor, by name.
    pub(crate) fn level(&self, factor: &str) -> &'static str {
        let place = FACTORS.iter().position(|(name, _)| *name == factor).expect("a factor");
        FACTORS[place].1[usize::from(self.0[place])]
    }

    /// Every factor with its level.
    pub(crate) fn levels(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        FACTORS.iter().zip(self.0).map(|((name, levels), level)| (*name, levels[usize::from(level)]))
    }

    /// With another level of a factor.
    pub(crate) fn with(mut self, factor: &str, level: &str) -> Self {
        let place = FACTORS.iter().position(|(name, _)| *name == factor).expect("a factor");
        let index = FACTORS[place].1.iter().position(|name| *name == level).expect("a level");
        self.0[place] = u8::try_from(index).expect("few levels");
        self
    }

    /// The factors that are not at their default.
    pub(crate) fn differences(&self) -> String {
        let others: Vec<_> = self
            .levels()
            .zip(FACTORS)
            .filter(|((_, level), (_, levels))| *level != levels[0])
            .map(|((name, level), _)| format!("{name}={level}"))
            .collect();
        if others.is_empty() { "all at their defaults".to_owned() } else { others.join(", ") }
    }

    /// The reading of section 2.3.
    pub(crate) fn reading(&self) -> Speer1985Options {
        let mut options = Speer1985Options::default();
        for (name, level) in self.levels().take(N_OPTIONS) {
            options.choose(name, level).expect("the factors are the options");
        }
        options
    }

    pub(super) fn order(&self) -> PixelOrder {
        match self.level("order") {
            "scanline" => PixelOrder::Scanline,
            "serpentine" => PixelOrder::Serpentine,
            _ => PixelOrder::Tiles(8),
        }
    }

    pub(super) fn resolution(&self) -> u32 {
        number(self.level("resolution"))
    }

    pub(super) fn cutoff(&self) -> Option<f64> {
        match self.level("cutoff") {
            "off" => None,
            "1/256" => Some(1.0 / 256.0),
            level => Some(number(level)),
        }
    }

    /// The scene of a seed.
    pub(super) fn scene(&self, count: u32, seed: u64) -> Result<Scene, StudyError> {
        let spheres = RandomSpheres {
            count,
            seed,
            size: size(self.level("size")),
            reflectance: number(self.level("reflectance")),
            transmittance: number(self.level("glass")),
            ..RandomSpheres::default()
        };
        let lights: usize = number(self.level("lights"));
        if lights == LIGHTS.len() {
            return Ok(spheres.scene()?);
        }
        // As `RandomSpheres::scene`, with fewer lights.
        let mut builder = SceneBuilder::new();
        builder.camera(Camera::new(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO, DVec3::Y, 28.0)?);
        builder.background(Color::new(0.10, 0.15, 0.25));
        builder.ambient(Color::splat(0.15));
        for &(position, intensity) in &LIGHTS[..lights] {
            builder.add_light(Light::point(position, Color::splat(intensity)));
        }
        spheres.add_to(&mut builder)?;
        Ok(builder.build()?)
    }
}

/// The lights of `RandomSpheres`.
const LIGHTS: [(DVec3, f64); 2] = [(DVec3::new(-4.0, 6.0, 6.0), 0.7), (DVec3::new(5.0, 2.0, 5.0), 0.4)];

/// The size of spheres by name.
pub(crate) fn size(level: &str) -> SphereSize {
    match (level.strip_prefix("cover-"), level.split_once('-')) {
        (Some(fraction), _) => SphereSize::Coverage(number(fraction)),
        (None, Some((least, greatest))) => SphereSize::Between(number(least), number(greatest)),
        (None, None) => SphereSize::Between(number(level), number(level)),
    }
}

fn number<T: std::str::FromStr>(level: &str) -> T {
    level.parse().unwrap_or_else(|_| panic!("the level `{level}` is no number"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_level_means_something() {
        for (factor, levels) in FACTORS {
            for level in levels {
                let setting = Setting::default().with(factor, level);
                assert_eq!(setting.level(factor), *level);
                let _ = (setting.reading(), setting.order(), setting.resolution(), setting.cutoff());
                assert!(setting.scene(2, 1).is_ok(), "{factor} = {level}");
            }
        }
    }

    #[test]
    fn the_default_is_that_of_the_program() {
        let setting = Setting::default();
        assert_eq!(setting.reading(), Speer1985Options::default());
        assert_eq!(setting.differences(), "all at their defaults");
        let (ours, theirs) = (setting.scene(8, 1).unwrap(), crate::sphere_scene(8, 1).unwrap().scene);
        assert_eq!((ours.objects(), ours.lights()), (theirs.objects(), theirs.lights()));
        assert_eq!(setting.with("slab", "centre").with("lights", "0").differences(), "slab=centre, lights=0");
    }

    #[test]
    fn fewer_lights_change_nothing_else() {
        let (two, one) = (Setting::default(), Setting::default().with("lights", "1"));
        let (two, one) = (two.scene(4, 3).unwrap(), one.scene(4, 3).unwrap());
        assert_eq!((one.lights().len(), one.lights()[0]), (1, two.lights()[0]));
        assert_eq!(
            (one.objects(), one.background(), one.ambient()),
            (two.objects(), two.background(), two.ambient())
        );
    }
}
