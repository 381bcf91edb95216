//! Primitives, one table each, and random spheres.

use rayset_geometry::{Cone, Polygon, Sides, Sphere, Triangle, unit};

use super::fields::{Fault, Field, Fields, excerpt, suggestion};
use super::keys::{self, Section};
use crate::{Limits, MAX_COORDINATE, Part, RandomSpheres, SphereSize};

/// How far corners may lie off the plane of their polygon, relative to its size.
const PLANARITY: f64 = 1e-3;

/// How a table becomes a primitive.
pub(super) type ReadShape = fn(&Fields, &Limits) -> Result<Part, Fault>;

/// The keys of the primitives, their tables, and how to read these.
pub(super) const SHAPES: [(&str, &Section, ReadShape); 4] = [
    ("sphere", &keys::SPHERE, sphere),
    ("triangle", &keys::TRIANGLE, triangle),
    ("polygon", &keys::POLYGON, polygon),
    ("cone", &keys::CONE, cone),
];

/// A primitive that a scene can hold.
pub(super) fn part(fields: &Fields, read: ReadShape, limits: &Limits) -> Result<Part, Fault> {
    let part = read(fields, limits)?;
    if part.primitive.extent() > MAX_COORDINATE {
        return Err(Fault::new(fields.at(), format!("a coordinate exceeds {MAX_COORDINATE:e}")));
    }
    Ok(Part { sides: fields.or("sides", Sides::Both, sides)?, ..part })
}

fn sphere(fields: &Fields, _: &Limits) -> Result<Part, Fault> {
    let center = fields.required("center")?.point()?;
    let radius = fields.required("radius")?;
    radius.positive()?;
    Ok(Sphere::new(center, radius.length()?).into())
}

fn triangle(fields: &Fields, _: &Limits) -> Result<Part, Fault> {
    let corners = fields.required("corners")?;
    let [a, b, c] = corners.points()?;
    if unit((b - a).cross(c - a)).is_none() {
        return Err(corners.fault("the corners lie on a line"));
    }
    let normals = fields.get("normals").map(Field::points).transpose()?;
    Ok(Part { normals, ..Triangle::new(a, b, c).into() })
}

fn polygon(fields: &Fields, limits: &Limits) -> Result<Part, Fault> {
    let corners = fields.required("corners")?;
    let list = corners.list()?;
    let limit = limits.corners as usize;
    if !(3..=limit).contains(&list.len()) {
        return Err(corners.fault(format!("a polygon needs 3 to {limit} corners, not {}", list.len())));
    }
    let vertices = list.map(Field::point).collect::<Result<Vec<_>, _>>()?;
    let Some(polygon) = Polygon::new(vertices) else {
        return Err(corners.fault("the polygon has no area"));
    };
    let first = polygon.vertices()[0];
    let offsets = || polygon.vertices().iter().map(|vertex| *vertex - first);
    let size = offsets().map(|offset| offset.length()).fold(0.0, f64::max);
    let heights = || offsets().map(|offset| offset.dot(polygon.normal()));
    let depth = heights().fold(0.0, f64::max) - heights().fold(0.0, f64::min);
    if depth > PLANARITY * size {
        let message =
            format!("the corners do not lie in a plane, but {depth:.3e} apart: make triangles of them");
        return Err(corners.fault(message));
    }
    Ok(polygon.into())
}

fn cone(fields: &Fields, _: &Limits) -> Result<Part, Fault> {
    let base = fields.required("base")?.point()?;
    let base_radius = fields.required("base_radius")?.length()?;
    let apex = fields.required("apex")?.point()?;
    let apex_radius = fields.required("apex_radius")?.length()?;
    match Cone::new(base, base_radius, apex, apex_radius) {
        Some(cone) => Ok(cone.into()),
        None if base_radius + apex_radius > 0.0 => {
            Err(Fault::new(fields.at(), "`base` and `apex` are too close together"))
        }
        None => Err(Fault::new(fields.at(), "`base_radius` and `apex_radius` are both zero")),
    }
}

fn sides(field: Field) -> Result<Sides, Fault> {
    match field.string()? {
        "front" => Ok(Sides::Front),
        "back" => Ok(Sides::Back),
        "both" => Ok(Sides::Both),
        other => {
            let hint = suggestion(other, ["front", "back", "both"])
                .map_or("it is `front`, `back` or `both`".to_owned(), |known| {
                    format!("did you mean `{known}`?")
                });
            Err(field.fault(format!("`sides` cannot be `{}`: {hint}", excerpt(other))))
        }
    }
}

/// Random spheres that can be added to a scene.
pub(super) fn random_spheres(fields: &Fields) -> Result<RandomSpheres, Fault> {
    let default = RandomSpheres::default();
    let size = match fields.either("radius", "coverage")? {
        None => default.size,
        Some(field) if field.key() == "radius" => radii(field)?,
        Some(field) => match field.positive()? {
            coverage if coverage < 1.0 => SphereSize::Coverage(coverage),
            _ => return Err(field.fault("`coverage` is not below 1")),
        },
    };
    Ok(RandomSpheres {
        count: fields.required("count")?.integer_32(1..=u32::MAX)?,
        seed: fields.or("seed", default.seed, |field| field.integer(0..=u64::MAX))?,
        size,
        separate: fields.or("separate", default.separate, Field::boolean)?,
        reflectance: fields.or("reflectance", default.reflectance, Field::not_negative)?,
        transmittance: fields.or("transmittance", default.transmittance, Field::not_negative)?,
    })
}

/// One radius, or the least and the greatest.
fn radii(field: Field) -> Result<SphereSize, Fault> {
    let [least, greatest] = if field.is_list() { field.list_of("numbers")? } else { [field, field] };
    let radii = (least.positive()?, greatest.length()?);
    // Their places reach 1 in every direction.
    if radii.1 > 0.5 * MAX_COORDINATE {
        return Err(greatest.fault(format!("`radius` exceeds {MAX_COORDINATE:e}")));
    }
    if radii.0 > radii.1 {
        return Err(field.fault("`radius` has its greater number first"));
    }
    Ok(SphereSize::Between(radii.0, radii.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shape_has_the_keys_that_are_read_for_all() {
        for (key, section, _) in SHAPES {
            assert!(keys::SCENE.keys.contains(&key));
            for common in ["material", "object", "sides"] {
                assert!(section.keys.contains(&common), "{key} {common}");
            }
        }
    }
}
