//! The questions a strategy answers, and their answers.

use rayset_bvh::Left;
use rayset_geometry::glam::DVec3;
use rayset_geometry::{Ray, Side, Span};
use rayset_scene::{LightId, ObjectId, PrimitiveId};
use rayset_simd::MAX_LANES;

use crate::Work;
use crate::lanes::lengthen;

/// The greatest depth of a tree: the initial ray has depth 1.
///
/// A bundle shrinks as the depth grows, so that its trees never hold more than 2^22 rays; beyond this depth a single
/// tree could.
pub const MAX_DEPTH: u32 = 20;

/// Why a ray is traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RayKind {
    /// From the viewpoint.
    Initial,
    /// Reflected by a surface.
    Reflected,
    /// Refracted by a surface.
    Refracted,
    /// Towards a light.
    Shadow,
}

impl RayKind {
    /// All kinds, in the order of the enum.
    pub const ALL: [Self; 4] = [Self::Initial, Self::Reflected, Self::Refracted, Self::Shadow];

    /// The name in lower case.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Initial => "initial",
            Self::Reflected => "reflected",
            Self::Refracted => "refracted",
            Self::Shadow => "shadow",
        }
    }
}

/// The number of a ray-set, an initial ray and all its descendants, in the order in which a sweep visits pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RaySetIndex(pub u32);

/// The place of a ray in its intersection tree.
///
/// Slots number the binary tree like a heap: the root is 1, the ray reflected from slot `s` is `2 s`, the one
/// refracted is `2 s + 1`. Corresponding rays of two ray-sets have the same slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Slot(pub u32);

impl Slot {
    /// The slot of every initial ray.
    pub const ROOT: Self = Self(1);

    /// The slot of the ray reflected where this one hits.
    #[must_use]
    pub fn reflected(self) -> Self {
        Self(self.0 * 2)
    }

    /// The slot of the ray refracted where this one hits.
    #[must_use]
    pub fn refracted(self) -> Self {
        Self(self.0 * 2 + 1)
    }

    /// The level of recursion: 1 for the root.
    #[must_use]
    pub fn depth(self) -> u32 {
        u32::BITS - self.0.leading_zeros()
    }

    /// What kind of ray has this slot.
    #[must_use]
    pub fn kind(self) -> RayKind {
        match self.0 {
            1 => RayKind::Initial,
            slot if slot.is_multiple_of(2) => RayKind::Reflected,
            _ => RayKind::Refracted,
        }
    }
}

/// Where a ray that is not initial starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Originating {
    /// The paper's originating object.
    pub object: ObjectId,
    /// The primitive it leaves.
    pub primitive: PrimitiveId,
    /// The side of that primitive into which it leaves.
    pub side: Side,
}

/// What does this ray hit first?
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayQuery {
    /// The ray-set it belongs to.
    pub ray_set: RaySetIndex,
    /// Its place in the tree.
    pub slot: Slot,
    /// What it leaves; `None` for an initial ray.
    pub originating: Option<Originating>,
    /// The ray.
    pub ray: Ray,
    /// Where hits count.
    pub span: Span,
}

/// Is this light hidden?
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowQuery {
    /// The ray-set it belongs to.
    pub ray_set: RaySetIndex,
    /// The slot of the ray that hit the point whose light is asked for.
    pub slot: Slot,
    /// The light.
    pub light: LightId,
    /// What it leaves.
    pub originating: Originating,
    /// The ray from the point towards the light.
    pub ray: Ray,
    /// Where a blocker counts: up to the light; infinite for a directional light.
    pub span: Span,
}

/// The nearest intersection of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The distance along the ray, in world units.
    pub t: f64,
    /// The object.
    pub object: ObjectId,
    /// The primitive.
    pub primitive: PrimitiveId,
}

impl Hit {
    /// Whether this hit comes before another in the order `(t, object, primitive)`.
    #[must_use]
    #[inline]
    pub fn precedes(&self, other: &Self) -> bool {
        let ids = |hit: &Self| (hit.object, hit.primitive);
        self.t.total_cmp(&other.t).then_with(|| ids(self).cmp(&ids(other))).is_lt()
    }
}

/// The rays of one level of a bundle of trees, as columns.
///
/// Rays of a slot stand together, in increasing order of ray-sets.
#[derive(Clone, Debug, Default)]
pub struct Generation {
    pub(crate) ray_sets: Vec<RaySetIndex>,
    /// As many as there are rays; the columns of numbers may be longer, and hold anything there.
    pub(crate) slots: Vec<Slot>,
    pub(crate) origins: [Vec<f64>; 3],
    pub(crate) directions: [Vec<f64>; 3],
    pub(crate) starts: Vec<f64>,
    pub(crate) ends: Vec<f64>,
    /// What each ray leaves, as the hierarchy reads it, and the object of that.
    pub(crate) left: Vec<Left>,
    pub(crate) left_objects: Vec<ObjectId>,
    /// Whether any ray leaves something.
    pub(crate) leaves_anything: bool,
}

impl Generation {
    /// How many rays there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// Whether there is no ray.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// The x, y and z of the origins.
    #[must_use]
    pub fn origins(&self) -> [&[f64]; 3] {
        self.origins.each_ref().map(|column| &column[..self.len()])
    }

    /// The x, y and z of the unit directions.
    #[must_use]
    pub fn directions(&self) -> [&[f64]; 3] {
        self.directions.each_ref().map(|column| &column[..self.len()])
    }

    /// Where each span starts and ends, in world units.
    #[must_use]
    pub fn spans(&self) -> (&[f64], &[f64]) {
        (&self.starts[..self.len()], &self.ends[..self.len()])
    }

    /// What a ray leaves.
    ///
    /// # Panics
    ///
    /// If there is no such ray.
    #[must_use]
    #[inline(always)]
    pub fn originating(&self, i: usize) -> Option<Originating> {
        let (left, object) = (self.left[i].get(), self.left_objects[i]);
        left.map(|(primitive, side)| Originating { object, primitive: PrimitiveId(primitive), side })
    }

    /// What each ray leaves; empty if none leaves anything, as initial rays.
    pub(crate) fn left(&self) -> &[Left] {
        if self.leaves_anything { &self.left } else { &[] }
    }

    /// The slot of each ray.
    #[must_use]
    pub fn slots(&self) -> &[Slot] {
        &self.slots
    }

    /// The ray-set of each ray.
    #[must_use]
    pub fn ray_sets(&self) -> &[RaySetIndex] {
        &self.ray_sets
    }

    /// One ray.
    ///
    /// # Panics
    ///
    /// If there is no such ray.
    #[must_use]
    #[inline]
    pub fn query(&self, i: usize) -> RayQuery {
        let vector = |columns: &[Vec<f64>; 3]| DVec3::new(columns[0][i], columns[1][i], columns[2][i]);
        RayQuery {
            ray_set: self.ray_sets[i],
            slot: self.slots[i],
            originating: self.originating(i),
            ray: Ray::new(vector(&self.origins), vector(&self.directions)),
            span: Span { start: self.starts[i], end: self.ends[i] },
        }
    }

    /// Appends a ray.
    ///
    /// # Panics
    ///
    /// If it leaves a primitive that no scene has: one numbered 2^30 or more.
    #[inline(always)]
    pub fn push(&mut self, query: &RayQuery) {
        let n = self.len();
        self.ray_sets.push(query.ray_set);
        self.slots.push(query.slot);
        self.left.push(Left::from(query.originating.map(|from| (from.primitive.0, from.side))));
        self.left_objects.push(query.originating.map_or(ObjectId(0), |from| from.object));
        self.leaves_anything |= query.originating.is_some();
        let (origin, direction) = (query.ray.origin().to_array(), query.ray.direction().to_array());
        for k in 0..3 {
            put(&mut self.origins[k], n, origin[k]);
            put(&mut self.directions[k], n, direction[k]);
        }
        put(&mut self.starts, n, query.span.start);
        put(&mut self.ends, n, query.span.end);
    }

    /// Adds the initial rays of the ray-sets from `first` on.
    pub(crate) fn extend_initial(&mut self, first: RaySetIndex, rays: impl IntoIterator<Item = Ray>) {
        let mut n = 0;
        for ray in rays {
            for k in 0..3 {
                put(&mut self.origins[k], n, ray.origin()[k]);
                put(&mut self.directions[k], n, ray.direction()[k]);
            }
            n += 1;
        }
        self.make_room(n);
        self.finish_initial(first, n);
    }

    /// Makes room for so many rays, and for lanes beyond.
    pub(crate) fn make_room(&mut self, n: usize) {
        let [ox, oy, oz] = &mut self.origins;
        let [dx, dy, dz] = &mut self.directions;
        for column in [ox, oy, oz, dx, dy, dz, &mut self.starts, &mut self.ends] {
            // Of a length, so that nobody stops to find that a direction has none.
            lengthen(column, n + MAX_LANES, 1.0);
        }
    }

    /// Fills what is the same for all initial rays, once there are origins and directions of so many, and room.
    pub(crate) fn finish_initial(&mut self, first: RaySetIndex, n: usize) {
        assert!(u32::try_from(n).is_ok(), "fewer than 2^32 ray-sets");
        self.ray_sets.extend((first.0..).take(n).map(RaySetIndex));
        self.slots.resize(n, Slot::ROOT);
        self.left.resize(n, Left::NOTHING);
        self.left_objects.resize(n, ObjectId(0));
        self.starts[..n].fill(Span::FORWARD.start);
        self.ends[..n].fill(Span::FORWARD.end);
    }

    /// Removes all rays and keeps the memory.
    pub fn clear(&mut self) {
        self.ray_sets.clear();
        self.slots.clear();
        self.left.clear();
        self.left_objects.clear();
        self.leaves_anything = false;
    }
}

/// Writes the number of a ray, the next behind those that are there.
#[inline(always)]
fn put(column: &mut Vec<f64>, n: usize, number: f64) {
    match column.get_mut(n) {
        Some(place) => *place = number,
        None => column.push(number),
    }
}

/// How many values are equal to the first, from there on.
#[inline]
pub(crate) fn run_len<T: PartialEq>(values: &[T]) -> usize {
    let Some(first) = values.first() else { return 0 };
    let mut n = 0;
    // Many at a time: without a way out in between, they are compared in lanes.
    for values in values.chunks_exact(32) {
        if !values.iter().fold(true, |are_equal, value| are_equal & (value == first)) {
            break;
        }
        n += 32;
    }
    n + values[n..].iter().take_while(|value| *value == first).count()
}

/// The columns of a generation, cut to one length, for loops that want few of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Columns<'a> {
    pub(crate) slots: &'a [Slot],
    origins: [&'a [f64]; 3],
    directions: [&'a [f64]; 3],
    starts: &'a [f64],
    ends: &'a [f64],
}

impl<'a> Columns<'a> {
    #[inline(always)]
    pub(crate) fn of(generation: &'a Generation) -> Self {
        let n = generation.len();
        let cut = |[x, y, z]: &'a [Vec<f64>; 3]| [&x[..n], &y[..n], &z[..n]];
        Self {
            slots: &generation.slots[..n],
            origins: cut(&generation.origins),
            directions: cut(&generation.directions),
            starts: &generation.starts[..n],
            ends: &generation.ends[..n],
        }
    }

    #[inline(always)]
    pub(crate) fn ray(&self, i: usize) -> Ray {
        let vector = |[x, y, z]: [&[f64]; 3]| DVec3::new(x[i], y[i], z[i]);
        Ray::new(vector(self.origins), vector(self.directions))
    }

    #[inline(always)]
    pub(crate) fn span(&self, i: usize) -> Span {
        Span { start: self.starts[i], end: self.ends[i] }
    }
}

/// The light rays of one level of a bundle of trees, as columns.
///
/// Rays of a slot and light stand together, in increasing order of ray-sets.
#[derive(Clone, Debug, Default)]
pub struct ShadowGeneration {
    pub(crate) rays: Generation,
    pub(crate) lights: Vec<LightId>,
}

impl ShadowGeneration {
    /// The rays; every one has an originating object.
    #[must_use]
    pub fn rays(&self) -> &Generation {
        &self.rays
    }

    /// The light that each ray is for.
    #[must_use]
    pub fn lights(&self) -> &[LightId] {
        &self.lights
    }

    /// How many rays there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lights.len()
    }

    /// Whether there is no ray.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// One ray.
    ///
    /// # Panics
    ///
    /// If there is no such ray.
    #[must_use]
    #[inline]
    pub fn query(&self, i: usize) -> ShadowQuery {
        let RayQuery { ray_set, slot, originating, ray, span } = self.rays.query(i);
        let originating = originating.expect("a light ray leaves a surface");
        ShadowQuery { ray_set, slot, light: self.lights[i], originating, ray, span }
    }

    /// Appends a ray.
    ///
    /// # Panics
    ///
    /// As [`Generation::push`] does.
    #[inline(always)]
    pub fn push(&mut self, query: &ShadowQuery) {
        let ShadowQuery { ray_set, slot, light, originating, ray, span } = *query;
        self.rays.push(&RayQuery { ray_set, slot, originating: Some(originating), ray, span });
        self.lights.push(light);
    }

    /// Removes all rays and keeps the memory.
    pub fn clear(&mut self) {
        self.rays.clear();
        self.lights.clear();
    }
}

/// What answering one query took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct QueryWork {
    /// The work; what a packet of rays shares is divided evenly among them.
    pub work: Work,
    /// Whether the answer was coherent: found without a partition.
    pub coherent: bool,
    /// The radius of the safety zone that gave the answer, or was built with it, in world units; 0 for none.
    pub certificate_radius: f64,
}

/// Answers in the order of the queries.
#[derive(Clone, Debug)]
pub struct Answers<T> {
    /// One answer a query.
    pub values: Vec<T>,
    /// What each took; empty unless it is recorded.
    pub work: Vec<QueryWork>,
}

impl<T> Answers<T> {
    /// Removes all answers and keeps the memory.
    pub fn clear(&mut self) {
        self.values.clear();
        self.work.clear();
    }
}

impl<T> Default for Answers<T> {
    fn default() -> Self {
        Self { values: Vec::new(), work: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_end_where_a_value_differs() {
        assert_eq!(run_len::<u8>(&[]), 0);
        for len in [1, 2, 31, 32, 33, 64, 100] {
            for run in 1..=len {
                let mut values = vec![7; run];
                values.resize(len, 8);
                assert_eq!(run_len(&values), run, "of {len}");
                // What is equal again after another value does not count.
                values.extend([7; 40]);
                assert_eq!(run_len(&values), if run == len { len + 40 } else { run });
            }
        }
    }

    #[test]
    fn columns_hold_what_was_added_since_they_were_cleared() {
        let query = |i: u32| RayQuery {
            ray_set: RaySetIndex(i),
            slot: Slot::ROOT,
            originating: None,
            ray: Ray::new(DVec3::splat(f64::from(i)), DVec3::Z),
            span: Span { start: f64::from(i), end: f64::from(2 * i) },
        };
        let mut rays = Generation::default();
        rays.make_room(2);
        for n in [5, 2, 30, 0] {
            rays.clear();
            (1..=n).for_each(|i| rays.push(&query(i)));
            let expected: Vec<f64> = (1..=n).map(f64::from).collect();
            assert_eq!(rays.origins(), [&expected[..]; 3]);
            assert_eq!(rays.directions().map(<[f64]>::len), [rays.len(); 3]);
            let (starts, ends) = rays.spans();
            assert_eq!((starts, ends.len()), (&expected[..], rays.len()));
            assert!((1..=n).all(|i| rays.query(i as usize - 1) == query(i)));
        }
    }

    #[test]
    fn slots_number_the_tree_like_a_heap() {
        assert_eq!(Slot::ROOT.depth(), 1);
        assert_eq!(Slot::ROOT.kind(), RayKind::Initial);
        let child = Slot::ROOT.refracted().reflected();
        assert_eq!(child, Slot(6));
        assert_eq!((child.depth(), child.kind()), (3, RayKind::Reflected));
        assert_eq!(Slot(7).kind(), RayKind::Refracted);
    }

    #[test]
    fn hits_are_ordered_by_distance_then_object_then_primitive() {
        let hit =
            |t, object, primitive| Hit { t, object: ObjectId(object), primitive: PrimitiveId(primitive) };
        assert!(hit(1.0, 9, 9).precedes(&hit(2.0, 0, 0)));
        assert!(hit(1.0, 0, 9).precedes(&hit(1.0, 1, 0)));
        assert!(hit(1.0, 1, 0).precedes(&hit(1.0, 1, 1)));
        assert!(!hit(1.0, 1, 1).precedes(&hit(1.0, 1, 1)));
    }
}
