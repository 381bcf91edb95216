//! Every exact strategy on every backend against brute force, on the scenes and rays that `coherent` is proved with.

use std::error::Error;
use std::fmt::{self, Debug};
use std::sync::{Mutex, MutexGuard, PoisonError};

use rayset_engine::{
    Answers, Backend, Generation, Hit, IntersectionStrategy, RayQuery, RaySetIndex, Recording, RenderOptions,
    ShadowGeneration, ShadowQuery, Stats, StrategyKind, SweepLength, Tracer, render,
};
use rayset_scene::Scene;

use super::specimen::Specimen;
use super::watch::{PRIMITIVES_A_CHECK, Violation};

/// Pixels across and down: each picture is rendered once a strategy and backend.
const SIZE: (u32, u32) = (24, 16);

/// A strategy and the backend it runs on.
pub(crate) type Pair = (StrategyKind, Backend);

/// Every exact strategy on every backend of this machine.
pub(crate) fn pairs() -> Vec<Pair> {
    let exact = StrategyKind::ALL.iter().filter(|kind| kind.is_exact());
    exact.flat_map(|&kind| Backend::available().iter().map(move |&backend| (kind, backend))).collect()
}

/// How the answers of a strategy on a backend fared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Row {
    pair: Pair,
    compared: u64,
    violations: u64,
}

/// How all of them fared.
#[derive(Clone, Debug, Default)]
pub(crate) struct Comparisons {
    rows: Vec<Row>,
}

impl Comparisons {
    /// Adds what was found elsewhere.
    pub(crate) fn absorb(&mut self, other: &Self) {
        for row in &other.rows {
            self.add(row.pair, row.compared, row.violations);
        }
    }

    pub(crate) fn violations(&self) -> u64 {
        self.rows.iter().map(|row| row.violations).sum()
    }

    fn add(&mut self, pair: Pair, compared: u64, violations: u64) {
        if let Some(row) = self.rows.iter_mut().find(|row| row.pair == pair) {
            row.compared += compared;
            row.violations += violations;
        } else {
            self.rows.push(Row { pair, compared, violations });
        }
    }
}

impl fmt::Display for Comparisons {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:27}{:>12}{:>12}{:>12}", "strategies", "backend", "compared", "violations")?;
        for Row { pair: (kind, backend), compared, violations } in &self.rows {
            writeln!(f, "{:27}{:>12}{compared:>12}{violations:>12}", kind.name(), backend.name())?;
        }
        Ok(())
    }
}

/// Passes the answers of a strategy on, and compares them with brute force: of a large scene a share.
pub(crate) struct Compared<'s> {
    inner: Box<dyn IntersectionStrategy + 's>,
    pair: Pair,
    specimen: &'s Specimen,
    seen: Mutex<Seen>,
}

#[derive(Default)]
struct Seen {
    answers: u64,
    compared: u64,
    violations: u64,
    first: Option<Violation>,
}

impl<'s> Compared<'s> {
    pub(crate) fn new(pair: Pair, specimen: &'s Specimen) -> Self {
        let inner = pair.0.bind_on(&specimen.scene, pair.1);
        Self { inner, pair, specimen, seen: Mutex::default() }
    }

    /// Renders a small picture with bundles, sweeps and order of another.
    pub(crate) fn render(&self, options: &RenderOptions) -> Result<(), Box<dyn Error + Send + Sync>> {
        let (width, height) = SIZE;
        let options = RenderOptions { width, height, sweep: SweepLength::WholeImage, ..*options };
        render(self, &options)?;
        Ok(())
    }

    /// Adds what was compared; returns the first wrong answer.
    pub(crate) fn finish(self, comparisons: &mut Comparisons) -> Option<Violation> {
        let seen = self.seen.into_inner().unwrap_or_else(PoisonError::into_inner);
        comparisons.add(self.pair, seen.compared, seen.violations);
        seen.first
    }

    fn seen(&self) -> MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Compares an answer if it is its turn.
    fn check<A: PartialEq + Debug>(
        &self,
        ray_set: RaySetIndex,
        answer: &A,
        query: &impl Debug,
        truth: impl FnOnce(&Specimen) -> A,
    ) {
        let stride = (self.specimen.primitives.len() as u64).div_ceil(PRIMITIVES_A_CHECK).max(1);
        let mut seen = self.seen();
        seen.answers += 1;
        if !seen.answers.is_multiple_of(stride) {
            return;
        }
        let truth = truth(self.specimen);
        seen.compared += 1;
        if *answer != truth {
            seen.violations += 1;
            let (kind, backend) = self.pair;
            let message = format!("{kind} on {backend}: {answer:?}\nbrute force: {truth:?}\n{query:?}");
            seen.first.get_or_insert(Violation { ray_set, after: 0, message });
        }
    }
}

impl IntersectionStrategy for Compared<'_> {
    fn name(&self) -> &'static str {
        "compared"
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn scene(&self) -> &Scene {
        &self.specimen.scene
    }

    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_> {
        Box::new(ComparedTracer { strategy: self, inner: self.inner.begin_sweep(recording) })
    }
}

struct ComparedTracer<'s> {
    strategy: &'s Compared<'s>,
    inner: Box<dyn Tracer + 's>,
}

impl ComparedTracer<'_> {
    fn check_nearest(&self, query: &RayQuery, answer: &Option<Hit>) {
        self.strategy.check(query.ray_set, answer, query, |specimen| specimen.nearest(query));
    }

    fn check_occluded(&self, query: &ShadowQuery, answer: bool) {
        self.strategy.check(query.ray_set, &answer, query, |specimen| specimen.occluded(query));
    }
}

impl Tracer for ComparedTracer<'_> {
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
        let answer = self.inner.nearest(query);
        self.check_nearest(query, &answer);
        answer
    }

    fn occluded(&mut self, query: &ShadowQuery) -> bool {
        let answer = self.inner.occluded(query);
        self.check_occluded(query, answer);
        answer
    }

    fn stats(&self) -> &Stats {
        self.inner.stats()
    }

    fn recording(&self) -> Recording {
        self.inner.recording()
    }

    fn nearest_bundle(&mut self, generation: &Generation, answers: &mut Answers<Option<Hit>>) {
        let before = answers.values.len();
        self.inner.nearest_bundle(generation, answers);
        assert_eq!(answers.values.len() - before, generation.len(), "one answer a query");
        for (i, answer) in answers.values[before..].iter().enumerate() {
            self.check_nearest(&generation.query(i), answer);
        }
    }

    fn occluded_bundle(&mut self, generation: &ShadowGeneration, answers: &mut Answers<bool>) {
        let before = answers.values.len();
        self.inner.occluded_bundle(generation, answers);
        assert_eq!(answers.values.len() - before, generation.len(), "one answer a query");
        for (i, &answer) in answers.values[before..].iter().enumerate() {
            self.check_occluded(&generation.query(i), answer);
        }
    }
}

#[cfg(test)]
mod tests {
    use rayset_scene::glam::DVec3;

    use super::*;
    use crate::prove::specimen::Maker;

    #[test]
    fn every_wrong_answer_is_noticed_in_bundles_too() {
        let mut maker = Maker::new(1.0, DVec3::ZERO);
        let matt = maker.matt();
        let balls = [-1.0, 1.0].map(|x| maker.ball(DVec3::new(x, 0.0, 0.0), 0.5));
        maker.add(matt, balls);
        maker.lamp(DVec3::new(0.0, 5.0, 5.0));
        maker.look(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, 40.0).unwrap();
        let mut specimen = maker.finish().unwrap();
        let compare = |specimen: &Specimen| {
            let mut comparisons = Comparisons::default();
            let mut first = None;
            for pair in pairs() {
                let compared = Compared::new(pair, specimen);
                compared.render(&RenderOptions::default()).unwrap();
                first = first.or(compared.finish(&mut comparisons));
            }
            assert_eq!(comparisons.rows.len(), pairs().len());
            assert!(comparisons.rows.iter().all(|row| row.compared > 300));
            (comparisons, first)
        };
        let (comparisons, first) = compare(&specimen);
        assert!(comparisons.violations() == 0 && first.is_none());
        // Now brute force knows of another ball than the strategies.
        specimen.primitives.swap(0, 1);
        let (comparisons, first) = compare(&specimen);
        assert!(comparisons.rows.iter().all(|row| row.violations > 0), "{comparisons}");
        assert!(first.unwrap().message.starts_with("standard on scalar: "));
    }
}
