//! `rayset compare`.

use std::error::Error;
use std::path::{Path, PathBuf};

use rayset::image::{
    Comparison, Image, ImageError, Samples, compare, difference_image, false_colour, read_exr, write_png_rgb8,
};

use crate::Outcome;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rayset compare golden.exr now.exr
  rayset compare --layers beauty,depth golden.exr now.exr
  rayset compare --tolerance 1e-4 --diff differs.png golden.exr now.exr

Two samples differ when their bits do. A picture of R, G and B alone is the layer `beauty`.
The difference image is black where nothing differs, and violet to yellow up to the largest difference elsewhere.")]
pub(crate) struct Options {
    /// What is expected.
    #[arg(value_name = "A.exr")]
    expected: PathBuf,
    /// What there is.
    #[arg(value_name = "B.exr")]
    actual: PathBuf,
    /// The greatest difference of two floats that does not count; without it every bit does.
    #[arg(long, value_name = "X", default_value_t = 0.0)]
    tolerance: f32,
    /// Compares these layers only: names with commas between them. Without it both images must have the same ones.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    layers: Vec<String>,
    /// Writes an image of where the layers differ.
    #[arg(long, value_name = "FILE.png")]
    diff: Option<PathBuf>,
}

pub(crate) fn run(options: &Options) -> Result<Outcome, Box<dyn Error>> {
    if !(options.tolerance >= 0.0 && options.tolerance.is_finite()) {
        return Err("the tolerance is negative or not a number".into());
    }
    let expected = options.read(&options.expected)?;
    let actual = options.read(&options.actual)?;
    let comparison = match compare(&expected, &actual, options.tolerance) {
        Ok(comparison) => comparison,
        // Images that cannot be compared are not equal.
        Err(error) => {
            println!("the images differ: {error}");
            return Ok(Outcome::Differs);
        }
    };
    println!("{:14} {:>12} {:>14} {:>14}  channels", "layer", "pixels", "maximum", "RMSE");
    for layer in expected.layers() {
        let one = |image: &Image| layer_of(image, layer.name);
        let row = row(&one(&expected)?, &one(&actual)?, options.tolerance)?;
        let components: Vec<_> = layer.channels.iter().map(|channel| channel.component()).collect();
        println!("{:14} {row}  {}", layer.name, components.join(" "));
    }
    println!("{:14} {}", "all", figures(&comparison));
    if let Some(path) = &options.diff {
        write_png_rgb8(path, expected.width(), expected.height(), &picture(&expected, &actual)?)?;
    }
    let is_equal =
        if options.tolerance > 0.0 { comparison.is_within_tolerance() } else { comparison.is_identical() };
    if is_equal {
        println!(
            "the images are {}",
            if comparison.is_identical() { "identical" } else { "within the tolerance" }
        );
        return Ok(Outcome::Done);
    }
    println!("the images differ in {} of {} pixels", comparison.differing_pixels, comparison.pixels);
    if let Some(first) = &comparison.first_difference {
        println!(
            "first at ({}, {}) in {}: {} against {}",
            first.x, first.y, first.channel, first.expected, first.actual
        );
    }
    Ok(Outcome::Differs)
}

impl Options {
    /// The layers of a file that are to be compared.
    fn read(&self, path: &Path) -> Result<Image, Box<dyn Error>> {
        let image = with_layers(&read_exr(path)?)?;
        if self.layers.is_empty() {
            return Ok(image);
        }
        let mut chosen = Image::new(image.width(), image.height())?;
        for name in &self.layers {
            let layer = image.layer(name).ok_or_else(|| {
                let known = image.layer_names().join(", ");
                format!("`{}` has no layer `{name}`; it has {known}", path.display())
            })?;
            for channel in layer.channels {
                push(&mut chosen, channel.name().to_owned(), channel.samples())?;
            }
        }
        Ok(chosen)
    }
}

/// The figures of a layer: of counts, their numeric difference; ids have none.
fn row(one: &Image, other: &Image, tolerance: f32) -> Result<String, ImageError> {
    let comparison = compare(one, other, tolerance)?;
    let (mut largest, mut squares, mut n_counts) = (0.0_f64, 0.0_f64, 0_usize);
    for (one, other) in one.channels().iter().zip(other.channels()) {
        if let (Samples::U32(ones), Samples::U32(others)) = (one.samples(), other.samples()) {
            if one.component() == "id" {
                return Ok(format!("{:>12} {:>14} {:>14}", comparison.differing_pixels, "-", "-"));
            }
            for (one, other) in ones.iter().zip(others) {
                let distance = f64::from(one.abs_diff(*other));
                largest = largest.max(distance);
                squares += distance * distance;
                n_counts += 1;
            }
        }
    }
    if n_counts == 0 {
        return Ok(figures(&comparison));
    }
    let rmse = (squares / n_counts as f64).sqrt();
    Ok(format!("{:>12} {largest:>14.6e} {rmse:>14.6e}", comparison.differing_pixels))
}

fn figures(row: &Comparison) -> String {
    format!("{:>12} {:>14.6e} {:>14.6e}", row.differing_pixels, row.max_abs, row.rmse)
}

/// The image with its plain `R`, `G` and `B` named as the layer `beauty`, so that it compares with one of layers.
fn with_layers(image: &Image) -> Result<Image, ImageError> {
    let mut layered = Image::new(image.width(), image.height())?;
    for channel in image.channels() {
        let name = match channel.name() {
            plain @ ("R" | "G" | "B") if image.channel(&format!("beauty.{plain}")).is_none() => {
                format!("beauty.{plain}")
            }
            name => name.to_owned(),
        };
        push(&mut layered, name, channel.samples())?;
    }
    Ok(layered)
}

/// One layer by itself.
fn layer_of(image: &Image, name: &str) -> Result<Image, ImageError> {
    let mut alone = Image::new(image.width(), image.height())?;
    for channel in image.channels().iter().filter(|channel| channel.layer_name() == name) {
        push(&mut alone, channel.name().to_owned(), channel.samples())?;
    }
    Ok(alone)
}

fn push(image: &mut Image, name: String, samples: &Samples) -> Result<(), ImageError> {
    match samples {
        Samples::F32(samples) => image.push_f32(name, samples.clone()),
        Samples::U32(samples) => image.push_u32(name, samples.clone()),
    }
}

/// The largest difference of each pixel over all channels, each against the channel's largest one; black for none.
fn picture(expected: &Image, actual: &Image) -> Result<Vec<[u8; 3]>, ImageError> {
    let difference = difference_image(expected, actual)?;
    let mut largest = vec![0.0_f32; expected.pixels()];
    let finite = |value: f32| if value.is_finite() { value } else { f32::MAX };
    for channel in difference.channels() {
        let distances: Vec<f32> = match channel.samples() {
            Samples::F32(samples) => samples.iter().copied().map(finite).collect(),
            Samples::U32(samples) => {
                samples.iter().map(|&differs| f32::from(u8::from(differs > 0))).collect()
            }
        };
        let scale = distances.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        for (largest, distance) in largest.iter_mut().zip(distances) {
            *largest = largest.max(distance / scale);
        }
    }
    let colours = false_colour(&largest).into_iter().zip(differing(expected, actual));
    Ok(colours.map(|(colour, differs)| if differs { colour } else { [0; 3] }).collect())
}

/// Whether each pixel differs in any bit.
fn differing(expected: &Image, actual: &Image) -> Vec<bool> {
    let mut differs = vec![false; expected.pixels()];
    for (one, other) in expected.channels().iter().zip(actual.channels()) {
        for (pixel, differs) in differs.iter_mut().enumerate() {
            *differs |= match (one.samples(), other.samples()) {
                (Samples::F32(one), Samples::F32(other)) => one[pixel].to_bits() != other[pixel].to_bits(),
                (Samples::U32(one), Samples::U32(other)) => one[pixel] != other[pixel],
                _ => true,
            };
        }
    }
    differs
}
