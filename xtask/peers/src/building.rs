//! How long it takes to build, and how much memory is taken: a million triangles.

use std::fmt::Write as _;
use std::time::Instant;

use rayset_bvh::Hierarchy;
use rayset_engine::StrategyKind;
use rayset_engine::geometry::{Primitive, Sides, Triangle};
use rayset_engine::scene::glam::DVec3;
use rayset_engine::scene::{Material, Scene, SceneBuilder};
use rayset_study::Spread;

use crate::embree::Embree;
use crate::parts::Parts;

/// Quads around and from pole to pole: a million triangles.
const AROUND: u32 = 1000;
const DOWN: u32 = 500;

/// How often each builds.
const REPETITIONS: usize = 3;

/// Threads that build.
const THREADS: usize = 2;

/// A sphere with bumps; triangles at the poles are slivers, as in real meshes.
fn triangles() -> Vec<Triangle> {
    let point = |i: u32, j: u32| {
        let (u, v) =
            (f64::from(i % AROUND) / f64::from(AROUND), (f64::from(j) + 0.5) / (f64::from(DOWN) + 1.0));
        let (u, v) = (u * std::f64::consts::TAU, v * std::f64::consts::PI);
        let ((sin_u, cos_u), (sin_v, cos_v)) = (libm::sincos(u), libm::sincos(v));
        let radius = 1.0 + 0.05 * libm::sin(40.0 * u) * libm::sin(31.0 * v);
        radius * DVec3::new(sin_v * cos_u, cos_v, sin_v * sin_u)
    };
    let quads = (0..DOWN).flat_map(|j| (0..AROUND).map(move |i| (i, j)));
    quads
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
            [Triangle::new(a, b, c), Triangle::new(a, c, d)]
        })
        .collect()
}

/// Builds in turns, and says in Markdown what it took.
pub(crate) fn report() -> Result<String, Box<dyn std::error::Error>> {
    let triangles = triangles();
    let n = triangles.len();
    let bytes_of = |bytes: usize| bytes / n;
    let mut builder = SceneBuilder::new();
    let material = builder.add_material(Material::default());
    builder.add_object("mesh".to_owned(), material, triangles.iter().copied());
    let scene: Scene = builder.build()?;
    let parts = Parts::of(&scene)?;
    let primitives: Vec<Primitive> = triangles.into_iter().map(Primitive::from).collect();
    let bytes = bytes_of(Hierarchy::new(primitives.iter().map(|primitive| (primitive, Sides::Both))).bytes());
    drop(primitives);
    let (mut ours, mut theirs, mut held) = (Vec::new(), Vec::new(), 0);
    for _ in 0..REPETITIONS {
        let start = Instant::now();
        drop(StrategyKind::Hierarchical.bind(&scene));
        ours.push(start.elapsed().as_secs_f64());
        let embree = Embree::new(&parts, false, THREADS)?;
        theirs.push(embree.commit_seconds);
        held = bytes_of(usize::try_from(embree.bytes).unwrap_or(0));
    }
    let (ours, theirs) = (Spread::of(&ours), Spread::of(&theirs));
    let mut text = format!("### Building over {n} triangles, {THREADS} threads\n\n");
    text.push_str("| | seconds, median | least | bytes a primitive |\n|---|---:|---:|---:|\n");
    let _ = writeln!(
        text,
        "| `hierarchical`, from the scene | {:.3} | {:.3} | {bytes} |",
        ours.median, ours.least
    );
    let _ = writeln!(text, "| `rtcCommitScene` | {:.3} | {:.3} | {held} |", theirs.median, theirs.least);
    text.push_str(
        "\nBytes are those of the hierarchy with its primitives; of Embree, all that it reports to hold, \
         with its 48 bytes of copied corners and faces a triangle.\n",
    );
    Ok(text)
}
