//! A wide bounding volume hierarchy with exact, repeatable double-precision hits.
//!
//! Boxes are culled in single precision, in lanes, with margins that are derived so that no hit is lost; what is hit
//! is decided by the `f64` tests of [`rayset_geometry`]. So every answer has the bits of a loop over all primitives, on
//! any backend and for any number of threads.
//!
//! ```
//! use rayset_bvh::Hierarchy;
//! use rayset_geometry::{Primitive, Ray, Sides, Span, Sphere, glam::DVec3};
//!
//! let spheres: Vec<Primitive> =
//!     (1..=100).map(|i| Sphere::new(DVec3::new(0.0, 0.0, 5.0 * f64::from(i)), 1.0).into()).collect();
//! let hierarchy = Hierarchy::new(spheres.iter().map(|sphere| (sphere, Sides::Both)));
//!
//! let hit = hierarchy.nearest(&Ray::new(DVec3::ZERO, DVec3::Z), Span::FORWARD).unwrap();
//! assert_eq!((hit.t, hit.primitive), (4.0, 0));
//! ```

mod axes;
mod batch;
mod beam;
mod blockers;
mod boxes;
mod build;
mod bundle;
mod cells;
mod columns;
mod cone;
mod descent;
#[cfg(test)]
mod doubtful;
mod duplicates;
mod each;
mod entrance;
mod exact;
mod faces;
mod fans;
mod few;
mod frame;
mod hierarchy;
mod interval;
mod leaf;
mod lists;
mod node;
mod own;
mod packet;
mod pairs;
mod planes;
mod ray;
mod shaft;
mod shapes;
mod shear;
mod stream;
mod together;
mod traverse;
mod trial;
mod triangles;

pub use axes::{AXIS_MARGIN, REACH_MARGIN};
pub use batch::Query;
pub use beam::SHAFT_MARGIN;
pub use boxes::BoxHierarchy;
pub use bundle::{BundleScratch, Bundled, Group, PartOfList, Spent};
pub use cells::PLACE_MARGIN;
pub use columns::{HitOrNone, Left, RayColumns};
pub use cone::{CONE_MARGIN, COSINE_MARGIN};
pub use faces::FACE_MARGIN;
pub use hierarchy::{Hierarchy, Scratch};
pub use interval::SPHERE_MARGIN;
pub use own::{Shape, ShapeHierarchy};
pub use planes::PLANE_MARGIN;
pub use ray::SLAB_MARGIN;
pub use shapes::Hit;
pub use traverse::Steps;
pub use triangles::{DISTANCE_MARGIN, EDGE_MARGIN, VERTEX_MARGIN, WEIGHT_MARGIN};

/// The examples of the readme, compiled.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
