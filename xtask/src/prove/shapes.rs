//! What scenes are made of.

use rayset_scene::Part;
use rayset_scene::geometry::Sides;
use rayset_scene::glam::DVec3;

use super::dice::Dice;
use super::families::any_material;
use super::specimen::Maker;

/// Up to so many spheres anywhere, one an object; few more often than many.
pub(crate) fn spheres(maker: &mut Maker, dice: &mut Dice, most: u32, least: f64, greatest: f64) {
    let most = dice.among(2, most);
    for _ in 0..dice.among(most.div_ceil(2), most) {
        let material = any_material(maker, dice);
        let ball = maker.ball(1.5 * dice.point(), dice.between(least, greatest));
        maker.add(material, [ball]);
    }
}

/// Spheres that touch the one before from outside or inside, lie round its centre, are it once more, or points.
pub(crate) fn touching(maker: &mut Maker, dice: &mut Dice) {
    let (mut center, mut radius) = (DVec3::ZERO, 0.5);
    for _ in 0..dice.among(2, 40) {
        let direction = if dice.once_in(2) { dice.axis() } else { dice.direction() };
        let other = dice.pick(&[0.125, 0.25, 0.5, 0.75]);
        match dice.below(8) {
            0..=2 => (center, radius) = (center + (radius + other) * direction, other),
            3 | 4 => (center, radius) = (center + (radius - other) * direction, other),
            5 => radius = other,
            6 => {}
            _ => radius = 0.0,
        }
        if center.abs().max_element() > 2.5 {
            center = DVec3::ZERO;
        }
        let material = any_material(maker, dice);
        // Once in a while two of an object.
        let parts = vec![maker.ball(center, radius); if dice.once_in(8) { 2 } else { 1 }];
        maker.add(material, parts);
    }
}

/// Equal spheres on a grid that touch, overlap, or leave gaps.
pub(crate) fn lattice(maker: &mut Maker, dice: &mut Dice) {
    let sides = [0; 3].map(|_| dice.among(1, 4));
    let radius = dice.pick(&[0.125, 0.25, 0.2, 0.375]);
    let materials = [0; 3].map(|_| any_material(maker, dice));
    for i in 0..sides[0] * sides[1] * sides[2] {
        let (x, y, z) = (i % sides[0], i / sides[0] % sides[1], i / sides[0] / sides[1]);
        let corner = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
        let ball = maker.ball(0.5 * corner - DVec3::splat(0.75), radius);
        let material = dice.pick(&materials);
        maker.add(material, [ball]);
    }
}

/// Lights that coincide, that are many, that shine from inside things, and along axes.
pub(crate) fn lamps(maker: &mut Maker, dice: &mut Dice) {
    for _ in 0..dice.among(1, 4) {
        let place = dice.pick(&[1.0, 4.0, 20.0]) * dice.point();
        for _ in 0..dice.among(1, 2) {
            maker.lamp(place);
        }
        let towards = if dice.once_in(2) { dice.axis() } else { dice.direction() };
        if dice.once_in(2) {
            maker.sun(towards);
        }
    }
}

/// Any primitive, seen from any side.
fn any_part(maker: &Maker, dice: &mut Dice) -> Option<Part> {
    let (a, size) = (1.5 * dice.point(), dice.between(0.1, 0.8));
    let (b, c) = (a + size * dice.point(), a + size * dice.point());
    let part = match dice.below(5) {
        0 => maker.ball(a, size),
        1 => maker.triangle([a, b, c]),
        2 => maker.polygon(&[a, b, b + c - a, c])?,
        3 => maker.cone(a, 0.5 * size, b, 0.0)?,
        _ => maker.cone(a, 0.4 * size, b, 0.4 * size)?,
    };
    let sides = dice.pick(&[Sides::Both, Sides::Both, Sides::Front, Sides::Back]);
    Some(Part { sides, ..part })
}

/// Primitives of all kinds, alone or several under one volume, and a floor.
pub(crate) fn kinds(maker: &mut Maker, dice: &mut Dice) {
    for _ in 0..dice.among(2, 24) {
        let material = any_material(maker, dice);
        let n = dice.pick(&[1, 1, 1, 2, 5]);
        let parts: Vec<Part> = (0..n).filter_map(|_| any_part(maker, dice)).collect();
        maker.add(material, parts);
    }
    let material = any_material(maker, dice);
    let (corner, is_polygon) = (DVec3::new(-3.0, -1.5, -3.0), dice.once_in(2));
    let floor = maker.wall(corner, 6.0 * DVec3::Z, 6.0 * DVec3::X, is_polygon);
    maker.add(material, floor);
    let most = dice.pick(&[None, Some(1), Some(2)]);
    maker.builder.max_volume_primitives(most);
}

/// Spheres of glass in spheres of glass, with a common centre or not.
pub(crate) fn glass(maker: &mut Maker, dice: &mut Dice) {
    for _ in 0..dice.among(1, 6) {
        let (mut center, mut radius) = (dice.point(), dice.between(0.3, 1.0));
        for _ in 0..dice.among(1, 5) {
            let index = dice.pick(&[1.0, 1.1, 1.33, 1.5, 2.0, 0.75]);
            let material = if dice.once_in(5) { maker.mirror() } else { maker.glass(index) };
            let ball = maker.ball(center, radius);
            maker.add(material, [ball]);
            let inner = dice.between(0.4, 1.0) * radius;
            // Inside, up to touching.
            center += dice.pick(&[0.0, 0.5, 1.0]) * (radius - inner) * dice.direction();
            radius = inner;
        }
    }
}

/// A room of mirrors with things in it.
pub(crate) fn mirrors(maker: &mut Maker, dice: &mut Dice) {
    let (mirror, is_polygon) = (maker.mirror(), dice.once_in(2));
    let n_walls = dice.among(2, 6);
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    for i in 0..n_walls as usize {
        let (normal, u, v) = (axes[i / 2 % 3], axes[(i / 2 + 1) % 3], axes[(i / 2 + 2) % 3]);
        let side = if i % 2 == 0 { 1.5 } else { -1.5 };
        let wall = maker.wall(side * normal - 1.5 * (u + v), 3.0 * u, 3.0 * v, is_polygon);
        maker.add(mirror, wall);
    }
    spheres(maker, dice, 20, 0.1, 0.4);
}

/// Boxes and spheres whose sides and extremes lie on a grid.
pub(crate) fn boxes(maker: &mut Maker, dice: &mut Dice) {
    for _ in 0..dice.among(2, 12) {
        let material = any_material(maker, dice);
        let mut cell = || 0.25 * f64::from(dice.among(0, 8)) - 1.0;
        let corner = DVec3::new(cell(), cell(), cell());
        let size = 0.25 * f64::from(dice.among(1, 3));
        let (x, y, z) = (size * DVec3::X, size * DVec3::Y, size * DVec3::Z);
        let is_polygon = dice.once_in(2);
        if dice.once_in(3) {
            let ball = maker.ball(corner, size);
            maker.add(material, [ball]);
            continue;
        }
        let faces = [(x, y), (y, z), (z, x)].into_iter().flat_map(|(u, v)| {
            let far = corner + (x + y + z - u - v);
            [maker.wall(corner, u, v, is_polygon), maker.wall(far, u, v, is_polygon)].concat()
        });
        let faces: Vec<Part> = faces.collect();
        // As one object, or every face under a volume of its own.
        if dice.once_in(2) {
            maker.add(material, faces);
        } else {
            for face in faces {
                maker.add(material, [face]);
            }
        }
    }
}
