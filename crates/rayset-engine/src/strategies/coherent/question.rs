//! What a ray asks, and what settles it.

use rayset_geometry::{Departure, Probe, Ray, Span};
use rayset_scene::{Scene, VolumeId};
use rayset_simd::Simd;

use super::certificate::{Certificate, LoneSphere};
use super::condition::{Condition, Omitted};
use super::retained::Blocker;
use crate::strategies::partition::{first_in, nearest_in};
use crate::{Hit, Originating, Work};

/// A question that the contents of volumes answer, one after the other.
pub(super) trait Question {
    /// Whether a certificate reaches as far as is asked.
    fn is_covered(&self, certificate: &Certificate, omitted: Omitted) -> bool;

    /// Tests a sphere; whether that settles the question.
    fn test_sphere(
        &mut self,
        sphere: &LoneSphere,
        ray: &Ray,
        span: Span,
        originating: Option<Originating>,
    ) -> bool;

    /// Tests the contents of a volume; whether that settles the question.
    fn test_volume<S: Simd>(
        &mut self,
        scene: &Scene,
        probe: &Probe<S>,
        volume: VolumeId,
        departure: Option<Departure>,
        work: &mut Work,
    ) -> bool;

    /// Whether it is settled by the tests of all volumes of a certificate that admits the ray.
    fn is_settled(&self, certificate: &Certificate, omitted: Omitted) -> bool;

    /// How far along the ray the answer reaches, in world units; infinite if there is no end.
    fn reach(&self) -> f64;
}

/// What does the ray hit first?
#[derive(Debug, Default)]
pub(super) struct Nearest {
    pub(super) hit: Option<Hit>,
}

impl Nearest {
    #[inline(always)]
    fn meet(&mut self, hit: Option<Hit>) {
        if let Some(hit) = hit
            && self.hit.is_none_or(|nearest| hit.precedes(&nearest))
        {
            self.hit = Some(hit);
        }
    }
}

impl Question for Nearest {
    #[inline(always)]
    fn is_covered(&self, _: &Certificate, _: Omitted) -> bool {
        true
    }

    #[inline(always)]
    fn test_sphere(
        &mut self,
        sphere: &LoneSphere,
        ray: &Ray,
        span: Span,
        originating: Option<Originating>,
    ) -> bool {
        self.meet(sphere.hit(ray, span, originating));
        false
    }

    #[inline(always)]
    fn test_volume<S: Simd>(
        &mut self,
        scene: &Scene,
        probe: &Probe<S>,
        volume: VolumeId,
        departure: Option<Departure>,
        work: &mut Work,
    ) -> bool {
        self.meet(nearest_in(scene, probe, volume, departure, work));
        false
    }

    #[inline(always)]
    fn is_settled(&self, certificate: &Certificate, omitted: Omitted) -> bool {
        self.reach() <= certificate.length || omitted.is(Condition::HitLength)
    }

    #[inline(always)]
    fn reach(&self) -> f64 {
        self.hit.map_or(f64::INFINITY, |hit| hit.t)
    }
}

/// Is the light hidden?
#[derive(Debug)]
pub(super) struct Hidden {
    /// How far from the surface the light is, in world units; infinite for a directional light.
    pub(super) length: f64,
    pub(super) blocker: Option<Blocker>,
}

impl Question for Hidden {
    #[inline(always)]
    fn is_covered(&self, certificate: &Certificate, omitted: Omitted) -> bool {
        self.length <= certificate.length || omitted.is(Condition::LightLength)
    }

    #[inline(always)]
    fn test_sphere(
        &mut self,
        sphere: &LoneSphere,
        ray: &Ray,
        span: Span,
        originating: Option<Originating>,
    ) -> bool {
        let is_hit = sphere.hit(ray, span, originating).is_some();
        if is_hit {
            self.blocker = Some(Blocker::Sphere(*sphere));
        }
        is_hit
    }

    #[inline(always)]
    fn test_volume<S: Simd>(
        &mut self,
        scene: &Scene,
        probe: &Probe<S>,
        volume: VolumeId,
        departure: Option<Departure>,
        work: &mut Work,
    ) -> bool {
        let run = first_in(scene, probe, volume, departure, work);
        self.blocker = run.map(|run| Blocker::of_run(scene, run));
        self.blocker.is_some()
    }

    #[inline(always)]
    fn is_settled(&self, _: &Certificate, _: Omitted) -> bool {
        true
    }

    #[inline(always)]
    fn reach(&self) -> f64 {
        self.length
    }
}
