//! How many instructions each exact strategy takes: a guard against slow-downs that needs no clock.

use std::collections::BTreeMap;
use std::env;
use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::process::Command;

use rayon::prelude::*;
use rayset_engine::{RenderOptions, StrategyKind, render_observed};
use rayset_scene::{LoadOptions, load_scene};
use rayset_study::{NamedScene, cornell_spheres, sphere_scene, write_file};
use serde_json::{Value, json};

use crate::{Outcome, project};

/// By how many percent a count may grow. A repeated count differs by a few instructions in millions.
const TOLERANCE: u64 = 3;

/// The scenes: few volumes, a mesh, and so many primitives that a strategy's structure decides.
const SCENES: [&str; 3] = ["spheres-8", "cornell-spheres", "balls"];

/// What is counted: building what a strategy needs, and rendering. Reading a scene is not.
const COUNTED: [&str; 2] = ["*render_observed*", "*StrategyKind*bind*"];

#[derive(clap::Args)]
pub(crate) struct Options {
    scene: String,
    strategy: StrategyKind,
}

/// Counts by scene and strategy, and the compiler they are of.
#[derive(Clone, Debug, PartialEq)]
struct Counts {
    rustc: String,
    counts: BTreeMap<String, u64>,
}

/// What a comparison found.
#[derive(Debug, PartialEq)]
struct Verdict {
    text: String,
    failures: usize,
}

/// Renders a scene with a strategy, in the process that valgrind watches.
pub(crate) fn render_one(options: &Options) -> Outcome {
    let NamedScene { scene, name, .. } = scene(&options.scene)?;
    // The strategies that ask every volume would take long.
    let (width, height) = if name == "balls" { (32, 24) } else { (64, 48) };
    let render_options = RenderOptions { width, height, ..RenderOptions::default() };
    // One thread, so that nothing waits for another.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let frame = pool.install(|| {
        let strategy = options.strategy.bind(&scene);
        render_observed(strategy.as_ref(), &render_options, &|_| ControlFlow::Continue(()))
    })?;
    // So that the frame is needed.
    println!("{}", frame.counts.total().cast);
    Ok(())
}

fn scene(name: &str) -> Result<NamedScene, Box<dyn Error>> {
    Ok(match name {
        "spheres-8" => sphere_scene(8, 1)?,
        "cornell-spheres" => cornell_spheres(&project::fixtures())?,
        _ => {
            let path = project::fixtures().join(format!("nff/{name}.nff.gz"));
            let loaded = load_scene(&path, &LoadOptions::default())?;
            NamedScene { name: name.to_owned(), scene: loaded.scene, spheres: None }
        }
    })
}

/// Counts anew and compares with the file; says that it is skipped where valgrind is missing.
pub(crate) fn check() -> Outcome {
    if !is_installed()? {
        return Ok(());
    }
    let expected = Counts::parse(&fs::read_to_string(path())?)?;
    let Verdict { text, failures } = compare(&expected, &Counts::measure()?);
    print!("{text}");
    match failures {
        0 => Ok(()),
        _ => Err(format!(
            "{failures} instruction counts are not within {TOLERANCE} percent; `cargo xtask bless instructions` accepts them"
        )
        .into()),
    }
}

/// Writes the file.
pub(crate) fn bless() -> Outcome {
    if is_installed()? {
        write_file(&path(), Counts::measure()?.to_json()?.as_bytes())?;
        println!("wrote {}", path().display());
    }
    Ok(())
}

fn path() -> PathBuf {
    project::fixtures().join("golden/instructions.json")
}

/// Whether there is a valgrind; without one nothing is counted, which is an error where no tool may be missing.
fn is_installed() -> Result<bool, Box<dyn Error>> {
    if Command::new("valgrind").arg("--version").output().is_ok_and(|output| output.status.success()) {
        return Ok(true);
    }
    if env::var_os("RAYSET_REQUIRE_TOOLS").is_some() {
        return Err(
            "valgrind is not installed, and RAYSET_REQUIRE_TOOLS forbids to skip what needs it".into()
        );
    }
    println!("skipped: instruction counts need valgrind, which is not installed");
    Ok(false)
}

impl Counts {
    /// Counts every exact strategy on every scene, as many at once as there are processors: no clock is asked.
    fn measure() -> Result<Self, Box<dyn Error>> {
        let mut runs = Vec::new();
        for name in SCENES {
            let scene = scene(name)?.scene;
            let exact = StrategyKind::ALL.iter().filter(|kind| kind.bind(&scene).is_exact());
            runs.extend(exact.map(|kind| (name, *kind)));
        }
        let count = |(name, kind): (&str, StrategyKind)| Ok((format!("{name} {kind}"), count(name, kind)?));
        let counts: Result<_, String> = runs.into_par_iter().map(count).collect();
        Ok(Self { rustc: rustc()?, counts: counts? })
    }

    fn parse(text: &str) -> Result<Self, Box<dyn Error>> {
        let value: Value = serde_json::from_str(text)?;
        let rustc = value["rustc"].as_str().ok_or("no `rustc` in the instruction counts")?.to_owned();
        let counts =
            value["instructions"].as_object().ok_or("no `instructions` in the instruction counts")?;
        let count = |(name, count): (&String, &Value)| Some((name.clone(), count.as_u64()?));
        let counts: Option<_> = counts.iter().map(count).collect();
        Ok(Self { rustc, counts: counts.ok_or("an instruction count is no count")? })
    }

    fn to_json(&self) -> Result<String, serde_json::Error> {
        let value = json!({ "rustc": self.rustc, "instructions": self.counts });
        Ok(serde_json::to_string_pretty(&value)? + "\n")
    }
}

/// The compiler that cargo builds with.
fn rustc() -> Result<String, Box<dyn Error>> {
    let program = env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(program).arg("--version").current_dir(project::root()).output()?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// The instructions that this very program takes to render a scene.
fn count(name: &str, kind: StrategyKind) -> Result<u64, String> {
    let own = env::current_exe().map_err(|error| error.to_string())?;
    let mut command = Command::new("valgrind");
    command.args(["--tool=callgrind", "--callgrind-out-file=/dev/null"]);
    command.args(COUNTED.map(|function| format!("--toggle-collect={function}")));
    command.arg(own).args(["count-instructions", name, kind.name()]);
    // It knows no AVX-512.
    let output = command.env("RAYSET_SIMD", "avx2").output().map_err(|error| error.to_string())?;
    let text = String::from_utf8_lossy(&output.stderr);
    match collected(&text) {
        Some(count) if output.status.success() && count > 0 => Ok(count),
        _ => Err(format!("valgrind counted nothing for {name} {kind}: {}\n{text}", output.status)),
    }
}

/// The count in what callgrind prints: `==1234== Collected : 5678`.
fn collected(text: &str) -> Option<u64> {
    text.lines().find_map(|line| line.split_once("Collected : "))?.1.trim().parse().ok()
}

/// Holds the counts of now to those of the file.
fn compare(expected: &Counts, actual: &Counts) -> Verdict {
    let mut verdict = Verdict { text: String::new(), failures: 0 };
    let is_same_rustc = expected.rustc == actual.rustc;
    if !is_same_rustc {
        let (old, new) = (&expected.rustc, &actual.rustc);
        verdict.say(&format!("warning: the counts are of {old}, and this is {new}: nothing fails"));
    }
    for (name, &now) in &actual.counts {
        let Some(&before) = expected.counts.get(name) else {
            verdict.fail(is_same_rustc, &format!("{name:32} {now:>12} instructions, never blessed"));
            continue;
        };
        let percent = 100.0 * (now as f64 / before as f64 - 1.0);
        let line = format!("{name:32} {now:>12} instructions, {percent:+.2} %");
        if 100 * now > (100 + TOLERANCE) * before {
            verdict.fail(is_same_rustc, &format!("{line}: more than {before}"));
        } else if 100 * now < (100 - TOLERANCE) * before {
            verdict.say(&format!("{line}: an improvement; bless it"));
        } else {
            verdict.say(&line);
        }
    }
    for name in expected.counts.keys().filter(|name| !actual.counts.contains_key(*name)) {
        verdict.fail(is_same_rustc, &format!("{name:32} was not counted"));
    }
    verdict
}

impl Verdict {
    fn say(&mut self, line: &str) {
        writeln!(self.text, "{line}").expect("a string takes all");
    }

    fn fail(&mut self, counts: bool, line: &str) {
        self.say(line);
        self.failures += usize::from(counts);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(rustc: &str, counts: &[(&str, u64)]) -> Counts {
        let counts = counts.iter().map(|&(name, count)| (name.to_owned(), count)).collect();
        Counts { rustc: rustc.to_owned(), counts }
    }

    #[test]
    fn growth_beyond_the_tolerance_fails() {
        let old = counts("1.95", &[("a", 1000), ("b", 1000), ("c", 1000)]);
        let verdict = compare(&old, &counts("1.95", &[("a", 1030), ("b", 1031), ("c", 900)]));
        assert_eq!(verdict.failures, 1, "{}", verdict.text);
        let lines: Vec<_> = verdict.text.lines().collect();
        assert!(lines[0].ends_with("+3.00 %"), "{}", lines[0]);
        assert!(lines[1].ends_with("+3.10 %: more than 1000"), "{}", lines[1]);
        assert!(lines[2].ends_with("-10.00 %: an improvement; bless it"), "{}", lines[2]);
    }

    #[test]
    fn what_is_new_or_gone_fails() {
        let verdict = compare(&counts("1.95", &[("a", 1)]), &counts("1.95", &[("b", 1)]));
        assert_eq!(verdict.failures, 2, "{}", verdict.text);
        assert!(verdict.text.contains("never blessed") && verdict.text.contains("not counted"));
    }

    #[test]
    fn another_compiler_only_warns() {
        let verdict = compare(&counts("1.95", &[("a", 1)]), &counts("1.96", &[("a", 9), ("b", 1)]));
        assert_eq!(verdict.failures, 0);
        assert!(verdict.text.starts_with("warning: the counts are of 1.95, and this is 1.96"));
        assert!(verdict.text.contains("more than 1"));
    }

    #[test]
    fn counts_are_read_as_they_are_written() {
        let counts = counts("1.95", &[("a b", 12), ("a c", 5_000_000_000)]);
        assert_eq!(Counts::parse(&counts.to_json().unwrap()).unwrap(), counts);
        assert!(Counts::parse("{}").is_err());
        assert_eq!(collected("==1== Events : Ir\n==1== Collected : 13595553\n"), Some(13_595_553));
        assert_eq!(collected("==1== Collected :\n"), None);
    }

    #[test]
    fn every_exact_strategy_is_blessed_on_every_scene() {
        let blessed = Counts::parse(&fs::read_to_string(path()).unwrap()).unwrap();
        for name in SCENES {
            let scene = scene(name).unwrap().scene;
            for kind in StrategyKind::ALL.iter().filter(|kind| kind.bind(&scene).is_exact()) {
                assert!(blessed.counts.contains_key(&format!("{name} {kind}")), "{name} {kind}");
            }
        }
    }
}
