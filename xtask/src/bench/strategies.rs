//! `cargo xtask bench`: every exact strategy on the same rays.

use std::fs;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use rayset_engine::Backend;
use rayset_study::{Bench, BenchPlan, BenchScene, View, write_file};

use super::bless;
use crate::{Outcome, project};

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Fewer scenes, smaller images, fewer repetitions: done within a minute.
    #[arg(long)]
    quick: bool,
    /// A scene by name or file (.obj, .nff, .nff.gz, .toml); may be given more than once.
    #[arg(long, value_name = "NAME|FILE")]
    scene: Vec<String>,
    /// A strategy, or a mode of a peer, by the beginning of its name; may be given more than once.
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// A view: whole, 512 x 512; or crop, the middle 512 x 512 of 2048 x 2048. Both, if none is named.
    #[arg(long, value_name = "VIEW", value_parser = ["whole", "crop"])]
    view: Option<String>,
    /// How many threads share the rays.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// How often each list of rays is answered by each.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    repetitions: Option<u16>,
    /// A folder with further meshes, each in a folder of its own: `teapot/teapot.obj`, `lost_empire/lost_empire.obj`.
    #[arg(long, value_name = "FOLDER")]
    meshes: Option<PathBuf>,
    /// Adds other libraries on the same rays: Embree 3, if it is installed, obvhs, bvh and parry3d.
    #[arg(long)]
    peers: bool,
    /// Writes the comparisons into docs/performance.md and README.md too; with lanes narrower than AVX-512, into
    /// docs/performance-avx2.md or docs/performance-portable.md.
    #[arg(long, requires = "peers", conflicts_with = "quick")]
    bless: bool,
    /// The folder for tables, figures as JSON, and plot.
    #[arg(long, value_name = "FOLDER", default_value_os_t = project::root().join("target/bench"))]
    out: PathBuf,
}

/// The scenes of a quick run.
const QUICK: [&str; 5] = ["spheres-8", "spheres-1k", "spheres-16k", "balls", "knob"];

pub(crate) fn run(options: &Options) -> Outcome {
    let plan = plan(options)?;
    // An output that cannot be written is found out before the minutes are spent.
    let probe = options.out.join(".writable");
    write_file(&probe, b"")?;
    fs::remove_file(&probe)?;
    let start = Instant::now();
    if options.peers {
        peers(options, &plan)?;
    } else {
        println!("{}", measure(&plan)?.write(&options.out, "strategies")?);
    }
    println!("Written to {} in {:.0} s.", options.out.display(), start.elapsed().as_secs_f64());
    if options.bless {
        let text = fs::read_to_string(options.out.join("peers.md"))?;
        let building = fs::read_to_string(options.out.join("building.md")).unwrap_or_default();
        let contents = format!("{}{building}", comparisons(&text));
        let plot = fs::read(options.out.join("peers.svg"))?;
        let backend = Backend::active();
        if backend == WIDEST {
            bless("docs/performance.md", "bench", &contents)?;
            bless("README.md", "bench", &format!("{}\n", frames(&text)))?;
            write_file(&project::root().join("docs/performance.svg"), &plot)?;
        } else {
            let name = format!("docs/performance-{backend}");
            let document = narrower(backend, &contents);
            write_file(&project::root().join(format!("{name}.md")), document.as_bytes())?;
            write_file(&project::root().join(format!("{name}.svg")), &plot)?;
            println!("wrote {name}.md, and its plot: the other documents hold what {WIDEST} lanes take");
        }
    }
    Ok(())
}

/// The lanes whose tables stand in docs/performance.md and the README.
const WIDEST: Backend = Backend::Avx512;

/// The document of other lanes.
fn narrower(backend: Backend, tables: &str) -> String {
    format!(
        "# Speed with {backend} lanes\n\n\
         The tables of [Speed](performance.md), which says how they are measured, with `{backend}` lanes; Embree is limited \
         to the same instructions.\n\
         `cargo xtask bench --peers --bless` writes this document where these are the widest lanes there are, or \
         `RAYSET_SIMD={backend}` asks for them.\n\n\
         ![Nanoseconds a ray](performance-{backend}.svg)\n\n{tables}"
    )
}

/// The tables over all scenes: what stands before the first scene's own.
fn comparisons(text: &str) -> &str {
    let is_scene = |heading: &str| heading.contains(" primitives, nanoseconds a ray");
    let end = text.match_indices("### ").find(|(at, _)| text[*at..].lines().next().is_some_and(is_scene));
    end.map_or(text, |(at, _)| &text[..at])
}

/// The table of whole frames, cut to what the README shows: pictures seen whole that other libraries saw too.
fn frames(text: &str) -> String {
    let rest = text.split_once("### Speed of a frame's rays\n\n").map_or("", |(_, rest)| rest);
    let table = rest.split_once("### ").map_or(rest, |(table, _)| table).trim_end_matches('\n');
    let is_shown = |line: &&str| {
        let cells: Vec<_> = line.split('|').map(str::trim).collect();
        let is_crop = cells.get(2).is_some_and(|view| view.contains(" of "));
        let is_alone = cells.get(3).is_some_and(|ratio| ratio.is_empty());
        !is_crop && !is_alone
    };
    table.lines().filter(is_shown).collect::<Vec<_>>().join("\n")
}

/// What the options ask for.
fn plan(options: &Options) -> Result<BenchPlan, String> {
    let (mut scenes, missing) = BenchScene::all(&project::fixtures(), options.meshes.as_deref());
    if options.scene.is_empty() {
        scenes.retain(|scene| !options.quick || QUICK.contains(&scene.name()));
        if !missing.is_empty() && !options.quick {
            eprintln!("note: not here, see --meshes: {}", missing.join(", "));
        }
    } else {
        let chosen = options.scene.iter().map(|wanted| chosen(wanted, &scenes));
        scenes = chosen.collect::<Result<_, _>>()?;
    }
    let side = if options.quick { 256 } else { 512 };
    let mut views = vec![View { image: side, side }, View { image: 4 * side, side }];
    match options.view.as_deref() {
        Some("whole") => views.truncate(1),
        Some(_) => drop(views.remove(0)),
        None => {}
    }
    let repetitions = options.repetitions.map_or(if options.quick { 5 } else { 9 }, usize::from);
    Ok(BenchPlan { scenes, views, repetitions, threads: options.threads.into(), only: options.only.clone() })
}

/// The scene of a name, or of a file.
fn chosen(wanted: &str, scenes: &[BenchScene]) -> Result<BenchScene, String> {
    if let Some(scene) = scenes.iter().find(|scene| scene.name() == wanted) {
        return Ok(scene.clone());
    }
    let path = PathBuf::from(wanted);
    if path.is_file() {
        return Ok(BenchScene::file(&path));
    }
    let names: Vec<_> = scenes.iter().map(BenchScene::name).collect();
    Err(format!("`{wanted}` is neither a file nor one of the scenes {}", names.join(", ")))
}

/// Builds the crate that holds the other libraries, which is not of the workspace, and has it measure.
fn peers(options: &Options, plan: &BenchPlan) -> Outcome {
    let manifest = project::root().join("xtask/peers/Cargo.toml").to_string_lossy().into_owned();
    let target = project::root().join("target");
    let mut build = project::cargo(&["build", "--release", "--manifest-path", &manifest]);
    project::run(build.env("CARGO_TARGET_DIR", &target)).map_err(|error| {
        format!("{error}; Embree 3 is needed, on Debian and its kin the package libembree-dev")
    })?;
    let mut command = std::process::Command::new(target.join("release/rayset-peers"));
    command.arg(serde_json::to_string(plan)?).arg(&options.out);
    // What building takes has nothing to do with scenes that are chosen.
    if options.scene.is_empty() {
        command.arg("building");
    }
    project::run(&mut command)
}

/// Measures with a progress bar on a terminal.
fn measure(plan: &BenchPlan) -> Result<Bench, Box<dyn std::error::Error>> {
    let steps = plan.scenes.len() * (1 + plan.views.len());
    let bar = ProgressBar::new(steps as u64);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = ProgressStyle::with_template("{msg:44} {wide_bar} {pos}/{len}, {elapsed}");
    bar.set_style(style.expect("a valid template"));
    let mut finished = 0;
    let bench = Bench::run(plan, &mut |what| {
        bar.set_message(what.to_owned());
        bar.set_position(finished);
        finished += 1;
    });
    bar.finish_and_clear();
    Ok(bench?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_blessed_is_cut_out_of_the_tables() {
        let text = "Some machine.\n\n### Speed of a frame's rays\n\nRatios.\n\n| scene | view | a | b |\n|---|---|---:|---:|\n\
                    | knob | 512 x 512 | 2.00 | 1.00 |\n| knob | 512 x 512 of 2048 x 2048 | 3.00 | 1.00 |\n\
                    | balls | 512 x 512 |  | 1.00 |\n\n### Speed, list by list\n\n| b |\n\n\
                    ### balls, 512 x 512: 7 primitives, nanoseconds a ray\n\n| c |\n";
        assert!(comparisons(text).ends_with("| b |\n\n"));
        let shown =
            "Ratios.\n\n| scene | view | a | b |\n|---|---|---:|---:|\n| knob | 512 x 512 | 2.00 | 1.00 |";
        assert_eq!(frames(text), shown);
    }

    #[test]
    fn the_documents_have_a_place_for_it() {
        let documents = [include_str!("../../../docs/performance.md"), include_str!("../../../README.md")];
        for text in documents {
            assert_eq!(text.matches("<!-- bench -->\n").count(), 1);
            assert_eq!(text.matches("<!-- /bench -->\n").count(), 1);
        }
    }

    #[test]
    fn other_lanes_have_a_document_of_their_own() {
        let text = narrower(Backend::Portable, "| a |\n");
        assert!(text.starts_with("# Speed with portable lanes\n\n") && text.ends_with("\n\n| a |\n"));
        assert!(text.contains("(performance-portable.svg)") && !text.contains("  "));
    }

    #[test]
    fn quick_scenes_are_scenes() {
        let (scenes, _) = BenchScene::all(&project::fixtures(), None);
        for name in QUICK {
            assert_eq!(chosen(name, &scenes).unwrap().name(), name);
        }
        assert!(chosen("nothing", &scenes).unwrap_err().contains("spheres-1k"));
    }
}
