//! Hits that single precision is sure of, where they are exactly: a ray and its primitive a lane.

use rayset_geometry::{AxesLanes, PrimitiveKind, RayLanes, ShearedLanes, Side, Sides, Sphere, Triangle};
use rayset_simd::{CullLanes, LaneMask, Lanes, Part, Simd};

use super::lanes::{LanesOfColumns, in_order};
use super::{Departing, Exact, Sure, least_together};
use crate::columns::{HitOrNone, Left, RayColumns};
use crate::packet::Packet;
use crate::shapes::Shapes;

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
        // The bits of the number of what each lane hits.
        let mut numbers = simd.splat_f32(0.0);
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
                    let triangle = in_order(simd, order, shapes.triangle(one.index));
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
                    simd.splat_f32(f32::from_bits(number)).put(simd.mask_f32(alike), &mut numbers);
                    // Who leaves it does not surely hit it.
                    triangles.add_all(alike >> lane, &one, [0; 2]);
                } else if one.kind == PrimitiveKind::Sphere && is_whole {
                    let sphere = shapes.sphere(one.index);
                    for (lanes, coordinate) in ball.0.iter_mut().zip(sphere.center().to_array()) {
                        *lanes = simd.splat_f64(coordinate).select(mask, *lanes);
                    }
                    ball.1 = simd.splat_f64(sphere.radius()).select(mask, ball.1);
                    let number = shapes.number(one.kind, one.index);
                    let (leaving, outwards) = packet.leaving(simd, number);
                    simd.splat_f32(f32::from_bits(number)).put(simd.mask_f32(alike), &mut numbers);
                    spheres.add_all(alike >> lane, &one, [leaving >> lane, outwards >> lane]);
                } else if is_whole
                    && matches!(one.kind, PrimitiveKind::Polygon | PrimitiveKind::Cone)
                    && alike.count_ones() >= least_together(one.kind)
                {
                    let (leaving, outwards) = packet.leaving(simd, shapes.number(one.kind, one.index));
                    let mut wanted = Wanted::NONE;
                    wanted.add_all(alike >> lane, &one, [leaving >> lane, outwards >> lane]);
                    let place = (*rays, first + lane);
                    shapes.write_alike(simd, place, &one, wanted, &mut found[lane..]);
                } else {
                    others |= alike;
                    let mut alike = alike;
                    while alike != 0 {
                        sure[alike.trailing_zeros() as usize % W] = one;
                        alike &= alike - 1;
                    }
                }
            }
            let mut bits = [0.0; W];
            numbers.store(&mut bits);
            let numbers = bits.map(f32::to_bits);
            for wanted in [&mut triangles, &mut spheres] {
                wanted.primitives[..pairs].copy_from_slice(&numbers[lane..lane + pairs]);
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

/// A polygon or a cone, and rays that surely hit it.
struct AlikeByRays<'a, S: Simd, const W: usize> {
    shapes: &'a Shapes<W>,
    one: &'a Sure,
    rays: &'a RayColumns<'a>,
    /// The number of the first.
    at: usize,
    sides: (<S::F64 as Lanes>::Mask, <S::F64 as Lanes>::Mask),
}

impl<S: Simd, const W: usize> Part<S> for AlikeByRays<'_, S, W> {
    type Output = (<S::F64 as Lanes>::Mask, S::F64);

    #[inline(always)]
    fn run(self, simd: S) -> Self::Output {
        let Self { shapes, one, rays, at, sides } = self;
        if one.kind == PrimitiveKind::Cone {
            let LanesOfColumns { rays, span } = rays.lanes(simd, at);
            return shapes.columns.cone_by_rays(simd, one.index, &rays, span, sides);
        }
        let (rays, order) = rays.sheared(simd, at);
        shapes.columns.polygon_by_rays(simd, one.index, (&rays, &order), sides)
    }
}

/// Rays from one on, what each leaves, and the polygons and cones that some lanes surely hit.
struct ResolveAlike<'a, 'r, const W: usize> {
    shapes: &'a Shapes<W>,
    place: (&'a RayColumns<'r>, usize, &'a [Left]),
    sure: &'a [Sure],
    lanes: u32,
    found: &'a mut [HitOrNone],
}

impl<S: Simd, const W: usize> Part<S> for ResolveAlike<'_, '_, W> {
    type Output = u32;

    /// Writes the exact hits of what is hit by enough of them to go together; gives these lanes.
    #[inline(always)]
    fn run(self, simd: S) -> u32 {
        let Self { shapes, place: (rays, at, left), sure, mut lanes, found } = self;
        let mut answered = 0;
        while lanes != 0 {
            let one = &sure[lanes.trailing_zeros() as usize];
            let number = shapes.number(one.kind, one.index);
            let (mut wanted, mut rest) = (Wanted::<W>::NONE, lanes);
            while rest != 0 {
                let lane = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                if sure[lane] == *one {
                    wanted.add(lane, one, number, left);
                }
            }
            lanes &= !wanted.lanes;
            if wanted.lanes.count_ones() >= least_together(one.kind) {
                answered |= wanted.lanes;
                shapes.write_alike(simd, (rays, at), one, wanted, found);
            }
        }
        answered
    }
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

    /// Adds lanes that hit the same, but for its number; of all, which leave it so that its front, and its back, is not
    /// met again.
    #[inline(always)]
    fn add_all(&mut self, lanes: u32, sure: &Sure, [front, back]: [u32; 2]) {
        self.lanes |= lanes;
        self.front |= if sure.sides == Sides::Back { 0 } else { lanes & !front };
        self.back |= if sure.sides == Sides::Front { 0 } else { lanes & !back };
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
        let hit = |lane: usize| HitOrNone { t: distances[lane], primitive: self.primitives[lane] };
        if hits == u32::MAX >> (32 - L::LANES)
            && let Some(places) = found.get_mut(..L::LANES)
        {
            // How many they are is not guessed where it is all.
            for (lane, place) in places.iter_mut().enumerate() {
                *place = hit(lane);
            }
            return;
        }
        while hits != 0 {
            let lane = hits.trailing_zeros() as usize;
            hits &= hits - 1;
            found[lane] = hit(lane);
        }
    }
}

impl<const W: usize> Shapes<W> {
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
                let rest = wanted & !answered;
                if rest != 0 {
                    let (sure, found) = (&sure[lane..], &mut found[lane..]);
                    answered |= simd.outline(ResolveAlike { shapes: self, place, sure, lanes: rest, found });
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

    /// Writes the hits of rays, some lanes that surely hit the same polygon or cone.
    #[inline(always)]
    fn write_alike<S: Simd>(
        &self,
        simd: S,
        (rays, at): (&RayColumns<'_>, usize),
        one: &Sure,
        mut wanted: Wanted<W>,
        found: &mut [HitOrNone],
    ) {
        wanted.primitives = [self.number(one.kind, one.index); W];
        let sides = wanted.sides(simd);
        let hits = simd.outline(AlikeByRays { shapes: self, one, rays, at, sides });
        wanted.write(hits, found);
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
