//! A second look at a strategy's answers.

use rayset::engine::{
    Backend, Frame, Layers, RayKind, RenderError, RenderOptions, Speer1985, Speer1985Options, Standard,
    StrategyKind,
};
use rayset::scene::Scene;
use serde::Serialize;

use crate::progress;

/// What an audit found.
#[derive(Debug, Serialize)]
pub(crate) struct Audit {
    /// Pixels whose colour differs in any bit from brute force.
    pub(crate) wrong_pixels: usize,
    /// Whether as many rays of every kind were cast and hit as by brute force.
    pub(crate) same_ray_counts: bool,
    /// Answers that brute force contradicts, by kind of ray; only where the strategy may be wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) wrong_answers: Option<WrongAnswers>,
}

#[derive(Debug, Serialize)]
pub(crate) struct WrongAnswers {
    initial: u64,
    reflected: u64,
    refracted: u64,
    shadow: u64,
}

impl Audit {
    /// Whether nothing was found.
    pub(crate) fn is_clean(&self) -> bool {
        self.wrong_pixels == 0 && self.same_ray_counts
    }
}

/// The frame of the standard strategy without lanes: every ray against every volume.
pub(crate) fn brute_force(scene: &Scene, options: &RenderOptions) -> Result<Frame, RenderError> {
    let options = RenderOptions { layers: Layers::BEAUTY, ..*options };
    progress::render("audit", &Standard::on(scene, Backend::Scalar), &options)
}

/// Compares a frame with brute force; where the strategy may be wrong, renders once more and checks every answer.
pub(crate) fn audit(
    scene: &Scene,
    kind: StrategyKind,
    options: &RenderOptions,
    frame: &Frame,
    expected: &Frame,
) -> Result<Audit, RenderError> {
    let wrong_answers = match kind {
        StrategyKind::Speer1985 => {
            let reading = Speer1985Options { audit: true, ..Speer1985Options::default() };
            let audited = Speer1985::on(scene, Backend::active(), reading);
            let options = RenderOptions { layers: Layers::BEAUTY, ..*options };
            let coherence = progress::render("audit", &audited, &options)?.stats.coherence;
            let wrong = |kind: RayKind| coherence[kind].wrong;
            Some(WrongAnswers {
                initial: wrong(RayKind::Initial),
                reflected: wrong(RayKind::Reflected),
                refracted: wrong(RayKind::Refracted),
                shadow: wrong(RayKind::Shadow),
            })
        }
        _ => None,
    };
    Ok(Audit {
        wrong_pixels: frame.differing_pixels(expected),
        same_ray_counts: frame.counts == expected.counts,
        wrong_answers,
    })
}
