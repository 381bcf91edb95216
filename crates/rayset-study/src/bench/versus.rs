//! Ours beside other libraries, as ratios of speeds.

use std::fmt::Write as _;

use super::report::cells;
use super::{Bench, BenchRow, ContenderRow};

/// Whose contenders are compared with all others.
pub(super) const OURS: &str = "rayset";

/// The single rays of ours and of the library that comparisons are usually made with.
const SINGLE: [&str; 2] = ["hierarchical", "embree 1"];

/// The same library where it takes the rays from the columns that ours takes them from.
const CONVERTED: &str = "embree 1, converted";

/// What of ours is compared with the fastest mode of a library, list by list.
const TOGETHER: &str = "bundle";

impl BenchRow {
    /// Nanoseconds a ray of the fastest contender of a family for a list.
    pub(super) fn best(&self, family: &str, pass: usize) -> Option<f64> {
        let of_family = self.contenders.iter().filter(|contender| contender.family == family);
        of_family
            .filter_map(|contender| contender.passes.get(pass))
            .map(|spread| spread.median)
            .reduce(f64::min)
    }

    /// Milliseconds of a frame whose every list takes some nanoseconds a ray.
    #[expect(clippy::cast_precision_loss, reason = "counts below 2^53")]
    pub(super) fn frame(&self, list: impl Fn(usize) -> Option<f64>) -> Option<f64> {
        let times = self.passes.iter().enumerate().map(|(p, pass)| Some(list(p)? * pass.rays as f64 * 1e-6));
        times.sum()
    }

    /// Nanoseconds a ray of a contender for a list.
    fn of(&self, name: &str, pass: usize) -> Option<f64> {
        self.contender(name)?.passes.get(pass).map(|spread| spread.median)
    }
}

impl Bench {
    /// Tables of ratios, if there is anyone to compare with.
    pub(super) fn write_comparisons(&self, text: &mut String) {
        let mut families: Vec<&str> = Vec::new();
        for ContenderRow { family, .. } in self.rows.iter().flat_map(|row| &row.contenders) {
            if family != OURS && !families.contains(&family.as_str()) {
                families.push(family);
            }
        }
        if families.is_empty() {
            return;
        }
        self.write_frames(text, &families);
        for [ours, theirs] in [SINGLE, [SINGLE[0], CONVERTED], [TOGETHER, SINGLE[0]]] {
            let ratio: Ratio<'_> = &|row, pass| Some(row.of(theirs, pass)? / row.of(ours, pass)?);
            self.write_lists(text, &format!("Speed of `{ours}` over `{theirs}`, list by list"), ratio);
        }
        for family in families {
            let ratio: Ratio<'_> = &|row, pass| Some(row.best(family, pass)? / row.of(TOGETHER, pass)?);
            let title = format!("Speed of `{TOGETHER}` over the best mode of {family}, list by list");
            self.write_lists(text, &title, ratio);
        }
    }

    /// Frames as sums over lists, and their ratios.
    fn write_frames(&self, text: &mut String, families: &[&str]) {
        let _ = write!(
            text,
            "### Speed of a frame's rays\n\n\
             Ratios above 1: the first is faster. Of a library counts, list by list, the fastest mode.\n\
             Rays of `embree`, as of the others, stand ready in single precision in its own layout before the \
             clock starts, and its answers are left there.\n\
             Rays of `embree, converted` are narrowed within the clock, just before each call, from the columns of \
             double precision that ours reads, and its answers read out into columns, as in any application that \
             makes its rays in double precision.\n\n\
             | scene | view | `{0}` over `{1}` | `{0}` over `{CONVERTED}` | `{TOGETHER}` over `{0}` |",
            SINGLE[0], SINGLE[1]
        );
        cells(text, families.iter().map(|family| format!("`{TOGETHER}` over {family}")));
        let _ = writeln!(text, "\n|---|---|{}", "---:|".repeat(3 + families.len()));
        for row in &self.rows {
            let frame = |name: &str| row.frame(|pass| row.of(name, pass));
            let [single, theirs, converted, together] =
                [SINGLE[0], SINGLE[1], CONVERTED, TOGETHER].map(frame);
            let over = |ours: Option<f64>, theirs: Option<f64>| Some(theirs? / ours?);
            let mut entries = vec![over(single, theirs), over(single, converted), over(together, single)];
            entries.extend(
                families.iter().map(|family| over(together, row.frame(|pass| row.best(family, pass)))),
            );
            let _ = write!(text, "| {} | {} |", row.scene, row.view);
            cells(text, entries.into_iter().map(number));
            text.push('\n');
        }
        text.push('\n');
    }

    /// A ratio for each list.
    fn write_lists(&self, text: &mut String, title: &str, ratio: Ratio<'_>) {
        let mut names: Vec<&str> = Vec::new();
        for pass in self.rows.iter().flat_map(|row| &row.passes) {
            if !names.contains(&pass.name.as_str()) {
                names.push(&pass.name);
            }
        }
        if !self.rows.iter().any(|row| (0..row.passes.len()).any(|pass| ratio(row, pass).is_some())) {
            return;
        }
        let _ = write!(text, "### {title}\n\n| scene | view |");
        cells(text, names.iter().map(|name| (*name).to_owned()));
        let _ = writeln!(text, "\n|---|---|{}", "---:|".repeat(names.len()));
        for row in &self.rows {
            let entry = |name: &&str| {
                let pass = row.passes.iter().position(|pass| pass.name == *name)?;
                ratio(row, pass)
            };
            let entries: Vec<_> = names.iter().map(entry).collect();
            if entries.iter().flatten().next().is_some() {
                let _ = write!(text, "| {} | {} |", row.scene, row.view);
                cells(text, entries.into_iter().map(number));
                text.push('\n');
            }
        }
        text.push('\n');
    }
}

/// A ratio of speeds for a list of a row.
type Ratio<'r> = &'r dyn Fn(&BenchRow, usize) -> Option<f64>;

/// Two decimals, or none of a large number, or nothing.
fn number(value: Option<f64>) -> String {
    match value {
        None => String::new(),
        Some(value) if value >= 100.0 => format!("{value:.0}"),
        Some(value) => format!("{value:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ContenderRow, Disagreements, PassRow};
    use super::*;
    use crate::Spread;

    #[test]
    fn the_best_is_found_list_by_list() {
        let contender = |name: &str, family: &str, times: [f64; 2]| ContenderRow {
            name: name.to_owned(),
            family: family.to_owned(),
            ready_seconds: 0.0,
            frame: Spread::default(),
            passes: times.map(|time| Spread::of(&[time])).to_vec(),
            once: name == "embree 16",
            disagreements: Disagreements::default(),
        };
        let pass = |name: &str| PassRow { name: name.to_owned(), rays: 1_000_000, hits: 0 };
        let row = BenchRow {
            scene: "a".to_owned(),
            view: "b".to_owned(),
            spheres: None,
            primitives: 1,
            repetitions: 1,
            passes: vec![pass("initial 1"), pass("shadow 1")],
            contenders: vec![
                contender("hierarchical", "rayset", [10.0, 20.0]),
                contender("bundle", "rayset", [5.0, 30.0]),
                contender("embree 1", "embree", [20.0, 40.0]),
                contender("embree 16", "embree", [50.0, 10.0]),
                contender("embree 1, converted", "embree, converted", [30.0, 60.0]),
            ],
            skipped: Vec::new(),
        };
        let bench = Bench {
            processor: String::new(),
            cores: 1,
            threads: 1,
            backend: String::new(),
            repetitions: 1,
            most_tests_per_ray: 0.0,
            rows: vec![row],
        };
        let text = bench.to_markdown();
        assert!(text.contains("| a | b | 2.00 | 3.00 | 0.86 | 0.86 | 2.57 |"), "{text}");
        assert!(text.contains("list by list\n\n| scene | view | initial 1 | shadow 1 |\n|---|---|---:|---:|\n| a | b | 3.00 | 3.00 |"), "{text}");
        assert!(text.contains("Asked once, being slow: `embree 16`."), "{text}");
        assert!(text.contains("| a | b | 4.00 | 0.33 |"), "{text}");
    }
}
