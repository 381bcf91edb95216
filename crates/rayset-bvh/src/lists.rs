//! Where the answers of a list of rays go, and what packets of it ask for.

use rayset_simd::Simd;

use crate::columns::HitOrNone;
use crate::each::{AnyHit, NearestHit, OfRay};
use crate::exact::Exact;
use crate::few::OfFew;
use crate::frame::Frame;
use crate::packet::Packet;
use crate::together::{Hidden, Nearest, Question};

/// Where the answers of a list go, and how rays are answered.
pub(crate) trait List {
    /// What a packet asks for.
    type Asked<S: Simd, const W: usize>: Question<S, W>;
    /// Whether any hit is an answer, so that what blocked other rays is asked first.
    const ANY: bool;
    /// What a ray by itself asks for.
    type OfRay: OfFew + Default;

    /// Where the answers go.
    fn places(&mut self) -> &mut [<Self::OfRay as OfRay>::Answer];

    /// A packet begins with what is known of its rays.
    fn begin<S: Simd, const W: usize>(
        &self,
        simd: S,
        frame: &Frame,
        packet: &mut Packet<S, W>,
        asked: &mut Self::Asked<S, W>,
    );

    /// Takes over what a packet has found.
    fn answer<S: Simd, const W: usize>(
        &mut self,
        simd: S,
        exact: &Exact<'_, W>,
        packet: &Packet<S, W>,
        asked: Self::Asked<S, W>,
    );
}

/// Places of nearest hits, all without one at first.
pub(crate) struct NearestHits<'a>(pub(crate) &'a mut [HitOrNone]);

impl List for NearestHits<'_> {
    type Asked<S: Simd, const W: usize> = Nearest<S>;
    type OfRay = NearestHit;
    const ANY: bool = false;

    fn places(&mut self) -> &mut [HitOrNone] {
        self.0
    }

    #[inline(always)]
    fn begin<S: Simd, const W: usize>(
        &self,
        simd: S,
        frame: &Frame,
        packet: &mut Packet<S, W>,
        _: &mut Nearest<S>,
    ) {
        packet.know(simd, frame, &self.0[packet.first..packet.first + packet.len]);
    }

    #[inline(always)]
    fn answer<S: Simd, const W: usize>(
        &mut self,
        simd: S,
        exact: &Exact<'_, W>,
        packet: &Packet<S, W>,
        asked: Nearest<S>,
    ) {
        let places = &mut self.0[packet.first..packet.first + packet.len];
        let mut known = packet.known;
        if known == 0 {
            asked.finish(simd, exact, packet, places);
            return;
        }
        let mut before = [HitOrNone::NONE; W];
        before[..packet.len].copy_from_slice(places);
        asked.finish(simd, exact, packet, places);
        // What was found lies before what was known, or about there.
        while known != 0 {
            let lane = known.trailing_zeros() as usize % W;
            known &= known - 1;
            if let (Some(before), Some(now)) = (before[lane].get(), places[lane].get())
                && before.precedes(&now)
            {
                places[lane] = before.into();
            }
        }
    }
}

/// Places that say whether something is hit, all false at first.
pub(crate) struct Occluded<'a>(pub(crate) &'a mut [bool]);

impl List for Occluded<'_> {
    type Asked<S: Simd, const W: usize> = Hidden;
    type OfRay = AnyHit<true>;
    const ANY: bool = true;

    fn places(&mut self) -> &mut [bool] {
        self.0
    }

    #[inline(always)]
    fn begin<S: Simd, const W: usize>(
        &self,
        simd: S,
        _: &Frame,
        packet: &mut Packet<S, W>,
        asked: &mut Hidden,
    ) {
        let known = &self.0[packet.first..packet.first + packet.len];
        let lanes = (0..).zip(known).fold(0, |lanes, (lane, &is_hit)| lanes | u32::from(is_hit) << lane);
        asked.begin(simd, packet, lanes);
    }

    #[inline(always)]
    fn answer<S: Simd, const W: usize>(
        &mut self,
        _: S,
        _: &Exact<'_, W>,
        packet: &Packet<S, W>,
        asked: Hidden,
    ) {
        // All lanes at once: one by one, the bits took more than half as long as the packet's shaft.
        let hidden: [bool; W] = std::array::from_fn(|lane| asked.lanes >> lane & 1 == 1);
        let places = &mut self.0[packet.first..packet.first + packet.len];
        if let Some(all) = places.first_chunk_mut() {
            *all = hidden;
        } else {
            places.copy_from_slice(&hidden[..packet.len]);
        }
    }
}
