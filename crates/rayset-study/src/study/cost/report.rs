//! The models and their errors, as Markdown.

use std::fmt::Write;

use super::models::{FEATURES, Fit, Fits, Prediction};
use crate::study::interval::Median;

pub(super) fn markdown(fits: &Fits) -> String {
    let ((n_fit, fitted), (n_test, tested)) = (fits.n_fitted, fits.n_tested);
    let mut text = format!(
        "Fitted on {fitted} of {n_fit} scenes, tested on {tested} of {n_test} others; times are of one thread with scalar lanes, inside the strategy's calls.\nErrors are of the predicted ratio of times, coherent over standard, as a fraction of the measured one.\n"
    );
    if fits.models.is_empty() {
        return text;
    }
    text += &format!(
        "A time is the least of nine; the nine ratios of a scene are {:.0} % apart in the median, so that much is noise of the machine.\n",
        100.0 * fits.noise
    );
    text += "\n| strategy | model | constants | fitted scenes: median error | worst | other scenes: median error | worst | who wins, told rightly |\n|---|---|---|---:|---:|---:|---:|---:|\n";
    for fit in &fits.models {
        text += &line(fit);
    }
    let heads: Vec<_> = FEATURES.iter().map(|name| format!(" {name} |")).collect();
    text += &format!(
        "\nThe model of counts is a sum with these coefficients, in nanoseconds:\n\n| strategy |{}\n|---|{}\n",
        heads.concat(),
        "---:|".repeat(FEATURES.len()),
    );
    for (name, coefficients) in &fits.coefficients {
        let cells: Vec<_> = coefficients.iter().map(|seconds| format!(" {:.1} |", 1e9 * seconds)).collect();
        writeln!(text, "| {name} |{}", cells.concat()).expect("a string takes everything");
    }
    text
}

fn line(fit: &Fit) -> String {
    let errors = |predictions: &[Prediction]| -> (f64, f64) {
        let errors: Vec<_> = predictions.iter().map(Prediction::error).collect();
        (Median::of(&errors).value, errors.iter().copied().fold(0.0, f64::max))
    };
    let constants = fit.constants.as_ref().map_or_else(
        || "below".to_owned(),
        |section| {
            format!(
                "k = {:.1} ns, lambda = {:.1} ns, alpha = {:.1} ns",
                1e9 * section.k,
                1e9 * section.lambda,
                1e9 * section.alpha
            )
        },
    );
    let right = fit.tested.iter().filter(|prediction| prediction.is_right()).count();
    let ((fit_median, fit_worst), (median, worst)) = (errors(&fit.fitted), errors(&fit.tested));
    format!(
        "| `{}` | {} | {constants} | {:.1} % | {:.1} % | {:.1} % | {:.1} % | {right} of {} |\n",
        fit.strategy,
        fit.model,
        100.0 * fit_median,
        100.0 * fit_worst,
        100.0 * median,
        100.0 * worst,
        fit.tested.len()
    )
}
