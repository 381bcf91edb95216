//! The columns of Table 1: what stands beside the paper's figures.

use super::results::{PresetReport, Row, StrategyRow, Table1};

/// What one reading or preset gave for every scene it was run on.
#[derive(Clone, Copy, Debug)]
pub struct Column<'t> {
    /// The name.
    pub name: &'t str,
    /// The rows it is in; the rows of a preset are its own.
    pub rows: &'t [Row],
    /// The preset, if it is one.
    pub preset: Option<&'t PresetReport>,
}

impl Table1 {
    /// Every column, in the order in which reports show them: readings, then presets.
    #[must_use]
    pub fn columns(&self) -> Vec<Column<'_>> {
        let readings =
            self.options.readings.keys().map(|name| Column { name, rows: &self.ours, preset: None });
        let presets = self.presets.iter().map(|preset| Column {
            name: &preset.name,
            rows: &preset.rows,
            preset: Some(preset),
        });
        readings.chain(presets).collect()
    }

    /// Every row: those of the readings, then those of the presets.
    pub(super) fn rows(&self) -> impl Iterator<Item = &Row> {
        self.ours.iter().chain(self.presets.iter().flat_map(|preset| &preset.rows))
    }
}

impl<'t> Column<'t> {
    /// The scenes of spheres with what it took for each.
    pub fn spheres(self) -> impl Iterator<Item = (&'t Row, &'t StrategyRow)> {
        let rows = self.rows.iter().filter(|row| row.spheres.is_some());
        rows.filter_map(move |row| Some((row, row.strategies.get(self.name)?)))
    }

    /// The scene with this many spheres.
    #[must_use]
    pub fn of_spheres(self, count: u32) -> Option<(&'t Row, &'t StrategyRow)> {
        self.spheres().find(|(row, _)| row.spheres == Some(count))
    }
}
