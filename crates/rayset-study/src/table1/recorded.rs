//! The results that were written, read back for figures.

use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::paper::PaperRow;
use crate::{Spread, StudyError};

/// What a figure needs of `table1.json`; what else is there is left alone.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Recorded {
    /// The paper's rows.
    pub(crate) paper: Vec<PaperRow>,
    /// Our rows: spheres, then meshes.
    pub(crate) ours: Vec<RecordedRow>,
    /// Settings with scenes of their own.
    #[serde(default)]
    pub(crate) presets: Vec<RecordedPreset>,
    /// How it was run.
    pub(crate) options: RecordedOptions,
}

/// A setting with scenes of its own.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct RecordedPreset {
    /// The name.
    pub(crate) name: String,
    /// What is not at its default, as text.
    pub(crate) differences: String,
    /// What its percentages count.
    pub(crate) counting: String,
    /// Its rows, one for every number of spheres.
    pub(crate) rows: Vec<RecordedRow>,
}

/// One scene, over all seeds.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct RecordedRow {
    /// The name of the scene.
    pub(crate) scene: String,
    /// The number of spheres; `None` for a mesh.
    pub(crate) spheres: Option<u32>,
    /// The number of bounding volumes: the paper's n.
    pub(crate) volumes: u64,
    /// The number of seeds.
    pub(crate) seeds: u64,
    /// The side of the image, in pixels.
    pub(crate) resolution: u32,
    /// What each strategy took, by name.
    pub(crate) strategies: BTreeMap<String, RecordedStrategy>,
    /// What exact strategies took, by name; none in older results.
    #[serde(default)]
    pub(crate) exact: BTreeMap<String, RecordedExact>,
}

/// What a strategy took for a scene, over all seeds.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct RecordedStrategy {
    /// Time inside the strategy's calls, in seconds.
    pub(crate) seconds: f64,
    /// Coherent rays in percent of the rays cast, of all seeds together.
    pub(crate) percent_coherent: f64,
    /// Its spread over seeds.
    pub(crate) percent_coherent_spread: Spread,
    /// Time over that of `standard`, of all pairs.
    pub(crate) ratio_time_spread: Spread,
    /// Work over that of `standard`.
    pub(crate) ratio_work: f64,
    /// Pixels that differ from those of `standard`, over all seeds.
    pub(crate) wrong_pixels: u64,
}

/// What an exact strategy took for a scene, over all seeds.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct RecordedExact {
    /// Time inside the strategy's calls, in seconds.
    pub(crate) seconds: f64,
    /// Coherent rays in percent of the rays cast, of all seeds together; not in older results.
    pub(crate) percent_coherent: Option<f64>,
    /// Its spread over seeds.
    pub(crate) percent_coherent_spread: Option<Spread>,
    /// Time over that of `standard`, of all pairs.
    pub(crate) ratio_time: Spread,
    /// Work over that of `standard`.
    pub(crate) ratio_work: f64,
    /// Pixels that differ from those of `standard`, over all seeds.
    pub(crate) wrong_pixels: u64,
}

/// How the experiment was run.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct RecordedOptions {
    /// The side of the sphere images, in pixels.
    pub(crate) resolution: u32,
    /// The seeds.
    pub(crate) seeds: Vec<u64>,
    /// Repetitions of each sphere frame.
    pub(crate) repetitions: usize,
    /// The greatest depth of a tree.
    pub(crate) max_depth: u32,
    /// The adaptive cut-off.
    pub(crate) cutoff: Option<f64>,
    /// The lanes of both strategies.
    pub(crate) backend: String,
    /// The version of the program.
    pub(crate) version: String,
    /// All others.
    #[serde(flatten)]
    pub(crate) others: BTreeMap<String, Value>,
}

impl RecordedRow {
    /// How many pixels were rendered, of all seeds together.
    pub(crate) fn pixels(&self) -> u64 {
        u64::from(self.resolution) * u64::from(self.resolution) * self.seeds
    }
}

impl Recorded {
    /// What [`Table1::write`](super::Table1::write) wrote into a folder; `None` if nothing is there.
    ///
    /// # Errors
    ///
    /// [`StudyError::Read`] if the file is damaged.
    pub(crate) fn read(folder: &Path) -> Result<Option<Self>, StudyError> {
        let path = folder.join("table1.json");
        let failed = |source: Box<dyn std::error::Error + Send + Sync>| StudyError::Read {
            path: path.clone(),
            source,
        };
        let text = match fs::read_to_string(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            text => text.map_err(|error| failed(error.into()))?,
        };
        serde_json::from_str(&text).map(Some).map_err(|error| failed(error.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Table1, Table1Plan};
    use approx::assert_abs_diff_eq;

    #[test]
    fn what_is_written_is_read_back() {
        let plan = Table1Plan {
            spheres: vec![1, 16],
            seeds: vec![1],
            repetitions: 1,
            resolution: 16,
            mesh_resolutions: [0; 4],
            ..Table1Plan::full("none".into())
        };
        let folder = tempfile::tempdir().unwrap();
        assert!(Recorded::read(folder.path()).unwrap().is_none());
        let table = Table1::run(&plan, &mut |_| ()).unwrap();
        table.write(folder.path()).unwrap();
        let recorded = Recorded::read(folder.path()).unwrap().unwrap();
        assert_eq!(recorded.paper, table.paper);
        for (recorded, row) in recorded.ours.iter().zip(&table.ours) {
            assert_eq!(recorded.spheres, row.spheres);
            assert!(recorded.strategies.keys().eq(row.strategies.keys()));
            assert!(recorded.exact.keys().eq(row.exact.keys()) && recorded.exact.len() == plan.exact.len());
            for (recorded, exact) in recorded.exact.values().zip(row.exact.values()) {
                // What is read from JSON may differ in the last bit.
                let percent = recorded.percent_coherent.unwrap();
                assert_abs_diff_eq!(percent, exact.percent_coherent, epsilon = 1e-9);
                assert_abs_diff_eq!(recorded.ratio_time.median, exact.ratio_time.median, epsilon = 1e-9);
            }
        }
        let path = folder.path().join("table1.json");
        let mut earlier: Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
        let rows = earlier["ours"].as_array_mut().unwrap();
        rows[0].as_object_mut().unwrap().remove("exact");
        rows[1]["exact"]["bundle"].as_object_mut().unwrap().remove("percent_coherent");
        fs::write(&path, earlier.to_string()).unwrap();
        let recorded_earlier = Recorded::read(folder.path()).unwrap().unwrap();
        assert!(recorded_earlier.ours[0].exact.is_empty());
        assert!(recorded.ours[1].exact["bundle"].percent_coherent > Some(50.0));
        assert_eq!(recorded_earlier.ours[1].exact["bundle"].percent_coherent, None);
        assert_eq!(recorded.presets.len(), table.presets.len());
        fs::write(&path, "{").unwrap();
        assert!(matches!(Recorded::read(folder.path()), Err(StudyError::Read { .. })));
    }
}
