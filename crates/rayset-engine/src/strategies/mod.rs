//! The intersection strategies.

mod auto;
mod bundle;
mod cellular;
mod coherent;
mod hierarchical;
mod kind;
mod partition;
mod speer_1985;
mod standard;

pub use auto::Auto;
pub use bundle::Bundle;
pub use cellular::Cellular;
pub use coherent::Coherent;
#[cfg(feature = "mutations")]
pub use coherent::Condition;
pub use hierarchical::Hierarchical;
pub use kind::{StrategyKind, UnknownStrategy};
pub use speer_1985::{
    BlockerRule, EndPlaneRule, InheritanceRule, LightRule, MatchRule, MissRule, OriginatingRule, SlabRule,
    Speer1985, Speer1985Options, UnknownReading,
};
pub use standard::Standard;
