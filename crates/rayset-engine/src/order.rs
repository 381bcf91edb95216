//! The order in which a sweep visits pixels.

use std::ops::Range;

/// An order of the pixels of a band of rows: a permutation of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum PixelOrder {
    /// Row by row, each from left to right: the paper's two nested loops.
    #[default]
    Scanline,
    /// Row by row, odd rows from right to left.
    Serpentine,
    /// Square tiles of this many pixels a side, row by row; inside a tile row by row.
    Tiles(u32),
    /// Such tiles; inside a tile along the Z-order curve: counted from its first pixel, each 4, each 16 and each 64 are a
    /// square, where the tile has its full size and that is a power of two.
    ///
    /// Source: Morton 1966, "A computer oriented geodetic data base and a new technique in file sequencing".
    Morton(u32),
}

/// How much of an image a sweep covers: what a strategy retains never crosses from one sweep to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SweepLength {
    /// A band of rows, rounded up to whole tiles, and pixels; shorter at the end of a large image whose tiles follow a curve.
    Rows(u32),
    /// All of the image, as in the paper; on one thread, therefore.
    WholeImage,
}

impl Default for SweepLength {
    fn default() -> Self {
        Self::Rows(16)
    }
}

impl PixelOrder {
    /// The bands of rows that an image is cut into, from the top; so many rows, those of a pixel, stay together.
    ///
    /// Where tiles follow a curve the last of many bands are shorter: threads take one after the other, and none should be
    /// left with a long one while the others have none.
    pub(crate) fn sweeps(self, height: u32, length: SweepLength, rows_of_a_pixel: u32) -> Vec<Range<u32>> {
        let unit = match self {
            Self::Scanline | Self::Serpentine => 1,
            Self::Tiles(size) | Self::Morton(size) => size.max(1),
        };
        let SweepLength::Rows(rows) = length else { return std::iter::once(0..height).collect() };
        let to_multiple = |rows: u32, unit: u32| rows.max(1).div_ceil(unit).saturating_mul(unit);
        let full = to_multiple(rows, unit);
        let last_bands = full.saturating_mul(4);
        let has_many = matches!(self, Self::Morton(_)) && height > last_bands;
        let (mut bands, mut start) = (Vec::new(), 0);
        while start < height {
            let left = height - start;
            let rows = match left {
                _ if !has_many => full,
                left if left <= full => full / 4,
                left if left <= last_bands => full / 2,
                _ => full,
            };
            let end = start.saturating_add(to_multiple(rows, rows_of_a_pixel.max(1))).min(height);
            bands.push(start..end);
            start = end;
        }
        bands
    }

    /// Appends the pixels `(x, y)` of a band of rows in order.
    pub fn extend_with_pixels(self, pixels: &mut Vec<(u32, u32)>, width: u32, rows: Range<u32>) {
        match self {
            Self::Scanline => pixels.extend(rows.flat_map(|y| (0..width).map(move |x| (x, y)))),
            Self::Serpentine => pixels.extend(
                rows.flat_map(|y| (0..width).map(move |x| (if y % 2 == 0 { x } else { width - 1 - x }, y))),
            ),
            Self::Tiles(size) | Self::Morton(size) => {
                let size = size.max(1);
                // The curve of a tile of full size, which nearly all are.
                let mut whole = Vec::new();
                if matches!(self, Self::Morton(_)) && size <= width && size <= rows.end - rows.start {
                    push_along_curve(&mut whole, (0..size, 0..size));
                }
                for tile_y in rows.clone().step_by(size as usize) {
                    for tile_x in (0..width).step_by(size as usize) {
                        let (end_x, end_y) = (
                            tile_x.saturating_add(size).min(width),
                            tile_y.saturating_add(size).min(rows.end),
                        );
                        let is_whole = end_x - tile_x == size && end_y - tile_y == size;
                        if matches!(self, Self::Morton(_)) && is_whole {
                            pixels.extend(whole.iter().map(|(x, y)| (tile_x + x, tile_y + y)));
                        } else if matches!(self, Self::Morton(_)) {
                            push_along_curve(pixels, (tile_x..end_x, tile_y..end_y));
                        } else {
                            pixels.extend((tile_y..end_y).flat_map(|y| (tile_x..end_x).map(move |x| (x, y))));
                        }
                    }
                }
            }
        }
    }
}

/// Appends the pixels of a rectangle along the Z-order curve of the least square, of a power of two, that holds it.
fn push_along_curve(pixels: &mut Vec<(u32, u32)>, (columns, rows): (Range<u32>, Range<u32>)) {
    let (width, height) = (columns.end - columns.start, rows.end - rows.start);
    if width == 0 || height == 0 {
        return;
    }
    // Squares still to be cut into quarters: corner and side. The last is the next.
    let mut squares = vec![(0, 0, u64::from(width.max(height)).next_power_of_two())];
    while let Some((x, y, side)) = squares.pop() {
        if x >= u64::from(width) || y >= u64::from(height) {
            continue;
        }
        if side == 1 {
            let offset = |first: u32, at: u64| first + u32::try_from(at).expect("it lies in the rectangle");
            pixels.push((offset(columns.start, x), offset(rows.start, y)));
            continue;
        }
        let half = side / 2;
        squares.extend([(half, half), (0, half), (half, 0), (0, 0)].map(|(dx, dy)| (x + dx, y + dy, half)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ORDERS: [PixelOrder; 8] = [
        PixelOrder::Scanline,
        PixelOrder::Serpentine,
        PixelOrder::Tiles(1),
        PixelOrder::Tiles(4),
        PixelOrder::Tiles(0),
        PixelOrder::Morton(4),
        PixelOrder::Morton(5),
        PixelOrder::Morton(u32::MAX),
    ];

    #[test]
    fn every_order_visits_every_pixel_once() {
        for order in ORDERS {
            for length in [SweepLength::Rows(1), SweepLength::Rows(5), SweepLength::WholeImage] {
                let mut pixels = Vec::new();
                for band in order.sweeps(11, length, 1) {
                    order.extend_with_pixels(&mut pixels, 7, band);
                }
                assert_eq!(pixels.len(), 77, "{order:?} {length:?}");
                pixels.sort_unstable();
                pixels.dedup();
                assert_eq!(pixels.len(), 77, "{order:?} {length:?}");
            }
        }
    }

    #[test]
    fn tiles_stay_whole() {
        let bands = PixelOrder::Tiles(4).sweeps(11, SweepLength::Rows(5), 1);
        assert_eq!(bands, [0..8, 8..11]);
        let mut pixels = Vec::new();
        PixelOrder::Tiles(2).extend_with_pixels(&mut pixels, 3, 0..2);
        assert_eq!(pixels, [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (2, 1)]);
    }

    #[test]
    fn bands_are_of_whole_pixels() {
        for order in ORDERS {
            for (rows, samples) in [(1, 3), (5, 3), (16, 7), (u32::MAX, 3)] {
                let bands = order.sweeps(42, SweepLength::Rows(rows), samples);
                assert!(bands.iter().all(|band| band.start % samples == 0), "{order:?}: {bands:?}");
                assert!(bands.first().is_some_and(|band| band.start == 0));
                assert!(bands.windows(2).all(|pair| pair[0].end == pair[1].start));
                assert!(bands.last().is_some_and(|band| band.end == 42));
            }
        }
    }

    #[test]
    fn the_last_bands_along_a_curve_are_shorter() {
        let rows = |height| {
            let bands = PixelOrder::Morton(32).sweeps(height, SweepLength::Rows(16), 1);
            bands.iter().map(|band| band.end - band.start).collect::<Vec<_>>()
        };
        assert_eq!(rows(200), [32, 32, 32, 16, 16, 16, 16, 16, 8, 8, 8]);
        assert_eq!(rows(100), [32, 32, 32, 4]);
    }

    #[test]
    fn the_curve_goes_through_squares() {
        let mut pixels = Vec::new();
        PixelOrder::Morton(4).extend_with_pixels(&mut pixels, 8, 0..4);
        assert_eq!(pixels[..6], [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (3, 0)]);
        for square in pixels.chunks(4) {
            let (x, y) = square[0];
            assert_eq!(square, [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)]);
        }
        assert!(pixels[..16].iter().all(|&(x, _)| x < 4));
    }
}
