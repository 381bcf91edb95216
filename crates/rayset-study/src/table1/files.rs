//! The experiment as files.

use std::path::Path;

use rayset::{ChannelNames, image_of};
use rayset_image::{Image, to_srgb8, write_exr, write_false_colour_png, write_png_rgb8};

use super::plot;
use super::results::{Pictures, Table1};
use crate::{StudyError, write_file};

impl Table1 {
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
            write_pictures(folder, pictures)?;
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
            "resolution",
            "ratio_fitted_cost",
        ])?;
        for paper in &self.paper {
            for (strategy, hours, coherent, ratio) in [
                ("standard", paper.hours_standard, 0.0, 1.0),
                ("speer-1985", paper.hours_coherent, paper.percent_coherent, paper.ratio_recomputed),
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
                    empty(),
                    empty(),
                ])?;
            }
        }
        for row in self.rows() {
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
                    row.resolution.to_string(),
                    measured.fitted.map(|fitted| fitted.ratio.to_string()).unwrap_or_default(),
                ])?;
            }
        }
        Ok(String::from_utf8(writer.into_inner()?)?)
    }
}

/// Writes, for each strategy, the image as EXR and PNG and a false-colour picture of the coherent fraction of each
/// pixel's rays; and a picture of the pixels that differ from `standard`.
fn write_pictures(folder: &Path, pictures: &Pictures) -> Result<(), StudyError> {
    let depth = pictures.options.max_depth.to_string();
    let cutoff = pictures.options.cutoff.map_or_else(|| "off".to_owned(), |cutoff| cutoff.to_string());
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
