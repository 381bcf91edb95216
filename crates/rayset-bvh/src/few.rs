//! Few spheres: so few that a tree has nothing to spare, and every ray is tested against each of them.
//!
//! As many rays at a time as there are lanes of double precision, each sphere in turn: exact at once.
//! (With eight spheres, culling the one leaf there is and deciding afterwards took three times as long.)
//! In bundles, a cone round a block of rays shows which spheres none of them can meet; and of some hundred spheres, by
//! balls that hold neighbours, whether those that are left are few.

use std::ops::Range;

use rayset_geometry::glam::DVec3;
use rayset_geometry::{BoundingSphere, Primitive, PrimitiveKind, RayLanes, Sides, Sphere, enclosing_sphere};
use rayset_simd::{LaneMask, Lanes, MAX_LANES, Part, Simd};

use crate::Hit;
use crate::columns::{HitOrNone, Left, RayColumns};
use crate::cone::Cone;
use crate::each::{AnyHit, NearestHit, OfRay};
use crate::shapes::Shapes;
use crate::trial::Trial;

/// How many spheres are few.
const FEW: usize = 8;
/// Of how many spheres cones may leave few. (Of 1024 cones leave few for initial
/// rays only, and what they cost the others takes back what these gain.)
const FEW_IN_CONES: usize = 512;
/// How many spheres a group has, but for the last.
const GROUP: usize = 8;

/// All spheres of a hierarchy that are few, or may be few in cones.
#[derive(Clone, Debug, Default)]
pub(crate) struct Few {
    /// In the order of their numbers if they are few, else in that of the leaves, so that neighbours form groups.
    spheres: Vec<FewSphere>,
    columns: Balls,
    /// The balls that hold a group of spheres each.
    groups: Balls,
}

/// Balls as columns, with zeros after them up to whole groups.
#[derive(Clone, Debug, Default)]
struct Balls {
    centers: [Vec<f64>; 3],
    radii: Vec<f64>,
    len: usize,
}

/// Few spheres, by their places.
#[derive(Clone, Copy, Debug)]
struct Chosen {
    places: [usize; FEW],
    len: usize,
}

/// A sphere, the sides it can be hit from, and its number.
#[derive(Clone, Debug)]
struct FewSphere {
    sphere: Sphere,
    sides: Sides,
    number: u32,
}

/// What is asked about rays, of few spheres.
pub(crate) trait OfFew: OfRay {
    /// What is known of the rays in lanes.
    type Known<S: Simd>: Copy;
    fn nothing<S: Simd>(self, simd: S) -> Self::Known<S>;
    /// Takes in the lanes that hit a sphere, and where; whether all is known.
    fn take<S: Simd>(
        self,
        simd: S,
        known: &mut Self::Known<S>,
        hit: (<S::F64 as Lanes>::Mask, S::F64),
        number: u32,
    ) -> bool;
    /// Writes what is known of the rays in lanes from one on, as many as there are places.
    fn write<S: Simd>(self, known: &Self::Known<S>, lane: usize, places: &mut [Self::Answer]);
    /// The answer to one ray, by its hits in increasing order of numbers.
    fn one(self, hits: impl Iterator<Item = Hit>) -> Self::Answer;
}

/// Rays against few spheres.
pub(crate) struct EachOfFew<'a, Q: OfFew> {
    pub(crate) few: &'a Few,
    pub(crate) question: Q,
    pub(crate) columns: RayColumns<'a>,
    pub(crate) range: Range<usize>,
    pub(crate) places: &'a mut [Q::Answer],
}

/// The same, block by block, each against the spheres that a cone round it may meet, up to one that may meet too many.
pub(crate) struct BlocksOfFew<'a, Q: OfFew> {
    pub(crate) each: EachOfFew<'a, Q>,
    pub(crate) trial: &'a mut Trial,
}

/// What was done for blocks of rays.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Done {
    /// How many rays were answered.
    pub(crate) rays: usize,
    /// How many rays had a cone that was worth it.
    pub(crate) in_cones: u64,
    /// How many tests of a ray against a sphere there were.
    pub(crate) tests: u64,
}

/// How many rays share a cone: a tile. (With 64, which miss a few spheres more, frames took a tenth longer.)
pub(crate) const BLOCK: usize = 256;
/// What a cone costs, in quarters of a test of its rays against one sphere.
const CONE_COST: u64 = 5;

impl<const W: usize> Shapes<W> {
    /// All there is, if that is spheres of which cones may leave few.
    pub(crate) fn few_spheres(&self) -> Few {
        let is_few = self.is_only(PrimitiveKind::Sphere)
            && self.runs().iter().map(|run| usize::from(run.len)).sum::<usize>() <= FEW_IN_CONES;
        if !is_few {
            return Few::default();
        }
        let of_run = self.runs().iter().flat_map(|run| {
            (run.first..run.first + u32::from(run.len)).map(|index| FewSphere {
                sphere: *self.sphere(index),
                sides: run.sides,
                number: self.number(PrimitiveKind::Sphere, index),
            })
        });
        let mut spheres: Vec<_> = of_run.collect();
        if spheres.len() <= FEW {
            spheres.sort_by_key(|sphere| sphere.number);
        }
        let balls: Vec<_> = spheres.iter().map(|few| few.sphere.bounding_sphere()).collect();
        let groups: Vec<_> = balls.chunks(GROUP).map(ball_around).collect();
        Few { spheres, columns: Balls::of(&balls), groups: Balls::of(&groups) }
    }
}

/// A ball that holds some; all space, where squares overflow.
fn ball_around(balls: &[BoundingSphere]) -> BoundingSphere {
    let spheres = balls.iter().map(|ball| Primitive::from(Sphere::new(ball.center, ball.radius)));
    let ball = enclosing_sphere(&spheres.collect::<Vec<_>>());
    let is_finite = ball.center.is_finite() && ball.radius.is_finite();
    if is_finite { ball } else { BoundingSphere { center: DVec3::ZERO, radius: f64::INFINITY } }
}

impl Balls {
    fn of(balls: &[BoundingSphere]) -> Self {
        let column = |of: &dyn Fn(&BoundingSphere) -> f64| {
            let mut column: Vec<_> = balls.iter().map(of).collect();
            column.resize(balls.len().next_multiple_of(GROUP), 0.0);
            column
        };
        let centers = [0, 1, 2].map(|k| column(&|ball| ball.center[k]));
        Self { centers, radii: column(&|ball| ball.radius), len: balls.len() }
    }

    /// Those of a group of balls, as bits, that some rays may meet.
    #[inline(always)]
    fn may_be_met<S: Simd>(&self, simd: S, cone: &Cone, first: usize) -> u32 {
        let mut met = 0;
        for lane in (0..GROUP).step_by(S::F64::LANES) {
            let at = first + lane;
            let centers = [
                simd.load_f64(&self.centers[0][at..]),
                simd.load_f64(&self.centers[1][at..]),
                simd.load_f64(&self.centers[2][at..]),
            ];
            met |= cone.may_meet(simd, centers, simd.load_f64(&self.radii[at..]), 1.0) << lane;
        }
        met & (u32::MAX >> (32 - (self.len - first).min(GROUP)))
    }
}

impl Few {
    /// Whether every ray is tested against each, and none goes through the tree.
    pub(crate) fn replace_tree(&self) -> bool {
        (1..=FEW).contains(&self.len())
    }

    pub(crate) fn len(&self) -> usize {
        self.spheres.len()
    }

    /// Whether cones can be worth it: they cost more than one sphere.
    pub(crate) fn suit_cones(&self) -> bool {
        4 * self.len() as u64 > 2 * CONE_COST
    }

    /// All spheres, which are few.
    fn all(&self) -> Chosen {
        Chosen { places: std::array::from_fn(|place| place), len: self.len() }
    }

    /// The spheres that some rays may meet, by a cone round them, if they are few.
    #[inline(always)]
    fn may_be_met<S: Simd>(&self, simd: S, columns: &RayColumns<'_>, range: Range<usize>) -> Option<Chosen> {
        let Some(cone) = Cone::around(simd, columns, range, 1.0) else {
            return self.replace_tree().then(|| self.all());
        };
        let mut chosen = Chosen { places: [0; FEW], len: 0 };
        for first in (0..self.groups.len).step_by(GROUP) {
            let is_only_group = self.groups.len == 1;
            let mut groups = if is_only_group { 1 } else { self.groups.may_be_met(simd, &cone, first) };
            while groups != 0 {
                let group = GROUP * (first + groups.trailing_zeros() as usize);
                groups &= groups - 1;
                let mut spheres = self.columns.may_be_met(simd, &cone, group);
                if chosen.len + spheres.count_ones() as usize > FEW {
                    return None;
                }
                while spheres != 0 {
                    chosen.places[chosen.len] = group + spheres.trailing_zeros() as usize;
                    chosen.len += 1;
                    spheres &= spheres - 1;
                }
            }
        }
        if !self.replace_tree() {
            let number = |&place: &usize| self.spheres[place].number;
            chosen.places[..chosen.len].sort_unstable_by_key(number);
        }
        Some(chosen)
    }
}

impl<S: Simd, Q: OfFew> Part<S> for EachOfFew<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let Self { few, question, columns, range, places } = self;
        few.ask(simd, few.all(), question, &columns, range, places);
    }
}

impl<S: Simd, Q: OfFew> Part<S> for BlocksOfFew<'_, Q> {
    type Output = Done;

    #[inline(always)]
    fn run(self, simd: S) -> Done {
        let Self { each: EachOfFew { few, question, columns, range, places }, trial } = self;
        let mut done = Done::default();
        for start in range.clone().step_by(BLOCK) {
            let block = start..range.end.min(start + BLOCK);
            let rays = block.len();
            let mut chosen = few.replace_tree().then(|| few.all());
            let mut saved = 0;
            if rays >= S::F64::LANES && trial.is_due() {
                chosen = few.may_be_met(simd, &columns, block.clone());
                saved = match (&chosen, few.replace_tree()) {
                    (None, _) => 0,
                    (Some(chosen), true) => 4 * (few.len() - chosen.len) as u64,
                    // A tree takes longer than the tests of few.
                    (Some(_), false) => 2 * CONE_COST,
                };
                trial.end(CONE_COST, saved);
            }
            let Some(chosen) = chosen else { break };
            done.rays += rays;
            done.in_cones += if saved >= CONE_COST { rays as u64 } else { 0 };
            done.tests += (rays * chosen.len) as u64;
            few.ask(simd, chosen, question, &columns, block, places);
        }
        done
    }
}

impl Few {
    /// Answers some rays, which meet no spheres but the chosen.
    #[inline(always)]
    fn ask<S: Simd, Q: OfFew>(
        &self,
        simd: S,
        chosen: Chosen,
        question: Q,
        columns: &RayColumns<'_>,
        range: Range<usize>,
        places: &mut [Q::Answer],
    ) {
        if chosen.len == 0 {
            places[range].fill(Q::UNKNOWN);
        } else if columns.left.is_empty() {
            self.ask_of::<S, Q, false>(simd, chosen, question, columns, range, places);
        } else {
            self.ask_of::<S, Q, true>(simd, chosen, question, columns, range, places);
        }
    }

    /// The same, of rays that may leave something, or leave nothing.
    #[inline(always)]
    fn ask_of<S: Simd, Q: OfFew, const LEAVE: bool>(
        &self,
        simd: S,
        mut chosen: Chosen,
        question: Q,
        columns: &RayColumns<'_>,
        range: Range<usize>,
        places: &mut [Q::Answer],
    ) {
        let lanes = S::F64::LANES;
        let Range { start: mut first, end } = range;
        assert!(end <= columns.len() && end <= places.len(), "there are these rays");
        while first < end && first + lanes <= columns.len() {
            let known = self.known_of::<S, Q, LEAVE>(simd, &mut chosen, question, columns, first);
            let len = lanes.min(end - first);
            question.write::<S>(&known, 0, &mut places[first..first + len]);
            first += len;
        }
        if first == end {
            return;
        }
        // Too few are left in the columns for all lanes: some before them go once more.
        if let Some(last) = columns.len().checked_sub(lanes) {
            let known = self.known_of::<S, Q, LEAVE>(simd, &mut chosen, question, columns, last);
            question.write::<S>(&known, first - last, &mut places[first..end]);
            return;
        }
        for (i, place) in (first..end).zip(&mut places[first..]) {
            let (ray, span) = columns.ray(i);
            let left = columns.left(i);
            let spheres = chosen.places[..chosen.len].iter().map(|&place| &self.spheres[place]);
            *place = question.one(spheres.filter_map(|FewSphere { sphere, sides, number }| {
                let departure = left.filter(|left| left.0 == *number).map(|left| left.1);
                let t = sphere.intersect(&ray, span, *sides, departure)?;
                Some(Hit { t, primitive: *number })
            }));
        }
    }

    /// What is known of rays in lanes, from one of the columns on, once they are tested against the chosen spheres. The one
    /// that tells all there is to know, of rays that ask for any hit, is asked first about the next.
    #[inline(always)]
    fn known_of<S: Simd, Q: OfFew, const LEAVE: bool>(
        &self,
        simd: S,
        chosen: &mut Chosen,
        question: Q,
        columns: &RayColumns<'_>,
        first: usize,
    ) -> Q::Known<S> {
        let all = u32::MAX >> (32 - S::F64::LANES);
        let zero = simd.splat_f64(0.0);
        let mut rays = RayLanes { origin: [zero; 3], direction: [zero; 3] };
        for k in 0..3 {
            rays.origin[k] = simd.load_f64(&columns.origins[k][first..]);
            rays.direction[k] = simd.load_f64(&columns.directions[k][first..]);
        }
        // A ray is a half-line.
        let start = simd.load_f64(&columns.spans.0[first..]);
        let span = [zero.select(start.lt(zero), start), simd.load_f64(&columns.spans.1[first..])];
        let left = if LEAVE { Some(LeftBy::of(simd, columns, first)) } else { None };
        let mut known = question.nothing(simd);
        for i in 0..chosen.len {
            let FewSphere { sphere, sides, number } = &self.spheres[chosen.places[i % FEW]];
            let (leaving, outwards) = match &left {
                Some(left) => left.by(simd, *number),
                None => (0, 0),
            };
            let front = if *sides == Sides::Back { 0 } else { !leaving };
            let back = if *sides == Sides::Front { 0 } else { !outwards };
            if LEAVE && (front | back) & all == 0 {
                // All leave it, and can meet neither side of it again.
                continue;
            }
            let center = sphere.center();
            let center = [simd.splat_f64(center.x), simd.splat_f64(center.y), simd.splat_f64(center.z)];
            let sphere = (center, simd.splat_f64(sphere.radius()));
            let allowed = (simd.mask_f64(front), simd.mask_f64(back));
            let hit = Sphere::intersect_pairs(simd, &rays, span, sphere, allowed);
            if question.take(simd, &mut known, hit, *number) {
                chosen.places.swap(0, i % FEW);
                break;
            }
        }
        known
    }
}

/// What rays in lanes leave.
struct LeftBy {
    primitives: [u32; MAX_LANES],
    /// The lanes that leave something into its front.
    front: u32,
}

impl LeftBy {
    #[inline(always)]
    fn of<S: Simd>(simd: S, columns: &RayColumns<'_>, first: usize) -> Self {
        let mut left = [Left::NOTHING; MAX_LANES];
        let lanes = S::F64::LANES;
        left[..lanes].copy_from_slice(&columns.left[first..first + lanes]);
        let (primitives, front) = Left::split(simd, &left);
        Self { primitives, front }
    }

    /// The lanes that leave a primitive, and those that do so into its front.
    #[inline(always)]
    fn by<S: Simd>(&self, simd: S, number: u32) -> (u32, u32) {
        let leaving = simd.equal_u32(&self.primitives, number).bits();
        (leaving, leaving & self.front)
    }
}

/// Fills places from lanes, from one on.
#[inline(always)]
fn fill<S: Simd, A>(places: &mut [A], first: usize, of_lane: impl Fn(usize) -> A) {
    if let Some((places, [])) = places.split_at_mut_checked(S::F64::LANES) {
        // All lanes, as mostly: a loop of a known length.
        for (lane, place) in places[..S::F64::LANES].iter_mut().enumerate() {
            *place = of_lane(lane);
        }
    } else {
        for (lane, place) in places.iter_mut().enumerate() {
            *place = of_lane((first + lane) % S::F64::LANES);
        }
    }
}

/// The nearest hits so far: where, and of what.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NearestOfFew<S: Simd> {
    t: S::F64,
    /// Numbers as bits, which are moved and never calculated with.
    number: S::F64,
}

/// The bits of a number.
#[inline(always)]
fn bits_of<S: Simd>(simd: S, number: u32) -> S::F64 {
    simd.splat_f64(f64::from_bits(number.into()))
}

impl OfFew for NearestHit {
    type Known<S: Simd> = NearestOfFew<S>;

    #[inline(always)]
    fn nothing<S: Simd>(self, simd: S) -> NearestOfFew<S> {
        let HitOrNone { t, primitive } = HitOrNone::NONE;
        NearestOfFew { t: simd.splat_f64(t), number: bits_of(simd, primitive) }
    }

    #[inline(always)]
    fn take<S: Simd>(
        self,
        simd: S,
        known: &mut NearestOfFew<S>,
        (is_hit, t): (<S::F64 as Lanes>::Mask, S::F64),
        number: u32,
    ) -> bool {
        // Of equally near ones the first, which has the lesser number.
        let is_nearer = is_hit & t.lt(known.t);
        known.t = t.select(is_nearer, known.t);
        known.number = bits_of(simd, number).select(is_nearer, known.number);
        false
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "it was a number of 32 bits")]
    fn write<S: Simd>(self, known: &NearestOfFew<S>, lane: usize, places: &mut [HitOrNone]) {
        let (mut distances, mut numbers) = ([0.0; MAX_LANES], [0.0; MAX_LANES]);
        known.t.store(&mut distances);
        known.number.store(&mut numbers);
        fill::<S, _>(places, lane, |lane| HitOrNone {
            t: distances[lane],
            primitive: numbers[lane].to_bits() as u32,
        });
    }

    fn one(self, hits: impl Iterator<Item = Hit>) -> HitOrNone {
        hits.reduce(|nearest, hit| if hit.t < nearest.t { hit } else { nearest }).into()
    }
}

impl<const SHARED: bool> OfFew for AnyHit<SHARED> {
    /// The lanes that hit something.
    type Known<S: Simd> = u32;

    #[inline(always)]
    fn nothing<S: Simd>(self, _: S) -> u32 {
        0
    }

    #[inline(always)]
    fn take<S: Simd>(
        self,
        _: S,
        known: &mut u32,
        (is_hit, _): (<S::F64 as Lanes>::Mask, S::F64),
        _: u32,
    ) -> bool {
        *known |= is_hit.bits();
        known.count_ones() as usize == S::F64::LANES
    }

    #[inline(always)]
    fn write<S: Simd>(self, known: &u32, lane: usize, places: &mut [bool]) {
        fill::<S, _>(places, lane, |lane| known >> lane & 1 == 1);
    }

    fn one(self, mut hits: impl Iterator<Item = Hit>) -> bool {
        hits.next().is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Up to what cones add to distances anyhow, 2^-526.
    #[test]
    fn a_ball_holds_its_group() {
        let alike = [1.0, 1e-3, 1e150, 1e-155, 1e-161, 1e-200, 1e200].map(|scale| (scale, scale));
        for (apart, wide) in alike.into_iter().chain([(1e-170, 1.0), (1e-320, 1.0), (1.0, 0.0), (1.0, 1e-9)])
        {
            let scale = f64::max(apart, wide);
            for seed in 0..200_u32 {
                let at = |i: u32, k: f64| (f64::from(1 + seed * 32 + i) * k).fract() - 0.5;
                let n = 1 + seed % 8;
                let balls: Vec<_> = (0..n)
                    .map(|i| BoundingSphere {
                        center: apart
                            * DVec3::new(at(i, 0.618_033_9), at(i, 0.754_877_7), at(i, 0.569_840_3)),
                        radius: wide * (at(i, 0.819_172_5) + 0.5),
                    })
                    .collect();
                let held = ball_around(&balls);
                for ball in &balls {
                    let to = (ball.center - held.center) / scale;
                    let reach = to.length() + ball.radius / scale;
                    assert!(
                        reach <= (held.radius + 2e-159) / scale,
                        "{scale:e}, {seed}: {ball:?} in {held:?}"
                    );
                }
            }
        }
    }
}
