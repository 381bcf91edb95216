//! One ray prepared for testing many primitives in lanes.

use rayset_simd::{LaneMask, Lanes, Simd};

use crate::{Ray, Span};

/// A ray spread over the lanes of a backend.
#[derive(Clone, Copy, Debug)]
pub struct RayLanes<S: Simd> {
    /// The x, y and z of the origin.
    pub origin: [S::F64; 3],
    /// The x, y and z of the direction.
    pub direction: [S::F64; 3],
}

impl<S: Simd> RayLanes<S> {
    /// The same ray in every lane.
    #[must_use]
    #[inline(always)]
    pub fn splat(simd: S, ray: &Ray) -> Self {
        let splat = |v: glam::DVec3| [simd.splat_f64(v.x), simd.splat_f64(v.y), simd.splat_f64(v.z)];
        Self { origin: splat(ray.origin()), direction: splat(ray.direction()) }
    }
}

/// The shear that turns a ray into the z axis: `x' = x - (d_x / d_z) z`, `y' = y - (d_y / d_z) z`, `z' = z / d_z`.
///
/// The z axis here is the dominant one of the direction; the other two follow it so that a triangle seen
/// counterclockwise stays so. A vertex is sheared the same way whichever primitive it belongs to: that is why
/// primitives that share a vertex or an edge agree on which of them a ray passes through.
///
/// Source: Woop, Benthin, Wald 2013, "Watertight ray/triangle intersection", section 3.1.
#[derive(Clone, Copy, Debug)]
pub struct Shear {
    /// Which world axes play x, y and z.
    pub axes: [usize; 3],
    /// `d_x / d_z`, `d_y / d_z` and `1 / d_z`.
    pub factors: [f64; 3],
}

impl Shear {
    /// The shear of a ray's direction.
    #[must_use]
    #[inline]
    pub fn of(ray: &Ray) -> Self {
        let d = ray.direction().to_array();
        let axes @ [x, y, z] = Self::axes_of(d);
        Self { axes, factors: [d[x] / d[z], d[y] / d[z], 1.0 / d[z]] }
    }

    /// Which world axes play x, y and z for a direction.
    #[must_use]
    #[inline(always)]
    pub fn axes_of(direction: [f64; 3]) -> [usize; 3] {
        let size = direction.map(f64::abs);
        let z = if size[0] > size[1] {
            if size[0] > size[2] { 0 } else { 2 }
        } else if size[1] > size[2] {
            1
        } else {
            2
        };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        // A mirrored z axis would turn the triangles round.
        if direction[z] < 0.0 { [y, x, z] } else { [x, y, z] }
    }
}

/// Which world axes play x, y and z, for each of several rays: a [`Shear`]'s axes, a lane each.
#[derive(Clone, Copy, Debug)]
pub struct AxesLanes<S: Simd> {
    /// The lanes in which x plays z, and y.
    is_x: <S::F64 as Lanes>::Mask,
    is_y: <S::F64 as Lanes>::Mask,
    /// The lanes in which the other two change places.
    is_mirrored: <S::F64 as Lanes>::Mask,
}

impl<S: Simd> AxesLanes<S> {
    /// Those of some directions.
    #[must_use]
    #[inline(always)]
    pub fn of(simd: S, direction: &[S::F64; 3]) -> Self {
        let size = [direction[0].abs(), direction[1].abs(), direction[2].abs()];
        // The comparisons of `Shear::axes_of`.
        let is_x = size[0].gt(size[1]) & size[0].gt(size[2]);
        let is_y = !size[0].gt(size[1]) & size[1].gt(size[2]);
        let along = direction[0].select(is_x, direction[1].select(is_y, direction[2]));
        Self { is_x, is_y, is_mirrored: along.lt(simd.splat_f64(0.0)) }
    }

    /// The axes of all lanes, if these are the same.
    #[must_use]
    #[inline(always)]
    pub fn common(&self) -> Option<[usize; 3]> {
        let lanes = [self.is_x.bits(), self.is_y.bits(), self.is_mirrored.bits()];
        let all = u32::MAX >> (32 - S::F64::LANES);
        if lanes.iter().any(|&lanes| lanes != 0 && lanes != all) {
            return None;
        }
        let z = match lanes {
            [0, 0, _] => 2,
            [0, _, _] => 1,
            _ => 0,
        };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        Some(if lanes[2] == 0 { [x, y, z] } else { [y, x, z] })
    }

    /// Coordinates along the world's axes, in the order of each lane's own.
    #[must_use]
    #[inline(always)]
    pub fn order(&self, [x, y, z]: [S::F64; 3]) -> [S::F64; 3] {
        let Self { is_x, is_y, is_mirrored } = *self;
        let next = y.select(is_x, z.select(is_y, x));
        let last = z.select(is_x, x.select(is_y, y));
        let along = x.select(is_x, y.select(is_y, z));
        [last.select(is_mirrored, next), next.select(is_mirrored, last), along]
    }

    /// The same of three points.
    #[must_use]
    #[inline(always)]
    pub fn order_all(&self, [a, b, c]: [[S::F64; 3]; 3]) -> [[S::F64; 3]; 3] {
        [self.order(a), self.order(b), self.order(c)]
    }
}

/// In which order rays, a lane each, want the coordinates of points.
#[derive(Clone, Copy, Debug)]
pub enum AxesOrder<S: Simd> {
    /// In that of the axes that all have.
    Common([usize; 3]),
    /// In that of each ray's own.
    Own(AxesLanes<S>),
}

impl<S: Simd> AxesOrder<S> {
    /// That of rays with these axes.
    #[must_use]
    #[inline(always)]
    pub fn of(axes: AxesLanes<S>) -> Self {
        axes.common().map_or(Self::Own(axes), Self::Common)
    }

    /// A point, in every lane.
    #[must_use]
    #[inline(always)]
    pub fn splat(&self, simd: S, point: [f64; 3]) -> [S::F64; 3] {
        let of_axis = |axis: usize| simd.splat_f64(point[axis]);
        match self {
            Self::Common([x, y, z]) => [of_axis(*x), of_axis(*y), of_axis(*z)],
            Self::Own(axes) => axes.order([of_axis(0), of_axis(1), of_axis(2)]),
        }
    }
}

/// Rays that are sheared, a lane each.
#[derive(Clone, Copy, Debug)]
pub struct ShearedLanes<S: Simd> {
    /// The coordinates of the origins, in the order of each ray's axes.
    pub origin: [S::F64; 3],
    /// The factors of each ray's [`Shear`].
    pub factors: [S::F64; 3],
    /// Where the spans start and end.
    pub span: [S::F64; 2],
}

impl<S: Simd> ShearedLanes<S> {
    /// Shears rays, whose coordinates are in the order of each one's own axes.
    #[must_use]
    #[inline(always)]
    pub fn of(simd: S, rays: RayLanes<S>, span: [S::F64; 2]) -> Self {
        let RayLanes { origin, direction: [dx, dy, dz] } = rays;
        Self { origin, factors: [dx / dz, dy / dz, simd.splat_f64(1.0) / dz], span }
    }

    /// The z of points in sheared space, but for the factor that makes it a distance along the ray.
    #[inline(always)]
    pub(crate) fn along(&self, z: S::F64) -> S::F64 {
        z - self.origin[2]
    }

    /// The x or y of points in sheared space, of which `along` is known.
    #[inline(always)]
    pub(crate) fn across(&self, axis: usize, coordinate: S::F64, along: S::F64) -> S::F64 {
        (coordinate - self.origin[axis]) - self.factors[axis] * along
    }

    /// Points in sheared space, `along` as they are there.
    #[inline(always)]
    pub(crate) fn shear(&self, [x, y, z]: [S::F64; 3]) -> [S::F64; 3] {
        let z = self.along(z);
        [self.across(0, x, z), self.across(1, y, z), z]
    }
}

/// One ray and its span, prepared for testing columns of primitives.
#[derive(Clone, Copy, Debug)]
pub struct Probe<S: Simd> {
    pub(crate) simd: S,
    pub(crate) ray: Ray,
    pub(crate) span: Span,
    pub(crate) lanes: RayLanes<S>,
    pub(crate) shear: Shear,
}

impl<S: Simd> Probe<S> {
    /// Prepares a ray; `flat` says whether triangles or polygons will be tested.
    #[must_use]
    #[inline(always)]
    pub fn new(simd: S, ray: &Ray, span: Span, flat: bool) -> Self {
        let shear = if flat { Shear::of(ray) } else { Shear { axes: [0, 1, 2], factors: [0.0; 3] } };
        Self { simd, ray: *ray, span, lanes: RayLanes::splat(simd, ray), shear }
    }

    /// The same ray in the lanes of another backend.
    #[must_use]
    #[inline(always)]
    pub fn spread<T: Simd>(&self, simd: T) -> Probe<T> {
        let Self { ray, span, shear, .. } = *self;
        Probe { simd, ray, span, lanes: RayLanes::splat(simd, &ray), shear }
    }

    /// The shear of the ray, if it was prepared for triangles or polygons.
    #[must_use]
    #[inline(always)]
    pub fn shear(&self) -> &Shear {
        &self.shear
    }

    /// The ray.
    #[must_use]
    pub fn ray(&self) -> &Ray {
        &self.ray
    }

    /// Where hits count.
    #[must_use]
    pub fn span(&self) -> Span {
        self.span
    }

    /// The same ray sheared, in every lane.
    #[inline(always)]
    pub(crate) fn sheared(&self) -> ShearedLanes<S> {
        let (simd, Shear { axes: [x, y, z], factors }) = (self.simd, self.shear);
        let origin = &self.lanes.origin;
        ShearedLanes {
            origin: [origin[x], origin[y], origin[z]],
            factors: [simd.splat_f64(factors[0]), simd.splat_f64(factors[1]), simd.splat_f64(factors[2])],
            span: [simd.splat_f64(self.span.start), simd.splat_f64(self.span.end)],
        }
    }
}

/// `[f(a), f(b), f(c)]`, inlined always: `array::map` is a call where its closure is large, and costs half the speed
/// of a kernel.
#[inline(always)]
pub(crate) fn map3<T, U>([a, b, c]: [T; 3], f: impl Fn(T) -> U) -> [U; 3] {
    [f(a), f(b), f(c)]
}
