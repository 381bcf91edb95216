//! Loads an OBJ file and tells what is in it: `cargo run --release -p rayset-scene --example load_obj -- teapot.obj`.
#![expect(clippy::print_stdout, reason = "an example shows its result")]

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use rayset_scene::{LoadOptions, load_obj};

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args_os().nth(1).ok_or("which OBJ file?")?;
    let start = Instant::now();
    let model = load_obj(Path::new(&path), &LoadOptions::default())?;
    println!("read in {:.0?}", start.elapsed());
    for warning in &model.warnings {
        println!("  {warning}");
    }
    let n_triangles: usize = model.groups.iter().map(|group| group.triangles.len()).sum();
    println!("{n_triangles} triangles in {} groups, {} materials", model.groups.len(), model.materials.len());
    print_peak_memory();
    let start = Instant::now();
    let scene = model.into_scene(&LoadOptions::default())?.scene;
    println!("built in {:.0?}: {} objects", start.elapsed(), scene.objects().len());
    print_peak_memory();
    Ok(())
}

/// Tells what the process has taken at most, where the system knows.
fn print_peak_memory() {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    if let Some(peak) = status.lines().find_map(|line| line.strip_prefix("VmHWM:")) {
        println!("  peak memory {}", peak.trim());
    }
}
