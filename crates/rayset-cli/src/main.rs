//! The `rayset` command: `rayset --help`.
#![expect(clippy::print_stdout, reason = "a command prints its results")]

mod audit;
mod compare;
mod info;
mod interrupt;
mod load;
mod progress;
mod render;
mod statistics;
mod values;

use std::error::Error;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use rayset::simd::Backend;

/// Renders scenes by Whitted's rule with exact, repeatable double-precision hits, and compares images bit by bit.
#[derive(Parser)]
#[command(
    name = "rayset",
    disable_help_subcommand = true,
    after_help = "Exit status:
  0    done
  1    the images differ, or an audit found a wrong answer
  2    an error; its message says where
  130  interrupted; nothing half done was written

RAYSET_SIMD=scalar|portable|avx2|avx512 chooses the SIMD backend; no result depends on it."
)]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Renders a scene to EXR or PNG, with statistics as layers and JSON.
    Render(Box<render::Options>),
    /// Compares two EXR files bit by bit, layer by layer.
    Compare(compare::Options),
    /// Says what a scene holds.
    Info(info::Options),
}

/// How a task that met no error ended.
enum Outcome {
    /// As it should.
    Done,
    /// What was compared differs.
    Differs,
    /// The user stopped it.
    Interrupted,
}

fn main() -> ExitCode {
    match run() {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Differs) => ExitCode::from(1),
        Ok(Outcome::Interrupted) => {
            eprintln!("interrupted: nothing was written");
            ExitCode::from(interrupt::STATUS)
        }
        Err(error) => {
            eprint!("error: {error}");
            let mut cause = error.source();
            while let Some(error) = cause {
                eprint!(": {error}");
                cause = error.source();
            }
            eprintln!();
            ExitCode::from(2)
        }
    }
}

fn run() -> Result<Outcome, Box<dyn Error>> {
    let backend = Backend::from_environment().map_err(|error| format!("RAYSET_SIMD: {error}"));
    let name = backend.as_ref().map_or("unknown", |_| Backend::active().name());
    let version = format!("{} (SIMD backend: {name})", env!("CARGO_PKG_VERSION"));
    let matches = Arguments::command().version(version).get_matches();
    let arguments = Arguments::from_arg_matches(&matches)?;
    backend?;
    match &arguments.task {
        Task::Render(options) => render::run(options),
        Task::Compare(options) => compare::run(options),
        Task::Info(options) => info::run(options),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_are_consistent() {
        Arguments::command().debug_assert();
    }
}
