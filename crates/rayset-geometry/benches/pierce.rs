//! Pierce check against two sphere tests, partition against the number of volumes, flat primitives in columns.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayset_geometry::glam::DVec3;
use rayset_geometry::{
    BoundingSphere, ColumnHit, ColumnRun, Cylinder, PARTITION_MARGIN, Polygon, Primitive, PrimitiveColumns,
    Probe, Ray, RayLanes, Sides, Span, Sphere, Triangle, VolumeColumns, unit,
};
use rayset_simd::{Backend, Kernel, Lanes, Simd};

/// Seeded points in the cube from -1 to 1.
fn points() -> impl FnMut() -> DVec3 {
    let mut random = ChaCha8Rng::seed_from_u64(1985);
    move || DVec3::from_array([(); 3].map(|()| (random.next_u64() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0))
}

/// Rays that all look the same way, so that some volumes are in each of B, N and I.
fn rays() -> Vec<Ray> {
    let mut point = points();
    (0..64)
        .map(|_| Ray::between(2.0 * DVec3::NEG_Z + 0.1 * point(), 0.5 * point()).expect("far apart"))
        .collect()
}

/// The paper estimates that a pierce check costs two tests of a ray against a sphere.
fn pierce_check(c: &mut Criterion) {
    let (zone_axis, rays) = (DVec3::Z, rays());
    let zone = Cylinder { anchor: 2.0 * DVec3::NEG_Z, axis: zone_axis, length: 2.0, radius: 0.25 };
    let spheres = [Sphere::new(DVec3::ZERO, 0.5), Sphere::new(0.25 * DVec3::X, 0.5)].map(Primitive::from);
    let mut group = c.benchmark_group("pierce");
    group.throughput(Throughput::Elements(rays.len() as u64));
    group.bench_function("pierce check", |b| {
        b.iter(|| rays.iter().filter(|ray| zone.is_pierced_by(ray.origin(), black_box(ray.at(2.0)))).count());
    });
    group.bench_function("two spheres", |b| {
        let is_hit = |ray: &&Ray| {
            let hits =
                spheres.each_ref().map(|s| s.intersect(ray, Span::FORWARD, Sides::Both, None).is_some());
            hits[0] | hits[1]
        };
        b.iter(|| black_box(&rays).iter().filter(is_hit).count());
    });
    group.finish();
}

/// How many volumes a ray intersects.
struct Partition<'a>(&'a VolumeColumns, &'a Ray, f64);

impl Kernel for Partition<'_> {
    type Output = u32;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> u32 {
        let Self(volumes, ray, slack) = self;
        let lanes = RayLanes::splat(simd, ray);
        let chunks = (0..volumes.len()).step_by(S::F64::LANES);
        chunks.map(|i| volumes.classify(simd, &lanes, slack, i).intersected.count_ones()).sum()
    }
}

fn partition(c: &mut Criterion) {
    let rays = rays();
    let mut group = c.benchmark_group("partition");
    for n in [8_u64, 64, 512] {
        let (mut point, mut volumes) = (points(), VolumeColumns::default());
        (0..n).for_each(|_| volumes.push(&BoundingSphere { center: point(), radius: 0.1 }));
        group.throughput(Throughput::Elements(n * rays.len() as u64));
        for &backend in Backend::available() {
            group.bench_function(BenchmarkId::new(backend.name(), n), |b| {
                let intersected = |ray| backend.run(Partition(&volumes, ray, PARTITION_MARGIN * 4.0));
                b.iter(|| black_box(&rays).iter().map(intersected).sum::<u32>());
            });
        }
    }
    group.finish();
}

/// The nearest hit in a run.
struct Nearest<'a>(&'a PrimitiveColumns, &'a ColumnRun, &'a Ray);

impl Kernel for Nearest<'_> {
    type Output = Option<ColumnHit>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<ColumnHit> {
        let Self(columns, run, ray) = self;
        columns.nearest(&Probe::new(simd, ray, Span::FORWARD, true), run, None)
    }
}

fn flat_primitives(c: &mut Criterion) {
    let (rays, n) = (rays(), 256_u32);
    let (mut point, mut columns) = (points(), PrimitiveColumns::default());
    for _ in 0..n {
        let (center, x) = (point(), unit(point()).expect("not zero"));
        let y = unit(x.cross(point())).expect("not parallel");
        let [a, b, c, d] = [x, y, -x, -y].map(|corner| center + 0.1 * corner);
        columns.push(&Triangle::new(a, b, c).into(), Sides::Both);
        columns.push(&Polygon::new(vec![a, b, c, d]).expect("a square has an area").into(), Sides::Both);
    }
    let mut group = c.benchmark_group("columns");
    group.throughput(Throughput::Elements(u64::from(n) * rays.len() as u64));
    for kind in [rayset_geometry::PrimitiveKind::Triangle, rayset_geometry::PrimitiveKind::Polygon] {
        let run = ColumnRun { kind, sides: Sides::Both, range: 0..n };
        for &backend in Backend::available() {
            group.bench_function(BenchmarkId::new(format!("{kind:?}"), backend), |b| {
                let is_hit = |ray: &&Ray| backend.run(Nearest(&columns, &run, ray)).is_some();
                b.iter(|| black_box(&rays).iter().filter(is_hit).count());
            });
        }
    }
    group.finish();
}

criterion_group!(benches, pierce_check, partition, flat_primitives);
criterion_main!(benches);
