//! `cargo xtask prove`: every answer that `coherent` gives without a partition against brute force, and the answers of
//! every exact strategy on every backend.

mod case;
mod compared;
mod dice;
mod directed;
mod families;
#[cfg(feature = "mutations")]
mod mutations;
mod shapes;
mod specimen;
mod table;
mod watch;

use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use rayon::prelude::*;

use self::case::Case;
use self::compared::Comparisons;
use self::families::Family;
use self::table::Table;
use self::watch::{Findings, Violation};
use crate::Outcome;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  cargo xtask prove
  cargo xtask prove --accept 1000000 --seed 7
  cargo xtask prove --seed 7 --case 123
  cargo xtask prove --mutations")]
pub(crate) struct Options {
    /// How many answers without a partition to check; with --mutations, how many to try before a mutation counts as
    /// survived [default: 100000000; 20000000 with --mutations].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    accept: Option<u64>,
    /// What makes this run's scenes differ from others.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// One case of a run only: that of a violation.
    #[arg(long, value_name = "N", conflicts_with_all = ["accept", "mutations"])]
    case: Option<u64>,
    /// Leaves out one condition of the proof after the other, and fails if the wrong answers are not found.
    #[arg(long)]
    mutations: bool,
}

impl Options {
    /// A run that checks so many answers.
    pub(crate) fn accept(answers: u64) -> Self {
        Self { accept: Some(answers), seed: 1, case: None, mutations: false }
    }

    /// The run that leaves conditions out.
    pub(crate) fn mutations() -> Self {
        Self { accept: None, seed: 1, case: None, mutations: true }
    }
}

/// The exit status of an interrupted run: 128 and the number of the signal, as shells have it.
const INTERRUPTED: i32 = 130;

/// Cases that run together, twice each family: all of them or none count, so that results do not depend on threads.
const ROUND: u64 = 2 * Family::ALL.len() as u64;

static IS_INTERRUPTED: AtomicBool = AtomicBool::new(false);

fn is_interrupted() -> bool {
    IS_INTERRUPTED.load(Ordering::Relaxed)
}

pub(crate) fn run(options: &Options) -> Outcome {
    if options.mutations {
        return mutate(options);
    }
    ctrlc::set_handler(|| IS_INTERRUPTED.store(true, Ordering::Relaxed))?;
    let n_wanted = options.accept.unwrap_or(100_000_000);
    let bar = ProgressBar::new(n_wanted);
    if !std::io::stderr().is_terminal() || options.case.is_some() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = "{wide_bar} {human_pos} of {human_len} acceptances, {per_sec}, {eta} left";
    bar.set_style(ProgressStyle::with_template(style).expect("a valid template"));
    let start = Instant::now();
    let (mut table, mut comparisons, mut first): (Table, Comparisons, Option<Violation>) = Default::default();
    let mut numbers = options.case.map_or(0..ROUND, |case| case..case + 1);
    loop {
        let cases = numbers.clone().into_par_iter().map(|number| {
            let case = Case {
                seed: options.seed,
                number,
                change: &|coherent| coherent,
                to_first: false,
                is_stopped: &is_interrupted,
            };
            let findings = case.run()?;
            bar.inc(findings.tallies.total().checked);
            Ok((case.family(), findings))
        });
        let found: Result<Vec<_>, Box<dyn std::error::Error + Send + Sync>> = cases.collect();
        for (family, findings) in found.map_err(|error| error.to_string())? {
            let Findings { tallies, comparisons: compared, first: violation } = findings;
            table.add(family, &tallies);
            comparisons.absorb(&compared);
            first = first.or(violation);
        }
        let is_done = table.total().checked >= n_wanted || options.case.is_some();
        if is_done || is_interrupted() {
            break;
        }
        numbers = numbers.end..numbers.end + ROUND;
    }
    bar.finish_and_clear();
    let (total, seconds) = (table.total(), start.elapsed().as_secs_f64());
    println!("{table}\n{comparisons}");
    #[expect(clippy::cast_precision_loss, reason = "counts are far below 2^53")]
    let rate = total.checked as f64 / seconds / 1e6;
    println!(
        "{} of {} acceptances checked in {seconds:.0} s, {rate:.2} million a second",
        total.checked, total.accepted
    );
    if let Some(violation) = first {
        println!("\nThe first violation:\n{}", violation.message);
        return Err(format!("{} violations", total.violations + comparisons.violations()).into());
    }
    if is_interrupted() {
        println!("interrupted");
        std::process::exit(INTERRUPTED);
    }
    Ok(())
}

/// The engine leaves out no condition unless it was built for that.
#[cfg(not(feature = "mutations"))]
fn mutate(options: &Options) -> Outcome {
    let mut command = crate::project::cargo(&["run", "--release", "--package", "xtask"]);
    command.args(["--features", "mutations", "--", "prove", "--mutations"]);
    command.args(["--seed", &options.seed.to_string()]);
    if let Some(accept) = options.accept {
        command.args(["--accept", &accept.to_string()]);
    }
    crate::project::run(&mut command)
}

#[cfg(feature = "mutations")]
fn mutate(options: &Options) -> Outcome {
    mutations::run(options.seed, options.accept.unwrap_or(20_000_000))
}
