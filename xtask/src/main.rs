//! The regression and statistics suite of rayset: `cargo xtask --help`.
#![expect(clippy::print_stdout, reason = "a command prints its results")]

mod bench;
mod bless;
mod fuzz;
mod golden;
mod identical;
mod instructions;
mod project;
mod prove;
mod regress;
mod report;
mod repro_table1;
mod standard_scenes;
mod study;
mod test;
mod tidy;

use std::error::Error;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use rayset_engine::Backend;

/// What every task returns.
type Outcome = Result<(), Box<dyn Error>>;

/// The regression and statistics suite of rayset.
#[derive(Parser)]
#[command(name = "cargo xtask", version, disable_help_subcommand = true)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Reproduces Table 1 of the paper: prints it beside ours and writes tables, plot and pictures.
    ReproTable1(repro_table1::Options),
    /// Runs all checks: format, lints, tests with and without default features, documentation, layers, regressions.
    Test(test::Options),
    /// Renders the golden scenes with every exact strategy and compares them with fixtures/golden, bit by bit; counts
    /// the instructions it takes, where valgrind is installed.
    Regress,
    /// Accepts what is rendered now: writes goldens, snapshots, docs/table1.md, and the README's picture and table.
    Bless(bless::Options),
    /// Counts the rays of the standard scenes and compares them with those that are published.
    StandardScenes(standard_scenes::Options),
    /// Renders scenes with every exact strategy in every way there is: all pictures must be the same, bit by bit.
    Identical(identical::Options),
    /// Checks the answers of every exact strategy on every backend against brute force, and above all those that
    /// `coherent` gives without a partition, on scenes made to break them.
    Prove(prove::Options),
    /// Runs studies of many experiments: which reading gives Table 1, the plane of n and resolution, the cost model.
    Study(study::Options),
    /// Writes one HTML file with Table 1, the map, the cost model and pictures, from what the others recorded.
    Report(report::Options),
    /// Measures what is worth measuring, two things always side by side.
    Bench(bench::Options),
    /// Fuzzes the readers of OBJ, MTL, NFF and scene files.
    Fuzz(fuzz::Options),
    /// Renders a scene for valgrind to watch: `regress` starts it.
    #[command(hide = true)]
    CountInstructions(instructions::Options),
    /// Checks the layers: which crate may depend on which, and where `unsafe` may stand.
    Tidy,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments.task) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprint!("error: {error}");
            let mut cause = error.source();
            while let Some(error) = cause {
                eprint!(": {error}");
                cause = error.source();
            }
            eprintln!();
            ExitCode::FAILURE
        }
    }
}

fn run(task: &Task) -> Outcome {
    Backend::from_environment().map_err(|error| format!("RAYSET_SIMD: {error}"))?;
    match task {
        Task::ReproTable1(options) => repro_table1::run(options),
        Task::Test(options) => test::run(options),
        Task::Regress => regress::run(),
        Task::Bless(options) => bless::run(options),
        Task::StandardScenes(options) => standard_scenes::run(options),
        Task::Identical(options) => identical::run(options),
        Task::Prove(options) => prove::run(options),
        Task::Study(options) => study::run(options),
        Task::Report(options) => report::run(options),
        Task::Bench(options) => bench::run(options),
        Task::Fuzz(options) => fuzz::run(options),
        Task::CountInstructions(options) => instructions::render_one(options),
        Task::Tidy => tidy::run(),
    }
}
