//! Pictures of some scenes, with a switch between what they show.

mod views;

use maud::{Markup, html};
use rayset_engine::{
    Backend, Frame, IntersectionStrategy, Layer, Layers, RenderOptions, Speer1985, StrategyKind, SweepLength,
    render,
};

use self::views::{View, beauty, coherent, wrong};
use super::provenance::{cutoff, made};
use super::{ReportPlan, Section, Step};
use crate::{NamedScene, Reading, StudyError, cornell_spheres, sphere_scene};

/// A scene with what is shown of it.
struct Gallery {
    name: String,
    what: String,
    side: u32,
    options: RenderOptions,
    strategies: Vec<String>,
    views: Vec<View>,
}

/// The number of spheres and the seed: the last row of Table 1, as its first seed has it.
const SPHERES: (u32, u64) = (8, 1);

/// As in Table 1: what `coherent` takes for worth its while depends on the lanes, and pictures are to be the same everywhere.
const LANES: Backend = Backend::Scalar;

pub(super) fn section(plan: &ReportPlan, step: Step<'_>) -> Result<Section, StudyError> {
    let scenes = [
        (
            sphere_scene(SPHERES.0, SPHERES.1)?,
            format!("{} random spheres of Table 1, seed {}", SPHERES.0, SPHERES.1),
            plan.sides[0],
        ),
        (
            cornell_spheres(&plan.fixtures)?,
            "a mesh, obj/cornell/CornellBox-Sphere.obj of the fixtures".to_owned(),
            plan.sides[1],
        ),
    ];
    let all = scenes.len() * strategies(&scenes[0].0).len();
    let mut done = 0;
    let mut galleries = Vec::new();
    for (scene, what, side) in &scenes {
        galleries.push(gallery(scene, what, *side, &mut || {
            step("pictures", done, all);
            done += 1;
        })?);
    }
    let body = html! {
        p {
            "The same scenes as pictures, rendered for this report. "
            "Coherent fraction: how many of a pixel's rays, light rays included, were answered without looking at all bounding volumes. "
            "Wrong pixels: those whose colour differs in any bit from that of " code { "standard" } "."
        }
        div.galleries { @for (i, gallery) in galleries.iter().enumerate() { (gallery.markup(plan, i)) } }
    };
    Ok(Section { id: "pictures", title: "Pictures", body })
}

/// Every strategy of the engine, `standard` first, and the reading of the text that comes nearest to the paper.
fn strategies(scene: &NamedScene) -> Vec<(String, Box<dyn IntersectionStrategy + '_>)> {
    let of = |kind: &StrategyKind| (kind.name().to_owned(), kind.bind_on(&scene.scene, LANES));
    let mut strategies: Vec<_> = StrategyKind::ALL.iter().map(of).collect();
    strategies.sort_by_key(|(name, _)| name != StrategyKind::Standard.name());
    let Reading { name, options } = Reading::with_misses();
    strategies.push((name, Box::new(Speer1985::on(&scene.scene, LANES, options))));
    strategies
}

fn gallery(scene: &NamedScene, what: &str, side: u32, step: &mut dyn FnMut()) -> Result<Gallery, StudyError> {
    let options = RenderOptions {
        width: side,
        height: side,
        // As in Table 1: retained trees are those of the pixel before, in the order of scanlines.
        sweep: SweepLength::WholeImage,
        layers: Layers::BEAUTY.with(Layer::Coherent),
        ..RenderOptions::default()
    };
    let (mut views, mut names) = (Vec::new(), Vec::new());
    let mut standard: Option<Frame> = None;
    let mut wrongs = Vec::new();
    for (name, strategy) in strategies(scene) {
        step();
        let mut frame = render(strategy.as_ref(), &options)?;
        match &standard {
            None => views.push(beauty(&scene.name, &frame)?),
            Some(standard) if !strategy.is_exact() => {
                frame.mark_wrong(standard);
                wrongs.push(wrong(&scene.name, &name, &frame, standard)?);
            }
            Some(_) => {}
        }
        views.extend(coherent(&scene.name, &name, &frame)?);
        standard.get_or_insert(frame);
        names.push(name);
    }
    views.extend(wrongs);
    Ok(Gallery { name: scene.name.clone(), what: what.to_owned(), side, options, strategies: names, views })
}

impl Gallery {
    fn markup(&self, plan: &ReportPlan, number: usize) -> Markup {
        let id = format!("gallery-{number}");
        let option = |view: usize| format!("{id}-{view}");
        html! {
            section.gallery aria-labelledby=(id) {
                h3 id=(id) { (self.name) }
                // Real radio buttons: arrows choose, and the style alone shows what is chosen. Print shows all.
                fieldset {
                    legend { "Show" }
                    @for (i, view) in self.views.iter().enumerate() {
                        label {
                            input type="radio" name=(id) id=(option(i)) value=(i) checked[i == 0];
                            span { (view.label) }
                        }
                    }
                }
                div.views {
                    @for (i, view) in self.views.iter().enumerate() { (view.markup(i, self.side)) }
                }
                (made(&[
                    ("command", plan.command.clone()),
                    ("scene", format!("{}: {}", self.name, self.what)),
                    ("image", format!("{0} x {0} pixels, one eye ray a pixel, one sweep in scanline order", self.side)),
                    ("depth", self.options.max_depth.to_string()),
                    ("cut-off", cutoff(self.options.cutoff)),
                    ("lanes", LANES.name().to_owned()),
                    ("strategies", self.strategies.join(", ")),
                    ("version", env!("CARGO_PKG_VERSION").to_owned()),
                ]))
            }
        }
    }
}
