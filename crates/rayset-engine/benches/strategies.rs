//! The strategies on random spheres, on one thread: `cargo bench -p rayset-engine`.

use criterion::{BenchmarkId, Criterion, Throughput};
use rayset_engine::scene::RandomSpheres;
use rayset_engine::{Backend, RenderOptions, StrategyKind, SweepLength, render};

fn strategies(criterion: &mut Criterion) {
    let options = RenderOptions {
        width: 64,
        height: 64,
        // One sweep runs on one thread.
        sweep: SweepLength::WholeImage,
        ..RenderOptions::default()
    };
    for count in [8, 64] {
        let scene = RandomSpheres { count, ..RandomSpheres::default() }.scene().unwrap();
        let mut group = criterion.benchmark_group(format!("{count} spheres, 64 x 64"));
        let rays =
            render(StrategyKind::Standard.bind(&scene).as_ref(), &options).unwrap().counts.total().cast;
        group.throughput(Throughput::Elements(rays));
        for &kind in StrategyKind::ALL {
            for backend in [Backend::Scalar, Backend::widest()] {
                let strategy = kind.bind_on(&scene, backend);
                group.bench_function(BenchmarkId::new(kind.name(), backend), |bencher| {
                    bencher.iter(|| render(strategy.as_ref(), &options).unwrap());
                });
            }
        }
        group.finish();
    }
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    strategies(&mut criterion);
    criterion.final_summary();
}
