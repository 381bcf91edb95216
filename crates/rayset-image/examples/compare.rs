//! Writes two small images that differ in one pixel, reads them back and prints what differs.

#![expect(clippy::print_stdout, reason = "an example shows its result")]

use std::{env, error::Error, fs};

use rayset_image::{Image, compare, difference_image, read_exr, write_exr};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = env::temp_dir().join(format!("rayset-compare-{}", std::process::id()));
    fs::create_dir_all(&folder)?;
    let (expected_path, actual_path) = (folder.join("expected.exr"), folder.join("actual.exr"));
    write_exr(&expected_path, &gradient(0.0)?)?;
    write_exr(&actual_path, &gradient(0.25)?)?;

    let (expected, actual) = (read_exr(&expected_path)?, read_exr(&actual_path)?);
    println!("{}\n", compare(&expected, &actual, 0.001)?);
    println!("{}", difference_image(&expected, &actual)?.summary(4, 3));

    fs::remove_dir_all(&folder)?;
    Ok(())
}

/// A grey ramp of 8 x 6 pixels whose pixel at x = 5, y = 3 is lighter by `spot` in green.
fn gradient(spot: f32) -> Result<Image, Box<dyn Error>> {
    let ramp: Vec<f32> = (0..48_u8).map(|index| f32::from(index) / 47.0).collect();
    let mut green = ramp.clone();
    green[3 * 8 + 5] += spot;
    let mut image = Image::new(8, 6)?;
    image.push_f32("R", ramp.clone())?;
    image.push_f32("G", green)?;
    image.push_f32("B", ramp)?;
    image.push_attribute("scene", "a grey ramp")?;
    Ok(image)
}
