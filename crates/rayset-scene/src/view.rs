//! What a scene is seen and lit by where its file does not say.

use rayset_geometry::BoundingBox;
use rayset_geometry::glam::DVec3;

use crate::{Camera, Color, Light, SceneError};

/// The background where a file names none.
pub(crate) const BACKGROUND: Color = Color::splat(0.2);

/// The ambient light where a file names none.
pub(crate) const AMBIENT: Color = Color::splat(0.1);

/// A camera that sees all of a box, 40 degrees high, from in front, a little to the right and above.
///
/// # Errors
///
/// Those of [`Camera::new`], for an empty box too.
pub(crate) fn camera(bounds: &BoundingBox) -> Result<Camera, SceneError> {
    let towards = DVec3::new(0.5, 0.35, 1.0);
    Camera::fitted(bounds.center(), 0.5 * bounds.diagonal().length(), towards, DVec3::Y, 40.0)
}

/// One white light, infinitely far away, above that camera.
pub(crate) fn light() -> Light {
    Light::directional(DVec3::new(-0.2, 0.8, 1.0), Color::splat(0.9))
}
