//! Few spheres: so few that a tree has nothing to spare, and every ray is tested against each of them.
//!
//! As many rays at a time as there are lanes of double precision, each sphere in turn: exact at once.
//! (With eight spheres, culling the one leaf there is and deciding afterwards took three times as long.)
//! In bundles, a cone round a block of rays shows which spheres none of them can meet; and of some more spheres, whether
//! those that are left are few.

use std::ops::Range;

use rayset_geometry::{PrimitiveKind, RayLanes, Sides, Sphere};
use rayset_simd::{LaneMask, Lanes, MAX_LANES, Part, Simd};

use crate::Hit;
use crate::bundle::Trial;
use crate::columns::{HitOrNone, Left, RayColumns};
use crate::cone::Cone;
use crate::each::{AnyHit, NearestHit, OfRay};
use crate::shapes::Shapes;

/// How many spheres are few.
const FEW: usize = 8;
/// How many spheres may be few after a cone was asked about all: as many as a set has bits. (With 128, light rays took a
/// fifth longer.)
const FEW_IN_CONES: usize = u64::BITS as usize;

/// All spheres of a hierarchy that are few, or may be few in cones, in the order of their numbers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Few {
    spheres: Vec<FewSphere>,
    /// Their centres and radii as columns, with zeros after them up to whole lanes.
    centers: [Vec<f64>; 3],
    radii: Vec<f64>,
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
    fn write<S: Simd>(self, known: &Self::Known<S>, places: &mut [Self::Answer]);
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
    /// All there is, if that is spheres of which few may be left by cones.
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
        spheres.sort_by_key(|sphere| sphere.number);
        let column = |of: &dyn Fn(&Sphere) -> f64| {
            let mut column: Vec<_> = spheres.iter().map(|few| of(&few.sphere)).collect();
            column.resize(spheres.len().next_multiple_of(MAX_LANES), 0.0);
            column
        };
        let centers = [0, 1, 2].map(|k| column(&|sphere| sphere.center()[k]));
        let radii = column(&|sphere| sphere.radius());
        Few { spheres, centers, radii }
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

    /// All spheres, as bits.
    fn all(&self) -> u64 {
        u64::MAX >> (FEW_IN_CONES - self.len())
    }

    /// The spheres, as bits, that some rays may meet, by a cone round them.
    #[inline(always)]
    fn may_be_met<S: Simd>(&self, simd: S, columns: &RayColumns<'_>, range: Range<usize>) -> u64 {
        let Some(cone) = Cone::around(simd, columns, range, 1.0) else { return self.all() };
        let mut met = 0;
        for first in (0..self.len()).step_by(S::F64::LANES) {
            let centers = [
                simd.load_f64(&self.centers[0][first..]),
                simd.load_f64(&self.centers[1][first..]),
                simd.load_f64(&self.centers[2][first..]),
            ];
            let radii = simd.load_f64(&self.radii[first..]);
            met |= u64::from(cone.may_meet(simd, centers, radii, 1.0)) << first;
        }
        met & self.all()
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
            let mut met = few.all();
            let (mut saved, n) = (0, few.len() as u64);
            if rays >= S::F64::LANES && trial.is_due() {
                met = few.may_be_met(simd, &columns, block.clone());
                let left = u64::from(met.count_ones());
                saved = match (few.replace_tree(), left <= FEW as u64) {
                    (true, _) => 4 * (n - left),
                    // A tree takes longer than the tests of few.
                    (false, true) => 2 * CONE_COST,
                    (false, false) => 0,
                };
                trial.end(CONE_COST, saved);
            }
            if met.count_ones() as usize > FEW {
                break;
            }
            done.rays += rays;
            done.in_cones += if saved >= CONE_COST { rays as u64 } else { 0 };
            done.tests += rays as u64 * u64::from(met.count_ones());
            few.ask(simd, met, question, &columns, block, places);
        }
        done
    }
}

impl Few {
    /// Answers some rays, which meet no spheres but those that are set, which are few.
    #[inline(always)]
    fn ask<S: Simd, Q: OfFew>(
        &self,
        simd: S,
        met: u64,
        question: Q,
        columns: &RayColumns<'_>,
        range: Range<usize>,
        places: &mut [Q::Answer],
    ) {
        let lanes = S::F64::LANES;
        let Range { start: mut first, end } = range;
        assert!(end <= columns.len() && end <= places.len(), "there are these rays");
        let mut which = [0; FEW];
        let n = met.count_ones() as usize;
        let mut left = met;
        for place in &mut which[..n] {
            *place = left.trailing_zeros() as usize;
            left &= left - 1;
        }
        let which = &which[..n];
        let zero = simd.splat_f64(0.0);
        while first < end && first + lanes <= columns.len() {
            let mut rays = RayLanes { origin: [zero; 3], direction: [zero; 3] };
            for k in 0..3 {
                rays.origin[k] = simd.load_f64(&columns.origins[k][first..]);
                rays.direction[k] = simd.load_f64(&columns.directions[k][first..]);
            }
            // A ray is a half-line.
            let start = simd.load_f64(&columns.spans.0[first..]);
            let span = [zero.select(start.lt(zero), start), simd.load_f64(&columns.spans.1[first..])];
            let left = LeftBy::of(columns, first, lanes);
            let mut known = question.nothing(simd);
            for &i in which {
                let FewSphere { sphere, sides, number } = &self.spheres[i];
                let (leaving, outwards) = left.by(simd, *number);
                let front = if *sides == Sides::Back { 0 } else { !leaving };
                let back = if *sides == Sides::Front { 0 } else { !outwards };
                let center = sphere.center();
                let center = [simd.splat_f64(center.x), simd.splat_f64(center.y), simd.splat_f64(center.z)];
                let sphere = (center, simd.splat_f64(sphere.radius()));
                let allowed = (simd.mask_f64(front), simd.mask_f64(back));
                let hit = Sphere::intersect_pairs(simd, &rays, span, sphere, allowed);
                if question.take(simd, &mut known, hit, *number) {
                    break;
                }
            }
            let len = lanes.min(end - first);
            question.write::<S>(&known, &mut places[first..first + len]);
            first += len;
        }
        // Too few are left in the columns for all lanes.
        for (i, place) in (first..end).zip(&mut places[first..]) {
            let (ray, span) = columns.ray(i);
            let left = columns.left(i);
            *place = question.one(self.spheres.iter().filter_map(|FewSphere { sphere, sides, number }| {
                let departure = left.filter(|left| left.0 == *number).map(|left| left.1);
                let t = sphere.intersect(&ray, span, *sides, departure)?;
                Some(Hit { t, primitive: *number })
            }));
        }
    }
}

/// What rays in lanes leave.
struct LeftBy {
    primitives: [u32; MAX_LANES],
    /// The lanes that leave something into its front.
    front: u32,
    leaves: bool,
}

impl LeftBy {
    #[inline(always)]
    fn of(columns: &RayColumns<'_>, first: usize, lanes: usize) -> Self {
        let mut left = [Left::NOTHING; MAX_LANES];
        let leaves = !columns.left.is_empty();
        if leaves {
            left[..lanes].copy_from_slice(&columns.left[first..first + lanes]);
        }
        let (primitives, front) = Left::split(&left);
        Self { primitives, front, leaves }
    }

    /// The lanes that leave a primitive, and those that do so into its front.
    #[inline(always)]
    fn by<S: Simd>(&self, simd: S, number: u32) -> (u32, u32) {
        if !self.leaves {
            return (0, 0);
        }
        let leaving = simd.equal_u32(&self.primitives, number).bits();
        (leaving, leaving & self.front)
    }
}

/// Fills places from lanes.
#[inline(always)]
fn fill<S: Simd, A>(places: &mut [A], of_lane: impl Fn(usize) -> A) {
    if let Some((places, [])) = places.split_at_mut_checked(S::F64::LANES) {
        // All lanes, as mostly: a loop of a known length.
        for (lane, place) in places[..S::F64::LANES].iter_mut().enumerate() {
            *place = of_lane(lane);
        }
    } else {
        for (lane, place) in places.iter_mut().enumerate() {
            *place = of_lane(lane);
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
    fn write<S: Simd>(self, known: &NearestOfFew<S>, places: &mut [HitOrNone]) {
        let (mut distances, mut numbers) = ([0.0; MAX_LANES], [0.0; MAX_LANES]);
        known.t.store(&mut distances);
        known.number.store(&mut numbers);
        fill::<S, _>(places, |lane| HitOrNone {
            t: distances[lane],
            primitive: numbers[lane].to_bits() as u32,
        });
    }

    fn one(self, hits: impl Iterator<Item = Hit>) -> HitOrNone {
        hits.reduce(|nearest, hit| if hit.t < nearest.t { hit } else { nearest }).into()
    }
}

impl OfFew for AnyHit {
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
    fn write<S: Simd>(self, known: &u32, places: &mut [bool]) {
        fill::<S, _>(places, |lane| known >> lane & 1 == 1);
    }

    fn one(self, mut hits: impl Iterator<Item = Hit>) -> bool {
        hits.next().is_some()
    }
}
