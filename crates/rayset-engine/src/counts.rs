//! Counts of rays: the same for every exact strategy, bundle length, pixel order and number of threads.

use std::fmt;
use std::ops::{AddAssign, Index, IndexMut};

use crate::RayKind;

/// Something for each kind of ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ByKind<T> {
    /// For rays from the viewpoint.
    pub initial: T,
    /// For reflected rays.
    pub reflected: T,
    /// For refracted rays.
    pub refracted: T,
    /// For rays towards lights.
    pub shadow: T,
}

/// How many rays of a kind there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct RayTally {
    /// How many were cast; a light ray is cast only where the surface faces the light.
    pub cast: u64,
    /// How many hit something; a light ray hits when something lies between point and light.
    pub hit: u64,
}

/// Counts of rays of every kind.
pub type RayCounts = ByKind<RayTally>;

impl<T> ByKind<T> {
    /// The four values, in the order of [`RayKind::ALL`].
    pub fn iter(&self) -> impl Iterator<Item = (RayKind, &T)> {
        RayKind::ALL.into_iter().zip([&self.initial, &self.reflected, &self.refracted, &self.shadow])
    }
}

impl<T: Copy + Default + AddAssign> ByKind<T> {
    /// The sum over all kinds.
    #[must_use]
    pub fn total(&self) -> T {
        let mut total = T::default();
        for (_, value) in self.iter() {
            total += *value;
        }
        total
    }
}

impl<T> Index<RayKind> for ByKind<T> {
    type Output = T;

    fn index(&self, kind: RayKind) -> &T {
        match kind {
            RayKind::Initial => &self.initial,
            RayKind::Reflected => &self.reflected,
            RayKind::Refracted => &self.refracted,
            RayKind::Shadow => &self.shadow,
        }
    }
}

impl<T> IndexMut<RayKind> for ByKind<T> {
    fn index_mut(&mut self, kind: RayKind) -> &mut T {
        match kind {
            RayKind::Initial => &mut self.initial,
            RayKind::Reflected => &mut self.reflected,
            RayKind::Refracted => &mut self.refracted,
            RayKind::Shadow => &mut self.shadow,
        }
    }
}

impl<T: AddAssign + Copy> AddAssign for ByKind<T> {
    fn add_assign(&mut self, other: Self) {
        for (kind, value) in other.iter() {
            self[kind] += *value;
        }
    }
}

impl AddAssign for RayTally {
    fn add_assign(&mut self, other: Self) {
        self.cast += other.cast;
        self.hit += other.hit;
    }
}

impl fmt::Display for RayCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (kind, tally) in self.iter() {
            writeln!(f, "{:9} rays: {} cast, {} hit", kind.name(), tally.cast, tally.hit)?;
        }
        Ok(())
    }
}
