//! Axis-parallel boxes.

use glam::DVec3;

use crate::Primitive;

/// A box with sides parallel to the axes, in world space; empty where `min` exceeds `max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingBox {
    /// The least coordinates.
    pub min: DVec3,
    /// The greatest coordinates.
    pub max: DVec3,
}

impl BoundingBox {
    /// The box that holds nothing.
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The smallest box that holds both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The smallest box that holds a point too.
    #[must_use]
    pub fn with_point(self, point: DVec3) -> Self {
        self.union(Self { min: point, max: point })
    }

    /// Whether it holds nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// The point in the middle; not finite for the empty box.
    #[must_use]
    pub fn center(&self) -> DVec3 {
        0.5 * self.min + 0.5 * self.max
    }

    /// From the least to the greatest coordinates.
    #[must_use]
    pub fn diagonal(&self) -> DVec3 {
        self.max - self.min
    }
}

impl FromIterator<BoundingBox> for BoundingBox {
    /// The smallest box that holds all of them.
    fn from_iter<I: IntoIterator<Item = BoundingBox>>(boxes: I) -> Self {
        boxes.into_iter().fold(Self::EMPTY, Self::union)
    }
}

impl FromIterator<DVec3> for BoundingBox {
    /// The smallest box that holds all points.
    fn from_iter<I: IntoIterator<Item = DVec3>>(points: I) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::with_point)
    }
}

impl Primitive {
    /// The smallest box that holds the primitive, to within rounding: a vertex of a triangle or polygon is never
    /// outside, a point of a round shape at most by roundings of its size and place.
    #[must_use]
    pub fn bounding_box(&self) -> BoundingBox {
        match self {
            Self::Sphere(sphere) => disc(sphere.center(), DVec3::splat(sphere.radius())),
            Self::Triangle(triangle) => triangle.vertices().iter().copied().collect(),
            Self::Polygon(polygon) => polygon.vertices().iter().copied().collect(),
            Self::Cone(cone) => {
                let axis = crate::unit(cone.apex() - cone.base()).unwrap_or(DVec3::ZERO);
                // A circle about an axis reaches r sqrt(1 - a_k^2) along axis k.
                let reach = (DVec3::ONE - axis * axis).max(DVec3::ZERO).map(f64::sqrt);
                disc(cone.base(), cone.base_radius() * reach)
                    .union(disc(cone.apex(), cone.apex_radius() * reach))
            }
        }
    }
}

fn disc(center: DVec3, reach: DVec3) -> BoundingBox {
    BoundingBox { min: center - reach, max: center + reach }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;
    use crate::{Cone, Sphere, Triangle};

    #[test]
    fn boxes_hold_their_shapes_and_no_more() {
        let sphere: Primitive = Sphere::new(dvec3(1.0, 2.0, 3.0), 0.5).into();
        assert_eq!(
            sphere.bounding_box(),
            BoundingBox { min: dvec3(0.5, 1.5, 2.5), max: dvec3(1.5, 2.5, 3.5) }
        );
        let triangle: Primitive = Triangle::new(DVec3::ZERO, DVec3::X, dvec3(0.0, -1.0, 2.0)).into();
        assert_eq!(
            triangle.bounding_box(),
            BoundingBox { min: dvec3(0.0, -1.0, 0.0), max: dvec3(1.0, 0.0, 2.0) }
        );
        // An upright cone: its discs reach to the sides and not upwards.
        let cone: Primitive = Cone::new(DVec3::ZERO, 2.0, DVec3::Y * 3.0, 1.0).unwrap().into();
        assert_eq!(
            cone.bounding_box(),
            BoundingBox { min: dvec3(-2.0, 0.0, -2.0), max: dvec3(2.0, 3.0, 2.0) }
        );
    }

    #[test]
    fn nothing_is_empty() {
        assert!(BoundingBox::EMPTY.is_empty());
        assert!(!BoundingBox::EMPTY.with_point(DVec3::ONE).is_empty());
        assert_eq!(
            [DVec3::ONE, DVec3::ZERO].into_iter().collect::<BoundingBox>().center(),
            DVec3::splat(0.5)
        );
    }
}
