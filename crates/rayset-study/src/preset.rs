//! Settings that have a name.

use std::ops::RangeInclusive;

use rayset_engine::{MissRule, PixelOrder, SlabRule, Speer1985Options};
use rayset_scene::SphereSize;

use crate::{Conditions, Cost, Counting};

/// Conditions with a name, and what percentage and cost mean under them: all that Table 1 does not say.
#[derive(Clone, Debug, PartialEq)]
pub struct Preset {
    /// The name.
    pub name: &'static str,
    /// Reading, scenes, resolution, and order of pixels.
    pub conditions: Conditions,
    /// What "percent rays coherent" counts.
    pub counting: Counting,
    /// What work costs; its constants were fitted to the paper's ratios, so they are no finding.
    pub cost: Cost,
    /// The seeds by which all of this was chosen: only others can tell whether it is near by chance.
    pub chosen_by: RangeInclusive<u64>,
}

impl Preset {
    /// The nearest to the paper that was found, in percentages and in ratios at once.
    ///
    /// Its percentages are within 5 points of the paper's. Its ratios are within 0.05 only with the fitted cost, and only
    /// with the seeds it was chosen by. It is no claim about what the authors did.
    ///
    /// Source: the study [`Table1Explained`](crate::StudyName::Table1Explained), "nearest in both".
    #[must_use]
    pub fn nearest() -> Self {
        Self {
            name: "speer-1985-nearest",
            conditions: Conditions {
                reading: Speer1985Options {
                    misses: MissRule::Cylinder,
                    slab: SlabRule::Inside,
                    ..Speer1985Options::default()
                },
                order: PixelOrder::Serpentine,
                resolution: 64,
                size: SphereSize::Coverage(0.2),
                ..Conditions::default()
            },
            counting: Counting::ALL_CAST,
            cost: Cost { k: 12.0, lambda_over_k: 4.0, pierce: 2.0, alpha: 24.0 },
            chosen_by: 1..=8,
        }
    }
}
