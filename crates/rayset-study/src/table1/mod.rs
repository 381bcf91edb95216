//! Table 1: the paper's experiment, with the paper's figures beside ours.

mod paper;
mod plot;
mod report;
mod run;

pub use self::paper::{PAPER, PaperRow};
pub use self::run::{
    KindRow, ModelReport, OptionsReport, Pictures, Reading, Row, StrategyRow, Table1, Table1Plan,
};
