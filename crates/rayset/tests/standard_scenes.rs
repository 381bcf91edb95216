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
    ("balls", [[4225, 4225], [2715, 1955], [0, 0], [15_266, 4486]]),
    ("gears", [[4225, 3907], [4823, 3353], [3128, 2613], [35_396, 19_061]]),
    ("mount", [[4225, 2718], [5458, 4262], [5458, 3050], [6402, 3909]]),
    ("rings", [[4225, 4225], [4896, 2769], [0, 0], [17_230, 8028]]),
    ("teapot", [[4225, 2541], [3557, 1065], [0, 0], [6409, 612]]),
    ("tetra", [[4225, 779], [0, 0], [0, 0], [726, 79]]),
    ("tree", [[4225, 2704], [0, 0], [0, 0], [17_510, 697]]),
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
    for (name, expected) in COUNTS {
        assert_eq!(counts(name), expected, "{name}");
    }
}
