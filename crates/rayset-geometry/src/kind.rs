//! The shapes by name.

/// The shape of a primitive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum PrimitiveKind {
    /// [`crate::Sphere`].
    Sphere,
    /// [`crate::Triangle`].
    Triangle,
    /// [`crate::Polygon`].
    Polygon,
    /// [`crate::Cone`].
    Cone,
}
