//! The experiment as text and files.

use std::fmt::Write as _;
use std::path::Path;

use rayset::{ChannelNames, image_of};
use rayset_image::{Image, to_srgb8, write_exr, write_false_colour_png, write_png_rgb8};

use super::plot;
use super::results::{ModelReport, Pictures, Row, StrategyRow, Table1};
use crate::{StudyError, write_file};

const SPEER: &str = "speer-1985";

impl Table1 {
    /// The whole report in Markdown: both tables, the model, and what they say.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = String::new();
        self.write_spheres(&mut text);
        self.write_meshes(&mut text);
        self.write_rays(&mut text);
        self.write_model(&mut text);
        self.write_cylinders(&mut text);
        self.write_options(&mut text);
        text
    }

    /// The row with this many spheres.
    fn of_spheres(&self, count: u32) -> Option<&Row> {
        self.ours.iter().find(|row| row.spheres == Some(count))
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
            "| n | | time standard | time coherent | percent coherent | ratio of times | frame | ratio of work | wrong pixels |",
        );
        line(text, "|---:|---|---:|---:|---:|---:|---:|---:|---:|");
        for row in self.ours.iter().filter(|row| row.spheres.is_some()) {
            let n = row.spheres.unwrap_or_default();
            if let Some(paper) = self.paper.iter().find(|paper| paper.spheres == n) {
                let _ = writeln!(
                    text,
                    "| {n} | paper | {:.3} h | {:.3} h | {:.1} % | {:.3}, recomputed {:.3} | | | |",
                    paper.hours_standard,
                    paper.hours_coherent,
                    paper.percent_coherent,
                    paper.ratio_printed,
                    paper.ratio_recomputed
                );
            }
            write_row(text, &n.to_string(), row);
        }
        line(text, "");
        for reading in self.models.keys() {
            let [percent, time, work] = self.distance_from_the_paper(reading);
            let _ = writeln!(
                text,
                "`{reading}` is at most {percent:.1} points of coherence from the paper, {time:.2} from the ratio of its times in time and {work:.2} in work."
            );
        }
        line(text, "");
    }

    /// The greatest differences over all rows: of coherence in points, and of the ratios of time and of work from the
    /// recomputed ratio.
    fn distance_from_the_paper(&self, reading: &str) -> [f64; 3] {
        let mut greatest = [0.0_f64; 3];
        for paper in &self.paper {
            let Some(ours) = self.of_spheres(paper.spheres).and_then(|row| row.strategies.get(reading))
            else {
                continue;
            };
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
            write_row(text, &format!("{}, {} ({} triangles)", row.scene, row.volumes, row.primitives), row);
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
            self.ours.iter().flat_map(|row| readings(row).map(move |(n, m)| (row, n, m)))
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
        for (reading, model) in &self.models {
            self.write_model_of(text, reading, model);
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

    fn write_model_of(&self, text: &mut String, reading: &str, model: &ModelReport) {
        let _ = writeln!(
            text,
            "`{reading}`, fitted to its sphere rows: k = {:.2} ns, lambda = {:.2} ns, alpha = {:.1} ns a ray, so k/lambda = {:.3} and C_T = 1 / (1 + k/lambda) = {:.1} %.\n",
            1e9 * model.k,
            1e9 * model.lambda,
            1e9 * model.alpha,
            model.k / model.lambda,
            100.0 * model.threshold
        );
        line(text, "| n | coherence | C_T says | ratio predicted | ratio measured |");
        line(text, "|---:|---:|---|---:|---:|");
        for (i, row) in self.ours.iter().filter(|row| row.spheres.is_some()).enumerate() {
            let coherence = row.strategies[reading].percent_coherent;
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

    fn write_cylinders(&self, text: &mut String) {
        line(text, "## Do cylinders shrink as objects become more?\n");
        line(text, "Medians in units of the scene's extent, over all cylinders built.\n");
        line(text, "| scene | reading | median radius | without bound | median length |");
        line(text, "|---|---|---:|---:|---:|");
        let number =
            |value: Option<f64>| value.map_or_else(|| "unbounded".to_owned(), |value| format!("{value:.3}"));
        for (row, reading, speer) in
            self.ours.iter().flat_map(|row| readings(row).map(move |(n, m)| (row, n, m)))
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
        let rows: Vec<_> = self.ours.iter().filter(|row| row.spheres.is_some()).collect();
        let shrinks = |value: &dyn Fn(&Row) -> Option<f64>| {
            let values = rows.iter().map(|row| value(row).unwrap_or(f64::INFINITY));
            values.collect::<Vec<_>>().windows(2).all(|pair| pair[1] <= pair[0])
        };
        let verdict = |shrinks: bool| if shrinks { "held" } else { "failed" };
        line(
            text,
            "The paper says that both shrink (section 4); that holds if no row is above the one before.",
        );
        for reading in self.models.keys() {
            let _ = writeln!(
                text,
                "For these spheres, `{reading}`: radius {}, length {}.",
                verdict(shrinks(&|row| row.strategies[reading].median_radius)),
                verdict(shrinks(&|row| row.strategies[reading].median_length)),
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
    }

    /// Writes `table1.md`, `table1.csv`, `table1.json`, `table1.svg` and the images into a folder.
    ///
    /// # Errors
    ///
    /// [`StudyError`] if a file cannot be written; files are whole or not there.
    pub fn write(&self, folder: &Path) -> Result<(), StudyError> {
        let failed = |path: &Path, source: Box<dyn std::error::Error + Send + Sync>| StudyError::Write {
            path: path.into(),
            source,
        };
        let path = folder.join("table1.md");
        write_file(&path, format!("# Table 1, reproduced\n\n{}", self.to_markdown()).as_bytes())?;
        let path = folder.join("table1.json");
        let json = serde_json::to_string_pretty(self).map_err(|error| failed(&path, error.into()))?;
        write_file(&path, json.as_bytes())?;
        let path = folder.join("table1.csv");
        write_file(&path, self.to_csv().map_err(|error| failed(&path, error))?.as_bytes())?;
        let path = folder.join("table1.svg");
        write_file(&path, plot::svg(self).map_err(|error| failed(&path, error))?.as_bytes())?;
        for pictures in &self.pictures {
            write_pictures(folder, pictures, self)?;
        }
        Ok(())
    }

    fn to_csv(&self) -> Result<String, Box<dyn std::error::Error + Send + Sync>> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record([
            "source",
            "scene",
            "spheres",
            "volumes",
            "primitives",
            "strategy",
            "seconds",
            "seconds_frame",
            "percent_coherent",
            "ratio_time",
            "ratio_time_lower_quartile",
            "ratio_time_upper_quartile",
            "ratio_time_frame",
            "work",
            "ratio_work",
            "wrong_pixels",
        ])?;
        for paper in &self.paper {
            for (strategy, hours, coherent, ratio) in [
                ("standard", paper.hours_standard, 0.0, 1.0),
                (SPEER, paper.hours_coherent, paper.percent_coherent, paper.ratio_recomputed),
            ] {
                let (n, seconds) = (paper.spheres.to_string(), hours * 3600.0);
                let scene = format!("spheres-{n}");
                let [seconds, coherent, ratio] = [seconds, coherent, ratio].map(|value| value.to_string());
                let empty = String::new;
                writer.write_record([
                    "paper".to_owned(),
                    scene,
                    n.clone(),
                    n.clone(),
                    n,
                    strategy.to_owned(),
                    seconds,
                    empty(),
                    coherent,
                    ratio,
                    empty(),
                    empty(),
                    empty(),
                    empty(),
                    empty(),
                    empty(),
                ])?;
            }
        }
        for row in &self.ours {
            for (strategy, measured) in &row.strategies {
                writer.write_record([
                    "ours".to_owned(),
                    row.scene.clone(),
                    row.spheres.map(|n| n.to_string()).unwrap_or_default(),
                    row.volumes.to_string(),
                    row.primitives.to_string(),
                    strategy.clone(),
                    measured.seconds.to_string(),
                    measured.seconds_frame.to_string(),
                    measured.percent_coherent.to_string(),
                    measured.ratio_time.to_string(),
                    measured.ratio_time_spread.lower_quartile.to_string(),
                    measured.ratio_time_spread.upper_quartile.to_string(),
                    measured.ratio_time_frame.to_string(),
                    measured.work.to_string(),
                    measured.ratio_work.to_string(),
                    measured.wrong_pixels.to_string(),
                ])?;
            }
        }
        Ok(String::from_utf8(writer.into_inner()?)?)
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
            for (reading, speer) in self.of_spheres(n).into_iter().flat_map(readings) {
                let _ = writeln!(
                    text,
                    "| {n} | `{reading}` | {:.1} | {:.2} | {:.2} | {} |",
                    speer.percent_coherent, speer.ratio_time, speer.ratio_work, speer.wrong_pixels
                );
            }
        }
        text
    }
}

/// Writes a line for each reading of the algorithm.
fn write_row(text: &mut String, name: &str, row: &Row) {
    let standard = &row.strategies["standard"];
    for (reading, speer) in readings(row) {
        let (percents, ratios) = (&speer.percent_coherent_spread, &speer.ratio_time_spread);
        let _ = writeln!(
            text,
            "| {name} | `{reading}` | {:.4} s | {:.4} s | {:.1} % ({:.1} to {:.1}) | {:.3} ({:.3} to {:.3}) | {:.3} | {:.3} | {} of {} |",
            standard.seconds,
            speer.seconds,
            speer.percent_coherent,
            percents.lower_quartile,
            percents.upper_quartile,
            speer.ratio_time,
            ratios.lower_quartile,
            ratios.upper_quartile,
            speer.ratio_time_frame,
            speer.ratio_work,
            speer.wrong_pixels,
            u64::from(row.resolution) * u64::from(row.resolution) * row.seeds as u64
        );
    }
}

/// The strategies of a row besides `standard`.
fn readings(row: &Row) -> impl Iterator<Item = (&String, &StrategyRow)> {
    row.strategies.iter().filter(|(name, _)| *name != "standard")
}

fn line(text: &mut String, line: &str) {
    text.push_str(line);
    text.push('\n');
}

/// Writes, for each strategy, the image as EXR and PNG and a false-colour picture of the coherent fraction of each
/// pixel's rays; and a picture of the pixels that differ from `standard`.
fn write_pictures(folder: &Path, pictures: &Pictures, table: &Table1) -> Result<(), StudyError> {
    let depth = table.options.max_depth.to_string();
    let cutoff = table.options.cutoff.map_or_else(|| "off".to_owned(), |cutoff| cutoff.to_string());
    let mut first: Option<Image> = None;
    for (strategy, frame) in &pictures.frames {
        let provenance = [
            ("scene", pictures.scene.as_str()),
            ("strategy", strategy),
            ("max_depth", &depth),
            ("cutoff", &cutoff),
        ];
        let image = image_of(frame, ChannelNames::Plain, &provenance)?;
        let stem = format!("{}-{strategy}", pictures.scene);
        write_exr(&folder.join(format!("{stem}.exr")), &image)?;
        let path = folder.join(format!("{stem}.png"));
        write_png_rgb8(&path, image.width(), image.height(), &to_srgb8(&image, 0.0)?)?;
        write_false_colour_png(
            &folder.join(format!("{stem}-coherent.png")),
            &image,
            "coherent.all",
            0.0,
            1.0,
        )?;
        match &first {
            None => first = Some(image),
            Some(standard) => {
                let mut wrong = Image::new(image.width(), image.height())?;
                let differs = |name: &str| -> Result<Vec<bool>, StudyError> {
                    let channel = |image: &Image| -> Result<Vec<f32>, StudyError> {
                        Ok(image
                            .channel(name)
                            .map(|c| c.floats().map(<[f32]>::to_vec))
                            .transpose()?
                            .unwrap_or_default())
                    };
                    let pairs = channel(standard)?.into_iter().zip(channel(&image)?);
                    Ok(pairs.map(|(a, b)| a.to_bits() != b.to_bits()).collect())
                };
                let (red, green, blue) = (differs("R")?, differs("G")?, differs("B")?);
                let any = (0..red.len()).map(|i| f32::from(u8::from(red[i] || green[i] || blue[i])));
                wrong.push_f32("wrong", any.collect())?;
                let path = folder.join(format!("{stem}-wrong.png"));
                write_false_colour_png(&path, &wrong, "wrong", 0.0, 1.0)?;
            }
        }
    }
    Ok(())
}
