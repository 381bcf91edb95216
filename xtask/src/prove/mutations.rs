//! Leaves out one condition of the proof after the other: the wrong answers must be found.

use rayon::prelude::*;
use rayset_engine::Condition;

use super::case::Case;
use super::watch::Violation;
use crate::Outcome;

/// What became of a mutation.
struct Fate {
    condition: Condition,
    /// Acceptances that were checked, and right, before the first wrong one.
    checked: u64,
    violation: Option<(&'static str, Violation)>,
}

pub(crate) fn run(seed: u64, n_most: u64) -> Outcome {
    let fates: Result<Vec<Fate>, _> =
        Condition::ALL.into_par_iter().map(|condition| fate(condition, seed, n_most)).collect();
    let fates = fates.map_err(|error| error.to_string())?;
    println!("{:40}{:>26}  in", "condition left out", "acceptances until caught");
    for Fate { condition, checked, violation } in &fates {
        let family = violation.as_ref().map_or("- not caught -", |(family, _)| family);
        println!("{:40}{checked:>26}  {family}", condition.name());
    }
    let survivors = fates.iter().filter(|fate| fate.violation.is_none()).count();
    match survivors {
        0 => Ok(()),
        _ => Err(format!("{survivors} conditions can be left out and nobody notices").into()),
    }
}

/// Case after case until there is a wrong answer, or enough.
fn fate(
    condition: Condition,
    seed: u64,
    n_most: u64,
) -> Result<Fate, Box<dyn std::error::Error + Send + Sync>> {
    let (mut number, mut checked) = (0, 0);
    while checked < n_most {
        let case = Case {
            seed,
            number,
            change: &|coherent| coherent.without(condition),
            to_first: true,
            is_stopped: &|| false,
        };
        let findings = case.run()?;
        if let Some(violation) = findings.first {
            checked += violation.after;
            return Ok(Fate { condition, checked, violation: Some((case.family().name(), violation)) });
        }
        checked += findings.tallies.total().checked;
        number += 1;
    }
    Ok(Fate { condition, checked, violation: None })
}
