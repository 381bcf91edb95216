//! What was found, in double precision: one by one, or a ray and its primitive a lane.

use rayset_geometry::{
    AxesLanes, ColumnRun, Departure, PrimitiveKind, Probe, Ray, RayLanes, ShearedLanes, Side, Sides, Span,
    Sphere, Triangle,
};
use rayset_simd::{LaneMask, Lanes, Part, Scalar, Simd};

use crate::columns::{HitOrNone, Left, RayColumns};
use crate::frame::Frame;
use crate::packet::Packet;
use crate::shapes::{Hit, Run, Shapes};

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

/// So many rays at least are tested together against a sphere; of other shapes preparing one by itself takes as long.
const LEAST_TOGETHER: u32 = 3;

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
        let least = if kind == PrimitiveKind::Sphere { LEAST_TOGETHER } else { 1 };
        let can_go_together = kind != PrimitiveKind::Polygon;
        while can_go_together && lanes >> lane != 0 && first + lane + pairs <= rays.len() {
            let wanted = lanes & (u32::MAX >> (32 - pairs)) << lane;
            if wanted.count_ones() >= least {
                let at = first + lane;
                // A plane is never met again by a ray that leaves it.
                let not_back = if kind == PrimitiveKind::Triangle { leaving } else { outwards };
                let front = if sides == Sides::Back { 0 } else { wanted & !leaving };
                let back = if sides == Sides::Front { 0 } else { wanted & !not_back };
                let sides = (simd.mask_f64(front >> lane), simd.mask_f64(back >> lane));
                let (is_hit, t) = match kind {
                    PrimitiveKind::Triangle => {
                        let (rays, order) = rays.sheared(simd, at);
                        let vertices = order.of_one(simd, shapes.triangle(index));
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
                    _ => {
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

/// Rays of a packet, and the records that they surely hit.
pub(crate) struct ExactSure<'a, S: Simd, const W: usize> {
    pub(crate) exact: &'a Exact<'a, W>,
    pub(crate) packet: &'a Packet<S, W>,
    pub(crate) records: [u32; W],
    /// The lanes that hit one.
    pub(crate) lanes: u32,
    /// Where the hits go.
    pub(crate) found: &'a mut [HitOrNone],
}

impl<S: Simd, const W: usize> Part<S> for ExactSure<'_, S, W> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { exact, packet, records, lanes, found } = self;
        let Exact { shapes, rays, .. } = exact;
        let first = packet.first;
        let pairs = S::F64::LANES;
        let zero = simd.splat_f64(0.0);
        let (mut sure, mut others) = ([Sure::NONE; W], 0);
        let mut lane = 0;
        while lanes >> lane != 0 {
            let mut open = lanes & (u32::MAX >> (32 - pairs)) << lane;
            let is_whole = first + lane + pairs <= rays.len();
            let (mut spheres, mut triangles) = (Wanted::<W>::NONE, Wanted::<W>::NONE);
            let (mut ball, mut vertices) = (([zero; 3], zero), [[zero; 3]; 3]);
            let is_flat = is_whole && open != 0 && !shapes.is_only(PrimitiveKind::Sphere);
            let sheared = if is_flat { Some(rays.sheared(simd, first + lane)) } else { None };
            while open != 0 {
                let record = records[open.trailing_zeros() as usize % W];
                // Rays that hit the same fetch it once.
                let alike = open & simd.equal_u32(&records, record).bits();
                open &= !alike;
                let one = exact.sure(record);
                let mask = simd.mask_f64(alike >> lane);
                if one.kind == PrimitiveKind::Triangle
                    && let Some((_, order)) = &sheared
                {
                    let triangle = order.of_one(simd, shapes.triangle(one.index));
                    if triangles.lanes == 0 {
                        vertices = triangle;
                    } else {
                        for (lanes, coordinate) in
                            vertices.as_flattened_mut().iter_mut().zip(triangle.as_flattened())
                        {
                            *lanes = coordinate.select(mask, *lanes);
                        }
                    }
                    let number = shapes.number(one.kind, one.index);
                    // Who leaves it does not surely hit it.
                    triangles.add_all(alike >> lane, &one, number, [0; 2]);
                } else if one.kind == PrimitiveKind::Sphere && is_whole {
                    let sphere = shapes.sphere(one.index);
                    for (lanes, coordinate) in ball.0.iter_mut().zip(sphere.center().to_array()) {
                        *lanes = simd.splat_f64(coordinate).select(mask, *lanes);
                    }
                    ball.1 = simd.splat_f64(sphere.radius()).select(mask, ball.1);
                    let number = shapes.number(one.kind, one.index);
                    let (leaving, outwards) = packet.leaving(simd, number);
                    spheres.add_all(alike >> lane, &one, number, [leaving >> lane, outwards >> lane]);
                } else {
                    others |= alike;
                    let mut alike = alike;
                    while alike != 0 {
                        sure[alike.trailing_zeros() as usize % W] = one;
                        alike &= alike - 1;
                    }
                }
            }
            if triangles.lanes != 0
                && let Some((rays, _)) = &sheared
            {
                triangles.write_sure(simd, rays, vertices, &mut found[lane..]);
            }
            if spheres.lanes != 0 {
                let LanesOfColumns { rays: pair, span } = rays.lanes(simd, first + lane);
                let hits = Sphere::intersect_pairs(simd, &pair, span, ball, spheres.sides(simd));
                spheres.write(hits, &mut found[lane..]);
            }
            lane += pairs;
        }
        if others != 0 {
            let departing = Departing { rays: **rays, first, left: rays.left_by(first..first + packet.len) };
            shapes.resolve_all(simd, &departing, &sure, others, found);
        }
    }
}

/// Rays of columns, a lane each, and where their spans start and end.
struct LanesOfColumns<S: Simd> {
    rays: RayLanes<S>,
    span: [S::F64; 2],
}

impl RayColumns<'_> {
    /// The rays from one on, of which there are as many as there are lanes.
    #[inline(always)]
    fn lanes<S: Simd>(&self, simd: S, at: usize) -> LanesOfColumns<S> {
        let zero = simd.splat_f64(0.0);
        let mut rays = RayLanes { origin: [zero; 3], direction: [zero; 3] };
        for k in 0..3 {
            rays.origin[k] = simd.load_f64(&self.origins[k][at..]);
            rays.direction[k] = simd.load_f64(&self.directions[k][at..]);
        }
        // A ray is a half-line.
        let start = simd.load_f64(&self.spans.0[at..]).max(zero);
        LanesOfColumns { rays, span: [start, simd.load_f64(&self.spans.1[at..])] }
    }
}

/// In which order the coordinates of triangles are wanted.
enum Order<S: Simd> {
    /// In that of the axes that all rays have.
    Common([usize; 3]),
    /// In that of each ray's own.
    Own(AxesLanes<S>),
}

impl<S: Simd> Order<S> {
    /// The vertices of a triangle, in every lane.
    #[inline(always)]
    fn of_one(&self, simd: S, triangle: &Triangle) -> [[S::F64; 3]; 3] {
        match self {
            Self::Common(axes) => triangle.splat(simd, *axes),
            Self::Own(axes) => axes.order_all(triangle.splat(simd, WORLD)),
        }
    }
}

/// The world's axes, in their order.
const WORLD: [usize; 3] = [0, 1, 2];

impl RayColumns<'_> {
    /// The same sheared, and the order of their axes: most often all have the same.
    #[inline(always)]
    fn sheared<S: Simd>(&self, simd: S, at: usize) -> (ShearedLanes<S>, Order<S>) {
        let LanesOfColumns { rays, span } = self.lanes(simd, at);
        let axes = AxesLanes::of(simd, &rays.direction);
        if let Some(common) = axes.common() {
            let mut ordered = rays;
            for (k, axis) in common.into_iter().enumerate() {
                ordered.origin[k] = simd.load_f64(&self.origins[axis][at..]);
                ordered.direction[k] = simd.load_f64(&self.directions[axis][at..]);
            }
            return (ShearedLanes::of(simd, ordered, span), Order::Common(common));
        }
        let RayLanes { origin, direction } = rays;
        let rays = RayLanes { origin: axes.order(origin), direction: axes.order(direction) };
        (ShearedLanes::of(simd, rays, span), Order::Own(axes))
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

/// The lanes of pairs that are tested, and those whose front and back may be hit.
#[derive(Clone, Copy, Debug)]
struct Wanted<const W: usize> {
    lanes: u32,
    front: u32,
    back: u32,
    /// The numbers of their primitives.
    primitives: [u32; W],
}

impl<const W: usize> Wanted<W> {
    const NONE: Self = Self { lanes: 0, front: 0, back: 0, primitives: [0; W] };

    /// Adds a lane.
    #[inline(always)]
    fn add(&mut self, lane: usize, sure: &Sure, primitive: u32, left: &[Left]) {
        let left = left.get(lane).copied().unwrap_or(Left::NOTHING);
        let outwards = left == Left::of(primitive, Side::Front);
        let leaves = outwards || left == Left::of(primitive, Side::Back);
        let never_again = if sure.kind == PrimitiveKind::Triangle { leaves } else { outwards };
        self.lanes |= 1 << lane;
        self.primitives[lane] = primitive;
        self.front |= u32::from(sure.sides != Sides::Back && !leaves) << lane;
        self.back |= u32::from(sure.sides != Sides::Front && !never_again) << lane;
    }

    /// Adds lanes that hit the same; of all, which leave it so that its front, and its back, is not met again.
    #[inline(always)]
    fn add_all(&mut self, lanes: u32, sure: &Sure, primitive: u32, [front, back]: [u32; 2]) {
        self.lanes |= lanes;
        self.front |= if sure.sides == Sides::Back { 0 } else { lanes & !front };
        self.back |= if sure.sides == Sides::Front { 0 } else { lanes & !back };
        let mut lanes = lanes;
        while lanes != 0 {
            self.primitives[lanes.trailing_zeros() as usize % W] = primitive;
            lanes &= lanes - 1;
        }
    }

    #[inline(always)]
    fn sides<S: Simd>(&self, simd: S) -> (<S::F64 as Lanes>::Mask, <S::F64 as Lanes>::Mask) {
        (simd.mask_f64(self.front), simd.mask_f64(self.back))
    }

    /// Writes the hits of the lanes that were wanted, which surely hit their triangles.
    #[inline(always)]
    fn write_sure<S: Simd>(
        &self,
        simd: S,
        rays: &ShearedLanes<S>,
        vertices: [[S::F64; 3]; 3],
        found: &mut [HitOrNone],
    ) {
        let lanes = simd.mask_f64(self.lanes);
        if cfg!(debug_assertions) {
            self.write(Triangle::intersect_pairs(simd, rays, vertices, self.sides(simd)), found);
        } else {
            self.write((lanes, Triangle::distances_of_pairs(simd, rays, vertices, lanes)), found);
        }
    }

    /// Writes the hits of the lanes that were wanted.
    #[inline(always)]
    fn write<L: Lanes<Scalar = f64>>(&self, (is_hit, t): (L::Mask, L), found: &mut [HitOrNone]) {
        let mut hits = is_hit.bits() & self.lanes;
        debug_assert_eq!(hits, self.lanes, "a sure hit is one");
        let mut distances = [0.0; W];
        t.store(&mut distances);
        while hits != 0 {
            let lane = hits.trailing_zeros() as usize;
            hits &= hits - 1;
            found[lane] = HitOrNone { t: distances[lane], primitive: self.primitives[lane] };
        }
    }
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

    /// The exact hits of rays, each of the primitive that it surely hits; only of those whose bit is set.
    #[inline(always)]
    pub(crate) fn resolve_all<S: Simd>(
        &self,
        simd: S,
        departing: &Departing<'_>,
        sure: &[Sure; W],
        mut lanes: u32,
        found: &mut [HitOrNone],
    ) {
        let Departing { rays, first, left } = *departing;
        let pairs = S::F64::LANES;
        let mut lane = 0;
        while lanes >> lane != 0 && first + lane + pairs <= rays.len() {
            let at = first + lane;
            let wanted = lanes >> lane & (u32::MAX >> (32 - pairs));
            if wanted != 0 {
                let place = (&rays, at, left.get(lane..).unwrap_or(&[]));
                let mut answered = 0;
                if !self.is_only(PrimitiveKind::Triangle) {
                    answered |= self.resolve_spheres(simd, place, &sure[lane..], wanted, &mut found[lane..]);
                }
                if !self.is_only(PrimitiveKind::Sphere) {
                    answered |=
                        self.resolve_triangles(simd, place, &sure[lane..], wanted, &mut found[lane..]);
                }
                lanes &= !(answered << lane);
            }
            lane += pairs;
        }
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let (ray, span) = rays.ray(first + lane);
            let departure = self.departure(left.get(lane).copied().and_then(Left::get));
            found[lane] = self.exact_alone(simd, (&ray, span), departure, &sure[lane]).into();
            debug_assert!(found[lane].get().is_some(), "a sure hit is one");
        }
    }

    /// Where rays that leave a sphere into its inside meet it again, exactly: the lanes that do, of some.
    ///
    /// That bounds what is still to be found; and a ray that asks for any hit has its answer. It is asked where every
    /// sphere can be hit from the same sides: see [`Shapes::can_meet_own`].
    #[inline(always)]
    pub(crate) fn meet_own<S: Simd>(
        &self,
        simd: S,
        departing: &Departing<'_>,
        lanes: u32,
        found: &mut [HitOrNone; W],
        tests: &mut u64,
    ) -> u32 {
        let Departing { rays, first, left } = *departing;
        if Left::all_outwards(left) {
            return 0;
        }
        let (mut inwards, mut indices) = (0, [0; W]);
        for (lane, left) in left.iter().enumerate() {
            if let Some(index) = left.inwards().and_then(|number| self.sphere_of(number)) {
                indices[lane] = index;
                inwards |= 1 << lane;
            }
        }
        let (mut lanes, mut met, mut lane) = (lanes & inwards, 0, 0);
        *tests += u64::from(lanes.count_ones());
        let pairs = S::F64::LANES;
        while lanes >> lane != 0 && first + lane + pairs <= rays.len() {
            let wanted = lanes & (u32::MAX >> (32 - pairs)) << lane;
            if wanted != 0 {
                let LanesOfColumns { rays: pair, span } = rays.lanes(simd, first + lane);
                let sphere = |i: usize| self.sphere(indices[lane + i]);
                let center = [
                    simd.collect_f64(|i| sphere(i).center().x),
                    simd.collect_f64(|i| sphere(i).center().y),
                    simd.collect_f64(|i| sphere(i).center().z),
                ];
                let sphere = (center, simd.collect_f64(|i| sphere(i).radius()));
                // Nothing is between NaN and anything.
                let is_span = simd.load_f64(&rays.spans.0[first + lane..]).le(span[1]);
                let sides = (simd.mask_f64(0), simd.mask_f64(wanted >> lane) & is_span);
                let (is_hit, t) = Sphere::intersect_pairs(simd, &pair, span, sphere, sides);
                let mut distances = [0.0; W];
                t.store(&mut distances);
                let mut hits = is_hit.bits() << lane & wanted;
                met |= hits;
                while hits != 0 {
                    let i = hits.trailing_zeros() as usize % W;
                    hits &= hits - 1;
                    let primitive = self.number(PrimitiveKind::Sphere, indices[i]);
                    found[i] = HitOrNone { t: distances[i - lane], primitive };
                }
                lanes &= !wanted;
            }
            lane += pairs;
        }
        // Too few left in the columns for all lanes.
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % W;
            lanes &= lanes - 1;
            let (ray, span) = rays.ray(first + lane);
            if let Some(hit) = self.own_hit(&ray, span, indices[lane]) {
                found[lane] = hit.into();
                met |= 1 << lane;
            }
        }
        met
    }

    /// Where a ray that leaves a sphere into its inside meets it again, exactly.
    #[inline(always)]
    pub(crate) fn own_hit(&self, ray: &Ray, span: Span, index: u32) -> Option<Hit> {
        let t = self.sphere(index).intersect(ray, span, Sides::Back, Some(Side::Back))?;
        Some(Hit { t, primitive: self.number(PrimitiveKind::Sphere, index) })
    }

    /// Of the lanes that hit spheres, the exact hits; gives these lanes.
    #[inline(always)]
    fn resolve_spheres<S: Simd>(
        &self,
        simd: S,
        (rays, at, left): (&RayColumns<'_>, usize, &[Left]),
        sure: &[Sure],
        lanes: u32,
        found: &mut [HitOrNone],
    ) -> u32 {
        let (mut wanted, mut indices) = (Wanted::NONE, [0; W]);
        self.want(PrimitiveKind::Sphere, left, sure, lanes, &mut wanted, &mut indices);
        if wanted.lanes == 0 {
            return 0;
        }
        let sphere = |lane: usize| self.sphere(indices[lane]);
        let center = [
            simd.collect_f64(|lane| sphere(lane).center().x),
            simd.collect_f64(|lane| sphere(lane).center().y),
            simd.collect_f64(|lane| sphere(lane).center().z),
        ];
        let sphere = (center, simd.collect_f64(|lane| sphere(lane).radius()));
        let LanesOfColumns { rays, span } = rays.lanes(simd, at);
        let hits = Sphere::intersect_pairs(simd, &rays, span, sphere, wanted.sides(simd));
        wanted.write(hits, found);
        wanted.lanes
    }

    /// The same of triangles.
    #[inline(always)]
    fn resolve_triangles<S: Simd>(
        &self,
        simd: S,
        (rays, at, left): (&RayColumns<'_>, usize, &[Left]),
        sure: &[Sure],
        lanes: u32,
        found: &mut [HitOrNone],
    ) -> u32 {
        let (mut wanted, mut indices) = (Wanted::NONE, [0; W]);
        self.want(PrimitiveKind::Triangle, left, sure, lanes, &mut wanted, &mut indices);
        if wanted.lanes == 0 {
            return 0;
        }
        // Of rays that are traced one by one the axes seldom agree, and whether they do is not worth asking.
        let LanesOfColumns { rays: RayLanes { origin, direction }, span } = rays.lanes(simd, at);
        let axes = AxesLanes::of(simd, &direction);
        let rays = RayLanes { origin: axes.order(origin), direction: axes.order(direction) };
        let rays = ShearedLanes::of(simd, rays, span);
        let vertices = axes.order_all(Triangle::collect(simd, &indices.map(|index| self.triangle(index))));
        wanted.write_sure(simd, &rays, vertices, found);
        wanted.lanes
    }

    /// Adds those of some lanes whose hit is of a kind, and of every lane the index of what it hits: of the others, of
    /// anything. In place: given back, both would be copied.
    #[inline(always)]
    fn want(
        &self,
        kind: PrimitiveKind,
        left: &[Left],
        sure: &[Sure],
        mut lanes: u32,
        wanted: &mut Wanted<W>,
        indices: &mut [u32; W],
    ) {
        while lanes != 0 {
            let i = lanes.trailing_zeros() as usize % W;
            lanes &= lanes - 1;
            let sure = &sure[i];
            if sure.kind != kind {
                continue;
            }
            if wanted.lanes == 0 {
                *indices = [sure.index; W];
            }
            indices[i] = sure.index;
            wanted.add(i, sure, self.number(kind, sure.index), left);
        }
    }
}
