//! What holds for every scene that is built, whatever it is made of.

use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::RngSeed;
use rayset_geometry::glam::DVec3;
use rayset_geometry::{
    ColumnRun, Cone, Polygon, Primitive, PrimitiveKind, Probe, Ray, Sides, Span, Sphere, Triangle, unit,
};
use rayset_scene::{
    Camera, Light, Material, MaterialId, ObjectId, Part, PrimitiveId, RandomSpheres, Scene, SceneBuilder, SphereSize,
    VolumeId,
};
use rayset_simd::Scalar;

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(1985), ..ProptestConfig::default() }
}

fn vector() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-1.0..1.0).prop_map(DVec3::from_array)
}

fn primitive() -> impl Strategy<Value = Primitive> {
    let sphere = (vector(), 0.0..1.0).prop_map(|(center, radius)| Sphere::new(center, radius).into());
    let triangle = prop::array::uniform3(vector()).prop_map(|[a, b, c]| Triangle::new(a, b, c).into());
    let polygon = prop::array::uniform3(vector()).prop_filter_map("no area", |[a, b, c]| {
        Polygon::new(vec![a, a + b, a + b + c, a + c]).map(Primitive::from)
    });
    let cone = (vector(), 0.0..0.5, vector(), 0.0..0.5).prop_filter_map("no cone", |(base, r, apex, s)| {
        Cone::new(base, r, apex, s).map(Primitive::from)
    });
    prop_oneof![sphere, triangle, polygon, cone]
}

fn part() -> impl Strategy<Value = Part> {
    let sides = select(vec![Sides::Front, Sides::Back, Sides::Both]);
    let normals = prop::option::of(prop::array::uniform3(vector()));
    (primitive(), sides, normals).prop_map(|(primitive, sides, normals)| {
        let normals = normals.filter(|_| primitive.kind() == PrimitiveKind::Triangle);
        Part { primitive, sides, normals }
    })
}

/// What objects are made of: their materials' numbers and their parts.
fn objects() -> impl Strategy<Value = Vec<(u32, Vec<Part>)>> {
    (0..1000_i32).prop_flat_map(|far| {
        let part = part().prop_map(move |part| moved(part, f64::from(far)));
        prop::collection::vec((0..3_u32, prop::collection::vec(part, 1..8)), 0..8)
    })
}

/// The part, away from the origin.
fn moved(part: Part, far: f64) -> Part {
    let by = |point: DVec3| point + far * DVec3::new(1.0, -0.5, 0.25);
    let primitive = match &part.primitive {
        Primitive::Sphere(s) => Sphere::new(by(s.center()), s.radius()).into(),
        Primitive::Triangle(t) => t.vertices().map(by).map_into(),
        Primitive::Polygon(p) => {
            Polygon::new(p.vertices().iter().copied().map(by).collect()).map_or(part.primitive.clone(), Into::into)
        }
        Primitive::Cone(c) => Cone::new(by(c.base()), c.base_radius(), by(c.apex()), c.apex_radius())
            .map_or(part.primitive.clone(), Into::into),
    };
    Part { primitive, ..part }
}

trait IntoTriangle {
    fn map_into(self) -> Primitive;
}

impl IntoTriangle for [DVec3; 3] {
    fn map_into(self) -> Primitive {
        Triangle::new(self[0], self[1], self[2]).into()
    }
}
