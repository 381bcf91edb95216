//! Lists of rays, and how those that are traced together are held against a loop over all primitives.

use std::ops::Range;

use rayset_bvh::{
    BundleScratch, Bundled, Group, Hierarchy, Hit, HitOrNone, Left, PartOfList, Query, RayColumns, Spent,
};
use rayset_geometry::glam::dvec3;
use rayset_geometry::{Primitive, Ray, Side, Sides, Span};
use rayset_simd::Backend;

use crate::truth::{bits, columns_of, nearest};

/// Rays as columns, and what each leaves.
#[derive(Debug, Default)]
pub(crate) struct List {
    origins: [Vec<f64>; 3],
    directions: [Vec<f64>; 3],
    starts: Vec<f64>,
    ends: Vec<f64>,
    pub(crate) left: Vec<Option<(u32, Side)>>,
}

impl List {
    pub(crate) fn push(&mut self, ray: &Ray, span: Span, left: Option<(u32, Side)>) {
        for k in 0..3 {
            self.origins[k].push(ray.origin()[k]);
            self.directions[k].push(ray.direction()[k]);
        }
        self.starts.push(span.start);
        self.ends.push(span.end);
        self.left.push(left);
    }

    /// Its columns, and what each ray leaves.
    pub(crate) fn columns<'a>(&'a self, left: &'a [Left]) -> RayColumns<'a> {
        RayColumns {
            origins: [&self.origins[0], &self.origins[1], &self.origins[2]],
            directions: [&self.directions[0], &self.directions[1], &self.directions[2]],
            spans: (&self.starts, &self.ends),
            left,
        }
    }

    fn ray(&self, i: usize) -> (Ray, Span) {
        let at = |columns: &[Vec<f64>; 3]| dvec3(columns[0][i], columns[1][i], columns[2][i]);
        (Ray::new(at(&self.origins), at(&self.directions)), Span { start: self.starts[i], end: self.ends[i] })
    }
}

/// Where a list is cut in two, since shafts and lanes may end before the columns do.
fn cut(n: usize) -> usize {
    2 * n / 3
}

/// Most rays as one group, and the last in short ones of two classes.
fn groups(range: &Range<usize>, class: usize) -> Vec<Group> {
    let middle = range.start + range.len() * 3 / 4;
    let mut groups = vec![Group { range: range.start..middle, class }];
    let short = (middle..range.end).step_by(5).enumerate();
    groups.extend(
        short.map(|(i, first)| Group { range: first..range.end.min(first + 5), class: class + i / 2 % 2 }),
    );
    groups
}

fn together(hierarchy: &Hierarchy, list: &List) -> (Vec<Option<Hit>>, Vec<bool>, Bundled) {
    let left: Vec<_> = list.left.iter().map(|&left| Left::from(left)).collect();
    let rays = list.columns(&left);
    let n = list.left.len();
    // What stands in the places before does not matter.
    let something = HitOrNone { t: 0.0, primitive: 0 };
    let answer = |parts: Option<Vec<PartOfList>>| {
        let (mut hits, mut occluded) = (vec![something; n], vec![true; n]);
        let mut scratch = hierarchy.bundle_scratch();
        scratch.parts = parts;
        for range in [0..cut(n), cut(n)..n] {
            hierarchy.nearest_bundle(&rays, &groups(&range, 0), &mut hits, &mut scratch);
            hierarchy.occluded_bundle(&rays, &groups(&range, 10), &mut occluded, &mut scratch);
        }
        (hits, occluded, scratch)
    };
    let (hits, occluded, mut scratch) = answer(None);
    check_parts(n, answer(Some(Vec::new())), (&hits, &occluded, &scratch));
    let mut bundled = Bundled::default();
    for class in [0, 1, 10, 11] {
        bundled += scratch.take_bundled(class);
        assert_eq!(scratch.take_bundled(class), Bundled::default(), "they were taken");
    }
    assert_eq!(bundled.tiles + bundled.packets + bundled.blockers + bundled.alone, 2 * n as u64);
    let (mut each_hits, mut each_occluded) = (vec![something; n], vec![true; n]);
    hierarchy.nearest_each(&rays, &mut each_hits, &mut scratch.single);
    hierarchy.occluded_each(&rays, &mut each_occluded, &mut scratch.single);
    for i in 0..n {
        assert_eq!(each_hits[i], hits[i], "ray {i} one by one as together");
        assert_eq!(each_occluded[i], occluded[i], "ray {i} one by one as together");
    }
    (hits.iter().map(|hit| hit.get()).collect(), occluded, bundled)
}

/// Writing down what parts of a list took changes nothing; together they took all, and no ray is left out.
fn check_parts(
    n: usize,
    (hits, occluded, scratch): (Vec<HitOrNone>, Vec<bool>, BundleScratch),
    expected: (&[HitOrNone], &[bool], &BundleScratch),
) {
    assert_eq!((&hits[..], &occluded[..]), (expected.0, expected.1));
    let (single, expected) = (&scratch.single, &expected.2.single);
    assert_eq!((single.steps, single.primitive_tests), (expected.steps, expected.primitive_tests));
    let (mut spent, mut asked) = (Spent::default(), vec![0; n]);
    for part in scratch.parts.expect("it was asked for") {
        spent.nodes += part.spent.nodes;
        spent.primitive_tests += part.spent.primitive_tests;
        asked[part.range].iter_mut().for_each(|asked| *asked += 1);
    }
    assert_eq!(spent, Spent { nodes: single.steps.nodes, primitive_tests: single.primitive_tests });
    assert!(asked.iter().all(|&asked| asked >= 2), "each asked both questions");
}

/// Compares with a loop; returns how many rays were answered under shafts.
pub(crate) fn check(primitives: &[(Primitive, Sides)], list: &List) -> u64 {
    let Bundled { tiles, packets, .. } = check_stages(primitives, list);
    tiles + packets
}

/// Compares with a loop; returns how many rays each stage answered.
pub(crate) fn check_stages(primitives: &[(Primitive, Sides)], list: &List) -> Bundled {
    let (columns, items) = columns_of(primitives);
    let expected: Vec<Option<Hit>> = (0..list.left.len())
        .map(|i| {
            let (ray, span) = list.ray(i);
            nearest(primitives, &Query { ray, span, from: list.left[i] })
        })
        .collect();
    let mut stages = Bundled::default();
    for &backend in Backend::available() {
        let hierarchy = Hierarchy::over(&columns, &items, backend);
        let (hits, occluded, bundled) = together(&hierarchy, list);
        stages += bundled;
        assert!(bundled.at_once <= bundled.alone, "those are of these");
        for (i, expected) in expected.iter().enumerate() {
            let (ray, left) = (list.ray(i), list.left[i]);
            assert_eq!(bits(hits[i]), bits(*expected), "{backend}, ray {i}: {ray:?}, {left:?}");
            assert_eq!(occluded[i], expected.is_some(), "{backend}, ray {i}: {ray:?}");
        }
    }
    stages
}
