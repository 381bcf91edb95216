//! Whitted-style ray tracing with pluggable intersection strategies and the same bits from all of them.
//!
//! This crate re-exports the libraries of the workspace under one name:
//!
//! - [`geometry`]: rays, primitives, safety cylinders and the partition of space by a ray;
//! - [`bvh`]: the hierarchy by itself, over primitives or over boxes and a closure;
//! - [`scene`]: objects, materials, lights, cameras, random spheres and OBJ files;
//! - [`engine`]: intersection trees, shading and the strategies;
//! - [`image`]: float EXR, PNG, comparison and summaries;
//! - [`image_of`]: from a rendered frame to an image;
//! - [`simd`]: the lanes that all kernels are written over.
//!
//! ```
//! use rayset::engine::{RenderOptions, StrategyKind, render};
//! use rayset::scene::RandomSpheres;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = RandomSpheres { count: 8, seed: 1, ..RandomSpheres::default() }.scene()?;
//! let options = RenderOptions { width: 64, height: 64, ..RenderOptions::default() };
//! let frame = render(StrategyKind::default().bind(&scene).as_ref(), &options)?;
//! println!("{}", frame.counts);
//! # Ok(())
//! # }
//! ```

mod frames;

pub use frames::{ChannelNames, image_of};
pub use rayset_bvh as bvh;
pub use rayset_engine as engine;
pub use rayset_geometry as geometry;
pub use rayset_geometry::glam;
pub use rayset_image as image;
pub use rayset_scene as scene;
pub use rayset_simd as simd;

/// The examples of the READMEs are compiled and run.
#[cfg(all(doctest, feature = "obj", feature = "exr", feature = "png"))]
mod readme {
    #[doc = include_str!("../README.md")]
    #[expect(dead_code, reason = "it only carries the example")]
    struct OfTheCrate;

    #[doc = include_str!("../../../README.md")]
    #[expect(dead_code, reason = "it only carries the example")]
    struct OfTheWorkspace;
}
