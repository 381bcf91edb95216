//! `cargo xtask bench`: times, always of things that took turns on the same machine.

mod coherence;
mod povray;
mod strategies;

use rayset_study::write_file;

use crate::bless::replace_marked;
use crate::{Outcome, project};

#[derive(clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Examples:
  cargo xtask bench
  cargo xtask bench --quick
  cargo xtask bench --scene spheres-16k --scene knob --only hierarchical --only cellular
  cargo xtask bench --scene model.obj --view crop --threads 2
  cargo xtask bench --peers --quick
  cargo xtask bench --peers --bless
  cargo xtask bench coherence
  cargo xtask bench povray

Every strategy answers the same rays, recorded once a scene, in turns, list by list; answers are compared bit by bit.
Times are those of the processor, of the calls alone. A strategy that needs thousands of tests a ray is skipped.
Tables, figures as JSON, and a plot are written. The machine should have nothing else to do."
)]
pub(crate) struct Options {
    #[command(subcommand)]
    what: Option<What>,
    #[command(flatten)]
    strategies: strategies::Options,
}

#[derive(clap::Subcommand)]
enum What {
    /// What coherence gains: `coherent` beside `standard`, in time and tests, over n, resolution and lanes.
    Coherence(coherence::Options),
    /// Whole pictures of standard scenes beside POV-Ray 3.7, which must be installed.
    Povray(povray::Options),
}

pub(crate) fn run(options: &Options) -> Outcome {
    match &options.what {
        Some(What::Coherence(options)) => coherence::run(options),
        Some(What::Povray(options)) => povray::run(options),
        None => strategies::run(&options.strategies),
    }
}

/// Writes what was measured between the marks of a document.
fn bless(document: &str, mark: &str, contents: &str) -> Outcome {
    let path = project::root().join(document);
    let text = std::fs::read_to_string(&path)?;
    write_file(&path, replace_marked(&text, mark, contents)?.as_bytes())?;
    println!("wrote {}", path.display());
    Ok(())
}
