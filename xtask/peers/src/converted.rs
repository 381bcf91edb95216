//! Embree as an application asks it that has its rays in columns of double precision: within the clock, rays are
//! narrowed into a packet just before each call, and its answers are read out into columns just after.

use rayset_engine::Generation;
use rayset_study::{Disagreements, RecordedPart, Worker};

use crate::embree::Mode;
use crate::ffi::{Aligned64, Columns, Context, Hits, Packet};
use crate::parts::{Said, floor, judge};

/// A thread's one packet, the rays, near at hand as they are where they were just made, and the answers.
pub(crate) struct Converting<'e, P> {
    mode: &'e Mode,
    context: Context,
    packet: P,
    part: RecordedPart,
    hits: Hits,
    hidden: Vec<bool>,
}

impl<'e, P: Packet> Converting<'e, P> {
    pub(crate) fn new(mode: &'e Mode) -> Self {
        let part = RecordedPart::Nearest(Vec::new());
        let (hits, hidden) = (Hits::default(), Vec::new());
        Self { mode, context: mode.context(), packet: P::EMPTY, part, hits, hidden }
    }

    /// Bundle by bundle; a packet takes neighbours in the columns, of which those of a slot and light stand together.
    #[inline(always)]
    fn ask(&mut self) {
        let Self { mode, context, packet, part, hits, hidden } = self;
        let scene = mode.scene();
        let mut first = 0;
        match part {
            RecordedPart::Nearest(bundles) => {
                for (rays, _) in bundles {
                    let (columns, n) = (columns(rays, mode.extent()), rays.len());
                    let end = first + n;
                    let mut i = 0;
                    while i < n {
                        packet.fill(&columns, i);
                        // SAFETY: the scene was committed and lives as long as the mode; lanes are 0 or -1.
                        unsafe { packet.intersect(valid(n - i), scene, context) };
                        packet.read(hits, first + i..end);
                        i += P::LANES;
                    }
                    first = end;
                }
            }
            RecordedPart::Shadow(bundles) => {
                for (rays, _) in bundles {
                    let (columns, n) = (columns(rays.rays(), mode.extent()), rays.len());
                    let end = first + n;
                    let mut i = 0;
                    while i < n {
                        packet.fill(&columns, i);
                        // SAFETY: as above.
                        unsafe { packet.occluded(valid(n - i), scene, context) };
                        packet.read_hidden(&mut hidden[first + i..end]);
                        i += P::LANES;
                    }
                    first = end;
                }
            }
        }
    }

    /// With the instructions that the machine has, as `-march=native` would compile it.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma")]
    fn ask_avx512(&mut self) {
        self.ask();
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn ask_avx2(&mut self) {
        self.ask();
    }
}

/// Which lanes of a packet hold rays, if some are left.
#[inline(always)]
fn valid(left: usize) -> &'static Aligned64<[i32; 16]> {
    &VALID[if left < 16 { left } else { 16 }]
}

/// By the number of rays.
static VALID: [Aligned64<[i32; 16]>; 17] = {
    let mut valid = [Aligned64([0; 16]); 17];
    let mut n = 0;
    while n < 17 {
        let mut lane = 0;
        while lane < n {
            valid[n].0[lane] = -1;
            lane += 1;
        }
        n += 1;
    }
    valid
};

#[inline(always)]
fn columns(rays: &Generation, extent: f64) -> Columns<'_> {
    let ([ox, oy, oz], [dx, dy, dz], (starts, ends)) = (rays.origins(), rays.directions(), rays.spans());
    let n = rays.len();
    Columns {
        origins: [&ox[..n], &oy[..n], &oz[..n]],
        directions: [&dx[..n], &dy[..n], &dz[..n]],
        spans: [&starts[..n], &ends[..n]],
        floor: floor(rays, extent),
    }
}

impl<P: Packet> Worker for Converting<'_, P> {
    fn load(&mut self, part: &RecordedPart) {
        self.part = part.clone();
        let n = part.rays();
        self.hits.resize(n);
        self.hidden.resize(n, false);
    }

    fn trace(&mut self, _: &RecordedPart) {
        #[cfg(target_arch = "x86_64")]
        {
            let has_avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            let has_avx512 = is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512bw")
                && is_x86_feature_detected!("avx512dq")
                && is_x86_feature_detected!("avx512vl");
            if has_avx2 && has_avx512 {
                // SAFETY: the machine has the instructions.
                return unsafe { self.ask_avx512() };
            }
            if has_avx2 {
                // SAFETY: as above.
                return unsafe { self.ask_avx2() };
            }
        }
        self.ask();
    }

    fn compare(&mut self, part: &RecordedPart, disagreements: &mut Disagreements) {
        let lengths: Vec<usize> = match part {
            RecordedPart::Nearest(bundles) => bundles.iter().map(|(rays, _)| rays.len()).collect(),
            RecordedPart::Shadow(bundles) => bundles.iter().map(|(rays, _)| rays.len()).collect(),
        };
        let places = lengths.into_iter().enumerate().flat_map(|(b, n)| (0..n).map(move |i| (b, i)));
        for (i, place) in places.enumerate() {
            let said = match part {
                RecordedPart::Shadow(_) => Said::Blocked(self.hidden[i]),
                RecordedPart::Nearest(_) => Said::Nearest(self.mode.found(self.hits.get(i))),
            };
            judge(part, place, &said, self.mode.extent(), disagreements);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rayset_engine::geometry::Ray;
    use rayset_engine::scene::glam::DVec3;
    use rayset_engine::{RayQuery, RaySetIndex, Slot};
    use rayset_study::Contender;

    use super::*;
    use crate::embree::{Embree, modes};
    use crate::parts::Parts;

    #[test]
    fn packets_that_are_not_full_are_answered_in_order() {
        let parts = Parts { triangles: Vec::new(), spheres: vec![([0.0, 0.0, 5.0], 1.0, 9)] };
        let embree = Arc::new(Embree::new(&parts, false, 1).unwrap());
        let bundle = |n: u32| {
            let mut rays = Generation::default();
            for i in 0..n {
                // Every third hits.
                let x = if i % 3 == 0 { 0.0 } else { 3.0 };
                let ray = Ray::new(DVec3::new(x, 0.0, 0.0), DVec3::Z);
                let span = rayset_engine::geometry::Span::FORWARD;
                let (ray_set, slot) = (RaySetIndex(i), Slot::ROOT);
                rays.push(&RayQuery { ray_set, slot, originating: None, ray, span });
            }
            (rays, vec![None; n as usize])
        };
        let part = RecordedPart::Nearest(vec![bundle(37), bundle(16), bundle(1)]);
        for mode in modes(&embree, false, 1.0).iter().filter(|mode| mode.name().contains("converted")) {
            let mut found = Disagreements::default();
            let mut worker = mode.worker();
            worker.load(&part);
            worker.trace(&part);
            worker.compare(&part, &mut found);
            // Nothing is recorded as hit.
            assert_eq!((found.compared, found.total()), (54, 13 + 6 + 1), "{}", mode.name());
        }
    }
}
