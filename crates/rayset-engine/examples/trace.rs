//! Renders random spheres with the strategies that retain something and compares them with `standard`:
//! `cargo run --release -p rayset-engine --example trace [COUNT [RESOLUTION]]`.
#![expect(clippy::print_stdout, reason = "an example shows its result")]

use rayset_engine::scene::{RandomSpheres, SphereSize};
use rayset_engine::{
    Backend, Coherent, PixelOrder, RenderOptions, Speer1985, Speer1985Options, Standard, SweepLength, render,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let argument = |i: usize, default: u32| std::env::args().nth(i).map_or(Ok(default), |text| text.parse());
    let (count, resolution) = (argument(1, 8)?, argument(2, 256)?);
    // More than a few of the usual size would fill the cube.
    let size = if count > 8 { SphereSize::Coverage(0.5) } else { RandomSpheres::default().size };
    let scene = RandomSpheres { count, size, ..RandomSpheres::default() }.scene()?;
    // The retained tree runs through the whole image, as in the paper.
    let paper = RenderOptions {
        width: resolution,
        height: resolution,
        sweep: SweepLength::WholeImage,
        ..RenderOptions::default()
    };
    let standard = render(&Standard::on(&scene, Backend::Scalar), &paper)?;
    let reading = Speer1985Options { audit: true, ..Speer1985Options::default() };
    let speer = render(&Speer1985::on(&scene, Backend::Scalar, reading), &paper)?;
    let tiles =
        RenderOptions { order: Some(PixelOrder::Tiles(16)), sweep: RenderOptions::default().sweep, ..paper };
    let coherent = render(&Coherent::on(&scene, Backend::Scalar), &tiles)?;

    println!("{count} spheres, {resolution} x {resolution} pixels\n\n{}", standard.counts);
    println!("standard\n{}", standard.stats);
    for (name, frame) in [("speer-1985", &speer), ("coherent, in tiles", &coherent)] {
        let (tests, of) = (frame.stats.work.in_tests(), standard.stats.work.in_tests());
        println!("{name}\n{}", frame.stats);
        println!("tests: {tests} of {of}, {:.3}", tests as f64 / of as f64);
        println!("pixels that differ from standard: {}\n", standard.differing_pixels(frame));
    }
    Ok(())
}
