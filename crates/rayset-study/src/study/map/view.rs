//! The map as numbers, for figures.

use std::path::Path;

use super::crossing::share;
use super::{Sheet, sheets};
use crate::StudyError;
use crate::study::interval::Median;
use crate::study::journal::Journal;
use crate::study::runner::Experiment;
use crate::study::timed::{COHERENT, Timed, names, shared};
use crate::study::{Scale, StudyName};

/// A sheet of the map: medians over seeds.
#[derive(Debug)]
pub(crate) struct Plane {
    /// Which spheres, in which order of pixels.
    pub(crate) title: &'static str,
    /// The parameters that all cells share, as the journal names them.
    pub(crate) shared: Vec<(&'static str, String)>,
    /// The columns: numbers of spheres.
    pub(crate) spheres: Vec<u32>,
    /// The rows: sides of the square images, in pixels.
    pub(crate) resolutions: Vec<u32>,
    /// How many seeds there are for each cell: 1, 2, and so on.
    pub(crate) seeds: u64,
    /// How many experiments there are, and how many of them are finished.
    pub(crate) n_experiments: (usize, usize),
    /// The program's version, as journals know it.
    pub(crate) version: String,
    /// The strategies but `standard`.
    pub(crate) strategies: Vec<(&'static str, Figures)>,
}

/// What is known of a strategy, row by row.
#[derive(Debug)]
pub(crate) struct Figures {
    /// Coherent rays in percent of all; none of a strategy that has no coherent rays.
    pub(crate) coherence: Option<Vec<Vec<Option<f64>>>>,
    /// Work over that of `standard`.
    pub(crate) work: Ratios,
    /// Time over that of `standard`.
    pub(crate) time: Ratios,
}

/// Ratios, row by row.
#[derive(Debug)]
pub(crate) struct Ratios {
    /// The ratio of each cell; none where nothing is finished.
    pub(crate) values: Vec<Vec<Option<f64>>>,
    /// Where each row crosses 1, in columns: 2.5 is half way, in the logarithm of n, from the third to the fourth.
    pub(crate) crossings: Vec<Vec<f64>>,
}

/// Every sheet with what is finished of it.
pub(crate) fn planes(folder: &Path, scale: Scale) -> Result<Vec<Plane>, StudyError> {
    let journal = Journal::read(&StudyName::Map.path(folder))?;
    Ok(sheets(scale).iter().map(|sheet| plane(sheet, &journal)).collect())
}

fn plane(sheet: &Sheet, journal: &Journal<Timed>) -> Plane {
    let median = |figure: &dyn Fn(&Timed) -> f64| -> Vec<Vec<Option<f64>>> {
        let cell = |n: u32, side: u32| {
            let values: Vec<_> = sheet.timed(journal, n, side).iter().map(|timed| figure(timed)).collect();
            Some(Median::of(&values).value).filter(|value| value.is_finite())
        };
        let row = |&side: &u32| sheet.spheres.iter().map(|&n| cell(n, side)).collect();
        sheet.resolutions.iter().map(row).collect()
    };
    let figures = |strategy: usize| Figures {
        coherence: COHERENT
            .iter()
            .any(|&(coherent, _)| coherent == strategy)
            .then(|| median(&|timed| timed.strategies[strategy].counts.percent_coherent())),
        work: Ratios::of(median(&|timed| timed.ratio_of_work(strategy, 0))),
        time: Ratios::of(median(&|timed| timed.ratio_of_time(strategy, 0))),
    };
    let finished = sheet.cells().filter(|cell| journal.get(&cell.key()).is_some()).count();
    Plane {
        title: sheet.title,
        shared: shared(&sheet.cells().collect::<Vec<_>>()),
        spheres: sheet.spheres.clone(),
        resolutions: sheet.resolutions.clone(),
        seeds: sheet.seeds,
        n_experiments: (sheet.cells().count(), finished),
        version: sheet.cells().next().map_or_else(String::new, |cell| cell.version().to_owned()),
        strategies: names().enumerate().skip(1).map(|(i, name)| (name, figures(i))).collect(),
    }
}

impl Ratios {
    fn of(values: Vec<Vec<Option<f64>>>) -> Self {
        let crossings = values.iter().map(|row| crossings(row)).collect();
        Self { values, crossings }
    }
}

/// Between neighbours, one below 1 and the other not.
fn crossings(row: &[Option<f64>]) -> Vec<f64> {
    let mut found = Vec::new();
    let mut column = 0.0;
    for pair in row.windows(2) {
        if let [Some(a), Some(b)] = *pair
            && (a < 1.0) != (b < 1.0)
        {
            found.push(column + share(a, b));
        }
        column += 1.0;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_crossing_of_a_row_is_found_and_none_beside_a_gap() {
        let row = [Some(1.5), Some(0.5), Some(0.75), Some(1.25), None, Some(0.5)];
        assert_eq!(crossings(&row), [0.5, 2.5]);
        assert!(crossings(&[Some(1.0), Some(1.0)]).is_empty());
    }
}
