//! What the study found, as Markdown.

use std::fmt::Write;

use super::factors::{FACTORS, Setting};
use super::score::{Score, Tried};
use crate::measures::{Near, POINTS, RATIO};
use crate::{Cost, Counting, Median, PAPER, Preset};

/// `others` has the trials with other seeds of each score, where they are finished.
pub(super) fn markdown(scores: &[Score], others: &[Option<Tried>], planned: usize, seeds: u64) -> String {
    let mut text = format!(
        "{} of {planned} combinations are finished, {} trials; {seeds} seeds each, n = 1, 2, 4 and 8.\n",
        scores.len(),
        4 * seeds * scores.len() as u64
    );
    if scores.is_empty() {
        return text;
    }
    text += &tally(scores);
    text += &hold_out(scores, others);
    let best = |distance: &dyn Fn(&Score) -> f64| {
        let least = scores.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
        least.expect("there are scores")
    };
    let literal = scores.iter().find(|score| score.setting == Setting::default());
    let with_misses = Setting::default().with("misses", "cylinder");
    let with_misses = scores.iter().find(|score| score.setting == with_misses);
    let within = scores.iter().filter(|score| score.joint() <= 1.0);
    let within = within.min_by(|a, b| a.growth_error().total_cmp(&b.growth_error()));
    let named = [
        ("nearest in both, cost measure fitted", Some(best(&Score::joint))),
        ("within both bounds, cost measure fitted, and nearest to how the paper's times grow", within),
        ("within both bounds, cost measure fitted, and nearest with all seeds", robust(scores, others)),
        ("nearest in both, cost measure fixed", Some(best(&Score::joint_fixed))),
        ("nearest in coherence", Some(best(&|score| score.coherence.error))),
        ("nearest in ratio, cost measure fitted", Some(best(&|score| score.fitted.error))),
        ("nearest in ratio, cost measure fixed", Some(best(&Score::fixed_error))),
        ("`speer-1985`", literal),
        ("`speer-1985-misses`", with_misses),
    ];
    text += "\nIn tests no reading can give the paper's ratio for n = 1: a coherent ray costs a pierce check of 2, and 1 for the sphere if it hits; a partition of one sphere costs 1, and 1 if it hits.\nSo the ratio there is 1 at least, whatever is coherent (rays that a wrong answer cuts off aside); 0.820 asks for classifying a volume (k) to cost more than checking a cylinder.\n";
    text += "\nIn every table: medians over seeds, with intervals that hold the median of all seeds with the confidence of 0.9.\nErrors are the greatest of the four rows.\n";
    let mut shown = Vec::new();
    for (name, score) in named {
        if let Some(score) = score {
            text += &format!("\n#### {}\n\n", capitalised(name));
            if shown.contains(&score.setting) {
                text += &format!("As above: {}.\n", score.setting.conditions().differences());
                continue;
            }
            shown.push(score.setting);
            text += &one(score);
            text += &preset_of(score);
            let place = scores.iter().position(|other| other.setting == score.setting);
            let others = place.and_then(|place| score.on_others(others[place].as_ref()?));
            if let Some((points, ratio)) = others {
                text += &format!("With other seeds: error {points:.1} points, {ratio:.3} of the ratio.\n");
            }
        }
    }
    text += "\n#### What each factor does\n\n";
    text += &effects(scores);
    text
}

fn capitalised(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// How many settings are near, in which measure.
fn tally(scores: &[Score]) -> String {
    let count = |near: &dyn Fn(&Score) -> bool| scores.iter().filter(|score| near(score)).count();
    let coherent = |score: &Score| score.coherence.error <= POINTS;
    let [tests, paper] = [0, 1].map(|i| count(&|score| score.fixed[i].error <= RATIO));
    let [both_tests, both_paper] =
        [0, 1].map(|i| count(&|score| coherent(score) && score.fixed[i].error <= RATIO));
    let fitted = count(&|score| score.fitted.error <= RATIO);
    let both_fitted = count(&|score| coherent(score) && score.fitted.error <= RATIO);
    let n_coherent = count(&coherent);
    format!(
        "\n| within {POINTS} points of all four percentages, within {RATIO} of all four recomputed ratios | combinations |\n|---|---:|\n\
         | percentages, whatever counts as a ray | {n_coherent} |\n\
         | ratios, cost {} | {tests} |\n| ratios, cost {} | {paper} |\n\
         | ratios, best of the {} cost measures with a pierce check of 2 tests | {fitted} |\n\
         | both, cost {} | {both_tests} |\n| both, cost {} | {both_paper} |\n| both, best cost measure | {both_fitted} |\n",
        Cost::TESTS,
        Cost::PAPER_LAMBDA,
        Cost::grid().count(),
        Cost::TESTS,
        Cost::PAPER_LAMBDA,
    )
}

/// Whether what was chosen by some seeds is as near with others.
fn hold_out(scores: &[Score], others: &[Option<Tried>]) -> String {
    let near: Vec<_> = scores.iter().zip(others).filter(|(score, _)| score.joint() <= 1.0).collect();
    let outcomes: Vec<_> =
        near.iter().filter_map(|(score, tried)| score.on_others(tried.as_ref()?)).collect();
    let percents = outcomes.iter().filter(|(points, _)| *points <= POINTS).count();
    let ratios = outcomes.iter().filter(|(_, ratio)| *ratio <= RATIO).count();
    let still = outcomes.iter().filter(|(points, ratio)| *points <= POINTS && *ratio <= RATIO).count();
    let growth = near.iter().filter(|(score, _)| score.growth_error() <= GROWTH).count();
    let least = near.iter().map(|(score, _)| score.growth_error()).fold(f64::INFINITY, f64::min);
    format!(
        "\nOf the {} that are within both bounds in the best cost measure, {} were tried with as many other seeds, the percentage, the measure and its constants being kept: {percents} keep to the bound on percentages, {ratios} to that on ratios, {still} to both.\nIn {growth} of them the work of `standard` grows with n as the paper's times do, to {:.0} %; the nearest is {:.0} % off.\n",
        near.len(),
        outcomes.len(),
        100.0 * GROWTH,
        100.0 * least
    )
}

/// The setting within both bounds whose greatest distance, with the seeds it was chosen by and with others, is least.
fn robust<'s>(scores: &'s [Score], others: &[Option<Tried>]) -> Option<&'s Score> {
    let both = scores.iter().zip(others).filter(|(score, _)| score.joint() <= 1.0);
    let distances = both.filter_map(|(score, tried)| {
        let (points, ratio) = score.on_others(tried.as_ref()?)?;
        Some((score, (points / POINTS).max(ratio / RATIO).max(score.joint())))
    });
    distances.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(score, _)| score)
}

/// How far the growth of the standard algorithm's cost may be off, as a fraction.
const GROWTH: f64 = 0.2;

/// A setting beside the paper.
pub(super) fn one(score: &Score) -> String {
    let Near { measure: counting, error: points, .. } = &score.coherence;
    let counting: &Counting = counting;
    let mut text = format!(
        "Setting: {}.\nPercent of {counting}; error {points:.1} points.\nRatios in the fitted measure ({}): error {:.3}; in tests: error {:.3}; with the paper's lambda: error {:.3}.\n\n",
        score.setting.conditions().differences(),
        score.fitted.measure,
        score.fitted.error,
        score.fixed[0].error,
        score.fixed[1].error,
    );
    text += "| n | coherent, paper | coherent | ratio, paper | fitted | in tests | standard grows, paper | fitted |\n|---:|---:|---|---:|---|---|---:|---:|\n";
    for (row, paper) in PAPER.iter().enumerate() {
        let growth = if row == 0 { 1.0 } else { score.growth[row - 1] };
        let line = format!(
            "| {} | {:.1} % | {} | {:.3} | {} | {} | {:.2} | {growth:.2} |",
            paper.spheres,
            paper.percent_coherent,
            percent(&score.coherence.rows[row]),
            paper.ratio_recomputed,
            score.fitted.rows[row],
            score.fixed[0].rows[row],
            paper.hours_standard / PAPER[0].hours_standard,
        );
        writeln!(text, "{line}").expect("a string takes everything");
    }
    let hit = |rows: &[Median; 4], paper: [f64; 4]| {
        rows.iter().zip(paper).filter(|(row, paper)| (row.low..=row.high).contains(paper)).count()
    };
    let percents = hit(&score.coherence.rows, PAPER.map(|row| row.percent_coherent));
    let ratios = hit(&score.fitted.rows, PAPER.map(|row| row.ratio_recomputed));
    text += &format!(
        "\nThe paper's figure lies in the interval of {percents} of 4 percentages and {ratios} of 4 ratios; wrong pixels in the worst row: {:.3} %.\n",
        100.0 * score.wrong
    );
    text
}

/// Whether Table 1 has a column of this setting, with the same percentage and the same cost.
pub(super) fn preset_of(score: &Score) -> String {
    let preset = Preset::nearest();
    let is_it = score.setting.conditions() == preset.conditions
        && score.coherence.measure == preset.counting
        && score.fitted.measure == preset.cost;
    if is_it { format!("This is the column `{}` of Table 1.\n", preset.name) } else { String::new() }
}

fn percent(median: &Median) -> String {
    format!("{:.1} % ({:.1} to {:.1})", median.value, median.low, median.high)
}

/// For every level, the median and the best error of the settings that have it.
fn effects(scores: &[Score]) -> String {
    let mut text = String::from(
        "| factor | level | combinations | coherence: median error | least | ratio, fitted: median error | least |\n|---|---|---:|---:|---:|---:|---:|\n",
    );
    for (factor, levels) in FACTORS {
        for level in levels {
            let here: Vec<_> = scores.iter().filter(|score| score.setting.level(factor) == *level).collect();
            let points: Vec<_> = here.iter().map(|score| score.coherence.error).collect();
            let ratios: Vec<_> = here.iter().map(|score| score.fitted.error).collect();
            let least = |values: &[f64]| values.iter().copied().fold(f64::INFINITY, f64::min);
            let line = format!(
                "| {factor} | {level} | {} | {:.1} | {:.1} | {:.3} | {:.3} |",
                here.len(),
                Median::of(&points).value,
                least(&points),
                Median::of(&ratios).value,
                least(&ratios)
            );
            writeln!(text, "{line}").expect("a string takes everything");
        }
    }
    text
}
