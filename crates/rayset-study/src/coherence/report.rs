//! The measurement as text.

use std::fmt::Write as _;

use rayset_engine::Backend;

use super::{Coherence, CoherenceRow};

impl Coherence {
    /// The tables in Markdown.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let (scalar, widest) = (Backend::Scalar.name(), Backend::widest().name());
        let mut text = String::new();
        let _ = writeln!(
            text,
            "{}, {} cores, one thread; the median of {} pairs of runs, and in brackets their quartiles.\n",
            self.processor, self.cores, self.repetitions
        );
        let time = |row: &CoherenceRow| {
            let spread = &row.time;
            format!("{:.2} ({:.2}..{:.2})", spread.median, spread.lower_quartile, spread.upper_quartile)
        };
        let titles =
            ["(a) Time over `standard`, both with scalar kernels", "(b) Time over `standard`, both in lanes"];
        for (title, backend) in titles.iter().zip([scalar, widest]) {
            self.write_table(&mut text, &format!("{title} (`{backend}`)"), backend, &time);
        }
        self.write_table(
            &mut text,
            "(c) Tests over those of `standard`: exact, on any lanes",
            scalar,
            &|row| format!("{:.3}", row.work),
        );
        self.write_table(&mut text, "Nanoseconds a ray: `standard`, `coherent`; scalar", scalar, &|row| {
            format!("{:.1}, {:.1}", row.standard.median, row.coherent.median)
        });
        self.write_table(&mut text, "Percent of the rays that are coherent", scalar, &|row| {
            format!("{:.0}", row.percent_coherent)
        });
        text
    }

    /// What the README says: the ratios of times with scalar kernels and in lanes, never one without the other, and the
    /// ratio of tests.
    #[must_use]
    pub fn summary(&self) -> String {
        let mut text = String::from(
            "| n | scalar, 512 x 512 | scalar, 1024 x 1024 | lanes, 512 x 512 | lanes, 1024 x 1024 | tests, 512 x 512 |\n|---:|---:|---:|---:|---:|---:|\n",
        );
        let (scalar, widest) = (Backend::Scalar.name(), Backend::widest().name());
        for n in self.numbers() {
            let time = |resolution, backend| {
                self.row(n, resolution, backend)
                    .map_or_else(String::new, |row| format!("{:.2}", row.time.median))
            };
            let work = self.row(n, 512, scalar).map_or_else(String::new, |row| format!("{:.2}", row.work));
            let _ = writeln!(
                text,
                "| {n} | {} | {} | {} | {} | {work} |",
                time(512, scalar),
                time(1024, scalar),
                time(512, widest),
                time(1024, widest)
            );
        }
        text
    }

    /// The numbers of spheres, once each.
    fn numbers(&self) -> Vec<u32> {
        let mut numbers: Vec<_> = self.rows.iter().map(|row| row.spheres).collect();
        numbers.sort_unstable();
        numbers.dedup();
        numbers
    }

    fn row(&self, spheres: u32, resolution: u32, backend: &str) -> Option<&CoherenceRow> {
        let is_it = |row: &&CoherenceRow| {
            row.spheres == spheres && row.resolution == resolution && row.backend == backend
        };
        self.rows.iter().find(is_it)
    }

    fn write_table(
        &self,
        text: &mut String,
        title: &str,
        backend: &str,
        entry: &dyn Fn(&CoherenceRow) -> String,
    ) {
        let mut resolutions: Vec<_> = self.rows.iter().map(|row| row.resolution).collect();
        resolutions.sort_unstable();
        resolutions.dedup();
        let _ = write!(text, "### {title}\n\n| n |");
        for side in &resolutions {
            let _ = write!(text, " {side} x {side} |");
        }
        let _ = writeln!(text, "\n|---:|{}", "---:|".repeat(resolutions.len()));
        for n in self.numbers() {
            let _ = write!(text, "| {n} |");
            for &side in &resolutions {
                let entry = self.row(n, side, backend).map_or_else(String::new, entry);
                let _ = write!(text, " {entry} |");
            }
            text.push('\n');
        }
        text.push('\n');
    }
}
