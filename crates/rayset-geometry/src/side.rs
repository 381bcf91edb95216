//! The two sides of a surface.

/// A side of a surface.
///
/// The front of a sphere, cylinder or cone is its outside; the front of a triangle or polygon is where its
/// vertices go round counterclockwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// The outside, or the side of the normal.
    Front,
    /// The inside, or the side away from the normal.
    Back,
}

/// From which sides a surface can be hit, by light rays too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Sides {
    /// Only rays that come from the front hit.
    Front,
    /// Only rays that come from the back hit.
    Back,
    /// Rays from either side hit.
    #[default]
    Both,
}

impl Side {
    /// The other side.
    #[must_use]
    #[inline]
    pub fn opposite(self) -> Self {
        match self {
            Self::Front => Self::Back,
            Self::Back => Self::Front,
        }
    }
}

impl Sides {
    /// Whether a ray that comes from `side` can hit.
    #[must_use]
    #[inline]
    pub fn include(self, side: Side) -> bool {
        match self {
            Self::Both => true,
            Self::Front => side == Side::Front,
            Self::Back => side == Side::Back,
        }
    }
}
