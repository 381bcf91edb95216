//! Closed meshes, random numbers, and crossings counted by exact predicates.

use std::collections::BTreeSet;
use std::path::Path;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayset_geometry::glam::DVec3;
use rayset_geometry::{Polygon, Primitive, Triangle, unit};
use robust::{Coord3D, orient3d};

/// What faces become.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Faces {
    /// A triangle each, or a fan of them.
    Triangles,
    /// A polygon each.
    Polygons,
    /// Faces of three vertices become triangles, and every other one of the rest a fan.
    Mixed,
}

/// A closed mesh; its faces go round counterclockwise seen from outside.
#[derive(Clone, Debug)]
pub(crate) struct Mesh {
    pub(crate) name: &'static str,
    pub(crate) vertices: Vec<DVec3>,
    pub(crate) faces: Vec<Vec<usize>>,
}

/// The nearest multiple of 2^-20: differences of such numbers are exact.
pub(crate) fn snap(point: DVec3) -> DVec3 {
    const GRID: f64 = (1 << 20) as f64;
    (point * GRID).round() / GRID
}

impl Mesh {
    fn new(name: &'static str, vertices: Vec<DVec3>, faces: Vec<Vec<usize>>) -> Self {
        Self { name, vertices: vertices.into_iter().map(snap).collect(), faces }
    }

    pub(crate) fn tetrahedron() -> Self {
        let vertices = vec![
            DVec3::ONE,
            DVec3::new(1.0, -1.0, -1.0),
            DVec3::new(-1.0, 1.0, -1.0),
            DVec3::new(-1.0, -1.0, 1.0),
        ];
        Self::new(
            "tetrahedron",
            vertices,
            [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]].map(Vec::from).to_vec(),
        )
    }

    /// A cube from -1 to 1.
    pub(crate) fn cube() -> Self {
        let square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        Self { name: "cube", ..Self::prism("cube", &square, -1.0, 1.0) }
    }

    /// An L, one unit high, that fills [0, 2] x [0, 1] and [0, 1] x [1, 2]; its reentrant wall is x = 1, y > 1.
    pub(crate) fn l_prism() -> Self {
        // The reentrant corner comes first: the L is star-shaped about it, so the fan from it stays inside.
        let outline = [(1.0, 1.0), (1.0, 2.0), (0.0, 2.0), (0.0, 0.0), (2.0, 0.0), (2.0, 1.0)];
        Self::prism("L prism", &outline, 0.0, 1.0)
    }

    /// A prism over an outline that goes round counterclockwise seen from above.
    fn prism(name: &'static str, outline: &[(f64, f64)], bottom: f64, top: f64) -> Self {
        let n = outline.len();
        let level = |z: f64| outline.iter().map(move |&(x, y)| DVec3::new(x, y, z));
        let mut faces =
            vec![(n..2 * n).collect::<Vec<_>>(), std::iter::once(0).chain((1..n).rev()).collect()];
        faces.extend((0..n).map(|i| vec![i, (i + 1) % n, (i + 1) % n + n, i + n]));
        Self::new(name, level(bottom).chain(level(top)).collect(), faces)
    }

    /// A sphere of radius 1: an octahedron whose triangles are cut into four, so many times.
    pub(crate) fn sphere(levels: usize) -> Self {
        let mut vertices: Vec<DVec3> = DVec3::AXES.iter().flat_map(|&axis| [axis, -axis]).collect();
        let mut faces: Vec<[usize; 3]> = Vec::new();
        for (x, y, z) in (0..8_usize).map(|i| (i & 1, 2 + (i >> 1 & 1), 4 + (i >> 2))) {
            let is_even = (x + y + z).is_multiple_of(2);
            faces.push(if is_even { [x, y, z] } else { [y, x, z] });
        }
        for _ in 0..levels {
            let mut middles = std::collections::BTreeMap::new();
            let mut middle = |a: usize, b: usize| {
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    vertices.push(unit(vertices[a] + vertices[b]).expect("edges are short"));
                    vertices.len() - 1
                })
            };
            let cut = |&[a, b, c]: &[usize; 3]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            };
            faces = faces.iter().flat_map(cut).collect();
        }
        Self::new("sphere", vertices, faces.into_iter().map(Vec::from).collect())
    }

    /// The cow of the fixtures, a closed surface without handles.
    pub(crate) fn spot() -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/obj/spot_triangulated.obj");
        let text = std::fs::read_to_string(path).expect("the fixture is in the repository");
        let lines_of = |tag: &'static str| text.lines().filter_map(move |line| line.strip_prefix(tag));
        let numbers = |line: &str| {
            DVec3::from_slice(&line.split(' ').map(|n| n.parse().unwrap()).collect::<Vec<f64>>())
        };
        let corner = |corner: &str| corner.split('/').next().unwrap().parse::<usize>().unwrap() - 1;
        let vertices = lines_of("v ").map(numbers).collect();
        Self::new(
            "spot",
            vertices,
            lines_of("f ").map(|line| line.split(' ').map(corner).collect()).collect(),
        )
    }

    /// The mesh with its vertices mapped, not rounded again.
    pub(crate) fn map(self, map: impl Fn(DVec3) -> DVec3) -> Self {
        Self { vertices: self.vertices.into_iter().map(map).collect(), ..self }
    }

    /// The mesh with the other side of every face in front.
    pub(crate) fn inside_out(self) -> Self {
        let turned = |face: Vec<usize>| face.into_iter().rev().collect();
        Self { name: "inside out", faces: self.faces.into_iter().map(turned).collect(), ..self }
    }

    /// The primitives of one face.
    fn face(&self, i: usize, faces: Faces) -> Vec<Primitive> {
        let corners: Vec<_> = self.faces[i].iter().map(|&v| self.vertices[v]).collect();
        let as_polygon = match faces {
            Faces::Triangles => false,
            Faces::Polygons => true,
            Faces::Mixed => corners.len() > 3 && i.is_multiple_of(2),
        };
        if as_polygon {
            return vec![Polygon::new(corners).expect("faces have areas").into()];
        }
        corners[1..].windows(2).map(|pair| Triangle::new(corners[0], pair[0], pair[1]).into()).collect()
    }

    /// The primitives of all faces.
    pub(crate) fn primitives(&self, faces: Faces) -> Vec<Primitive> {
        (0..self.faces.len()).flat_map(|i| self.face(i, faces)).collect()
    }

    /// The primitives of the faces that touch either vertex.
    pub(crate) fn primitives_around(&self, [a, b]: [usize; 2], faces: Faces) -> Vec<Primitive> {
        let touching =
            (0..self.faces.len()).filter(|&i| self.faces[i].contains(&a) || self.faces[i].contains(&b));
        touching.flat_map(|i| self.face(i, faces)).collect()
    }

    /// The edges, once each.
    pub(crate) fn edges(&self) -> Vec<[usize; 2]> {
        let of_face = |face: &Vec<usize>| {
            let ends: Vec<_> = (0..face.len()).map(|i| (face[i], face[(i + 1) % face.len()])).collect();
            ends.into_iter().map(|(a, b)| [a.min(b), a.max(b)])
        };
        self.faces.iter().flat_map(of_face).collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// Where a half-line crosses the triangulated mesh, by exact predicates: from the front, and from the back.
    ///
    /// `None` if it meets an edge or a vertex, or starts on the surface. The differences to the origin must be exact.
    pub(crate) fn crossings(&self, origin: DVec3, direction: DVec3) -> Option<[i32; 2]> {
        let mut counts = [0; 2];
        for face in &self.faces {
            let from_origin = |&v: &usize| self.vertices[v] - origin;
            let corners: Vec<_> = face.iter().map(from_origin).collect();
            for pair in corners[1..].windows(2) {
                let (a, b, c) = (corners[0], pair[0], pair[1]);
                let sides = [sign(direction, a, b), sign(direction, b, c), sign(direction, c, a)];
                if sides.iter().all(|&side| side >= 0) || sides.iter().all(|&side| side <= 0) {
                    let volume = sign(a, b, c);
                    if sides.contains(&0) || volume == 0 {
                        return None;
                    }
                    if volume == sides[0] {
                        counts[usize::from(volume > 0)] += 1;
                    }
                }
            }
        }
        Some(counts)
    }

    /// Points of the grid strictly inside, or outside: some anywhere, some close to the surface.
    pub(crate) fn points(&self, inside: bool, count: usize, random: &mut Random) -> Vec<DVec3> {
        let middle = self.vertices.iter().fold(DVec3::ZERO, |sum, &v| sum + v) / self.vertices.len() as f64;
        let (low, high) =
            self.vertices.iter().fold((middle, middle), |(low, high), &v| (low.min(v), high.max(v)));
        let mut points = Vec::new();
        while points.len() < count {
            let anywhere = low + (high - low) * (0.75 * random.vector() + 0.5);
            let near = self.vertices[random.index(self.vertices.len())];
            let closeness = 1.0 / (1_u64 << random.index(16)) as f64;
            let sign = if inside { 1.0 } else { -1.0 };
            let point = snap(if points.len().is_multiple_of(2) {
                anywhere
            } else {
                near + sign * closeness * (middle - near)
            });
            let parity = self.crossings(point, random.unit()).map(|[front, back]| (front + back) % 2);
            if parity == Some(i32::from(inside)) {
                points.push(point);
            }
        }
        points
    }
}

/// The sign of the determinant of three vectors.
fn sign(a: DVec3, b: DVec3, c: DVec3) -> i32 {
    let coordinates = |v: DVec3| Coord3D { x: v.x, y: v.y, z: v.z };
    let determinant = orient3d(coordinates(a), coordinates(b), coordinates(c), coordinates(DVec3::ZERO));
    i32::from(determinant > 0.0) - i32::from(determinant < 0.0)
}

/// Seeded random numbers, the same on every machine.
pub(crate) struct Random(ChaCha8Rng);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// From 0 up to 1.
    pub(crate) fn number(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn index(&mut self, len: usize) -> usize {
        let len = u64::try_from(len).expect("a small number");
        usize::try_from(self.0.next_u64() % len).expect("a small number")
    }

    /// In the cube from -1 to 1.
    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::from_array([(); 3].map(|()| 2.0 * self.number() - 1.0))
    }

    pub(crate) fn unit(&mut self) -> DVec3 {
        unit(self.vector()).expect("no random vector is zero")
    }

    /// The direction with each component the same, the number above, or the one below.
    pub(crate) fn nudge(&mut self, direction: DVec3) -> DVec3 {
        let nudges = self.index(27);
        let nudged = |value: f64, nudge: usize| match nudge % 3 {
            0 => value,
            1 => value.next_up(),
            _ => value.next_down(),
        };
        DVec3::new(
            nudged(direction.x, nudges),
            nudged(direction.y, nudges / 3),
            nudged(direction.z, nudges / 9),
        )
    }
}
