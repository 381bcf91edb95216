//! Rays that leave a sphere into its inside meet it again: where, exactly.

use rayset_geometry::{PrimitiveKind, Ray, Side, Sides, Span, Sphere};
use rayset_simd::{LaneMask, Lanes, Simd};

use super::Departing;
use super::lanes::LanesOfColumns;
use crate::columns::{HitOrNone, Left};
use crate::shapes::{Hit, Shapes};

impl<const W: usize> Shapes<W> {
    /// Where rays that leave a sphere into its inside meet it again, exactly: the lanes that do, of some.
    ///
    /// That bounds what is still to be found; and a ray that asks for any hit has its answer. It is asked where every
    /// sphere can be hit from the same sides: see [`Shapes::can_meet_own`].
    #[inline(always)]
    pub(crate) fn meet_own<S: Simd>(
        &self,
        simd: S,
        departing: &Departing<'_>,
        lanes: u32,
        found: &mut [HitOrNone; W],
        tests: &mut u64,
    ) -> u32 {
        let Departing { rays, first, left } = *departing;
        if Left::all_outwards(left) {
            return 0;
        }
        let (mut inwards, mut indices) = (0, [0; W]);
        for (lane, left) in left.iter().enumerate() {
            if let Some(index) = left.inwards().and_then(|number| self.sphere_of(number)) {
                indices[lane] = index;
                inwards |= 1 << lane;
            }
        }
        let (mut lanes, mut met, mut lane) = (lanes & inwards, 0, 0);
        *tests += u64::from(lanes.count_ones());
        let pairs = S::F64::LANES;
        while lanes >> lane != 0 && first + lane + pairs <= rays.len() {
            let wanted = lanes & (u32::MAX >> (32 - pairs)) << lane;
            if wanted != 0 {
                let LanesOfColumns { rays: pair, span } = rays.lanes(simd, first + lane);
                let sphere = |i: usize| self.sphere(indices[lane + i]);
                let center = [
                    simd.collect_f64(|i| sphere(i).center().x),
                    simd.collect_f64(|i| sphere(i).center().y),
                    simd.collect_f64(|i| sphere(i).center().z),
                ];
                let sphere = (center, simd.collect_f64(|i| sphere(i).radius()));
                // Nothing is between NaN and anything.
                let is_span = simd.load_f64(&rays.spans.0[first + lane..]).le(span[1]);
                let sides = (simd.mask_f64(0), simd.mask_f64(wanted >> lane) & is_span);
                let (is_hit, t) = Sphere::intersect_pairs(simd, &pair, span, sphere, sides);
                let mut distances = [0.0; W];
                t.store(&mut distances);
                let mut hits = is_hit.bits() << lane & wanted;
                met |= hits;
                while hits != 0 {
                    let i = hits.trailing_zeros() as usize % W;
                    hits &= hits - 1;
                    let primitive = self.number(PrimitiveKind::Sphere, indices[i]);
                    found[i] = HitOrNone { t: distances[i - lane], primitive };
                }
                lanes &= !wanted;
            }
            lane += pairs;
        }
        // Too few left in the columns for all lanes.
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % W;
            lanes &= lanes - 1;
            let (ray, span) = rays.ray(first + lane);
            if let Some(hit) = self.own_hit(&ray, span, indices[lane]) {
                found[lane] = hit.into();
                met |= 1 << lane;
            }
        }
        met
    }

    /// Where a ray that leaves a sphere into its inside meets it again, exactly.
    #[inline(always)]
    pub(crate) fn own_hit(&self, ray: &Ray, span: Span, index: u32) -> Option<Hit> {
        let t = self.sphere(index).intersect(ray, span, Sides::Back, Some(Side::Back))?;
        Some(Hit { t, primitive: self.number(PrimitiveKind::Sphere, index) })
    }
}
