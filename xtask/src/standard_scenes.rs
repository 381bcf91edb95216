//! `cargo xtask standard-scenes`: the ray counts of the standard scenes beside those that are published.

use std::fmt::Write;
use std::io::IsTerminal;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use rayset_engine::{Backend, EyeRays, RayCounts, RayTally, RenderOptions, StrategyKind, render};
use rayset_scene::{LoadOptions, load_scene};
use rayset_study::write_file;

use crate::{Outcome, project};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  cargo xtask standard-scenes
  cargo xtask standard-scenes --resolution 128 --scene gears
  cargo xtask standard-scenes --bless")]
pub(crate) struct Options {
    /// The side of the square images, in pixels; the published counts are for 512.
    #[arg(long, value_name = "PIXELS", default_value_t = PUBLISHED_RESOLUTION, value_parser = clap::value_parser!(u32).range(1..=4096))]
    resolution: u32,
    /// One scene only.
    #[arg(long, value_name = "NAME", value_parser = clap::builder::PossibleValuesParser::new(SCENES.map(|scene| scene.name)))]
    scene: Option<String>,
    /// Writes docs/standard-scenes.md.
    #[arg(long, conflicts_with_all = ["resolution", "scene"])]
    bless: bool,
}

impl Options {
    /// All scenes at the published resolution.
    pub(crate) fn all() -> Self {
        Self { resolution: PUBLISHED_RESOLUTION, scene: None, bless: false }
    }
}

/// The side of the images whose counts are published.
const PUBLISHED_RESOLUTION: u32 = 512;

/// How far a count may be off, in percent.
const TOLERANCE: f64 = 10.0;

/// A standard scene and its counts.
struct StandardScene {
    name: &'static str,
    /// Whether its opaque surfaces are hit from both sides.
    two_sided: bool,
    /// Eye rays that hit; reflected, refracted and shadow rays that are cast.
    published: [u64; 4],
    /// Ours of the same image, cast and hit, by kind: exactly these.
    expected: [[u64; 2]; 4],
}

/// What the published counts count.
const KINDS: [&str; 4] = ["eye rays that hit", "reflected rays", "refracted rays", "shadow rays"];

/// The standard scenes.
///
/// Source: the notes that come with Haines's Standard Procedural Databases.
const SCENES: [StandardScene; 7] = [
    StandardScene {
        name: "balls",
        two_sided: false,
        published: [263_169, 175_095, 0, 954_368],
        expected: [[263_169, 263_169], [175_057, 126_039], [0, 0], [954_111, 285_962]],
    },
    StandardScene {
        name: "gears",
        two_sided: false,
        published: [245_086, 304_643, 207_564, 2_246_955],
        expected: [[263_169, 245_090], [304_629, 214_528], [199_938, 167_613], [2_246_824, 1_219_994]],
    },
    StandardScene {
        name: "mount",
        two_sided: false,
        published: [173_125, 354_769, 354_769, 412_922],
        expected: [[263_169, 173_132], [354_770, 277_579], [354_770, 197_446], [412_924, 253_305]],
    },
    StandardScene {
        name: "rings",
        two_sided: false,
        published: [263_169, 315_236, 0, 1_085_002],
        expected: [[263_169, 263_169], [314_990, 179_597], [0, 0], [1_084_444, 515_261]],
    },
    StandardScene {
        name: "teapot",
        two_sided: true,
        published: [161_120, 225_248, 0, 407_656],
        expected: [[263_169, 161_124], [225_160, 66_886], [0, 0], [406_041, 38_453]],
    },
    StandardScene {
        name: "tetra",
        two_sided: false,
        published: [49_788, 0, 0, 46_112],
        expected: [[263_169, 49_797], [0, 0], [0, 0], [46_109, 5523]],
    },
    StandardScene {
        name: "tree",
        two_sided: false,
        published: [169_836, 0, 0, 1_097_419],
        expected: [[263_169, 169_830], [0, 0], [0, 0], [1_097_445, 43_456]],
    },
];

pub(crate) fn run(options: &Options) -> Outcome {
    let is_wanted = |name: &str| options.scene.as_ref().is_none_or(|scene| scene == name);
    let scenes: Vec<_> = SCENES.iter().filter(|scene| is_wanted(scene.name)).collect();
    let bar = ProgressBar::new(scenes.len() as u64);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = ProgressStyle::with_template("{msg:16} {wide_bar} {pos}/{len} scenes, {elapsed}");
    bar.set_style(style.expect("a valid template"));
    let start = Instant::now();
    let mut counted = Vec::with_capacity(scenes.len());
    for scene in scenes {
        bar.set_message(scene.name);
        counted.push((scene, count(scene, options.resolution)?));
        bar.inc(1);
    }
    bar.finish_and_clear();

    println!("{}", table(&counted, options.resolution));
    println!("Counted in {:.0} s.", start.elapsed().as_secs_f64());
    if options.resolution != PUBLISHED_RESOLUTION {
        println!("The published counts are for {PUBLISHED_RESOLUTION}; here they are scaled.");
        return Ok(());
    }
    let problems: Vec<_> = counted.iter().flat_map(|(scene, counts)| problems(scene, counts)).collect();
    if !problems.is_empty() {
        return Err(problems.join("; ").into());
    }
    if options.bless {
        let path = project::root().join("docs/standard-scenes.md");
        let text =
            include_str!("standard_scenes.md").replace("{table}\n", &table(&counted, PUBLISHED_RESOLUTION));
        write_file(&path, text.as_bytes())?;
        println!("wrote {}", path.display());
    }
    Ok(())
}

/// The counts of a scene under the published conditions, but for the resolution.
fn count(scene: &StandardScene, resolution: u32) -> Result<RayCounts, Box<dyn std::error::Error>> {
    let path = project::fixtures().join("nff").join(format!("{}.nff.gz", scene.name));
    let options = LoadOptions { two_sided: scene.two_sided, ..LoadOptions::default() };
    let loaded = load_scene(&path, &options)?;
    let options = RenderOptions {
        width: resolution,
        height: resolution,
        eye_rays: EyeRays::Corners,
        max_depth: 5,
        cutoff: None,
        ..RenderOptions::default()
    };
    // Among thousands of volumes the partition takes the time: lanes pay.
    let strategy = StrategyKind::Standard.bind_on(&loaded.scene, Backend::Portable);
    Ok(render(strategy.as_ref(), &options)?.counts)
}

/// What is published, of our counts.
fn comparable(counts: &RayCounts) -> [u64; 4] {
    [counts.initial.hit, counts.reflected.cast, counts.refracted.cast, counts.shadow.cast]
}

/// How far ours is off, in percent.
#[expect(clippy::cast_precision_loss, reason = "counts are far below 2^53")]
fn deviation(ours: u64, published: f64) -> f64 {
    100.0 * (ours as f64 / published - 1.0)
}

/// What is wrong with the counts of a scene at the published resolution.
fn problems(scene: &StandardScene, counts: &RayCounts) -> Vec<String> {
    let mut problems = Vec::new();
    for ((kind, ours), published) in KINDS.iter().zip(comparable(counts)).zip(scene.published) {
        #[expect(clippy::cast_precision_loss, reason = "counts are far below 2^53")]
        let is_near =
            if published == 0 { ours == 0 } else { deviation(ours, published as f64).abs() <= TOLERANCE };
        if !is_near {
            problems.push(format!("{}: {ours} {kind}, {published} are published", scene.name));
        }
    }
    let exact = exact(counts);
    if exact != scene.expected {
        problems.push(format!("{}: counts are {exact:?} and were {:?}", scene.name, scene.expected));
    }
    problems
}

/// Cast and hit, by kind.
fn exact(counts: &RayCounts) -> [[u64; 2]; 4] {
    let both = |tally: RayTally| [tally.cast, tally.hit];
    [both(counts.initial), both(counts.reflected), both(counts.refracted), both(counts.shadow)]
}

/// The counts as a Markdown table; the published ones are scaled if the resolution is another.
#[expect(clippy::cast_precision_loss, reason = "counts are far below 2^53")]
fn table(counted: &[(&StandardScene, RayCounts)], resolution: u32) -> String {
    let side = |resolution: u32| f64::from(resolution + 1);
    let scale =
        (side(resolution) / side(PUBLISHED_RESOLUTION)) * (side(resolution) / side(PUBLISHED_RESOLUTION));
    let mut table =
        String::from("| scene | rays | ours | published | deviation |\n|---|---|---:|---:|---:|\n");
    for (scene, counts) in counted {
        let rows = KINDS.iter().zip(comparable(counts)).zip(scene.published);
        for ((kind, ours), published) in rows.filter(|((_, ours), published)| ours + published > 0) {
            let scaled = published as f64 * scale;
            // Rounded first, so that there is no -0.00.
            let deviation = (100.0 * deviation(ours, scaled)).round() / 100.0 + 0.0;
            let row = format!("| {} | {kind} | {ours} | {scaled:.0} | {deviation:+.2} % |", scene.name);
            writeln!(table, "{row}").expect("a string takes everything");
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_beyond_the_tolerance_are_problems() {
        let scene = StandardScene {
            name: "balls",
            two_sided: false,
            published: [100, 100, 0, 1000],
            expected: [[200, 100], [109, 7], [0, 0], [901, 5]],
        };
        let tally = |[cast, hit]: [u64; 2]| RayTally { cast, hit };
        let [initial, reflected, refracted, shadow] = scene.expected.map(tally);
        let good = RayCounts { initial, reflected, refracted, shadow };
        assert_eq!(problems(&scene, &good), [""; 0]);
        let bad = RayCounts { reflected: tally([111, 7]), refracted: tally([1, 0]), ..good };
        assert_eq!(
            problems(&scene, &bad),
            [
                "balls: 111 reflected rays, 100 are published",
                "balls: 1 refracted rays, 0 are published",
                "balls: counts are [[200, 100], [111, 7], [1, 0], [901, 5]] and were [[200, 100], [109, 7], [0, 0], [901, 5]]"
            ]
        );
    }

    #[test]
    fn template_has_one_place_for_the_table() {
        assert_eq!(include_str!("standard_scenes.md").matches("{table}\n").count(), 1);
    }
}
