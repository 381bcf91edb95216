//! What strategies, and others, take for the same rays: recorded once a scene, answered in turns, compared as it runs.
//!
//! [`BenchScene`] says what is traced, [`Recording`] holds the rays of a Whitted tree of depth 3, generation by
//! generation, and every [`Contender`] answers them. [`Bench::run`] lets the contenders take turns, list by list.
//! Times are those of the processor, of the calls alone.

mod contender;
mod plot;
mod record;
mod report;
mod run;
mod scenes;
mod versus;

pub use contender::{Contender, Disagreements, Worker, strategies};
pub use record::{Pass, RecordedPart, RecordedPass, Recording};
pub use scenes::{BenchScene, View};

use serde::{Deserialize, Serialize};

use crate::Spread;

/// What is to be measured.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BenchPlan {
    /// The scenes, in the order of the run.
    pub scenes: Vec<BenchScene>,
    /// How each is seen.
    pub views: Vec<View>,
    /// How often each list of rays is answered by each contender, after once to warm up.
    pub repetitions: usize,
    /// How many threads share the sweeps of a list.
    pub threads: usize,
    /// Only contenders whose name begins with one of these; all, if there is none.
    pub only: Vec<String>,
}

/// The most tests a ray, as [`Work::in_tests`](rayset_engine::Work::in_tests) counts them, that a strategy may need on
/// the first rays of the middle bundle of any list; one that needs more is skipped for the scene.
pub const MOST_TESTS_PER_RAY: f64 = 4096.0;

/// How many times slower than the fastest a contender may be for all rays of a frame, the first time, to be asked again.
pub const SLOW: f64 = 8.0;

/// What was measured, and on which machine.
#[derive(Clone, Debug, Serialize)]
pub struct Bench {
    /// The processor: its name, family and model.
    pub processor: String,
    /// How many threads the machine runs at a time.
    pub cores: usize,
    /// How many of them were used.
    pub threads: usize,
    /// The lanes of the strategies.
    pub backend: String,
    /// How often each list was answered by each contender.
    pub repetitions: usize,
    /// See [`MOST_TESTS_PER_RAY`].
    pub most_tests_per_ray: f64,
    /// Scenes and views.
    pub rows: Vec<BenchRow>,
}

/// A scene, seen in one way.
#[derive(Clone, Debug, Serialize)]
pub struct BenchRow {
    /// The scene.
    pub scene: String,
    /// How it is seen.
    pub view: String,
    /// How many spheres, if it is one of random spheres.
    pub spheres: Option<u32>,
    /// How many primitives there are.
    pub primitives: usize,
    /// How often each list was answered by each contender: less often than elsewhere where that takes long.
    pub repetitions: usize,
    /// The lists of rays.
    pub passes: Vec<PassRow>,
    /// Who answered them, in the order of the run.
    pub contenders: Vec<ContenderRow>,
    /// Who did not, and why.
    pub skipped: Vec<(String, String)>,
}

/// A list of rays.
#[derive(Clone, Debug, Serialize)]
pub struct PassRow {
    /// Their kind and depth.
    pub name: String,
    /// How many there are.
    pub rays: u64,
    /// How many of them hit, or are blocked.
    pub hits: u64,
}

/// What one contender took for the lists of a row.
#[derive(Clone, Debug, Serialize)]
pub struct ContenderRow {
    /// Its name.
    pub name: String,
    /// Whose it is: `rayset`, or another library.
    pub family: String,
    /// Seconds to make it ready for the scene, once.
    pub ready_seconds: f64,
    /// Milliseconds for all lists.
    pub frame: Spread,
    /// Nanoseconds a ray, list by list.
    pub passes: Vec<Spread>,
    /// Whether it was asked but once, being more than [`SLOW`] times slower than the fastest.
    pub once: bool,
    /// Where its answers differ from the recorded ones; empty for the exact.
    pub disagreements: Disagreements,
}

impl BenchRow {
    /// The rays of all lists.
    #[must_use]
    pub fn rays(&self) -> u64 {
        self.passes.iter().map(|pass| pass.rays).sum()
    }

    /// The time of `auto` over that of the fastest other strategy of ours.
    #[must_use]
    pub fn auto_over_fastest(&self) -> Option<f64> {
        let others = self.contenders.iter().filter(|other| other.family == "rayset" && other.name != "auto");
        let fastest = others.map(|other| other.frame.median).reduce(f64::min)?;
        Some(self.contender("auto")?.frame.median / fastest)
    }

    /// The contender of a name.
    #[must_use]
    pub fn contender(&self, name: &str) -> Option<&ContenderRow> {
        self.contenders.iter().find(|contender| contender.name == name)
    }
}
