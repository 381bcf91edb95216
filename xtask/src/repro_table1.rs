//! `cargo xtask repro-table1`.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use rayset_engine::Backend;
use rayset_study::{Reading, Table1, Table1Plan, write_file};

use crate::{Outcome, project};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  cargo xtask repro-table1
  cargo xtask repro-table1 --quick
  cargo xtask repro-table1 --resolution 256 --seeds 32 --cutoff off --out /tmp/table1
  cargo xtask repro-table1 --quick --reading misses=cylinder --reading light_rays=all

Options of the reading, the first choice being the default:
  misses = partition, cylinder
  light_rays = blocked, all, none
  blocker = nearest, first
  slab = overlapping, centre, inside
  end_planes = side-only, closed
  matching = any-origin, same-object, same-object-and-side
  inheritance = formative, nothing
  originating = excluded, included")]
pub(crate) struct Options {
    /// Small images and few seeds: done within a minute.
    #[arg(long)]
    quick: bool,
    /// The folder for tables, plot and pictures.
    #[arg(long, value_name = "FOLDER", default_value_os_t = project::root().join("target/repro/table1"))]
    out: PathBuf,
    /// The number of seeds: scenes for each number of spheres.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=100_000))]
    seeds: Option<u64>,
    /// How often each frame is rendered with each strategy.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    repetitions: Option<u16>,
    /// The side of the square images of spheres, in pixels; `speer-1985-nearest` keeps its own, its depth and its cut-off.
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=16_384))]
    resolution: Option<u32>,
    /// The greatest depth of a tree; the initial ray has depth 1.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(rayset_engine::MAX_DEPTH)))]
    depth: Option<u32>,
    /// The adaptive cut-off: a share of a pixel's intensity, or `off`.
    #[arg(long, value_name = "X|off", value_parser = cutoff)]
    cutoff: Option<Cutoff>,
    /// The lanes of both strategies; `scalar` is the paper's setting.
    #[arg(long, value_name = "NAME", default_value = "scalar")]
    backend: Backend,
    /// Adds a reading of section 2.3 in which a place that the text leaves open is read in another way; may be given
    /// several times, all for one reading.
    #[arg(long, value_name = "OPTION=CHOICE")]
    reading: Vec<String>,
    /// Leaves the meshes out.
    #[arg(long)]
    no_meshes: bool,
}

#[derive(Clone, Copy)]
struct Cutoff(Option<f64>);

fn cutoff(text: &str) -> Result<Cutoff, String> {
    if text == "off" {
        return Ok(Cutoff(None));
    }
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(Cutoff(Some(value))),
        _ => Err("a cut-off is a number from 0 to 1, or `off`".to_owned()),
    }
}

impl Options {
    fn plan(&self) -> Result<Table1Plan, Box<dyn std::error::Error>> {
        let fixtures = project::fixtures();
        let mut plan = if self.quick { Table1Plan::quick(fixtures) } else { Table1Plan::full(fixtures) };
        if let Some(seeds) = self.seeds {
            plan.seeds = (1..=seeds).collect();
        }
        if let Some(repetitions) = self.repetitions {
            plan.repetitions = usize::from(repetitions);
            plan.mesh_repetitions = usize::from(repetitions);
        }
        if self.no_meshes {
            plan.mesh_resolutions = [0; 4];
        }
        plan.resolution = self.resolution.unwrap_or(plan.resolution);
        plan.max_depth = self.depth.unwrap_or(plan.max_depth);
        plan.cutoff = self.cutoff.map_or(plan.cutoff, |cutoff| cutoff.0);
        plan.backend = self.backend;
        if !self.reading.is_empty() {
            let mut reading = Reading { name: self.reading.join(","), ..Reading::literal() };
            for choice in &self.reading {
                let (option, choice) =
                    choice.split_once('=').ok_or(format!("`{choice}` is not OPTION=CHOICE"))?;
                reading.options.choose(option, choice)?;
            }
            plan.readings.push(reading);
        }
        Ok(plan)
    }
}

pub(crate) fn run(options: &Options) -> Outcome {
    let plan = options.plan()?;
    // An output that cannot be written is found out before the minutes are spent.
    let probe = options.out.join(".writable");
    write_file(&probe, b"")?;
    std::fs::remove_file(&probe)?;
    let start = Instant::now();
    let table = measure(&plan)?;
    table.write(&options.out)?;
    println!("{}", table.to_markdown());
    println!("Written to {} in {:.0} s.", options.out.display(), start.elapsed().as_secs_f64());
    Ok(())
}

/// Runs the experiment with a progress bar on a terminal.
pub(crate) fn measure(plan: &Table1Plan) -> Result<Table1, rayset_study::StudyError> {
    let bar = ProgressBar::new(plan.n_steps() as u64);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = ProgressStyle::with_template("{msg:16} {wide_bar} {pos}/{len} steps, {eta} left");
    bar.set_style(style.expect("a valid template"));
    let table = Table1::run(plan, &mut |scene| {
        bar.set_message(scene.to_owned());
        bar.inc(1);
    });
    bar.finish_and_clear();
    table
}

#[cfg(test)]
mod tests {
    use rayset_engine::Speer1985Options;

    #[test]
    fn help_lists_every_choice() {
        let help = <crate::Arguments as clap::CommandFactory>::command();
        let help = help.find_subcommand("repro-table1").unwrap().get_after_help().unwrap().to_string();
        for (option, choices) in Speer1985Options::CHOICES {
            assert!(help.contains(&format!("{option} = {}", choices.join(", "))), "{option}");
        }
    }
}
