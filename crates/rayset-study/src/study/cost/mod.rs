//! Does section 3 predict times, and do counts of rays by kind?

mod fit;
mod models;
mod report;

use std::path::Path;

pub(crate) use self::models::{Fit, Fits, Prediction};
use super::journal::Journal;
use super::runner::{Step, run_missing};
use super::timed::Cell;
use super::{Scale, StudyName};
use crate::StudyError;

/// Scenes to fit on, and others to test on.
fn cells(scale: Scale) -> (Vec<Cell>, Vec<Cell>) {
    let (sizes, numbers): (&[&str], &[u32]) = match scale {
        Scale::Full => (&["cover-0.3", "cover-0.5", "cover-0.8"], &[1, 2, 4, 8, 16, 32, 64, 96, 128, 256]),
        Scale::Quick => (&["cover-0.5"], &[1, 4, 16, 64, 128]),
        Scale::Tiny => (&["cover-0.5"], &[1, 4, 16]),
    };
    let of = |first_seed: u64, resolution: u32, reflectances: [&'static str; 2]| -> Vec<Cell> {
        sizes
            .iter()
            .flat_map(|&size| {
                numbers.iter().zip(first_seed..).map(move |(&spheres, seed)| Cell {
                    spheres,
                    size,
                    reflectance: reflectances[usize::from(seed % 2 == 1)],
                    seed,
                    resolution,
                    tiles: false,
                    // Enough for a steady time.
                    pixels: if spheres < 64 { 65_536 } else { 32_768 },
                    repetitions: 9,
                    others: false,
                })
            })
            .collect()
    };
    let sides = if scale == Scale::Tiny { [32, 24] } else { [256, 192] };
    // Other seeds, resolutions and materials: the test is not more of the same.
    (of(101, sides[0], ["0.3", "0.6"]), of(201, sides[1], ["0.5", "0.2"]))
}

pub(super) fn run(folder: &Path, scale: Scale, step: Step<'_>) -> Result<(), StudyError> {
    let mut journal = Journal::open(&StudyName::CostModel.path(folder))?;
    let (mut all, test) = cells(scale);
    all.extend(test);
    run_missing(&mut journal, &all, 1, step)
}

pub(super) fn report(folder: &Path, scale: Scale) -> Result<String, StudyError> {
    Ok(report::markdown(&fits(folder, scale)?))
}

/// What its journal says, as numbers; what is not finished is left out.
pub(crate) fn fits(folder: &Path, scale: Scale) -> Result<Fits, StudyError> {
    let journal = Journal::read(&StudyName::CostModel.path(folder))?;
    let (fit, test) = cells(scale);
    Ok(Fits::of(&fit, &test, &journal))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_scene_is_both_fitted_and_tested() {
        let (fit, test) = cells(Scale::Full);
        assert_eq!((fit.len(), test.len()), (30, 30));
        assert!(fit.iter().all(|a| test.iter().all(|b| a.seed != b.seed)));
    }
}
