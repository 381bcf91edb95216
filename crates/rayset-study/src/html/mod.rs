//! The report: one HTML file with Table 1, the map, the cost model and pictures.

mod cost;
mod draw;
mod map;
mod page;
mod pictures;
mod plan;
mod provenance;
mod table1;

use maud::Markup;

pub use self::plan::ReportPlan;
use crate::StudyError;

/// Told the name of a part, how many of its steps are finished, and how many there are; from any thread.
type Step<'a> = &'a (dyn Fn(&str, usize, usize) + Sync);

/// A part of the page.
struct Section {
    /// What links to it.
    id: &'static str,
    /// Its heading.
    title: &'static str,
    body: Markup,
}

impl ReportPlan {
    /// The report as one HTML document, which refers to no other file and no network.
    ///
    /// Experiments that are recorded are read; those that are missing are run, and recorded as each is finished. Equal
    /// records give equal bytes. `step` is told the name of a part, how many of its steps are finished, and how many
    /// there are.
    ///
    /// # Errors
    ///
    /// [`StudyError`] if a record is damaged or cannot be written, or a scene cannot be loaded.
    pub fn html(&self, step: &(dyn Fn(&str, usize, usize) + Sync)) -> Result<String, StudyError> {
        let sections = [
            table1::section(self, step)?,
            map::section(self, step)?,
            cost::section(self, step)?,
            pictures::section(self, step)?,
        ];
        Ok(page::page(self, &sections))
    }
}
