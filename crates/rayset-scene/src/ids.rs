//! Numbers that name the parts of a scene.

use std::fmt;

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub struct $name(pub u32);

        impl $name {
            /// The number as an index.
            #[must_use]
            #[inline]
            pub fn index(self) -> usize {
                self.0 as usize
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{}", self.0)
            }
        }
    };
}

id!(
    /// An object, in the order in which objects were added.
    ObjectId
);
id!(
    /// A primitive of the whole scene: ordered by object, then by the order within it.
    PrimitiveId
);
id!(
    /// A bounding volume: an object has one or more.
    VolumeId
);
id!(
    /// A light, in the order in which lights were added.
    LightId
);
id!(
    /// A material, in the order in which materials were added.
    MaterialId
);
