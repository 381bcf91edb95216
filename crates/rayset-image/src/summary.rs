//! Images as short stable texts, for snapshots a reviewer can read.

use std::{fmt::Write as _, ops::Range};

use crate::{Image, Samples};

impl Image {
    /// A text of the size and, for each channel in canonical order, its range and block means.
    ///
    /// A float channel has the count of its non-finite samples, then minimum, maximum and the means of a grid of
    /// blocks, all over its finite samples and to 4 decimals; `-` stands where there is no finite sample.
    /// An integer channel has minimum, maximum and the count of distinct values.
    ///
    /// The grid has `columns` by `rows` blocks, at least one and at most one a pixel. Block `i` of `n` covers the
    /// pixels from `floor(i size / n)` to before `floor((i + 1) size / n)`, so the sizes of blocks differ by one
    /// pixel at most and remainders are spread evenly. Means are sums in `f64` from the top left, row by row.
    ///
    /// Attributes are left out, since a new version would change every snapshot.
    #[must_use]
    pub fn summary(&self, columns: u32, rows: u32) -> String {
        let (width, height) = (self.width(), self.height());
        let mut text = format!("{width} x {height} pixels, {} channels\n", self.channels().len());
        for channel in self.channels() {
            let name = channel.name();
            // Writing to a string cannot fail.
            let _ = match channel.samples() {
                Samples::F32(samples) => {
                    let finite = || samples.iter().copied().filter(|sample| sample.is_finite());
                    let (minimum, maximum) =
                        (finite().min_by(f32::total_cmp), finite().max_by(f32::total_cmp));
                    writeln!(
                        text,
                        "{name}: {} non-finite, minimum {}, maximum {}",
                        samples.len() - finite().count(),
                        decimals(minimum.map(f64::from)),
                        decimals(maximum.map(f64::from)),
                    )
                    .and_then(|()| write_grid(&mut text, samples, (width, height), (columns, rows)))
                }
                Samples::U32(samples) => {
                    let mut distinct = samples.clone();
                    distinct.sort_unstable();
                    distinct.dedup();
                    let (minimum, maximum) = (distinct[0], distinct[distinct.len() - 1]);
                    let distinct = distinct.len();
                    writeln!(text, "{name}: minimum {minimum}, maximum {maximum}, {distinct} distinct")
                }
            };
        }
        text
    }
}

fn write_grid(
    text: &mut String,
    samples: &[f32],
    (width, height): (u32, u32),
    (columns, rows): (u32, u32),
) -> std::fmt::Result {
    for rows in blocks(height, rows) {
        for columns in blocks(width, columns) {
            let (mut sum, mut count) = (0.0, 0_u32);
            for y in rows.clone() {
                let row = &samples[y * width as usize..][columns.clone()];
                for &sample in row.iter().filter(|sample| sample.is_finite()) {
                    sum += f64::from(sample);
                    count += 1;
                }
            }
            let mean = (count > 0).then(|| sum / f64::from(count));
            write!(text, " {:>9}", decimals(mean))?;
        }
        writeln!(text)?;
    }
    Ok(())
}

/// Cuts `0..size` into `count` ranges, at least one and at most one a pixel.
fn blocks(size: u32, count: u32) -> impl Iterator<Item = Range<usize>> {
    let count = count.clamp(1, size);
    // Both factors are at most 65535, so the product fits.
    let edge = move |number: u32| (number * size / count) as usize;
    (0..count).map(move |number| edge(number)..edge(number + 1))
}

/// A value to 4 decimals; zero has no sign.
fn decimals(value: Option<f64>) -> String {
    match value.map(|value| format!("{value:.4}")) {
        None => "-".to_owned(),
        Some(text) if text == "-0.0000" => "0.0000".to_owned(),
        Some(text) => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_spread_the_remainder_evenly() {
        let cut = |size, count| blocks(size, count).map(|block| block.len()).collect::<Vec<usize>>();
        assert_eq!(cut(10, 4), [2, 3, 2, 3]);
        assert_eq!(cut(8, 4), [2, 2, 2, 2]);
        assert_eq!(cut(3, 8), [1, 1, 1]);
        assert_eq!(cut(3, 0), [3]);
        assert_eq!(cut(65_535, 65_535).iter().sum::<usize>(), 65_535);
    }

    #[test]
    fn a_worked_summary() {
        // Blocks are the columns 0 and 1, 2; means 1, (2 + 3) / 2, 4, and of -1 and an infinity -1.
        let mut image = Image::new(3, 2).unwrap();
        image.push_f32("R", vec![1.0, 2.0, 3.0, 4.0, -1.0, f32::INFINITY]).unwrap();
        image.push_f32("lost", vec![f32::NAN; 6]).unwrap();
        image.push_f32("tiny", vec![-1e-9; 6]).unwrap();
        image.push_u32("object", vec![7, 7, 2, 9, 2, 7]).unwrap();
        assert_eq!(
            image.summary(2, 2),
            "3 x 2 pixels, 4 channels\n\
             R: 1 non-finite, minimum -1.0000, maximum 4.0000\n    \
             1.0000    2.5000\n    \
             4.0000   -1.0000\n\
             lost: 6 non-finite, minimum -, maximum -\n         \
             -         -\n         \
             -         -\n\
             object: minimum 2, maximum 9, 3 distinct\n\
             tiny: 0 non-finite, minimum 0.0000, maximum 0.0000\n    \
             0.0000    0.0000\n    \
             0.0000    0.0000\n"
        );
    }
}
