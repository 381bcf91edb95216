//! Objects, materials, lights and cameras for Whitted-style ray tracing, made in code or read from OBJ.
//!
//! A [`Scene`] is immutable once built, and valid: loading and building return errors, so that what traces it
//! cannot fail.
//!
//! ```
//! use rayset_scene::{Camera, Light, Material, SceneBuilder, geometry::Sphere, glam::DVec3};
//!
//! # fn main() -> Result<(), rayset_scene::SceneError> {
//! let mut builder = SceneBuilder::new();
//! builder.camera(Camera::new(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 40.0)?);
//! builder.add_light(Light::point(DVec3::new(5.0, 5.0, 5.0), DVec3::ONE));
//! let mirror = builder.add_material(Material { reflectance: DVec3::splat(0.8), ..Material::default() });
//! builder.add_object("ball", mirror, [Sphere::new(DVec3::ZERO, 1.0)]);
//! let scene = builder.build()?;
//! assert_eq!(scene.objects().len(), 1);
//! # Ok(())
//! # }
//! ```

mod builder;
mod camera;
mod error;
mod folder;
mod ids;
mod layout;
mod light;
mod lines;
mod load;
mod material;
mod nff;
#[cfg(feature = "obj")]
mod obj;
mod part;
mod patch;
mod scene;
mod spheres;
#[cfg(feature = "toml")]
mod toml;
#[cfg(any(feature = "obj", feature = "toml"))]
mod view;
mod warnings;

pub use builder::{MAX_COORDINATE, MAX_PRIMITIVES, SceneBuilder};
pub use camera::Camera;
pub use error::{SceneError, Warning};
pub use ids::{LightId, MaterialId, ObjectId, PrimitiveId, VolumeId};
pub use light::{Illumination, Light};
pub use load::{Limits, LoadOptions, LoadedScene, load_scene};
pub use material::{Color, Material, Spawns};
pub use nff::{load_nff, read_nff};
#[cfg(feature = "obj")]
pub use obj::{MtlLibrary, ObjGroup, ObjModel, load_obj, read_mtl, read_obj};
pub use part::Part;
pub use patch::Patch;
pub use rayset_geometry as geometry;
pub use rayset_geometry::glam;
pub use scene::{Object, PrimitiveLocation, PrimitiveSurface, Scene, SurfaceForm, SurfacePoint};
pub use spheres::{RandomSpheres, SphereSize};
#[cfg(feature = "toml")]
pub use toml::{load_toml, read_toml};

#[cfg(all(doctest, feature = "obj"))]
#[doc = include_str!("../README.md")]
struct Readme;
