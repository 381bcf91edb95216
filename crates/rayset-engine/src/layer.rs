//! What an image can show besides the scene: the layers of a frame.

use std::fmt;
use std::str::FromStr;

/// A layer of a frame: one or more planes of numbers, one a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u16)]
pub enum Layer {
    /// `beauty.R`, `.G`, `.B`: linear radiance, averaged over the rays of the pixel.
    Beauty,
    /// `depth.Z`: the distance along the initial ray to its hit, in world units; infinite where it hits nothing.
    Depth,
    /// `normal.X`, `.Y`, `.Z`: the unit shading normal at the initial ray's hit, on the side the ray came from; zero
    /// where it hits nothing.
    Normal,
    /// `object.id`: the object the initial ray hits; 2^32 - 1 for none.
    Object,
    /// `primitive.id`: the primitive the initial ray hits; 2^32 - 1 for none.
    Primitive,
    /// `rays.initial`, `.reflected`, `.refracted`, `.shadow`: rays cast for the pixel, by kind.
    Rays,
    /// `volumes.classified`: [`Work::volumes_classified`](crate::Work::volumes_classified) for the pixel's rays.
    Volumes,
    /// `primitives.tested`: [`Work::primitive_tests`](crate::Work::primitive_tests) for the pixel's rays.
    PrimitiveTests,
    /// `pierce.checks`: [`Work::pierce_checks`](crate::Work::pierce_checks) for the pixel's rays.
    PierceChecks,
    /// `coherent.all` and `coherent.level1`, `.level2`, ...: the fraction of the pixel's rays, light rays included,
    /// that were answered without a partition: of all, and of those of each level; NaN where there are none.
    Coherent,
    /// `certificate.radius`: the radius of the safety zone that answered the initial ray, or was built round it, in
    /// world units; 0 if there is none, infinite if nothing bounds it.
    Certificate,
    /// `wrong.1985`: 1 where the colour of `speer-1985` differs in any bit from that of an exact strategy, else 0.
    ///
    /// [`render`](crate::render) leaves it out: it takes a second frame. See [`Frame::mark_wrong`](crate::Frame::mark_wrong).
    Wrong1985,
}

/// A set of layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Layers(u16);

/// The text is not the name of a layer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownLayer {
    name: String,
}

impl Layer {
    /// Every layer.
    pub const ALL: [Self; 12] = [
        Self::Beauty,
        Self::Depth,
        Self::Normal,
        Self::Object,
        Self::Primitive,
        Self::Rays,
        Self::Volumes,
        Self::PrimitiveTests,
        Self::PierceChecks,
        Self::Coherent,
        Self::Certificate,
        Self::Wrong1985,
    ];

    /// The name by which options and channels know it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Beauty => "beauty",
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::Object => "object",
            Self::Primitive => "primitive",
            Self::Rays => "rays",
            Self::Volumes => "volumes",
            Self::PrimitiveTests => "primitives",
            Self::PierceChecks => "pierce",
            Self::Coherent => "coherent",
            Self::Certificate => "certificate",
            Self::Wrong1985 => "wrong",
        }
    }
}

impl Layers {
    /// The image alone.
    pub const BEAUTY: Self = Self(1 << Layer::Beauty as u16);
    /// Every layer.
    pub const ALL: Self = Self((1 << Layer::ALL.len()) - 1);

    /// These layers and another one.
    #[must_use]
    pub const fn with(self, layer: Layer) -> Self {
        Self(self.0 | 1 << layer as u16)
    }

    /// These layers but one.
    #[must_use]
    pub const fn without(self, layer: Layer) -> Self {
        Self(self.0 & !(1 << layer as u16))
    }

    /// Whether a layer is among them.
    #[must_use]
    pub const fn contain(self, layer: Layer) -> bool {
        self.0 & 1 << layer as u16 != 0
    }

    /// Whether the work of every query must be recorded for them.
    #[must_use]
    pub(crate) const fn need_recording(self) -> bool {
        self.contain(Layer::Rays)
            || self.contain(Layer::Volumes)
            || self.contain(Layer::PrimitiveTests)
            || self.contain(Layer::PierceChecks)
            || self.contain(Layer::Coherent)
            || self.contain(Layer::Certificate)
    }

    /// Whether the initial ray's hit must be kept for them.
    #[must_use]
    pub(crate) const fn need_hits(self) -> bool {
        self.contain(Layer::Depth)
            || self.contain(Layer::Normal)
            || self.contain(Layer::Object)
            || self.contain(Layer::Primitive)
    }
}

impl Default for Layers {
    /// The image alone.
    fn default() -> Self {
        Self::BEAUTY
    }
}

impl FromIterator<Layer> for Layers {
    fn from_iter<I: IntoIterator<Item = Layer>>(layers: I) -> Self {
        layers.into_iter().fold(Self(0), Self::with)
    }
}

impl fmt::Display for Layer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Layer {
    type Err = UnknownLayer;

    fn from_str(name: &str) -> Result<Self, UnknownLayer> {
        let named = Self::ALL.into_iter().find(|layer| layer.name() == name);
        named.ok_or_else(|| UnknownLayer { name: name.to_owned() })
    }
}

impl fmt::Display for UnknownLayer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` is no layer; there are", self.name)?;
        for (i, layer) in Layer::ALL.iter().enumerate() {
            write!(f, "{} {layer}", if i == 0 { "" } else { "," })?;
        }
        Ok(())
    }
}

impl std::error::Error for UnknownLayer {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_layer_is_known_by_its_name() {
        for (i, layer) in Layer::ALL.into_iter().enumerate() {
            assert_eq!(layer as usize, i);
            assert_eq!(layer.name().parse(), Ok(layer));
            assert!(Layers::ALL.contain(layer));
            assert!(!Layers::ALL.without(layer).contain(layer));
        }
        assert_eq!(Layer::ALL.into_iter().collect::<Layers>(), Layers::ALL);
        let error = "alpha".parse::<Layer>().unwrap_err().to_string();
        assert!(error.starts_with("`alpha` is no layer; there are beauty, depth"), "{error}");
    }

    #[test]
    fn image_alone_needs_nothing_recorded() {
        assert!(!Layers::BEAUTY.need_recording() && !Layers::BEAUTY.need_hits());
        assert!(Layers::BEAUTY.with(Layer::Depth).need_hits());
        assert!(Layers::BEAUTY.with(Layer::Coherent).need_recording());
    }
}
