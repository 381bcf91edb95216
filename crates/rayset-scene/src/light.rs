//! Lights.

use rayset_geometry::glam::DVec3;
use rayset_geometry::unit;

use crate::Color;

/// A light; its intensity does not fall off with distance, as in Whitted's rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    pub(crate) place: Place,
    pub(crate) color: Color,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Place {
    Point(DVec3),
    Directional(DVec3),
}

/// How a light is seen from a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Illumination {
    /// The unit vector from the point towards the light.
    pub direction: DVec3,
    /// The distance to the light, in world units; infinite for a directional light.
    pub distance: f64,
}

impl Light {
    /// A point light at `position`, in world space.
    #[must_use]
    pub fn point(position: DVec3, color: Color) -> Self {
        Self { place: Place::Point(position), color }
    }

    /// A light infinitely far away; `towards` points from the scene to it and need not have unit length.
    ///
    /// A zero vector is refused when the scene is built.
    #[must_use]
    pub fn directional(towards: DVec3, color: Color) -> Self {
        Self { place: Place::Directional(unit(towards).unwrap_or(DVec3::ZERO)), color }
    }

    /// The intensity.
    #[must_use]
    #[inline]
    pub fn color(&self) -> Color {
        self.color
    }

    /// Where a point light is; `None` for a directional one.
    #[must_use]
    #[inline]
    pub fn position(&self) -> Option<DVec3> {
        match self.place {
            Place::Point(position) => Some(position),
            Place::Directional(_) => None,
        }
    }

    /// How the light is seen from `point`; `None` if the point is at the light.
    #[must_use]
    #[inline]
    pub fn seen_from(&self, point: DVec3) -> Option<Illumination> {
        match self.place {
            Place::Point(position) => {
                let to_light = position - point;
                unit(to_light).map(|direction| Illumination { direction, distance: to_light.length() })
            }
            Place::Directional(direction) => Some(Illumination { direction, distance: f64::INFINITY }),
        }
    }
}
