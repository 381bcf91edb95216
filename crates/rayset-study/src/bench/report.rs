//! The measurement as text.

use std::fmt::Write as _;

use std::path::Path;

use super::{Bench, BenchRow, ContenderRow, Disagreements, SLOW};
use crate::{Spread, StudyError, write_file};

impl Bench {
    /// Writes tables, figures as JSON and plot to a folder, under a name; gives the tables.
    ///
    /// # Errors
    ///
    /// [`StudyError::Write`] if a file cannot be written, [`StudyError::Draw`] if the plot cannot be drawn.
    pub fn write(&self, folder: &Path, name: &str) -> Result<String, StudyError> {
        let path = |ending: &str| folder.join(format!("{name}.{ending}"));
        let json = serde_json::to_vec_pretty(self)
            .map_err(|source| StudyError::Write { path: path("json"), source: source.into() })?;
        write_file(&path("json"), &json)?;
        write_file(&path("svg"), self.svg()?.as_bytes())?;
        let tables = self.to_markdown();
        write_file(&path("md"), tables.as_bytes())?;
        Ok(tables)
    }

    /// The tables in Markdown: an overview, comparisons with other libraries if there are any, then every list.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = String::new();
        let Self { processor, cores, threads, backend, repetitions, .. } = self;
        let _ = writeln!(
            text,
            "{processor}, {cores} cores; threads used: {threads}; lanes: {backend}. \
             Processor time of the calls alone; \
             medians of {repetitions} runs in which all took turns list by list, after one to warm up; \
             `±` is half the distance of the quartiles, in percent.\n\n\
             Rays are those of Whitted trees of depth 3, in tiles of 16 x 16 pixels along Morton curves, recorded once; \
             the number after a kind is the depth. \
             A strategy is skipped where it needs more than {:.0} tests for a ray of a small sample; \
             who takes more than {SLOW} times what the fastest takes to warm up is not asked again, \
             and that one time stands for all. Rows that take long have fewer runs, as they say.\n",
            self.most_tests_per_ray
        );
        self.write_overview(&mut text);
        self.write_comparisons(&mut text);
        for row in &self.rows {
            write_row(&mut text, row, *repetitions);
        }
        text
    }

    /// Milliseconds of whole frames: a line a scene and view, a column a contender of ours.
    fn write_overview(&self, text: &mut String) {
        let mut names: Vec<&str> = Vec::new();
        for contender in self.rows.iter().flat_map(|row| &row.contenders) {
            if contender.family == "rayset" && !names.contains(&contender.name.as_str()) {
                names.push(&contender.name);
            }
        }
        let _ =
            write!(text, "### All rays of a frame, in milliseconds\n\n| scene | view | primitives | rays |");
        cells(text, names.iter().map(|name| format!("`{name}`")));
        let _ = write!(text, " `auto` over the fastest |");
        let _ = writeln!(text, "\n|---|---|---:|---:|{}", "---:|".repeat(names.len() + 1));
        for row in &self.rows {
            let _ = write!(text, "| {} | {} | {} | {} |", row.scene, row.view, row.primitives, row.rays());
            let of = |name: &&str| row.contender(name).map_or_else(String::new, |found| entry(&found.frame));
            cells(text, names.iter().map(of));
            cells(text, [row.auto_over_fastest().map_or_else(String::new, |ratio| format!("{ratio:.2}"))]);
            text.push('\n');
        }
        text.push('\n');
    }
}

/// Appends cells to a row of a table.
pub(super) fn cells(text: &mut String, entries: impl IntoIterator<Item = String>) {
    for entry in entries {
        let _ = write!(text, " {entry} |");
    }
}

/// A median and how far the quartiles are apart.
fn entry(spread: &Spread) -> String {
    let half = 50.0 * (spread.upper_quartile - spread.lower_quartile) / spread.median;
    // Three digits say all that such a measurement knows.
    let digits = match spread.median {
        median if median < 10.0 => 2,
        median if median < 100.0 => 1,
        _ => 0,
    };
    format!("{:.digits$} ±{half:.0}", spread.median)
}

/// Nanoseconds a ray, list by list.
fn write_row(text: &mut String, row: &BenchRow, usual: usize) {
    let BenchRow { scene, view, primitives, passes, contenders, skipped, .. } = row;
    let _ = write!(text, "### {scene}, {view}: {primitives} primitives, nanoseconds a ray\n\n| |");
    cells(text, passes.iter().map(|pass| pass.name.clone()));
    let _ = write!(text, " frame, ms | ready, s |\n|---|{}", "---:|".repeat(passes.len() + 2));
    let _ = write!(text, "\n| rays |");
    cells(text, passes.iter().map(|pass| pass.rays.to_string()));
    let _ = write!(text, " | |\n| hits |");
    cells(text, passes.iter().map(|pass| pass.hits.to_string()));
    text.push_str(" | |\n");
    for ContenderRow { name, frame, passes, ready_seconds, .. } in contenders {
        let _ = write!(text, "| `{name}` |");
        cells(text, passes.iter().map(entry));
        let _ = writeln!(text, " {} | {ready_seconds:.3} |", entry(frame));
    }
    text.push('\n');
    if !skipped.is_empty() {
        let skipped: Vec<_> = skipped.iter().map(|(name, reason)| format!("`{name}` ({reason})")).collect();
        let _ = writeln!(text, "Skipped: {}.\n", skipped.join(", "));
    }
    let once: Vec<_> =
        contenders.iter().filter(|row| row.once).map(|row| format!("`{}`", row.name)).collect();
    if row.repetitions != usual {
        let _ = writeln!(text, "Runs: {}.\n", row.repetitions);
    }
    if !once.is_empty() {
        let _ = writeln!(text, "Asked once, being slow: {}.\n", once.join(", "));
    }
    write_disagreements(text, contenders);
}

/// Where answers differ from ours; contenders that differ in the same way share a line.
fn write_disagreements(text: &mut String, contenders: &[ContenderRow]) {
    let mut groups: Vec<(&Disagreements, Vec<String>)> = Vec::new();
    for ContenderRow { name, disagreements, .. } in
        contenders.iter().filter(|row| row.disagreements.total() > 0)
    {
        let name = format!("`{name}`");
        match groups.iter_mut().find(|(first, _)| first.reasons == disagreements.reasons) {
            Some((_, names)) => names.push(name),
            None => groups.push((disagreements, vec![name])),
        }
    }
    for (found, names) in &groups {
        let reasons: Vec<_> =
            found.reasons.iter().map(|(reason, count)| format!("{count} {reason}")).collect();
        let (total, compared) = (found.total(), found.compared);
        let (names, reasons) = (names.join(", "), reasons.join("; "));
        let _ = writeln!(text, "- Of {compared} rays, {total} are answered otherwise by {names}: {reasons}.");
        for sample in &found.samples {
            let _ = writeln!(text, "  - {sample}");
        }
    }
    if !groups.is_empty() {
        text.push('\n');
    }
}
