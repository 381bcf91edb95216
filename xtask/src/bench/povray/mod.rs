//! `cargo xtask bench povray`: `rayset render` beside POV-Ray.

mod output;
mod scene;

use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use rayset_engine::StrategyKind;
use rayset_image::{read_exr, to_srgb8, write_png_rgb8};
use rayset_scene::{LoadOptions, load_scene};
use rayset_study::{Spread, write_file};
use serde_json::{Value, json};

use self::output::{Difference, Picture, Printed};
use self::scene::{Limits, pov};
use crate::{Outcome, project};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  cargo xtask bench povray
  cargo xtask bench povray --scene balls --strategy bundle --repetitions 3

POV-Ray 3.7 and `rayset render` take turns on the standard scenes: the same geometry hit from both sides, camera, lights,
materials, depth 5, cut-off 1/256, a ray a pixel, one thread each. Compared are the times both print for tracing alone:
reading the scene, building what finds hits, and writing the picture are left out on both sides. Both pictures are left
beside the tables. The machine should have nothing else to do.")]
pub(crate) struct Options {
    /// A strategy, instead of the default of `rayset render`.
    #[arg(long, value_name = "NAME")]
    strategy: Option<StrategyKind>,
    /// A scene of fixtures/nff, instead of balls, mount, rings and tree; may be repeated.
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    /// The side of the square pictures, in pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 512, value_parser = clap::value_parser!(u32).range(16..=8192))]
    resolution: u32,
    /// How often each renders each scene.
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = clap::value_parser!(u8).range(1..))]
    repetitions: u8,
    /// The folder for table, figures as JSON, and pictures.
    #[arg(long, value_name = "FOLDER", default_value_os_t = project::root().join("target/bench"))]
    out: PathBuf,
}

/// The scenes that are compared; in gears, nearly all of it open glass, POV-Ray's light that falls through decides.
const SCENES: [&str; 4] = ["balls", "mount", "rings", "tree"];

/// How many times as fast as POV-Ray we want to be.
const TARGET: f64 = 15.0;

/// The least time that POV-Ray's milliseconds measure to a percent.
const SHORTEST: f64 = 0.1;

/// The options of `RenderOptions::default`, said to both.
const LIMITS: Limits = Limits { depth: 5, cutoff: 1.0 / 256.0 };

/// What both did with one scene.
struct Compared {
    name: String,
    povray: Spread,
    rayset: Spread,
    printed: Printed,
    /// The statistics that `rayset render` wrote last.
    statistics: Value,
    difference: Difference,
}

impl Compared {
    fn ratio(&self) -> f64 {
        self.povray.median / self.rayset.median
    }
}

pub(crate) fn run(options: &Options) -> Outcome {
    let version = povray_version()?;
    // An output that cannot be written is found out before the minutes are spent.
    let json = options.out.join("povray.json");
    write_file(&json, b"")?;
    let start = Instant::now();
    let rayset = project::rayset()?;
    let folder = tempfile::tempdir()?;
    let names =
        if options.scene.is_empty() { SCENES.map(str::to_owned).to_vec() } else { options.scene.clone() };
    let mut compared = Vec::new();
    for name in names {
        eprintln!("{name}");
        compared.push(compare(&name, options, &rayset, folder.path())?);
    }
    let table = table(&compared, &version, options.resolution);
    println!("{table}");
    write_file(&options.out.join("povray.md"), table.as_bytes())?;
    write_file(&json, &serde_json::to_vec_pretty(&figures(&compared, &version, options))?)?;
    println!("Written to {} in {:.0} s.", options.out.display(), start.elapsed().as_secs_f64());
    Ok(())
}

/// What the installed POV-Ray calls itself.
fn povray_version() -> Result<String, Box<dyn Error>> {
    let output = Command::new("povray").arg("--version").output().map_err(|error| {
        format!("cannot run povray: {error}; on Debian and its kin `apt-get install povray` installs it")
    })?;
    let text =
        String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    let line = text.lines().find(|line| line.starts_with("POV-Ray ")).unwrap_or_default();
    match line.strip_prefix("POV-Ray ") {
        Some(version) if version.starts_with("3.7") => Ok(line.to_owned()),
        _ => Err(format!("POV-Ray 3.7 is needed, and povray says it is `{line}`").into()),
    }
}

/// Lets both render a scene in turns.
fn compare(name: &str, options: &Options, rayset: &Path, folder: &Path) -> Result<Compared, Box<dyn Error>> {
    let path = project::fixtures().join(format!("nff/{name}.nff.gz"));
    let loaded = load_scene(&path, &LoadOptions { two_sided: true, ..LoadOptions::default() })?;
    let text =
        pov(&loaded.scene, LIMITS).map_err(|problem| format!("{name} is nothing for POV-Ray: {problem}"))?;
    fs::write(folder.join("scene.pov"), text)?;
    let (mut theirs, mut ours) = (Vec::new(), Vec::new());
    let mut last = None;
    for _ in 0..options.repetitions {
        let printed = render_povray(options.resolution, folder)?;
        theirs.push(printed.seconds);
        let statistics = render_rayset(&path, options, rayset, folder)?;
        ours.push(statistics["seconds"]["trace"].as_f64().ok_or("the statistics have no time")?);
        last = Some((printed, statistics));
    }
    let (printed, statistics) = last.ok_or("there was no repetition")?;
    let (povray, rayset) = (Spread::of(&theirs), Spread::of(&ours));
    if povray.median < SHORTEST {
        eprintln!("note: {name}: POV-Ray needs {} s only; --resolution makes it more", povray.median);
    }
    let difference = compare_pictures(name, options, folder)?;
    Ok(Compared { name: name.to_owned(), povray, rayset, printed, statistics, difference })
}

fn render_povray(resolution: u32, folder: &Path) -> Result<Printed, Box<dyn Error>> {
    let mut command = Command::new("povray");
    command.current_dir(folder).args([
        "+Iscene.pov",
        "+Opovray.ppm",
        "+FP",
        "-D",
        "-P",
        "-A",
        "-J",
        "+Q9",
        "+WT1",
    ]);
    command.args([format!("+W{resolution}"), format!("+H{resolution}")]);
    command.args(["File_Gamma=sRGB", "Dither=off"]);
    let output = command.output()?;
    let text = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() {
        let reason = text.lines().rfind(|line| line.contains("rror")).unwrap_or_default();
        return Err(format!("povray failed with {}: {reason}", output.status).into());
    }
    let printed = Printed::parse(&text)?;
    match printed.threads {
        1 => Ok(printed),
        threads => Err(format!("POV-Ray traced with {threads} threads").into()),
    }
}

fn render_rayset(
    path: &Path,
    options: &Options,
    rayset: &Path,
    folder: &Path,
) -> Result<Value, Box<dyn Error>> {
    let mut command = Command::new(rayset);
    command.current_dir(folder).arg("render").arg(path);
    command.args(["--two-sided", "--threads", "1", "--out", "rayset.exr", "--stats", "rayset.json"]);
    command.args(["--depth", &LIMITS.depth.to_string(), "--cutoff", &LIMITS.cutoff.to_string()]);
    command.args(["--resolution", &format!("{0}x{0}", options.resolution)]);
    if let Some(strategy) = options.strategy {
        command.args(["--strategy", strategy.name()]);
    }
    let output = command.output()?;
    if !output.status.success() {
        let reason = String::from_utf8_lossy(&output.stderr).into_owned();
        return Err(format!("rayset failed with {}: {reason}", output.status).into());
    }
    Ok(serde_json::from_slice(&fs::read(folder.join("rayset.json"))?)?)
}

/// Compares the pictures and leaves both in the folder of the tables.
fn compare_pictures(name: &str, options: &Options, folder: &Path) -> Result<Difference, Box<dyn Error>> {
    let theirs =
        Picture::from_ppm(&fs::read(folder.join("povray.ppm"))?).ok_or("POV-Ray wrote no PPM of 8 bits")?;
    let image = read_exr(&folder.join("rayset.exr"))?;
    let ours = Picture { width: image.width(), height: image.height(), pixels: to_srgb8(&image, 0.0)? };
    for (who, picture) in [("povray", &theirs), ("rayset", &ours)] {
        let path = options.out.join(format!("povray-{name}.{who}.png"));
        write_png_rgb8(&path, picture.width, picture.height, &picture.pixels)?;
    }
    Ok(ours.difference(&theirs))
}

/// Rays cast of a kind, as `rayset render` counts them.
fn cast(statistics: &Value, kind: &str) -> u64 {
    statistics["rays"][kind]["cast"].as_u64().unwrap_or(0)
}

fn geometric_mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut product, mut n) = (1.0_f64, 0.0);
    for value in values {
        product *= value;
        n += 1.0;
    }
    libm::pow(product, 1.0 / n)
}

/// The table in Markdown, with what a reader must know.
fn table(compared: &[Compared], version: &str, resolution: u32) -> String {
    let strategy = compared.first().and_then(|one| one.statistics["strategy"].as_str()).unwrap_or("");
    let simd = compared.first().and_then(|one| one.statistics["simd"].as_str()).unwrap_or("");
    let mut text = format!(
        "`rayset render` with `{strategy}` on {simd} beside {version}: {resolution} x {resolution} pixels, one thread each, seconds of tracing\n(median, least and greatest of repetitions that took turns).\n\n| scene | POV-Ray | rayset | ratio | mean difference | pixels off |\n|---|---:|---:|---:|---:|---:|\n"
    );
    let mut push = |line: String| writeln!(text, "{line}").expect("a string takes all");
    let seconds = |s: &Spread| format!("{:.3} ({:.3} to {:.3})", s.median, s.least, s.greatest);
    for one in compared {
        let Difference { mean, off } = one.difference;
        push(format!(
            "| {} | {} | {} | {:.1} | {mean:.2} | {:.2} % |",
            one.name,
            seconds(&one.povray),
            seconds(&one.rayset),
            one.ratio(),
            100.0 * off
        ));
    }
    let mean = geometric_mean(compared.iter().map(Compared::ratio));
    let verdict = if mean >= TARGET { "met" } else { "missed" };
    push(format!("\nGeometric mean of the ratios: {mean:.1}; the target, {TARGET}, is {verdict}."));
    push(
        "Differences are of 8-bit sRGB, of 255; a pixel is off if one of its colours is by more than 8."
            .to_owned(),
    );
    push("\n| scene | rays of | all but shadow | reflected | refracted | shadow |\n|---|---|---:|---:|---:|---:|".to_owned());
    for one in compared {
        let Printed { rays, reflected, refracted, shadow_tests, .. } = one.printed;
        push(format!(
            "| {} | POV-Ray | {rays} | {reflected} | {refracted} | {shadow_tests} tests |",
            one.name
        ));
        let [initial, reflected, refracted, shadow] =
            ["initial", "reflected", "refracted", "shadow"].map(|kind| cast(&one.statistics, kind));
        let rays = initial + reflected + refracted;
        push(format!("| | rayset | {rays} | {reflected} | {refracted} | {shadow} rays |"));
    }
    text.push_str("\nPOV-Ray counts as rays those too that it cuts off before they are traced.\n");
    text
}

/// The same as figures.
fn figures(compared: &[Compared], version: &str, options: &Options) -> Value {
    let scenes: Vec<Value> = compared
        .iter()
        .map(|one| {
            let Printed { rays, reflected, refracted, shadow_tests, .. } = one.printed;
            json!({
                "scene": one.name,
                "strategy": one.statistics["strategy"],
                "simd": one.statistics["simd"],
                "povray_seconds": one.povray,
                "rayset_seconds": one.rayset,
                "ratio": one.ratio(),
                "mean_difference": one.difference.mean,
                "pixels_off": one.difference.off,
                "povray_rays": { "all": rays, "reflected": reflected, "refracted": refracted, "shadow_tests": shadow_tests },
                "rayset_rays": one.statistics["rays"],
            })
        })
        .collect();
    json!({
        "povray": version,
        "resolution": options.resolution,
        "repetitions": options.repetitions,
        "geometric_mean": geometric_mean(compared.iter().map(Compared::ratio)),
        "target": TARGET,
        "scenes": scenes,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_that_is_compared_has_words_in_the_language() {
        for name in SCENES {
            let path = project::fixtures().join(format!("nff/{name}.nff.gz"));
            let loaded =
                load_scene(&path, &LoadOptions { two_sided: true, ..LoadOptions::default() }).unwrap();
            let text = pov(&loaded.scene, LIMITS).unwrap();
            let n = loaded.scene.n_primitives();
            let words = ["\nsphere {", "\ncone {", "\ncylinder {", "\npolygon {", "\ntriangle {"];
            let found: usize = words.iter().map(|word| text.matches(word).count()).sum();
            assert_eq!(found, n, "{name}");
        }
    }

    #[test]
    fn table_has_ratio_mean_and_both_counts() {
        let printed =
            Printed { seconds: 3.0, threads: 1, rays: 30, reflected: 20, refracted: 0, shadow_tests: 99 };
        let one = |name: &str, seconds| Compared {
            name: name.to_owned(),
            povray: Spread::of(&[3.0]),
            rayset: Spread::of(&[seconds]),
            printed,
            statistics: json!({ "strategy": "bundle", "simd": "avx2", "rays": { "initial": { "cast": 7 } } }),
            difference: Difference { mean: 0.5, off: 0.25 },
        };
        let text = table(&[one("balls", 0.3), one("tree", 0.075)], "POV-Ray 3.7.0", 512);
        assert!(
            text.contains(
                "| balls | 3.000 (3.000 to 3.000) | 0.300 (0.300 to 0.300) | 10.0 | 0.50 | 25.00 % |"
            ),
            "{text}"
        );
        assert!(text.contains("ratios: 20.0; the target, 15, is met"), "{text}");
        assert!(text.contains("| balls | POV-Ray | 30 | 20 | 0 | 99 tests |"), "{text}");
        assert!(text.contains("| | rayset | 7 | 0 | 0 | 0 rays |"), "{text}");
    }
}
