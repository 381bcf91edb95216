//! Those that answer recorded rays.

use std::collections::BTreeMap;
use std::time::Instant;

use rayset_engine::{
    Answers, Backend, Generation, Hit, IntersectionStrategy, Recording as Work, ShadowGeneration,
    StrategyKind, Tracer,
};
use rayset_scene::Scene;
use serde::Serialize;

use super::{RecordedPart, RecordedPass};

/// Something that answers recorded rays, bound to a scene.
pub trait Contender: Sync {
    /// Its name, for tables and filters.
    fn name(&self) -> &str;

    /// Whose it is: `rayset`, or another library.
    fn family(&self) -> &str;

    /// Whether its answers must be the recorded ones, bit for bit.
    fn is_exact(&self) -> bool;

    /// Seconds it took to be made ready for the scene.
    fn ready_seconds(&self) -> f64;

    /// Tests a ray that it needs, by a small sample of a list, if it counts them.
    fn tests_per_ray(&self, _pass: &RecordedPass) -> Option<f64> {
        None
    }

    /// What one thread needs to answer.
    fn worker(&self) -> Box<dyn Worker + '_>;
}

/// Answers sweeps, one after the other, part by part.
pub trait Worker {
    /// Begins a sweep; this is timed.
    fn begin(&mut self) {}

    /// Brings the rays of a part into the form it wants, before the clock starts.
    fn load(&mut self, _part: &RecordedPart) {}

    /// Answers the part loaded last; this is timed.
    fn trace(&mut self, part: &RecordedPart);

    /// Compares the answers to the part traced last with the recorded ones, after the clock has stopped.
    fn compare(&mut self, part: &RecordedPart, disagreements: &mut Disagreements);
}

/// Where answers differ from the recorded ones.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Disagreements {
    /// Answers compared.
    pub compared: u64,
    /// Those that differ, by what is likely the reason.
    pub reasons: BTreeMap<String, u64>,
    /// The first few of each reason, in words.
    pub samples: Vec<String>,
}

/// How many samples of each reason are kept.
const SAMPLES: u64 = 2;

impl Disagreements {
    /// Counts one, and keeps what it says if it is among the first for its reason.
    pub fn add(&mut self, reason: &str, sample: impl FnOnce() -> String) {
        let count = self.reasons.entry(reason.to_owned()).or_default();
        *count += 1;
        if *count <= SAMPLES {
            self.samples.push(format!("{reason}: {}", sample()));
        }
    }

    /// How many answers differ.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.reasons.values().sum()
    }

    /// Adds those found by another thread.
    pub(super) fn absorb(&mut self, other: Self) {
        self.compared += other.compared;
        for (reason, count) in other.reasons {
            *self.reasons.entry(reason).or_default() += count;
        }
        let room = self.reasons.len() * usize::try_from(SAMPLES).unwrap_or(0);
        self.samples.extend(other.samples);
        self.samples.truncate(room);
    }
}

/// Every exact strategy, bound to a scene on the lanes of [`Backend::active`].
#[must_use]
pub fn strategies(scene: &Scene) -> Vec<Box<dyn Contender + '_>> {
    let exact = StrategyKind::ALL.iter().filter(|kind| kind.is_exact());
    let bound = exact.map(|kind| {
        let start = Instant::now();
        let strategy = kind.bind_on(scene, Backend::active());
        let ready_seconds = start.elapsed().as_secs_f64();
        Box::new(Ours { strategy, ready_seconds }) as Box<dyn Contender>
    });
    bound.collect()
}

struct Ours<'s> {
    strategy: Box<dyn IntersectionStrategy + 's>,
    ready_seconds: f64,
}

/// How many rays are tried to see how many tests a strategy needs.
const TRIED: usize = 32;

impl Contender for Ours<'_> {
    fn name(&self) -> &str {
        self.strategy.name()
    }

    fn family(&self) -> &'static str {
        "rayset"
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn ready_seconds(&self) -> f64 {
        self.ready_seconds
    }

    fn tests_per_ray(&self, pass: &RecordedPass) -> Option<f64> {
        let mut tracer = self.strategy.begin_sweep(Work::Off);
        let sweep = pass.sweeps.get(pass.sweeps.len() / 2)?;
        let n = match sweep.get(sweep.len() / 2)? {
            RecordedPart::Nearest(bundles) => {
                let (rays, _) = bundles.get(bundles.len() / 2)?;
                let mut few = Generation::default();
                (0..rays.len().min(TRIED)).for_each(|i| few.push(&rays.query(i)));
                tracer.nearest_bundle(&few, &mut Answers::default());
                few.len()
            }
            RecordedPart::Shadow(bundles) => {
                let (rays, _) = bundles.get(bundles.len() / 2)?;
                let mut few = ShadowGeneration::default();
                (0..rays.len().min(TRIED)).for_each(|i| few.push(&rays.query(i)));
                tracer.occluded_bundle(&few, &mut Answers::default());
                few.len()
            }
        };
        #[expect(clippy::cast_precision_loss, reason = "counts below 2^53")]
        let tests = tracer.stats().work.in_tests() as f64 / n as f64;
        Some(tests)
    }

    fn worker(&self) -> Box<dyn Worker + '_> {
        let strategy = self.strategy.as_ref();
        Box::new(Answering {
            strategy,
            tracer: strategy.begin_sweep(Work::Off),
            part: RecordedPart::Shadow(Vec::new()),
            hits: Vec::new(),
            blocked: Vec::new(),
        })
    }
}

/// A thread's buffers: the rays, near at hand as they are where they were just made, and the answers of each bundle.
struct Answering<'s> {
    strategy: &'s dyn IntersectionStrategy,
    tracer: Box<dyn Tracer + 's>,
    part: RecordedPart,
    hits: Vec<Answers<Option<Hit>>>,
    blocked: Vec<Answers<bool>>,
}

impl Worker for Answering<'_> {
    fn begin(&mut self) {
        self.tracer = self.strategy.begin_sweep(Work::Off);
    }

    fn load(&mut self, part: &RecordedPart) {
        self.part = part.clone();
        self.hits.iter_mut().for_each(Answers::clear);
        self.blocked.iter_mut().for_each(Answers::clear);
        match part {
            RecordedPart::Nearest(bundles) => {
                grow(&mut self.hits, bundles.iter().map(|(rays, _)| rays.len()))
            }
            RecordedPart::Shadow(bundles) => {
                grow(&mut self.blocked, bundles.iter().map(|(rays, _)| rays.len()));
            }
        }
    }

    fn trace(&mut self, _: &RecordedPart) {
        let Self { tracer, part, hits, blocked, .. } = self;
        match part {
            RecordedPart::Nearest(bundles) => {
                for ((rays, _), answers) in bundles.iter().zip(hits) {
                    tracer.nearest_bundle(rays, answers);
                }
            }
            RecordedPart::Shadow(bundles) => {
                for ((rays, _), answers) in bundles.iter().zip(blocked) {
                    tracer.occluded_bundle(rays, answers);
                }
            }
        }
    }

    fn compare(&mut self, part: &RecordedPart, disagreements: &mut Disagreements) {
        let bits = |hit: &Option<Hit>| hit.map(|hit| (hit.t.to_bits(), hit.object, hit.primitive));
        let mut check = |n: usize, m: usize, differing: Option<usize>, what: &dyn Fn(usize) -> String| {
            disagreements.compared += n as u64;
            if n != m {
                disagreements.add("number of answers", || format!("{n} rays, {m} answers"));
            } else if let Some(i) = differing {
                disagreements.add("bits", || what(i));
            }
        };
        match part {
            RecordedPart::Nearest(bundles) => {
                for ((rays, hits), answers) in bundles.iter().zip(&self.hits) {
                    let found = &answers.values;
                    let differing = hits.iter().zip(found).position(|(hit, found)| bits(hit) != bits(found));
                    check(rays.len(), found.len(), differing, &|i| {
                        format!("{:?} gives {:?}, not {:?}", rays.query(i), found[i], hits[i])
                    });
                }
            }
            RecordedPart::Shadow(bundles) => {
                for ((rays, blocked), answers) in bundles.iter().zip(&self.blocked) {
                    let found = &answers.values;
                    let differing = blocked.iter().zip(found).position(|(blocked, found)| blocked != found);
                    check(rays.len(), found.len(), differing, &|i| {
                        format!("{:?} gives {}, not {}", rays.query(i), found[i], blocked[i])
                    });
                }
            }
        }
    }
}

/// Makes room for the answers of every bundle, so that no clock sees memory being asked for.
fn grow<T>(answers: &mut Vec<Answers<T>>, lengths: impl ExactSizeIterator<Item = usize>) {
    answers.resize_with(answers.len().max(lengths.len()), Answers::default);
    for (answers, length) in answers.iter_mut().zip(lengths) {
        answers.values.reserve(length);
    }
}
