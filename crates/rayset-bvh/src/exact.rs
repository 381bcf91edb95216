//! What was found, in double precision: one by one, or a ray and its primitive a lane.

use rayset_geometry::{ColumnRun, Departure, PrimitiveKind, Probe, Ray, Sides, Span, Sphere, Triangle};
use rayset_simd::{LaneMask, Lanes, Part, Scalar, Simd};

use self::lanes::in_order;
pub(crate) use self::sure::ExactSure;
use crate::columns::{Left, RayColumns};
use crate::frame::Frame;
use crate::shapes::{Hit, Run, Shapes};

mod inside;
mod lanes;
mod sure;

/// How many bits of a record's number say where in its run it stands.
pub(crate) const PLACE_BITS: u32 = 4;
/// No record.
pub(crate) const NONE: u32 = u32::MAX;

/// The number of what stands at a place of a run.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "`Shapes::suits_packets` has counted the runs")]
pub(crate) fn record_of(run: usize, place: u32) -> u32 {
    (run as u32) << PLACE_BITS | place
}

/// What the exact tests are made with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exact<'a, const W: usize> {
    pub(crate) shapes: &'a Shapes<W>,
    pub(crate) frame: &'a Frame,
    pub(crate) rays: &'a RayColumns<'a>,
}

impl<const W: usize> Exact<'_, W> {
    /// The primitive of a record.
    #[inline(always)]
    pub(crate) fn sure(&self, record: u32) -> Sure {
        let (run, place) = self.shapes.place_of(record);
        Sure { kind: run.kind, index: run.first + place, sides: run.sides }
    }

    /// The exact hit of a ray of the columns, if there is one, of a record.
    #[inline(always)]
    pub(crate) fn hit<S: Simd>(&self, simd: S, ray: usize, record: u32) -> Option<Hit> {
        let departure = self.shapes.departure(self.rays.left(ray));
        let (ray, span) = self.rays.ray(ray);
        self.shapes.exact_alone(simd, (&ray, span), departure, &self.sure(record))
    }
}

/// So many rays at least are tested together against a shape of a kind; of triangles and cones preparing one by itself takes
/// as long.
const fn least_together(kind: PrimitiveKind) -> u32 {
    match kind {
        PrimitiveKind::Sphere => 3,
        PrimitiveKind::Polygon => 2,
        PrimitiveKind::Triangle | PrimitiveKind::Cone => 1,
    }
}

/// The exact hits of rays of a packet, of one primitive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ExactHits<const W: usize> {
    /// The lanes of the rays that hit it.
    pub(crate) lanes: u32,
    /// Where they do.
    pub(crate) t: [f64; W],
    pub(crate) primitive: u32,
}

/// Some rays of a packet, and a primitive that they may hit.
pub(crate) struct ExactTogether<'a, const W: usize> {
    pub(crate) exact: &'a Exact<'a, W>,
    /// The number of the packet's first ray.
    pub(crate) first: usize,
    pub(crate) lanes: u32,
    /// The lanes that leave the primitive, and those that do so into its front.
    pub(crate) leaving: (u32, u32),
    pub(crate) record: u32,
}

impl<S: Simd, const W: usize> Part<S> for ExactTogether<'_, W> {
    type Output = ExactHits<W>;

    #[inline(always)]
    fn run(self, simd: S) -> ExactHits<W> {
        let Self { exact, first, mut lanes, leaving: (leaving, outwards), record } = self;
        let Exact { shapes, rays, .. } = exact;
        let Sure { kind, index, sides } = exact.sure(record);
        let mut hits = ExactHits { lanes: 0, t: [0.0; W], primitive: shapes.number(kind, index) };
        let pairs = S::F64::LANES;
        let mut lane = 0;
        let least = least_together(kind);
        while lanes >> lane != 0 && first + lane + pairs <= rays.len() {
            let wanted = lanes & (u32::MAX >> (32 - pairs)) << lane;
            if wanted.count_ones() >= least {
                let at = first + lane;
                // A plane is never met again by a ray that leaves it.
                let is_plane = matches!(kind, PrimitiveKind::Triangle | PrimitiveKind::Polygon);
                let not_back = if is_plane { leaving } else { outwards };
                let front = if sides == Sides::Back { 0 } else { wanted & !leaving };
                let back = if sides == Sides::Front { 0 } else { wanted & !not_back };
                let sides = (simd.mask_f64(front >> lane), simd.mask_f64(back >> lane));
                let (is_hit, t) = match kind {
                    PrimitiveKind::Triangle => {
                        let (rays, order) = rays.sheared(simd, at);
                        let vertices = in_order(simd, &order, shapes.triangle(index));
                        Triangle::intersect_pairs(simd, &rays, vertices, sides)
                    }
                    PrimitiveKind::Sphere => {
                        let sphere = shapes.sphere(index);
                        let [x, y, z] = sphere.center().to_array();
                        let center = [simd.splat_f64(x), simd.splat_f64(y), simd.splat_f64(z)];
                        let sphere = (center, simd.splat_f64(sphere.radius()));
                        let pair = rays.lanes(simd, at);
                        Sphere::intersect_pairs(simd, &pair.rays, pair.span, sphere, sides)
                    }
                    PrimitiveKind::Polygon => {
                        let (rays, order) = rays.sheared(simd, at);
                        shapes.columns.polygon_by_rays(simd, index, (&rays, &order), sides)
                    }
                    PrimitiveKind::Cone => {
                        let pair = rays.lanes(simd, at);
                        shapes.columns.cone_by_rays(simd, index, &pair.rays, pair.span, sides)
                    }
                };
                t.store(&mut hits.t[lane..]);
                hits.lanes |= is_hit.bits() << lane;
                lanes &= !wanted;
            }
            lane += pairs;
        }
        // Too few to go together, or too few left in the columns for all lanes.
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            if let Some(hit) = exact.hit(simd, first + lane, record) {
                hits.lanes |= 1 << lane;
                hits.t[lane] = hit.t;
            }
        }
        hits
    }
}

/// A primitive that is surely hit, and the sides it can be hit from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sure {
    pub(crate) kind: PrimitiveKind,
    pub(crate) index: u32,
    pub(crate) sides: Sides,
}

impl Sure {
    /// What stands where there is none.
    pub(crate) const NONE: Self = Self { kind: PrimitiveKind::Sphere, index: u32::MAX, sides: Sides::Both };
}

/// Rays of columns, and what each leaves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Departing<'a> {
    pub(crate) rays: RayColumns<'a>,
    /// The number of the first of them.
    pub(crate) first: usize,
    pub(crate) left: &'a [Left],
}

/// A ray and a primitive that it may hit.
struct ExactAlone<'a, const W: usize> {
    shapes: &'a Shapes<W>,
    ray: &'a Ray,
    span: Span,
    departure: Option<Departure>,
    sure: &'a Sure,
}

impl<S: Simd, const W: usize> Part<S> for ExactAlone<'_, W> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run(self, simd: S) -> Option<Hit> {
        let Self { shapes, ray, span, departure, sure } = self;
        let Sure { kind, index, sides } = *sure;
        let side = departure.filter(|d| d.kind == kind && d.index == index).map(|d| d.side);
        let t = match kind {
            PrimitiveKind::Sphere => shapes.sphere(index).intersect(ray, span, sides, side),
            PrimitiveKind::Triangle => {
                let probe = Probe::new(Scalar, ray, span, true);
                shapes.triangle(index).intersect(&probe, sides, side)
            }
            PrimitiveKind::Polygon | PrimitiveKind::Cone => {
                // The edges of a polygon are tested several at a time.
                let probe = Probe::new(simd, ray, span, kind == PrimitiveKind::Polygon);
                let column = ColumnRun { kind, sides, range: index..index + 1 };
                shapes.columns.nearest(&probe, &column, departure).map(|hit| hit.t)
            }
        };
        t.map(|t| Hit { t, primitive: shapes.number(kind, index) })
    }
}

impl<const W: usize> Shapes<W> {
    /// The run of a record, and where in it the record stands.
    #[inline(always)]
    pub(crate) fn place_of(&self, record: u32) -> (&Run, u32) {
        (&self.runs()[(record >> PLACE_BITS) as usize], record & ((1 << PLACE_BITS) - 1))
    }

    /// The exact hit of a primitive by a ray that is not prepared.
    #[inline(always)]
    pub(crate) fn exact_alone<S: Simd>(
        &self,
        simd: S,
        (ray, span): (&Ray, Span),
        departure: Option<Departure>,
        sure: &Sure,
    ) -> Option<Hit> {
        simd.outline(ExactAlone { shapes: self, ray, span, departure, sure })
    }
}
