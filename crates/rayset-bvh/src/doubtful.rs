//! Rays in doubt about polygons, for tests: aimed at their edges, those of fans too, singly and as packets.

use std::ops::RangeInclusive;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayset_geometry::glam::DVec3;
use rayset_geometry::{BoundingBox, Polygon, Primitive, Ray, Sides, Span};
use rayset_simd::{Backend, Kernel, LaneMask, Lanes, Scalar, Simd};

use crate::cells::{NEAR, PolygonCells};
use crate::columns::RayColumns;
use crate::fans::{FanBlock, fan_len};
use crate::frame::Frame;
use crate::interval::{Intervals, SpanLanes};
use crate::packet::{Approach, Mask, Packet, level};
use crate::ray::{Copies, CullRay, CullRays, Targets};
use crate::shaft::Shaft;
use crate::shapes::PolygonBlock;
use crate::shear::ShearedAlike;

/// At which polygons rays are aimed, and with which margins they are tested.
#[derive(Clone, Debug)]
pub(crate) struct Aimed {
    pub(crate) vertices: RangeInclusive<usize>,
    /// By what the margins are multiplied.
    pub(crate) factor: f32,
    /// How near to a cell an edge leaves it in doubt, in cells.
    pub(crate) near: f64,
}

/// How often the answer in single precision contradicts the exact one, and how often it is sure.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    lost: u32,
    false_sure: u32,
    out_of_interval: u32,
    pub(crate) sure: u32,
    pub(crate) hits: u32,
    /// How many rays single precision passed over.
    pub(crate) passed_over: u32,
}

impl Aimed {
    /// At polygons of so many vertices, with the margins as they are.
    pub(crate) fn at(vertices: RangeInclusive<usize>) -> Self {
        Self { vertices, factor: 1.0, near: NEAR }
    }
}

impl Tally {
    /// How many hits are lost, how many sure ones are none, and how many lie elsewhere.
    pub(crate) fn wrong(&self) -> [u32; 3] {
        [self.lost, self.false_sure, self.out_of_interval]
    }

    /// Takes in what single precision says of a ray: nothing, or between which distances it may hit, and whether it must.
    fn add(&mut self, found: Option<(f32, f32, bool)>, exact: Option<[f32; 2]>) {
        self.hits += u32::from(exact.is_some());
        let Some((low, high, is_sure)) = found else {
            self.lost += u32::from(exact.is_some());
            self.passed_over += 1;
            return;
        };
        self.sure += u32::from(is_sure);
        match exact {
            Some([below, above]) => {
                self.out_of_interval += u32::from(!(low <= above && high >= below));
            }
            None => self.false_sure += u32::from(is_sure),
        }
    }
}

/// What comes of it, on every backend.
pub(crate) fn tally_of(aimed: &Aimed) -> impl Iterator<Item = (Backend, Tally)> {
    Backend::available().iter().map(move |&backend| (backend, backend.run(Doubtful(aimed.clone()))))
}

struct Doubtful(Aimed);

struct Dice(ChaCha8Rng);

impl Dice {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * f64::from(self.0.next_u32()) / f64::from(u32::MAX)
    }
    fn point(&mut self) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| self.within(-1.0, 1.0)))
    }
    fn pick<const N: usize>(&mut self, values: [f64; N]) -> f64 {
        values[self.0.next_u32() as usize % N]
    }

    /// The corners of a polygon: convex, concave, one that crosses itself, or battlements along two axes.
    fn corners(&mut self, case: usize, n: usize) -> (DVec3, Vec<DVec3>) {
        let size = 0.3 * self.pick([1.0, 0.3, 0.1, 1e-2]);
        let (center, mut x, mut y) = (0.6 * self.point(), size * self.point(), size * self.point());
        if case.is_multiple_of(7) {
            // Seen from above or below, all its vertices have one depth.
            (x.z, y.z) = (0.0, 0.0);
        }
        if case % 4 == 3 {
            let [right, up] = [DVec3::X * x.x, DVec3::Y * y.y];
            let half = n.div_ceil(2);
            let step = |i: usize| 2.0 * (i / 2) as f64 / half as f64 - 1.0;
            let at = |i: usize, height: f64| center + step(i) * right + height * up;
            let top = (0..half).map(|i| at(i, if (i / 2) % 2 == 0 { 1.0 } else { 0.6 }));
            return (center, top.chain((0..n - half).rev().map(|i| at(i, -1.0))).collect());
        }
        let turns = if case % 4 == 2 { 2.3 } else { 1.0 };
        let off = self.pick([0.0, 0.0, 1e-6, 5e-4, 5e-4, 1e-3]);
        let (mut c, mut s) = (1.0, 0.0);
        let corners = (0..n).map(|_| {
            // Turned on, by the tangent of half the angle.
            let half = self.within(0.0, turns * 6.0 / n as f64);
            let [cosine, sine] = [1.0 - half * half, 2.0 * half].map(|x| x / (1.0 + half * half));
            (c, s) = (c * cosine - s * sine, s * cosine + c * sine);
            let reach = if case.is_multiple_of(4) { 1.0 } else { self.within(0.1, 1.0) };
            center + reach * (c * x + s * y) + off * size * self.point()
        });
        (center, corners.collect())
    }
}

impl Kernel for Doubtful {
    type Output = Tally;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Tally {
        let aimed = self.0;
        let mut dice = Dice(ChaCha8Rng::seed_from_u64(7));
        let mut tally = Tally::default();
        let numbers = aimed.vertices.clone().count();
        for case in 0..60_000 {
            let (scale, shift) = (dice.pick([1.0, 0.3, 1e4]), dice.point() * dice.pick([0.0, 1.0, 1e3]));
            let place = |p: DVec3| scale * (p + shift);
            let frame = Frame::of(&BoundingBox { min: place(DVec3::NEG_ONE), max: place(DVec3::ONE) });
            let n = aimed.vertices.start() + case % numbers;
            let (center, corners) = dice.corners(case / 3, n);
            let Some(polygon) = Polygon::new(corners.iter().map(|&corner| place(corner)).collect()) else {
                continue;
            };
            let first = dice.0.next_u32() as usize % n;
            let second = if case % 2 == 0 { (first + 1) % n } else { dice.0.next_u32() as usize % n };
            let (p, q) = (corners[if case % 3 == 0 { 0 } else { first }], corners[second]);
            let offset = dice.pick([0.0, 1e-8, -1e-8, 1e-7, -1e-7, 1e-6, 1e-3, 0.1, 0.02, -0.02]);
            let target = p + dice.within(0.0, 1.0) * (q - p) + offset * (center - p);
            let far = dice.pick([1.0, 3.0, 50.0]) * dice.point();
            // From nearby, where coordinates are long beside distances; or nearly in the plane.
            let eye = match case % 7 {
                0 => target + 1e-2 * (DVec3::Z + 0.5 * dice.point()),
                1..=3 => {
                    let along = dice.point().reject_from(polygon.normal());
                    target + along + dice.pick([1e-5, 1e-4, 1e-3, 1e-2, 3e-2, 0.1]) * polygon.normal()
                }
                _ => far,
            };
            let Some(ray) = Ray::between(place(eye), place(target)) else { continue };
            // Most rays go on; some spans end where they hit, or begin there.
            let t = Primitive::from(polygon.clone()).intersect(&ray, Span::FORWARD, Sides::Both, None);
            let span = match (case % 5, t) {
                (0, Some(t)) => Span { end: t, ..Span::FORWARD },
                (1, Some(t)) => Span { start: t, ..Span::FORWARD },
                (2, Some(t)) => Span { start: t * (1.0 - 1e-8), end: t * (1.0 + 1e-8) },
                _ => Span::FORWARD,
            };
            let others = ray.direction() + dice.pick([0.0, 0.8]) * dice.point();
            let tested = Tested { aimed: &aimed, polygon: &polygon, ray: &ray, span, others, frame: &frame };
            if S::F32::LANES == 16 {
                tested.test::<S, 16>(simd, &mut tally);
            } else {
                tested.test::<S, 8>(simd, &mut tally);
            }
        }
        tally
    }
}

/// A ray and a polygon.
struct Tested<'a> {
    aimed: &'a Aimed,
    polygon: &'a Polygon,
    ray: &'a Ray,
    span: Span,
    /// Which way others of a packet go.
    others: DVec3,
    frame: &'a Frame,
}

impl Tested<'_> {
    fn test<S: Simd, const W: usize>(&self, simd: S, tally: &mut Tally) {
        let Self { aimed, polygon, ray, span, frame, .. } = *self;
        let points: Vec<DVec3> = polygon.vertices().iter().map(|&vertex| frame.point(vertex)).collect();
        let block = if fan_len(points.len(), W).is_some() {
            let mut block = FanBlock::<W>::EMPTY;
            let after = block.set(1, 3, &points, polygon.normal());
            assert_eq!(after, points.len() - 1);
            PolygonBlock::Fans(block)
        } else {
            match PolygonCells::with(&points, polygon.normal(), frame, aimed.near) {
                Some(cells) => PolygonBlock::Cells(cells),
                None => return,
            }
        };
        let primitive = Primitive::from(polygon.clone());
        for sides in [Sides::Both, Sides::Front, Sides::Back] {
            let exact = primitive.intersect(ray, span, sides, None);
            let copies = Copies::<8>::of(ray, span);
            let mut rays = CullRays::<8>::alone(Scalar, frame, &copies.columns(), Targets::FLAT);
            rays.loosen(aimed.factor);
            if let Some(cull) = rays.ray(0) {
                let found = alone(simd, &block, cull, sides);
                tally.add(found, exact.map(|t| [cull.below(t), cull.end(t)]));
            }
            self.test_together(simd, &block, sides, exact, tally);
        }
    }

    /// The same of a packet whose last ray it is.
    fn test_together<S: Simd, const W: usize>(
        &self,
        simd: S,
        block: &PolygonBlock<W>,
        sides: Sides,
        exact: Option<f64>,
        tally: &mut Tally,
    ) {
        let Self { aimed, ray, span, others, frame, .. } = *self;
        let others = others.normalize_or_zero();
        let column = |value: f64| [value; W];
        let origins = ray.origin().to_array().map(column);
        let mut directions = others.to_array().map(column);
        for (column, component) in directions.iter_mut().zip(ray.direction().to_array()) {
            column[W - 1] = component;
        }
        let rays = RayColumns {
            origins: origins.each_ref().map(|column| &column[..]),
            directions: directions.each_ref().map(|column| &column[..]),
            spans: (&[span.start; W], &[span.end; W]),
            left: &[],
        };
        let approach = Approach::of(frame, &rays, 0..W, true);
        let mut packet = [Packet::<S, W>::new(simd, 0, W, &approach)];
        let Some(units) = level(simd, &mut packet, &approach) else { return };
        let Some(mut shaft) = Shaft::around(simd, &mut packet, units, &approach) else { return };
        shaft.rounding = shaft.rounding.times(aimed.factor);
        let packet = &packet[0];
        let (axes, shears) = (shaft.beam.axes, packet.shears);
        let rays = ShearedAlike { axes, shears, rounding: shaft.rounding };
        let sides = masks(simd, sides, u32::MAX >> (32 - W));
        let at = block.intervals(simd, 3, &rays, (&packet.span(), packet.start), sides);
        let is = |lanes: Mask<S>| lanes.bits() >> (W - 1) == 1;
        let found = is(at.possible).then(|| interval(&at, W - 1, is(at.sure)));
        tally.add(found, exact.map(|t| [packet.below(frame, t), packet.above(frame, t)]));
    }
}

/// What a ray by itself finds.
fn alone<S: Simd, const W: usize>(
    simd: S,
    block: &PolygonBlock<W>,
    cull: CullRay<'_, 8>,
    sides: Sides,
) -> Option<(f32, f32, bool)> {
    match block {
        PolygonBlock::Fans(block) => {
            let mut fans = block.test(simd, cull)?;
            let found = block.next(&mut fans);
            assert!(found.is_none_or(|polygon| polygon.place == 3));
            assert!(block.next(&mut fans).is_none(), "there is one polygon");
            let polygon = found?;
            let is_met =
                (polygon.is_front && sides != Sides::Back) || (polygon.is_back && sides != Sides::Front);
            let is_within = polygon.low > cull.start_above() && polygon.high < cull.end_below();
            Some((polygon.low, polygon.high, is_met && is_within))
        }
        PolygonBlock::Cells(cells) => {
            let rays = cull.sheared(simd);
            let span = SpanLanes::of(simd, cull, cull.end_above());
            let at = cells.intervals(simd, &rays, &span, masks(simd, sides, 1));
            at.possible.any().then(|| interval(&at, 0, at.sure.any()))
        }
    }
}

/// What is said of a lane: where it ends only if it is sure.
fn interval<S: Simd>(at: &Intervals<S>, lane: usize, is_sure: bool) -> (f32, f32, bool) {
    (at.low.lane(lane), if is_sure { at.high.lane(lane) } else { f32::INFINITY }, is_sure)
}

/// The lanes that may hit the front, and those that may hit the back.
fn masks<S: Simd>(simd: S, sides: Sides, lanes: u32) -> (Mask<S>, Mask<S>) {
    let front = if sides == Sides::Back { 0 } else { lanes };
    let back = if sides == Sides::Front { 0 } else { lanes };
    (simd.mask_f32(front), simd.mask_f32(back))
}
