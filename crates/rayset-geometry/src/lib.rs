//! Rays, primitives and safety cylinders with exact, repeatable double-precision hits.
//!
//! Every hit is decided by one `f64` arithmetic, written once over the lanes of [`rayset_simd`], so that a
//! primitive tested alone, in a column of thousands, or on another instruction set gives the same bits.
//!
//! ```
//! use rayset_geometry::{Primitive, Ray, Sides, Span, Sphere, glam::DVec3};
//!
//! let ray = Ray::new(DVec3::ZERO, DVec3::Z);
//! let sphere = Primitive::from(Sphere::new(DVec3::new(0.0, 0.0, 5.0), 1.0));
//! assert_eq!(sphere.intersect(&ray, Span::FORWARD, Sides::Both, None), Some(4.0));
//! // Only the inside is visible: the ray hits where it leaves.
//! assert_eq!(sphere.intersect(&ray, Span::FORWARD, Sides::Back, None), Some(6.0));
//! ```

mod bounding;
mod bounding_box;
mod columns;
mod cone;
mod crossing;
mod cylinder;
mod departure;
mod exact;
mod kind;
mod pencil;
mod polygon;
mod primitive;
mod probe;
mod ray;
mod region;
mod side;
mod span;
mod sphere;
mod triangle;
mod vectors;

pub use bounding::{BoundingSphere, enclosing_sphere};
pub use bounding_box::BoundingBox;
pub use columns::{ColumnHit, ColumnRun, Outward, PrimitiveColumns};
pub use cone::{Cone, ConeAxis};
pub use cylinder::Cylinder;
pub use departure::Departure;
pub use exact::compare_products;
pub use glam;
pub use kind::PrimitiveKind;
pub use pencil::{PENCIL_MARGIN, Pencil, PencilGate, PencilLanes};
pub use polygon::Polygon;
pub use primitive::Primitive;
pub use probe::{AxesLanes, AxesOrder, Probe, RayLanes, Shear, ShearedLanes};
pub use ray::{Ray, unit};
pub use region::{BoundingPlane, PARTITION_MARGIN, VolumeColumns, VolumeLanes, VolumeSet};
pub use side::{Side, Sides};
pub use span::Span;
pub use sphere::Sphere;
pub use triangle::Triangle;
pub use vectors::{dot_lanes, unit_lanes};

/// The examples of the readme, compiled.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;
