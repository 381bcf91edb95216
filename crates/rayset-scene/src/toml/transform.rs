//! Scales, turns and moves a mesh.

use rayset_geometry::glam::{DMat3, DVec3};
use rayset_geometry::{Primitive, Triangle, unit};

use super::fields::{Fault, Field, Fields};
use super::keys;
use crate::{MAX_COORDINATE, Part};

/// Longer vertex normals are shortened: only their directions and the ratios of their lengths count.
const MAX_NORMAL: f64 = 1e60;

/// `p -> R S p + t`: a scaling along the axes, then rotations, then a translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transform {
    /// `R S`.
    linear: DMat3,
    /// `R S^-1`, the inverse transpose of `R S`, times a positive number.
    normal: DMat3,
    translation: DVec3,
    /// Whether `S` turns fronts into backs.
    mirrors: bool,
}

impl Transform {
    /// The transform that `scale`, `rotate` and `translate` ask for; `None` if there is none of these.
    pub(super) fn read(fields: &Fields) -> Result<Option<Self>, Fault> {
        let (scale, rotate) = (fields.get("scale"), fields.get("rotate"));
        let translate = fields.get("translate");
        if scale.is_none() && rotate.is_none() && translate.is_none() {
            return Ok(None);
        }
        let scale = scale.map_or(Ok(DVec3::ONE), read_scale)?;
        let rotation = rotate.map_or(Ok(DMat3::IDENTITY), read_rotations)?;
        let translation = translate.map_or(Ok(DVec3::ZERO), Field::point)?;
        Ok(Some(Self::new(scale, rotation, translation)))
    }

    /// The components of `scale` must be finite and not zero.
    fn new(scale: DVec3, rotation: DMat3, translation: DVec3) -> Self {
        // The reciprocals may overflow; their ratios do not.
        let reciprocal = scale.abs().min_element() / scale;
        Self {
            linear: rotation * DMat3::from_diagonal(scale),
            normal: rotation * DMat3::from_diagonal(reciprocal),
            translation,
            mirrors: (scale.x < 0.0) ^ (scale.y < 0.0) ^ (scale.z < 0.0),
        }
    }

    /// A triangle in its new place; `None` if a scene cannot hold that.
    ///
    /// Where the scale mirrors, two corners are exchanged, so that the front stays the front. A primitive of another
    /// shape, of which meshes have none, has no new place.
    pub(super) fn apply(&self, part: &Part) -> Option<Part> {
        let Primitive::Triangle(triangle) = &part.primitive else { return None };
        let mut vertices = triangle.vertices().map(|vertex| self.linear * vertex + self.translation);
        let mut normals = part.normals.map(|normals| normals.map(|normal| self.turn(normal)));
        if self.mirrors {
            vertices.swap(1, 2);
            if let Some(normals) = &mut normals {
                normals.swap(1, 2);
            }
        }
        // False for what is not a number, too.
        let is_within_range =
            |vertex: &DVec3| vertex.is_finite() && vertex.abs().max_element() <= MAX_COORDINATE;
        let [a, b, c] = vertices;
        vertices.iter().all(is_within_range).then(|| Part {
            primitive: Triangle::new(a, b, c).into(),
            sides: part.sides,
            normals,
        })
    }

    /// A normal in its new direction, as long as before.
    fn turn(&self, normal: DVec3) -> DVec3 {
        let direction = unit(normal).and_then(|normal| unit(self.normal * normal));
        normal.length().min(MAX_NORMAL) * direction.unwrap_or(DVec3::ZERO)
    }
}

fn read_scale(field: Field) -> Result<DVec3, Fault> {
    let scale = if field.is_list() { field.vector()? } else { DVec3::splat(field.number()?) };
    if scale.cmpeq(DVec3::ZERO).any() { Err(field.fault("`scale` is zero")) } else { Ok(scale) }
}

/// One rotation, or several, the first first.
fn read_rotations(field: Field) -> Result<DMat3, Fault> {
    if !field.is_list() {
        return read_rotation(field);
    }
    field.list()?.try_fold(DMat3::IDENTITY, |before, field| Ok(read_rotation(field)? * before))
}

fn read_rotation(field: Field) -> Result<DMat3, Fault> {
    let fields = field.table(&keys::ROTATE)?;
    let axis = fields.required("axis")?;
    let degrees = fields.required("degrees")?.number()?;
    let Some(direction) = unit(axis.vector()?) else { return Err(axis.fault("`axis` is zero")) };
    Ok(rotation(direction, degrees))
}

/// The rotation about a unit vector, counterclockwise as seen from its tip: `c I + s [k] + (1 - c) k k^T`.
///
/// Quarter turns about a coordinate axis are exact.
///
/// Source: Rodrigues' formula.
fn rotation(k: DVec3, degrees: f64) -> DMat3 {
    let (s, c) = sine_and_cosine(degrees);
    let cross =
        DMat3::from_cols(DVec3::new(0.0, k.z, -k.y), DVec3::new(-k.z, 0.0, k.x), DVec3::new(k.y, -k.x, 0.0));
    let outer = DMat3::from_cols(k.x * k, k.y * k, k.z * k);
    DMat3::from_diagonal(DVec3::splat(c)) + cross * s + outer * (1.0 - c)
}

/// The same on every host; exact for quarter turns.
fn sine_and_cosine(degrees: f64) -> (f64, f64) {
    // The remainder is exact.
    let turn = degrees % 360.0;
    for (quarter, exact) in
        [(0.0, (0.0, 1.0)), (90.0, (1.0, 0.0)), (180.0, (0.0, -1.0)), (270.0, (-1.0, 0.0))]
    {
        if (turn - quarter) % 360.0 == 0.0 {
            return exact;
        }
    }
    let radians = turn * (std::f64::consts::PI / 180.0);
    (libm::sin(radians), libm::cos(radians))
}
