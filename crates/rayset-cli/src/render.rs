//! `rayset render`.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rayset::engine::{
    Backend, Crop, EyeRays, Frame, Layer, Layers, MAX_DEPTH, PixelOrder, RenderError, RenderOptions,
    StrategyKind,
};
use rayset::glam::DVec3;
use rayset::image::{Image, ImageError, check_writable, to_srgb8, write_exr, write_png_rgb8, write_whole};
use rayset::scene::{Camera, Scene};
use rayset::{ChannelNames, image_of};

use crate::audit::{Audit, audit, brute_force};
use crate::load::Source;
use crate::statistics::{Rays, Seconds, Statistics, image_bits, seconds};
use crate::values::{self, Cutoff, Resolution};
use crate::{Outcome, interrupt, progress};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rayset render teapot.obj
  rayset render cornell.toml --resolution 1024x1024 --samples 3 --out cornell.png --exposure 0.5
  rayset render balls.nff --eye-rays corners --cutoff off --stats balls.json
  rayset render spheres.toml --strategy speer-1985 --layers all --audit --out spheres.exr
  rayset render knob.obj --from 1,2,5 --at 0,0,0 --angle 30 --crop 100,100,64,64

Without --out and --stats the image goes to the scene's name with the ending .exr, in the current folder.
An EXR holds linear radiance as 32-bit floats; without --layers its channels are R, G and B, with it each channel
carries the name of its layer, as in beauty.R. A PNG holds the picture as 8-bit sRGB: radiance is multiplied by
2^EV, clamped to 0 to 1, and encoded by the sRGB transfer function.
Layers: beauty, depth, normal, object, primitive, rays, volumes, primitives, pierce, coherent, certificate, wrong.")]
pub(crate) struct Options {
    #[command(flatten)]
    source: Source,
    /// How rays find what they hit; every strategy but speer-1985 gives the same bits.
    #[arg(long, value_name = "NAME", default_value = StrategyKind::default().name())]
    strategy: StrategyKind,
    /// Pixels across and down; by default what the scene asks for, or 512x512.
    #[arg(long, value_name = "WxH")]
    resolution: Option<Resolution>,
    /// Where initial rays pass: the centres of pixels, or their corners, four of which average to a pixel.
    #[arg(long, value_name = "centers|corners", default_value = "centers")]
    eye_rays: EyeRayPlaces,
    /// The greatest depth of a tree; the initial ray has depth 1.
    #[arg(long, value_name = "N", default_value_t = 5,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_DEPTH)))]
    depth: u32,
    /// Leaves out rays that can add no more than this share of their intensity to the pixel; `off` for none.
    #[arg(long, value_name = "X|off", default_value = "0.00390625")]
    cutoff: Cutoff,
    /// The order of pixels: scanline, serpentine, tiles, tiles=N, morton or morton=N; by default what suits the strategy. Changes no pixel.
    #[arg(long, value_name = "ORDER", value_parser = values::order)]
    order: Option<PixelOrder>,
    /// Threads; by default one for each processor. Changes no pixel and no count.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Renders only these pixels of the image: the first column, the first row, columns and rows.
    #[arg(long, value_name = "X,Y,W,H", value_parser = values::crop)]
    crop: Option<Crop>,
    /// Rays in a pixel: a regular grid of N by N.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=256))]
    samples: Option<u32>,
    /// The viewpoint, instead of the scene's.
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true)]
    from: Option<DVec3>,
    /// The point in the middle of the image, instead of the scene's.
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true)]
    at: Option<DVec3>,
    /// The direction that is upwards in the image, instead of the scene's.
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true)]
    up: Option<DVec3>,
    /// The full angle of view from the lower to the upper edge, in degrees, instead of the scene's.
    #[arg(long, value_name = "DEG")]
    angle: Option<f64>,
    /// The exposure of a PNG, in stops.
    #[arg(long, value_name = "EV", default_value_t = 0.0, allow_hyphen_values = true)]
    exposure: f64,
    /// What an EXR shows: names of layers with commas between them, or all.
    #[arg(long, value_name = "NAME,...|all", value_parser = values::layers)]
    layers: Option<Layers>,
    /// The image: .exr or .png.
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Writes times, counts and the hash of the image as JSON.
    #[arg(long, value_name = "FILE.json")]
    stats: Option<PathBuf>,
    /// Checks the image and its counts against brute force afterwards; exit status 1 if an exact strategy is wrong.
    #[arg(long)]
    audit: bool,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum EyeRayPlaces {
    Centers,
    Corners,
}

/// What tracing gives.
struct Traced {
    frame: Frame,
    audit: Option<Audit>,
    prepare: Duration,
}

/// What is written, and where.
enum Target {
    Exr(PathBuf),
    Png(PathBuf),
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Box<dyn Error>> {
    let target = options.target()?;
    // An output that cannot be written is found out before the minutes are spent.
    for path in target.iter().map(Target::path).chain(options.stats.as_deref()) {
        check_writable(path)?;
    }
    interrupt::listen()?;
    let start = Instant::now();
    let loaded = options.source.load()?;
    let scene = options.aimed(loaded.scene)?;
    let load = start.elapsed();
    let render_options = options.render_options(loaded.resolution)?;
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = options.threads {
        pool = pool.num_threads(usize::from(threads));
    }
    let pool = pool.build()?;

    interrupt::set_busy();
    let traced = pool.install(|| options.trace(&scene, &render_options));
    let Traced { frame, audit, prepare } = match traced {
        Ok(traced) => traced,
        Err(RenderError::Cancelled) => return Ok(Outcome::Interrupted),
        Err(error) => return Err(error.into()),
    };

    let start = Instant::now();
    if let Some(target) = &target {
        pool.install(|| options.write(target, &frame, &render_options))?;
    }
    let write = start.elapsed();
    let statistics = Statistics {
        scene: options.source.scene.display().to_string(),
        strategy: options.strategy.name(),
        resolution: [render_options.width, render_options.height],
        crop: render_options.crop.map(|crop| [crop.x, crop.y, crop.width, crop.height]),
        threads: pool.current_num_threads(),
        simd: Backend::active().name(),
        seconds: Seconds {
            load: seconds(load),
            prepare: seconds(prepare),
            trace: seconds(frame.times.trace),
            strategy: seconds(frame.times.strategy),
            write: seconds(write),
        },
        rays: Rays::of(&frame),
        work: frame.stats.work.into(),
        image_bits: image_bits(&frame),
        audit,
    };
    if let Some(path) = &options.stats {
        let mut json = serde_json::to_vec_pretty(&statistics)?;
        json.push(b'\n');
        write_whole(path, &json)?;
    }
    report(&frame, &statistics, target.as_ref());
    let is_wrong =
        options.strategy.is_exact() && statistics.audit.as_ref().is_some_and(|audit| !audit.is_clean());
    Ok(if is_wrong { Outcome::Differs } else { Outcome::Done })
}

impl Options {
    fn target(&self) -> Result<Option<Target>, Box<dyn Error>> {
        let path = match (&self.out, &self.stats) {
            (Some(path), _) => path.clone(),
            (None, Some(_)) if self.layers.is_none() => return Ok(None),
            (None, _) => {
                let name = self.source.scene.file_name().unwrap_or_default().to_string_lossy();
                let stem = name.strip_suffix(".gz").unwrap_or(&name);
                Path::new(stem).with_extension("exr")
            }
        };
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        match ending.as_deref() {
            Some("exr") => Ok(Some(Target::Exr(path))),
            Some("png") if self.layers.is_some_and(|layers| layers != Layers::BEAUTY) => {
                Err("a PNG shows beauty alone: give layers to an .exr".into())
            }
            Some("png") => Ok(Some(Target::Png(path))),
            _ => Err(format!("`{}` ends neither with .exr nor with .png", path.display()).into()),
        }
    }

    /// The scene seen as the command line asks for it.
    fn aimed(&self, scene: Scene) -> Result<Scene, Box<dyn Error>> {
        if self.from.is_none() && self.at.is_none() && self.up.is_none() && self.angle.is_none() {
            return Ok(scene);
        }
        let camera = *scene.camera();
        let camera = Camera::new(
            self.from.unwrap_or(camera.viewpoint()),
            self.at.unwrap_or(camera.target()),
            self.up.unwrap_or(camera.up()),
            self.angle.unwrap_or(camera.angle()),
        )?;
        Ok(scene.with_camera(camera)?)
    }

    fn render_options(&self, resolution: Option<(u32, u32)>) -> Result<RenderOptions, Box<dyn Error>> {
        let asked = self.resolution.map(|Resolution(width, height)| (width, height));
        let (width, height) = asked.or(resolution).unwrap_or((512, 512));
        let eye_rays = match (self.eye_rays, self.samples) {
            (EyeRayPlaces::Corners, Some(_)) => {
                return Err("--samples goes with --eye-rays centers only".into());
            }
            (EyeRayPlaces::Corners, None) => EyeRays::Corners,
            (EyeRayPlaces::Centers, samples) => EyeRays::Centers { samples: samples.unwrap_or(1) },
        };
        if !self.exposure.is_finite() {
            return Err("the exposure is not a number".into());
        }
        Ok(RenderOptions {
            width,
            height,
            eye_rays,
            crop: self.crop,
            max_depth: self.depth,
            cutoff: self.cutoff.0,
            order: self.order,
            layers: self.layers.unwrap_or_default(),
            ..RenderOptions::default()
        })
    }

    /// Renders, and then, not to disturb the times, whatever else was asked for.
    fn trace(&self, scene: &Scene, options: &RenderOptions) -> Result<Traced, RenderError> {
        let start = Instant::now();
        let strategy = self.strategy.bind(scene);
        let prepare = start.elapsed();
        let mut frame = progress::render("render", strategy.as_ref(), options)?;
        let needs_wrong = options.layers.contain(Layer::Wrong1985);
        let is_exact = strategy.is_exact();
        let expected = match self.audit || (needs_wrong && !is_exact) {
            true => Some(brute_force(scene, options)?),
            false => None,
        };
        if needs_wrong {
            let other = match &expected {
                Some(expected) if !is_exact => expected.clone(),
                _ => {
                    let literal = StrategyKind::Speer1985.bind(scene);
                    let options = RenderOptions { layers: Layers::BEAUTY, ..*options };
                    progress::render("1985", literal.as_ref(), &options)?
                }
            };
            frame.mark_wrong(&other);
        }
        let audit = match &expected {
            Some(expected) if self.audit => Some(audit(scene, self.strategy, options, &frame, expected)?),
            _ => None,
        };
        Ok(Traced { frame, audit, prepare })
    }

    fn write(&self, target: &Target, frame: &Frame, options: &RenderOptions) -> Result<(), ImageError> {
        let path = target.path();
        match target {
            Target::Exr(_) => {
                let names = if self.layers.is_some() { ChannelNames::Layered } else { ChannelNames::Plain };
                let image = self.with_provenance(frame, names, options)?;
                write_exr(path, &image)?;
            }
            Target::Png(_) => {
                let image = image_of(frame, ChannelNames::Plain, &[])?;
                write_png_rgb8(path, frame.width, frame.height, &to_srgb8(&image, self.exposure)?)?;
            }
        }
        Ok(())
    }

    /// The image with what decides its pixels as attributes.
    fn with_provenance(
        &self,
        frame: &Frame,
        names: ChannelNames,
        options: &RenderOptions,
    ) -> Result<Image, ImageError> {
        let scene = self.source.scene.file_name().unwrap_or_default().to_string_lossy();
        let depth = options.max_depth.to_string();
        let cutoff = options.cutoff.map_or_else(|| "off".to_owned(), |cutoff| cutoff.to_string());
        let provenance = [
            ("scene", scene.as_ref()),
            ("strategy", self.strategy.name()),
            ("max_depth", &depth),
            ("cutoff", &cutoff),
        ];
        let keep = self.layers.is_none_or(|layers| layers.contain(Layer::Beauty));
        let image = image_of(frame, names, &provenance)?;
        Ok(if keep { image } else { without_beauty(&image)? })
    }
}

/// The image without the layer nobody asked for.
fn without_beauty(image: &Image) -> Result<Image, ImageError> {
    let mut rest = Image::new(image.width(), image.height())?;
    for channel in image.channels().iter().filter(|channel| channel.layer_name() != "beauty") {
        match channel.samples() {
            rayset::image::Samples::F32(samples) => rest.push_f32(channel.name(), samples.clone())?,
            rayset::image::Samples::U32(samples) => rest.push_u32(channel.name(), samples.clone())?,
        }
    }
    for (name, value) in image.attributes() {
        rest.push_attribute(name, value)?;
    }
    Ok(rest)
}

impl Target {
    fn path(&self) -> &Path {
        match self {
            Self::Exr(path) | Self::Png(path) => path,
        }
    }
}

/// The result in a few lines.
fn report(frame: &Frame, statistics: &Statistics, target: Option<&Target>) {
    for (kind, tally) in frame.counts.iter() {
        let coherent = frame.stats.coherence[kind].coherent;
        println!(
            "{:9} rays  {:>12} cast {:>12} hit {:>12} coherent",
            kind.name(),
            tally.cast,
            tally.hit,
            coherent
        );
    }
    let Seconds { load, prepare, trace, strategy, .. } = statistics.seconds;
    let rays = frame.counts.total().cast as f64;
    println!(
        "load {load:.3} s, prepare {prepare:.3} s, trace {trace:.3} s ({:.2} Mrays/s), strategy {strategy:.3} s on {} threads",
        rays / trace.max(1e-9) / 1e6,
        statistics.threads
    );
    if let Some(audit) = &statistics.audit {
        let counts = if audit.same_ray_counts { "the same" } else { "other" };
        println!("audit: {} wrong pixels, {counts} ray counts as brute force", audit.wrong_pixels);
    }
    if let Some(target) = target {
        println!("wrote {}", target.path().display());
    }
}
