//! What the retained intersection tree knows of a ray.

use std::collections::HashMap;

use rayset_geometry::Cylinder;
use rayset_scene::VolumeId;

use crate::{Originating, RaySetIndex};

/// A node of the retained tree: a cylinder, and what the formative ray met.
#[derive(Clone, Copy, Debug)]
pub(super) struct Retained {
    /// The last ray-set that built it or was served by it: it guides the next one only.
    pub(super) ray_set: RaySetIndex,
    /// What the formative ray left.
    pub(super) originating: Option<Originating>,
    /// The container.
    pub(super) zone: Cylinder,
    /// The volume whose contents were hit; `None` if nothing was.
    pub(super) predicted: Option<VolumeId>,
}

/// The retained tree: an entry for every slot, or every pair of slot and light, that was ever used.
#[derive(Debug, Default)]
pub(super) struct RetainedTree {
    near: Vec<Option<Retained>>,
    far: HashMap<u64, Retained>,
}

/// Entries below this number are found by index, those above by hashing: a deep tree must not take memory for all
/// the slots it could have.
const N_NEAR: u64 = 1 << 12;

impl RetainedTree {
    #[inline]
    pub(super) fn get(&self, place: u64) -> Option<&Retained> {
        if place < N_NEAR {
            self.near.get(usize::try_from(place).ok()?)?.as_ref()
        } else {
            self.far.get(&place)
        }
    }

    #[inline]
    pub(super) fn get_mut(&mut self, place: u64) -> Option<&mut Retained> {
        if place < N_NEAR {
            self.near.get_mut(usize::try_from(place).ok()?)?.as_mut()
        } else {
            self.far.get_mut(&place)
        }
    }

    /// Retains an entry, or forgets the one there was.
    #[inline]
    pub(super) fn set(&mut self, place: u64, entry: Option<Retained>) {
        if place < N_NEAR {
            let place = usize::try_from(place).expect("a small number");
            if place >= self.near.len() {
                self.near.resize(place + 1, None);
            }
            self.near[place] = entry;
        } else if let Some(entry) = entry {
            self.far.insert(place, entry);
        } else {
            self.far.remove(&place);
        }
    }
}
