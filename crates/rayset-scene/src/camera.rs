//! The pinhole camera.

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Ray, unit};

use crate::{MAX_COORDINATE, SceneError};

/// A pinhole camera: the paper's viewpoint and image plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    from: DVec3,
    target: DVec3,
    angle: f64,
    forward: DVec3,
    right: DVec3,
    up: DVec3,
    half_height: f64,
}

impl Camera {
    /// A camera at `from` that looks towards `at`, both in world space, with `up` pointing upwards in the image.
    ///
    /// `angle` is the full angle of view from the lower to the upper edge of the image, in degrees, between 0 and
    /// 180; the width follows from the resolution, pixels being square.
    ///
    /// # Errors
    ///
    /// [`SceneError::Invalid`] if `from` and `at` coincide, `up` is parallel to the line of sight, the angle is out
    /// of range, or anything is not finite.
    pub fn new(from: DVec3, at: DVec3, up: DVec3, angle: f64) -> Result<Self, SceneError> {
        let invalid =
            |message: &str| SceneError::Invalid { item: "camera".to_owned(), message: message.to_owned() };
        if !from.is_finite() {
            return Err(invalid("the viewpoint is not finite"));
        }
        let forward =
            unit(at - from).ok_or_else(|| invalid("viewpoint and target coincide or are not finite"))?;
        let up = unit(up).ok_or_else(|| invalid("the up vector is zero or not finite"))?;
        let right = forward.cross(up);
        if right.length() < 1e-9 {
            return Err(invalid("the up vector is parallel to the line of sight"));
        }
        let right = unit(right).ok_or_else(|| invalid("the up vector is parallel to the line of sight"))?;
        if !(angle > 0.0 && angle < 180.0) {
            return Err(invalid("the angle of view is not between 0 and 180 degrees"));
        }
        let half_height = libm::tan(angle * (std::f64::consts::PI / 360.0));
        Ok(Self { from, target: at, angle, forward, right, up: right.cross(forward), half_height })
    }

    /// A camera that sees all of a sphere from a direction; used where a scene brings none.
    ///
    /// # Errors
    ///
    /// As [`Camera::new`].
    pub fn fitted(
        center: DVec3,
        radius: f64,
        towards: DVec3,
        up: DVec3,
        angle: f64,
    ) -> Result<Self, SceneError> {
        let distance = radius.max(f64::MIN_POSITIVE) / libm::sin(angle * (std::f64::consts::PI / 360.0));
        let away = unit(towards).unwrap_or(DVec3::Z);
        Self::new(center + distance * away, center, up, angle)
    }

    /// Refuses a camera that no scene can have.
    pub(crate) fn check(&self) -> Result<(), SceneError> {
        if self.from.abs().max_element() <= MAX_COORDINATE {
            return Ok(());
        }
        Err(SceneError::Invalid {
            item: "camera".to_owned(),
            message: "the viewpoint is too far away".to_owned(),
        })
    }

    /// The viewpoint, in world space.
    #[must_use]
    pub fn viewpoint(&self) -> DVec3 {
        self.from
    }

    /// The point it looks at, in world space.
    #[must_use]
    pub fn target(&self) -> DVec3 {
        self.target
    }

    /// The unit vector that points upwards in the image, in world space.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        self.up
    }

    /// The full angle of view from the lower to the upper edge of the image, in degrees.
    #[must_use]
    pub fn angle(&self) -> f64 {
        self.angle
    }

    /// The initial ray through a point of an image of `width` by `height` pixels.
    ///
    /// `x` runs from 0 at the left edge to `width` at the right, `y` from 0 at the upper edge to `height` at the
    /// lower: the centre of the first pixel is at (0.5, 0.5).
    #[must_use]
    #[inline]
    pub fn ray(&self, x: f64, y: f64, width: u32, height: u32) -> Ray {
        let direction = self.towards(self.tangents(x, y, width, height));
        Ray::new(self.from, unit(direction).unwrap_or(self.forward))
    }

    /// How far to the right and up a point of the image lies, seen from the viewpoint, at a distance of one unit: the
    /// first depends on `x` alone, the second on `y` alone. The point is that of [`Camera::ray`].
    #[must_use]
    #[inline]
    pub fn tangents(&self, x: f64, y: f64, width: u32, height: u32) -> (f64, f64) {
        let (width, height) = (f64::from(width), f64::from(height));
        let right = (2.0 * x - width) / height * self.half_height;
        let up = (height - 2.0 * y) / height * self.half_height;
        (right, up)
    }

    /// The unit vectors forwards, to the right and upwards, in world space.
    ///
    /// [`Camera::ray`] goes along `forwards + right * (to the right) + up * (upwards)` with the tangents `right` and `up`;
    /// rays of a grid can share their tangents, and be scaled to unit length together.
    #[must_use]
    pub fn axes(&self) -> [DVec3; 3] {
        [self.forward, self.right, self.up]
    }

    #[inline]
    fn towards(&self, (right, up): (f64, f64)) -> DVec3 {
        self.forward + right * self.right + up * self.up
    }
}

impl Default for Camera {
    /// At (0, 0, 5), looking at the origin with y upwards, 45 degrees high.
    fn default() -> Self {
        Self::new(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 45.0).expect("a valid camera")
    }
}

#[cfg(test)]
mod tests {
    use approx::abs_diff_eq;
    use rayset_geometry::glam::dvec3;

    use super::*;

    #[test]
    fn central_ray_looks_at_the_target_and_corners_span_the_angle() {
        let camera = Camera::new(dvec3(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 90.0).unwrap();
        assert_eq!(camera.ray(8.0, 4.0, 16, 8).direction(), -DVec3::Z);
        let top = camera.ray(8.0, 0.0, 16, 8).direction();
        assert!((top - dvec3(0.0, 1.0, -1.0) * 0.5_f64.sqrt()).length() < 1e-15, "{top}");
        // Twice as wide as high: tangent 2 to the right edge.
        let right = camera.ray(16.0, 4.0, 16, 8).direction();
        assert!(abs_diff_eq!(right.x / -right.z, 2.0, epsilon = 1e-14), "{right}");
    }

    #[test]
    fn nonsense_cameras_are_refused() {
        let refused = |from, at, up, angle| Camera::new(from, at, up, angle).unwrap_err().to_string();
        assert!(refused(DVec3::ZERO, DVec3::ZERO, DVec3::Y, 45.0).contains("coincide"));
        assert!(refused(DVec3::ZERO, DVec3::Y, DVec3::Y, 45.0).contains("parallel"));
        assert!(refused(DVec3::ZERO, DVec3::Z, DVec3::Y, 180.0).contains("angle"));
        assert!(refused(DVec3::ZERO, DVec3::Z, DVec3::Y, f64::NAN).contains("angle"));
        assert!(refused(DVec3::NAN, DVec3::Z, DVec3::Y, 45.0).contains("not finite"));
    }

    #[test]
    fn fitted_camera_sees_the_whole_sphere() {
        let camera = Camera::fitted(dvec3(1.0, 2.0, 3.0), 2.0, DVec3::Z, DVec3::Y, 60.0).unwrap();
        assert!((camera.viewpoint() - dvec3(1.0, 2.0, 7.0)).length() < 1e-12);
    }
}
