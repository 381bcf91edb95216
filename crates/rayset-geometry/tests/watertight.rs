//! No ray slips between the faces of a closed mesh, however exactly it is aimed at an edge or a vertex.
//!
//! `RAYSET_WATERTIGHT_RAYS` sets how many aimed rays are traced in all; 10^8 take about a minute of two cores in the
//! release profile.

mod meshes;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use meshes::{Faces, Mesh, Random, snap};
use rayset_geometry::glam::DVec3;
use rayset_geometry::{
    ColumnRun, Polygon, Primitive, PrimitiveColumns, PrimitiveKind, Probe, Ray, Sides, Span, Triangle, unit,
};
use rayset_simd::{Backend, Kernel, Simd};

/// How many aimed rays there are in all.
fn ray_count() -> usize {
    let text = std::env::var("RAYSET_WATERTIGHT_RAYS").unwrap_or_else(|_| "200000".to_owned());
    text.parse().expect("RAYSET_WATERTIGHT_RAYS is a number")
}

/// Primitives in columns: one run for each of the flat kinds.
struct Patch(Vec<ColumnRun>);

impl Patch {
    fn new(columns: &mut PrimitiveColumns, primitives: &[Primitive]) -> Self {
        let mut runs: Vec<ColumnRun> = Vec::new();
        for primitive in primitives {
            let run = columns.push(primitive, Sides::Both);
            match runs.iter_mut().find(|r| r.kind == run.kind) {
                Some(known) => known.range.end = run.range.end,
                None => runs.push(run),
            }
        }
        Self(runs)
    }

    #[inline(always)]
    fn is_hit<S: Simd>(&self, columns: &PrimitiveColumns, probe: &Probe<S>) -> bool {
        self.0.iter().any(|run| columns.any(probe, run, None).is_some())
    }

    /// Hits from the front less hits from the back.
    #[inline(always)]
    fn signed_hits<S: Simd>(&self, columns: &PrimitiveColumns, probe: &Probe<S>) -> i32 {
        let mut count = 0;
        for run in &self.0 {
            for i in run.range.clone() {
                for (sides, sign) in [(Sides::Front, 1), (Sides::Back, -1)] {
                    let alone = ColumnRun { kind: run.kind, sides, range: i..i + 1 };
                    count += if columns.any(probe, &alone, None).is_some() { sign } else { 0 };
                }
            }
        }
        count
    }
}

/// A mesh with the faces around each edge at hand.
struct Target {
    mesh: Mesh,
    faces: Faces,
    columns: PrimitiveColumns,
    all: Patch,
    edges: Vec<([usize; 2], Patch)>,
    origins: Vec<DVec3>,
}

impl Target {
    fn new(mesh: Mesh, faces: Faces, origins: usize) -> Self {
        let mut columns = PrimitiveColumns::default();
        let all = Patch::new(&mut columns, &mesh.primitives(faces));
        let around =
            |edge: [usize; 2]| (edge, Patch::new(&mut columns, &mesh.primitives_around(edge, faces)));
        let edges = mesh.edges().into_iter().map(around).collect();
        let origins = mesh.points(true, origins, &mut Random::new(2013));
        Self { mesh, faces, columns, all, edges, origins }
    }
}

/// Rays from inside a mesh, exactly at its edges and vertices; the first that slips through.
struct AimedRays<'a> {
    target: &'a Target,
    seed: u64,
    count: usize,
}

impl Kernel for AimedRays<'_> {
    type Output = Option<Ray>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<Ray> {
        let Target { mesh, faces, columns, all, edges, origins } = self.target;
        let mut random = Random::new(self.seed);
        for i in 0..self.count {
            let ([a, b], around) = &edges[random.index(edges.len())];
            let (a, b) = (mesh.vertices[*a], mesh.vertices[*b]);
            let origin = origins[random.index(origins.len())];
            let goal = match i % 4 {
                0 => a,
                1 => 0.5 * (a + b),
                _ => a + random.number() * (b - a),
            };
            let Some(direction) = unit(goal - origin) else { continue };
            let ray = Ray::new(origin, if i % 3 == 0 { direction } else { random.nudge(direction) });
            let probe = Probe::new(simd, &ray, Span::FORWARD, true);
            let holds = if *faces == Faces::Polygons {
                // Of polygons that share an edge exactly one is hit.
                all.signed_hits(columns, &probe) == -1
            } else {
                // Faces farther away are looked at only where the edge is part of a silhouette.
                around.is_hit(columns, &probe) || all.is_hit(columns, &probe)
            };
            if !holds {
                return Some(ray);
            }
        }
        None
    }
}

#[test]
fn ray_at_an_edge_or_vertex_never_slips_through() {
    let targets = [
        (Target::new(Mesh::sphere(3), Faces::Triangles, 400), 30),
        (Target::new(Mesh::sphere(3).inside_out(), Faces::Triangles, 400), 10),
        (Target::new(Mesh::tetrahedron(), Faces::Triangles, 400), 8),
        (Target::new(Mesh::cube(), Faces::Triangles, 400), 8),
        (Target::new(Mesh::cube(), Faces::Polygons, 400), 4),
        (Target::new(Mesh::cube(), Faces::Mixed, 400), 8),
        (Target::new(Mesh::l_prism(), Faces::Polygons, 400), 4),
        (Target::new(Mesh::l_prism(), Faces::Mixed, 400), 8),
        (Target::new(Mesh::l_prism(), Faces::Triangles, 400), 8),
        (Target::new(Mesh::spot(), Faces::Triangles, 100), 8),
        (Target::new(Mesh::sphere(1), Faces::Polygons, 400), 4),
    ];
    let shares: usize = targets.iter().map(|(_, share)| share).sum();
    // Seeds belong to chunks, not to threads.
    let chunks: Vec<_> =
        targets.iter().flat_map(|(target, share)| vec![target; *share]).enumerate().collect();
    let (next, slip) = (AtomicUsize::new(0), Mutex::new(None));
    let work = || {
        while let Some(&(seed, target)) = chunks.get(next.fetch_add(1, Ordering::Relaxed)) {
            let count = ray_count().div_ceil(shares);
            let backend = Backend::available()[seed % Backend::available().len()];
            let rays = AimedRays { target, seed: u64::try_from(seed).expect("few chunks"), count };
            if let Some(ray) = backend.run(rays) {
                *slip.lock().expect("no panic") = Some((target.mesh.name, target.faces, backend, ray));
            }
        }
    };
    thread::scope(|scope| {
        let threads = thread::available_parallelism().map_or(1, usize::from);
        (0..threads).for_each(|_| drop(scope.spawn(work)));
    });
    assert_eq!(slip.into_inner().expect("no panic"), None);
}

#[test]
fn ray_along_a_reentrant_wall_never_slips_through() {
    let mut random = Random::new(1962);
    for round in 0..ray_count().div_ceil(500) {
        // The wall of an L in any position, so that it is plane only up to rounding.
        let x = random.unit();
        let y = unit(x.cross(random.unit())).expect("no random vectors are parallel");
        let (z, corner) = (x.cross(y), 10.0 * random.vector());
        let place = |p: DVec3| corner + p.x * x + p.y * y + p.z * z;
        let mesh = Mesh::l_prism().map(place);
        for faces in [Faces::Triangles, Faces::Polygons, Faces::Mixed] {
            let primitives = mesh.primitives(faces);
            for _ in 0..16 {
                let origin = place(DVec3::new(1.0, 0.1 + 0.8 * random.number(), 0.1 + 0.8 * random.number()));
                let goal = place(DVec3::new(1.0, 1.0 + random.number(), random.number()));
                let ray = Ray::between(origin, goal).expect("the goal is farther up");
                let hits = |sides| {
                    let hit = |p: &&Primitive| p.intersect(&ray, Span::FORWARD, sides, None).is_some();
                    i32::try_from(primitives.iter().filter(hit).count()).expect("few faces")
                };
                let (front, back) = (hits(Sides::Front), hits(Sides::Back));
                assert!(front + back > 0, "round {round}, {faces:?}: {ray:?} slips through");
                assert!(back > 0, "round {round}, {faces:?}: {ray:?} leaves without hitting a back");
                if faces == Faces::Polygons {
                    assert_eq!(front - back, -1, "round {round}: {ray:?}");
                }
            }
        }
    }
}

#[test]
fn ray_inside_a_sliver_never_slips_through() {
    // A tetrahedron 1e-32 thin that the ray leaves by the face of p, q and r: seen from the origin it is edge-on but
    // for e^2, so that all its edge functions round to zero. The ray passes the other faces behind its origin only.
    let e = f64::EPSILON;
    let [p, q, r, behind] =
        [[1.0 + e, 1.0, 1.0], [-1.0, e - 1.0, 2.0], [-1.0 - 2.0 * e, -1.0 - e, 3.0], [0.0, 0.0, -5.0]]
            .map(DVec3::from_array);
    let ray = Ray::new(DVec3::ZERO, DVec3::Z);
    let is_hit = |a, b, c| {
        let triangle = Primitive::from(Triangle::new(a, b, c));
        let polygon = Primitive::from(Polygon::new(vec![a, b, c]).expect("it has an area"));
        [triangle, polygon].map(|face| face.intersect(&ray, Span::FORWARD, Sides::Both, None).is_some())
    };
    assert_eq!(is_hit(p, q, r), [true; 2]);
    for (a, b) in [(p, q), (q, r), (r, p)] {
        assert_eq!(is_hit(b, a, behind), [false; 2]);
    }
}

/// Every hit of a patch against the exact crossings.
struct CountedHits<'a>(&'a Target, Ray);

impl Kernel for CountedHits<'_> {
    type Output = (bool, i32);

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> (bool, i32) {
        let Self(target, ray) = self;
        let probe = Probe::new(simd, &ray, Span::FORWARD, true);
        let nearest = target.all.0.iter().any(|run| target.columns.nearest(&probe, run, None).is_some());
        (nearest, target.all.signed_hits(&target.columns, &probe))
    }
}

#[test]
fn crossings_agree_with_exact_predicates() {
    let targets = [
        (Target::new(Mesh::sphere(3), Faces::Triangles, 100), 1500),
        (Target::new(Mesh::tetrahedron(), Faces::Triangles, 100), 10_000),
        (Target::new(Mesh::cube(), Faces::Mixed, 100), 10_000),
        (Target::new(Mesh::l_prism(), Faces::Polygons, 100), 10_000),
        (Target::new(Mesh::spot(), Faces::Triangles, 50), 500),
    ];
    for (seed, (target, rays)) in targets.iter().enumerate() {
        let mut random = Random::new(u64::try_from(seed).expect("few meshes"));
        let outside = target.mesh.points(false, 50, &mut random);
        let mut skipped = 0;
        for i in 0..*rays {
            let is_inside = i % 2 == 0;
            let origins = if is_inside { &target.origins } else { &outside };
            let origin = origins[random.index(origins.len())];
            // Half of the rays from outside towards the mesh, or most would miss it.
            let aim =
                unit(target.origins[random.index(target.origins.len())] + 0.1 * random.vector() - origin);
            let direction = if i % 4 == 1 { aim.unwrap_or(DVec3::X) } else { random.unit() };
            let Some([front, back]) = target.mesh.crossings(origin, direction) else {
                skipped += 1;
                continue;
            };
            let name = target.mesh.name;
            let ray = Ray::new(origin, direction);
            assert_eq!((front + back) % 2, i32::from(is_inside), "{name}: exact parity of {ray:?}");
            assert_eq!(front - back, -i32::from(is_inside), "{name}: exact signed crossings of {ray:?}");
            for &backend in Backend::available() {
                let (is_hit, signed) = backend.run(CountedHits(target, ray));
                assert_eq!(is_hit, front + back > 0, "{name}: {ray:?} on {backend}");
                assert_eq!(signed, front - back, "{name}: {ray:?} on {backend}");
            }
        }
        assert!(skipped * 100 < *rays, "{} of {rays} rays at {} were skipped", skipped, target.mesh.name);
    }
}

#[test]
fn meshes_are_closed_and_their_primitives_flat() {
    for mesh in [Mesh::sphere(3), Mesh::tetrahedron(), Mesh::cube(), Mesh::l_prism(), Mesh::spot()] {
        let n_corners: usize = mesh.faces.iter().map(Vec::len).sum();
        assert_eq!(n_corners, 2 * mesh.edges().len(), "{}: every edge joins two faces", mesh.name);
        assert_eq!(
            mesh.vertices.len() + mesh.faces.len(),
            mesh.edges().len() + 2,
            "{}: no handle",
            mesh.name
        );
        assert!(mesh.vertices.iter().all(|&v| v == snap(v)), "{}: on the grid", mesh.name);
        assert!(mesh.primitives(Faces::Triangles).iter().all(|p| p.kind() == PrimitiveKind::Triangle));
    }
}
