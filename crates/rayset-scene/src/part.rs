//! A primitive as it is added to an object.

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Cone, Polygon, Primitive, Sides, Sphere, Triangle};

/// A primitive, the sides from which it is visible, and normals to shade it with.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// The shape.
    pub primitive: Primitive,
    /// From which sides rays hit it, light rays too.
    pub sides: Sides,
    /// A normal for each vertex of a triangle, in world space; they shade the surface and never move a hit.
    ///
    /// They need not have unit length. For polygons with normals there is [`Patch`](crate::Patch).
    pub normals: Option<[DVec3; 3]>,
}

macro_rules! from_shape {
    ($($shape:ident),*) => {$(
        impl From<$shape> for Part {
            /// Visible from both sides, shaded by its own normal.
            fn from(shape: $shape) -> Self {
                Self { primitive: shape.into(), sides: Sides::Both, normals: None }
            }
        }
    )*};
}

from_shape!(Sphere, Triangle, Polygon, Cone, Primitive);
