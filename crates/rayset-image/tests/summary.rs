//! The text of a summary, as a snapshot.

use rayset_image::Image;

/// A small picture of a lit disc over a gradient, made of exact operations only.
fn disc() -> Image {
    let (width, height) = (48_u8, 36_u8);
    let mut red = Vec::new();
    let mut depth = Vec::new();
    let mut object = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let (across, down) = (f32::from(x) - 23.5, f32::from(y) - 17.5);
            let square = across * across + down * down;
            let hit = square < 144.0;
            red.push(if hit { 1.0 - square / 144.0 } else { f32::from(y) / 64.0 });
            depth.push(if hit { 12.0 - (144.0 - square).sqrt() / 12.0 } else { f32::INFINITY });
            object.push(if hit { 3 } else { 0 });
        }
    }
    let mut image = Image::new(width.into(), height.into()).unwrap();
    image.push_f32("R", red).unwrap();
    image.push_f32("depth", depth).unwrap();
    image.push_u32("object", object).unwrap();
    image
}

#[test]
fn the_summary_of_a_disc() {
    insta::assert_snapshot!(disc().summary(7, 5));
}
