//! Faces that rays leave behind: planes across an axis on which they begin, and which they have passed where their spans
//! start.
//!
//! Of scenes of blocks, rooms and floors most boxes end in such planes, those of the primitives that a ray leaves and of
//! all that lie in the same plane or below it. Moved outwards by a margin they hold the ray's origin, and it would go
//! through all of them. Where single precision has the coordinate of the plane itself, which is often so where scenes are
//! made on a grid, they are told apart by one comparison without any margin.

use rayset_simd::{Lanes, Simd};

use crate::frame::Frame;
use crate::packet::Mask;

/// How far past a face a ray has to be where its span starts, in units of what a hit may be off.
///
/// Derived in `docs/numerics.md`.
pub const FACE_MARGIN: f32 = 2.0;

/// How near its origin has to be to the number in single precision that stands for the face, in the same units.
const NEAR: f32 = 0.25;

/// Rays, a lane each, that may begin in a plane across an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beginning<S: Simd> {
    /// What their origins along the axis lose by being rounded to single precision.
    pub(crate) lost: S::F32,
    /// Where their spans start, and their directions along the axis.
    pub(crate) start: S::F32,
    pub(crate) direction: S::F32,
    /// What a hit may be off.
    pub(crate) hit_slack: S::F32,
}

impl<S: Simd> Beginning<S> {
    /// The rays that have passed the plane where their spans start, and how far they are past it there.
    ///
    /// The plane's coordinate is that of the origin, rounded. A box that ends there, or before, in the sense in which the
    /// ray goes along the axis, holds nothing that the ray hits.
    #[inline(always)]
    pub(crate) fn passed(&self, simd: S) -> (Mask<S>, S::F32) {
        self.past(simd, FACE_MARGIN)
    }

    #[inline(always)]
    fn past(&self, simd: S, margin: f32) -> (Mask<S>, S::F32) {
        let Self { lost, start, direction, hit_slack } = *self;
        let past = start * direction.abs();
        let (near, least) = (simd.splat_f32(NEAR) * hit_slack, simd.splat_f32(margin) * hit_slack);
        (lost.abs().le(near) & past.gt(least), past)
    }
}

/// What coordinates of origins, `place` of a column, lose by being rounded to single precision in culling space.
#[inline(always)]
pub(crate) fn lost<S: Simd, const W: usize>(
    simd: S,
    frame: &Frame,
    axis: usize,
    origins: &[f64],
    (first, len): (usize, usize),
) -> S::F32 {
    let (offset, scale) = (frame.center[axis], frame.scale);
    if let Some(origins) = origins.get(first..first + W) {
        return simd.narrowing_f32(origins, offset, scale);
    }
    let mut last = [0.0; W];
    for (lane, origin) in last.iter_mut().enumerate() {
        *origin = origins[first + lane.min(len - 1)];
    }
    simd.narrowing_f32(&last, offset, scale)
}

/// A face that a ray leaves behind, in lanes: boxes are compared with it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Face<S: Simd> {
    /// Of the six planes of a box, the one that lies along the face and farther on along the ray.
    plane: usize,
    /// In which sense along the axis across it the ray goes, 1 or -1, and its coordinate, times that.
    sense: S::F32,
    place: S::F32,
}

impl<S: Simd> Face<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, plane: usize, [sense, place]: [f32; 2]) -> Self {
        Self { plane, sense: simd.splat_f32(sense), place: simd.splat_f32(place) }
    }

    /// The boxes, by their planes, that do not lie behind it.
    #[inline(always)]
    pub(crate) fn ahead<const W: usize>(self, simd: S, planes: &[[f32; W]; 6]) -> Mask<S> {
        (simd.load_f32(&planes[self.plane]) * self.sense).gt(self.place)
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use rayset_geometry::glam::DVec3;
    use rayset_simd::{Backend, Kernel, LaneMask};

    use super::*;

    /// How many hits are lost, and how many boxes left behind, with the margin multiplied by `factor`: of rays that begin in
    /// a plane, or as near to it as may be taken for that, and hit what lies in it as exactly as hits have to.
    struct Leaving {
        factor: f32,
    }

    impl Kernel for Leaving {
        type Output = (usize, usize);

        #[inline(always)]
        #[expect(clippy::cast_possible_truncation, reason = "what is prepared is in single precision")]
        fn run<S: Simd>(self, simd: S) -> (usize, usize) {
            let mut rng = ChaCha8Rng::seed_from_u64(7);
            let mut number = || f64::from(rng.next_u32()) / f64::from(u32::MAX);
            let (mut lost, mut behind) = (0, 0);
            let slack = 1e-13;
            for _ in 0..60_000 {
                let sense = if number() < 0.5 { 1.0 } else { -1.0 };
                let plane = f64::from((2.0 * number() - 1.0) as f32);
                // Near enough, or not.
                let farthest = if number() < 0.5 { 0.3 } else { 5.0 };
                let off = farthest * slack * (2.0 * number() - 1.0);
                let hit = plane + slack * (2.0 * number() - 1.0);
                let direction = sense * (0.01 + 0.98 * number());
                let start = 4.0 * slack * number() / f64::abs(direction);
                let origin = plane + off;
                let is_hit = (hit - origin) / direction >= start;
                let column = [origin; 16];
                let frame = Frame { center: DVec3::ZERO, scale: 1.0, remoteness: 0.0, reach: 1.0 };
                let lost_here = if S::F32::LANES == 16 {
                    super::lost::<S, 16>(simd, &frame, 0, &column, (0, 16))
                } else {
                    super::lost::<S, 8>(simd, &frame, 0, &column, (0, 8))
                };
                let beginning = Beginning {
                    lost: lost_here,
                    start: simd.splat_f32(start as f32),
                    direction: simd.splat_f32(direction as f32),
                    hit_slack: simd.splat_f32(slack as f32),
                };
                let (passed, _) = beginning.past(simd, self.factor * FACE_MARGIN);
                behind += usize::from(passed.any());
                lost += usize::from(passed.any() && is_hit);
            }
            (lost, behind)
        }
    }

    #[test]
    fn face_margin_is_needed() {
        for &backend in Backend::available() {
            let (lost, behind) = backend.run(Leaving { factor: 1.0 });
            assert!(lost == 0 && behind > 5000, "{backend}: {lost}, {behind}");
            let (lost, _) = backend.run(Leaving { factor: 0.0 });
            assert!(lost > 1000, "{backend}: {lost}");
        }
    }
}
