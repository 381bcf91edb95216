//! Seeded random spheres: the scenes of Table 1.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayset_geometry::Sphere;
use rayset_geometry::glam::DVec3;

use crate::{Camera, Color, Light, Material, MaterialId, Scene, SceneBuilder, SceneError};

/// How large random spheres are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SphereSize {
    /// Radii uniform between two values, in world units, however many there are.
    Between(f64, f64),
    /// Radii within 20 % of the one at which they cover this fraction of a square view of the cube.
    Coverage(f64),
}

/// Spheres at random positions in the cube from (-1, -1, -1) to (1, 1, 1), seen from (0, 0, 6) at 28 degrees.
///
/// The scene depends on these values alone: the generator is `ChaCha` with 8 rounds, keyed with the seed, and its
/// words are turned into numbers here, so no release of a random number crate can change it.
///
/// Every sphere is diffuse with a random colour and reflects `reflectance` of the light; each fourth one
/// (the last of every four) is glass of index 1.5 that lets `transmittance` through. There are two point lights.
///
/// Source: Speer et al. 1985, section 4, "four scenes containing an increasing number of randomly-positioned
/// spheres"; the paper gives no more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RandomSpheres {
    /// How many spheres.
    pub count: u32,
    /// What makes this scene differ from the others.
    pub seed: u64,
    /// How large they are.
    pub size: SphereSize,
    /// Whether a sphere that would overlap an earlier one is placed anew, up to 64 times.
    ///
    /// Takes time quadratic in the count; the paper assumes "that relatively few of these volumes intersect".
    pub separate: bool,
    /// The coefficient of reflected rays.
    pub reflectance: f64,
    /// The coefficient of refracted rays, of the spheres that are glass.
    pub transmittance: f64,
}

impl Default for RandomSpheres {
    /// One separate sphere of radius 0.35 to 0.6, reflecting 0.3, glass 0.6.
    fn default() -> Self {
        Self {
            count: 1,
            seed: 1,
            size: SphereSize::Between(0.35, 0.6),
            separate: true,
            reflectance: 0.3,
            transmittance: 0.6,
        }
    }
}

impl RandomSpheres {
    /// Builds the scene; every sphere is an object of its own.
    ///
    /// # Errors
    ///
    /// [`SceneError::Invalid`] if a size or coefficient is negative, out of range or not finite.
    pub fn scene(&self) -> Result<Scene, SceneError> {
        let mut builder = SceneBuilder::new();
        builder.camera(Camera::new(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO, DVec3::Y, 28.0)?);
        builder.background(Color::new(0.10, 0.15, 0.25));
        builder.ambient(Color::splat(0.15));
        builder.add_light(Light::point(DVec3::new(-4.0, 6.0, 6.0), Color::splat(0.7)));
        builder.add_light(Light::point(DVec3::new(5.0, 2.0, 5.0), Color::splat(0.4)));
        self.add_to(&mut builder)?;
        builder.build()
    }

    /// Adds the spheres, one object each, and their materials to a scene.
    ///
    /// # Errors
    ///
    /// [`SceneError::Invalid`] if a size is negative, out of range or not finite.
    pub fn add_to(&self, builder: &mut SceneBuilder) -> Result<(), SceneError> {
        let (least, greatest) = self.radii()?;
        let mut random = Random::new(self.seed);
        let mut spheres: Vec<Sphere> = Vec::new();
        for i in 0..self.count {
            let radius = random.between(least, greatest);
            let mut position = random.position();
            for _ in 0..64 {
                let overlaps = |other: &Sphere| {
                    let reach = other.radius() + radius;
                    other.center().distance_squared(position) < reach * reach
                };
                if !self.separate || !spheres.iter().any(overlaps) {
                    break;
                }
                position = random.position();
            }
            let sphere = Sphere::new(position, radius);
            let color =
                Color::new(random.between(0.1, 0.9), random.between(0.1, 0.9), random.between(0.1, 0.9));
            let material = self.material(builder, color, i % 4 == 3);
            builder.add_object(format!("sphere {i}"), material, [sphere]);
            spheres.push(sphere);
        }
        Ok(())
    }

    fn radii(&self) -> Result<(f64, f64), SceneError> {
        let invalid = |message: &str| SceneError::Invalid {
            item: "random spheres".to_owned(),
            message: message.to_owned(),
        };
        match self.size {
            SphereSize::Between(least, greatest) => {
                if !(least > 0.0 && greatest >= least && greatest.is_finite()) {
                    return Err(invalid("the radii are not a positive range"));
                }
                Ok((least, greatest))
            }
            SphereSize::Coverage(fraction) => {
                if !(fraction > 0.0 && fraction < 1.0) {
                    return Err(invalid("the coverage is not between 0 and 1"));
                }
                // Discs of area A thrown on a square of area 4 leave exp(-n A / 4) of it free.
                let area = -libm::log(1.0 - fraction) * 4.0 / f64::from(self.count.max(1));
                let radius = (area / std::f64::consts::PI).sqrt();
                Ok((0.8 * radius, 1.2 * radius))
            }
        }
    }

    fn material(&self, builder: &mut SceneBuilder, color: Color, glass: bool) -> MaterialId {
        let shared = Material {
            specular: Color::splat(0.4),
            shininess: 40.0,
            reflectance: Color::splat(self.reflectance),
            ..Material::default()
        };
        builder.add_material(if glass {
            Material {
                diffuse: 0.1 * color,
                transmittance: Color::splat(self.transmittance),
                index: 1.5,
                ..shared
            }
        } else {
            Material { diffuse: 0.7 * color, ..shared }
        })
    }
}

/// Numbers that depend on the seed and on nothing else.
struct Random(ChaCha8Rng);

impl Random {
    fn new(seed: u64) -> Self {
        let mut key = [0; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        Self(ChaCha8Rng::from_seed(key))
    }

    /// Uniform in [0, 1): the upper 53 bits of a word.
    #[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
    fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, least: f64, greatest: f64) -> f64 {
        least + (greatest - least) * self.unit()
    }

    fn position(&mut self) -> DVec3 {
        let x = self.between(-1.0, 1.0);
        let y = self.between(-1.0, 1.0);
        DVec3::new(x, y, self.between(-1.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn the_same_seed_gives_the_same_spheres_for_ever() {
        let size = SphereSize::Between(0.25, 0.45);
        let scene = RandomSpheres { count: 8, seed: 1, size, ..RandomSpheres::default() }.scene().unwrap();
        let bits = scene.objects().iter().flat_map(|object| {
            let [x, y, z] = object.bounds.center.to_array();
            [x, y, z, object.bounds.radius].map(f64::to_bits)
        });
        // A hash by hand: any change of any bit shows.
        let hash =
            bits.fold(0xcbf2_9ce4_8422_2325_u64, |hash, bits| (hash ^ bits).wrapping_mul(0x100_0000_01b3));
        assert_eq!(hash, EIGHT_SPHERES_OF_SEED_1, "{hash:#x}");
    }

    const EIGHT_SPHERES_OF_SEED_1: u64 = 0x4997_a424_8066_4fd6;

    #[test]
    fn more_spheres_of_one_seed_keep_the_first_ones() {
        let few = RandomSpheres { count: 2, seed: 7, ..RandomSpheres::default() }.scene().unwrap();
        let many = RandomSpheres { count: 5, seed: 7, ..RandomSpheres::default() }.scene().unwrap();
        assert_eq!(few.objects()[..2], many.objects()[..2]);
    }

    #[test]
    fn separate_spheres_do_not_overlap() {
        let scene = RandomSpheres { count: 8, seed: 3, ..RandomSpheres::default() }.scene().unwrap();
        let bounds: Vec<_> = scene.objects().iter().map(|object| object.bounds).collect();
        for (i, a) in bounds.iter().enumerate() {
            for b in &bounds[..i] {
                assert!(a.center.distance(b.center) >= a.radius + b.radius);
            }
        }
    }

    #[test]
    fn coverage_shrinks_spheres_as_they_become_many() {
        let radius = |count| {
            let scene = RandomSpheres { count, size: SphereSize::Coverage(0.5), ..RandomSpheres::default() };
            let radii = scene.radii().unwrap();
            f64::midpoint(radii.0, radii.1)
        };
        assert_abs_diff_eq!(radius(4) / radius(64), 4.0, epsilon = 1e-12);
    }

    #[test]
    fn nonsense_sizes_are_refused() {
        for size in [
            SphereSize::Between(-1.0, 1.0),
            SphereSize::Between(2.0, 1.0),
            SphereSize::Between(1.0, f64::NAN),
            SphereSize::Coverage(1.0),
            SphereSize::Coverage(f64::NAN),
        ] {
            assert!(RandomSpheres { size, ..RandomSpheres::default() }.scene().is_err(), "{size:?}");
        }
        assert!(RandomSpheres { reflectance: f64::NAN, ..RandomSpheres::default() }.scene().is_err());
    }
}
