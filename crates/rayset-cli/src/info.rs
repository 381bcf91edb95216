//! `rayset info`.

use std::error::Error;

use rayset::geometry::PrimitiveKind;
use rayset::scene::{Scene, VolumeId};

use crate::Outcome;
use crate::load::Source;

/// In the order in which they are listed.
const KINDS: [PrimitiveKind; 4] =
    [PrimitiveKind::Sphere, PrimitiveKind::Triangle, PrimitiveKind::Polygon, PrimitiveKind::Cone];

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rayset info teapot.obj
  rayset info --split 64 lost_empire.obj")]
pub(crate) struct Options {
    #[command(flatten)]
    source: Source,
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Box<dyn Error>> {
    let loaded = options.source.load()?;
    let scene = &loaded.scene;
    println!("scene       {}", options.source.scene.display());
    println!("objects     {}", scene.objects().len());
    println!("volumes     {}, {} primitives in the largest", scene.volumes().len(), largest_volume(scene));
    let kinds = KINDS.into_iter().filter_map(|kind| {
        let count = scene.primitives().len(kind);
        (count > 0).then(|| format!("{count} {}", plural(kind)))
    });
    println!("primitives  {}: {}", scene.n_primitives(), kinds.collect::<Vec<_>>().join(", "));
    println!("materials   {}", scene.materials().len());
    let directional = scene.lights().iter().filter(|light| light.position().is_none()).count();
    println!("lights      {} point, {directional} directional", scene.lights().len() - directional);
    let (low, high) = (scene.bounds().min, scene.bounds().max);
    println!("bounds      from {low} to {high}");
    let camera = scene.camera();
    println!(
        "camera      from {} at {} up {} angle {}",
        camera.viewpoint(),
        camera.target(),
        camera.up(),
        camera.angle()
    );
    match loaded.resolution {
        Some((width, height)) => println!("resolution  {width}x{height}"),
        None => println!("resolution  not given"),
    }
    println!("warnings    {}", loaded.warnings.len());
    Ok(Outcome::Done)
}

fn largest_volume(scene: &Scene) -> u32 {
    let volumes = 0..u32::try_from(scene.volumes().len()).unwrap_or(u32::MAX);
    let size = |volume: u32| {
        let runs = scene.volume_runs(VolumeId(volume));
        runs.iter().map(|run| run.range.end - run.range.start).sum()
    };
    volumes.map(size).max().unwrap_or(0)
}

fn plural(kind: PrimitiveKind) -> &'static str {
    match kind {
        PrimitiveKind::Sphere => "spheres",
        PrimitiveKind::Triangle => "triangles",
        PrimitiveKind::Polygon => "polygons",
        PrimitiveKind::Cone => "cones and cylinders",
    }
}
