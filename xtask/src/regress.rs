//! `cargo xtask regress`.

use rayset_engine::StrategyKind;
use rayset_image::{compare, difference_image, read_exr, write_exr};

use crate::{Outcome, golden, instructions, project};

/// Renders the golden scenes with every exact strategy and compares them with the goldens, bit by bit; then counts
/// instructions.
///
/// Actual and difference images of failures are left in `target/regress`.
pub(crate) fn run() -> Outcome {
    let folder = project::root().join("target/regress");
    let mut failures = 0;
    for scene in golden::scenes()? {
        let expected = read_exr(&project::fixtures().join("golden").join(format!("{}.exr", scene.name)))?;
        let reference = golden::frame(&scene, StrategyKind::Standard)?;
        for &kind in StrategyKind::ALL {
            let frame = golden::frame(&scene, kind)?;
            if !kind.bind(&scene.scene).is_exact() {
                let wrong = frame.differing_pixels(&reference);
                println!("{:16} {kind:12} {wrong} wrong pixels (it is not exact)", scene.name);
                continue;
            }
            if frame.counts != reference.counts {
                println!(
                    "{:16} {kind:12} casts other rays:\n{}{}",
                    scene.name, frame.counts, reference.counts
                );
                failures += 1;
            }
            let actual = golden::image(&scene, &frame)?;
            let comparison = compare(&expected, &actual, 0.0)?;
            if comparison.is_identical() {
                println!("{:16} {kind:12} identical", scene.name);
                continue;
            }
            failures += 1;
            println!("{:16} {kind:12} differs\n{comparison}", scene.name);
            std::fs::create_dir_all(&folder)?;
            let stem = format!("{}-{kind}", scene.name);
            write_exr(&folder.join(format!("{stem}.actual.exr")), &actual)?;
            write_exr(&folder.join(format!("{stem}.diff.exr")), &difference_image(&expected, &actual)?)?;
        }
    }
    match failures {
        0 => instructions::check(),
        _ => Err(format!(
            "{failures} golden images differ; see {}; `cargo xtask bless` accepts them",
            folder.display()
        )
        .into()),
    }
}
