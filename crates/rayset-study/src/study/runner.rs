//! Runs the experiments that a journal lacks.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::thread;

use rayset_engine::{
    Backend, LightRule, MissRule, RenderOptions, Speer1985, Speer1985Options, StrategyKind, SweepLength,
    render,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::counts::Counts;
use super::journal::{Journal, Key};
use super::timed::OTHERS;
use crate::{StudyError, sphere_scene};

/// An experiment: its parameters decide its counts.
pub(super) trait Experiment: Sync {
    /// What it finds.
    type Record: Serialize + DeserializeOwned + Send;

    /// The parameters by name.
    fn parameters(&self) -> Vec<(&'static str, String)>;

    /// The version of the program, as far as it bears on the result.
    fn version(&self) -> &str;

    /// Does it.
    fn run(&self) -> Result<Self::Record, StudyError>;

    /// The key in the journal.
    fn key(&self) -> Key {
        let experiment: BTreeMap<_, _> =
            self.parameters().into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        Key { version: self.version().to_owned(), experiment }
    }
}

/// Told how many experiments of a batch are finished, and how many there are; from any thread.
pub(super) type Step<'a> = &'a (dyn Fn(usize, usize) + Sync);

/// Runs the experiments that are not in the journal, on some threads; each is noted when it is finished.
pub(super) fn run_missing<E: Experiment>(
    journal: &mut Journal<E::Record>,
    experiments: &[E],
    threads: usize,
    step: Step<'_>,
) -> Result<(), StudyError> {
    let missing: Vec<_> =
        experiments.iter().filter(|experiment| journal.get(&experiment.key()).is_none()).collect();
    let done = experiments.len() - missing.len();
    step(done, experiments.len());
    let (next, finished) = (AtomicUsize::new(0), AtomicUsize::new(done));
    let shared = Mutex::new((journal, None));
    let work = || {
        while let Some(experiment) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
            let record = experiment.run();
            let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
            let noted = record.and_then(|record| shared.0.append(experiment.key(), record));
            if let Err(error) = noted {
                shared.1.get_or_insert(error);
                next.store(missing.len(), Ordering::Relaxed);
            }
            step(finished.fetch_add(1, Ordering::Relaxed) + 1, experiments.len());
        }
    };
    thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(work);
        }
        work();
    });
    let (_, error) = shared.into_inner().unwrap_or_else(PoisonError::into_inner);
    error.map_or(Ok(()), Err)
}

/// The package's version, and a hash of what `standard` and `speer-1985` count for a few frames: a change of the engine
/// that changes counts is another version, and its experiments are run anew.
pub(super) fn version_of_1985() -> &'static str {
    static VERSION: OnceLock<String> = OnceLock::new();
    VERSION.get_or_init(|| version_with(&[]))
}

/// The same with `coherent`.
pub(super) fn version_of_all() -> &'static str {
    static VERSION: OnceLock<String> = OnceLock::new();
    VERSION.get_or_init(|| version_with(&[StrategyKind::Coherent]))
}

/// The same with the other methods too.
pub(super) fn version_with_others() -> &'static str {
    static VERSION: OnceLock<String> = OnceLock::new();
    VERSION.get_or_init(|| {
        let more: Vec<_> = [StrategyKind::Coherent].into_iter().chain(OTHERS).collect();
        version_with(&more)
    })
}

/// The same with some strategies.
pub(super) fn version_with(more: &[StrategyKind]) -> String {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |counts: &Counts| {
        for byte in serde_json::to_vec(counts).expect("numbers") {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    };
    let wide = Speer1985Options {
        misses: MissRule::Cylinder,
        light_rays: LightRule::All,
        ..Speer1985Options::default()
    };
    let options =
        RenderOptions { width: 48, height: 48, sweep: SweepLength::WholeImage, ..RenderOptions::default() };
    for count in [3, 9] {
        let scene = sphere_scene(count, 1).expect("a valid scene").scene;
        let mut strategies = vec![
            StrategyKind::Standard.bind_on(&scene, Backend::Scalar),
            StrategyKind::Speer1985.bind_on(&scene, Backend::Scalar),
            Box::new(Speer1985::on(&scene, Backend::Scalar, wide)),
        ];
        strategies.extend(more.iter().map(|kind| kind.bind_on(&scene, Backend::Scalar)));
        for strategy in strategies {
            let frame = render(strategy.as_ref(), &options).expect("valid options");
            add(&Counts::of(&frame.counts, &frame.stats));
        }
    }
    format!("{}-{:08x}", env!("CARGO_PKG_VERSION"), hash >> 32)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Square(u64);

    impl Experiment for Square {
        type Record = u64;

        fn parameters(&self) -> Vec<(&'static str, String)> {
            vec![("of", self.0.to_string())]
        }

        fn version(&self) -> &'static str {
            "1"
        }

        fn run(&self) -> Result<u64, StudyError> {
            if self.0 == 13 {
                return Err(StudyError::Write { path: "13".into(), source: "unlucky".into() });
            }
            Ok(self.0 * self.0)
        }
    }

    fn journal(name: &str) -> Journal<u64> {
        let path = std::env::temp_dir().join(format!("rayset-runner-{}-{name}", std::process::id()));
        let _ = std::fs::remove_file(&path);
        Journal::open(&path).unwrap()
    }

    #[test]
    fn what_is_finished_is_not_run_again() {
        let mut journal = journal("again");
        run_missing(&mut journal, &[Square(2), Square(3)], 1, &|_, _| ()).unwrap();
        let n_steps = AtomicUsize::new(0);
        let all: Vec<_> = (0..10).map(Square).collect();
        let step = |_, of| {
            assert_eq!(of, 10);
            n_steps.fetch_add(1, Ordering::Relaxed);
        };
        run_missing(&mut journal, &all, 3, &step).unwrap();
        assert_eq!(n_steps.into_inner(), 9);
        assert_eq!(journal.len(), 10);
        assert!(all.iter().all(|square| journal.get(&square.key()) == Some(&(square.0 * square.0))));
    }

    #[test]
    fn an_error_stops_the_run_and_keeps_what_is_finished() {
        let mut journal = journal("error");
        let all: Vec<_> = (12..100).map(Square).collect();
        assert!(run_missing(&mut journal, &all, 1, &|_, _| ()).is_err());
        assert_eq!(journal.len(), 1);
    }

    #[test]
    fn versions_are_the_same_each_time_and_differ_by_what_they_cover() {
        assert_eq!(version_with(&[]), version_of_1985());
        assert_ne!(version_of_1985(), version_of_all());
        assert_ne!(version_of_all(), version_with_others());
    }
}
