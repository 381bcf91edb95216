//! The primitives of a hierarchy, in the order of its leaves.

use rayset_geometry::{ColumnRun, Departure, PrimitiveColumns, PrimitiveKind, Side, Sides, Sphere, Triangle};
use rayset_simd::Simd;

pub(crate) use self::alone::{Anything, Content, Found, Nearest, OnlySpheres, OnlyTriangles, Traced};
use crate::axes::AxisBlock;
use crate::cells::PolygonCells;
use crate::fans::FanBlock;
use crate::interval::{Intervals, SpanLanes, SphereBlock};
use crate::packet::Mask;
use crate::pairs::Pairs;
use crate::shaft::BoxBlock;
use crate::shear::Shearing;
use crate::triangles::TriangleBlock;

mod alone;
mod arrange;

/// What is hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The distance along the ray, in world units.
    pub t: f64,
    /// The number of the primitive, in the order in which the hierarchy was given them.
    pub primitive: u32,
}

impl Hit {
    /// Whether this hit comes before another in the order `(t, primitive)`.
    #[inline(always)]
    pub(crate) fn precedes(&self, other: &Self) -> bool {
        self.t < other.t || (self.t.total_cmp(&other.t).is_eq() && self.primitive < other.primitive)
    }
}

/// Of what is tested by its `f64` test alone.
const NO_BLOCK: u32 = u32::MAX;

/// Primitives of one kind and visibility in a leaf.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub(crate) kind: PrimitiveKind,
    pub(crate) sides: Sides,
    /// Whether the leaf goes on with the next run.
    pub(crate) goes_on: bool,
    pub(crate) len: u16,
    /// The index of the first among those of its kind.
    pub(crate) first: u32,
    /// The index of the block, unless it is [`NO_BLOCK`].
    block: u32,
    /// The index of the block of boxes, of polygons or cones.
    boxes: u32,
}

/// Polygons in single precision.
#[derive(Clone, Debug)]
pub(crate) enum PolygonBlock<const W: usize> {
    Fans(FanBlock<W>),
    /// One polygon of many vertices.
    Cells(PolygonCells),
}

/// Primitives of any shape, each with the sides it can be hit from.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shapes<const W: usize> {
    runs: Vec<Run>,
    sphere_blocks: Vec<SphereBlock<W>>,
    triangle_blocks: Vec<TriangleBlock<W>>,
    /// Which triangles of each block packets test together: apart from all that single rays read.
    pairs: Vec<Pairs>,
    polygon_blocks: Vec<PolygonBlock<W>>,
    axis_blocks: Vec<AxisBlock<W>>,
    box_blocks: Vec<BoxBlock<W>>,
    spheres: Vec<Sphere>,
    triangles: Vec<Triangle>,
    /// Polygons and cones.
    pub(crate) columns: PrimitiveColumns,
    /// The number of each primitive of a kind.
    numbers: [Vec<u32>; 4],
    /// Whether there is any triangle or polygon: whether a ray needs a shear.
    is_flat: bool,
    /// The only kind there is, if there is one.
    only: Option<PrimitiveKind>,
    /// Where each primitive went.
    places: Vec<Place>,
    /// Whether there are spheres, all of which can be hit from the back.
    spheres_have_backs: bool,
}

/// The index of a primitive among those of its kind, and in the lowest bits the kind: rays look up what they leave, which
/// stands anywhere, so that it is to be small.
#[derive(Clone, Copy, Debug)]
struct Place(u32);

impl Place {
    /// That of what is in no leaf: nobody's.
    const NOWHERE: Self = Self(u32::MAX);

    fn new(kind: PrimitiveKind, index: u32) -> Self {
        assert!(index < 1 << 30, "fewer than 2^30 primitives");
        Self(index << 2 | kind as u32)
    }

    #[inline(always)]
    fn sphere(self) -> Option<u32> {
        (self.0 % 4 == PrimitiveKind::Sphere as u32).then_some(self.0 >> 2)
    }

    #[inline(always)]
    fn departure(self, side: Side) -> Departure {
        const KINDS: [PrimitiveKind; 4] =
            [PrimitiveKind::Sphere, PrimitiveKind::Triangle, PrimitiveKind::Polygon, PrimitiveKind::Cone];
        Departure { kind: KINDS[self.0 as usize % 4], index: self.0 >> 2, side }
    }
}

impl<const W: usize> Shapes<W> {
    /// Whether there is nothing but spheres, or nothing but triangles.
    #[inline(always)]
    pub(crate) fn is_only(&self, kind: PrimitiveKind) -> bool {
        self.only == Some(kind)
    }

    /// Whether there is any triangle or polygon.
    #[inline(always)]
    pub(crate) fn is_flat(&self) -> bool {
        self.is_flat
    }

    /// All runs.
    #[inline(always)]
    pub(crate) fn runs(&self) -> &[Run] {
        &self.runs
    }

    #[inline(always)]
    pub(crate) fn sphere_block(&self, run: &Run) -> &SphereBlock<W> {
        &self.sphere_blocks[run.block as usize]
    }

    #[inline(always)]
    pub(crate) fn triangle_block(&self, run: &Run) -> &TriangleBlock<W> {
        &self.triangle_blocks[run.block as usize]
    }

    /// Which triangles of a run packets test together.
    #[inline(always)]
    pub(crate) fn pairs(&self, run: &Run) -> Pairs {
        self.pairs[run.block as usize]
    }

    #[inline(always)]
    pub(crate) fn sphere(&self, index: u32) -> &Sphere {
        &self.spheres[index as usize]
    }

    #[inline(always)]
    pub(crate) fn triangle(&self, index: u32) -> &Triangle {
        &self.triangles[index as usize]
    }

    /// The triangles of a run, and those after it.
    #[inline(always)]
    pub(crate) fn triangles_of(&self, run: &Run) -> &[Triangle] {
        &self.triangles[run.first as usize..]
    }

    /// The number of a primitive of a kind.
    #[inline(always)]
    pub(crate) fn number(&self, kind: PrimitiveKind, index: u32) -> u32 {
        self.numbers[kind as usize][index as usize]
    }

    /// The numbers of the primitives of a run, and of those after it.
    #[inline(always)]
    pub(crate) fn numbers_of(&self, run: &Run) -> &[u32] {
        &self.numbers[run.kind as usize][run.first as usize..]
    }

    /// What a ray leaves, by its place.
    #[inline(always)]
    pub(crate) fn departure(&self, from: Option<(u32, Side)>) -> Option<Departure> {
        from.map(|(primitive, side)| self.places[primitive as usize].departure(side))
    }

    /// The index of a sphere among the spheres, by its number; `None` if it is none, or in no leaf.
    #[inline(always)]
    pub(crate) fn sphere_of(&self, number: u32) -> Option<u32> {
        self.places[number as usize].sphere()
    }

    /// Whether rays that leave a sphere into its inside meet it again, unless their span ends before.
    #[inline(always)]
    pub(crate) fn can_meet_own(&self) -> bool {
        self.spheres_have_backs
    }

    /// The block of a run of polygons, if they have one, and of cones.
    #[inline(always)]
    pub(crate) fn polygon_block(&self, run: &Run) -> Option<&PolygonBlock<W>> {
        self.polygon_blocks.get(run.block as usize)
    }

    #[inline(always)]
    pub(crate) fn axis_block(&self, run: &Run) -> &AxisBlock<W> {
        &self.axis_blocks[run.block as usize]
    }

    #[inline(always)]
    pub(crate) fn box_block(&self, run: &Run) -> &BoxBlock<W> {
        &self.box_blocks[run.boxes as usize]
    }

    /// How many bytes the primitives take.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&self.runs[..])
            + size_of_val(&self.sphere_blocks[..])
            + size_of_val(&self.triangle_blocks[..])
            + size_of_val(&self.pairs[..])
            + size_of_val(&self.polygon_blocks[..])
            + self.polygon_blocks.iter().map(PolygonBlock::more_bytes).sum::<usize>()
            + size_of_val(&self.axis_blocks[..])
            + size_of_val(&self.box_blocks[..])
            + size_of_val(&self.spheres[..])
            + size_of_val(&self.triangles[..])
            + size_of_val(&self.places[..])
            + self.numbers.iter().map(|numbers| size_of_val(&numbers[..])).sum::<usize>()
            + self.columns.bytes()
    }
}

impl<const W: usize> PolygonBlock<W> {
    /// Where rays, a lane each, hit the polygon at a place, which is `from` so far on, and whose front and back may be hit by
    /// some.
    #[inline(always)]
    pub(crate) fn intervals<S: Simd>(
        &self,
        simd: S,
        place: usize,
        rays: &impl Shearing<S>,
        (span, from): (&SpanLanes<S>, S::F32),
        sides: (Mask<S>, Mask<S>),
    ) -> Intervals<S> {
        match self {
            Self::Fans(fans) => fans.all_intervals(simd, place, rays, (span, from), sides),
            Self::Cells(cells) => cells.intervals(simd, rays, span, sides),
        }
    }

    /// How many bytes it takes beside its own.
    fn more_bytes(&self) -> usize {
        match self {
            Self::Fans(_) => 0,
            Self::Cells(cells) => cells.more_bytes(),
        }
    }
}

impl Run {
    #[inline(always)]
    fn columns(&self) -> ColumnRun {
        ColumnRun { kind: self.kind, sides: self.sides, range: self.first..self.first + u32::from(self.len) }
    }

    /// Whether there is nothing but a plane that a ray leaves, which it never meets again.
    #[inline(always)]
    fn is_left_by(&self, departure: Option<Departure>) -> bool {
        match departure {
            Some(departure) => self.len == 1 && departure.kind == self.kind && departure.index == self.first,
            None => false,
        }
    }

    /// The lanes that may hit the front of one of them, and its back, if some leave it, and some of these into its front.
    #[inline(always)]
    pub(crate) fn hittable<const W: usize>(&self, (leaving, outwards): (u32, u32)) -> (u32, u32) {
        let all = u32::MAX >> (32 - W);
        let front = if self.sides == Sides::Back { 0 } else { all & !leaving };
        let back = match (self.sides, self.kind) {
            (Sides::Front, _) => 0,
            (_, PrimitiveKind::Triangle | PrimitiveKind::Polygon) => all & !leaving,
            _ => all & !outwards,
        };
        (front, back)
    }

    /// One of them.
    #[inline(always)]
    fn column(&self, place: u32) -> ColumnRun {
        let index = self.first + place;
        ColumnRun { kind: self.kind, sides: self.sides, range: index..index + 1 }
    }
}
