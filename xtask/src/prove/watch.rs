//! A strategy that passes on what `coherent` answers, and holds it against brute force.

use std::fmt::Debug;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use rayset_engine::{
    ByKind, Coherent, Hit, IntersectionStrategy, RayKind, RayQuery, RaySetIndex, Recording, ShadowQuery,
    Stats, Tracer,
};
use rayset_scene::Scene;

use super::compared::Comparisons;
use super::specimen::Specimen;

/// Primitives that one look at brute force may cost on average: in larger scenes only a share of answers is checked.
pub(super) const PRIMITIVES_A_CHECK: u64 = 128;

/// One answer out of so many that took a partition is checked too.
const PARTITIONED: u64 = 16;

/// How rays of a kind fared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tally {
    pub(crate) rays: u64,
    /// Answered without a partition.
    pub(crate) accepted: u64,
    /// Of these, compared with brute force.
    pub(crate) checked: u64,
    /// Answers after a partition that were compared with brute force.
    pub(crate) partitioned: u64,
    pub(crate) violations: u64,
}

impl std::ops::AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.rays += other.rays;
        self.accepted += other.accepted;
        self.checked += other.checked;
        self.partitioned += other.partitioned;
        self.violations += other.violations;
    }
}

/// A wrong answer.
#[derive(Clone, Debug)]
pub(crate) struct Violation {
    /// Orders those of one case.
    pub(crate) ray_set: RaySetIndex,
    /// How many acceptances of the same sweep were right before.
    pub(crate) after: u64,
    pub(crate) message: String,
}

/// What watching a case found.
#[derive(Clone, Debug, Default)]
pub(crate) struct Findings {
    pub(crate) tallies: ByKind<Tally>,
    /// What the strategies answered, all of them.
    pub(crate) comparisons: Comparisons,
    pub(crate) first: Option<Violation>,
}

impl Findings {
    /// Adds what was found elsewhere; the first violation is that of the least ray-set.
    pub(crate) fn absorb(&mut self, other: Self) {
        self.tallies += other.tallies;
        self.comparisons.absorb(&other.comparisons);
        let is_first =
            |violation: &Violation| self.first.as_ref().is_none_or(|first| violation.ray_set < first.ray_set);
        if let Some(violation) = other.first
            && is_first(&violation)
        {
            self.first = Some(violation);
        }
    }
}

/// Passes the answers of `coherent` on, and compares those it gave without a partition with brute force.
pub(crate) struct Watched<'s> {
    inner: Coherent<'s>,
    specimen: &'s Specimen,
    /// Every such answer is checked.
    stride: u64,
    findings: Mutex<Findings>,
    /// Set by the first wrong answer.
    is_wrong: AtomicBool,
}

impl<'s> Watched<'s> {
    pub(crate) fn new(inner: Coherent<'s>, specimen: &'s Specimen) -> Self {
        let stride = (specimen.primitives.len() as u64).div_ceil(PRIMITIVES_A_CHECK).max(1);
        let (findings, is_wrong) = (Mutex::default(), AtomicBool::new(false));
        Self { inner, specimen, stride, findings, is_wrong }
    }

    /// Whether there was a wrong answer.
    pub(crate) fn is_wrong(&self) -> bool {
        self.is_wrong.load(Ordering::Relaxed)
    }

    pub(crate) fn findings(self) -> Findings {
        self.findings.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

impl IntersectionStrategy for Watched<'_> {
    fn name(&self) -> &'static str {
        "watched"
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn scene(&self) -> &Scene {
        &self.specimen.scene
    }

    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_> {
        let inner = self.inner.begin_sweep(recording);
        Box::new(WatchedTracer { strategy: self, inner, findings: Findings::default(), n_partitioned: 0 })
    }
}

struct WatchedTracer<'s> {
    strategy: &'s Watched<'s>,
    inner: Box<dyn Tracer + 's>,
    findings: Findings,
    n_partitioned: u64,
}

impl WatchedTracer<'_> {
    fn n_coherent(&self, kind: RayKind) -> u64 {
        self.inner.stats().coherence[kind].coherent
    }

    /// Counts an answer, and compares it with the truth if it is its turn.
    fn check<A: PartialEq + Debug>(
        &mut self,
        (ray_set, kind, before): (RaySetIndex, RayKind, u64),
        answer: &A,
        query: &impl Debug,
        truth: impl FnOnce(&Specimen) -> A,
    ) {
        let is_accepted = self.n_coherent(kind) > before;
        let tally = &mut self.findings.tallies[kind];
        tally.rays += 1;
        if is_accepted {
            tally.accepted += 1;
            if !tally.accepted.is_multiple_of(self.strategy.stride) {
                return;
            }
            tally.checked += 1;
        } else {
            self.n_partitioned += 1;
            if !self.n_partitioned.is_multiple_of(PARTITIONED * self.strategy.stride) {
                return;
            }
            tally.partitioned += 1;
        }
        let truth = truth(self.strategy.specimen);
        if *answer == truth {
            return;
        }
        tally.violations += 1;
        self.strategy.is_wrong.store(true, Ordering::Relaxed);
        if self.findings.first.is_none() {
            let after = self.findings.tallies.total().checked - u64::from(is_accepted);
            let how = if is_accepted { "accepted" } else { "found by a partition" };
            let radius = self.inner.certificate_radius();
            let message = format!(
                "{how}: {answer:?}\nbrute force: {truth:?}\ncertificate radius: {radius:e}\n{query:?}"
            );
            self.findings.first = Some(Violation { ray_set, after, message });
        }
    }
}

impl Drop for WatchedTracer<'_> {
    fn drop(&mut self) {
        let mut findings = self.strategy.findings.lock().unwrap_or_else(PoisonError::into_inner);
        findings.absorb(std::mem::take(&mut self.findings));
    }
}

impl Tracer for WatchedTracer<'_> {
    fn nearest(&mut self, query: &RayQuery) -> Option<Hit> {
        let kind = query.slot.kind();
        let before = self.n_coherent(kind);
        let answer = self.inner.nearest(query);
        // `Hit` compares distances as numbers: a distance is positive, so equal numbers are equal bits.
        self.check((query.ray_set, kind, before), &answer, query, |specimen| specimen.nearest(query));
        answer
    }

    fn occluded(&mut self, query: &ShadowQuery) -> bool {
        let before = self.n_coherent(RayKind::Shadow);
        let answer = self.inner.occluded(query);
        self.check((query.ray_set, RayKind::Shadow, before), &answer, query, |specimen| {
            specimen.occluded(query)
        });
        answer
    }

    fn stats(&self) -> &Stats {
        self.inner.stats()
    }

    fn recording(&self) -> Recording {
        self.inner.recording()
    }

    fn certificate_radius(&self) -> f64 {
        self.inner.certificate_radius()
    }
}
