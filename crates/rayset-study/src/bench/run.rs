//! Runs the measurement.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use cpu_time::ThreadTime;
use rayset_engine::{Backend, StrategyKind};
use rayset_scene::Scene;

use super::contender::{Contender, Disagreements, strategies};
use super::{
    Bench, BenchPlan, BenchRow, ContenderRow, MOST_TESTS_PER_RAY, PassRow, RecordedPass, Recording, SLOW,
    View,
};
use crate::coherence::processor;
use crate::{Spread, StudyError};

/// How long all may take to warm up, and what part of the repetitions those rows get that take longer: they are large, and
/// vary little.
const LONG: Duration = Duration::from_secs(8);
const FEWER: usize = 3;

/// Binds contenders beside the strategies to a scene, and says why others are left out.
pub(super) type Others<'o> =
    &'o dyn for<'s> Fn(&'s Scene) -> (Vec<Box<dyn Contender + 's>>, Vec<(String, String)>);

impl Bench {
    /// Runs the measurement with the exact strategies; `step` is called before each view with what comes.
    ///
    /// # Errors
    ///
    /// [`StudyError::Scene`] if a scene cannot be read, [`StudyError::Differs`] if the strategies give other bits,
    /// which they never do.
    pub fn run(plan: &BenchPlan, step: &mut dyn FnMut(&str)) -> Result<Self, StudyError> {
        Self::run_with(plan, &|_| (Vec::new(), Vec::new()), step)
    }

    /// Runs the measurement with the exact strategies and others beside them.
    ///
    /// `others` binds them to a scene, and gives the names of those that cannot be, with the reason.
    ///
    /// # Errors
    ///
    /// Those of [`Bench::run`].
    pub fn run_with(
        plan: &BenchPlan,
        others: Others<'_>,
        step: &mut dyn FnMut(&str),
    ) -> Result<Self, StudyError> {
        let mut rows = Vec::new();
        for source in &plan.scenes {
            step(&format!("{}, making it ready", source.name()));
            let scene = source.load()?;
            let mut contenders = strategies(&scene);
            let (more, refused) = others(&scene);
            contenders.extend(more);
            let is_wanted = |name: &str| {
                plan.only.is_empty() || plan.only.iter().any(|prefix| name.starts_with(prefix.as_str()))
            };
            contenders.retain(|contender| is_wanted(contender.name()));
            for view in &plan.views {
                step(&format!("{}, {}", source.name(), view.name()));
                let mut row = measure(plan, source.name(), &scene, view, &contenders)?;
                row.spheres = source.spheres();
                row.skipped.extend(refused.iter().filter(|(name, _)| is_wanted(name)).cloned());
                rows.push(row);
            }
        }
        Ok(Self {
            processor: processor(),
            cores: thread::available_parallelism().map_or(1, usize::from),
            threads: plan.threads,
            backend: Backend::active().name().to_owned(),
            repetitions: plan.repetitions,
            most_tests_per_ray: MOST_TESTS_PER_RAY,
            rows,
        })
    }
}

fn measure(
    plan: &BenchPlan,
    name: &str,
    scene: &Scene,
    view: &View,
    contenders: &[Box<dyn Contender + '_>],
) -> Result<BenchRow, StudyError> {
    let recording = Recording::of(StrategyKind::Hierarchical.bind(scene).as_ref(), view);
    let mut skipped = Vec::new();
    let contenders: Vec<_> = contenders
        .iter()
        .filter(|contender| {
            let tests = recording.passes.iter().filter_map(|pass| contender.tests_per_ray(pass));
            let most = tests.fold(0.0, f64::max);
            let is_slow = most > MOST_TESTS_PER_RAY;
            if is_slow {
                skipped.push((contender.name().to_owned(), format!("{most:.0} tests a ray")));
            }
            !is_slow
        })
        .collect();
    // Nanoseconds by repetition, list and contender.
    let mut times = vec![vec![vec![0.0; contenders.len()]; recording.passes.len()]; plan.repetitions];
    let mut disagreements = vec![Disagreements::default(); contenders.len()];
    let mut warming = vec![vec![0.0; contenders.len()]; recording.passes.len()];
    let mut once = vec![false; contenders.len()];
    let mut repetitions = plan.repetitions;
    let start = Instant::now();
    for repetition in 0..=plan.repetitions {
        if repetition > repetitions {
            break;
        }
        for (p, pass) in recording.passes.iter().enumerate() {
            for turn in 0..contenders.len() {
                // Another one goes first each time, so that nobody always follows the same neighbour.
                let c = (turn + repetition + p) % contenders.len();
                if once[c] {
                    continue;
                }
                // Those that may differ are compared once.
                let is_compared = repetition == 0 || contenders[c].is_exact();
                let (time, found) = answer(contenders[c].as_ref(), pass, plan.threads, is_compared);
                let time = time.as_secs_f64() * 1e9;
                if contenders[c].is_exact() && found.total() > 0 {
                    let what =
                        format!("{} on {name}, {}: {:?}", contenders[c].name(), pass.pass, found.samples);
                    return Err(StudyError::Differs { what });
                }
                // The first time warms up.
                if let Some(repetition) = repetition.checked_sub(1) {
                    times[repetition][p][c] = time;
                } else {
                    warming[p][c] = time;
                    disagreements[c].absorb(found);
                }
            }
        }
        if repetition == 0 {
            if start.elapsed() > LONG {
                repetitions = plan.repetitions.div_ceil(FEWER);
                times.truncate(repetitions);
            }
            once = far_behind(&warming);
            // What warmed up is all there is of these.
            for times in &mut times {
                for (times, warming) in times.iter_mut().zip(&warming) {
                    (0..once.len()).filter(|&c| once[c]).for_each(|c| times[c] = warming[c]);
                }
            }
        }
    }
    let rows = contenders.iter().zip(disagreements).enumerate().map(|(c, (contender, disagreements))| {
        let frame =
            |lists: &Vec<Vec<f64>>| lists.iter().map(|list| list[c]).fold(0.0, |sum, time| sum + time);
        let frames: Vec<f64> = times.iter().map(|lists| frame(lists) * 1e-6).collect();
        let passes = recording.passes.iter().enumerate().map(|(p, pass)| {
            let rays = float(pass.rays());
            Spread::of(&times.iter().map(|lists| lists[p][c] / rays).collect::<Vec<_>>())
        });
        ContenderRow {
            name: contender.name().to_owned(),
            family: contender.family().to_owned(),
            ready_seconds: contender.ready_seconds(),
            frame: Spread::of(&frames),
            passes: passes.collect(),
            once: once[c],
            disagreements,
        }
    });
    let passes = recording.passes.iter().map(|pass| PassRow {
        name: pass.pass.to_string(),
        rays: pass.rays(),
        hits: pass.hits(),
    });
    Ok(BenchRow {
        scene: name.to_owned(),
        view: view.name(),
        spheres: None,
        primitives: scene.n_primitives(),
        repetitions,
        passes: passes.collect(),
        contenders: rows.collect(),
        skipped,
    })
}

/// Who takes more than [`SLOW`] times what the fastest takes, by the times of each list and contender.
fn far_behind(times: &[Vec<f64>]) -> Vec<bool> {
    let n = times.first().map_or(0, Vec::len);
    let frames: Vec<f64> = (0..n).map(|c| times.iter().fold(0.0, |sum, list| sum + list[c])).collect();
    let fastest = frames.iter().copied().fold(f64::INFINITY, f64::min);
    frames.into_iter().map(|frame| frame > SLOW * fastest).collect()
}

/// Answers a list on some threads, which share its sweeps; gives the time of the one that was busy longest.
fn answer(
    contender: &dyn Contender,
    pass: &RecordedPass,
    threads: usize,
    is_compared: bool,
) -> (Duration, Disagreements) {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut worker = contender.worker();
        let (mut busy, mut found) = (Duration::ZERO, Disagreements::default());
        while let Some(sweep) = pass.sweeps.get(next.fetch_add(1, Ordering::Relaxed)) {
            // Not the time of day: what else the machine does would be in it.
            let start = ThreadTime::now();
            worker.begin();
            busy += start.elapsed();
            for part in sweep {
                worker.load(part);
                let start = ThreadTime::now();
                worker.trace(part);
                busy += start.elapsed();
                if is_compared {
                    worker.compare(part, &mut found);
                }
            }
        }
        (busy, found)
    };
    if threads <= 1 {
        return work();
    }
    let results = Mutex::new((Duration::ZERO, Disagreements::default()));
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                let (busy, found) = work();
                let mut results = results.lock().unwrap_or_else(PoisonError::into_inner);
                results.0 = results.0.max(busy);
                results.1.absorb(found);
            });
        }
    });
    results.into_inner().unwrap_or_else(PoisonError::into_inner)
}

#[expect(clippy::cast_precision_loss, reason = "counts below 2^53")]
fn float(count: u64) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::BenchScene;
    use super::*;

    fn plan(threads: usize) -> BenchPlan {
        let (scenes, _) = BenchScene::all(Path::new("nowhere"), None);
        let scenes = scenes.into_iter().filter(|scene| scene.name() == "spheres-8").collect();
        let views = vec![View { image: 32, side: 32 }, View { image: 64, side: 32 }];
        BenchPlan { scenes, views, repetitions: 1, threads, only: Vec::new() }
    }

    #[test]
    fn every_exact_strategy_answers_every_list() {
        let exact = StrategyKind::ALL.iter().filter(|kind| kind.is_exact());
        let names: Vec<_> = exact.map(|kind| kind.name()).collect();
        for threads in [1, 2] {
            let mut steps = Vec::new();
            let bench = Bench::run(&plan(threads), &mut |step| steps.push(step.to_owned())).unwrap();
            assert_eq!((bench.rows.len(), steps.len()), (2, 3));
            for row in &bench.rows {
                assert!(row.passes.len() >= 6 && row.rays() > 1024);
                assert!(
                    row.contenders.iter().map(|contender| contender.name.as_str()).eq(names.iter().copied())
                );
                let is_timed =
                    |row: &ContenderRow| row.frame.least > 0.0 && row.disagreements.compared > 1024;
                assert!(row.contenders.iter().all(is_timed));
            }
            assert!(bench.to_markdown().contains("| `hierarchical` |"));
            assert!(bench.svg().unwrap().contains("spheres"));
        }
    }

    #[test]
    fn only_who_is_far_behind_is_asked_once() {
        let times = [vec![10.0, 60.0, 79.0], vec![10.0, 101.0, 81.0]];
        assert_eq!(far_behind(&times), [false, true, false]);
        assert!(far_behind(&[]).is_empty());
    }

    #[test]
    fn filters_take_the_beginning_of_names() {
        let bench = Bench::run(&BenchPlan { only: vec!["hier".to_owned()], ..plan(1) }, &mut |_| ()).unwrap();
        assert!(bench.rows.iter().all(|row| row.contenders.len() == 1));
    }
}
