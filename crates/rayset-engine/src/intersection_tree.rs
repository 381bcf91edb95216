//! The intersection trees of a bundle of ray-sets.

use rayset_geometry::Side;
use rayset_geometry::glam::DVec3;
use rayset_scene::{LightId, MaterialId};

use crate::{Hit, Slot};

/// A ray of a tree and what it met.
///
/// Source: Speer et al. 1985, section 2.2 (the record of the objects intersected).
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// Which ray-set of the bundle it belongs to, counted from 0.
    pub ray_set: u32,
    /// Its place in the tree.
    pub slot: Slot,
    /// The unit direction of the ray.
    pub direction: DVec3,
    /// Its nearest intersection, and the surface there; `None` if it met nothing.
    pub hit: Option<(Hit, Surface)>,
    /// The greatest share of its intensity that reaches the pixel.
    pub weight: f64,
    /// The ray reflected at the hit.
    pub reflected: Branch,
    /// The ray refracted at the hit.
    pub refracted: Branch,
}

/// The surface at a hit.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// The point, in world space.
    pub point: DVec3,
    /// The unit normal on the side the ray came from.
    pub normal: DVec3,
    /// The unit normal to shade with, on the same side.
    pub shading_normal: DVec3,
    /// The side the ray came from.
    pub side: Side,
    /// How the surface answers light.
    pub material: MaterialId,
}

/// What became of a ray that a surface could send out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Branch {
    /// The surface sends none, or it was cut off.
    #[default]
    None,
    /// The surface reflects totally; the reflected ray carries the refracted share too.
    TotalReflection,
    /// The index of its node.
    Node(u32),
}

/// How a light stands to a hit point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightState {
    /// The surface faces away: no ray was cast.
    #[default]
    FacesAway,
    /// Something lies between.
    Hidden,
    /// The light shines on the point.
    Visible,
}

/// A light that shines on a hit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lit {
    pub(crate) node: u32,
    pub(crate) light: LightId,
    /// The unit vector towards it.
    pub(crate) direction: DVec3,
}

/// The trees of a bundle of ray-sets, grown level by level; children stand behind their parents.
///
/// The first nodes are the initial rays, one a ray-set, in order.
#[derive(Clone, Debug, Default)]
pub struct IntersectionTrees {
    pub(crate) nodes: Vec<Node>,
    pub(crate) lights: Vec<LightState>,
    /// Those that are visible, in increasing order of lights for each node.
    pub(crate) lit: Vec<Lit>,
    pub(crate) n_lights: usize,
}

impl IntersectionTrees {
    /// All nodes, level by level.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The state of every light at the hit of a node.
    ///
    /// # Panics
    ///
    /// If there is no such node.
    #[must_use]
    pub fn lights_of(&self, node: usize) -> &[LightState] {
        &self.lights[node * self.n_lights..(node + 1) * self.n_lights]
    }
}
