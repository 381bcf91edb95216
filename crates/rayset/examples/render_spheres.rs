//! Renders eight random spheres with both strategies of the paper, compares them, and writes an EXR and a PNG:
//! `cargo run --release -p rayset --example render_spheres [FOLDER]`.
#![expect(clippy::print_stdout, reason = "an example shows its result")]

use std::path::PathBuf;

use rayset::engine::{Frame, PlaneSamples, RenderOptions, StrategyKind, render};
use rayset::image::{Image, to_srgb8, write_exr, write_png_rgb8};
use rayset::scene::RandomSpheres;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args_os().nth(1).map_or_else(std::env::temp_dir, PathBuf::from);
    let scene = RandomSpheres { count: 8, seed: 1, ..RandomSpheres::default() }.scene()?;
    let options = RenderOptions { width: 512, height: 512, ..RenderOptions::default() };

    let standard = render(StrategyKind::Standard.bind(&scene).as_ref(), &options)?;
    let speer = render(StrategyKind::Speer1985.bind(&scene).as_ref(), &options)?;
    println!("{}", standard.counts);
    let times = |frame: &Frame| (frame.times.strategy, frame.times.trace);
    println!(
        "standard\n{}took {:?} (in the strategy over all threads, by the clock)\n",
        standard.stats,
        times(&standard)
    );
    println!("speer-1985\n{}took {:?}", speer.stats, times(&speer));
    println!("{} pixels differ", speer.differing_pixels(&standard));

    let mut image = Image::new(standard.width, standard.height)?;
    for plane in standard.planes() {
        match plane.samples {
            PlaneSamples::F32(samples) => image.push_f32(plane.name, samples.to_vec())?,
            PlaneSamples::U32(samples) => image.push_u32(plane.name, samples.to_vec())?,
        }
    }
    write_exr(&folder.join("spheres.exr"), &image)?;
    write_png_rgb8(&folder.join("spheres.png"), image.width(), image.height(), &to_srgb8(&image, 0.0)?)?;
    println!("wrote spheres.exr and spheres.png into {}", folder.display());
    Ok(())
}
