//! `cargo xtask bench coherence`.

use std::fs;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use rayset_study::{Coherence, CoherencePlan, StudyError, write_file};

use super::bless;
use crate::{Outcome, project};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  cargo xtask bench coherence
  cargo xtask bench coherence --quick
  cargo xtask bench coherence --out /tmp/bench
  cargo xtask bench coherence --bless

Times are those inside the calls of the strategy, of one thread, on random spheres in tiles of 16 x 16 pixels;
`standard` and `coherent` take turns band by band. The machine should have nothing else to do.")]
pub(crate) struct Options {
    /// Images of 64 x 64 pixels only: done within half a minute.
    #[arg(long)]
    quick: bool,
    /// The folder for the tables and the figures as JSON.
    #[arg(long, value_name = "FOLDER", default_value_os_t = project::root().join("target/bench"))]
    out: PathBuf,
    /// Writes the tables into docs/coherence.md and README.md too.
    #[arg(long, conflicts_with = "quick")]
    bless: bool,
}

pub(crate) fn run(options: &Options) -> Outcome {
    let json = options.out.join("coherence.json");
    // An output that cannot be written is found out before the minutes are spent.
    let probe = options.out.join(".writable");
    write_file(&probe, b"")?;
    fs::remove_file(&probe)?;
    let start = Instant::now();
    let plan = if options.quick { CoherencePlan::quick() } else { CoherencePlan::full() };
    let result = measure(&plan)?;
    let tables = result.to_markdown();
    println!("{tables}");
    write_file(&json, &serde_json::to_vec_pretty(&result)?)?;
    write_file(&options.out.join("coherence.md"), tables.as_bytes())?;
    println!("Written to {} in {:.0} s.", options.out.display(), start.elapsed().as_secs_f64());
    if options.bless {
        bless("docs/coherence.md", "coherence", &tables)?;
        bless("README.md", "coherence", &result.summary())?;
    }
    Ok(())
}

/// Measures with a progress bar on a terminal.
fn measure(plan: &CoherencePlan) -> Result<Coherence, StudyError> {
    let bar = ProgressBar::new(plan.cells.len() as u64);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = ProgressStyle::with_template("{msg:28} {wide_bar} {pos}/{len} scenes, {eta} left");
    bar.set_style(style.expect("a valid template"));
    let mut finished = 0;
    let result = Coherence::run(plan, &mut |cell| {
        bar.set_message(format!("n {} at {}, {}", cell.spheres, cell.resolution, cell.backend));
        bar.set_position(finished);
        finished += 1;
    });
    bar.finish_and_clear();
    result
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_documents_have_a_place_for_it() {
        for text in [include_str!("../../../docs/coherence.md"), include_str!("../../../README.md")] {
            assert_eq!(text.matches("<!-- coherence -->\n").count(), 1);
            assert_eq!(text.matches("<!-- /coherence -->\n").count(), 1);
        }
    }
}
