//! The golden scenes: rendered small, and compared bit by bit.

use rayset::{ChannelNames, image_of};
use rayset_engine::{Frame, RenderOptions, StrategyKind, render};
use rayset_image::Image;
use rayset_scene::geometry::{Cone, Polygon, Sides, Sphere, Triangle};
use rayset_scene::glam::DVec3;
use rayset_scene::{Camera, Color, Light, Material, Part, Scene, SceneBuilder, SceneError};
use rayset_study::{NamedScene, cornell_box, cornell_spheres, sphere_scene};

use crate::project;

/// All golden scenes.
pub(crate) fn scenes() -> Result<Vec<NamedScene>, SceneError> {
    let fixtures = project::fixtures();
    Ok(vec![
        sphere_scene(1, 1)?,
        sphere_scene(8, 1)?,
        sphere_scene(64, 1)?,
        cornell_box(&fixtures)?,
        cornell_spheres(&fixtures)?,
        NamedScene { name: "all-primitives".to_owned(), scene: all_primitives()?, spheres: None },
    ])
}

/// How a golden scene is rendered.
pub(crate) fn options() -> RenderOptions {
    RenderOptions { width: 64, height: 48, ..RenderOptions::default() }
}

/// A golden scene rendered with a strategy.
pub(crate) fn frame(scene: &NamedScene, kind: StrategyKind) -> Result<Frame, Box<dyn std::error::Error>> {
    Ok(render(kind.bind(&scene.scene).as_ref(), &options())?)
}

/// The image of a golden frame, with its provenance.
pub(crate) fn image(scene: &NamedScene, frame: &Frame) -> Result<Image, Box<dyn std::error::Error>> {
    let options = options();
    let depth = options.max_depth.to_string();
    let cutoff = options.cutoff.map_or_else(|| "off".to_owned(), |cutoff| cutoff.to_string());
    let provenance = [
        ("scene", scene.name.as_str()),
        ("strategy", "standard"),
        ("max_depth", &depth),
        ("cutoff", &cutoff),
    ];
    Ok(image_of(frame, ChannelNames::Plain, &provenance)?)
}

/// Every kind of primitive, seen from either side, with a mirror, glass, and both kinds of lights.
fn all_primitives() -> Result<Scene, SceneError> {
    let mut builder = SceneBuilder::new();
    builder.camera(Camera::new(DVec3::new(0.0, 2.2, 6.5), DVec3::new(0.0, 0.6, 0.0), DVec3::Y, 38.0)?);
    builder.background(Color::new(0.2, 0.3, 0.5)).ambient(Color::splat(0.1));
    builder.add_light(Light::point(DVec3::new(-3.0, 5.0, 4.0), Color::splat(0.7)));
    builder.add_light(Light::directional(DVec3::new(1.0, 2.0, 0.5), Color::splat(0.3)));
    let matt = |r, g, b| Material { diffuse: Color::new(r, g, b), ..Material::default() };
    let floor = builder.add_material(Material { reflectance: Color::splat(0.15), ..matt(0.6, 0.6, 0.55) });
    let mirror = builder.add_material(Material {
        specular: Color::splat(0.6),
        shininess: 80.0,
        reflectance: Color::splat(0.7),
        ..matt(0.1, 0.1, 0.12)
    });
    let glass = builder.add_material(Material {
        specular: Color::splat(0.5),
        shininess: 60.0,
        reflectance: Color::splat(0.1),
        transmittance: Color::new(0.7, 0.85, 0.8),
        index: 1.5,
        ..matt(0.02, 0.03, 0.03)
    });
    let red = builder.add_material(matt(0.8, 0.2, 0.1));
    let blue = builder.add_material(matt(0.2, 0.3, 0.8));
    let point = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let star = (0..10).map(|i| {
        let radius = if i % 2 == 0 { 4.5 } else { 2.6 };
        let angle = f64::from(i) * std::f64::consts::PI / 5.0;
        // Counterclockwise from above.
        point(radius * libm::sin(angle), 0.0, radius * libm::cos(angle))
    });
    builder.add_object("floor", floor, Polygon::new(star.collect()));
    builder.add_object("mirror", mirror, [Sphere::new(point(-1.3, 0.7, -0.4), 0.7)]);
    builder.add_object("glass", glass, [Sphere::new(point(0.5, 0.6, 1.0), 0.6)]);
    builder.add_object("pipe", red, Cone::new(point(1.7, 0.0, -0.6), 0.5, point(1.7, 1.4, -0.6), 0.5));
    builder.add_object("cone", blue, Cone::new(point(0.4, 0.0, -1.6), 0.8, point(0.4, 1.9, -1.6), 0.0));
    let pane = Triangle::new(point(-2.6, 0.0, 1.2), point(-1.6, 0.0, 1.8), point(-2.1, 1.3, 1.5));
    builder.add_object("pane", blue, [Part { sides: Sides::Front, ..pane.into() }]);
    let inner = Part { sides: Sides::Back, ..Sphere::new(point(2.4, 0.5, 1.4), 0.5).into() };
    builder.add_object("bowl", red, [inner]);
    builder.build()
}
