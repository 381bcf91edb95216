//! `cargo xtask fuzz`: libFuzzer on the scene readers, with the stable compiler.

use std::path::PathBuf;
use std::{fs, io};

use clap::ValueEnum;

use crate::{Outcome, project};

/// What `cargo fuzz` would pass to the compiler, but for sanitizers, which only the nightly one has.
const COVERAGE: &str = "--cfg fuzzing -Ccodegen-units=1 -Cpasses=sancov-module \
    -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares";

/// The most bytes of an input that is tried, and of one that is kept in fixtures/fuzz.
const MAX_BYTES: u32 = 4096;
const MAX_KEPT_BYTES: u32 = 192;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  cargo xtask fuzz
  cargo xtask fuzz obj --seconds 60
  cargo xtask fuzz --minimize

Needs a C++ compiler. New inputs go to target/fuzz/corpus; a finding goes to target/fuzz/findings and ends the run.")]
pub(crate) struct Options {
    /// The reader; all of them, one after the other, if none is named.
    reader: Option<Reader>,
    /// How long each reader is fuzzed.
    #[arg(long, value_name = "SECONDS", default_value_t = 600)]
    seconds: u32,
    /// Writes the smallest set of inputs with the same coverage to fixtures/fuzz, and fuzzes no more.
    #[arg(long)]
    minimize: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Reader {
    Obj,
    Mtl,
    Nff,
    Toml,
}

impl Reader {
    fn name(self) -> &'static str {
        match self {
            Self::Obj => "obj",
            Self::Mtl => "mtl",
            Self::Nff => "nff",
            Self::Toml => "toml",
        }
    }

    /// Files that are good to begin with, besides the committed corpus.
    fn seeds(self) -> Vec<PathBuf> {
        let folder = match self {
            Self::Obj | Self::Mtl => "obj/torture",
            Self::Nff => "nff",
            Self::Toml => "scenes",
        };
        vec![project::fixtures().join(folder)]
    }
}

pub(crate) fn run(options: &Options) -> Outcome {
    let readers = options.reader.map_or_else(|| Reader::value_variants().to_vec(), |reader| vec![reader]);
    let manifest = project::root().join("crates/rayset-scene/fuzz/Cargo.toml");
    let target = project::root().join("target/fuzz");
    let manifest = manifest.to_string_lossy().into_owned();
    // With a target triple the flags are not passed to build scripts.
    let triple = host()?;
    let mut build =
        project::cargo(&["build", "--release", "--manifest-path", &manifest, "--target", &triple]);
    project::run(build.env("RUSTFLAGS", COVERAGE).env("CARGO_TARGET_DIR", &target))?;
    for reader in readers {
        let name = reader.name();
        let binary = target.join(&triple).join("release").join(name);
        let corpus = target.join("corpus").join(name);
        let committed = project::fixtures().join("fuzz").join(name);
        let findings = target.join("findings").join(name);
        for folder in [&corpus, &committed, &findings] {
            fs::create_dir_all(folder)?;
        }
        let mut command = std::process::Command::new(&binary);
        command.current_dir(&target).arg("-timeout=10").arg("-rss_limit_mb=2048").arg("-verbosity=1");
        if options.minimize {
            let fresh = target.join("minimized").join(name);
            remove(&fresh)?;
            fs::create_dir_all(&fresh)?;
            command
                .args(["-set_cover_merge=1", "-use_counters=0", "-use_value_profile=0"])
                .arg(format!("-max_len={MAX_KEPT_BYTES}"))
                .arg(&fresh)
                .arg(&corpus)
                .arg(&committed);
            project::run(&mut command)?;
            remove(&committed)?;
            fs::rename(&fresh, &committed)?;
            continue;
        }
        println!("fuzzing the reader of {name} for {} s", options.seconds);
        command
            .arg(format!("-max_total_time={}", options.seconds))
            .arg(format!("-max_len={MAX_BYTES}"))
            .arg("-print_final_stats=1")
            .arg(format!("-artifact_prefix={}/", findings.display()))
            .arg(&corpus)
            .arg(&committed)
            .args(reader.seeds().into_iter().filter(|folder| folder.is_dir()));
        project::run(&mut command)?;
    }
    println!("no finding");
    Ok(())
}

/// The triple of this machine.
fn host() -> Result<String, Box<dyn std::error::Error>> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = std::process::Command::new(rustc).arg("-vV").output()?;
    let text = String::from_utf8(output.stdout)?;
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.ok_or("rustc names no host")?.to_owned())
}

fn remove(folder: &std::path::Path) -> io::Result<()> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}
