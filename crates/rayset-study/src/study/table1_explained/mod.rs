//! Which reading of the paper gives its Table 1?

mod design;
mod factors;
mod report;
mod score;
mod trial;

use std::collections::BTreeSet;
use std::ops::RangeInclusive;
use std::path::Path;

use self::factors::Setting;
pub(super) use self::factors::size;
use self::score::{Score, Tried};
use self::trial::Trial;
use super::journal::Journal;
use super::runner::{Experiment, Step, run_missing};
use super::{Scale, StudyName};
use crate::{PAPER, Pair, StudyError};

/// How much of the study to run.
#[derive(Clone, Copy, Debug)]
struct Plan {
    screened: usize,
    focused: usize,
    seeds: u64,
    rounds: usize,
    /// How many of the best settings each round starts from.
    best: usize,
    /// Whether images of more than 96 pixels a side are left out.
    small: bool,
}

impl Plan {
    fn of(scale: Scale) -> Self {
        match scale {
            Scale::Full => Self { screened: 160, focused: 240, seeds: 8, rounds: 4, best: 2, small: false },
            Scale::Quick => Self { screened: 24, focused: 12, seeds: 2, rounds: 1, best: 1, small: true },
            Scale::Tiny => Self { screened: 4, focused: 2, seeds: 1, rounds: 1, best: 1, small: true },
        }
    }

    /// The seeds that settings are chosen by.
    fn chosen(&self) -> RangeInclusive<u64> {
        1..=self.seeds
    }

    /// As many others.
    fn others(&self) -> RangeInclusive<u64> {
        self.seeds + 1..=2 * self.seeds
    }

    fn allows(&self, setting: &Setting) -> bool {
        !self.small || setting.conditions().resolution <= 96
    }

    /// The settings that are tried in any case.
    fn first(&self) -> Vec<Setting> {
        let literal = Setting::default();
        let with_misses = literal.with("misses", "cylinder");
        let mut settings = vec![literal, with_misses];
        // Single steps are taken at a resolution that takes less time.
        let resolution = if self.small { "96" } else { "192" };
        settings.extend(design::steps_from(literal.with("resolution", resolution)));
        settings.extend(design::steps_from(with_misses.with("resolution", resolution)));
        settings.extend(design::screening(self.screened));
        settings.extend(design::focused(self.focused));
        settings.retain(|setting| self.allows(setting));
        settings
    }
}

pub(super) fn run(folder: &Path, scale: Scale, threads: usize, step: Step<'_>) -> Result<(), StudyError> {
    let plan = Plan::of(scale);
    let mut journal = Journal::open(&StudyName::Table1Explained.path(folder))?;
    let mut settings = BTreeSet::new();
    let mut next = plan.first();
    for round in 0..=plan.rounds {
        settings.extend(next.iter().copied());
        let trials: Vec<_> = settings.iter().flat_map(|setting| trials(*setting, plan.chosen())).collect();
        run_missing(&mut journal, &trials, threads, step)?;
        if round < plan.rounds {
            next = refinement(&plan, &scores(&journal, &plan, &settings));
        }
    }
    // Those that were chosen for what they gave with some seeds are tried with others.
    let near = scores(&journal, &plan, &settings).into_iter().filter(|score| score.joint() <= 1.0);
    let others: Vec<_> = near.flat_map(|score| trials(score.setting, plan.others())).collect();
    run_missing(&mut journal, &others, threads, step)
}

pub(super) fn report(folder: &Path, scale: Scale) -> Result<String, StudyError> {
    let plan = Plan::of(scale);
    let journal = Journal::read(&StudyName::Table1Explained.path(folder))?;
    let mut settings: BTreeSet<_> = plan.first().into_iter().collect();
    for _ in 0..plan.rounds {
        settings.extend(refinement(&plan, &scores(&journal, &plan, &settings)));
    }
    let scores = scores(&journal, &plan, &settings);
    let others: Vec<_> = scores.iter().map(|score| tried(&journal, score.setting, plan.others())).collect();
    Ok(report::markdown(&scores, &others, settings.len(), plan.seeds))
}

/// The steps from the best settings: by both distances, with the measure fitted and fixed, and by either distance alone.
fn refinement(plan: &Plan, scores: &[Score]) -> Vec<Setting> {
    let distances: [fn(&Score) -> f64; 3] = [Score::joint, Score::joint_fixed, |score| score.coherence.error];
    let mut next = BTreeSet::new();
    for distance in distances {
        let mut sorted: Vec<_> = scores.iter().collect();
        sorted.sort_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.setting.cmp(&b.setting)));
        for score in sorted.iter().take(plan.best) {
            next.extend(design::steps_from(score.setting));
        }
    }
    next.into_iter().filter(|setting| plan.allows(setting)).collect()
}

fn trials(setting: Setting, seeds: RangeInclusive<u64>) -> impl Iterator<Item = Trial> {
    PAPER
        .iter()
        .flat_map(move |row| seeds.clone().map(move |seed| Trial { setting, spheres: row.spheres, seed }))
}

/// The trials of a setting, if all are finished.
fn tried(journal: &Journal<Pair>, setting: Setting, seeds: RangeInclusive<u64>) -> Option<Tried> {
    let mut rows = [const { Vec::new() }; 4];
    for trial in trials(setting, seeds) {
        let row = PAPER.iter().position(|row| row.spheres == trial.spheres)?;
        rows[row].push(journal.get(&trial.key())?.clone());
    }
    Some(Tried { setting, rows })
}

fn scores(journal: &Journal<Pair>, plan: &Plan, settings: &BTreeSet<Setting>) -> Vec<Score> {
    settings.iter().filter_map(|setting| Score::of(&tried(journal, *setting, plan.chosen())?)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Counts, Preset, Table1, Table1Plan};
    use approx::assert_abs_diff_eq;

    /// The nearest setting as the findings have it: by its factors.
    fn nearest() -> Setting {
        let setting = Setting::default().with("misses", "cylinder").with("slab", "inside");
        setting.with("order", "serpentine").with("resolution", "64").with("size", "cover-0.2")
    }

    #[test]
    fn what_the_study_found_nearest_is_the_preset_of_table_1() {
        let (setting, preset, plan) = (nearest(), Preset::nearest(), Plan::of(Scale::Full));
        assert_eq!((setting.conditions(), plan.chosen()), (preset.conditions, preset.chosen_by.clone()));
        let rows = PAPER.map(|row| {
            let seeds = plan.chosen().map(|seed| Trial { setting, spheres: row.spheres, seed });
            seeds.map(|trial| trial.run().unwrap()).collect()
        });
        // Whatever the journals made of it stands in the document: the same setting, counted anew, must say the same.
        let score = Score::of(&Tried { setting, rows }).unwrap();
        assert_eq!((score.coherence.measure, score.fitted.measure), (preset.counting, preset.cost));
        let found = include_str!("../../../../../docs/study.md");
        let (_, found) = found.split_once("#### Nearest in both, cost measure fitted\n\n").unwrap();
        let now = format!("{}{}", report::one(&score), report::preset_of(&score));
        assert!(now.ends_with("This is the column `speer-1985-nearest` of Table 1.\n"), "{now}");
        assert_eq!(found.get(..now.len()), Some(now.as_str()));
    }

    #[test]
    fn the_column_of_table_1_counts_what_the_study_counts() {
        let preset = Preset::nearest();
        let plan = Table1Plan {
            seeds: vec![2, 9],
            repetitions: 1,
            resolution: 8,
            mesh_resolutions: [0; 4],
            ..Table1Plan::full("".into())
        };
        let mut steps = 0;
        let table = Table1::run(&plan, &mut |_| steps += 1).unwrap();
        assert_eq!(steps, plan.n_steps());
        let column = *table.columns().last().unwrap();
        assert_eq!((column.name, column.preset.unwrap().misses.len()), (preset.name, 2));
        for (row, measured) in column.spheres() {
            let spheres = row.spheres.unwrap();
            let pairs = [2, 9].map(|seed| Trial { setting: nearest(), spheres, seed }.run().unwrap());
            let sum = |count: fn(&Pair) -> u64| pairs.iter().map(count).sum::<u64>();
            assert_eq!(row.rays, sum(|pair| pair.standard.rays()));
            assert_eq!(measured.work, sum(|pair| pair.speer.in_tests()));
            assert_eq!(measured.wrong_pixels, sum(|pair| pair.wrong_pixels));
            let coherent: u64 = measured.kinds.values().map(|kind| kind.coherent).sum();
            assert_eq!(coherent, sum(|pair| pair.speer.coherent.iter().sum()));
            let cost =
                |count: fn(&Pair) -> &Counts| pairs.iter().map(|pair| preset.cost.of(count(pair))).sum();
            let (ours, standard): (f64, f64) = (cost(|pair| &pair.speer), cost(|pair| &pair.standard));
            assert_abs_diff_eq!(measured.fitted.unwrap().ratio, ours / standard, epsilon = 1e-12);
        }
        assert_eq!(column.spheres().count(), 4);
    }
}
