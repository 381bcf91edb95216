//! The experiment as text.

use std::fmt::Write as _;

use rayset_engine::RenderOptions;

use super::Column;
use super::results::{Fitted, Misses, ModelReport, PresetReport, Row, StrategyRow, Table1};
use crate::measures::{POINTS, RATIO};

const SPEER: &str = "speer-1985";

impl Table1 {
    /// The whole report in Markdown: both tables, the model, and what they say.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = String::new();
        self.write_spheres(&mut text);
        self.write_meshes(&mut text);
        self.write_exact(&mut text);
        self.write_rays(&mut text);
        self.write_model(&mut text);
        self.write_cylinders(&mut text);
        self.write_options(&mut text);
        text
    }

    fn write_spheres(&self, text: &mut String) {
        line(text, "## Table 1: spheres\n");
        line(
            text,
            "Times are seconds inside the strategy's calls, of one thread; the paper's are hours of a VAX.",
        );
        line(text, "In brackets: the quartiles of all pairs of runs, or of all seeds.\n");
        line(
            text,
            "| n | | time standard | time coherent | percent coherent | ratio of times | frame | ratio of work | fitted* | wrong pixels |",
        );
        line(text, "|---:|---|---:|---:|---:|---:|---:|---:|---:|---:|");
        for n in self.ours.iter().filter_map(|row| row.spheres) {
            if let Some(paper) = self.paper.iter().find(|paper| paper.spheres == n) {
                let _ = writeln!(
                    text,
                    "| {n} | paper | {:.3} h | {:.3} h | {:.1} % | {:.3}, recomputed {:.3} | | | | |",
                    paper.hours_standard,
                    paper.hours_coherent,
                    paper.percent_coherent,
                    paper.ratio_printed,
                    paper.ratio_recomputed
                );
            }
            for column in self.columns() {
                if let Some((row, measured)) = column.of_spheres(n) {
                    write_row(text, &n.to_string(), row, column.name, measured, true);
                }
            }
        }
        line(text, "");
        for column in self.columns() {
            let [percent, time, work] = self.distance_from_the_paper(column);
            let _ = writeln!(
                text,
                "`{}` is at most {percent:.1} points of coherence from the paper, {time:.2} from the ratio of its times in time and {work:.2} in work.",
                column.name
            );
        }
        line(text, "");
        for preset in &self.presets {
            write_preset(text, preset);
        }
    }

    /// The greatest differences over all rows: of coherence in points, and of the ratios of time and of work from the
    /// recomputed ratio.
    fn distance_from_the_paper(&self, column: Column<'_>) -> [f64; 3] {
        let mut greatest = [0.0_f64; 3];
        for paper in &self.paper {
            let Some((_, ours)) = column.of_spheres(paper.spheres) else { continue };
            let differences = [
                ours.percent_coherent - paper.percent_coherent,
                ours.ratio_time - paper.ratio_recomputed,
                ours.ratio_work - paper.ratio_recomputed,
            ];
            for (greatest, difference) in greatest.iter_mut().zip(differences) {
                *greatest = greatest.max(difference.abs());
            }
        }
        greatest
    }

    fn write_meshes(&self, text: &mut String) {
        let mut meshes = self.ours.iter().filter(|row| row.spheres.is_none()).peekable();
        if meshes.peek().is_none() {
            return;
        }
        line(text, "## Table 2: meshes\n");
        line(
            text,
            "n is the number of bounding volumes: groups of triangles under a bounding sphere, as in the paper; in a scene named `split`, the same groups split spatially so that no volume holds more triangles than the number says.\n",
        );
        line(
            text,
            "| scene, n | | time standard | time coherent | percent coherent | ratio of times | frame | ratio of work | wrong pixels |",
        );
        line(text, "|---|---|---:|---:|---:|---:|---:|---:|---:|");
        for row in meshes {
            let name = format!("{}, {} ({} triangles)", row.scene, row.volumes, row.primitives);
            for (reading, measured) in readings(row) {
                write_row(text, &name, row, reading, measured, false);
            }
        }
        line(text, "");
    }

    /// What exact strategies took on the same scenes.
    fn write_exact(&self, text: &mut String) {
        if self.ours.iter().all(|row| row.exact.is_empty()) {
            return;
        }
        line(text, "## The same scenes, exactly\n");
        line(
            text,
            "The exact strategies took their turns in the same runs, on lanes of the same kind. Work counts every lane of a test, of boxes too.\n",
        );
        line(
            text,
            "| scene | | time standard | time | ratio of times | frame | ratio of work | wrong pixels |",
        );
        line(text, "|---|---|---:|---:|---:|---:|---:|---:|");
        for row in &self.ours {
            for (name, exact) in &row.exact {
                let _ = writeln!(
                    text,
                    "| {} | `{name}` | {:.4} s | {:.4} s | {:.3} ({:.3} to {:.3}) | {:.3} | {:.3} | {} |",
                    row.scene,
                    row.strategies["standard"].seconds,
                    exact.seconds,
                    exact.ratio_time.median,
                    exact.ratio_time.lower_quartile,
                    exact.ratio_time.upper_quartile,
                    exact.ratio_time_frame.median,
                    exact.ratio_work,
                    exact.wrong_pixels
                );
            }
        }
        line(text, "");
    }

    fn write_rays(&self, text: &mut String) {
        line(text, "## What became of the rays\n");
        line(text, "Over all seeds.");
        line(
            text,
            "A light ray hits when it is blocked; none is cast where the surface faces away from the light.\n",
        );
        line(
            text,
            "| scene | reading | kind | cast | hit | guided | missed the prediction | pierced | of these intercepted (Figure 2) | coherent | wrong |",
        );
        line(text, "|---|---|---|---:|---:|---:|---:|---:|---:|---:|---:|");
        for (row, reading, measured) in
            self.rows().flat_map(|row| readings(row).map(move |(n, m)| (row, n, m)))
        {
            for kind in ["initial", "reflected", "refracted", "shadow"] {
                let k = measured.kinds[kind];
                let _ = writeln!(
                    text,
                    "| {} | `{reading}` | {kind} | {} | {} | {} | {} | {} | {} | {} | {} |",
                    row.scene,
                    k.cast,
                    k.hit,
                    k.guided,
                    k.predicted_missed,
                    k.pierced,
                    k.false_coherence,
                    k.coherent,
                    k.wrong
                );
            }
        }
        line(text, "");
    }

    fn write_model(&self, text: &mut String) {
        line(text, "## Section 3: does the cost model predict this?\n");
        for column in self.columns() {
            if let Some(model) = self.models.get(column.name) {
                write_model_of(text, column, model);
            }
        }
        let model = &self.model;
        let _ = writeln!(
            text,
            "Fitted to the paper's own table, the model leaves a root mean square error of {:.3} (alpha/k = {:.2}, lambda/k = {:.2}); what it should explain, the distance of the ratios from 1, is {:.3}.",
            model.paper_rms_error,
            model.paper_alpha_over_k,
            model.paper_lambda_over_k,
            model.paper_rms_effect
        );
        let _ = writeln!(
            text,
            "The paper derives k/lambda = {:.3} from its last row, and calls it k/alpha.\n",
            model.paper_k_over_lambda
        );
    }

    fn write_cylinders(&self, text: &mut String) {
        line(text, "## Do cylinders shrink as objects become more?\n");
        line(text, "Medians in units of the scene's extent, over all cylinders built.\n");
        line(text, "| scene | reading | median radius | without bound | median length |");
        line(text, "|---|---|---:|---:|---:|");
        let number =
            |value: Option<f64>| value.map_or_else(|| "unbounded".to_owned(), |value| format!("{value:.3}"));
        for (row, reading, speer) in self.rows().flat_map(|row| readings(row).map(move |(n, m)| (row, n, m)))
        {
            let _ = writeln!(
                text,
                "| {} | `{reading}` | {} | {:.1} % | {} |",
                row.scene,
                number(speer.median_radius),
                100.0 * speer.unbounded_radii,
                number(speer.median_length)
            );
        }
        line(text, "");
        let shrinks = |column: Column<'_>, value: &dyn Fn(&StrategyRow) -> Option<f64>| {
            let values = column.spheres().map(|(_, measured)| value(measured).unwrap_or(f64::INFINITY));
            values.collect::<Vec<_>>().windows(2).all(|pair| pair[1] <= pair[0])
        };
        let verdict = |shrinks: bool| if shrinks { "held" } else { "failed" };
        line(
            text,
            "The paper says that both shrink (section 4); that holds if no row is above the one before.",
        );
        for column in self.columns() {
            let _ = writeln!(
                text,
                "For these spheres, `{}`: radius {}, length {}.",
                column.name,
                verdict(shrinks(column, &|measured| measured.median_radius)),
                verdict(shrinks(column, &|measured| measured.median_length)),
            );
        }
        line(text, "");
    }

    fn write_options(&self, text: &mut String) {
        let options = &self.options;
        line(text, "## How it was run\n");
        let cutoff = options.cutoff.map_or_else(|| "off".to_owned(), |cutoff| format!("{cutoff:.6}"));
        let _ = writeln!(
            text,
            "Spheres at {0} x {0} pixels, seeds {1} to {2}, {3} repetitions; meshes {4} repetitions; depth {5}, adaptive cut-off {cutoff}, {6} order, one sweep an image, `{7}` lanes for both strategies.",
            options.resolution,
            options.seeds.first().copied().unwrap_or_default(),
            options.seeds.last().copied().unwrap_or_default(),
            options.repetitions,
            options.mesh_repetitions,
            options.max_depth,
            options.order,
            options.backend
        );
        line(text, "The strategies take turns, and use the same kernels.");
        line(
            text,
            "Work is primitive tests, volumes classified, radius comparisons, and two for each pierce check.\n",
        );
        for (reading, choices) in &options.readings {
            let choices: Vec<_> =
                choices.iter().map(|(option, choice)| format!("{option} = {choice}")).collect();
            let _ = writeln!(text, "`{reading}` reads section 2.3 with {}.\n", choices.join(", "));
        }
        for preset in &self.presets {
            let levels: Vec<_> =
                preset.conditions.iter().map(|(name, level)| format!("{name} = {level}")).collect();
            let _ = writeln!(
                text,
                "`{}` has the same seeds, repetitions of spheres and lanes, depth {}, and else its own {}.\n",
                preset.name,
                RenderOptions::default().max_depth,
                levels.join(", ")
            );
        }
    }

    /// The sphere rows in short, for a README: coherence, ratios and wrong pixels beside the paper's.
    #[must_use]
    pub fn summary(&self) -> String {
        let mut text = String::new();
        line(&mut text, "| n | | percent coherent | ratio of times | ratio of work | wrong pixels |");
        line(&mut text, "|---:|---|---:|---:|---:|---:|");
        for paper in &self.paper {
            let n = paper.spheres;
            let (percent, printed, recomputed) =
                (paper.percent_coherent, paper.ratio_printed, paper.ratio_recomputed);
            let _ = writeln!(
                text,
                "| {n} | paper | {percent:.1} | {printed:.3}; {recomputed:.3} from its times | | |"
            );
            for column in self.columns() {
                let Some((_, speer)) = column.of_spheres(n) else { continue };
                let fitted =
                    speer.fitted.map_or_else(String::new, |fitted| format!("; {:.2} fitted", fitted.ratio));
                let _ = writeln!(
                    text,
                    "| {n} | `{}` | {:.1} | {:.2} | {:.2}{fitted} | {} |",
                    column.name,
                    speer.percent_coherent,
                    speer.ratio_time,
                    speer.ratio_work,
                    speer.wrong_pixels
                );
            }
        }
        text
    }
}

/// Writes the line of a column; `has_fitted` if there is a place for the ratio in a fitted cost.
fn write_row(
    text: &mut String,
    name: &str,
    row: &Row,
    column: &str,
    measured: &StrategyRow,
    has_fitted: bool,
) {
    let (percents, ratios) = (&measured.percent_coherent_spread, &measured.ratio_time_spread);
    let fitted = match &measured.fitted {
        Some(Fitted { ratio, spread }) => {
            format!(" {ratio:.3}* ({:.3} to {:.3}) |", spread.lower_quartile, spread.upper_quartile)
        }
        None if has_fitted => " |".to_owned(),
        None => String::new(),
    };
    let _ = writeln!(
        text,
        "| {name} | `{column}` | {:.4} s | {:.4} s | {:.1} % ({:.1} to {:.1}) | {:.3} ({:.3} to {:.3}) | {:.3} | {:.3} |{fitted} {} of {} |",
        row.strategies["standard"].seconds,
        measured.seconds,
        measured.percent_coherent,
        percents.lower_quartile,
        percents.upper_quartile,
        measured.ratio_time,
        ratios.lower_quartile,
        ratios.upper_quartile,
        measured.ratio_time_frame,
        measured.ratio_work,
        measured.wrong_pixels,
        u64::from(row.resolution) * u64::from(row.resolution) * row.seeds as u64
    );
}

/// Writes what a preset is, by how much it misses, and what its fitted ratios are worth.
fn write_preset(text: &mut String, preset: &PresetReport) {
    let PresetReport { name, differences, counting, cost, .. } = preset;
    let _ = writeln!(
        text,
        "`{name}` is the nearest to the paper that `cargo xtask study table1-explained` found, in coherence and fitted ratios at once; it was searched for, and is no claim about what the authors did.\nIt differs from `{SPEER}` in {differences}, so its scenes and images are not those of the lines above it, and `standard` has other times there; its percentages are of {counting}."
    );
    for misses in &preset.misses {
        write_misses(text, misses);
    }
    let _ = writeln!(
        text,
        "\n\\* Work over that of `standard` where a test of a primitive costs 1, a pierce check {}, classifying a volume k = {}, looking at a member of N lambda = {}, and each ray alpha = {}.\nThe last three were fitted to the paper's four ratios: that these come near is no finding.\n",
        cost.pierce,
        cost.k,
        cost.k * cost.lambda_over_k,
        cost.alpha
    );
}

fn write_misses(text: &mut String, misses: &Misses) {
    let Misses { seeds, chosen, points, ratio_fitted, ratio_tests } = misses;
    let verdict = |is_within: bool| if is_within { "within" } else { "not within" };
    let [percent, ratio] = misses.are_within_bounds().map(verdict);
    let whose = if *chosen { "the seeds it was chosen by" } else { "other seeds" };
    let _ = writeln!(
        text,
        "Medians over {whose} ({}) miss the paper by at most {points:.1} points of coherence ({percent} the {POINTS} asked for), {ratio_fitted:.3} of the ratio in fitted cost ({ratio} the {RATIO} asked for), and {ratio_tests:.2} of the ratio in tests.",
        seeds.len()
    );
}

/// What section 3 predicts for the spheres of a column.
fn write_model_of(text: &mut String, column: Column<'_>, model: &ModelReport) {
    let _ = writeln!(
        text,
        "`{}`, fitted to its sphere rows: k = {:.2} ns, lambda = {:.2} ns, alpha = {:.1} ns a ray, so k/lambda = {:.3} and C_T = 1 / (1 + k/lambda) = {:.1} %.\n",
        column.name,
        1e9 * model.k,
        1e9 * model.lambda,
        1e9 * model.alpha,
        model.k / model.lambda,
        100.0 * model.threshold
    );
    line(text, "| n | coherence | C_T says | ratio predicted | ratio measured |");
    line(text, "|---:|---:|---|---:|---:|");
    for (i, (row, measured)) in column.spheres().enumerate() {
        let coherence = measured.percent_coherent;
        let says = if coherence / 100.0 > model.threshold { "coherent wins" } else { "standard wins" };
        let _ = writeln!(
            text,
            "| {} | {coherence:.1} % | {says} | {:.3} | {:.3} |",
            row.volumes, model.predicted_ratio[i], model.measured_ratio[i]
        );
    }
    let verdict = if model.predicts { "predicts" } else { "does not predict" };
    let decides = if model.threshold_decides { "tells rightly" } else { "does not tell rightly" };
    let _ = writeln!(
        text,
        "\nSection 3, with its own three constants fitted, {verdict} the measured ratios to within their quartiles: the root mean square error is {:.3}.\nThe threshold alone {decides} which algorithm wins in each row.\n",
        model.rms_error
    );
}

/// The strategies of a row besides `standard`.
fn readings(row: &Row) -> impl Iterator<Item = (&String, &StrategyRow)> {
    row.strategies.iter().filter(|(name, _)| *name != "standard")
}

fn line(text: &mut String, line: &str) {
    text.push_str(line);
    text.push('\n');
}
