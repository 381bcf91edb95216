//! A primitive of any shape.

use glam::DVec3;
use rayset_simd::Scalar;

use crate::departure::Allowed;
use crate::{BoundingSphere, Cone, Polygon, PrimitiveKind, Probe, Ray, Side, Sides, Span, Sphere, Triangle};
use crate::{cone, polygon};

/// A piece of surface: what the paper calls a primitive.
///
/// A closed enum, so that a `match` shows every place that knows the shapes.
#[derive(Clone, Debug, PartialEq)]
pub enum Primitive {
    /// A sphere.
    Sphere(Sphere),
    /// A triangle.
    Triangle(Triangle),
    /// A planar polygon.
    Polygon(Polygon),
    /// A cylinder or truncated cone without caps.
    Cone(Cone),
}

impl Primitive {
    /// The shape.
    #[must_use]
    pub fn kind(&self) -> PrimitiveKind {
        match self {
            Self::Sphere(_) => PrimitiveKind::Sphere,
            Self::Triangle(_) => PrimitiveKind::Triangle,
            Self::Polygon(_) => PrimitiveKind::Polygon,
            Self::Cone(_) => PrimitiveKind::Cone,
        }
    }

    /// The distance to the first hit of a ray within `span`, if there is one.
    ///
    /// `sides` says from where the surface can be hit. `departure` is the side into which the ray left this very
    /// primitive, if it did: the place it left is no hit, and where geometry proves that the ray cannot return
    /// (a plane, the outside of a convex shape) there is none at all.
    ///
    /// The same kernel tests whole columns: see [`crate::PrimitiveColumns`].
    #[must_use]
    pub fn intersect(&self, ray: &Ray, span: Span, sides: Sides, departure: Option<Side>) -> Option<f64> {
        let is_flat = matches!(self.kind(), PrimitiveKind::Triangle | PrimitiveKind::Polygon);
        let probe = Probe::new(Scalar, ray, span, is_flat);
        match self {
            Self::Sphere(sphere) => sphere.intersect(ray, span, sides, departure),
            Self::Triangle(triangle) => triangle.intersect(&probe, sides, departure),
            Self::Cone(cone) => {
                let allowed = Allowed::of_one(PrimitiveKind::Cone, sides, departure);
                let (is_hit, t) = cone::intersect(&probe, cone.parameters(), allowed);
                is_hit.then_some(t)
            }
            Self::Polygon(polygon) => {
                let (side, t) = polygon::intersect(&probe, polygon, polygon.vertices().len())?;
                (departure.is_none() && sides.include(side) && span.contains(t)).then_some(t)
            }
        }
    }

    /// The unit normal of the front at a point of the surface.
    #[must_use]
    pub fn normal_at(&self, point: DVec3) -> DVec3 {
        match self {
            Self::Sphere(sphere) => sphere.normal_at(point),
            Self::Triangle(triangle) => triangle.normal(),
            Self::Polygon(polygon) => polygon.normal(),
            Self::Cone(cone) => cone.normal_at(point),
        }
    }

    /// A near-minimal sphere that holds every hit.
    #[must_use]
    pub fn bounding_sphere(&self) -> BoundingSphere {
        match self {
            Self::Sphere(sphere) => sphere.bounding_sphere(),
            Self::Triangle(triangle) => triangle.bounding_sphere(),
            Self::Polygon(polygon) => polygon.bounding_sphere(),
            Self::Cone(cone) => cone.bounding_sphere(),
        }
    }

    /// The largest absolute coordinate of any point of the primitive, or more.
    #[must_use]
    pub fn extent(&self) -> f64 {
        let largest = |points: &[DVec3]| points.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        match self {
            Self::Sphere(sphere) => largest(&[sphere.center()]) + sphere.radius(),
            Self::Triangle(triangle) => largest(triangle.vertices()),
            Self::Polygon(polygon) => largest(polygon.vertices()),
            Self::Cone(cone) => {
                largest(&[cone.base(), cone.apex()]) + cone.base_radius().max(cone.apex_radius())
            }
        }
    }
}

impl From<Sphere> for Primitive {
    fn from(sphere: Sphere) -> Self {
        Self::Sphere(sphere)
    }
}

impl From<Triangle> for Primitive {
    fn from(triangle: Triangle) -> Self {
        Self::Triangle(triangle)
    }
}

impl From<Polygon> for Primitive {
    fn from(polygon: Polygon) -> Self {
        Self::Polygon(polygon)
    }
}

impl From<Cone> for Primitive {
    fn from(cone: Cone) -> Self {
        Self::Cone(cone)
    }
}
