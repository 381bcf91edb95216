//! `cargo xtask test`: everything that continuous integration runs.

use std::time::Instant;

use crate::{Outcome, identical, project, prove, regress, standard_scenes, tidy};

/// The libraries with features that can be turned off.
const WITH_FEATURES: [&str; 4] = ["rayset-scene", "rayset-engine", "rayset-image", "rayset"];

#[derive(clap::Args)]
#[command(after_help = "Examples:
  cargo xtask test
  cargo xtask test --full")]
pub(crate) struct Options {
    /// Runs the long checks too: standard scenes at full size, 10^8 rays at edges, 10^8 certificates, every combination
    /// of what must not matter, and the proof without each of its conditions. A quarter of an hour more.
    #[arg(long)]
    full: bool,
}

pub(crate) fn run(options: &Options) -> Outcome {
    step("format", || project::run(&mut project::cargo(&["fmt", "--all", "--check"])))?;
    step("lints", || {
        project::run(&mut project::cargo(&["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"]))
    })?;
    step("lints without default features", || {
        let mut arguments = vec!["clippy", "--all-targets", "--no-default-features"];
        arguments.extend(WITH_FEATURES.iter().flat_map(|name| ["--package", name]));
        arguments.extend(["--", "-D", "warnings"]);
        project::run(&mut project::cargo(&arguments))
    })?;
    step("tests", || {
        project::run(project::cargo(&["test", "--workspace", "--no-fail-fast"]).env("INSTA_UPDATE", "no"))
    })?;
    step("tests without default features", || {
        let mut arguments = vec!["test", "--no-default-features", "--no-fail-fast"];
        arguments.extend(WITH_FEATURES.iter().flat_map(|name| ["--package", name]));
        project::run(project::cargo(&arguments).env("INSTA_UPDATE", "no"))
    })?;
    step("documentation", || {
        let mut doc = project::cargo(&["doc", "--workspace", "--no-deps", "--exclude", "xtask"]);
        project::run(doc.env("RUSTDOCFLAGS", "-D warnings"))
    })?;
    step("layers", tidy::run)?;
    step("golden images", regress::run)?;
    step("certificates against brute force", || prove::run(&prove::Options::accept(3_000_000)))?;
    step("the same bits in every way", || identical::run(&identical::Options::new(true)))?;
    if options.full {
        long_checks()?;
    }
    println!("\nall checks passed");
    Ok(())
}

/// What takes minutes.
fn long_checks() -> Outcome {
    step("ray counts of the standard scenes", || standard_scenes::run(&standard_scenes::Options::all()))?;
    step("10^8 rays at edges and vertices", || {
        let mut test =
            project::cargo(&["test", "--release", "--package", "rayset-geometry", "--test", "watertight"]);
        project::run(test.env("RAYSET_WATERTIGHT_RAYS", "100000000"))
    })?;
    step("10^8 certificates against brute force", || prove::run(&prove::Options::accept(100_000_000)))?;
    step("the same bits in every combination", || identical::run(&identical::Options::new(false)))?;
    step("lints of the build that leaves conditions out", || {
        let arguments =
            ["clippy", "-p", "xtask", "--features", "mutations", "--all-targets", "--", "-D", "warnings"];
        project::run(&mut project::cargo(&arguments))
    })?;
    // Last, since it builds this very program anew.
    step("conditions left out", || prove::run(&prove::Options::mutations()))
}

/// Announces a step, runs it, and says how long it took.
fn step(name: &str, run: impl FnOnce() -> Outcome) -> Outcome {
    println!("\n=== {name}");
    let start = Instant::now();
    run().map_err(|error| format!("{name}: {error}"))?;
    println!("=== {name}: passed in {:.0} s", start.elapsed().as_secs_f64());
    Ok(())
}
