//! The table as a reviewer can read it, with times left out.

use rayset_study::{ExactRow, Spread, StrategyRow, Table1, Table1Plan};

/// The same of an exact strategy.
fn exact_without_times(exact: &mut ExactRow) {
    (exact.seconds, exact.ratio_time, exact.ratio_time_frame) = (1.0, ONE, ONE);
}

const ONE: Spread =
    Spread { least: 1.0, lower_quartile: 1.0, median: 1.0, upper_quartile: 1.0, greatest: 1.0 };

/// Times differ from run to run: all are one second, and every ratio of them one.
fn without_times(measured: &mut StrategyRow) {
    (measured.seconds, measured.seconds_frame) = (1.0, 1.0);
    (measured.ratio_time, measured.ratio_time_spread, measured.ratio_time_frame) = (1.0, ONE, 1.0);
}

#[test]
fn the_spheres_with_every_column() {
    let plan = Table1Plan {
        seeds: vec![1, 2, 9],
        repetitions: 1,
        resolution: 24,
        mesh_resolutions: [0; 4],
        ..Table1Plan::full("".into())
    };
    let mut table = Table1::run(&plan, &mut |_| ()).unwrap();
    let presets = table.presets.iter_mut().flat_map(|preset| &mut preset.rows);
    for row in table.ours.iter_mut().chain(presets) {
        row.strategies.values_mut().for_each(without_times);
        row.exact.values_mut().for_each(exact_without_times);
    }
    let text = table.to_markdown();
    // The cost model is of times.
    let (before, model) = text.split_once("## Section 3").unwrap();
    let (_, after) = model.split_once("## Do cylinders").unwrap();
    let counted = format!("{before}## Do cylinders{after}");
    insta::assert_snapshot!("table", counted);
    insta::assert_snapshot!("summary", table.summary());
}
