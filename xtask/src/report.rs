//! `cargo xtask report`.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use rayset_study::{ReportPlan, write_file};

use crate::{Outcome, project};

/// The name of the file.
const FILE: &str = "rayset.html";

#[derive(clap::Args)]
#[command(after_help = "Examples:
  cargo xtask report
  cargo xtask report --quick --out /tmp/report
  cargo xtask study && cargo xtask repro-table1 && cargo xtask report

The report is FOLDER/rayset.html: one file with all figures inside, to be read in any browser, without a network.
It shows what `study` and `repro-table1` recorded; what was never run is run in its quick form, and the report says so.
Every finished experiment of a study is recorded: a run that is stopped, by Ctrl-C or otherwise, goes on there; only the
quick form of Table 1, half a minute, begins again. A report that was there stays until the new one is whole.")]
pub(crate) struct Options {
    /// Small pictures, and the quick forms of the studies: about a minute.
    #[arg(long)]
    quick: bool,
    /// The folder for the report.
    #[arg(long, value_name = "FOLDER", default_value_os_t = project::root().join("target/report"))]
    out: PathBuf,
    /// The folder of the studies' journals.
    #[arg(long, value_name = "FOLDER", default_value_os_t = project::root().join("target/study"))]
    study: PathBuf,
    /// The folder of the results of Table 1.
    #[arg(long, value_name = "FOLDER", default_value_os_t = project::root().join("target/repro/table1"))]
    table1: PathBuf,
}

impl Options {
    fn plan(&self) -> ReportPlan {
        // Without the folders: the same records give the same bytes wherever they lie.
        let command = if self.quick { "cargo xtask report --quick" } else { "cargo xtask report" };
        let make = if self.quick { ReportPlan::quick } else { ReportPlan::full };
        make(command.to_owned(), self.study.clone(), self.table1.clone(), project::fixtures())
    }
}

pub(crate) fn run(options: &Options) -> Outcome {
    // An output that cannot be written is found out before the minutes are spent.
    let probe = options.out.join(".writable");
    write_file(&probe, b"")?;
    std::fs::remove_file(&probe)?;
    let start = Instant::now();
    let html = with_progress(&options.plan())?;
    let path = options.out.join(FILE);
    write_file(&path, html.as_bytes())?;
    println!(
        "Written to {} ({} kB) in {:.0} s.",
        path.display(),
        html.len().div_ceil(1000),
        start.elapsed().as_secs_f64()
    );
    Ok(())
}

/// Makes the report with a progress bar on a terminal.
fn with_progress(plan: &ReportPlan) -> Result<String, rayset_study::StudyError> {
    let bar = ProgressBar::new(0);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = ProgressStyle::with_template("{msg:24} {wide_bar} {pos}/{len} steps, {eta} left");
    bar.set_style(style.expect("a valid template"));
    let step = |part: &str, done: usize, all: usize| {
        if bar.message() != part {
            bar.set_message(part.to_owned());
            bar.reset();
        }
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    };
    let html = plan.html(&step);
    bar.finish_and_clear();
    html
}
