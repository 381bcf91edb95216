//! One of prepared rays.

use rayset_simd::Simd;

use super::CullRays;
use crate::frame::round_down;
use crate::interval::splat;
use crate::shear::{ShearedAlike, Shears};
use crate::triangles::Rounding;

/// One of prepared rays. What is asked of it is read where it stands: few rays ask for everything.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CullRay<'a, const W: usize> {
    pub(super) rays: &'a CullRays<W>,
    pub(super) lane: usize,
    /// The axes of the shear: those across, and the one along.
    pub(crate) axes: [usize; 3],
}

impl<const W: usize> CullRay<'_, W> {
    #[inline(always)]
    fn of(self, columns: &[[f32; W]; 3]) -> [f32; 3] {
        let lane = self.lane % W;
        [columns[0][lane], columns[1][lane], columns[2][lane]]
    }

    /// The same, said to have axes that there are, so that no load by them has to ask.
    #[inline(always)]
    pub(crate) fn with_axes_known(self) -> Self {
        let [x, y, z] = self.axes;
        assert!(x.max(y).max(z) < 3, "there are three axes");
        self
    }

    /// One over the direction.
    #[inline(always)]
    pub(crate) fn inverse(self) -> [f32; 3] {
        self.of(&self.rays.inverse)
    }

    /// What is added to a near plane's distance, and a far plane's.
    #[inline(always)]
    pub(crate) fn offsets(self) -> [[f32; 3]; 2] {
        [self.of(&self.rays.near_offset), self.of(&self.rays.far_offset)]
    }

    /// The face that it leaves behind, if there is one: the axis across, the sense in which it goes along that, and the
    /// coordinate times the sense.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0, 1 or 2")]
    pub(crate) fn face(self) -> Option<(usize, f32, f32)> {
        let CullRays { face_axis, face_sense, face_place, .. } = self.rays;
        let lane = self.lane % W;
        let axis = (face_axis[lane] as usize).min(2);
        (face_sense[lane].abs() > 0.0).then_some((axis, face_sense[lane], face_place[lane]))
    }

    /// Which of a node's six planes are near, and far.
    #[inline(always)]
    pub(crate) fn planes(self) -> [[usize; 3]; 2] {
        let turned = self.rays.turned.map(|lanes| (lanes >> self.lane & 1) as usize);
        let near = [3 * turned[0], 1 + 3 * turned[1], 2 + 3 * turned[2]];
        [near, [3 - 3 * turned[0], 4 - 3 * turned[1], 5 - 3 * turned[2]]]
    }

    /// The axes along which it runs backwards, a bit each.
    #[inline(always)]
    pub(crate) fn turned(self) -> u32 {
        let [x, y, z] = self.rays.turned.map(|lanes| lanes >> self.lane & 1);
        x | y << 1 | z << 2
    }

    /// The origin in culling space, moved along the ray if it was far off.
    #[inline(always)]
    pub(crate) fn origin(self) -> [f32; 3] {
        self.of(&self.rays.origin)
    }

    #[inline(always)]
    pub(crate) fn direction(self) -> [f32; 3] {
        self.of(&self.rays.direction)
    }

    /// The shear, the same in every lane.
    #[inline(always)]
    pub(crate) fn shears<S: Simd>(self, simd: S) -> Shears<S> {
        let [factors, crossings] = [self.of(&self.rays.factors), self.of(&self.rays.crossings)];
        Shears { factors: splat(simd, factors), crossings: splat(simd, crossings) }
    }

    /// The ray as one that is sheared, the same in every lane.
    #[inline(always)]
    pub(crate) fn sheared<S: Simd>(self, simd: S) -> ShearedAlike<S> {
        ShearedAlike { axes: self.axes, shears: self.shears(simd), rounding: self.rounding() }
    }

    /// How far tests of flat shapes may be off.
    #[inline(always)]
    pub(crate) fn rounding(self) -> Rounding {
        let lane = self.lane % W;
        let (vertex, distance) = (self.rays.vertex_slack[lane], self.rays.distance_slack[lane]);
        Rounding { vertex, steepness: 1.0, distance }
    }

    /// The rounding of a coordinate: `2^-24 (1 + the origin's largest coordinate)` and what `f64` adds.
    #[inline(always)]
    pub(crate) fn unit(self) -> f32 {
        self.rays.unit[self.lane % W]
    }

    /// Where the span starts, or less.
    #[inline(always)]
    pub(crate) fn start(self) -> f32 {
        self.rays.start[self.lane % W]
    }

    /// Where the span starts, or more.
    #[inline(always)]
    pub(crate) fn start_above(self) -> f32 {
        self.rays.start_above[self.lane % W]
    }

    /// Where the span ends, or less.
    #[inline(always)]
    pub(crate) fn end_below(self) -> f32 {
        self.rays.end_below[self.lane % W]
    }

    /// Where the span ends, or more.
    #[inline(always)]
    pub(crate) fn end_above(self) -> f32 {
        self.rays.end_above[self.lane % W]
    }

    /// A distance in culling space that is not below `t` in world units.
    #[inline(always)]
    pub(crate) fn end(self, t: f64) -> f32 {
        self.rays.end(self.lane % W, t)
    }

    /// A distance in culling space that is not above `t` in world units.
    #[inline(always)]
    pub(crate) fn below(self, t: f64) -> f32 {
        round_down(t * self.rays.scale - self.rays.advance[self.lane % W])
    }
}
