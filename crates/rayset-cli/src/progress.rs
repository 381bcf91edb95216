//! How far a render is: a bar on a terminal, and the place where it hears of Ctrl-C.

use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use rayset::engine::{Frame, IntersectionStrategy, Progress, RenderError, RenderOptions, render_observed};

use crate::interrupt;

/// Renders with a progress bar, until done or interrupted.
pub(crate) fn render(
    title: &'static str,
    strategy: &dyn IntersectionStrategy,
    options: &RenderOptions,
) -> Result<Frame, RenderError> {
    let bar = ProgressBar::new(options.n_ray_sets());
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let rays = std::sync::Arc::new(AtomicU64::new(0));
    let counted = rays.clone();
    let speed = move |state: &ProgressState, out: &mut dyn std::fmt::Write| {
        let rays = counted.load(Ordering::Relaxed) as f64;
        let _ = write!(out, "{:.2} Mrays/s", rays / state.elapsed().as_secs_f64().max(1e-9) / 1e6);
    };
    let style = ProgressStyle::with_template("{prefix:8} {wide_bar} {percent:>3} %  {speed}  {eta} left");
    bar.set_style(style.expect("a valid template").with_key("speed", speed));
    bar.set_prefix(title);
    let outcome = render_observed(strategy, options, &|progress: Progress| {
        rays.fetch_add(progress.rays, Ordering::Relaxed);
        bar.inc(progress.ray_sets);
        if interrupt::is_noted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    bar.finish_and_clear();
    outcome
}
