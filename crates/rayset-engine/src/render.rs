//! Sweeps over the image.

use std::fmt;
use std::ops::Range;
use std::time::{Duration, Instant};

#[cfg(feature = "parallel")]
use rayon::prelude::*;
use rayset_scene::Color;

use crate::{
    IntersectionStrategy, MAX_DEPTH, PixelOrder, RayCounts, RaySetIndex, RaySets, Recording, Stats,
    SweepLength, TreeOptions, shade,
};

/// The most pixels a side of an image may have.
const MAX_SIDE: u32 = 65_535;

/// No bundle's trees may hold more rays than this.
const MAX_BUNDLE_NODES: usize = 1 << 22;

/// What to render, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// Pixels across; each is sampled once, at its centre.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// The greatest depth of a tree, from 1 to [`MAX_DEPTH`]; the initial ray has depth 1.
    pub max_depth: u32,
    /// The adaptive cut-off: see [`TreeOptions::cutoff`].
    pub cutoff: Option<f64>,
    /// The order in which a sweep visits pixels.
    pub order: PixelOrder,
    /// How much of the image a sweep covers.
    pub sweep: SweepLength,
    /// How many ray-sets are traced together; `None` for what the strategy prefers. Changes no result.
    pub bundle_len: Option<usize>,
    /// Whether the rays of each pixel, and the coherent ones among them, become planes of the frame.
    pub recording: Recording,
}

impl Default for RenderOptions {
    /// 512 by 512 pixels, depth 5, cut-off 1/256, scanlines, sweeps of 16 rows.
    fn default() -> Self {
        Self {
            width: 512,
            height: 512,
            max_depth: 5,
            cutoff: Some(1.0 / 256.0),
            order: PixelOrder::Scanline,
            sweep: SweepLength::default(),
            bundle_len: None,
            recording: Recording::Off,
        }
    }
}

/// Options that make no sense.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RenderError {
    message: String,
}

impl fmt::Display for RenderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for RenderError {}

/// A rendered image, with what it took.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Linear red, green and blue of every pixel, rows from the top.
    pub beauty: [Vec<f32>; 3],
    /// Rays cast for every pixel, if recorded.
    pub rays: Option<Vec<u32>>,
    /// The fraction of each pixel's rays that were coherent, if recorded.
    pub coherent: Option<Vec<f32>>,
    /// Rays by kind; the same for every exact strategy.
    pub counts: RayCounts,
    /// What the strategy counted.
    pub stats: Stats,
    /// How long it took.
    pub times: FrameTimes,
}

/// How long a frame took.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameTimes {
    /// From the first ray to the last pixel, by the clock.
    pub trace: Duration,
    /// Inside the strategy's calls, summed over threads.
    pub strategy: Duration,
}

/// A named plane of numbers, one a pixel, rows from the top.
#[derive(Clone, Copy, Debug)]
pub struct Plane<'a> {
    /// The name: of a channel as OpenEXR has it.
    pub name: &'static str,
    /// The numbers.
    pub samples: PlaneSamples<'a>,
}

/// The numbers of a plane.
#[derive(Clone, Copy, Debug)]
pub enum PlaneSamples<'a> {
    /// Quantities.
    F32(&'a [f32]),
    /// Counts and ids.
    U32(&'a [u32]),
}

impl Frame {
    /// All planes: `R`, `G`, `B`, and what was recorded.
    #[must_use]
    pub fn planes(&self) -> Vec<Plane<'_>> {
        let names = ["R", "G", "B"].into_iter().zip(&self.beauty);
        let mut planes: Vec<_> =
            names.map(|(name, samples)| Plane { name, samples: PlaneSamples::F32(samples) }).collect();
        if let Some(rays) = &self.rays {
            planes.push(Plane { name: "rays", samples: PlaneSamples::U32(rays) });
        }
        if let Some(coherent) = &self.coherent {
            planes.push(Plane { name: "coherent", samples: PlaneSamples::F32(coherent) });
        }
        planes
    }

    /// How many pixels differ from another frame's in any bit of their colour.
    ///
    /// # Panics
    ///
    /// If the frames differ in size.
    #[must_use]
    pub fn differing_pixels(&self, other: &Self) -> usize {
        assert_eq!((self.width, self.height), (other.width, other.height), "frames of one size");
        let pixels = 0..self.beauty[0].len();
        pixels
            .filter(|&i| (0..3).any(|k| self.beauty[k][i].to_bits() != other.beauty[k][i].to_bits()))
            .count()
    }
}

/// What one sweep gives.
struct Sweep {
    pixels: Vec<(u32, u32)>,
    radiance: Vec<Color>,
    tallies: Vec<(u32, u32)>,
    counts: RayCounts,
    stats: Stats,
    strategy_time: Duration,
}

/// Renders the scene that a strategy is bound to.
///
/// Sweeps run on all threads of the current rayon pool (feature `parallel`); neither pixels nor counts depend on how
/// many there are.
///
/// # Errors
///
/// [`RenderError`] if a side of the image is zero or above 65,535, the depth is zero or above [`MAX_DEPTH`], the
/// bundle length is zero, or the cut-off is negative or NaN.
pub fn render(strategy: &dyn IntersectionStrategy, options: &RenderOptions) -> Result<Frame, RenderError> {
    check(options)?;
    let start = Instant::now();
    let bands = options.order.sweeps(options.height, options.sweep);
    #[cfg(feature = "parallel")]
    let sweeps: Vec<Sweep> = bands.into_par_iter().map(|band| sweep(strategy, options, band)).collect();
    #[cfg(not(feature = "parallel"))]
    let sweeps: Vec<Sweep> = bands.into_iter().map(|band| sweep(strategy, options, band)).collect();

    let n_pixels = options.width as usize * options.height as usize;
    let recorded = options.recording == Recording::PerQuery;
    let mut frame = Frame {
        width: options.width,
        height: options.height,
        beauty: std::array::from_fn(|_| vec![0.0; n_pixels]),
        rays: recorded.then(|| vec![0; n_pixels]),
        coherent: recorded.then(|| vec![0.0; n_pixels]),
        counts: RayCounts::default(),
        stats: Stats::default(),
        times: FrameTimes::default(),
    };
    for sweep in sweeps {
        frame.merge(&sweep);
    }
    frame.times.trace = start.elapsed();
    Ok(frame)
}

fn check(options: &RenderOptions) -> Result<(), RenderError> {
    let refuse = |message: String| Err(RenderError { message });
    let sides = 1..=MAX_SIDE;
    if !(sides.contains(&options.width) && sides.contains(&options.height)) {
        return refuse(format!("an image of {} x {} pixels is not possible", options.width, options.height));
    }
    if !(1..=MAX_DEPTH).contains(&options.max_depth) {
        return refuse(format!("a depth of {} is not between 1 and {MAX_DEPTH}", options.max_depth));
    }
    if options.bundle_len == Some(0) {
        return refuse("a bundle needs at least one ray-set".to_owned());
    }
    if options.cutoff.is_some_and(|cutoff| cutoff < 0.0 || cutoff.is_nan()) {
        return refuse("the cut-off is negative or not a number".to_owned());
    }
    Ok(())
}

fn sweep(strategy: &dyn IntersectionStrategy, options: &RenderOptions, rows: Range<u32>) -> Sweep {
    let scene = strategy.scene();
    let mut tracer = strategy.begin_sweep(options.recording);
    let mut ray_sets = RaySets::default();
    let first = rows.start * options.width;
    let mut pixels = Vec::new();
    options.order.extend_with_pixels(&mut pixels, options.width, rows);
    let mut radiance = Vec::with_capacity(pixels.len());
    let mut tallies = Vec::new();
    let mut scratch = Vec::new();
    let tree_options = TreeOptions { max_depth: options.max_depth, cutoff: options.cutoff };
    let bundle_len = options.bundle_len.unwrap_or_else(|| strategy.preferred_bundle_len());
    // A tree of depth d has fewer than 2^d nodes.
    let bundle_len = bundle_len.clamp(1, MAX_BUNDLE_NODES >> options.max_depth);
    for (i, bundle) in pixels.chunks(bundle_len).enumerate() {
        let bundle_start = u32::try_from(i * bundle_len).expect("fewer than 2^32 pixels");
        let rays = bundle.iter().map(|&(x, y)| {
            scene.camera().ray(f64::from(x) + 0.5, f64::from(y) + 0.5, options.width, options.height)
        });
        let trees =
            ray_sets.grow(scene, tracer.as_mut(), RaySetIndex(first + bundle_start), rays, &tree_options);
        shade(trees, scene, &mut scratch, &mut radiance);
        if options.recording == Recording::PerQuery {
            tallies.extend(ray_sets.tallies().iter().map(|tally| (tally.rays, tally.coherent)));
        }
    }
    let stats = tracer.stats().clone();
    let (counts, strategy_time) = (*ray_sets.counts(), ray_sets.strategy_time());
    Sweep { pixels, radiance, tallies, counts, stats, strategy_time }
}

impl Frame {
    #[expect(clippy::cast_possible_truncation, reason = "a pixel is rounded to f32 once, here")]
    #[expect(clippy::cast_precision_loss, reason = "the ratio of two small counts")]
    fn merge(&mut self, sweep: &Sweep) {
        for (i, (&(x, y), color)) in sweep.pixels.iter().zip(&sweep.radiance).enumerate() {
            let pixel = y as usize * self.width as usize + x as usize;
            for (plane, value) in self.beauty.iter_mut().zip(color.to_array()) {
                plane[pixel] = value as f32;
            }
            if let Some(&(rays, coherent)) = sweep.tallies.get(i) {
                if let Some(plane) = &mut self.rays {
                    plane[pixel] = rays;
                }
                if let Some(plane) = &mut self.coherent {
                    plane[pixel] = coherent as f32 / rays as f32;
                }
            }
        }
        self.counts += sweep.counts;
        self.stats += &sweep.stats;
        self.times.strategy += sweep.strategy_time;
    }
}
