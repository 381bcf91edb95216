//! Every strategy against the standard one; and nothing depends on how the work is cut up.

mod pixels;
mod scenes;

use pixels::assert_same_pixels;
use rayon::{ThreadPool, ThreadPoolBuilder};
use rayset_engine::{
    Backend, Frame, IntersectionStrategy, PixelOrder, Recording, RenderOptions, Speer1985, Speer1985Options,
    Standard, StrategyKind, SweepLength, render,
};
use scenes::TestScene;

/// Sides that are no multiple of a sweep, a bundle or a tile.
const OPTIONS: RenderOptions = RenderOptions {
    width: 41,
    height: 27,
    max_depth: 5,
    cutoff: Some(1.0 / 256.0),
    order: PixelOrder::Scanline,
    sweep: SweepLength::Rows(8),
    bundle_len: None,
    recording: Recording::Off,
};

fn frame(strategy: &dyn IntersectionStrategy, options: &RenderOptions) -> Frame {
    render(strategy, options).unwrap()
}

fn pools() -> Vec<ThreadPool> {
    [1, 2, 3].map(|n| ThreadPoolBuilder::new().num_threads(n).build().unwrap()).into()
}

#[test]
fn every_exact_strategy_gives_the_pixels_and_ray_counts_of_standard() {
    for TestScene { name, scene, .. } in &scenes::all() {
        let expected = frame(&Standard::new(scene), &OPTIONS);
        for &kind in StrategyKind::ALL {
            let strategy = kind.bind(scene);
            if strategy.is_exact() {
                let actual = frame(strategy.as_ref(), &OPTIONS);
                assert_same_pixels(&expected, &actual, format!("{kind}, {name}"));
                assert_eq!(expected.counts, actual.counts, "{kind}, {name}");
            }
        }
    }
}

#[test]
fn strategy_that_is_not_exact_errs_only_where_its_audit_says_so() {
    for TestScene { name, scene, .. } in &scenes::all() {
        let expected = frame(&Standard::new(scene), &OPTIONS);
        for kind in StrategyKind::ALL.iter().filter(|kind| !kind.bind(scene).is_exact()) {
            assert_eq!(*kind, StrategyKind::Speer1985, "{kind} needs an audit of its own");
            let audited = Speer1985Options { audit: true, ..Speer1985Options::default() };
            let actual = frame(&Speer1985::on(scene, Backend::active(), audited), &OPTIONS);
            let wrong = actual.stats.coherence.total().wrong;
            eprintln!("{name}: {wrong} wrong answers, {} wrong pixels", expected.differing_pixels(&actual));
            if wrong == 0 {
                assert_same_pixels(&expected, &actual, format!("{kind} without a wrong answer, {name}"));
                assert_eq!(expected.counts, actual.counts, "{kind}, {name}");
            }
            let unaudited = frame(kind.bind(scene).as_ref(), &OPTIONS);
            assert_same_pixels(&actual, &unaudited, format!("{kind} without an audit, {name}"));
        }
    }
}

#[test]
fn nothing_depends_on_bundles_threads_or_lanes() {
    let (pools, whole) = (pools(), (OPTIONS.width * OPTIONS.height) as usize);
    for TestScene { name, scene, .. } in &scenes::all() {
        for &kind in StrategyKind::ALL {
            let expected = frame(kind.bind(scene).as_ref(), &OPTIONS);
            for &backend in Backend::ALL {
                let strategy = kind.bind_on(scene, backend);
                for bundle_len in [1, 7, 64, whole] {
                    for pool in &pools {
                        let options = RenderOptions { bundle_len: Some(bundle_len), ..OPTIONS };
                        let actual = pool.install(|| frame(strategy.as_ref(), &options));
                        let threads = pool.current_num_threads();
                        let what =
                            format!("{kind}, {name}, {backend}, bundles of {bundle_len}, {threads} threads");
                        assert_same_pixels(&expected, &actual, &what);
                        assert_eq!(expected.counts, actual.counts, "{what}");
                        assert!(expected.stats == actual.stats, "{what}: {}{}", expected.stats, actual.stats);
                    }
                }
            }
        }
    }
}

#[test]
fn neither_pixels_nor_ray_counts_depend_on_the_order_of_pixels() {
    let orders = [PixelOrder::Scanline, PixelOrder::Serpentine, PixelOrder::Tiles(4), PixelOrder::Tiles(16)];
    let sweeps = [SweepLength::Rows(1), SweepLength::Rows(7), SweepLength::WholeImage];
    for TestScene { name, scene, .. } in &scenes::all() {
        let expected = frame(&Standard::new(scene), &OPTIONS);
        for &kind in StrategyKind::ALL {
            let strategy = kind.bind(scene);
            if !strategy.is_exact() {
                continue;
            }
            for (order, sweep) in orders.into_iter().flat_map(|order| sweeps.map(|sweep| (order, sweep))) {
                let actual = frame(strategy.as_ref(), &RenderOptions { order, sweep, ..OPTIONS });
                let what = format!("{kind}, {name}, {order:?}, {sweep:?}");
                assert_same_pixels(&expected, &actual, &what);
                assert_eq!(expected.counts, actual.counts, "{what}");
            }
        }
    }
}

#[test]
fn recording_adds_planes_and_changes_nothing_else() {
    for TestScene { name, scene, .. } in &scenes::all() {
        for &kind in StrategyKind::ALL {
            let (strategy, what) = (kind.bind(scene), format!("{kind}, {name}"));
            let expected = frame(strategy.as_ref(), &OPTIONS);
            let actual =
                frame(strategy.as_ref(), &RenderOptions { recording: Recording::PerQuery, ..OPTIONS });
            assert_same_pixels(&expected, &actual, &what);
            assert_eq!(expected.counts, actual.counts, "{what}");
            assert!(expected.stats == actual.stats, "{what}: {}{}", expected.stats, actual.stats);
            let (rays, coherent) = (actual.rays.unwrap(), actual.coherent.unwrap());
            let cast: u64 = rays.iter().map(|&rays| u64::from(rays)).sum();
            assert_eq!(cast, actual.counts.total().cast, "{what}");
            let coherent: f64 =
                rays.iter().zip(&coherent).map(|(&rays, &share)| f64::from(rays) * f64::from(share)).sum();
            let counted = actual.stats.coherence.total().coherent;
            assert!((coherent - counted as f64).abs() < 0.01, "{what}: {coherent} of {counted}");
        }
    }
}
