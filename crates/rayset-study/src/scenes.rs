//! The scenes of the experiments.

use std::path::Path;

use rayset_scene::glam::DVec3;
use rayset_scene::{
    Camera, Color, Light, LoadOptions, RandomSpheres, Scene, SceneBuilder, SceneError, load_obj,
};

/// A scene with the name that reports give it.
#[derive(Debug)]
pub struct NamedScene {
    /// The name.
    pub name: String,
    /// The scene.
    pub scene: Scene,
    /// The number of spheres; `None` for a mesh.
    pub spheres: Option<u32>,
}

/// The scene of Table 1 with this many spheres.
///
/// # Errors
///
/// As [`RandomSpheres::scene`].
pub fn sphere_scene(count: u32, seed: u64) -> Result<NamedScene, SceneError> {
    let scene = RandomSpheres { count, seed, ..RandomSpheres::default() }.scene()?;
    Ok(NamedScene { name: format!("spheres-{count}"), scene, spheres: Some(count) })
}

/// The mesh scenes of the second table, from the folder of fixtures.
///
/// # Errors
///
/// [`SceneError`] if a file is missing or damaged.
pub fn mesh_scenes(fixtures: &Path) -> Result<Vec<NamedScene>, SceneError> {
    Ok(vec![
        cornell_box(fixtures)?,
        cornell_spheres(fixtures)?,
        knob(fixtures, None)?,
        knob(fixtures, Some(KNOB_VOLUME))?,
    ])
}

/// A Cornell box of 36 triangles in 8 groups.
///
/// # Errors
///
/// As [`mesh_scenes`].
pub fn cornell_box(fixtures: &Path) -> Result<NamedScene, SceneError> {
    let camera = Camera::new(DVec3::new(0.0, 1.0, 3.9), DVec3::new(0.0, 1.0, 0.0), DVec3::Y, 40.0)?;
    let lights = [Light::point(DVec3::new(0.0, 1.9, 0.0), Color::splat(0.9))];
    mesh(
        "cornell-box",
        &fixtures.join("obj/cornell/CornellBox-Original.obj"),
        camera,
        &lights,
        &LoadOptions::default(),
    )
}

/// A Cornell box with a mirror and a glass sphere of triangles.
///
/// # Errors
///
/// As [`mesh_scenes`].
pub fn cornell_spheres(fixtures: &Path) -> Result<NamedScene, SceneError> {
    let camera = Camera::new(DVec3::new(0.0, 0.8, 3.4), DVec3::new(0.0, 0.8, 0.0), DVec3::Y, 38.0)?;
    let lights = [Light::point(DVec3::new(0.0, 1.5, 0.0), Color::splat(0.9))];
    mesh(
        "cornell-spheres",
        &fixtures.join("obj/cornell/CornellBox-Sphere.obj"),
        camera,
        &lights,
        &LoadOptions::default(),
    )
}

/// The most triangles of a bounding volume, where the knob's groups are split.
const KNOB_VOLUME: u32 = 32;

/// A glass knob of 11,970 triangles in five groups, each under one bounding volume or split as
/// [`SceneBuilder::max_volume_primitives`] says.
///
/// # Errors
///
/// As [`mesh_scenes`].
pub fn knob(fixtures: &Path, max_volume_primitives: Option<u32>) -> Result<NamedScene, SceneError> {
    let camera = Camera::new(DVec3::new(-0.9, 0.9, -2.4), DVec3::new(0.0, -0.05, 0.0), DVec3::Y, 32.0)?;
    let lights = [
        Light::point(DVec3::new(3.0, 6.0, -4.0), Color::splat(0.8)),
        Light::point(DVec3::new(-5.0, 4.0, -3.0), Color::splat(0.4)),
    ];
    let name = max_volume_primitives.map_or_else(|| "knob".to_owned(), |max| format!("knob-split-{max}"));
    let options = LoadOptions { max_volume_primitives, ..LoadOptions::default() };
    mesh(&name, &fixtures.join("obj/mori_knob/testObj.obj"), camera, &lights, &options)
}

fn mesh(
    name: &str,
    path: &Path,
    camera: Camera,
    lights: &[Light],
    options: &LoadOptions,
) -> Result<NamedScene, SceneError> {
    let mut builder = SceneBuilder::new();
    builder.max_volume_primitives(options.max_volume_primitives);
    builder.camera(camera).ambient(Color::splat(0.2)).background(Color::new(0.10, 0.15, 0.25));
    for light in lights {
        builder.add_light(*light);
    }
    load_obj(path, options)?.add_to(&mut builder);
    Ok(NamedScene { name: name.to_owned(), scene: builder.build()?, spheres: None })
}
