//! Experiments over scenes, strategies and options: Table 1 of Speer, DeRose and Barsky (1985) and its cost model.
//!
//! [`Table1`] is the paper's experiment, run on the scenes of a [`Table1Plan`]; [`CostModel`] is the paper's section 3,
//! fitted to what was measured. [`Coherence`] is what the strategy `coherent` gains today, and [`Bench`] what every
//! exact strategy takes for the same rays.
//!
//! ```
//! use rayset_study::CostModel;
//!
//! // The paper's own conclusion from its last row: a coherence of 0.662 is the threshold, so k / lambda is 0.51.
//! let model = CostModel { k: 0.511, lambda: 1.0, alpha: 0.0 };
//! assert!((model.threshold() - 0.662).abs() < 0.001);
//! ```

mod bench;
mod coherence;
mod conditions;
mod cost_model;
mod error;
mod files;
mod html;
mod measures;
mod preset;
mod scenes;
mod statistics;
mod study;
mod table1;

pub use bench::{
    Bench, BenchPlan, BenchRow, BenchScene, Contender, ContenderRow, Disagreements, MOST_TESTS_PER_RAY, Pass,
    PassRow, RecordedPart, RecordedPass, Recording, SLOW, View, Worker, strategies,
};
pub use coherence::{Coherence, CoherenceCell, CoherencePlan, CoherenceRow};
pub use conditions::{Conditions, Pair};
pub use cost_model::{CostModel, Measurement};
pub use error::StudyError;
pub use files::write_file;
pub use html::ReportPlan;
pub use measures::{Among, Cost, Counting, Which};
pub use preset::Preset;
pub use scenes::{NamedScene, cornell_box, cornell_spheres, knob, mesh_scenes, sphere_scene};
pub use statistics::Spread;
pub use study::{Counts, Distribution, Journal, Key, Kinds, Median, Scale, StudyName};
pub use table1::{
    Column, ExactRow, Fitted, KindRow, Misses, ModelReport, OptionsReport, PAPER, PaperRow, Pictures,
    PresetReport, Reading, Row, StrategyRow, Table1, Table1Plan,
};
