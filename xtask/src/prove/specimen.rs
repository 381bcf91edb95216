//! A scene with a list of its primitives, from which brute force answers.

use rayset_engine::{Hit, Originating, RayQuery, ShadowQuery};
use rayset_scene::geometry::{Cone, Polygon, PrimitiveKind, Ray, Sides, Span, Sphere, Triangle};
use rayset_scene::glam::DVec3;
use rayset_scene::{
    Camera, Color, Light, Material, MaterialId, ObjectId, Part, PrimitiveId, Scene, SceneBuilder, SceneError,
};

/// A scene, and what is in it as it was put in.
#[derive(Debug)]
pub(crate) struct Specimen {
    pub(crate) scene: Scene,
    /// The primitives by their id, each with its object.
    pub(crate) primitives: Vec<(ObjectId, Part)>,
}

impl Specimen {
    /// A scene of triangles alone.
    pub(crate) fn of_triangles(scene: Scene) -> Self {
        let sides_of = |id: PrimitiveId| {
            let location = scene.location(id);
            assert_eq!(location.kind, PrimitiveKind::Triangle, "a mesh has triangles alone");
            let runs = scene.volume_runs(location.volume);
            let run = runs.iter().find(|run| run.range.contains(&location.index));
            run.map_or(Sides::Both, |run| run.sides)
        };
        let mut primitives = Vec::with_capacity(scene.n_primitives());
        for (object, i) in scene.objects().iter().zip(0..) {
            for id in object.primitives.clone().map(PrimitiveId) {
                let triangle = scene.primitives().triangle(scene.location(id).index);
                primitives.push((ObjectId(i), Part { sides: sides_of(id), ..triangle.into() }));
            }
        }
        Self { scene, primitives }
    }

    /// The least hit, by testing every primitive alone: no volumes, no partition, no certificates, no lanes.
    pub(crate) fn nearest(&self, query: &RayQuery) -> Option<Hit> {
        let key = |hit: &Hit| (hit.object, hit.primitive);
        self.hits(&query.ray, query.span, query.originating)
            .min_by(|a, b| a.t.total_cmp(&b.t).then(key(a).cmp(&key(b))))
    }

    /// Whether any primitive lies within the span.
    pub(crate) fn occluded(&self, query: &ShadowQuery) -> bool {
        self.hits(&query.ray, query.span, Some(query.originating)).next().is_some()
    }

    fn hits(&self, ray: &Ray, span: Span, originating: Option<Originating>) -> impl Iterator<Item = Hit> {
        self.primitives.iter().zip(0..).filter_map(move |((object, part), id)| {
            let primitive = PrimitiveId(id);
            let left = originating.filter(|o| o.primitive == primitive).map(|o| o.side);
            let t = part.primitive.intersect(ray, span, part.sides, left)?;
            Some(Hit { t, object: *object, primitive })
        })
    }
}

/// Adds objects to a scene and keeps a list of their primitives; everything is scaled, then moved.
#[derive(Debug)]
pub(crate) struct Maker {
    pub(crate) builder: SceneBuilder,
    primitives: Vec<(ObjectId, Part)>,
    scale: f64,
    offset: DVec3,
}

impl Maker {
    pub(crate) fn new(scale: f64, offset: DVec3) -> Self {
        let mut builder = SceneBuilder::new();
        builder.background(Color::new(0.1, 0.2, 0.4)).ambient(Color::splat(0.1));
        Self { builder, primitives: Vec::new(), scale, offset }
    }

    pub(crate) fn point(&self, point: DVec3) -> DVec3 {
        self.offset + self.scale * point
    }

    pub(crate) fn ball(&self, center: DVec3, radius: f64) -> Part {
        Sphere::new(self.point(center), self.scale * radius).into()
    }

    pub(crate) fn triangle(&self, corners: [DVec3; 3]) -> Part {
        let [a, b, c] = corners.map(|corner| self.point(corner));
        Triangle::new(a, b, c).into()
    }

    /// A polygon; `None` if the corners are no polygon.
    pub(crate) fn polygon(&self, corners: &[DVec3]) -> Option<Part> {
        let corners = corners.iter().map(|&corner| self.point(corner)).collect();
        Polygon::new(corners).map(Part::from)
    }

    /// A cone; `None` if it has no height.
    pub(crate) fn cone(&self, base: DVec3, base_radius: f64, apex: DVec3, apex_radius: f64) -> Option<Part> {
        let (base, apex) = (self.point(base), self.point(apex));
        Cone::new(base, self.scale * base_radius, apex, self.scale * apex_radius).map(Part::from)
    }

    /// A rectangle of two triangles, or of one polygon.
    pub(crate) fn wall(&self, corner: DVec3, u: DVec3, v: DVec3, is_polygon: bool) -> Vec<Part> {
        if is_polygon {
            return self.polygon(&[corner, corner + u, corner + u + v, corner + v]).into_iter().collect();
        }
        let far = corner + u + v;
        vec![self.triangle([corner, corner + u, far]), self.triangle([corner, far, corner + v])]
    }

    pub(crate) fn add(&mut self, material: MaterialId, parts: impl IntoIterator<Item = Part>) {
        let parts: Vec<Part> = parts.into_iter().collect();
        if parts.is_empty() {
            return;
        }
        let object = self.builder.add_object("object", material, parts.clone());
        self.primitives.extend(parts.into_iter().map(|part| (object, part)));
    }

    pub(crate) fn matt(&mut self) -> MaterialId {
        self.builder.add_material(Material::default())
    }

    pub(crate) fn mirror(&mut self) -> MaterialId {
        self.builder.add_material(Material { reflectance: Color::splat(0.8), ..Material::default() })
    }

    pub(crate) fn glass(&mut self, index: f64) -> MaterialId {
        self.builder.add_material(Material {
            reflectance: Color::splat(0.4),
            transmittance: Color::splat(0.7),
            index,
            ..Material::default()
        })
    }

    pub(crate) fn lamp(&mut self, position: DVec3) {
        self.builder.add_light(Light::point(self.point(position), Color::splat(0.5)));
    }

    pub(crate) fn sun(&mut self, towards: DVec3) {
        self.builder.add_light(Light::directional(towards, Color::splat(0.5)));
    }

    /// Looks at the scene; upwards is any direction that is not along the line of sight.
    pub(crate) fn look(&mut self, from: DVec3, at: DVec3, angle: f64) -> Result<(), SceneError> {
        let sight = (at - from).abs();
        let up = if sight.y > 0.99 * sight.length() { DVec3::X } else { DVec3::Y };
        let camera = Camera::new(self.point(from), self.point(at), up, angle)?;
        self.builder.camera(camera);
        Ok(())
    }

    pub(crate) fn finish(self) -> Result<Specimen, SceneError> {
        let specimen = Specimen { scene: self.builder.build()?, primitives: self.primitives };
        assert_eq!(specimen.primitives.len(), specimen.scene.n_primitives(), "every primitive is listed");
        Ok(specimen)
    }
}

#[cfg(test)]
mod tests {
    use rayset_engine::{RaySetIndex, Slot};
    use rayset_scene::geometry::Side;

    use super::*;

    #[test]
    fn brute_force_finds_the_least_hit_and_honours_departures() {
        let mut maker = Maker::new(2.0, DVec3::X);
        let matt = maker.matt();
        let balls = [4.0, 2.0, 2.0].map(|z| maker.ball(DVec3::new(0.0, 0.0, z), 0.5));
        maker.add(matt, balls[..1].iter().cloned());
        maker.add(matt, balls[1..].iter().cloned());
        let specimen = maker.finish().unwrap();
        let query = |originating| RayQuery {
            ray_set: RaySetIndex(0),
            slot: Slot::ROOT,
            originating,
            ray: Ray::new(DVec3::X, DVec3::Z),
            span: Span::FORWARD,
        };
        let hit = |t: f64, object: u32, primitive: u32| {
            Some(Hit { t, object: ObjectId(object), primitive: PrimitiveId(primitive) })
        };
        assert_eq!(specimen.nearest(&query(None)), hit(3.0, 1, 1));
        let leaving = Originating { object: ObjectId(1), primitive: PrimitiveId(1), side: Side::Front };
        assert_eq!(specimen.nearest(&query(Some(leaving))), hit(3.0, 1, 2));
    }
}
