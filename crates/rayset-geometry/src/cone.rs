//! Cylinders and cones without caps.

use glam::DVec3;
use rayset_simd::{Lanes, Simd};

use crate::departure::Allowed;
use crate::{BoundingBox, BoundingSphere, Probe, RayLanes, dot_lanes, enclosing_sphere};

/// How far off the surface a hit may lie, relative to the radius of the bounding sphere: 2^-22 is the square root of
/// 512 roundings. Near a pointed apex the rounding of the quadratic, at most 225 of them, displaces a hit by a square
/// root. Derived in `docs/numerics.md`.
const CONTAINMENT_MARGIN: f64 = 1.0 / (1_u64 << 22) as f64;

/// The curved side of a truncated cone or, with equal radii, of a cylinder; in world space, open at both ends.
///
/// Its front is its outside. (The container of the paper is [`crate::Cylinder`].)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    base: DVec3,
    base_radius: f64,
    apex: DVec3,
    apex_radius: f64,
    axis: DVec3,
    height: f64,
    slope: f64,
    thickness: f64,
    bounds: BoundingSphere,
}

impl Cone {
    /// A cone from a circle round `base` to one round `apex`; either radius may be zero, but not both.
    ///
    /// `None` if the ends coincide, both radii are zero, one is negative, or anything is not finite.
    #[must_use]
    pub fn new(base: DVec3, base_radius: f64, apex: DVec3, apex_radius: f64) -> Option<Self> {
        let radii_are_valid = base_radius >= 0.0 && apex_radius >= 0.0 && base_radius + apex_radius > 0.0;
        if !radii_are_valid || !(base_radius + apex_radius).is_finite() {
            return None;
        }
        let axis = crate::unit(apex - base)?;
        let height = (apex - base).length();
        let slope = (apex_radius - base_radius) / height;
        if !(slope.is_finite() && height > 0.0) {
            return None;
        }
        let mut cone = Self {
            base,
            base_radius,
            apex,
            apex_radius,
            axis,
            height,
            slope,
            thickness: 0.0,
            bounds: BoundingSphere { center: base, radius: 0.0 },
        };
        cone.thickness = 2.0 * CONTAINMENT_MARGIN * enclosing_sphere(&[cone.into()]).radius;
        cone.bounds = enclosing_sphere(&[cone.into()]);
        Some(cone)
    }

    /// The centre of the first circle, in world space.
    #[must_use]
    pub fn base(&self) -> DVec3 {
        self.base
    }

    /// The radius of the first circle, in world units.
    #[must_use]
    pub fn base_radius(&self) -> f64 {
        self.base_radius
    }

    /// The centre of the last circle, in world space.
    #[must_use]
    pub fn apex(&self) -> DVec3 {
        self.apex
    }

    /// The radius of the last circle, in world units.
    #[must_use]
    pub fn apex_radius(&self) -> f64 {
        self.apex_radius
    }

    /// The unit vector from base to apex.
    #[must_use]
    pub fn axis(&self) -> DVec3 {
        self.axis
    }

    /// The outward unit normal at a point of the surface; along the axis at a pointed apex, where none is defined.
    #[must_use]
    pub fn normal_at(&self, point: DVec3) -> DVec3 {
        Self::outward(self.base, self.axis, self.slope, point)
    }

    /// The outward unit normal of the infinite cone through a point.
    pub(crate) fn outward(base: DVec3, axis: DVec3, slope: f64, point: DVec3) -> DVec3 {
        match crate::unit(Self::away(base, axis, point)) {
            Some(outward) => crate::unit(outward - slope * axis).unwrap_or(outward),
            None => axis,
        }
    }

    /// From the nearest point of the axis to a point.
    #[inline]
    pub(crate) fn away(base: DVec3, axis: DVec3, point: DVec3) -> DVec3 {
        (point - base) - (point - base).dot(axis) * axis
    }

    /// A sphere that holds the surface and, up to the rounding of coordinates, every hit.
    #[must_use]
    pub fn bounding_sphere(&self) -> BoundingSphere {
        self.bounds
    }

    /// The box round the truncated solid cone of these [`parameters`](Self::parameters), wider by its thickness.
    pub(crate) fn bounding_box_of(parameters: &[f64; PARAMETERS]) -> BoundingBox {
        let [bx, by, bz, ax, ay, az, height, base_radius, slope, _, widest] = *parameters;
        let (base, axis) = (DVec3::new(bx, by, bz), DVec3::new(ax, ay, az));
        let apex_radius = (base_radius + slope * height).max(0.0);
        let thickness = DVec3::splat(2.0 * (widest - base_radius.max(apex_radius)));
        // A circle about an axis reaches r sqrt(1 - a_k^2) along axis k. Rounding takes up to 2^-24.9 r from a small
        // root, which the thickness can spare.
        let reach = (DVec3::ONE - axis * axis).max(DVec3::ZERO).map(f64::sqrt);
        let ends = [(base, base_radius), (base + height * axis, apex_radius)];
        let boxes = ends.map(|(center, radius)| BoundingBox {
            min: center - radius * reach - thickness,
            max: center + radius * reach + thickness,
        });
        boxes.into_iter().collect()
    }

    /// The axis of the cone of these [`parameters`](Self::parameters).
    pub(crate) fn axis_of(parameters: &[f64; PARAMETERS]) -> ConeAxis {
        let [bx, by, bz, ax, ay, az, height, base_radius, slope, _, widest] = *parameters;
        let radius = base_radius.max(base_radius + slope * height);
        let reach = widest + (widest - radius);
        let (base, direction) = (DVec3::new(bx, by, bz), DVec3::new(ax, ay, az));
        let least_radius = base_radius.min(base_radius + slope * height).max(0.0);
        ConeAxis { base, direction, height, reach, least_radius, slope }
    }

    /// How far from the truncated solid cone a computed hit may lie, apart from the rounding of coordinates; in world
    /// units.
    pub(crate) fn thickness(&self) -> f64 {
        self.thickness
    }

    /// Base, axis, height, base radius, slope; then how much wider than the local radius a hit may lie from the
    /// axis, and how far at most: what [`intersect`] reads.
    pub(crate) fn parameters(&self) -> [f64; PARAMETERS] {
        let ([bx, by, bz], [ax, ay, az]) = (self.base.to_array(), self.axis.to_array());
        // Half the thickness along the normal; where the rim cuts that short, the whole is enough for both.
        let across = 0.5 * self.thickness * (1.0 + self.slope * self.slope).sqrt();
        let widest = self.base_radius.max(self.apex_radius) + 0.5 * self.thickness;
        [bx, by, bz, ax, ay, az, self.height, self.base_radius, self.slope, across, widest]
    }
}

/// The axis of a cone, and where hits lie beside it; in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConeAxis {
    /// The centre of the first circle.
    pub base: DVec3,
    /// The unit vector towards the other.
    pub direction: DVec3,
    /// How far the other is: along the axis hits lie between the two, up to the rounding of coordinates.
    pub height: f64,
    /// How far from the axis any hit lies at most, up to the rounding of coordinates.
    pub reach: f64,
    /// The radius of the smaller circle, up to its rounding.
    pub least_radius: f64,
    /// How fast the radius grows along the axis.
    pub slope: f64,
}

/// How many numbers describe a cone to [`intersect`].
pub(crate) const PARAMETERS: usize = 11;

/// Where a ray meets cones, a lane each: the lanes that are hit, and `t`.
///
/// From `o'`, the point of the ray nearest to the base, with `q = o' - base`, `p` the parts perpendicular to the
/// axis and `m` the height along it, a point of the infinite cone satisfies `|p|^2 = (r + k m)^2`, so
/// `A t^2 + 2 B t + C = 0` with `A = |d_p|^2 - (k d_m)^2`, `B = q_p . d_p - k d_m (r + k q_m)`,
/// `C = |q_p|^2 - (r + k q_m)^2`. At a root `A t + B` is half the derivative, so the root with `-sqrt(B^2 - A C)`
/// always meets the front and the other the back. A hit lies between the two circles, where the radius is not
/// negative, and no farther outside the surface than the cone's thickness: no better bound can be derived near a
/// pointed apex, and none at all for roots that rays nearly parallel to the surface make.
#[inline(always)]
pub(crate) fn intersect<S: Simd>(
    probe: &Probe<S>,
    parameters: [S::F64; PARAMETERS],
    Allowed { front, back }: Allowed<S>,
) -> (<S::F64 as Lanes>::Mask, S::F64) {
    let span = [probe.simd.splat_f64(probe.span.start), probe.simd.splat_f64(probe.span.end)];
    intersect_pairs(probe.simd, &probe.lanes, span, parameters, (front, back))
}

/// Where rays meet cones, a pair a lane; of the rays, where their spans start and end, and the lanes whose front and
/// back may be hit.
#[inline(always)]
pub(crate) fn intersect_pairs<S: Simd>(
    simd: S,
    rays: &RayLanes<S>,
    [start, end]: [S::F64; 2],
    parameters: [S::F64; PARAMETERS],
    (front_allowed, back_allowed): (<S::F64 as Lanes>::Mask, <S::F64 as Lanes>::Mask),
) -> (<S::F64 as Lanes>::Mask, S::F64) {
    let zero = simd.splat_f64(0.0);
    let (o, d) = (rays.origin, rays.direction);
    let [bx, by, bz, ax, ay, az, height, base_radius, slope, across, widest] = parameters;
    let axis = [ax, ay, az];
    let to_base = [bx - o[0], by - o[1], bz - o[2]];
    let nearest = dot_lanes(to_base, d);
    let q = [nearest * d[0] - to_base[0], nearest * d[1] - to_base[1], nearest * d[2] - to_base[2]];
    let (q_m, d_m) = (dot_lanes(q, axis), dot_lanes(d, axis));
    let q_p = [q[0] - q_m * ax, q[1] - q_m * ay, q[2] - q_m * az];
    let d_p = [d[0] - d_m * ax, d[1] - d_m * ay, d[2] - d_m * az];
    let radius = base_radius + slope * q_m;
    let narrowing = slope * d_m;
    let a = dot_lanes(d_p, d_p) - narrowing * narrowing;
    let b = dot_lanes(q_p, d_p) - narrowing * radius;
    let c = dot_lanes(q_p, q_p) - radius * radius;
    let discriminant = b * b - a * c;
    let real = discriminant.ge(zero);
    let root = discriminant.sqrt();
    // The sum without cancellation gives one root, Vieta's product the other.
    let b_positive = b.gt(zero);
    let sum = (-(b + root)).select(b_positive, root - b);
    let by_sum = sum / a;
    // Both roots are zero where the sum is: a ray that touches the surface where it is nearest to the base.
    let by_product = by_sum.select(sum.eq(zero), c / sum);
    let front = by_sum.select(b_positive, by_product);
    let back = by_product.select(b_positive, by_sum);
    let wall = Wall::<S> { zero, q_m, d_m, q_p, d_p, height, base_radius, slope, across, widest };
    let (front_t, back_t) = (nearest + front, nearest + back);
    let front_hit = real & front_allowed & wall.holds(front) & front_t.gt(start) & front_t.lt(end);
    let back_hit = real & back_allowed & wall.holds(back) & back_t.gt(start) & back_t.lt(end);
    // The front root is the nearer one except on the mirror cone, which never counts; still, take the least.
    let first = front_hit & !(back_hit & back_t.lt(front_t));
    (front_hit | back_hit, front_t.select(first, back_t))
}

/// The ray in the cone's own terms, and the cone's thick wall. No closure: lanes must be inlined always.
struct Wall<S: Simd> {
    zero: S::F64,
    q_m: S::F64,
    d_m: S::F64,
    q_p: [S::F64; 3],
    d_p: [S::F64; 3],
    height: S::F64,
    base_radius: S::F64,
    slope: S::F64,
    across: S::F64,
    widest: S::F64,
}

impl<S: Simd> Wall<S> {
    /// Whether the point at `t` lies in the wall.
    #[inline(always)]
    fn holds(&self, t: S::F64) -> <S::F64 as Lanes>::Mask {
        let m = self.q_m + t * self.d_m;
        let (q, d) = (&self.q_p, &self.d_p);
        let p = [q[0] + t * d[0], q[1] + t * d[1], q[2] + t * d[2]];
        let local_radius = self.base_radius + self.slope * m;
        let reach = (local_radius + self.across).min(self.widest);
        m.ge(self.zero) & m.le(self.height) & local_radius.ge(self.zero) & dot_lanes(p, p).le(reach * reach)
    }
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use glam::dvec3;

    use super::*;
    use crate::{Primitive, Ray, Side, Sides, Span};

    fn cylinder() -> Primitive {
        Cone::new(DVec3::ZERO, 1.0, dvec3(0.0, 0.0, 2.0), 1.0).unwrap().into()
    }

    fn cone() -> Primitive {
        Cone::new(DVec3::ZERO, 2.0, dvec3(0.0, 0.0, 2.0), 0.0).unwrap().into()
    }

    fn hit(primitive: &Primitive, origin: DVec3, direction: DVec3, sides: Sides) -> Option<f64> {
        let ray = Ray::between(origin, origin + direction).unwrap();
        primitive.intersect(&ray, Span::FORWARD, sides, None)
    }

    #[test]
    fn cylinder_is_hit_outside_and_inside() {
        let origin = dvec3(-3.0, 0.0, 1.0);
        assert_eq!(hit(&cylinder(), origin, DVec3::X, Sides::Both), Some(2.0));
        assert_eq!(hit(&cylinder(), origin, DVec3::X, Sides::Front), Some(2.0));
        assert_eq!(hit(&cylinder(), origin, DVec3::X, Sides::Back), Some(4.0));
        assert_eq!(hit(&cylinder(), dvec3(0.0, 0.0, 1.0), DVec3::Y, Sides::Both), Some(1.0));
    }

    #[test]
    fn open_ends_let_rays_through() {
        assert_eq!(hit(&cylinder(), dvec3(0.5, 0.0, -1.0), DVec3::Z, Sides::Both), None);
        assert_eq!(hit(&cylinder(), dvec3(-3.0, 0.0, 2.5), DVec3::X, Sides::Both), None);
        // Through the open end, then the inner wall: x grows by 1 while z grows by 1.
        let t = hit(&cylinder(), dvec3(0.0, 0.0, -0.5), dvec3(1.0, 0.0, 1.0), Sides::Both).unwrap();
        assert_abs_diff_eq!(t, 2.0_f64.sqrt(), epsilon = 1e-14);
        assert_eq!(hit(&cylinder(), dvec3(0.0, 0.0, -0.5), dvec3(1.0, 0.0, 1.0), Sides::Front), None);
    }

    #[test]
    fn cone_narrows_towards_its_apex() {
        assert_eq!(hit(&cone(), dvec3(-5.0, 0.0, 1.0), DVec3::X, Sides::Both), Some(4.0));
        // The mirror cone beyond the apex does not count.
        assert_eq!(hit(&cone(), dvec3(-5.0, 0.0, 3.0), DVec3::X, Sides::Both), None);
        // Along the axis through the apex only the point itself is met, from outside.
        assert_eq!(hit(&cone(), dvec3(0.5, 0.0, 5.0), -DVec3::Z, Sides::Both), Some(3.5));
    }

    #[test]
    fn tangent_ray_hits_from_outside() {
        // It touches the cylinder where it is nearest to the base, so that both roots are zero.
        let origin = dvec3(1.0, -5.0, 0.0);
        assert_eq!(hit(&cylinder(), origin, DVec3::Y, Sides::Front), Some(5.0));
        assert_eq!(hit(&cylinder(), origin, DVec3::Y, Sides::Both), Some(5.0));
    }

    #[test]
    fn ray_parallel_to_a_generator_hits_once() {
        // The generator from (2, 0, 0) to (0, 0, 2); the ray runs parallel to it through the axis at z = 1.
        let t = hit(&cone(), dvec3(2.0, 0.0, -1.0), dvec3(-1.0, 0.0, 1.0), Sides::Both).unwrap();
        let point = dvec3(2.0, 0.0, -1.0) + t * 0.5_f64.sqrt() * dvec3(-1.0, 0.0, 1.0);
        assert!(abs_diff_eq!(point.x.abs(), 2.0 - point.z, epsilon = 1e-12), "{point}");
        assert!(point.x < 0.0, "{point} lies on the opposite wall");
    }

    #[test]
    fn ray_that_leaves_outwards_never_returns() {
        let ray = Ray::between(dvec3(-1.0, 0.0, 1.0), dvec3(-1.0, 5.0, 1.0)).unwrap();
        assert_eq!(cylinder().intersect(&ray, Span::FORWARD, Sides::Both, Some(Side::Front)), None);
        let inwards = Ray::new(dvec3(-1.0 - 1e-15, 0.0, 1.0), DVec3::X);
        let t = cylinder().intersect(&inwards, Span::FORWARD, Sides::Both, Some(Side::Back)).unwrap();
        assert_abs_diff_eq!(t, 2.0, epsilon = 1e-12);
    }

    #[test]
    fn invalid_cones_are_refused() {
        assert_eq!(Cone::new(DVec3::ZERO, 1.0, DVec3::ZERO, 1.0), None);
        assert_eq!(Cone::new(DVec3::ZERO, 0.0, DVec3::Z, 0.0), None);
        assert_eq!(Cone::new(DVec3::ZERO, -1.0, DVec3::Z, 2.0), None);
        assert_eq!(Cone::new(DVec3::ZERO, f64::NAN, DVec3::Z, 2.0), None);
    }

    #[test]
    fn normals_point_outwards() {
        let Primitive::Cone(cone) = cone() else { unreachable!() };
        let normal = cone.normal_at(dvec3(1.0, 0.0, 1.0));
        assert!((normal - dvec3(1.0, 0.0, 1.0).normalize()).length() < 1e-15, "{normal}");
    }
}
