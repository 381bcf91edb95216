//! `cargo xtask study`: studies of many experiments, which go on where they stopped.

use std::fs;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Instant;

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use rayset_study::{Scale, StudyName, write_file};

use crate::{Outcome, project};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  cargo xtask study
  cargo xtask study table1-explained --threads 1
  cargo xtask study --quick --out /tmp/study
  cargo xtask study --report map

Every finished experiment is a line of FOLDER/NAME.jsonl: a run that is stopped, by Ctrl-C or otherwise, goes on there.")]
pub(crate) struct Options {
    /// The studies; all if none is named.
    name: Vec<Name>,
    /// Few experiments: done within half a minute.
    #[arg(long)]
    quick: bool,
    /// The folder for journals and reports.
    #[arg(long, value_name = "FOLDER", default_value_os_t = project::root().join("target/study"))]
    out: PathBuf,
    /// Threads for experiments that only count; what is timed runs on one.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u16).range(1..))]
    threads: u16,
    /// Runs nothing, and prints what the journals say.
    #[arg(long)]
    report: bool,
    /// Runs nothing, and writes what the journals say into docs/study.md.
    #[arg(long, conflicts_with_all = ["report", "quick"])]
    bless: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Name {
    /// Which reading of the paper, on which scenes, gives its Table 1?
    Table1Explained,
    /// Coherence, work and time over the plane of n and resolution.
    Map,
    /// Does section 3 predict times, and do counts of rays by kind?
    CostModel,
}

impl From<Name> for StudyName {
    fn from(name: Name) -> Self {
        match name {
            Name::Table1Explained => Self::Table1Explained,
            Name::Map => Self::Map,
            Name::CostModel => Self::CostModel,
        }
    }
}

pub(crate) fn run(options: &Options) -> Outcome {
    let scale = if options.quick { Scale::Quick } else { Scale::Full };
    let studies: Vec<StudyName> = match options.name.as_slice() {
        [] => StudyName::ALL.to_vec(),
        names => names.iter().copied().map(Into::into).collect(),
    };
    for study in studies {
        if options.bless {
            bless(study, &study.report(&options.out, scale)?)?;
            continue;
        }
        let start = Instant::now();
        if !options.report {
            measure(study, scale, options)?;
        }
        let report = study.report(&options.out, scale)?;
        println!("### {}\n\n{report}", study.name());
        if !options.report {
            let path = options.out.join(format!("{}.md", study.name()));
            write_file(&path, report.as_bytes())?;
            println!("Written to {} in {:.0} s.\n", path.display(), start.elapsed().as_secs_f64());
        }
    }
    Ok(())
}

/// Runs a study with a progress bar on a terminal.
fn measure(study: StudyName, scale: Scale, options: &Options) -> Outcome {
    let bar = ProgressBar::new(0);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = ProgressStyle::with_template("{msg:16} {wide_bar} {pos}/{len} experiments, {eta} left");
    bar.set_style(style.expect("a valid template"));
    bar.set_message(study.name());
    let step = |finished: usize, all: usize| {
        bar.set_length(all as u64);
        bar.set_position(finished as u64);
    };
    let outcome = study.run(&options.out, scale, usize::from(options.threads), &step);
    bar.finish_and_clear();
    Ok(outcome?)
}

/// Writes a report between the marks of its study in docs/study.md.
fn bless(study: StudyName, report: &str) -> Outcome {
    let path = project::root().join("docs/study.md");
    let text = fs::read_to_string(&path)?;
    let (begin, end) = (format!("<!-- {} -->\n", study.name()), format!("<!-- /{} -->", study.name()));
    let missing = || format!("{} has no `{}` ... `{end}`", path.display(), begin.trim());
    let (before, rest) = text.split_once(&begin).ok_or_else(missing)?;
    let (_, after) = rest.split_once(&end).ok_or_else(missing)?;
    write_file(&path, format!("{before}{begin}{report}{end}{after}").as_bytes())?;
    println!("wrote {} of {}", study.name(), path.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_study_can_be_named_as_its_journal_is() {
        for (name, study) in Name::value_variants().iter().zip(StudyName::ALL) {
            assert_eq!(StudyName::from(*name), study);
            assert_eq!(name.to_possible_value().unwrap().get_name(), study.name());
        }
    }

    #[test]
    fn the_document_has_one_place_for_each_study() {
        let text = include_str!("../../docs/study.md");
        for study in StudyName::ALL {
            assert_eq!(text.matches(&format!("<!-- {} -->\n", study.name())).count(), 1, "{}", study.name());
            assert_eq!(text.matches(&format!("<!-- /{} -->\n", study.name())).count(), 1, "{}", study.name());
        }
    }
}
