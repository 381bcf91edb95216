//! Coherence, work and time over the plane of n and resolution.

mod claims;
mod crossing;
mod report;
mod view;

use std::path::Path;

pub(crate) use self::view::{Figures, Plane, planes};
use super::journal::Journal;
use super::runner::{Experiment, Step, run_missing};
use super::timed::{Cell, Timed};
use super::{Scale, StudyName};
use crate::StudyError;

/// The plane with one size of spheres and one order of pixels.
#[derive(Clone, Debug)]
struct Sheet {
    title: &'static str,
    size: &'static str,
    tiles: bool,
    spheres: Vec<u32>,
    resolutions: Vec<u32>,
    seeds: u64,
}

fn sheets(scale: Scale) -> Vec<Sheet> {
    let (all, some) = match scale {
        Scale::Full => (vec![64, 128, 256, 512, 1024, 2048, 4096], vec![256, 1024, 4096]),
        Scale::Quick => (vec![64, 256, 1024], vec![256]),
        Scale::Tiny => (vec![16, 32], vec![16]),
    };
    let (many, few, seeds) = match scale {
        Scale::Full => (vec![1, 2, 4, 8, 16, 32, 64, 256, 1024, 4096], vec![1, 2, 4, 8, 16, 32], 5),
        Scale::Quick => (vec![1, 4, 16, 64], vec![1, 8], 2),
        Scale::Tiny => (vec![1, 4, 8, 16], vec![1, 16], 1),
    };
    vec![
        Sheet {
            title: "Spheres that cover half of the cube's face, scanlines",
            size: "cover-0.5",
            tiles: false,
            spheres: many,
            resolutions: all.clone(),
            seeds,
        },
        Sheet {
            title: "Spheres of Table 1 (radii 0.35 to 0.6), scanlines",
            size: "0.35-0.6",
            tiles: false,
            spheres: few,
            resolutions: all,
            seeds,
        },
        Sheet {
            title: "Spheres that cover half of the cube's face, tiles of 8 x 8",
            size: "cover-0.5",
            tiles: true,
            spheres: vec![8, 16, 32, 64, 256],
            resolutions: some,
            seeds,
        },
    ]
}

impl Sheet {
    fn cell(&self, spheres: u32, resolution: u32, seed: u64) -> Cell {
        // A partition takes time in proportion to n: the more volumes, the fewer pixels are needed for a steady time.
        let pixels = match spheres {
            0..16 => 65_536,
            16..256 => 32_768,
            256..1024 => 16_384,
            1024..4096 => 8192,
            _ => 4096,
        };
        let Self { size, tiles, .. } = *self;
        Cell {
            spheres,
            size,
            reflectance: "0.3",
            seed,
            resolution,
            tiles,
            pixels,
            repetitions: 3,
            others: true,
        }
    }

    fn cells(&self) -> impl Iterator<Item = Cell> {
        self.spheres.iter().flat_map(move |&spheres| {
            self.resolutions
                .iter()
                .flat_map(move |&side| (1..=self.seeds).map(move |seed| self.cell(spheres, side, seed)))
        })
    }

    /// The one that is looked at more closely.
    fn usual_resolution(&self) -> Option<u32> {
        self.resolutions.iter().copied().find(|&side| side == 512).or(self.resolutions.get(1).copied())
    }

    /// What is finished of a cell, seed by seed.
    fn timed<'j>(&self, journal: &'j Journal<Timed>, spheres: u32, resolution: u32) -> Vec<&'j Timed> {
        (1..=self.seeds).filter_map(|seed| journal.get(&self.cell(spheres, resolution, seed).key())).collect()
    }
}

pub(super) fn run(folder: &Path, scale: Scale, step: Step<'_>) -> Result<(), StudyError> {
    let mut journal = Journal::open(&StudyName::Map.path(folder))?;
    let mut cells: Vec<_> = sheets(scale).iter().flat_map(Sheet::cells).collect();
    // All cells of one seed before any of the next: a run that is stopped has a map.
    cells.sort_by_key(|cell| cell.seed);
    run_missing(&mut journal, &cells, 1, step)
}

pub(super) fn report(folder: &Path, scale: Scale) -> Result<String, StudyError> {
    let journal = Journal::read(&StudyName::Map.path(folder))?;
    Ok(report::markdown(&sheets(scale), &journal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::timed::names;

    #[test]
    fn every_strategy_is_on_the_map_and_coherence_where_there_is_any() {
        let folder = tempfile::tempdir().unwrap();
        run(folder.path(), Scale::Tiny, &|_, _| ()).unwrap();
        let text = report(folder.path(), Scale::Tiny).unwrap();
        let planes = planes(folder.path(), Scale::Tiny).unwrap();
        for plane in &planes {
            assert!(plane.strategies.iter().map(|(name, _)| *name).eq(names().skip(1)));
            for (name, figures) in &plane.strategies {
                assert!(text.contains(&format!("`{name}`, ratio of work:")), "{name}");
                assert!(text.contains(&format!("`{name}`, ratio of times")), "{name}");
                let is_alone = ["cellular", "hierarchical"].contains(name);
                assert_eq!(figures.coherence.is_none(), is_alone, "{name}");
                assert_eq!(text.contains(&format!("`{name}`, percent coherent:")), !is_alone, "{name}");
            }
            let (_, bundle) = plane.strategies.last().unwrap();
            let most = bundle.coherence.iter().flatten().flatten().flatten().copied().fold(0.0, f64::max);
            assert!(most > 50.0 && most <= 100.0, "{most}");
        }
        for line in
            ["`bundle` over `hierarchical`, ratio of times", "| `bundle` over `hierarchical` | work |"]
        {
            assert!(text.contains(line), "{line}");
        }
        // Section 3 is held against it in every sheet of scanlines.
        assert_eq!(text.matches("\n| `bundle` | `hierarchical` | 8 |").count(), 1, "{text}");
    }
}
