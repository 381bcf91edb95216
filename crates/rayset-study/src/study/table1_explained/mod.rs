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
