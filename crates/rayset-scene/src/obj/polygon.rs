//! Triangulates the faces of an OBJ file.

use std::collections::HashMap;
use std::fmt;

use earcut::Earcut;
use rayset_geometry::glam::{DVec2, DVec3};

/// Cuts polygons into triangles, with buffers that are used again.
pub(super) struct Triangulator {
    earcut: Earcut<f64>,
    flat: Vec<[f64; 2]>,
    ears: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    /// What clipping may still take: the squares of corners, since that is how its time grows.
    work: u64,
    fanned: Fanned,
}

/// Polygons that were cut into fans without being convex.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Fanned {
    /// They cross themselves.
    pub(super) crossed: usize,
    /// Clipping them, too, would have taken too long.
    pub(super) skipped: usize,
}

/// What clipping may take: some seconds. A polygon of so many corners, the limit of a face, uses it up.
const MAX_WORK: u64 = 1 << 32;

/// Polygons of so many corners are clipped in any case.
const FEW_CORNERS: u64 = 64;

/// How much the triangles of a polygon may differ in area from it, where its corners span about 1: far more than
/// rounding does, and less than what shows.
const AREA_TOLERANCE: f64 = 1e-9;

impl Default for Triangulator {
    fn default() -> Self {
        Self {
            earcut: Earcut::new(),
            flat: Vec::new(),
            ears: Vec::new(),
            triangles: Vec::new(),
            work: MAX_WORK,
            fanned: Fanned::default(),
        }
    }
}

impl fmt::Debug for Triangulator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Triangulator").finish_non_exhaustive()
    }
}

impl Triangulator {
    /// The triangles of a polygon as indices of its corners, each in the sense of the polygon.
    ///
    /// A simple polygon gives two triangles fewer than it has corners, whether it is convex or not; it need not be
    /// planar: its projection along its vector area (Newell's normal) counts. A polygon that has no area or crosses
    /// itself is cut into a fan, and so is a large one once many large ones have been clipped.
    ///
    /// Source: ear clipping as in the mapbox earcut library.
    pub(super) fn triangulate(&mut self, corners: &[DVec3]) -> &[[u32; 3]] {
        self.triangles.clear();
        let is_convex = match *corners {
            [_, _, _] => true,
            [a, b, c, d] => is_convex_quadrilateral([a, b, c, d]),
            _ => false,
        };
        if is_convex || !self.flatten(corners) || is_convex_polygon(&self.flat) {
            self.fan(corners.len());
        } else if !self.has_work(corners.len() as u64) {
            self.fanned.skipped += 1;
            self.fan(corners.len());
        } else if !self.clip() {
            self.fanned.crossed += 1;
            self.fan(corners.len());
        }
        &self.triangles
    }

    /// What was cut into fans so far.
    pub(super) fn fanned(&self) -> Fanned {
        self.fanned
    }

    /// Takes the work for a polygon of so many corners; `false` if there is not enough left.
    fn has_work(&mut self, n_corners: u64) -> bool {
        let left = match n_corners <= FEW_CORNERS {
            true => Some(self.work),
            false => self.work.checked_sub(n_corners.saturating_mul(n_corners)),
        };
        self.work = left.unwrap_or(self.work);
        left.is_some()
    }

    fn fan(&mut self, n_corners: usize) {
        let n_corners = u32::try_from(n_corners).unwrap_or(u32::MAX);
        self.triangles.clear();
        self.triangles.extend((2..n_corners).map(|corner| [0, corner - 1, corner]));
    }

    /// Projects the corners on the plane of the polygon, scaled to about 1, counterclockwise; `false` without area.
    fn flatten(&mut self, corners: &[DVec3]) -> bool {
        let first = corners[0];
        let scale = corners.iter().map(|corner| (*corner - first).abs().max_element()).fold(0.0, f64::max);
        if scale <= 0.0 {
            return false;
        }
        let local = |corner: &DVec3| (*corner - first) / scale;
        let area = corners
            .windows(2)
            .map(|pair| local(&pair[0]).cross(local(&pair[1])))
            .fold(DVec3::ZERO, |area, cross| area + cross);
        let Some(normal) = rayset_geometry::unit(area) else { return false };
        let (across, up) = normal.any_orthonormal_pair();
        self.flat.clear();
        self.flat.extend(corners.iter().map(local).map(|corner| [corner.dot(across), corner.dot(up)]));
        true
    }

    /// Cuts the flat polygon; `false` if the triangles do not cover it, because it crosses itself.
    fn clip(&mut self) -> bool {
        self.earcut.earcut_slice(&self.flat, &[], &mut self.ears);
        self.triangles.clear();
        self.triangles.extend(self.ears.chunks_exact(3).map(|ear| [ear[0], ear[1], ear[2]]));
        let area = |triangles: &[[u32; 3]]| {
            triangles.iter().fold(0.0, |area, &triangle| area + turn(triangle.map(|i| self.flat[i as usize])))
        };
        let n_corners = u32::try_from(self.flat.len()).unwrap_or(u32::MAX);
        let polygon_area: f64 = (2..n_corners).fold(0.0, |sum, i| sum + area(&[[0, i - 1, i]]));
        let covered: f64 = area(&self.triangles);
        if (covered - polygon_area).abs() > AREA_TOLERANCE {
            return false;
        }
        if self.triangles.len() + 2 < self.flat.len() {
            self.restore_corners();
        }
        !self.triangles.is_empty()
    }

    /// Puts back the corners on straight edges that ear clipping leaves out: neighbours meet there, and a ray could
    /// slip through between a long edge and two short ones.
    fn restore_corners(&mut self) {
        let n_corners = self.flat.len();
        let mut is_kept = vec![false; n_corners];
        let mut by_edge = HashMap::new();
        for (i, triangle) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                is_kept[triangle[k] as usize] = true;
                by_edge.insert((triangle[k], triangle[(k + 1) % 3]), i);
            }
        }
        let kept: Vec<usize> = (0..n_corners).filter(|&i| is_kept[i]).collect();
        for (k, &from) in kept.iter().enumerate() {
            let to = kept[(k + 1) % kept.len()];
            let n_between = (to + n_corners - from - 1) % n_corners;
            let between = (1..=n_between).map(|i| (from + i) % n_corners);
            let index = |i: usize| u32::try_from(i).unwrap_or(u32::MAX);
            let Some(&triangle) = by_edge.get(&(index(from), index(to))) else { continue };
            if n_between == 0 || !is_monotone(&self.flat, from, between.clone(), to) {
                continue;
            }
            let apex = self.triangles[triangle].into_iter().find(|&i| i != index(from) && i != index(to));
            let Some(apex) = apex else { continue };
            // The triangle keeps its place with the first piece of the edge.
            let mut place = triangle;
            let mut start = index(from);
            for end in between.map(index).chain([index(to)]) {
                if start == index(from) {
                    self.triangles[place] = [start, end, apex];
                } else {
                    place = self.triangles.len();
                    self.triangles.push([start, end, apex]);
                }
                start = end;
            }
            by_edge.insert((index(to), apex), place);
        }
    }
}

/// Whether points lie one after the other between two ends.
fn is_monotone(flat: &[[f64; 2]], from: usize, between: impl Iterator<Item = usize>, to: usize) -> bool {
    let point = |i: usize| DVec2::from_array(flat[i]);
    let along = point(to) - point(from);
    let mut last = 0.0;
    let is_ahead = |i: usize| {
        let position = along.dot(point(i) - point(from));
        std::mem::replace(&mut last, position) <= position && position <= along.length_squared()
    };
    { between }.all(is_ahead)
}

/// Whether a quadrilateral turns left at every corner, seen against its vector area; not if it has a straight angle.
fn is_convex_quadrilateral(corners: [DVec3; 4]) -> bool {
    let [a, b, c, d] = corners;
    let normal = (c - a).cross(d - b);
    let turns_left = |p: DVec3, q: DVec3, r: DVec3| (q - p).cross(r - q).dot(normal) > 0.0;
    turns_left(a, b, c) && turns_left(b, c, d) && turns_left(c, d, a) && turns_left(d, a, b)
}

/// Whether a flat polygon turns left at every corner and goes round once; not if it has a straight angle.
fn is_convex_polygon(flat: &[[f64; 2]]) -> bool {
    let n = flat.len();
    let is_upward = |i: usize| flat[(i + 1) % n][1] > flat[i % n][1];
    let n_upturns = (0..n).filter(|&i| !is_upward(i) && is_upward(i + 1)).count();
    n_upturns == 1 && (0..n).all(|i| turn([flat[i], flat[(i + 1) % n], flat[(i + 2) % n]]) > 0.0)
}

/// Twice the area of a triangle, positive if it goes round counterclockwise.
fn turn(corners: [[f64; 2]; 3]) -> f64 {
    let [a, b, c] = corners.map(DVec2::from_array);
    (b - a).perp_dot(c - a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::{abs_diff_eq, assert_abs_diff_eq};

    fn flat(points: &[(f64, f64)]) -> Vec<DVec3> {
        points.iter().map(|&(x, y)| DVec3::new(x, y, 0.0)).collect()
    }

    /// The areas of the triangles added up, and added as vectors.
    fn areas(corners: &[DVec3]) -> (usize, f64, DVec3) {
        let mut triangulator = Triangulator::default();
        let triangles = triangulator.triangulate(corners);
        let mut sums = (triangles.len(), 0.0, DVec3::ZERO);
        for triangle in triangles {
            let [a, b, c] = triangle.map(|i| corners[i as usize]);
            let area = 0.5 * (b - a).cross(c - a);
            sums.1 += area.length();
            sums.2 += area;
        }
        sums
    }

    fn assert_covered(corners: &[DVec3], area: f64) {
        let (n_triangles, sum, vector) = areas(corners);
        assert_eq!(n_triangles, corners.len() - 2, "{corners:?}");
        assert_abs_diff_eq!(sum, area, epsilon = 1e-12 * area);
        assert!(abs_diff_eq!(vector.length(), area, epsilon = 1e-12 * area), "some triangle is turned over");
    }

    /// In every order of the corners, either way round, in another plane.
    fn assert_covered_any_way(points: &[(f64, f64)], area: f64) {
        let mut corners = flat(points);
        for reversed in [false, true] {
            for _ in 0..corners.len() {
                corners.rotate_left(1);
                assert_covered(&corners, area);
                let (across, up) = DVec3::new(0.6, 0.0, 0.8).any_orthonormal_pair();
                let turned: Vec<_> = corners.iter().map(|c| 1e-170 * (across * c.x + up * c.y)).collect();
                let (n_triangles, ..) = areas(&turned);
                assert_eq!(n_triangles, corners.len() - 2);
                let turned: Vec<_> = corners.iter().map(|c| 1e59 * (across * c.x + up * c.y)).collect();
                assert_covered(&turned, area * 1e59 * 1e59);
            }
            corners.reverse();
            assert!(reversed || areas(&corners).2.z < 0.0, "the sense of the polygon is kept");
        }
    }

    #[test]
    fn simple_polygons_are_covered_once() {
        assert_covered_any_way(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)], 1.0);
        // A dart, an L, a comb, an arrow.
        assert_covered_any_way(&[(0.0, 0.0), (2.0, -1.0), (1.0, 0.0), (2.0, 1.0)], 1.0);
        assert_covered_any_way(
            &[(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)],
            3.0,
        );
        let comb = [(0.0, 0.0), (5.0, 0.0), (5.0, 2.0), (4.0, 2.0), (4.0, 1.0), (3.0, 1.0), (3.0, 2.0)];
        let rest = [(2.0, 2.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)];
        assert_covered_any_way(&[&comb[..], &rest[..]].concat(), 8.0);
        assert_covered_any_way(&[(0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (1.0, 1.0)], 4.5);
    }

    #[test]
    fn corners_on_straight_edges_are_kept() {
        let with_middles =
            [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0), (0.0, 2.0)];
        let mut corners = flat(&with_middles);
        for _ in 0..corners.len() {
            corners.rotate_left(1);
            assert_covered(&corners, 4.0);
            let mut triangulator = Triangulator::default();
            for triangle in triangulator.triangulate(&corners) {
                let [a, b, c] = triangle.map(|i| corners[i as usize]);
                assert!((b - a).cross(c - a).z > 0.0, "a triangle has no area");
            }
        }
    }

    #[test]
    fn polygons_without_area_are_fans() {
        let line: Vec<_> = (0..6).map(|i| DVec3::splat(f64::from(i))).collect();
        assert_eq!(areas(&line).0, 4);
        assert_eq!(areas(&[DVec3::X; 5]).0, 3);
        assert_eq!(areas(&flat(&[(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)])).0, 2, "a bow tie");
    }

    #[test]
    fn polygons_that_cross_themselves_are_fans_and_counted() {
        let mut triangulator = Triangulator::default();
        let tie = flat(&[(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 1.0)]);
        assert_eq!(triangulator.triangulate(&tie), [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(triangulator.fanned().crossed, 1);
        let star = flat(&[(0.0, 10.0), (6.0, -8.0), (-10.0, 3.0), (10.0, 3.0), (-6.0, -8.0)]);
        assert_eq!(triangulator.triangulate(&star).len(), 3);
        assert_eq!(triangulator.fanned().crossed, 2);
        // A bridge or a spike crosses nothing.
        let spike = flat(&[(0.0, 0.0), (2.0, 0.0), (3.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]);
        triangulator.triangulate(&spike);
        assert_eq!(triangulator.fanned().crossed, 2);
    }

    #[test]
    fn clipping_comes_to_an_end() {
        let dart = [(0.0, 0.0), (2.0, -1.0), (1.0, 0.0), (2.0, 1.0)];
        let zigzag = |n: i32| {
            (0..n).map(|i| (f64::from(i), f64::from(i % 2))).chain([(f64::from(n), 9.0), (0.0, 9.0)])
        };
        let large = flat(&zigzag(198).collect::<Vec<_>>());
        let mut triangulator = Triangulator { work: 50_000, ..Triangulator::default() };
        for skipped in [0, 1, 2] {
            assert_eq!(triangulator.triangulate(&large).len(), 198);
            triangulator.triangulate(&flat(&dart));
            assert_eq!(triangulator.fanned(), Fanned { crossed: 0, skipped });
        }
    }

    #[test]
    fn star_that_goes_round_twice_is_not_taken_for_convex() {
        let points: Vec<_> = [0, 2, 4, 1, 3]
            .map(|i| f64::from(i) * 0.4 * std::f64::consts::PI)
            .iter()
            .map(|angle| [libm::cos(*angle), libm::sin(*angle)])
            .collect();
        assert!(!is_convex_polygon(&points));
    }

    #[test]
    fn many_corners_are_covered() {
        let circle = |radius: f64, i: i32| {
            let angle = f64::from(i) * std::f64::consts::TAU / 500.0;
            DVec3::new(radius * libm::cos(angle), radius * libm::sin(angle), 0.0)
        };
        let round: Vec<_> = (0..500).map(|i| circle(1.0, i)).collect();
        assert_eq!(areas(&round).0, 498);
        assert_abs_diff_eq!(areas(&round).1, areas(&round).2.z, epsilon = 1e-12);
        let star: Vec<_> = (0..500).map(|i| circle(if i % 2 == 0 { 1.0 } else { 0.3 }, i)).collect();
        let (n_triangles, sum, vector) = areas(&star);
        assert_eq!(n_triangles, 498);
        assert!((sum - vector.z).abs() < 1e-12 && sum < 1.1, "{sum}");
    }
}
