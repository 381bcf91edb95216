//! Where the initial rays of an image go, and to which pixel each belongs.

use std::ops::Range;

use rayset_geometry::unit_lanes;
use rayset_scene::{Camera, Color};
use rayset_simd::{Backend, Kernel, Lanes, Simd};

use crate::lanes::splat3;
use crate::{Generation, RaySetIndex};

/// Where initial rays pass through the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EyeRays {
    /// Through the middles of a regular grid of `samples` by `samples` cells in every pixel; their mean is its colour.
    Centers {
        /// How many a side; at least 1.
        samples: u32,
    },
    /// Through the corners of the pixels, one more than there are pixels each way; the mean of its four corners is a
    /// pixel's colour, as in the standard scenes' test conditions. What has no mean is that of the upper left one.
    Corners,
}

impl Default for EyeRays {
    /// One ray through the middle of every pixel.
    fn default() -> Self {
        Self::Centers { samples: 1 }
    }
}

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Crop {
    /// The first column.
    pub x: u32,
    /// The first row, from the top.
    pub y: u32,
    /// Columns; at least 1.
    pub width: u32,
    /// Rows; at least 1.
    pub height: u32,
}

/// Makes the rays of some rows of a grid.
#[derive(Clone, Debug)]
pub(crate) struct EyeRayMaker<'c> {
    camera: &'c Camera,
    /// How far to the right the rays of each column go, and up those of each row from the first: see [`Camera::tangents`].
    right: Vec<f64>,
    up: Vec<f64>,
    first_row: u32,
}

impl<'c> EyeRayMaker<'c> {
    pub(crate) fn new(grid: &Grid, camera: &'c Camera, rows: Range<u32>) -> Self {
        let (width, height) = grid.image;
        let columns = 0..u32::try_from(grid.width()).expect("fewer than 2^32 rays");
        let right = |x| camera.tangents(grid.place(x, grid.crop.x), 0.0, width, height).0;
        let up = |y| camera.tangents(0.0, grid.place(y, grid.crop.y), width, height).1;
        Self {
            camera,
            right: columns.map(right).collect(),
            up: rows.clone().map(up).collect(),
            first_row: rows.start,
        }
    }

    /// Fills in the rays at some places of the grid, the ray-sets from `first` on, with the bits of [`Camera::ray`].
    pub(crate) fn fill(
        &self,
        backend: Backend,
        first: RaySetIndex,
        places: &[(u32, u32)],
        rays: &mut Generation,
    ) {
        rays.make_room(places.len());
        backend.run(Aim {
            maker: self,
            places,
            directions: rays.directions.each_mut().map(|column| &mut column[..]),
        });
        for (column, coordinate) in rays.origins.iter_mut().zip(self.camera.viewpoint().to_array()) {
            column[..places.len()].fill(coordinate);
        }
        rays.finish_initial(first, places.len());
    }
}

/// Where rays go from the viewpoint.
struct Aim<'a> {
    maker: &'a EyeRayMaker<'a>,
    places: &'a [(u32, u32)],
    directions: [&'a mut [f64]; 3],
}

impl Kernel for Aim<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { maker, places, directions: [xs, ys, zs] } = self;
        let [forward, right, up] = maker.camera.axes().map(|axis| splat3(simd, axis));
        for (i, places) in places.chunks(S::F64::LANES).enumerate() {
            let place = |lane: usize| places.get(lane).copied().unwrap_or(places[0]);
            let to_right = simd.collect_f64(|lane| maker.right[place(lane).0 as usize]);
            let upwards = simd.collect_f64(|lane| maker.up[(place(lane).1 - maker.first_row) as usize]);
            let mut towards = forward;
            for k in 0..3 {
                towards[k] = forward[k] + to_right * right[k] + upwards * up[k];
            }
            let ([x, y, z], _) = unit_lanes(simd, towards);
            let first = i * S::F64::LANES;
            x.store(&mut xs[first..]);
            y.store(&mut ys[first..]);
            z.store(&mut zs[first..]);
        }
    }
}

/// The grid of initial rays of a crop of an image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    /// The pixels of the whole image.
    pub(crate) image: (u32, u32),
    pub(crate) crop: Crop,
    pub(crate) eye_rays: EyeRays,
}

impl Grid {
    /// Rays across.
    pub(crate) fn width(&self) -> u64 {
        self.along(self.crop.width)
    }

    /// Rays down.
    pub(crate) fn height(&self) -> u64 {
        self.along(self.crop.height)
    }

    fn along(&self, pixels: u32) -> u64 {
        match self.eye_rays {
            EyeRays::Centers { samples } => u64::from(pixels) * u64::from(samples),
            EyeRays::Corners => u64::from(pixels) + 1,
        }
    }

    /// Rows of rays that must stay together: those of one row of pixels.
    pub(crate) fn rows_of_a_pixel(&self) -> u32 {
        match self.eye_rays {
            EyeRays::Centers { samples } => samples,
            EyeRays::Corners => 1,
        }
    }

    /// Where a column or row of rays passes through the image, by the crop's first.
    fn place(&self, ray: u32, first: u32) -> f64 {
        match self.eye_rays {
            EyeRays::Centers { samples } => {
                (f64::from(first) * f64::from(samples) + f64::from(ray) + 0.5) / f64::from(samples)
            }
            EyeRays::Corners => f64::from(first + ray),
        }
    }

    /// The pixel of the crop that counts the ray as its own, and whether it is the pixel's first.
    pub(crate) fn owner(&self, (x, y): (u32, u32)) -> Option<(usize, bool)> {
        let (pixel, is_first) = match self.eye_rays {
            EyeRays::Centers { samples } => {
                ((x / samples, y / samples), x % samples == 0 && y % samples == 0)
            }
            EyeRays::Corners => ((x, y), true),
        };
        let is_inside = pixel.0 < self.crop.width && pixel.1 < self.crop.height;
        is_inside.then(|| (pixel.1 as usize * self.crop.width as usize + pixel.0 as usize, is_first))
    }

    /// The colour of a pixel in a run of whole rows of rays that begins with the pixel's own; rays are added row by
    /// row, whatever the order in which they were traced.
    pub(crate) fn mean(&self, radiance: &[Color], (x, y): (usize, usize)) -> Color {
        let width = usize::try_from(self.width()).expect("fewer than 2^32 rays");
        let (side, stride) = match self.eye_rays {
            EyeRays::Centers { samples: 1 } => return radiance[y * width + x],
            EyeRays::Centers { samples } => (samples as usize, samples as usize),
            EyeRays::Corners => (2, 1),
        };
        let mut sum = Color::ZERO;
        for row in radiance[y * stride * width..].chunks(width).take(side) {
            for color in &row[x * stride..x * stride + side] {
                sum += *color;
            }
        }
        sum / (side * side) as f64
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::float_cmp, reason = "numbers that no rounding touches")]

    use rayset_geometry::glam::DVec3;
    use rayset_geometry::{Ray, Span};

    use super::*;
    use crate::Slot;

    fn grid(eye_rays: EyeRays) -> Grid {
        Grid { image: (8, 6), crop: Crop { x: 2, y: 1, width: 3, height: 2 }, eye_rays }
    }

    fn ray(grid: &Grid, camera: &Camera, place: (u32, u32)) -> Ray {
        let mut rays = Generation::default();
        let maker = EyeRayMaker::new(grid, camera, place.1..place.1 + 1);
        maker.fill(Backend::active(), RaySetIndex(0), &[place], &mut rays);
        rays.query(0).ray
    }

    #[test]
    fn rays_of_a_grid_have_the_bits_of_the_camera() {
        let camera = Camera::new(DVec3::new(0.3, -2.0, 7.0), DVec3::ZERO, DVec3::Y, 37.0).unwrap();
        let whole = Crop { x: 0, y: 0, width: 37, height: 11 };
        let grid = Grid { image: (37, 11), crop: whole, eye_rays: EyeRays::Centers { samples: 3 } };
        let maker = EyeRayMaker::new(&grid, &camera, 6..33);
        let places: Vec<_> = (6..33).flat_map(|y| (0..111).map(move |x| (x, y))).collect();
        for &backend in Backend::available() {
            let mut rays = Generation::default();
            maker.fill(backend, RaySetIndex(5), &places, &mut rays);
            assert_eq!(rays.len(), places.len());
            for (i, &(x, y)) in places.iter().enumerate() {
                let at = |i: u32| (f64::from(i) + 0.5) / 3.0;
                let query = rays.query(i);
                assert_eq!(query.ray, camera.ray(at(x), at(y), 37, 11));
                assert_eq!((query.slot, query.ray_set.0 as usize), (Slot::ROOT, 5 + i));
                assert_eq!((query.span, query.originating), (Span::FORWARD, None));
            }
        }
    }

    #[test]
    fn corners_are_one_more_each_way_and_shared() {
        let corners = grid(EyeRays::Corners);
        assert_eq!((corners.width(), corners.height()), (4, 3));
        let camera = Camera::default();
        assert_eq!(ray(&corners, &camera, (1, 2)), camera.ray(3.0, 3.0, 8, 6));
        assert_eq!(corners.owner((2, 1)), Some((5, true)));
        assert_eq!(corners.owner((3, 1)), None);
        let radiance: Vec<Color> = (0..12).map(|i| DVec3::splat(f64::from(i))).collect();
        assert_eq!(corners.mean(&radiance, (1, 1)).x, f64::from(5 + 6 + 9 + 10) / 4.0);
    }

    #[test]
    fn samples_fill_the_pixel_evenly() {
        let fine = grid(EyeRays::Centers { samples: 2 });
        assert_eq!((fine.width(), fine.height()), (6, 4));
        let camera = Camera::default();
        assert_eq!(ray(&fine, &camera, (1, 2)), camera.ray(2.75, 2.25, 8, 6));
        assert_eq!(fine.owner((3, 2)), Some((4, false)));
        assert_eq!(fine.owner((2, 2)), Some((4, true)));
        let radiance: Vec<Color> = (0..24).map(|i| DVec3::splat(f64::from(i))).collect();
        assert_eq!(fine.mean(&radiance, (2, 1)).x, f64::from(16 + 17 + 22 + 23) / 4.0);
    }

    #[test]
    fn crop_shows_the_rays_of_the_whole_image() {
        let camera = Camera::default();
        assert_eq!(ray(&grid(EyeRays::default()), &camera, (0, 1)), camera.ray(2.5, 2.5, 8, 6));
    }
}
