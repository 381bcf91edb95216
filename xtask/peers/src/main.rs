//! Other libraries beside rayset's strategies, on the same rays in the same process: `cargo xtask bench --peers`.
//!
//! Called with a plan as JSON and a folder for what is measured; a third argument asks for what building takes too.

mod building;
mod converted;
mod embree;
mod ffi;
mod obvhs;
mod parry;
mod parts;
mod plain;
mod single;

use std::error::Error;
use std::io::IsTerminal;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use rayset_scene::Scene;
use rayset_study::{Bench, BenchPlan, Contender, write_file};

use crate::embree::Embree;
use crate::parry::Parry;
use crate::parts::Parts;
use crate::plain::Plain;
use crate::single::Single;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let [plan, out, rest @ ..] = arguments else {
        return Err("this is run by `cargo xtask bench --peers`".into());
    };
    let plan: BenchPlan = serde_json::from_str(plan)?;
    let out = Path::new(out);
    let bar = ProgressBar::new((plan.scenes.len() * (1 + plan.views.len())) as u64);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    bar.set_style(ProgressStyle::with_template("{msg:44} {wide_bar} {pos}/{len}, {elapsed}")?);
    let mut finished = 0;
    let bench = Bench::run_with(&plan, &|scene| peers(scene, plan.threads), &mut |what| {
        bar.set_message(what.to_owned());
        bar.set_position(finished);
        finished += 1;
    })?;
    bar.finish_and_clear();
    println!("{}", bench.write(out, "peers")?);
    if rest.first().is_some_and(|what| what == "building") {
        let text = building::report()?;
        println!("{text}");
        write_file(&out.join("building.md"), text.as_bytes())?;
    }
    Ok(())
}

/// Those that can be bound to a scene; the name of every library that cannot, and why.
type Peers = (Vec<Box<dyn Contender>>, Vec<(String, String)>);

fn peers(scene: &Scene, threads: usize) -> Peers {
    let (mut peers, mut refused): Peers = Default::default();
    let mut refuse = |name: &str, reason: String| refused.push((name.to_owned(), reason));
    let parts = match Parts::of(scene) {
        Ok(parts) if parts.triangles.len() + parts.spheres.len() > 0 => parts,
        outcome => {
            let reason = outcome.err().unwrap_or_else(|| "no primitives".to_owned());
            ["embree", "obvhs", "bvh", "parry3d"].into_iter().for_each(|name| refuse(name, reason.clone()));
            return (peers, refused);
        }
    };
    let extent = scene.extent();
    for robust in [false, true] {
        match Embree::new(&parts, robust, threads) {
            Ok(embree) => {
                let modes = embree::modes(&Arc::new(embree), robust, extent);
                peers.extend(modes.into_iter().map(|mode| Box::new(mode) as Box<dyn Contender>));
            }
            Err(reason) => refuse("embree", reason),
        }
    }
    peers.push(Box::new(Single { library: obvhs::Wide::new(&parts), extent }));
    peers.push(Box::new(Single { library: obvhs::Binary::new(&parts), extent }));
    peers.push(Box::new(Single { library: Plain::new(&parts), extent }));
    match Parry::new(&parts) {
        Ok(library) => peers.push(Box::new(Single { library, extent })),
        Err(reason) => refuse("parry3d", reason),
    }
    (peers, refused)
}
