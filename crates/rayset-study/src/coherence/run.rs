//! Runs the measurement.

use std::fs;
use std::thread;

use rayset_engine::{
    Coherent, Crop, Frame, IntersectionStrategy, PixelOrder, RenderOptions, Standard, SweepLength, render,
};
use rayset_scene::{RandomSpheres, Scene, SphereSize};

use super::{Coherence, CoherenceCell, CoherencePlan, CoherenceRow};
use crate::{Spread, StudyError};

/// The side of a tile, and the rows of a band: a band is one sweep, as it would be in the whole image.
const TILE: u32 = 16;

/// About how long `standard` may take for the bands of a cell, in nanoseconds: so many are rendered.
const LONGEST: f64 = 2e8;

/// More spheres than this of the usual size would fill the cube: they shrink so as to cover half of it.
const MOST_OF_USUAL_SIZE: u32 = 8;

/// Spheres beyond this number are not kept from overlapping, which takes time quadratic in it.
const MOST_SEPARATE: u32 = 256;

impl Coherence {
    /// Runs the measurement; `step` is called before each cell.
    ///
    /// # Errors
    ///
    /// [`StudyError::Differs`] if the strategies give other pixels or rays, which they never do.
    pub fn run(plan: &CoherencePlan, step: &mut dyn FnMut(&CoherenceCell)) -> Result<Self, StudyError> {
        let mut rows = Vec::new();
        for cell in &plan.cells {
            step(cell);
            rows.push(measure(cell, plan.repetitions)?);
        }
        let cores = thread::available_parallelism().map_or(1, usize::from);
        Ok(Self { processor: processor(), cores, repetitions: plan.repetitions, rows })
    }
}

/// The model name that the system gives, if it does, with family and number: virtual machines hide the rest of the name.
pub(crate) fn processor() -> String {
    described(&fs::read_to_string("/proc/cpuinfo").unwrap_or_default())
}

/// The first processor of a list as Linux writes it.
fn described(list: &str) -> String {
    let value = |key: &str| {
        let mut entries = list.lines().filter_map(|line| line.split_once(':'));
        entries.find(|(name, _)| name.trim() == key).map(|(_, value)| value.trim())
    };
    match (value("model name"), value("cpu family"), value("model")) {
        (Some(name), Some(family), Some(model)) => format!("{name} (family {family}, model {model})"),
        (Some(name), ..) => name.to_owned(),
        _ => std::env::consts::ARCH.to_owned(),
    }
}

fn scene(spheres: u32) -> Result<Scene, StudyError> {
    let usual = RandomSpheres::default();
    let size = if spheres > MOST_OF_USUAL_SIZE { SphereSize::Coverage(0.5) } else { usual.size };
    Ok(RandomSpheres { count: spheres, size, separate: spheres <= MOST_SEPARATE, ..usual }.scene()?)
}

fn measure(cell: &CoherenceCell, repetitions: usize) -> Result<CoherenceRow, StudyError> {
    let scene = scene(cell.spheres)?;
    let bands = bands(cell);
    let standard = Standard::on(&scene, cell.backend);
    let coherent = Coherent::on(&scene, cell.backend);
    let strategies: [&dyn IntersectionStrategy; 2] = [&standard, &coherent];
    let mut seconds = vec![[0.0; 2]; repetitions];
    let (mut rays, mut served, mut tests) = (0, 0, [0; 2]);
    for (repetition, seconds) in seconds.iter_mut().enumerate() {
        for (i, band) in bands.iter().enumerate() {
            // The two take turns band by band, and in going first: what else the machine does meets both.
            let first = (repetition + i) % 2;
            let mut frames: [Option<Frame>; 2] = [None, None];
            for which in [first, 1 - first] {
                let frame = render(strategies[which], &options(cell, *band))?;
                seconds[which] += frame.times.strategy.as_secs_f64();
                frames[which] = Some(frame);
            }
            if repetition == 0
                && let [Some(standard), Some(coherent)] = &frames
            {
                if standard.differing_pixels(coherent) > 0 || standard.counts != coherent.counts {
                    return Err(StudyError::Differs { what: format!("{cell:?}, {band:?}") });
                }
                rays += standard.counts.total().cast;
                served += coherent.stats.coherence.total().coherent;
                tests[0] += standard.stats.work.in_tests();
                tests[1] += coherent.stats.work.in_tests();
            }
        }
    }
    let spread = |of: &dyn Fn(&[f64; 2]) -> f64| Spread::of(&seconds.iter().map(of).collect::<Vec<_>>());
    Ok(CoherenceRow {
        spheres: cell.spheres,
        resolution: cell.resolution,
        backend: cell.backend.name().to_owned(),
        pixel_rows: bands.iter().map(|band| band.height).sum(),
        rays,
        standard: spread(&|pair| pair[0] * 1e9 / float(rays)),
        coherent: spread(&|pair| pair[1] * 1e9 / float(rays)),
        time: spread(&|pair| pair[1] / pair[0]),
        work: float(tests[1]) / float(tests[0]),
        percent_coherent: 100.0 * float(served) / float(rays),
    })
}

fn options(cell: &CoherenceCell, band: Crop) -> RenderOptions {
    RenderOptions {
        width: cell.resolution,
        height: cell.resolution,
        crop: Some(band),
        order: Some(PixelOrder::Tiles(TILE)),
        sweep: SweepLength::Rows(TILE),
        ..RenderOptions::default()
    }
}

/// Rows of tiles, evenly over the image: all of them, if that does not take too long.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "cut to the number of bands")]
fn bands(cell: &CoherenceCell) -> Vec<Crop> {
    let side = cell.resolution;
    let all = (side / TILE).max(1);
    // Some three rays a pixel, of 25 nanoseconds and four a volume.
    let a_band = f64::from(side * TILE) * 3.0 * (25.0 + 4.0 * f64::from(cell.spheres));
    let n = ((LONGEST / a_band) as u32).clamp(2.min(all), all);
    let band = |i: u32| {
        let middle = (2 * i + 1) * all / (2 * n);
        Crop { x: 0, y: middle * TILE, width: side, height: TILE.min(side) }
    };
    (0..n).map(band).collect()
}

#[expect(clippy::cast_precision_loss, reason = "counts below 2^53")]
fn float(count: u64) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use rayset_engine::Backend;

    use super::*;

    #[test]
    fn processors_are_told_apart() {
        let list =
            "processor\t: 0\ncpu family\t: 25\nmodel\t\t: 17\nmodel name\t: AMD EPYC\n\nmodel\t\t: 18\n";
        assert_eq!(described(list), "AMD EPYC (family 25, model 17)");
        assert_eq!(described("model name\t: Fast"), "Fast");
        assert_eq!(described(""), std::env::consts::ARCH);
    }

    #[test]
    fn bands_are_sweeps_of_the_whole_image() {
        for (spheres, resolution) in [(1, 64), (64, 512), (4096, 512), (64, 1024), (4096, 64)] {
            let bands = bands(&CoherenceCell { spheres, resolution, backend: Backend::Scalar });
            assert!(bands.len() >= 2);
            for pair in bands.windows(2) {
                assert!(pair[0].y % TILE == 0 && pair[0].y < pair[1].y && pair[1].y < resolution);
            }
        }
    }

    #[test]
    fn coherent_makes_no_more_tests_than_it_may() {
        let cell = |spheres| CoherenceCell { spheres, resolution: 64, backend: Backend::Scalar };
        let plan = CoherencePlan { cells: vec![cell(1), cell(8), cell(64)], repetitions: 1 };
        let result = Coherence::run(&plan, &mut |_| ()).unwrap();
        assert!(result.rows.iter().all(|row| row.work <= 1.01 && row.rays > 4096), "{:?}", result.rows);
        assert!(result.to_markdown().contains("| 64 |") && !result.processor.is_empty());
    }
}
