//! Renders random spheres with both strategies of the paper and compares them:
//! `cargo run --release -p rayset-engine --example trace [COUNT]`.
#![expect(clippy::print_stdout, reason = "an example shows its result")]

use rayset_engine::scene::RandomSpheres;
use rayset_engine::{Backend, RenderOptions, Speer1985, Speer1985Options, Standard, SweepLength, render};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let count = std::env::args().nth(1).map_or(Ok(8), |count| count.parse())?;
    let scene = RandomSpheres { count, ..RandomSpheres::default() }.scene()?;
    // The retained tree runs through the whole image, as in the paper.
    let options =
        RenderOptions { width: 256, height: 256, sweep: SweepLength::WholeImage, ..RenderOptions::default() };

    let standard = render(&Standard::new(&scene), &options)?;
    let reading = Speer1985Options { audit: true, ..Speer1985Options::default() };
    let speer = render(&Speer1985::on(&scene, Backend::active(), reading), &options)?;

    println!("{count} spheres, {} x {} pixels\n\n{}", options.width, options.height, standard.counts);
    println!("standard\n{}", standard.stats);
    println!("speer-1985\n{}", speer.stats);
    let work = |stats: &rayset_engine::Stats| stats.work.in_tests();
    println!("tests: {} of {}", work(&speer.stats), work(&standard.stats));
    println!("pixels that differ: {}", standard.differing_pixels(&speer));
    Ok(())
}
