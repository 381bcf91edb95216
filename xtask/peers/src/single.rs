//! Libraries in Rust that trace one ray at a time.

use rayset_study::{Contender, Disagreements, RecordedPart, Worker};

use crate::parts::{Narrow, Place, Said, judge, rays};

/// A library, bound to a scene.
pub(crate) trait Library: Sync {
    /// Its name and mode.
    fn name(&self) -> &'static str;
    /// Its name.
    fn family(&self) -> &'static str;
    /// Seconds it took to build.
    fn build_seconds(&self) -> f64;
    /// Distance and id of the nearest hit.
    fn nearest(&self, ray: &Narrow) -> Option<(f32, u32)>;
    /// Whether anything is hit.
    fn occluded(&self, ray: &Narrow) -> bool;
}

/// A library as a contender.
pub(crate) struct Single<L> {
    pub(crate) library: L,
    pub(crate) extent: f64,
}

impl<L: Library> Contender for Single<L> {
    fn name(&self) -> &str {
        self.library.name()
    }

    fn family(&self) -> &str {
        self.library.family()
    }

    fn is_exact(&self) -> bool {
        false
    }

    fn ready_seconds(&self) -> f64 {
        self.library.build_seconds()
    }

    fn worker(&self) -> Box<dyn Worker + '_> {
        Box::new(Asking { single: self, rays: Vec::new(), hits: Vec::new(), blocked: Vec::new() })
    }
}

/// A thread's rays and answers.
struct Asking<'l, L> {
    single: &'l Single<L>,
    rays: Vec<(Narrow, Place)>,
    hits: Vec<Option<(f32, u32)>>,
    blocked: Vec<bool>,
}

impl<L: Library> Worker for Asking<'_, L> {
    fn load(&mut self, part: &RecordedPart) {
        self.rays = rays(part, self.single.extent);
        self.hits.clear();
        self.blocked.clear();
        self.hits.reserve(self.rays.len());
        self.blocked.reserve(self.rays.len());
    }

    fn trace(&mut self, part: &RecordedPart) {
        let library = &self.single.library;
        match part {
            RecordedPart::Nearest(_) => {
                self.hits.extend(self.rays.iter().map(|(ray, _)| library.nearest(ray)))
            }
            RecordedPart::Shadow(_) => {
                self.blocked.extend(self.rays.iter().map(|(ray, _)| library.occluded(ray)));
            }
        }
    }

    fn compare(&mut self, part: &RecordedPart, disagreements: &mut Disagreements) {
        for (i, (_, place)) in self.rays.iter().enumerate() {
            let said = match part {
                RecordedPart::Nearest(_) => Said::Nearest(self.hits[i]),
                RecordedPart::Shadow(_) => Said::Blocked(self.blocked[i]),
            };
            judge(part, *place, &said, self.single.extent, disagreements);
        }
    }
}
