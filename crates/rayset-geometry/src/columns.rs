//! Primitives stored as columns per kind, and the loops that test runs of them.

mod polygons;

use std::ops::Range;

use glam::DVec3;
use rayset_simd::{LaneMask, Lanes, MAX_LANES, Simd};

use crate::departure::Allowed;
use crate::probe::map3;
use crate::{
    AxesOrder, BoundingBox, Cone, ConeAxis, Departure, Polygon, Primitive, PrimitiveKind, Probe, RayLanes,
    ShearedLanes, Sides, Sphere, Triangle, cone, sphere, triangle,
};

use polygons::PolygonColumns;

/// Primitives of all kinds, a structure of arrays for each kind.
///
/// Built once with [`PrimitiveColumns::push`], then tested by runs.
/// Every column is padded, so that a load in lanes that starts at the last value stays inside.
#[derive(Clone, Debug)]
pub struct PrimitiveColumns {
    /// x, y, z, radius.
    spheres: [Vec<f64>; 4],
    /// Coordinate `k` of vertex `v` is column `3 v + k`.
    triangles: [Vec<f64>; 9],
    cones: [Vec<f64>; cone::PARAMETERS],
    polygons: PolygonColumns,
}

/// A range of primitives of one kind, all visible from the same sides.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnRun {
    /// The kind.
    pub kind: PrimitiveKind,
    /// From which sides they can be hit.
    pub sides: Sides,
    /// The indices in the columns of that kind.
    pub range: Range<u32>,
}

/// The normal of the front of a curved primitive, not yet scaled.
///
/// That of a sphere is `away` scaled to unit length; that of a cone is that vector less `tilt`, scaled once more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outward {
    /// From the centre of a sphere, or straight from the axis of a cone, to the point.
    pub away: DVec3,
    /// The axis of a cone times how fast its radius grows along it; `None` of a sphere.
    pub tilt: Option<DVec3>,
}

/// A hit in a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColumnHit {
    /// The distance along the ray, in world units.
    pub t: f64,
    /// The index in the columns of the run's kind.
    pub index: u32,
}

fn padded<const N: usize>() -> [Vec<f64>; N] {
    std::array::from_fn(|_| vec![0.0; MAX_LANES])
}

/// Adds a value before the padding.
fn push_padded(column: &mut Vec<f64>, value: f64) {
    let end = column.len() - MAX_LANES;
    column[end] = value;
    column.push(0.0);
}

/// What stands in columns of one primitive.
///
/// # Panics
///
/// If there is no such primitive: beyond the last one stands the padding, which is none.
#[inline(always)]
fn row<const N: usize>(columns: &[Vec<f64>; N], index: u32) -> [f64; N] {
    let i = index as usize;
    assert!(i < columns[0].len() - MAX_LANES, "there is no primitive {index}");
    std::array::from_fn(|k| columns[k][i])
}

fn index_of(len: usize) -> u32 {
    u32::try_from(len).expect("at most 2^32 primitives of a kind")
}

impl Default for PrimitiveColumns {
    fn default() -> Self {
        Self { spheres: padded(), triangles: padded(), cones: padded(), polygons: PolygonColumns::default() }
    }
}

impl PrimitiveColumns {
    /// Appends a primitive; returns the run of it alone.
    ///
    /// # Panics
    ///
    /// If there are 2^32 of its kind, or of polygon vertices, already.
    pub fn push(&mut self, primitive: &Primitive, sides: Sides) -> ColumnRun {
        let kind = primitive.kind();
        let index = index_of(self.len(kind));
        match primitive {
            Primitive::Sphere(sphere) => {
                let [x, y, z] = sphere.center().to_array();
                push_all(&mut self.spheres, [x, y, z, sphere.radius()]);
            }
            Primitive::Triangle(triangle) => {
                let [a, b, c] = triangle.vertices().map(|vertex| vertex.to_array());
                push_all(&mut self.triangles, [a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]]);
            }
            Primitive::Cone(cone) => push_all(&mut self.cones, cone.parameters()),
            Primitive::Polygon(polygon) => {
                self.polygons.push(polygon.vertices(), polygon.normal());
            }
        }
        ColumnRun { kind, sides, range: index..index + 1 }
    }

    /// How many primitives of a kind there are.
    #[must_use]
    pub fn len(&self, kind: PrimitiveKind) -> usize {
        match kind {
            PrimitiveKind::Sphere => self.spheres[0].len() - MAX_LANES,
            PrimitiveKind::Triangle => self.triangles[0].len() - MAX_LANES,
            PrimitiveKind::Cone => self.cones[0].len() - MAX_LANES,
            PrimitiveKind::Polygon => self.polygons.len(),
        }
    }

    /// Whether there is any triangle or polygon: whether a [`Probe`] must prepare for them.
    #[must_use]
    pub fn is_flat(&self) -> bool {
        self.len(PrimitiveKind::Triangle) + self.len(PrimitiveKind::Polygon) > 0
    }

    /// The unit normal of the front of a primitive, at a point of it.
    ///
    /// # Panics
    ///
    /// If there is no such primitive.
    #[must_use]
    #[inline]
    pub fn normal_at(&self, kind: PrimitiveKind, index: u32, point: DVec3) -> DVec3 {
        let i = index as usize;
        match kind {
            PrimitiveKind::Sphere => {
                let [x, y, z, _] = &self.spheres;
                Sphere::outward(DVec3::new(x[i], y[i], z[i]), point)
            }
            PrimitiveKind::Triangle => self.triangle(index).normal(),
            PrimitiveKind::Polygon => self.polygons.normal(i),
            PrimitiveKind::Cone => {
                let at = |k: usize| DVec3::new(self.cones[k][i], self.cones[k + 1][i], self.cones[k + 2][i]);
                Cone::outward(at(0), at(3), self.cones[8][i], point)
            }
        }
    }

    /// The normal of [`PrimitiveColumns::normal_at`] before it is scaled, for those who scale many at a time; `None` of what
    /// is flat.
    ///
    /// Where scaling finds no direction, ask [`PrimitiveColumns::normal_at`].
    ///
    /// # Panics
    ///
    /// If there is no such primitive.
    #[must_use]
    #[inline]
    pub fn outward_at(&self, kind: PrimitiveKind, index: u32, point: DVec3) -> Option<Outward> {
        let i = index as usize;
        match kind {
            PrimitiveKind::Sphere => {
                let [x, y, z, _] = &self.spheres;
                Some(Outward { away: point - DVec3::new(x[i], y[i], z[i]), tilt: None })
            }
            PrimitiveKind::Cone => {
                let at = |k: usize| DVec3::new(self.cones[k][i], self.cones[k + 1][i], self.cones[k + 2][i]);
                let (axis, slope) = (at(3), self.cones[8][i]);
                Some(Outward { away: Cone::away(at(0), axis, point), tilt: Some(slope * axis) })
            }
            PrimitiveKind::Triangle | PrimitiveKind::Polygon => None,
        }
    }

    /// A box that holds every hit of a primitive, up to the rounding of coordinates; in world space.
    ///
    /// It is that of [`Primitive::bounding_box`], and for a cone wider by the thickness of its surface.
    ///
    /// # Panics
    ///
    /// If there is no such primitive.
    #[must_use]
    pub fn bounding_box(&self, kind: PrimitiveKind, index: u32) -> BoundingBox {
        let i = index as usize;
        match kind {
            PrimitiveKind::Sphere => Primitive::from(self.sphere(index)).bounding_box(),
            PrimitiveKind::Triangle => Primitive::from(self.triangle(index)).bounding_box(),
            PrimitiveKind::Polygon => self.polygons.corners(i).collect(),
            PrimitiveKind::Cone => Cone::bounding_box_of(&row(&self.cones, index)),
        }
    }

    /// A triangle.
    ///
    /// # Panics
    ///
    /// If there is no such triangle.
    #[must_use]
    pub fn triangle(&self, index: u32) -> Triangle {
        let [ax, ay, az, bx, by, bz, cx, cy, cz] = row(&self.triangles, index);
        Triangle::of_finite([DVec3::new(ax, ay, az), DVec3::new(bx, by, bz), DVec3::new(cx, cy, cz)])
    }

    /// The axis of a cone.
    ///
    /// # Panics
    ///
    /// If there is no such cone.
    #[must_use]
    pub fn cone_axis(&self, index: u32) -> ConeAxis {
        Cone::axis_of(&row(&self.cones, index))
    }

    /// Where rays meet a cone, a ray a lane: the lanes that hit it, and `t`; of the rays, where their spans start and end,
    /// and the lanes whose front and back may be hit.
    ///
    /// The arithmetic of [`PrimitiveColumns::nearest`], and its bits.
    ///
    /// # Panics
    ///
    /// If there is no such cone.
    #[must_use]
    #[inline(always)]
    pub fn cone_by_rays<S: Simd>(
        &self,
        simd: S,
        index: u32,
        rays: &RayLanes<S>,
        span: [S::F64; 2],
        sides: (<S::F64 as Lanes>::Mask, <S::F64 as Lanes>::Mask),
    ) -> (<S::F64 as Lanes>::Mask, S::F64) {
        let mut parameters = [simd.splat_f64(0.0); cone::PARAMETERS];
        for (parameter, column) in parameters.iter_mut().zip(&self.cones) {
            *parameter = simd.splat_f64(column[index as usize]);
        }
        cone::intersect_pairs(simd, rays, span, parameters, sides)
    }

    /// Where rays meet a polygon, a ray a lane: the lanes that hit it, and `t`; of the rays, how they are sheared, in which
    /// order they want coordinates, and the lanes whose front and back may be hit.
    ///
    /// The arithmetic of [`PrimitiveColumns::nearest`], and its bits.
    ///
    /// # Panics
    ///
    /// If there is no such polygon.
    #[must_use]
    #[inline(always)]
    pub fn polygon_by_rays<S: Simd>(
        &self,
        simd: S,
        index: u32,
        (rays, order): (&ShearedLanes<S>, &AxesOrder<S>),
        sides: (<S::F64 as Lanes>::Mask, <S::F64 as Lanes>::Mask),
    ) -> (<S::F64 as Lanes>::Mask, S::F64) {
        self.polygons.intersect_by_rays(simd, index as usize, (rays, order), sides)
    }

    /// How many vertices a polygon has.
    ///
    /// # Panics
    ///
    /// If there is no such polygon.
    #[must_use]
    pub fn polygon_len(&self, index: u32) -> usize {
        self.polygons.corners(index as usize).len()
    }

    /// The vertices of a polygon.
    ///
    /// # Panics
    ///
    /// If there is no such polygon.
    #[must_use]
    pub fn polygon_vertices(&self, index: u32) -> Vec<DVec3> {
        self.polygons.corners(index as usize).collect()
    }

    /// The bits of the numbers that a primitive is tested by.
    ///
    /// Of primitives of one kind with the same bits, every test gives the same answer.
    ///
    /// # Panics
    ///
    /// If there is no such primitive.
    pub fn bits(&self, kind: PrimitiveKind, index: u32) -> impl Iterator<Item = u64> {
        let i = index as usize;
        let (columns, range): (&[Vec<f64>], _) = match kind {
            PrimitiveKind::Sphere => (&self.spheres, i..i + 1),
            PrimitiveKind::Triangle => (&self.triangles, i..i + 1),
            PrimitiveKind::Cone => (&self.cones, i..i + 1),
            PrimitiveKind::Polygon => self.polygons.coordinates(i),
        };
        columns.iter().flat_map(move |column| column[range.clone()].iter().map(|value| value.to_bits()))
    }

    /// Appends a primitive of other columns; returns the run of it alone.
    ///
    /// # Panics
    ///
    /// If there is no such primitive, or as [`PrimitiveColumns::push`] does.
    pub fn push_from(&mut self, other: &Self, kind: PrimitiveKind, index: u32, sides: Sides) -> ColumnRun {
        let new = index_of(self.len(kind));
        match kind {
            PrimitiveKind::Sphere => push_all(&mut self.spheres, row(&other.spheres, index)),
            PrimitiveKind::Triangle => push_all(&mut self.triangles, row(&other.triangles, index)),
            PrimitiveKind::Cone => push_all(&mut self.cones, row(&other.cones, index)),
            PrimitiveKind::Polygon => {
                self.polygons.push(&other.polygon_vertices(index), other.polygons.normal(index as usize));
            }
        }
        ColumnRun { kind, sides, range: new..new + 1 }
    }

    /// How many bytes the columns take.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let columns = self.spheres.iter().chain(&self.triangles).chain(&self.cones);
        columns.map(|column| size_of_val(&column[..])).sum::<usize>() + self.polygons.bytes()
    }

    /// A sphere.
    ///
    /// # Panics
    ///
    /// If there is no such sphere.
    #[must_use]
    pub fn sphere(&self, index: u32) -> Sphere {
        let [x, y, z, radius] = row(&self.spheres, index);
        Sphere::new(DVec3::new(x, y, z), radius)
    }

    /// A primitive by itself, for those who copy a scene; that of a cone is rounded anew.
    ///
    /// # Panics
    ///
    /// If there is no such primitive.
    #[must_use]
    pub fn primitive(&self, kind: PrimitiveKind, index: u32) -> Primitive {
        let i = index as usize;
        match kind {
            PrimitiveKind::Sphere => self.sphere(index).into(),
            PrimitiveKind::Triangle => self.triangle(index).into(),
            PrimitiveKind::Polygon => {
                Polygon::new(self.polygon_vertices(index)).expect("it was one when it was added").into()
            }
            PrimitiveKind::Cone => {
                let at = |k: usize| DVec3::new(self.cones[k][i], self.cones[k + 1][i], self.cones[k + 2][i]);
                let [height, radius, slope] = [6, 7, 8].map(|k| self.cones[k][i]);
                let apex_radius = (radius + slope * height).max(0.0);
                let cone = Cone::new(at(0), radius, at(0) + height * at(3), apex_radius);
                cone.expect("it was one when it was added").into()
            }
        }
    }

    /// The nearest hit of a run, of equally near ones the one of least index.
    #[must_use]
    #[inline(always)]
    pub fn nearest<S: Simd>(
        &self,
        probe: &Probe<S>,
        run: &ColumnRun,
        departure: Option<Departure>,
    ) -> Option<ColumnHit> {
        let mut nearest: Option<ColumnHit> = None;
        self.each_hit(probe, run, departure, |hit| {
            if nearest.is_none_or(|nearest| hit.t < nearest.t) {
                nearest = Some(hit);
            }
            true
        });
        nearest
    }

    /// The hit of least index in a run, whatever its distance.
    #[must_use]
    #[inline(always)]
    pub fn any<S: Simd>(
        &self,
        probe: &Probe<S>,
        run: &ColumnRun,
        departure: Option<Departure>,
    ) -> Option<ColumnHit> {
        let mut any = None;
        self.each_hit(probe, run, departure, |hit| {
            any = Some(hit);
            false
        });
        any
    }

    /// Calls `visit` with the hits of a run in increasing index order until it says stop.
    #[inline(always)]
    fn each_hit<S: Simd>(
        &self,
        probe: &Probe<S>,
        run: &ColumnRun,
        departure: Option<Departure>,
        mut visit: impl FnMut(ColumnHit) -> bool,
    ) {
        let departure = departure.filter(|d| d.kind == run.kind && run.range.contains(&d.index));
        if run.kind == PrimitiveKind::Polygon {
            // The lanes run over a polygon's edges: one polygon at a time.
            for i in run.range.clone() {
                // A plane is never met again by a ray that leaves it.
                if departure.is_none_or(|d| d.index != i)
                    && let Some((side, t)) = self.polygons.intersect(probe, i as usize)
                    && run.sides.include(side)
                    && probe.span.contains(t)
                    && !visit(ColumnHit { t, index: i })
                {
                    return;
                }
            }
            return;
        }
        // The kind is told apart outside of the loops, and each loop has its kernel inlined.
        match run.kind {
            PrimitiveKind::Sphere => each_lane(probe, run, departure, visit, &SphereTest(&self.spheres)),
            PrimitiveKind::Triangle => {
                let vertex = |v: usize| map3(probe.shear.axes, |k| self.triangles[3 * v + k].as_slice());
                each_lane(probe, run, departure, visit, &TriangleTest([vertex(0), vertex(1), vertex(2)]));
            }
            PrimitiveKind::Cone => each_lane(probe, run, departure, visit, &ConeTest(&self.cones)),
            PrimitiveKind::Polygon => unreachable!("polygons are tested one at a time"),
        }
    }
}

/// The kernel of a kind, reading its columns. A trait and not a closure, since it must be inlined always.
trait LaneTest<S: Simd> {
    /// Tests the primitives `i`, `i + 1`, ... as many as there are lanes.
    fn test(&self, probe: &Probe<S>, i: usize, allowed: Allowed<S>) -> (<S::F64 as Lanes>::Mask, S::F64);
}

struct SphereTest<'a>(&'a [Vec<f64>; 4]);

impl<S: Simd> LaneTest<S> for SphereTest<'_> {
    #[inline(always)]
    fn test(&self, probe: &Probe<S>, i: usize, allowed: Allowed<S>) -> (<S::F64 as Lanes>::Mask, S::F64) {
        let ([x, y, z, radius], simd) = (self.0, probe.simd);
        let center = [simd.load_f64(&x[i..]), simd.load_f64(&y[i..]), simd.load_f64(&z[i..])];
        sphere::intersect(probe, center, simd.load_f64(&radius[i..]), allowed)
    }
}

/// The three vertices, each with its axes in the order of the probe's shear.
struct TriangleTest<'a>([[&'a [f64]; 3]; 3]);

impl<S: Simd> LaneTest<S> for TriangleTest<'_> {
    #[inline(always)]
    fn test(&self, probe: &Probe<S>, i: usize, allowed: Allowed<S>) -> (<S::F64 as Lanes>::Mask, S::F64) {
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = self.0;
        let simd = probe.simd;
        let a = [simd.load_f64(&ax[i..]), simd.load_f64(&ay[i..]), simd.load_f64(&az[i..])];
        let b = [simd.load_f64(&bx[i..]), simd.load_f64(&by[i..]), simd.load_f64(&bz[i..])];
        let c = [simd.load_f64(&cx[i..]), simd.load_f64(&cy[i..]), simd.load_f64(&cz[i..])];
        triangle::intersect(probe, [a, b, c], allowed)
    }
}

struct ConeTest<'a>(&'a [Vec<f64>; cone::PARAMETERS]);

impl<S: Simd> LaneTest<S> for ConeTest<'_> {
    #[inline(always)]
    fn test(&self, probe: &Probe<S>, i: usize, allowed: Allowed<S>) -> (<S::F64 as Lanes>::Mask, S::F64) {
        let mut parameters = [probe.simd.splat_f64(0.0); cone::PARAMETERS];
        for (parameter, column) in parameters.iter_mut().zip(self.0) {
            *parameter = probe.simd.load_f64(&column[i..]);
        }
        cone::intersect(probe, parameters, allowed)
    }
}

/// Runs a kernel over the lanes of a run and visits its hits in increasing index order.
#[inline(always)]
fn each_lane<S: Simd>(
    probe: &Probe<S>,
    run: &ColumnRun,
    departure: Option<Departure>,
    mut visit: impl FnMut(ColumnHit) -> bool,
    kernel: &impl LaneTest<S>,
) {
    let (start, end) = (run.range.start as usize, run.range.end as usize);
    for i in (start..end).step_by(S::F64::LANES) {
        let allowed = Allowed::of(probe.simd, run.sides, departure, i);
        let (hits, t) = kernel.test(probe, i, allowed);
        let real = (1_u32 << (end - i).min(S::F64::LANES)) - 1;
        let mut bits = hits.bits() & real;
        while bits != 0 {
            let lane = bits.trailing_zeros();
            bits &= bits - 1;
            if !visit(ColumnHit { t: t.lane(lane as usize), index: index_of(i) + lane }) {
                return;
            }
        }
    }
}

fn push_all<const N: usize>(columns: &mut [Vec<f64>; N], values: [f64; N]) {
    for (column, value) in columns.iter_mut().zip(values) {
        push_padded(column, value);
    }
}

#[cfg(test)]
mod tests {
    use std::panic::catch_unwind;

    use super::*;

    #[test]
    fn padding_is_no_primitive() {
        let (a, b, c) = (DVec3::ZERO, DVec3::X, DVec3::Y);
        let mut columns = PrimitiveColumns::default();
        for primitive in [
            Primitive::from(Sphere::new(a, 1.0)),
            Triangle::new(a, b, c).into(),
            Cone::new(a, 1.0, c, 0.5).expect("a frustum").into(),
        ] {
            assert_eq!(columns.push(&primitive, Sides::Both).range, 0..1);
        }
        assert_eq!(columns.triangle(0).vertices(), &[a, b, c]);
        assert!(catch_unwind(|| columns.triangle(1)).is_err(), "there is one triangle");
        assert!(catch_unwind(|| columns.sphere(1)).is_err(), "there is one sphere");
        assert!(catch_unwind(|| columns.cone_axis(1)).is_err(), "there is one cone");
    }
}
