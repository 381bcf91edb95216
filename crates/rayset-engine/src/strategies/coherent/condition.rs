//! The conditions that make certificates sound, each of which can be left out to see that it is needed.

use std::borrow::Cow;

use rayset_geometry::{BoundingSphere, PENCIL_MARGIN, Pencil, VolumeColumns};
use rayset_scene::Scene;

/// A condition of the proof in `docs/certificates.md`.
///
/// With the feature `mutations`, and only then, [`Coherent`](crate::Coherent) can be told to leave one out:
/// `cargo xtask prove --mutations` does, and must find wrong answers without it. The feature is off by default and
/// nothing in the workspace turns it on but a build made for that run, so that no other build carries the switch.
#[cfg_attr(not(feature = "mutations"), expect(unreachable_pub, reason = "exported with the feature alone"))]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Condition {
    /// A ray starts within the spread of the pencil.
    Spread,
    /// The direction of a ray differs by no more than the divergence.
    Divergence,
    /// A hit lies within the length of the pencil.
    HitLength,
    /// A light lies within the length of the pencil.
    LightLength,
    /// The primitive that was left out is the one the ray leaves.
    ExcludedIsLeft,
    /// It is left on its front side.
    ExcludedFront,
    /// Its volume holds nothing else.
    ExcludedAlone,
    /// The predicted volume is tested.
    Predicted,
    /// The guests are tested.
    Guests,
    /// An answer needs all of these tests, paid for or not.
    AllTested,
    /// The last blocker hides a light only if it still does.
    Blocker,
    /// Volumes are tested against all of the pencil, not against its axis alone.
    Widening,
    /// Volumes are tested with their radii.
    VolumeRadius,
    /// A volume that is in the way at every reach becomes a guest.
    InTheWay,
    /// Where more are in the way than there may be guests, there is no certificate.
    TooMany,
    /// A volume is clear only by [`PENCIL_MARGIN`].
    Margin,
}

#[cfg(feature = "mutations")]
impl Condition {
    /// All conditions.
    pub const ALL: [Self; 16] = [
        Self::Spread,
        Self::Divergence,
        Self::HitLength,
        Self::LightLength,
        Self::ExcludedIsLeft,
        Self::ExcludedFront,
        Self::ExcludedAlone,
        Self::Predicted,
        Self::Guests,
        Self::AllTested,
        Self::Blocker,
        Self::Widening,
        Self::VolumeRadius,
        Self::InTheWay,
        Self::TooMany,
        Self::Margin,
    ];

    /// What is left out, in a few words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Spread => "spread of the starts",
            Self::Divergence => "divergence of the directions",
            Self::HitLength => "length, for hits",
            Self::LightLength => "length, for lights",
            Self::ExcludedIsLeft => "excluded primitive is the one left",
            Self::ExcludedFront => "excluded primitive is left in front",
            Self::ExcludedAlone => "excluded primitive is alone",
            Self::Predicted => "predicted volume is tested",
            Self::Guests => "guests are tested",
            Self::AllTested => "all tests are made",
            Self::Blocker => "last blocker is tested",
            Self::Widening => "widening of the pencil",
            Self::VolumeRadius => "radius of the volumes",
            Self::InTheWay => "volumes never clear become guests",
            Self::TooMany => "no certificate past too many volumes",
            Self::Margin => "margin for rounding",
        }
    }
}

/// The condition that is left out, if any: nothing at all without the feature `mutations`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Omitted {
    #[cfg(feature = "mutations")]
    pub(super) condition: Option<Condition>,
}

impl Omitted {
    /// Whether a condition is left out.
    #[inline(always)]
    pub(super) fn is(self, condition: Condition) -> bool {
        #[cfg(feature = "mutations")]
        return self.condition == Some(condition);
        #[cfg(not(feature = "mutations"))]
        {
            let _ = condition;
            false
        }
    }

    /// The pencil that a ray must belong to.
    pub(super) fn pencil_of_rays(self, mut pencil: Pencil) -> Pencil {
        if self.is(Condition::Spread) {
            pencil.spread = f64::INFINITY;
        }
        if self.is(Condition::Divergence) {
            pencil.divergence = f64::INFINITY;
        }
        pencil
    }

    /// The pencil that volumes must be clear of.
    #[inline(always)]
    pub(super) fn pencil_of_volumes(self, pencil: Pencil) -> Pencil {
        if self.is(Condition::Widening) { Pencil { spread: 0.0, divergence: 0.0, ..pencil } } else { pencil }
    }

    /// [`PENCIL_MARGIN`].
    #[inline(always)]
    pub(super) fn margin(self) -> f64 {
        if self.is(Condition::Margin) { 0.0 } else { PENCIL_MARGIN }
    }

    /// The volumes of a scene.
    #[inline(always)]
    pub(super) fn volumes(self, scene: &Scene) -> Cow<'_, VolumeColumns> {
        let volumes = scene.volumes();
        if !self.is(Condition::VolumeRadius) {
            return Cow::Borrowed(volumes);
        }
        let mut points = VolumeColumns::default();
        for i in 0..volumes.len() {
            points.push(&BoundingSphere { radius: 0.0, ..volumes.sphere(i) });
        }
        Cow::Owned(points)
    }
}

#[cfg(all(test, feature = "mutations"))]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_omitted_unless_told() {
        for (i, condition) in Condition::ALL.into_iter().enumerate() {
            assert!(!Omitted::default().is(condition));
            let omitted = Omitted { condition: Some(condition) };
            let others = Condition::ALL.into_iter().enumerate().filter(|&(_, other)| omitted.is(other));
            assert_eq!(others.map(|(other, _)| other).collect::<Vec<_>>(), [i]);
        }
    }
}
