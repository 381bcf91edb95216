//! The strategies by name.

use std::fmt;
use std::str::FromStr;

use rayset_scene::Scene;
use rayset_simd::Backend;

use crate::{
    Auto, Bundle, Cellular, Coherent, Hierarchical, IntersectionStrategy, Speer1985, Speer1985Options,
    Standard,
};

/// A strategy, not yet bound to a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum StrategyKind {
    /// [`Standard`].
    Standard,
    /// [`Speer1985`] with its default options; the one strategy that is not exact.
    Speer1985,
    /// [`Coherent`].
    Coherent,
    /// [`Cellular`].
    Cellular,
    /// [`Hierarchical`].
    Hierarchical,
    /// [`Bundle`].
    Bundle,
    /// [`Auto`]: the default.
    #[default]
    Auto,
}

/// The text is not the name of a strategy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownStrategy {
    name: String,
}

impl StrategyKind {
    /// Every strategy.
    pub const ALL: &[Self] = &[
        Self::Standard,
        Self::Speer1985,
        Self::Coherent,
        Self::Cellular,
        Self::Hierarchical,
        Self::Bundle,
        Self::Auto,
    ];

    /// The name by which options and reports know it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Standard => "standard",
            Self::Speer1985 => "speer-1985",
            Self::Coherent => "coherent",
            Self::Cellular => "cellular",
            Self::Hierarchical => "hierarchical",
            Self::Bundle => "bundle",
            Self::Auto => "auto",
        }
    }

    /// Whether every answer is the least hit; see [`IntersectionStrategy::is_exact`].
    #[must_use]
    pub fn is_exact(self) -> bool {
        match self {
            Self::Standard
            | Self::Coherent
            | Self::Cellular
            | Self::Hierarchical
            | Self::Bundle
            | Self::Auto => true,
            Self::Speer1985 => false,
        }
    }

    /// Binds the strategy to a scene, on the lanes of [`Backend::active`].
    #[must_use]
    pub fn bind(self, scene: &Scene) -> Box<dyn IntersectionStrategy + '_> {
        self.bind_on(scene, Backend::active())
    }

    /// Binds the strategy to a scene, on the lanes of a backend.
    #[must_use]
    pub fn bind_on(self, scene: &Scene, backend: Backend) -> Box<dyn IntersectionStrategy + '_> {
        match self {
            Self::Standard => Box::new(Standard::on(scene, backend)),
            Self::Coherent => Box::new(Coherent::on(scene, backend)),
            Self::Cellular => Box::new(Cellular::on(scene, backend)),
            Self::Hierarchical => Box::new(Hierarchical::on(scene, backend)),
            Self::Bundle => Box::new(Bundle::on(scene, backend)),
            Self::Auto => Box::new(Auto::on(scene, backend)),
            Self::Speer1985 => Box::new(Speer1985::on(scene, backend, Speer1985Options::default())),
        }
    }
}

impl fmt::Display for StrategyKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for StrategyKind {
    type Err = UnknownStrategy;

    fn from_str(name: &str) -> Result<Self, UnknownStrategy> {
        let kind = Self::ALL.iter().copied().find(|kind| kind.name() == name);
        kind.ok_or_else(|| UnknownStrategy { name: name.to_owned() })
    }
}

impl fmt::Display for UnknownStrategy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` is no strategy; there are", self.name)?;
        for (i, kind) in StrategyKind::ALL.iter().enumerate() {
            write!(f, "{} {kind}", if i == 0 { "" } else { "," })?;
        }
        Ok(())
    }
}

impl std::error::Error for UnknownStrategy {}

#[cfg(test)]
mod tests {
    use rayset_scene::SceneBuilder;

    use super::*;

    #[test]
    fn every_strategy_is_known_by_its_name() {
        for &kind in StrategyKind::ALL {
            assert_eq!(kind.name().parse(), Ok(kind));
            let scene = SceneBuilder::new().build().unwrap();
            let bound = kind.bind(&scene);
            assert_eq!((bound.name(), bound.is_exact()), (kind.name(), kind.is_exact()));
        }
        let error = "octree".parse::<StrategyKind>().unwrap_err();
        assert_eq!(
            error.to_string(),
            "`octree` is no strategy; there are standard, speer-1985, coherent, cellular, hierarchical, bundle, auto"
        );
    }
}
