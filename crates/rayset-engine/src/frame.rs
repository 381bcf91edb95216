//! A rendered image, with what it took.

use std::time::Duration;

use crate::{RayCounts, Stats};

/// A rendered image, with what it took.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Linear red, green and blue of every pixel, rows from the top.
    pub beauty: [Vec<f32>; 3],
    /// The planes of the other layers that were asked for.
    pub layers: Vec<Plane>,
    /// Rays by kind; the same for every exact strategy.
    pub counts: RayCounts,
    /// What the strategy counted.
    pub stats: Stats,
    /// How long it took.
    pub times: FrameTimes,
}

/// How long a frame took.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameTimes {
    /// From the first ray to the last pixel, by the clock.
    pub trace: Duration,
    /// Inside the strategy's calls, summed over threads.
    pub strategy: Duration,
}

/// A named plane of numbers, one a pixel, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// The layer, a dot and the component, as OpenEXR names channels; see [`Layer`](crate::Layer).
    pub name: String,
    /// The numbers.
    pub samples: PlaneSamples,
}

/// The numbers of a plane.
#[derive(Clone, Debug, PartialEq)]
pub enum PlaneSamples {
    /// Quantities.
    F32(Vec<f32>),
    /// Counts and ids.
    U32(Vec<u32>),
}

impl PlaneSamples {
    /// How many numbers there are.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::F32(samples) => samples.len(),
            Self::U32(samples) => samples.len(),
        }
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Frame {
    /// All planes: `beauty.R`, `beauty.G`, `beauty.B`, and those of the other layers.
    #[must_use]
    pub fn planes(&self) -> Vec<Plane> {
        let names = ["beauty.R", "beauty.G", "beauty.B"].into_iter().zip(&self.beauty);
        let beauty = names.map(|(name, samples)| Plane {
            name: name.to_owned(),
            samples: PlaneSamples::F32(samples.clone()),
        });
        beauty.chain(self.layers.iter().cloned()).collect()
    }

    /// The counts or ids of a plane, if the frame has it.
    #[must_use]
    pub fn integers(&self, name: &str) -> Option<&[u32]> {
        self.layers.iter().find(|plane| plane.name == name).and_then(|plane| match &plane.samples {
            PlaneSamples::U32(samples) => Some(samples.as_slice()),
            PlaneSamples::F32(_) => None,
        })
    }

    /// The quantities of a plane, if the frame has it.
    #[must_use]
    pub fn floats(&self, name: &str) -> Option<&[f32]> {
        self.layers.iter().find(|plane| plane.name == name).and_then(|plane| match &plane.samples {
            PlaneSamples::F32(samples) => Some(samples.as_slice()),
            PlaneSamples::U32(_) => None,
        })
    }

    /// Whether each pixel differs from another frame's in any bit of its colour.
    fn differs<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = bool> + 'a {
        assert_eq!((self.width, self.height), (other.width, other.height), "frames of one size");
        let bits = |frame: &Self, k: usize, i: usize| frame.beauty[k][i].to_bits();
        (0..self.beauty[0].len()).map(move |i| (0..3).any(|k| bits(self, k, i) != bits(other, k, i)))
    }

    /// How many pixels differ from another frame's in any bit of their colour.
    ///
    /// # Panics
    ///
    /// If the frames differ in size.
    #[must_use]
    pub fn differing_pixels(&self, other: &Self) -> usize {
        self.differs(other).filter(|&differs| differs).count()
    }

    /// Adds the layer [`Layer::Wrong1985`](crate::Layer::Wrong1985), `wrong.1985`: where this frame and one by
    /// `speer-1985` differ, or this one by `speer-1985` and an exact one.
    ///
    /// # Panics
    ///
    /// If the frames differ in size.
    pub fn mark_wrong(&mut self, other: &Self) {
        let samples = PlaneSamples::U32(self.differs(other).map(u32::from).collect());
        self.layers.push(Plane { name: "wrong.1985".to_owned(), samples });
    }
}
