//! Table 1: the paper's experiment, with the paper's figures beside ours.

mod column;
mod files;
mod paper;
mod plan;
mod plot;
mod recorded;
mod report;
mod results;
mod run;

pub use self::column::Column;
pub use self::paper::{PAPER, PaperRow};
pub use self::plan::{Reading, Table1Plan};
pub(crate) use self::recorded::{Recorded, RecordedExact, RecordedRow, RecordedStrategy};
pub use self::results::{
    ExactRow, Fitted, KindRow, Misses, ModelReport, OptionsReport, Pictures, PresetReport, Row, StrategyRow,
    Table1,
};
