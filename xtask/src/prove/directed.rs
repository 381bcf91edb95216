//! Rays that no image would hold: made to lie at the very bounds of pencils, or strewn round them.

use rayset_engine::{IntersectionStrategy, Originating, RayQuery, RaySetIndex, Recording, ShadowQuery, Slot};
use rayset_scene::geometry::{Ray, Side, Span, unit};
use rayset_scene::glam::DVec3;
use rayset_scene::{LightId, ObjectId, PrimitiveId, SceneError};

use super::dice::Dice;
use super::specimen::{Maker, Specimen};

/// Rays from far away, and a sphere that the outermost of them touch.
///
/// A strategy that learns from two rays how far they are apart, and builds a certificate that reaches so many times as
/// far, is asked for rays at that very bound: whether they hit is a matter of the last bits.
#[derive(Debug)]
pub(crate) struct Brush {
    pub(crate) specimen: Specimen,
    rays: Vec<Ray>,
    /// If the rays are for a light, how far from it they start.
    light_distance: Option<f64>,
}

impl Brush {
    pub(crate) fn new(dice: &mut Dice) -> Result<Self, SceneError> {
        let distance = dice.pick(&[1e2, 1e4, 1e6]);
        let direction = dice.direction();
        let origin = dice.point() - distance * direction;
        let light_distance = dice.once_in(2).then_some(distance + 10.0);
        // Whatever the strategy's reaches are, some of them should be here; the widest matters most.
        let reach = dice.pick(&[2.0, 3.0, 4.0, 8.0, 10.0, 16.0, 32.0, 32.0, 32.0, 64.0]);
        let step = dice.between(0.1, 3.0) / reach;
        // Rays to a point light all meet there; others spread, or diverge, or both.
        let way = if light_distance.is_some() { 1 } else { dice.below(3) };
        let spread = if way == 1 { 0.0 } else { step };
        let divergence = if way == 0 { 0.0 } else { step / distance };
        let at = |spread: f64, divergence: f64, across: DVec3| {
            let direction = unit(direction + divergence * across).unwrap_or(direction);
            Ray::new(origin + spread * across, direction)
        };
        let across = dice.across(direction);
        let first = at(-spread, -divergence, across);
        let axis = Ray::new(origin, direction);
        // As a strategy measures it.
        let spread = axis.origin().distance(first.origin());
        let divergence = axis.direction().distance(first.direction());
        let outward = dice.across(direction);
        let extreme = |shortfall: f64| {
            let share = reach * (1.0 - shortfall);
            at(share * spread, share * divergence, outward)
        };
        let touching = extreme(1e-14);
        let normal = outward - outward.dot(touching.direction()) * touching.direction();
        let radius = dice.between(0.2, 1.0);
        let noise = distance * dice.between(-4.0, 4.0) * f64::EPSILON;
        let center = touching.at(distance) + (radius + noise) * normal.normalize();
        let shortfalls = [1e-14, 3e-14, 1e-13, 0.0, 3e-15];
        let rays = [first, axis].into_iter().chain(shortfalls.map(extreme)).collect();

        let mut maker = Maker::new(1.0, DVec3::ZERO);
        let matt = maker.matt();
        let ground = maker.ball(origin - 10.0 * direction, 1.0);
        maker.add(matt, [ground]);
        // Many at one place are too many to be guests.
        for _ in 0..if reach < 32.0 || dice.once_in(2) { 6 } else { 1 } {
            let ball = maker.ball(center, radius);
            maker.add(matt, [ball]);
        }
        if light_distance.is_some() {
            maker.lamp(origin);
        }
        Ok(Self { specimen: maker.finish()?, rays, light_distance })
    }

    /// Asks a strategy for all rays.
    pub(crate) fn ask(&self, strategy: &dyn IntersectionStrategy) {
        let mut tracer = strategy.begin_sweep(Recording::Off);
        for (ray, i) in self.rays.iter().zip(0..) {
            let ray_set = RaySetIndex(i);
            match self.light_distance {
                Some(distance) => {
                    let originating =
                        Originating { object: ObjectId(0), primitive: PrimitiveId(0), side: Side::Front };
                    let light = ray.origin();
                    if let Some(query) =
                        shadow_query(ray_set, Slot::ROOT, originating, ray.at(distance), light)
                    {
                        tracer.occluded(&query);
                    }
                }
                None => {
                    tracer.nearest(&RayQuery {
                        ray_set,
                        slot: Slot::ROOT,
                        originating: None,
                        ray: *ray,
                        span: Span::FORWARD,
                    });
                }
            }
        }
    }
}

/// A ray to the only point light.
fn shadow_query(
    ray_set: RaySetIndex,
    slot: Slot,
    originating: Originating,
    point: DVec3,
    light: DVec3,
) -> Option<ShadowQuery> {
    let direction = unit(light - point)?;
    let distance = (light - point).length();
    let start = 1e-12 * distance;
    let (ray, span) = (Ray::new(point, direction), Span { start, end: distance - start });
    Some(ShadowQuery { ray_set, slot, light: LightId(0), originating, ray, span })
}

/// Asks a strategy for rays strewn round an axis, within about what its pencils may reach; they leave this primitive
/// or that, and so do rays to a light from points near by.
pub(crate) fn strew(strategy: &dyn IntersectionStrategy, specimen: &Specimen, dice: &mut Dice) {
    let mut tracer = strategy.begin_sweep(Recording::Off);
    let n_primitives = u32::try_from(specimen.primitives.len()).expect("few primitives");
    let (origin, target) = (dice.between(0.0, 6.0) * dice.direction(), 1.5 * dice.point());
    let direction = unit(target - origin).unwrap_or(DVec3::Z);
    let spread = dice.pick(&[0.0, 1e-8, 1e-5, 1e-3, 1e-2]);
    let divergence = dice.pick(&[0.0, 1e-8, 1e-5, 1e-3, 1e-2]);
    let light = specimen.scene.lights().first().and_then(|light| light.position());
    let departs = dice.once_in(2);
    let mut left = any_originating(specimen, dice, n_primitives);
    let slot = if departs { Slot(dice.among(2, 3)) } else { Slot::ROOT };
    for i in 0..60 {
        // The first rays tell the step; the others lie within some dozens of them.
        let reach = if i < 3 { 1.0 } else { dice.pick(&[1.0, 4.0, 16.0, 40.0]) };
        if dice.once_in(8) {
            left = any_originating(specimen, dice, n_primitives);
        }
        let ray = Ray::new(
            origin + reach * spread * dice.point(),
            unit(direction + reach * divergence * dice.point()).unwrap_or(direction),
        );
        let ray_set = RaySetIndex(i);
        let originating = departs.then_some(left);
        tracer.nearest(&RayQuery { ray_set, slot, originating, ray, span: Span::FORWARD });
        let point = target + reach * (spread + divergence) * dice.point();
        if let Some(light) = light
            && let Some(query) = shadow_query(ray_set, slot, left, point, light)
        {
            tracer.occluded(&query);
        }
    }
}

fn any_originating(specimen: &Specimen, dice: &mut Dice, n_primitives: u32) -> Originating {
    let primitive = dice.below(n_primitives);
    let (object, _) = specimen.primitives[primitive as usize];
    let side = dice.pick(&[Side::Front, Side::Front, Side::Front, Side::Back]);
    Originating { object, primitive: PrimitiveId(primitive), side }
}
