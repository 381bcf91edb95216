//! Lists of rays, and how those that are traced together are held against a loop over all primitives.

use rayset_bvh::{Bundled, Hierarchy, Hit, HitOrNone, Left, Query, RayColumns};
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

fn together(hierarchy: &Hierarchy, list: &List) -> (Vec<Option<Hit>>, Vec<bool>, Bundled) {
    let left: Vec<_> = list.left.iter().map(|&left| Left::from(left)).collect();
    let rays = list.columns(&left);
    let n = list.left.len();
    // What stands in the places before does not matter.
    let something = HitOrNone { t: 0.0, primitive: 0 };
    let (mut hits, mut occluded) = (vec![something; n], vec![true; n]);
    let mut scratch = hierarchy.bundle_scratch();
    for range in [0..cut(n), cut(n)..n] {
        hierarchy.nearest_bundle(&rays, range.clone(), 0, &mut hits, &mut scratch);
        hierarchy.occluded_bundle(&rays, range, 1, &mut occluded, &mut scratch);
    }
    let (mut each_hits, mut each_occluded) = (vec![something; n], vec![true; n]);
    hierarchy.nearest_each(&rays, &mut each_hits, &mut scratch.single);
    hierarchy.occluded_each(&rays, &mut each_occluded, &mut scratch.single);
    for i in 0..n {
        assert_eq!(each_hits[i], hits[i], "ray {i} one by one as together");
        assert_eq!(each_occluded[i], occluded[i], "ray {i} one by one as together");
    }
    (hits.iter().map(|hit| hit.get()).collect(), occluded, scratch.bundled)
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
        stages.tiles += bundled.tiles;
        stages.packets += bundled.packets;
        stages.blockers += bundled.blockers;
        stages.alone += bundled.alone;
        stages.at_once += bundled.at_once;
        assert!(bundled.at_once <= bundled.alone, "those are of these");
        for (i, expected) in expected.iter().enumerate() {
            let (ray, left) = (list.ray(i), list.left[i]);
            assert_eq!(bits(hits[i]), bits(*expected), "{backend}, ray {i}: {ray:?}, {left:?}");
            assert_eq!(occluded[i], expected.is_some(), "{backend}, ray {i}: {ray:?}");
        }
    }
    stages
}
