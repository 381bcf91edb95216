//! The standard scenes small, with the exact numbers of their rays; `cargo xtask standard-scenes` has them large.
#![cfg(feature = "gzip")]

use std::path::Path;

use rayset::engine::{EyeRays, RayTally, RenderOptions, StrategyKind, render};
use rayset::scene::{LoadOptions, load_scene};
use rayset::simd::Backend;

/// Pixels of a side: 65 by 65 rays go through their corners.
const RESOLUTION: u32 = 64;

/// Cast and hit, by kind: initial, reflected, refracted and shadow rays.
const COUNTS: [(&str, [[u64; 2]; 4]); 7] = [
    ("balls", [[0; 2]; 4]),
    ("gears", [[0; 2]; 4]),
    ("mount", [[0; 2]; 4]),
    ("rings", [[0; 2]; 4]),
    ("teapot", [[0; 2]; 4]),
    ("tetra", [[0; 2]; 4]),
    ("tree", [[0; 2]; 4]),
];

fn counts(name: &str) -> [[u64; 2]; 4] {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/nff");
    // Only the teapot's surfaces are hit from both sides.
    let options = LoadOptions { two_sided: name == "teapot", ..LoadOptions::default() };
    let loaded = load_scene(&fixtures.join(format!("{name}.nff.gz")), &options).unwrap();
    let options = RenderOptions {
        width: RESOLUTION,
        height: RESOLUTION,
        eye_rays: EyeRays::Corners,
        max_depth: 5,
        cutoff: None,
        ..RenderOptions::default()
    };
    let strategy = StrategyKind::Standard.bind_on(&loaded.scene, Backend::Portable);
    let counts = render(strategy.as_ref(), &options).unwrap().counts;
    let both = |tally: RayTally| [tally.cast, tally.hit];
    [both(counts.initial), both(counts.reflected), both(counts.refracted), both(counts.shadow)]
}

#[test]
fn rays_of_the_standard_scenes_are_as_many_as_ever() {
    let found = COUNTS.map(|(name, _)| (name, counts(name)));
    assert_eq!(found, COUNTS);
}
