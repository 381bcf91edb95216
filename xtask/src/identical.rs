//! `cargo xtask identical`: all exact strategies, however they are run, give the same bits.

use std::error::Error;
use std::fmt;
use std::io::IsTerminal;
use std::sync::Arc;
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use rayset_engine::{
    Backend, Frame, IntersectionStrategy, Layer, Layers, PixelOrder, Plane, PlaneSamples, RenderOptions,
    StrategyKind, SweepLength, render,
};
use rayset_scene::{LoadOptions, Scene, SceneError, load_scene};
use rayset_study::{NamedScene, cornell_box, cornell_spheres, knob, sphere_scene};
use sha2::{Digest, Sha256};

use crate::{Outcome, golden, project};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  cargo xtask identical
  cargo xtask identical --quick")]
pub(crate) struct Options {
    /// Small images, and every fourth combination, so that each strategy and backend still meets all the rest.
    #[arg(long)]
    quick: bool,
}

impl Options {
    /// All combinations, or a share of them.
    pub(crate) fn new(quick: bool) -> Self {
        Self { quick }
    }
}

/// The layers that show what was found, and not what it took.
const LAYERS: [Layer; 6] =
    [Layer::Beauty, Layer::Depth, Layer::Normal, Layer::Object, Layer::Primitive, Layer::Rays];

/// The standard scenes.
const STANDARD_SCENES: [&str; 7] = ["balls", "gears", "mount", "rings", "teapot", "tetra", "tree"];

/// One way to render a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Combination {
    kind: StrategyKind,
    backend: Backend,
    n_threads: usize,
    order: PixelOrder,
    /// `None` for all ray-sets of a sweep.
    bundle_len: Option<usize>,
}

/// A picture as it is compared.
struct Picture {
    width: usize,
    planes: Vec<Plane>,
    /// Rays cast, and those that hit, by kind.
    counts: [[u64; 2]; 4],
    hash: String,
}

pub(crate) fn run(options: &Options) -> Outcome {
    let start = Instant::now();
    let scenes = scenes()?;
    let combinations = combinations(options.quick);
    let bar = ProgressBar::new((scenes.len() * combinations.len()) as u64);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = ProgressStyle::with_template("{msg:16} {wide_bar} {pos}/{len} pictures, {eta} left");
    bar.set_style(style.expect("a valid template"));
    let pools = [pool(1)?, pool(2)?];
    for scene in &scenes {
        bar.set_message(scene.name.clone());
        let size = size(scene, options.quick);
        let strategies = Strategies::of(&scene.scene);
        let expected = picture(&strategies, &combinations[0], size, &pools)?;
        combinations[1..].par_iter().try_for_each(|combination| {
            let actual = picture(&strategies, combination, size, &pools)?;
            bar.inc(1);
            match difference(&expected, &actual) {
                None => Ok(()),
                Some(what) => Err(format!("{}, {combination}: {what}", scene.name)),
            }
        })?;
        bar.inc(1);
        bar.suspend(|| {
            println!(
                "{:16} {}x{:<4} {} {} combinations",
                scene.name,
                size.0,
                size.1,
                expected.hash,
                combinations.len()
            );
        });
    }
    bar.finish_and_clear();
    println!("all identical, in {:.0} s", start.elapsed().as_secs_f64());
    Ok(())
}

fn pool(n_threads: usize) -> Result<Arc<ThreadPool>, Box<dyn Error>> {
    Ok(Arc::new(ThreadPoolBuilder::new().num_threads(n_threads).build()?))
}

fn scenes() -> Result<Vec<NamedScene>, Box<dyn Error>> {
    let fixtures = project::fixtures();
    let mut scenes: Vec<_> =
        [1, 8, 64, 512].into_iter().map(|n| sphere_scene(n, 1)).collect::<Result<_, _>>()?;
    for name in STANDARD_SCENES {
        let two_sided = name == "teapot";
        let options = LoadOptions { two_sided, ..LoadOptions::default() };
        scenes.push(loaded(name, &format!("nff/{name}.nff.gz"), &options)?);
    }
    scenes.extend([cornell_box(&fixtures)?, cornell_spheres(&fixtures)?]);
    scenes.extend([knob(&fixtures, None)?, knob(&fixtures, Some(32))?]);
    let split = LoadOptions { max_volume_primitives: Some(16), ..LoadOptions::default() };
    scenes.push(loaded("spot", "obj/spot_triangulated.obj", &split)?);
    scenes.extend(golden::scenes()?.into_iter().filter(|scene| scene.name == "all-primitives"));
    Ok(scenes)
}

fn loaded(name: &str, file: &str, options: &LoadOptions) -> Result<NamedScene, SceneError> {
    let scene = load_scene(&project::fixtures().join(file), options)?.scene;
    Ok(NamedScene { name: name.to_owned(), scene, spheres: None })
}

/// Pixels across and down: fewer where a ray takes longer.
fn size(scene: &NamedScene, quick: bool) -> (u32, u32) {
    let tests = scene.scene.volumes().len() + scene.scene.n_primitives();
    match (tests, quick) {
        (..=256, false) => (93, 70),
        (..=256, true) => (53, 40),
        (..=2048, false) => (61, 46),
        (..=2048, true) => (29, 22),
        (_, false) => (37, 28),
        (_, true) => (23, 17),
    }
}

/// All combinations; the first is what the others are compared with.
fn combinations(quick: bool) -> Vec<Combination> {
    let mut combinations = Vec::new();
    for &kind in StrategyKind::ALL.iter().filter(|kind| kind.is_exact()) {
        for (b, &backend) in Backend::available().iter().enumerate() {
            for (i, bundle_len) in [Some(64), Some(1), Some(7), None].into_iter().enumerate() {
                for (j, n_threads) in [1, 2].into_iter().enumerate() {
                    for (k, order) in [PixelOrder::Scanline, PixelOrder::Morton(8)].into_iter().enumerate() {
                        // In two backends every pair of two choices comes up.
                        if !quick || j == (i + b) % 2 && k == (i / 2 + b) % 2 {
                            combinations.push(Combination { kind, backend, n_threads, order, bundle_len });
                        }
                    }
                }
            }
        }
    }
    combinations
}

/// Every exact strategy on every backend, bound once to a scene.
struct Strategies<'s> {
    bound: Vec<(StrategyKind, Backend, Box<dyn IntersectionStrategy + 's>)>,
}

impl<'s> Strategies<'s> {
    fn of(scene: &'s Scene) -> Self {
        let exact = StrategyKind::ALL.iter().filter(|kind| kind.is_exact());
        let pairs = exact.flat_map(|&kind| Backend::available().iter().map(move |&backend| (kind, backend)));
        Self { bound: pairs.map(|(kind, backend)| (kind, backend, kind.bind_on(scene, backend))).collect() }
    }

    fn get(&self, combination: &Combination) -> &dyn IntersectionStrategy {
        let wanted = (combination.kind, combination.backend);
        let bound = self.bound.iter().find(|(kind, backend, _)| (*kind, *backend) == wanted);
        bound.expect("combinations are of exact strategies and available backends").2.as_ref()
    }
}

fn picture(
    strategies: &Strategies<'_>,
    combination: &Combination,
    (width, height): (u32, u32),
    pools: &[Arc<ThreadPool>; 2],
) -> Result<Picture, String> {
    let options = RenderOptions {
        width,
        height,
        cutoff: None,
        order: Some(combination.order),
        sweep: SweepLength::Rows(8),
        bundle_len: Some(combination.bundle_len.unwrap_or((width * height) as usize)),
        layers: LAYERS.into_iter().collect::<Layers>(),
        ..RenderOptions::default()
    };
    let strategy = strategies.get(combination);
    let frame = pools[combination.n_threads - 1].install(|| render(strategy, &options));
    Ok(Picture::new(&frame.map_err(|error| error.to_string())?))
}

impl Picture {
    fn new(frame: &Frame) -> Self {
        let (initial, reflected) = (frame.counts.initial, frame.counts.reflected);
        let (refracted, shadow) = (frame.counts.refracted, frame.counts.shadow);
        let counts = [initial, reflected, refracted, shadow].map(|tally| [tally.cast, tally.hit]);
        let planes = frame.planes();
        let mut hash = Sha256::new();
        for plane in &planes {
            hash.update(plane.name.as_bytes());
            hash.update((plane.samples.len() as u64).to_le_bytes());
            for i in 0..plane.samples.len() {
                hash.update(bits(plane, i).to_le_bytes());
            }
        }
        for count in counts.as_flattened() {
            hash.update(count.to_le_bytes());
        }
        let hash = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        Self { width: frame.width as usize, planes, counts, hash }
    }
}

fn bits(plane: &Plane, i: usize) -> u32 {
    match &plane.samples {
        PlaneSamples::F32(samples) => samples[i].to_bits(),
        PlaneSamples::U32(samples) => samples[i],
    }
}

/// The first place where two pictures differ, if they do.
fn difference(expected: &Picture, actual: &Picture) -> Option<String> {
    if expected.hash == actual.hash {
        return None;
    }
    for (one, other) in expected.planes.iter().zip(&actual.planes) {
        let n = one.samples.len().min(other.samples.len());
        if let Some(i) = (0..n).find(|&i| bits(one, i) != bits(other, i)) {
            let value = |plane: &Plane| match &plane.samples {
                PlaneSamples::F32(samples) => format!("{:e} ({:#010x})", samples[i], samples[i].to_bits()),
                PlaneSamples::U32(samples) => samples[i].to_string(),
            };
            let (x, y) = (i % expected.width, i / expected.width);
            let (actual, expected) = (value(other), value(one));
            return Some(format!("{} at pixel ({x}, {y}) is {actual}, should be {expected}", one.name));
        }
    }
    Some(format!("the planes are alike, the counts {:?} should be {:?}", actual.counts, expected.counts))
}

impl fmt::Display for Combination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, backend, n_threads, order, bundle_len } = self;
        let bundle = bundle_len.map_or_else(|| "whole sweeps".to_owned(), |n| format!("bundles of {n}"));
        write!(f, "{kind} on {backend}, threads: {n_threads}, {order:?}, {bundle}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> Picture {
        let scene = sphere_scene(2, 1).unwrap();
        let pools = [pool(1).unwrap(), pool(2).unwrap()];
        picture(&Strategies::of(&scene.scene), &combinations(true)[0], (9, 7), &pools).unwrap()
    }

    #[test]
    fn first_difference_is_named_with_its_plane_and_pixel() {
        let (expected, mut actual) = (small(), small());
        assert_eq!(difference(&expected, &actual), None);
        let index = actual.planes.iter().position(|plane| plane.name == "primitive.id").unwrap();
        let PlaneSamples::U32(samples) = &mut actual.planes[index].samples else { panic!("ids are whole") };
        samples[9 * 3 + 2] ^= 5;
        let (old, new) = (samples[9 * 3 + 2] ^ 5, samples[9 * 3 + 2]);
        actual.hash.clear();
        assert_eq!(
            difference(&expected, &actual),
            Some(format!("primitive.id at pixel (2, 3) is {new}, should be {old}"))
        );
    }

    #[test]
    fn counts_count() {
        let (expected, mut actual) = (small(), small());
        actual.counts[3][1] += 1;
        actual.hash.clear();
        assert!(difference(&expected, &actual).unwrap().starts_with("the planes are alike, the counts"));
    }

    #[test]
    fn few_combinations_hold_every_pair_of_choices_of_each_strategy() {
        let (few, all) = (combinations(true), combinations(false));
        assert_eq!(few.len() * 4, all.len());
        assert_eq!(few[0], all[0]);
        for &kind in StrategyKind::ALL.iter().filter(|kind| kind.is_exact()) {
            let has = |wanted: &dyn Fn(&Combination) -> bool| few.iter().any(|c| c.kind == kind && wanted(c));
            for one in &all {
                assert!(has(&|c| (c.n_threads, c.bundle_len) == (one.n_threads, one.bundle_len)), "{one}");
                assert!(has(&|c| (c.order, c.bundle_len) == (one.order, one.bundle_len)), "{one}");
                assert!(has(&|c| (c.order, c.n_threads) == (one.order, one.n_threads)), "{one}");
                assert!(has(&|c| (c.backend, c.bundle_len) == (one.backend, one.bundle_len)), "{one}");
            }
        }
    }
}
