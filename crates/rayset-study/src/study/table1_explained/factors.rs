//! What the paper leaves open, as factors with levels.

use rayset_engine::{PixelOrder, Speer1985Options};
use rayset_scene::SphereSize;

use crate::Conditions;

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

    /// What the levels mean.
    pub(crate) fn conditions(&self) -> Conditions {
        let mut reading = Speer1985Options::default();
        for (name, level) in self.levels().take(N_OPTIONS) {
            reading.choose(name, level).expect("the factors are the options");
        }
        Conditions {
            reading,
            order: match self.level("order") {
                "scanline" => PixelOrder::Scanline,
                "serpentine" => PixelOrder::Serpentine,
                _ => PixelOrder::Tiles(8),
            },
            resolution: number(self.level("resolution")),
            size: size(self.level("size")),
            reflectance: number(self.level("reflectance")),
            transmittance: number(self.level("glass")),
            cutoff: match self.level("cutoff") {
                "off" => None,
                "1/256" => Some(1.0 / 256.0),
                level => Some(number(level)),
            },
            lights: number(self.level("lights")),
        }
    }
}

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
    use crate::conditions::name_of_size;

    #[test]
    fn every_level_means_something_and_no_two_mean_the_same() {
        for (factor, levels) in FACTORS {
            let mut seen = Vec::new();
            for level in levels {
                let setting = Setting::default().with(factor, level);
                assert_eq!(setting.level(factor), *level);
                let conditions = setting.conditions();
                assert!(conditions.scene(2, 1).is_ok(), "{factor} = {level}");
                assert!(!seen.contains(&conditions), "{factor} = {level}");
                seen.push(conditions);
            }
        }
    }

    #[test]
    fn the_default_is_that_of_the_program() {
        assert_eq!(Setting::default().conditions(), Conditions::default());
        let other = Setting::default().with("slab", "centre").with("lights", "0");
        assert_eq!(other.conditions().differences(), "slab=centre, lights=0");
    }

    #[test]
    fn sizes_are_called_as_their_levels() {
        for level in SIZES {
            assert_eq!(name_of_size(size(level)), *level);
        }
    }
}
