//! Intersection trees and ray-sets with pluggable intersection strategies.
//!
//! Whitted's recursion and shading are written once; an [`IntersectionStrategy`] only answers two questions: what
//! does this ray hit first, and is this light hidden. Every exact strategy gives the same image, bit for bit.
//!
//! ```
//! use rayset_engine::{RenderOptions, StrategyKind, render};
//! use rayset_scene::RandomSpheres;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = RandomSpheres { count: 4, ..RandomSpheres::default() }.scene()?;
//! let options = RenderOptions { width: 32, height: 32, ..RenderOptions::default() };
//! let frame = render(StrategyKind::default().bind(&scene).as_ref(), &options)?;
//! assert_eq!(frame.counts.initial.cast, 32 * 32);
//! # Ok(())
//! # }
//! ```

mod counts;
mod film;
mod frame;
mod histogram;
mod intersection_tree;
mod lanes;
mod layer;
mod leaving;
mod lights;
mod order;
mod powers;
mod query;
mod ray_set;
mod render;
mod sampling;
mod shading;
mod spawning;
mod stats;
mod strategies;
mod strategy;
mod surfaces;

pub use counts::{ByKind, RayCounts, RayTally};
pub use frame::{Frame, FrameTimes, Plane, PlaneSamples};
pub use histogram::Histogram;
pub use intersection_tree::{IntersectionTrees, LightState, Node, Surface};
pub use layer::{Layer, Layers, UnknownLayer};
pub use order::{PixelOrder, SweepLength};
pub use query::{
    Answers, Generation, Hit, MAX_DEPTH, Originating, QueryWork, RayKind, RayQuery, RaySetIndex,
    ShadowGeneration, ShadowQuery, Slot,
};
pub use ray_set::{DEPARTURE_MARGIN, RaySets, TreeOptions};
pub use rayset_geometry as geometry;
pub use rayset_scene as scene;
pub use rayset_simd::Backend;
pub use render::{Observer, Progress, RenderError, RenderOptions, render, render_observed};
pub use sampling::{Crop, EyeRays};
pub use shading::{Shading, shade};
pub use stats::{CoherenceCounts, StageCounts, Stats, Work};
#[cfg(feature = "mutations")]
pub use strategies::Condition;
pub use strategies::{
    Auto, BlockerRule, Bundle, Cellular, Coherent, EndPlaneRule, Hierarchical, InheritanceRule, LightRule,
    MatchRule, MissRule, OriginatingRule, SlabRule, Speer1985, Speer1985Options, Standard, StrategyKind,
    UnknownReading, UnknownStrategy,
};
pub use strategy::{IntersectionStrategy, Recording, Tracer};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
