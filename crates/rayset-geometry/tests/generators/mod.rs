//! Primitives and rays for the property tests: scales from 1e-2 to 1e6, origins near and far, rays that graze.

use proptest::array::uniform3;
use proptest::prelude::*;
use proptest::sample::select;
use rayset_geometry::glam::DVec3;
use rayset_geometry::{Cone, Polygon, Primitive, Ray, Side, Sides, Sphere, Triangle, unit};

/// A number around zero, of order one, with a weakness for special values.
fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![8 => -1.0..1.0, 1 => select(vec![0.0, -0.0, 1.0, -1.0, 0.5]), 1 => -1e-9..1e-9]
}

/// A vector of such numbers.
pub(crate) fn vector() -> impl Strategy<Value = DVec3> {
    uniform3(coordinate()).prop_map(DVec3::from_array)
}

/// The size of a scene, in world units.
pub(crate) fn scale() -> impl Strategy<Value = f64> {
    select(vec![1e-2, 0.3, 1.0, 37.0, 1e3, 1e6])
}

/// A unit vector in any direction.
pub(crate) fn unit_vector() -> impl Strategy<Value = DVec3> {
    prop_oneof![2 => vector().prop_filter_map("the zero vector", unit), 1 => axis_parallel()]
}

/// A unit vector along an axis; its other components are zeros of either sign, or subnormal.
fn axis_parallel() -> impl Strategy<Value = DVec3> {
    let tiny =
        || select(vec![0.0, -0.0, f64::from_bits(1), -f64::from_bits(1), 1e-310, -f64::MIN_POSITIVE / 2.0]);
    (0..3_usize, select(vec![1.0, -1.0]), tiny(), tiny()).prop_map(|(axis, sign, a, b)| {
        let mut direction = [sign, a, b];
        direction.rotate_right(axis);
        DVec3::from_array(direction)
    })
}

/// The sides a surface is visible from.
pub(crate) fn sides() -> impl Strategy<Value = Sides> {
    select(vec![Sides::Front, Sides::Back, Sides::Both])
}

/// The side a ray leaves into, if it leaves the primitive at all.
pub(crate) fn departure() -> impl Strategy<Value = Option<Side>> {
    select(vec![None, Some(Side::Front), Some(Side::Back)])
}

/// A sphere of `size` or less round `center`.
fn sphere(center: DVec3, size: f64) -> impl Strategy<Value = Primitive> {
    prop_oneof![9 => 0.01..1.0, 1 => Just(0.0)].prop_map(move |r: f64| Sphere::new(center, r * size).into())
}

/// A triangle near `center`, now and then a sliver.
fn triangle(center: DVec3, size: f64) -> impl Strategy<Value = Primitive> {
    ([vector(), vector(), vector()], select(vec![1.0, 1.0, 1e-3, 1e-12])).prop_map(
        move |([a, b, c], width)| {
            let c = (a + b) * 0.5 + (c - a) * width;
            Triangle::new(center + size * a, center + size * b, center + size * c).into()
        },
    )
}

/// A polygon round `center` with three to eight corners, or many, star-shaped about it; concave more often than not.
fn polygon(center: DVec3, size: f64) -> impl Strategy<Value = Primitive> {
    let corners = |n| prop::collection::vec(0.2..1.0, n);
    let corners = prop_oneof![3 => corners(3..=8), 1 => corners(9..=150)];
    (vector(), vector(), corners).prop_filter_map("no area", move |(a, b, radii)| {
        let x = unit(a)?;
        let y = unit(b - b.dot(x) * x)?;
        let octagon = [(4, 0), (3, 3), (0, 4), (-3, 3), (-4, 0), (-3, -3), (0, -4), (3, -3)];
        let corner = |(i, &radius): (usize, &f64)| {
            // Beyond eight, between its corners.
            let n = radii.len();
            let (place, between) = (i * 8 / n, if n > 8 { (i * 8 % n) as f64 / n as f64 } else { 0.0 });
            let at = |k: usize| f64::from(octagon[k % 8].0) * x + f64::from(octagon[k % 8].1) * y;
            center + radius * 0.25 * size * at(place).lerp(at(place + 1), between)
        };
        Polygon::new(radii.iter().enumerate().map(corner).collect()).map(Primitive::from)
    })
}

/// A cone or cylinder near `center`; now and then pointed, flat or narrow.
fn cone(center: DVec3, size: f64) -> impl Strategy<Value = Primitive> {
    let radius = || prop_oneof![8 => 0.01..1.0, 1 => Just(0.0), 1 => 1e-6..1e-3];
    let height = select(vec![1.0, 1.0, 0.1, 1e-3]);
    (vector(), vector(), radius(), radius(), height, any::<bool>()).prop_filter_map(
        "no cone",
        move |(a, b, base, apex, height, is_cylinder)| {
            let apex_radius = if is_cylinder { base } else { apex };
            let end = a + height * (b - a);
            Cone::new(center + size * a, size * base, center + size * end, size * apex_radius)
                .map(Primitive::from)
        },
    )
}

/// Any primitive of at most `size`, round `center`.
pub(crate) fn primitive(center: DVec3, size: f64) -> impl Strategy<Value = Primitive> {
    prop_oneof![sphere(center, size), triangle(center, size), polygon(center, size), cone(center, size)]
}

/// Any primitive, anywhere, at any scale.
pub(crate) fn any_primitive() -> impl Strategy<Value = Primitive> {
    (scale(), vector(), select(vec![1.0, 0.1, 1e-3]))
        .prop_flat_map(|(scale, center, size)| primitive(scale * center, scale * size))
}

/// A triangle, anywhere, at any scale.
pub(crate) fn any_triangle() -> impl Strategy<Value = Triangle> {
    let of = |primitive| if let Primitive::Triangle(triangle) = primitive { Some(triangle) } else { None };
    (scale(), vector(), select(vec![1.0, 0.1, 1e-3]))
        .prop_flat_map(|(scale, center, size)| triangle(scale * center, scale * size))
        .prop_filter_map("no triangle", of)
}

/// A cone or cylinder, anywhere, at any scale.
pub(crate) fn any_cone() -> impl Strategy<Value = Primitive> {
    (scale(), vector()).prop_flat_map(|(scale, center)| cone(scale * center, scale))
}

/// A polygon, anywhere, at any scale.
pub(crate) fn any_polygon() -> impl Strategy<Value = Primitive> {
    (scale(), vector()).prop_flat_map(|(scale, center)| polygon(scale * center, scale))
}

/// How a ray is aimed at a primitive.
#[derive(Clone, Debug)]
pub(crate) struct Aim {
    /// Which points of the primitive the target lies between, and their weights.
    picks: [(usize, f64); 3],
    /// How far off, relative to the primitive's size.
    offset: DVec3,
    from: From,
}

/// Where an aimed ray comes from.
#[derive(Clone, Debug)]
enum From {
    /// From this point, relative to the primitive's extent.
    Near(DVec3),
    /// From 1e6 units away.
    Far(DVec3),
    /// Along this direction, from this many extents.
    Along(DVec3, f64),
    /// Along the surface, tilted by so much.
    Grazing(DVec3, f64, f64),
}

/// Rays that hit, miss or graze in all the ways that have ever been trouble.
pub(crate) fn aim() -> impl Strategy<Value = Aim> {
    let pick =
        || (0..8_usize, select(vec![0.0, 0.0, 0.5, 1.0]).prop_union(select(vec![0.3, 0.1, 0.01, 1e-9])));
    let offset_size = select(vec![0.0, 0.0, 1e-16, 1e-12, 1e-6, 1e-2, 1.0]);
    let tilt = select(vec![0.0, 1e-17, 1e-16, 1e-14, 1e-12, 1e-9, 1e-6, 1e-3]);
    let from = prop_oneof![
        vector().prop_map(From::Near),
        unit_vector().prop_map(From::Far),
        (axis_parallel(), select(vec![0.1, 1.0, 3.0, 1e3]))
            .prop_map(|(d, distance)| From::Along(d, distance)),
        (vector(), tilt, select(vec![0.1, 1.0, 3.0, 1e3]))
            .prop_map(|(d, tilt, far)| From::Grazing(d, tilt, far)),
    ];
    ([pick(), pick(), pick()], vector(), offset_size, from).prop_map(|(picks, offset, size, from)| Aim {
        picks,
        offset: size * offset,
        from,
    })
}

impl Aim {
    /// The aimed ray; `None` if it would start at its target.
    pub(crate) fn at(&self, primitive: &Primitive) -> Option<Ray> {
        let features = features(primitive);
        let (mut target, mut weight) = (DVec3::ZERO, 0.0);
        for (index, share) in self.picks {
            target += share * features[index % features.len()];
            weight += share;
        }
        let target = if weight > 0.0 { target / weight } else { features[self.picks[0].0 % features.len()] };
        let size = primitive.bounding_sphere().radius;
        let target = target + size * self.offset;
        match self.from {
            From::Near(origin) => Ray::between(3.0 * primitive.extent() * origin, target),
            From::Far(direction) => Ray::between(target + 1e6 * direction, target),
            From::Along(direction, distance) => {
                Some(Ray::new(target - distance * size.max(1e-3) * direction, direction))
            }
            From::Grazing(direction, tilt, distance) => {
                let normal = primitive.normal_at(target);
                let direction = unit(direction - direction.dot(normal) * normal + tilt * normal)?;
                Some(Ray::new(target - distance * size.max(1e-3) * direction, direction))
            }
        }
    }
}

/// Points of the surface that span it.
fn features(primitive: &Primitive) -> Vec<DVec3> {
    match primitive {
        Primitive::Sphere(s) => DVec3::AXES
            .iter()
            .flat_map(|&a| [s.center() + s.radius() * a, s.center() - s.radius() * a])
            .collect(),
        Primitive::Triangle(t) => t.vertices().to_vec(),
        Primitive::Polygon(p) => p.vertices().to_vec(),
        Primitive::Cone(c) => {
            let x = c.axis().any_orthonormal_vector();
            let y = c.axis().cross(x);
            let circle = |(center, radius): (DVec3, f64)| {
                [x, y, -x, -y].into_iter().map(move |outward| center + radius * outward)
            };
            [(c.base(), c.base_radius()), (c.apex(), c.apex_radius())].into_iter().flat_map(circle).collect()
        }
    }
}
