//! A hierarchy over shapes of the caller's own type.

use rayset_geometry::{BoundingBox, Ray, Side, Span};
use rayset_simd::Backend;

use crate::{BoxHierarchy, Hit, Query};

/// What a [`ShapeHierarchy`] can be over.
///
/// An implementation keeps to two things, as the closure of a [`BoxHierarchy`] does, which says them exactly: hits lie in
/// the box, and where one lies does not depend on the span.
pub trait Shape {
    /// A box in world space that holds every hit; an empty one for a shape that is never hit.
    fn bounding_box(&self) -> BoundingBox;

    /// The least distance within a span at which a ray hits the shape, in world units.
    ///
    /// `departure` is the side into which the ray left this very shape, if it did: the place that was left is no hit.
    fn intersect(&self, ray: &Ray, span: Span, departure: Option<Side>) -> Option<f64>;
}

impl<T: Shape + ?Sized> Shape for Box<T> {
    fn bounding_box(&self) -> BoundingBox {
        (**self).bounding_box()
    }

    fn intersect(&self, ray: &Ray, span: Span, departure: Option<Side>) -> Option<f64> {
        (**self).intersect(ray, span, departure)
    }
}

/// A bounding volume hierarchy that owns shapes of any one type; of several, an enum or `Box<dyn Shape>` is one.
///
/// Every answer is that of a loop over all shapes, the least in the order `(t, index)`. For spheres, triangles, polygons
/// and cones alone [`Hierarchy`](crate::Hierarchy) is faster, since it tests several at a time.
///
/// ```
/// use rayset_bvh::{Shape, ShapeHierarchy};
/// use rayset_geometry::{BoundingBox, Probe, Ray, Side, Span, glam::{DVec3, dvec3}};
///
/// /// A disk that faces the z axis.
/// struct Disk {
///     center: DVec3,
///     radius: f64,
/// }
///
/// impl Shape for Disk {
///     fn bounding_box(&self) -> BoundingBox {
///         let half = dvec3(self.radius, self.radius, 0.0);
///         BoundingBox { min: self.center - half, max: self.center + half }
///     }
///
///     fn intersect(&self, ray: &Ray, span: Span, departure: Option<Side>) -> Option<f64> {
///         let t = (self.center.z - ray.origin().z) / ray.direction().z;
///         let is_hit = ray.at(t).distance(self.center) <= self.radius && departure.is_none();
///         (is_hit && span.contains(t)).then_some(t)
///     }
/// }
///
/// let disks = (1..=50).map(|i| Disk { center: DVec3::Z * f64::from(i), radius: 0.01 * f64::from(i) });
/// let hierarchy = ShapeHierarchy::new(disks);
/// let hit = hierarchy.nearest(&Ray::new(dvec3(0.095, 0.0, 0.0), DVec3::Z), Span::FORWARD).unwrap();
/// assert_eq!((hit.t, hit.primitive), (10.0, 9));
/// assert_eq!(hierarchy.shapes()[9].radius, 0.1);
/// ```
#[derive(Clone, Debug)]
pub struct ShapeHierarchy<T> {
    boxes: BoxHierarchy,
    shapes: Vec<T>,
}

impl<T: Shape> ShapeHierarchy<T> {
    /// Builds a hierarchy over shapes, numbered in their order, for the lanes of [`Backend::active`].
    ///
    /// # Panics
    ///
    /// If a coordinate of a box that is not empty is NaN or not finite, or there are 2^31 shapes or more.
    #[must_use]
    pub fn new(shapes: impl IntoIterator<Item = T>) -> Self {
        Self::on(shapes, Backend::active())
    }

    /// Builds a hierarchy for the lanes of a backend.
    ///
    /// # Panics
    ///
    /// As [`ShapeHierarchy::new`] does.
    #[must_use]
    pub fn on(shapes: impl IntoIterator<Item = T>, backend: Backend) -> Self {
        let shapes: Vec<T> = shapes.into_iter().collect();
        Self { boxes: BoxHierarchy::on(shapes.iter().map(Shape::bounding_box), backend), shapes }
    }

    /// The shapes, in the order they were given.
    #[must_use]
    pub fn shapes(&self) -> &[T] {
        &self.shapes
    }

    /// The least hit of a ray in the order `(t, index)`.
    #[must_use]
    pub fn nearest(&self, ray: &Ray, span: Span) -> Option<Hit> {
        self.boxes.nearest(ray, span, |i, ray, span| self.shapes[i as usize].intersect(ray, span, None))
    }

    /// Whether a ray hits anything.
    #[must_use]
    pub fn occluded(&self, ray: &Ray, span: Span) -> bool {
        self.boxes.occluded(ray, span, |i, ray, span| self.shapes[i as usize].intersect(ray, span, None))
    }

    /// Appends the least hit of every ray, in order, with the lanes chosen once.
    pub fn nearest_batch(&self, queries: &[Query], answers: &mut Vec<Option<Hit>>) {
        self.boxes.nearest_batch(queries, |i, query| self.intersect(i, query), answers);
    }

    /// Appends for every ray, in order, whether it hits anything.
    pub fn occluded_batch(&self, queries: &[Query], answers: &mut Vec<bool>) {
        self.boxes.occluded_batch(queries, |i, query| self.intersect(i, query), answers);
    }

    #[inline(always)]
    fn intersect(&self, i: u32, query: &Query) -> Option<f64> {
        let departure = query.from.filter(|&(left, _)| left == i).map(|(_, side)| side);
        self.shapes[i as usize].intersect(&query.ray, query.span, departure)
    }
}
