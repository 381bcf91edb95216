//! Sweeps over the image.

use std::fmt;
use std::ops::{ControlFlow, Range};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

#[cfg(feature = "parallel")]
use rayon::prelude::*;
use rayset_scene::Color;

use crate::film::Film;
use crate::sampling::{EyeRayMaker, Grid};
use crate::{
    Crop, EyeRays, Frame, FrameTimes, IntersectionStrategy, Layers, MAX_DEPTH, PixelOrder, RayCounts,
    RaySetIndex, RaySets, Recording, Shading, Stats, SweepLength, TreeOptions, shade,
};

/// The most pixels a side of an image may have.
const MAX_SIDE: u32 = 65_535;

/// No bundle's trees may hold more rays than this.
const MAX_BUNDLE_NODES: usize = 1 << 22;

/// What to render, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Where initial rays pass through the image.
    pub eye_rays: EyeRays,
    /// The part of the image to render; `None` for all of it. The frame is of that part's size.
    pub crop: Option<Crop>,
    /// The greatest depth of a tree, from 1 to [`MAX_DEPTH`]; the initial ray has depth 1.
    pub max_depth: u32,
    /// The adaptive cut-off: see [`TreeOptions::cutoff`].
    pub cutoff: Option<f64>,
    /// The order in which a sweep visits initial rays; `None` for what the strategy prefers. Changes no result.
    pub order: Option<PixelOrder>,
    /// How much of the image a sweep covers, in rows of initial rays.
    pub sweep: SweepLength,
    /// How many ray-sets are traced together; `None` for what the strategy prefers. Changes no result.
    pub bundle_len: Option<usize>,
    /// What the frame shows besides the image; changes no pixel and no count.
    pub layers: Layers,
}

impl Default for RenderOptions {
    /// 512 by 512 pixels, a ray through the middle of each, depth 5, cut-off 1/256, sweeps of 16 rows.
    fn default() -> Self {
        Self {
            width: 512,
            height: 512,
            eye_rays: EyeRays::default(),
            crop: None,
            max_depth: 5,
            cutoff: Some(1.0 / 256.0),
            order: None,
            sweep: SweepLength::default(),
            bundle_len: None,
            layers: Layers::default(),
        }
    }
}

/// Why there is no frame.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RenderError {
    /// The options make no sense.
    Invalid {
        /// What is wrong with them.
        message: String,
    },
    /// The observer asked to stop.
    Cancelled,
}

impl fmt::Display for RenderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Invalid { message } => f.write_str(message),
            Self::Cancelled => f.write_str("cancelled"),
        }
    }
}

impl std::error::Error for RenderError {}

/// What is done between two calls of an observer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Ray-sets finished.
    pub ray_sets: u64,
    /// Rays cast for them, of all kinds.
    pub rays: u64,
}

/// Called after every bundle, from any thread, with what was done in it; may ask to stop.
pub type Observer<'a> = &'a (dyn Fn(Progress) -> ControlFlow<()> + Sync);

impl RenderOptions {
    /// How many ray-sets the image takes: what [`Progress::ray_sets`] adds up to.
    #[must_use]
    pub fn n_ray_sets(&self) -> u64 {
        let grid = self.grid();
        grid.width() * grid.height()
    }

    fn grid(&self) -> Grid {
        let whole = Crop { x: 0, y: 0, width: self.width, height: self.height };
        Grid { image: (self.width, self.height), crop: self.crop.unwrap_or(whole), eye_rays: self.eye_rays }
    }
}

/// What a sweep works in; its memory is kept for the next.
#[derive(Default)]
struct Workspace {
    ray_sets: RaySets,
    /// The places of the grid, in order.
    places: Vec<(u32, u32)>,
    /// The colours of the sweep, in rows of the grid.
    radiance: Vec<Color>,
    /// Those of a bundle, and what shading needs.
    colors: Vec<Color>,
    shading: Shading,
}

/// What one sweep gives, besides its colours.
struct Sweep {
    rows: Range<u32>,
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
/// [`RenderError::Invalid`] if a side of the image is zero or above 65,535, the crop is empty or reaches outside, there
/// are no samples or 2^32 rays, the depth is zero or above [`MAX_DEPTH`], the bundle length is zero, or the cut-off is
/// negative or NaN.
pub fn render(strategy: &dyn IntersectionStrategy, options: &RenderOptions) -> Result<Frame, RenderError> {
    render_observed(strategy, options, &|_| ControlFlow::Continue(()))
}

/// Renders as [`render`] does, and tells an observer how far it is.
///
/// # Errors
///
/// Those of [`render`], and [`RenderError::Cancelled`] once the observer breaks.
pub fn render_observed(
    strategy: &dyn IntersectionStrategy,
    options: &RenderOptions,
    observer: Observer<'_>,
) -> Result<Frame, RenderError> {
    check(options)?;
    let start = Instant::now();
    let canvas = Canvas::new(options);
    let run = |rows: Range<u32>| {
        let mut workspace = canvas.workspace();
        let sweep = sweep(strategy, options, &canvas, rows, observer, &mut workspace)?;
        canvas.absorb(sweep, workspace);
        Ok(())
    };
    let order = options.order.unwrap_or_else(|| strategy.preferred_order());
    let bands = order.sweeps(height_of(&canvas.grid), options.sweep, canvas.grid.rows_of_a_pixel());
    // Each thread takes the next: the shortest come last.
    #[cfg(feature = "parallel")]
    let outcome: Result<(), RenderError> = bands.into_iter().par_bridge().try_for_each(run);
    #[cfg(not(feature = "parallel"))]
    let outcome: Result<(), RenderError> = bands.into_iter().try_for_each(run);
    outcome?;
    let mut frame = canvas.finish();
    frame.times.trace = start.elapsed();
    Ok(frame)
}

fn check(options: &RenderOptions) -> Result<(), RenderError> {
    let refuse = |message: String| Err(RenderError::Invalid { message });
    let (width, height) = (options.width, options.height);
    let sides = 1..=MAX_SIDE;
    if !(sides.contains(&width) && sides.contains(&height)) {
        return refuse(format!("an image of {width} x {height} pixels is not possible"));
    }
    if let Some(crop) = options.crop {
        let is_inside = |first: u32, length: u32, side: u32| {
            length > 0 && first.checked_add(length).is_some_and(|end| end <= side)
        };
        if !(is_inside(crop.x, crop.width, width) && is_inside(crop.y, crop.height, height)) {
            let Crop { x, y, width: w, height: h } = crop;
            return refuse(format!(
                "the crop of {w} x {h} pixels at ({x}, {y}) is empty or reaches outside the image of {width} x {height}"
            ));
        }
    }
    if options.eye_rays == (EyeRays::Centers { samples: 0 }) {
        return refuse("a pixel needs at least one sample".to_owned());
    }
    let grid = options.grid();
    if grid.width().checked_mul(grid.height()).is_none_or(|rays| rays >= u64::from(u32::MAX)) {
        return refuse("there are 2^32 initial rays or more".to_owned());
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

/// Rows of the grid: checked to fit.
fn height_of(grid: &Grid) -> u32 {
    u32::try_from(grid.height()).expect("fewer than 2^32 rays")
}

fn width_of(grid: &Grid) -> u32 {
    u32::try_from(grid.width()).expect("fewer than 2^32 rays")
}

/// The frame while sweeps are added to it, from any thread and in any order.
struct Canvas {
    grid: Grid,
    film: Option<Mutex<Film>>,
    picture: Mutex<Picture>,
    /// Of sweeps that are done: as many as there were threads, in the end.
    idle: Mutex<Vec<Workspace>>,
}

struct Picture {
    beauty: [Vec<f32>; 3],
    /// All rays of the grid, where pixels share them.
    shared: Vec<Color>,
    counts: RayCounts,
    stats: Stats,
    strategy_time: Duration,
}

impl Canvas {
    fn new(options: &RenderOptions) -> Self {
        let grid = options.grid();
        let n_pixels = grid.crop.width as usize * grid.crop.height as usize;
        let n_shared = match options.eye_rays {
            EyeRays::Corners => width_of(&grid) as usize * height_of(&grid) as usize,
            EyeRays::Centers { .. } => 0,
        };
        let layers = options.layers;
        let film = (layers.need_recording() || layers.need_hits())
            .then(|| Mutex::new(Film::new(layers, n_pixels, options.max_depth)));
        let picture = Picture {
            beauty: std::array::from_fn(|_| vec![0.0; n_pixels]),
            shared: vec![Color::ZERO; n_shared],
            counts: RayCounts::default(),
            stats: Stats::default(),
            strategy_time: Duration::ZERO,
        };
        Self { grid, film, picture: Mutex::new(picture), idle: Mutex::default() }
    }

    fn workspace(&self) -> Workspace {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    /// Adds the colours and counts of a sweep; the sums are of integers, so the order does not matter.
    fn absorb(&self, sweep: Sweep, workspace: Workspace) {
        let mut picture = self.picture.lock().unwrap_or_else(PoisonError::into_inner);
        let radiance = &workspace.radiance;
        picture.counts += sweep.counts;
        picture.stats += &sweep.stats;
        picture.strategy_time += sweep.strategy_time;
        if self.grid.eye_rays == EyeRays::Corners {
            let start = sweep.rows.start as usize * width_of(&self.grid) as usize;
            picture.shared[start..start + radiance.len()].copy_from_slice(radiance);
        } else {
            let rows =
                sweep.rows.start / self.grid.rows_of_a_pixel()..sweep.rows.end / self.grid.rows_of_a_pixel();
            picture.resolve(&self.grid, radiance, rows);
        }
        drop(picture);
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(workspace);
    }

    fn finish(self) -> Frame {
        let mut picture = self.picture.into_inner().unwrap_or_else(PoisonError::into_inner);
        if self.grid.eye_rays == EyeRays::Corners {
            let shared = std::mem::take(&mut picture.shared);
            picture.resolve(&self.grid, &shared, 0..self.grid.crop.height);
        }
        let film = self.film.map(|film| film.into_inner().unwrap_or_else(PoisonError::into_inner));
        Frame {
            width: self.grid.crop.width,
            height: self.grid.crop.height,
            beauty: picture.beauty,
            layers: film.map(Film::develop).unwrap_or_default(),
            counts: picture.counts,
            stats: picture.stats,
            times: FrameTimes { trace: Duration::ZERO, strategy: picture.strategy_time },
        }
    }
}

impl Picture {
    /// Turns rays into the pixels of some rows; `radiance` begins with the first ray of the first of them.
    #[expect(clippy::cast_possible_truncation, reason = "a pixel is rounded to f32 once, here")]
    fn resolve(&mut self, grid: &Grid, radiance: &[Color], rows: Range<u32>) {
        let width = grid.crop.width as usize;
        if grid.eye_rays == (EyeRays::Centers { samples: 1 }) {
            // Every ray is a pixel.
            let first = rows.start as usize * width;
            for (k, plane) in self.beauty.iter_mut().enumerate() {
                let plane = &mut plane[first..first + radiance.len()];
                plane.iter_mut().zip(radiance).for_each(|(sample, color)| *sample = color[k] as f32);
            }
            return;
        }
        for (row, y) in rows.enumerate() {
            for x in 0..width {
                let color = grid.mean(radiance, (x, row));
                for (plane, value) in self.beauty.iter_mut().zip(color.to_array()) {
                    plane[y as usize * width + x] = value as f32;
                }
            }
        }
    }
}

fn sweep(
    strategy: &dyn IntersectionStrategy,
    options: &RenderOptions,
    canvas: &Canvas,
    rows: Range<u32>,
    observer: Observer<'_>,
    workspace: &mut Workspace,
) -> Result<Sweep, RenderError> {
    let Workspace { ray_sets, places, radiance, colors, shading } = workspace;
    let scene = strategy.scene();
    let recording = if options.layers.need_recording() { Recording::PerQuery } else { Recording::Off };
    let mut tracer = strategy.begin_sweep(recording);
    let width = width_of(&canvas.grid);
    let first = rows.start * width;
    let order = options.order.unwrap_or_else(|| strategy.preferred_order());
    places.clear();
    order.extend_with_pixels(places, width, rows.clone());
    // Every place is written.
    radiance.resize(places.len(), Color::ZERO);
    let eye_rays = EyeRayMaker::new(&canvas.grid, scene.camera(), rows.clone());
    let tree_options = TreeOptions { max_depth: options.max_depth, cutoff: options.cutoff };
    let bundle_len = options.bundle_len.unwrap_or_else(|| strategy.preferred_bundle_len());
    // A tree of depth d has fewer than 2^d nodes.
    let bundle_len = bundle_len.clamp(1, MAX_BUNDLE_NODES >> options.max_depth);
    let mut rays_before = 0;
    for (i, bundle) in places.chunks(bundle_len).enumerate() {
        let bundle_start = u32::try_from(i * bundle_len).expect("fewer than 2^32 rays");
        let first = RaySetIndex(first + bundle_start);
        let trees = ray_sets.grow_places(scene, tracer.as_mut(), first, (&eye_rays, bundle), &tree_options);
        colors.clear();
        shade(trees, scene, shading, colors);
        for (&(x, y), color) in bundle.iter().zip(&*colors) {
            radiance[(y - rows.start) as usize * width as usize + x as usize] = *color;
        }
        if let Some(film) = &canvas.film {
            let mut film = film.lock().unwrap_or_else(PoisonError::into_inner);
            film.expose(&canvas.grid, bundle, ray_sets.trees(), ray_sets.tallies());
        }
        let rays = ray_sets.counts().total().cast;
        let progress = Progress { ray_sets: bundle.len() as u64, rays: rays - rays_before };
        rays_before = rays;
        if observer(progress).is_break() {
            return Err(RenderError::Cancelled);
        }
    }
    let stats = tracer.stats().clone();
    let (counts, strategy_time) = ray_sets.take_totals();
    Ok(Sweep { rows, counts, stats, strategy_time })
}
