//! What hid lights of late, asked first about the light rays that follow.
//!
//! A light is hidden by whatever lies before it, so that no order and no tree is needed to say so: one primitive is tested
//! against as many rays as there are lanes, and those that it surely blocks are answered. What one ray of a block finds in
//! the tree is offered to the others at once.
//!
//! Source: Haines and Greenberg 1986, "The light buffer: a shadow-testing accelerator", for testing the last blocker
//! first, there one ray at a time.

use rayset_geometry::PrimitiveKind;
use rayset_simd::{LaneMask, Part, Simd};

use crate::axes::AxisRays;
use crate::columns::Left;
use crate::exact::NONE;
use crate::interval::Chords;
use crate::leaf::PACKET_TEST_STEPS;
use crate::packet::Packet;
use crate::ray::CullRays;
use crate::shaft::Shaft;
use crate::shapes::Shapes;
use crate::shear::Shearing;
use crate::together::Question;
use crate::trial::Trial;
use crate::triangles::Sheared;

/// How many blockers are remembered.
const REMEMBERED: usize = 4;

/// The last primitives that hid a light from rays of a class, and whether asking them first is worth it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blockers {
    /// Their records, the last first.
    records: [u32; REMEMBERED],
    trial: Trial,
    /// Whether it is worth it to offer what a ray finds to the others of its block.
    offers: Trial,
    /// The steps that a ray is spared by a blocker.
    pub(crate) steps: u64,
    /// How many rays blockers answered that were found for others.
    pub(crate) answered: u64,
}

impl Blockers {
    /// None yet.
    pub(crate) const NEW: Self =
        Self { records: [NONE; REMEMBERED], trial: Trial::NEW, offers: Trial::NEW, steps: 0, answered: 0 };

    /// Remembers a blocker, as the last.
    #[inline(always)]
    pub(crate) fn remember(&mut self, record: u32) {
        let mut moved = record;
        for place in &mut self.records {
            std::mem::swap(place, &mut moved);
            if moved == record {
                break;
            }
        }
    }

    /// The blockers to ask about the next rays, the last first; none while that is not worth it.
    #[inline(always)]
    fn due(&mut self) -> ([u32; REMEMBERED], usize) {
        let is_due = self.records[0] != NONE && self.trial.is_due();
        let known = self.records.iter().take_while(|&&record| record != NONE);
        (self.records, if is_due { known.count() } else { 0 })
    }

    /// The lanes, of those that are open, whose rays a blocker that is remembered surely blocks.
    #[inline(always)]
    pub(crate) fn ask<S: Simd, const W: usize>(
        &mut self,
        simd: S,
        shapes: &Shapes<W>,
        rays: &CullRays<W>,
        left: &[Left],
        open: u32,
        primitive_tests: &mut u64,
    ) -> u32 {
        let (mut blocked, mut tests) = (0, 0);
        let (records, known) = self.due();
        for &record in &records[..known] {
            let asked = open & !blocked;
            if asked == 0 {
                break;
            }
            blocked |= asked & simd.outline(Blocked { shapes, rays, left, record });
            *primitive_tests += u64::from(asked.count_ones());
            tests += 1;
        }
        let answered = u64::from(blocked.count_ones());
        if tests > 0 {
            self.trial.end(PACKET_TEST_STEPS * tests, answered * self.steps);
        }
        self.answered += answered;
        blocked
    }

    /// A ray has found a blocker: the lanes, of those that are open, whose rays it surely blocks too.
    #[inline(always)]
    pub(crate) fn offer<S: Simd, const W: usize>(
        &mut self,
        simd: S,
        asked: Blocked<'_, W>,
        open: u32,
        primitive_tests: &mut u64,
    ) -> u32 {
        self.remember(asked.record);
        if open == 0 || !self.offers.is_due() {
            return 0;
        }
        let blocked = open & simd.outline(asked);
        *primitive_tests += u64::from(open.count_ones());
        let answered = u64::from(blocked.count_ones());
        self.offers.end(PACKET_TEST_STEPS, answered * self.steps);
        self.answered += answered;
        blocked
    }

    /// Packets under a shaft that ask whether anything blocks their rays: those that a blocker that is remembered surely
    /// blocks are answered.
    #[inline(always)]
    pub(crate) fn ask_packets<S: Simd, Q: Question<S, W>, const W: usize>(
        &mut self,
        simd: S,
        shapes: &Shapes<W>,
        shaft: &Shaft<S>,
        packets: &mut [Packet<S, W>],
        asked: &mut [Q],
        primitive_tests: &mut u64,
    ) {
        let (records, known) = self.due();
        let (mut tests, mut answered) = (0, 0);
        for &record in &records[..known] {
            let blocking = shapes.block(simd, record, shaft, packets, asked);
            answered += blocking.answered;
            tests += blocking.packets;
            *primitive_tests += blocking.rays;
        }
        if tests > 0 {
            // Under a shaft a ray takes about a step.
            self.trial.end(PACKET_TEST_STEPS * tests, answered);
        }
    }
}

/// Prepared rays, and a primitive that may block some of them.
pub(crate) struct Blocked<'a, const W: usize> {
    pub(crate) shapes: &'a Shapes<W>,
    pub(crate) rays: &'a CullRays<W>,
    /// What each leaves; empty if none leaves anything.
    pub(crate) left: &'a [Left],
    pub(crate) record: u32,
}

impl<S: Simd, const W: usize> Part<S> for Blocked<'_, W> {
    type Output = u32;

    /// The lanes whose rays it surely blocks.
    #[inline(always)]
    fn run(self, simd: S) -> u32 {
        let Self { shapes, rays, left, record } = self;
        let (run, place) = shapes.place_of(record);
        let lanes = rays.lanes(simd);
        let leaving = Left::lanes_that_leave::<S, W>(simd, left, shapes.number(run.kind, run.first + place));
        let (front, back) = run.hittable::<W>(leaving);
        let (front, back) = (simd.mask_f32(front), simd.mask_f32(back));
        let at = match run.kind {
            PrimitiveKind::Sphere => {
                let sphere = shapes.sphere_block(run).one(simd, place as usize);
                let chords = Chords::of(simd, sphere, lanes.origin, lanes.direction, lanes.unit);
                chords.intervals(simd, &lanes.span, front, back)
            }
            PrimitiveKind::Triangle => {
                let [a, b, c] = shapes.triangle_block(run).vertices(place as usize);
                let vertices = [lanes.shear(simd, a), lanes.shear(simd, b), lanes.shear(simd, c)];
                let sheared = Sheared::of(vertices);
                sheared.intervals(simd, lanes.rounding(), lanes.shears(), &lanes.span, front, back)
            }
            PrimitiveKind::Cone => {
                let rays = AxisRays::new([lanes.origin, lanes.direction], lanes.span, lanes.unit);
                shapes.axis_block(run).intervals_of_rays(simd, place as usize, &rays, (front, back))
            }
            PrimitiveKind::Polygon => match shapes.polygon_block(run) {
                Some(block) => {
                    let span = (&lanes.span, lanes.span.start);
                    block.intervals(simd, place as usize, &lanes, span, (front, back))
                }
                None => return 0,
            },
        };
        (at.possible & at.sure).bits()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_blockers_are_asked_first_and_each_once() {
        let mut blockers = Blockers::NEW;
        assert_eq!(blockers.due().1, 0, "there is none");
        for record in [1, 2, 3, 2, 2, 4, 5, 6, 4] {
            blockers.remember(record);
        }
        assert_eq!(blockers.due(), ([4, 6, 5, 2], 4));
        // Not worth it: others are asked the less.
        blockers.trial.end(100, 0);
        blockers.trial.end(100, 0);
        assert_eq!([blockers.due().1, blockers.due().1], [0, 4]);
    }
}
