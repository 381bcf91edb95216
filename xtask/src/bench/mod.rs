//! `cargo xtask bench`: times, as ratios of two things that took turns on the same machine.

mod coherence;

use crate::Outcome;

#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand)]
enum What {
    /// What coherence gains: `coherent` beside `standard`, in time and tests, over n, resolution and lanes.
    Coherence(coherence::Options),
}

pub(crate) fn run(options: &Options) -> Outcome {
    match &options.what {
        What::Coherence(options) => coherence::run(options),
    }
}
