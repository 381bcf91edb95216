//! The scenes of the bench, and how they are seen.

use std::path::{Path, PathBuf};

use rayset_engine::Crop;
use rayset_scene::{
    Color, Light, LoadOptions, Material, RandomSpheres, Scene, SceneBuilder, SphereSize, load_obj, load_scene,
};

use serde::{Deserialize, Serialize};

use crate::{StudyError, knob};

/// A scene of the bench.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BenchScene {
    name: String,
    source: Source,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Source {
    Spheres(u32),
    /// The fixtures that hold it.
    Knob(PathBuf),
    /// A mesh made all of glass.
    Glass(PathBuf),
    /// As the file says.
    File(PathBuf),
}

/// The numbers of random spheres.
const SPHERES: [(u32, &str); 7] = [
    (1, "spheres-1"),
    (8, "spheres-8"),
    (64, "spheres-64"),
    (1 << 10, "spheres-1k"),
    (1 << 14, "spheres-16k"),
    (1 << 18, "spheres-256k"),
    (1 << 20, "spheres-1M"),
];

/// The standard scenes.
const STANDARD: [&str; 5] = ["balls", "gears", "mount", "rings", "tree"];

/// The meshes, and where each is in a folder of meshes.
const MESHES: [(&str, &str); 3] = [
    ("spot", "spot/spot_triangulated.obj"),
    ("teapot", "teapot/teapot.obj"),
    ("lost-empire", "lost_empire/lost_empire.obj"),
];

/// Spheres beyond this number are not kept from overlapping, which takes time quadratic in it.
const MOST_SEPARATE: u32 = 256;

impl BenchScene {
    /// All scenes: random spheres, the standard scenes and the meshes of a folder of fixtures, and the meshes of
    /// another folder, each in a folder of its own. The second list names those that neither has.
    #[must_use]
    pub fn all(fixtures: &Path, meshes: Option<&Path>) -> (Vec<Self>, Vec<String>) {
        let mut scenes: Vec<_> = SPHERES
            .map(|(count, name)| Self { name: name.to_owned(), source: Source::Spheres(count) })
            .into();
        let mut missing = Vec::new();
        for name in STANDARD {
            let path = fixtures.join("nff").join(format!("{name}.nff.gz"));
            scenes.push(Self { name: name.to_owned(), source: Source::File(path) });
        }
        scenes.push(Self { name: "knob".to_owned(), source: Source::Knob(fixtures.into()) });
        for (name, place) in MESHES {
            let own = fixtures.join("obj");
            let file = Path::new(place).file_name().unwrap_or_default();
            let places = [own.join(file), own.join(place)].into_iter();
            match places.chain(meshes.map(|folder| folder.join(place))).find(|path| path.is_file()) {
                Some(path) => scenes.push(Self { name: name.to_owned(), source: Source::Glass(path) }),
                None => missing.push(name.to_owned()),
            }
        }
        (scenes, missing)
    }

    /// The scene of a file, with the materials, lights and camera that it says.
    #[must_use]
    pub fn file(path: &Path) -> Self {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        Self {
            name: name.split('.').next().unwrap_or_default().to_owned(),
            source: Source::File(path.into()),
        }
    }

    /// The name by which options and reports know it.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// How many random spheres it has, if it is made of them.
    #[must_use]
    pub fn spheres(&self) -> Option<u32> {
        match self.source {
            Source::Spheres(count) => Some(count),
            _ => None,
        }
    }

    /// Builds or reads it.
    ///
    /// # Errors
    ///
    /// [`StudyError::Scene`] if a file is missing or damaged.
    pub fn load(&self) -> Result<Scene, StudyError> {
        Ok(match &self.source {
            Source::Spheres(count) => {
                let size = SphereSize::Coverage(0.5);
                let separate = *count <= MOST_SEPARATE;
                RandomSpheres { count: *count, size, separate, ..RandomSpheres::default() }.scene()?
            }
            Source::Knob(fixtures) => knob(fixtures, None)?.scene,
            Source::Glass(path) => glass(path)?,
            Source::File(path) => load_scene(path, &LoadOptions::default())?.scene,
        })
    }
}

/// A mesh all of glass that also reflects, so that there are rays of every kind; seen and lit as its file would be.
fn glass(path: &Path) -> Result<Scene, StudyError> {
    let options = LoadOptions::default();
    let camera = *load_scene(path, &options)?.scene.camera();
    let mut model = load_obj(path, &options)?;
    let glass = Material {
        diffuse: Color::splat(0.1),
        reflectance: Color::splat(0.3),
        transmittance: Color::splat(0.6),
        index: 1.5,
        ..Material::default()
    };
    model.materials = vec![("glass".to_owned(), glass)];
    for group in &mut model.groups {
        group.material = Some(0);
    }
    let mut builder = SceneBuilder::new();
    builder.camera(camera).ambient(Color::splat(0.2));
    let center = camera.target();
    let reach = camera.viewpoint() - center;
    // Two lights, on either side of the camera and above it.
    let aside = reach.cross(camera.up());
    for side in [aside, -0.5 * aside] {
        builder
            .add_light(Light::point(center + reach + side + camera.up() * reach.length(), Color::splat(0.6)));
    }
    model.add_to(&mut builder);
    Ok(builder.build()?)
}

/// A square of pixels in the middle of a square image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct View {
    /// The side of the image, in pixels.
    pub image: u32,
    /// The side of the part of it that is traced: at most that of the image.
    pub side: u32,
}

impl View {
    /// What reports call it.
    #[must_use]
    pub fn name(&self) -> String {
        match (self.side, self.image) {
            (side, image) if side == image => format!("{side} x {side}"),
            (side, image) => format!("{side} x {side} of {image} x {image}"),
        }
    }

    /// The pixels that are traced.
    #[must_use]
    pub fn crop(&self) -> Crop {
        let first = (self.image - self.side) / 2;
        Crop { x: first, y: first, width: self.side, height: self.side }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_that_are_nowhere_are_named() {
        let (scenes, missing) = BenchScene::all(Path::new("nowhere"), None);
        assert_eq!(scenes.len(), 13);
        assert_eq!(missing, ["spot", "teapot", "lost-empire"]);
        assert_eq!(BenchScene::file(Path::new("a/balls.nff.gz")).name(), "balls");
    }

    #[test]
    fn a_crop_is_in_the_middle() {
        let view = View { image: 2048, side: 512 };
        assert_eq!(view.crop(), Crop { x: 768, y: 768, width: 512, height: 512 });
        assert_eq!(view.name(), "512 x 512 of 2048 x 2048");
    }
}
