//! What the paper's experiment leaves open, and the experiment once all of it is said.

use rayset_engine::{
    Backend, PixelOrder, RenderOptions, Speer1985, Speer1985Options, StrategyKind, SweepLength, render,
};
use rayset_scene::glam::DVec3;
use rayset_scene::{Camera, Color, Light, RandomSpheres, Scene, SceneBuilder, SceneError, SphereSize};
use serde::{Deserialize, Serialize};

use crate::{Counts, StudyError};

/// What the paper leaves open: with a number of spheres and a seed, a whole experiment.
///
/// What an option of [`Speer1985Options`] cannot say is said here: scenes, resolution, and the order of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// The reading of section 2.3.
    pub reading: Speer1985Options,
    /// The order in which rays are cast, and so which ray comes before which.
    pub order: PixelOrder,
    /// The side of the square image, in pixels.
    pub resolution: u32,
    /// How large the spheres are.
    pub size: SphereSize,
    /// The coefficient of reflected rays.
    pub reflectance: f64,
    /// The coefficient of refracted rays of every fourth sphere.
    pub transmittance: f64,
    /// The adaptive cut-off.
    pub cutoff: Option<f64>,
    /// How many of the two lights of [`RandomSpheres`] there are, the key light first; more than two are two.
    pub lights: usize,
}

/// What both algorithms counted for one scene, and where they differ.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pair {
    /// What `standard` counted.
    pub standard: Counts,
    /// What `speer-1985` counted.
    pub speer: Counts,
    /// Pixels that differ.
    pub wrong_pixels: u64,
    /// Pixels.
    pub pixels: u64,
}

impl Default for Conditions {
    /// Those of Table 1 with the literal reading.
    fn default() -> Self {
        let (spheres, options) = (RandomSpheres::default(), RenderOptions::default());
        Self {
            reading: Speer1985Options::default(),
            order: PixelOrder::Scanline,
            resolution: options.width,
            size: spheres.size,
            reflectance: spheres.reflectance,
            transmittance: spheres.transmittance,
            cutoff: options.cutoff,
            lights: LIGHTS.len(),
        }
    }
}

impl Conditions {
    /// The scene of a seed.
    ///
    /// # Errors
    ///
    /// [`SceneError::Invalid`] if a size or coefficient is negative, out of range or not finite.
    pub fn scene(&self, count: u32, seed: u64) -> Result<Scene, SceneError> {
        let Self { size, reflectance, transmittance, .. } = *self;
        let spheres =
            RandomSpheres { count, seed, size, reflectance, transmittance, ..RandomSpheres::default() };
        if self.lights >= LIGHTS.len() {
            return spheres.scene();
        }
        // As `RandomSpheres::scene`, with fewer lights.
        let mut builder = SceneBuilder::new();
        builder.camera(Camera::new(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO, DVec3::Y, 28.0)?);
        builder.background(Color::new(0.10, 0.15, 0.25));
        builder.ambient(Color::splat(0.15));
        for &(position, intensity) in &LIGHTS[..self.lights] {
            builder.add_light(Light::point(position, Color::splat(intensity)));
        }
        spheres.add_to(&mut builder)?;
        builder.build()
    }

    /// How a scene is rendered: the image is one sweep, as in the paper, and so on one thread.
    #[must_use]
    pub fn render_options(&self) -> RenderOptions {
        RenderOptions {
            width: self.resolution,
            height: self.resolution,
            cutoff: self.cutoff,
            order: Some(self.order),
            sweep: SweepLength::WholeImage,
            ..RenderOptions::default()
        }
    }

    /// Renders one scene with `standard` and with the reading, and counts.
    ///
    /// # Errors
    ///
    /// As [`scene`](Self::scene) and [`render`].
    pub fn pair(&self, spheres: u32, seed: u64) -> Result<Pair, StudyError> {
        let scene = self.scene(spheres, seed)?;
        let options = self.render_options();
        let standard = render(StrategyKind::Standard.bind_on(&scene, Backend::Scalar).as_ref(), &options)?;
        let speer = render(&Speer1985::on(&scene, Backend::Scalar, self.reading), &options)?;
        Ok(Pair {
            wrong_pixels: speer.differing_pixels(&standard) as u64,
            pixels: u64::from(self.resolution) * u64::from(self.resolution),
            standard: Counts::of(&standard.counts, &standard.stats),
            speer: Counts::of(&speer.counts, &speer.stats),
        })
    }

    /// Everything that is left open, by name, as text: the options of the reading first.
    #[must_use]
    pub fn levels(&self) -> Vec<(&'static str, String)> {
        let order = match self.order {
            PixelOrder::Scanline => "scanline".to_owned(),
            PixelOrder::Serpentine => "serpentine".to_owned(),
            PixelOrder::Tiles(side) => format!("tiles-{side}"),
            PixelOrder::Morton(side) => format!("morton-{side}"),
        };
        let choices = self.reading.choices().into_iter().map(|(option, choice)| (option, choice.to_owned()));
        let others = [
            ("order", order),
            ("resolution", self.resolution.to_string()),
            ("size", name_of_size(self.size)),
            ("reflectance", self.reflectance.to_string()),
            ("glass", self.transmittance.to_string()),
            ("cutoff", self.cutoff.map_or_else(|| "off".to_owned(), |cutoff| cutoff.to_string())),
            ("lights", self.lights.to_string()),
        ];
        choices.chain(others).collect()
    }

    /// Those that are not at their defaults, as text.
    #[must_use]
    pub fn differences(&self) -> String {
        let defaults = Self::default().levels();
        let levels = self.levels().into_iter().zip(defaults).filter(|(ours, default)| ours != default);
        let others: Vec<_> = levels.map(|((name, level), _)| format!("{name}={level}")).collect();
        if others.is_empty() { "all at their defaults".to_owned() } else { others.join(", ") }
    }
}

/// The lights of `RandomSpheres`.
const LIGHTS: [(DVec3, f64); 2] = [(DVec3::new(-4.0, 6.0, 6.0), 0.7), (DVec3::new(5.0, 2.0, 5.0), 0.4)];

/// The size of spheres by name: radii from and to in world units, or the fraction that they cover of the cube's face.
pub(crate) fn name_of_size(size: SphereSize) -> String {
    match size {
        SphereSize::Between(least, greatest) => format!("{least}-{greatest}"),
        SphereSize::Coverage(fraction) => format!("cover-{fraction}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_that_of_the_program() {
        let conditions = Conditions::default();
        assert_eq!(conditions.differences(), "all at their defaults");
        let (ours, theirs) = (conditions.scene(8, 1).unwrap(), crate::sphere_scene(8, 1).unwrap().scene);
        assert_eq!((ours.objects(), ours.lights()), (theirs.objects(), theirs.lights()));
    }

    #[test]
    fn fewer_lights_change_nothing_else() {
        let scene = |lights| Conditions { lights, ..Conditions::default() }.scene(4, 3).unwrap();
        let (two, one) = (scene(2), scene(1));
        assert_eq!((one.lights().len(), one.lights()[0]), (1, two.lights()[0]));
        assert_eq!(
            (one.objects(), one.background(), one.ambient()),
            (two.objects(), two.background(), two.ambient())
        );
    }

    #[test]
    fn a_pair_has_the_same_counts_each_time() {
        let conditions = Conditions { resolution: 48, ..Conditions::default() };
        let pair = conditions.pair(4, 2).unwrap();
        assert_eq!(pair, conditions.pair(4, 2).unwrap());
        assert_eq!((pair.pixels, pair.speer.cast[0]), (48 * 48, 48 * 48));
        assert!(pair.speer.coherent[0] > 0 && pair.standard.work.cylinders_built == 0);
    }
}
