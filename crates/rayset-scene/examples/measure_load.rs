//! Compares `load_obj` with bare tobj: `cargo run --release -p rayset-scene --example measure_load -- teapot.obj`.
//!
//! Both read the file nine times in turn; the medians and their ratio are printed.
#![expect(clippy::print_stdout, reason = "an example shows its result")]

use std::error::Error;
use std::path::Path;
use std::time::{Duration, Instant};

use rayset_scene::{LoadOptions, load_obj};

const ROUNDS: usize = 9;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args_os().nth(1).ok_or("which OBJ file?")?;
    let path = Path::new(&path);
    let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let (mut ours, mut bare) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        let start = Instant::now();
        let (models, _) = tobj::load_obj(path, &options)?;
        bare.push(start.elapsed());
        drop(models);
        let start = Instant::now();
        let model = load_obj(path, &LoadOptions::default())?;
        ours.push(start.elapsed());
        drop(model);
    }
    let (ours, bare) = (median(ours), median(bare));
    println!("load_obj {ours:.1?}, tobj {bare:.1?}, ratio {:.2}", ours.as_secs_f64() / bare.as_secs_f64());
    Ok(())
}

fn median(mut times: Vec<Duration>) -> Duration {
    times.sort_unstable();
    times[times.len() / 2]
}
