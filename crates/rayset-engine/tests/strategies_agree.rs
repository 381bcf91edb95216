//! Every strategy against the standard one; and nothing depends on how the work is cut up.

mod pixels;
mod scenes;

use approx::abs_diff_eq;
use pixels::assert_same_pixels;
use rayon::{ThreadPool, ThreadPoolBuilder};
use rayset_engine::{
    Backend, Crop, EyeRays, Frame, IntersectionStrategy, Layers, PixelOrder, Progress, RenderError,
    RenderOptions, Speer1985, Speer1985Options, Standard, StrategyKind, SweepLength, render, render_observed,
};
use scenes::TestScene;

/// Sides that are no multiple of a sweep, a bundle or a tile.
const OPTIONS: RenderOptions = RenderOptions {
    width: 41,
    height: 27,
    max_depth: 5,
    cutoff: Some(1.0 / 256.0),
    order: Some(PixelOrder::Scanline),
    sweep: SweepLength::Rows(8),
    bundle_len: None,
    layers: Layers::BEAUTY,
    eye_rays: EyeRays::Centers { samples: 1 },
    crop: None,
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
            for &backend in Backend::available() {
                let strategy = kind.bind_on(scene, backend);
                for bundle_len in [1, 7, 64, whole] {
                    // What is retained depends on what the rays before have saved, and nodes are as wide as the lanes.
                    let stats = match kind {
                        StrategyKind::Coherent
                        | StrategyKind::Hierarchical
                        | StrategyKind::Bundle
                        | StrategyKind::Auto => {
                            let options = RenderOptions { bundle_len: Some(bundle_len), ..OPTIONS };
                            frame(strategy.as_ref(), &options).stats
                        }
                        _ => expected.stats.clone(),
                    };
                    for pool in &pools {
                        let options = RenderOptions { bundle_len: Some(bundle_len), ..OPTIONS };
                        let actual = pool.install(|| frame(strategy.as_ref(), &options));
                        let threads = pool.current_num_threads();
                        let what =
                            format!("{kind}, {name}, {backend}, bundles of {bundle_len}, {threads} threads");
                        assert_same_pixels(&expected, &actual, &what);
                        assert_eq!(expected.counts, actual.counts, "{what}");
                        assert!(stats == actual.stats, "{what}: {stats}{}", actual.stats);
                    }
                }
            }
        }
    }
}

#[test]
fn neither_pixels_nor_ray_counts_depend_on_the_order_of_pixels() {
    let orders = [PixelOrder::Scanline, PixelOrder::Serpentine, PixelOrder::Tiles(4), PixelOrder::Morton(16)];
    let sweeps = [SweepLength::Rows(1), SweepLength::Rows(7), SweepLength::WholeImage];
    for TestScene { name, scene, .. } in &scenes::all() {
        let expected = frame(&Standard::new(scene), &OPTIONS);
        for &kind in StrategyKind::ALL {
            let strategy = kind.bind(scene);
            if !strategy.is_exact() {
                continue;
            }
            for (order, sweep) in orders.into_iter().flat_map(|order| sweeps.map(|sweep| (order, sweep))) {
                let actual =
                    frame(strategy.as_ref(), &RenderOptions { order: Some(order), sweep, ..OPTIONS });
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
            let actual = frame(strategy.as_ref(), &RenderOptions { layers: Layers::ALL, ..OPTIONS });
            assert_same_pixels(&expected, &actual, &what);
            assert_eq!(expected.counts, actual.counts, "{what}");
            assert!(expected.stats == actual.stats, "{what}: {}{}", expected.stats, actual.stats);
            let kinds = ["initial", "reflected", "refracted", "shadow"];
            for (kind, tally) in kinds.iter().zip(actual.counts.iter().map(|(_, tally)| tally)) {
                let rays = actual.integers(&format!("rays.{kind}")).unwrap();
                let cast: u64 = rays.iter().map(|&rays| u64::from(rays)).sum();
                assert_eq!(cast, tally.cast, "{what}, {kind}");
            }
            let sum = |name: &str| {
                let plane = actual.integers(name).unwrap();
                plane.iter().map(|&count| u64::from(count)).sum::<u64>()
            };
            assert_eq!(sum("volumes.classified"), actual.stats.work.volumes_classified, "{what}");
            assert_eq!(sum("primitives.tested"), actual.stats.work.primitive_tests, "{what}");
            assert_eq!(sum("pierce.checks"), actual.stats.work.pierce_checks, "{what}");
            let rays = |pixel: usize| -> u32 {
                kinds.iter().map(|kind| actual.integers(&format!("rays.{kind}")).unwrap()[pixel]).sum()
            };
            let share = actual.floats("coherent.all").unwrap();
            let coherent: f64 =
                (0..share.len()).map(|i| f64::from(rays(i)) * f64::from(share[i])).fold(0.0, |a, b| a + b);
            let counted = actual.stats.coherence.total().coherent;
            assert!(
                abs_diff_eq!(coherent, counted as f64, epsilon = 0.01),
                "{what}: {coherent} of {counted}"
            );
        }
    }
}

#[test]
fn layers_show_the_hits_of_the_initial_rays() {
    for TestScene { name, scene, .. } in &scenes::all() {
        let standard = Standard::new(scene);
        let frame = frame(&standard, &RenderOptions { layers: Layers::ALL, ..OPTIONS });
        let (depth, object) = (frame.floats("depth.Z").unwrap(), frame.integers("object.id").unwrap());
        let primitive = frame.integers("primitive.id").unwrap();
        let normal = ["normal.X", "normal.Y", "normal.Z"].map(|name| frame.floats(name).unwrap());
        let hits = depth.iter().filter(|depth| depth.is_finite()).count();
        assert_eq!(hits as u64, frame.counts.initial.hit, "{name}");
        for pixel in 0..depth.len() {
            let length: f32 = normal.iter().map(|plane| plane[pixel] * plane[pixel]).fold(0.0, |a, b| a + b);
            if depth[pixel].is_finite() {
                assert!(abs_diff_eq!(length, 1.0, epsilon = 1e-5), "{name}, {pixel}: {length}");
                let object = &scene.objects()[object[pixel] as usize];
                assert!(object.primitives.contains(&primitive[pixel]), "{name}, {pixel}");
            } else {
                assert_eq!((object[pixel], primitive[pixel]), (u32::MAX, u32::MAX), "{name}, {pixel}");
                assert_eq!(length.to_bits(), 0, "{name}, {pixel}");
            }
        }
    }
}

#[test]
fn crop_has_the_pixels_of_the_whole_image() {
    let crop = Crop { x: 13, y: 5, width: 20, height: 17 };
    for TestScene { name, scene, .. } in &scenes::all() {
        for eye_rays in [EyeRays::default(), EyeRays::Centers { samples: 3 }, EyeRays::Corners] {
            let standard = Standard::new(scene);
            let options = RenderOptions { eye_rays, ..OPTIONS };
            let whole = frame(&standard, &options);
            let part = frame(&standard, &RenderOptions { crop: Some(crop), ..options });
            assert_eq!((part.width, part.height), (20, 17));
            for (whole, part) in whole.beauty.iter().zip(&part.beauty) {
                for (y, row) in part.chunks(20).enumerate() {
                    let start = (y + 5) * 41 + 13;
                    let bits = |row: &[f32]| row.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
                    assert_eq!(bits(&whole[start..start + 20]), bits(row), "{name}, {eye_rays:?}, row {y}");
                }
            }
        }
    }
}

#[test]
fn eye_rays_are_as_many_as_they_should_be_and_no_order_changes_a_mean() {
    for (eye_rays, count) in [
        (EyeRays::Corners, 42 * 28),
        (EyeRays::Centers { samples: 3 }, 41 * 27 * 9),
        (EyeRays::default(), 41 * 27),
    ] {
        for TestScene { name, scene, .. } in &scenes::all() {
            let standard = Standard::new(scene);
            let options = RenderOptions { eye_rays, layers: Layers::ALL, ..OPTIONS };
            assert_eq!(options.n_ray_sets(), count);
            let expected = frame(&standard, &options);
            assert_eq!(expected.counts.initial.cast, count, "{name}");
            for order in [
                PixelOrder::Serpentine,
                PixelOrder::Tiles(4),
                PixelOrder::Tiles(5),
                PixelOrder::Morton(4),
                PixelOrder::Morton(32),
            ] {
                let actual =
                    frame(&standard, &RenderOptions { order: Some(order), bundle_len: Some(7), ..options });
                assert_same_pixels(&expected, &actual, format!("{name}, {eye_rays:?}, {order:?}"));
                for (one, other) in expected.layers.iter().zip(&actual.layers) {
                    assert!(
                        format!("{one:?}") == format!("{other:?}"),
                        "{name}, {eye_rays:?}, {order:?}: {}",
                        one.name
                    );
                }
            }
        }
    }
}

#[test]
fn observer_hears_of_every_ray_and_can_stop() {
    use std::ops::ControlFlow;
    use std::sync::atomic::{AtomicU64, Ordering};
    let scenes = scenes::all();
    let standard = Standard::new(&scenes[0].scene);
    let (sets, rays) = (AtomicU64::new(0), AtomicU64::new(0));
    let count = |progress: Progress| {
        sets.fetch_add(progress.ray_sets, Ordering::Relaxed);
        rays.fetch_add(progress.rays, Ordering::Relaxed);
        ControlFlow::Continue(())
    };
    let frame = render_observed(&standard, &OPTIONS, &count).unwrap();
    assert_eq!(sets.into_inner(), OPTIONS.n_ray_sets());
    assert_eq!(rays.into_inner(), frame.counts.total().cast);
    let stopped = render_observed(&standard, &OPTIONS, &|_| ControlFlow::Break(()));
    assert_eq!(stopped.unwrap_err(), RenderError::Cancelled);
}

#[test]
fn senseless_options_are_refused() {
    let scenes = scenes::all();
    let standard = Standard::new(&scenes[0].scene);
    let crop = |x, y, width, height| Some(Crop { x, y, width, height });
    for options in [
        RenderOptions { width: 0, ..OPTIONS },
        RenderOptions { height: 65_536, ..OPTIONS },
        RenderOptions { max_depth: 0, ..OPTIONS },
        RenderOptions { max_depth: 21, ..OPTIONS },
        RenderOptions { cutoff: Some(f64::NAN), ..OPTIONS },
        RenderOptions { bundle_len: Some(0), ..OPTIONS },
        RenderOptions { crop: crop(0, 0, 0, 1), ..OPTIONS },
        RenderOptions { crop: crop(40, 0, 2, 1), ..OPTIONS },
        RenderOptions { crop: crop(0, u32::MAX, 1, 2), ..OPTIONS },
        RenderOptions { eye_rays: EyeRays::Centers { samples: 0 }, ..OPTIONS },
        RenderOptions { eye_rays: EyeRays::Centers { samples: u32::MAX }, ..OPTIONS },
        RenderOptions { width: 65_535, height: 65_535, eye_rays: EyeRays::Corners, ..OPTIONS },
    ] {
        assert!(matches!(render(&standard, &options), Err(RenderError::Invalid { .. })), "{options:?}");
    }
}
