//! Random and adversarial scenes, by family.

use rayset_scene::glam::DVec3;
use rayset_scene::{Camera, MaterialId, SceneError};
use rayset_study::{NamedScene, cornell_box, cornell_spheres, knob};

use super::dice::Dice;
use super::shapes;
use super::specimen::{Maker, Specimen};
use crate::project;

/// What is hard about a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Family {
    Spheres,
    Touching,
    Lattice,
    EyeInside,
    Lights,
    Kinds,
    Glass,
    Mirrors,
    Axes,
    Crowd,
    Meshes,
    Far,
    FarEye,
    Tiny,
    /// Not an image: rays made to brush past the volumes that bound a pencil.
    Brushing,
    /// Not an image: rays strewn round the bounds of pencils.
    Strewn,
}

impl Family {
    pub(crate) const ALL: [Self; 16] = [
        Self::Spheres,
        Self::Touching,
        Self::Lattice,
        Self::EyeInside,
        Self::Lights,
        Self::Kinds,
        Self::Glass,
        Self::Mirrors,
        Self::Axes,
        Self::Crowd,
        Self::Meshes,
        Self::Far,
        Self::FarEye,
        Self::Tiny,
        Self::Brushing,
        Self::Strewn,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Spheres => "random spheres",
            Self::Touching => "touching, nested, doubled",
            Self::Lattice => "lattices",
            Self::EyeInside => "eye inside a sphere",
            Self::Lights => "many lights",
            Self::Kinds => "all kinds of primitives",
            Self::Glass => "glass in glass",
            Self::Mirrors => "mirrors facing mirrors",
            Self::Axes => "rays along axes",
            Self::Crowd => "hundreds of volumes",
            Self::Meshes => "meshes",
            Self::Far => "far from the origin",
            Self::FarEye => "eye far away",
            Self::Tiny => "tiny, and huge",
            Self::Brushing => "rays that brush past",
            Self::Strewn => "rays strewn at random",
        }
    }

    /// A scene of the family.
    pub(crate) fn specimen(self, dice: &mut Dice) -> Result<Specimen, SceneError> {
        let (shape, scale, offset) = match self {
            Self::Meshes => return mesh(dice),
            Self::Far => {
                let (far, direction) = (dice.pick(&[1e3, 1e6, 1e6, 1e9]), dice.direction());
                (dice.pick(&Self::ALL[..10]), 1.0, far * direction)
            }
            Self::Tiny => {
                let scale = dice.pick(&[1e-3, 1e-3, 1e-6, 1e-12, 1e-100, 1e12, 1e50]);
                (dice.pick(&Self::ALL[..10]), scale, DVec3::ZERO)
            }
            shape => (shape, 1.0, DVec3::ZERO),
        };
        let mut maker = Maker::new(scale, offset);
        shape.put_into(&mut maker, dice)?;
        maker.finish()
    }

    fn put_into(self, maker: &mut Maker, dice: &mut Dice) -> Result<(), SceneError> {
        let angle = dice.between(8.0, 45.0);
        let mut from = dice.between(3.0, 8.0) * dice.direction();
        let mut at = 0.3 * dice.point();
        match self {
            Self::Touching => shapes::touching(maker, dice),
            Self::Lattice => {
                shapes::lattice(maker, dice);
                if dice.once_in(2) {
                    (from, at) = (dice.pick(&[4.0, 6.5, 8.0]) * dice.axis(), DVec3::ZERO);
                }
            }
            Self::EyeInside => {
                let material = any_material(maker, dice);
                let shell = maker.ball(DVec3::ZERO, dice.between(1.5, 4.0));
                maker.add(material, [shell]);
                shapes::spheres(maker, dice, 24, 0.1, 0.5);
                (from, at) = (dice.point(), dice.point());
            }
            Self::Lights => {
                shapes::spheres(maker, dice, 40, 0.1, 0.5);
                shapes::lamps(maker, dice);
            }
            Self::Kinds => shapes::kinds(maker, dice),
            Self::Glass => {
                shapes::glass(maker, dice);
                if dice.once_in(4) {
                    from = dice.between(0.0, 1.0) * dice.direction();
                }
            }
            Self::Mirrors => {
                shapes::mirrors(maker, dice);
                from = 0.9 * dice.point();
            }
            Self::Axes => {
                shapes::boxes(maker, dice);
                (from, at) = (dice.pick(&[4.0, 5.5, 8.0]) * dice.axis(), DVec3::ZERO);
            }
            Self::Crowd => shapes::spheres(maker, dice, 400, 0.03, 0.12),
            Self::FarEye => shapes::spheres(maker, dice, 50, 0.05, 0.4),
            _ => shapes::spheres(maker, dice, 64, 0.1, 0.5),
        }
        let mut angle = if matches!(self, Self::EyeInside | Self::Mirrors) { 3.0 * angle } else { angle };
        if self == Self::FarEye {
            let far = dice.pick(&[1e3, 1e4, 1e6]);
            (from, angle) = (far * dice.direction(), 80.0 / far);
        }
        if from.distance(at) < 1e-3 {
            at += DVec3::X;
        }
        if dice.once_in(3) {
            maker.sun(dice.direction());
        }
        if self == Self::Axes {
            maker.sun(dice.axis());
        }
        for _ in 0..dice.among(0, 2) {
            maker.lamp(6.0 * dice.point());
        }
        maker.look(from, at, angle)
    }
}

/// A material of any kind.
pub(crate) fn any_material(maker: &mut Maker, dice: &mut Dice) -> MaterialId {
    match dice.below(5) {
        0 | 1 => maker.matt(),
        2 | 3 => maker.mirror(),
        _ => {
            let index = dice.pick(&[1.0, 1.3, 1.5, 2.4]);
            maker.glass(index)
        }
    }
}

fn mesh(dice: &mut Dice) -> Result<Specimen, SceneError> {
    let fixtures = project::fixtures();
    // The knob is large: brute force takes long.
    let NamedScene { scene, .. } = match dice.below(8) {
        0..=4 => cornell_box(&fixtures)?,
        5 => cornell_spheres(&fixtures)?,
        6 => knob(&fixtures, None)?,
        _ => knob(&fixtures, Some(dice.pick(&[8, 32, 128])))?,
    };
    let old = scene.camera();
    let from = old.viewpoint() + 0.3 * dice.point();
    let angle = dice.between(0.2, 1.0) * old.angle();
    let camera = Camera::new(from, old.target() + 0.3 * dice.point(), DVec3::Y, angle)?;
    Ok(Specimen::of_triangles(scene.with_camera(camera)?))
}
