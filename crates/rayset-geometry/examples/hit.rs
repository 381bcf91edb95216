//! Finds the nearest of several primitives: `cargo run -p rayset-geometry --example hit`.
#![expect(clippy::print_stdout, reason = "an example shows its result")]

use rayset_geometry::glam::dvec3;
use rayset_geometry::{
    Cone, PARTITION_MARGIN, Polygon, Primitive, Ray, Sides, Span, Sphere, Triangle, VolumeSet,
    enclosing_sphere,
};

fn main() {
    let square =
        vec![dvec3(-2.0, -2.0, 9.0), dvec3(2.0, -2.0, 9.0), dvec3(2.0, 2.0, 9.0), dvec3(-2.0, 2.0, 9.0)];
    let primitives: [Primitive; 4] = [
        Sphere::new(dvec3(0.0, 0.0, 5.0), 1.0).into(),
        Triangle::new(dvec3(-3.0, -1.0, 4.0), dvec3(3.0, -1.0, 4.0), dvec3(0.0, -3.0, 4.0)).into(),
        Polygon::new(square).expect("a square has an area").into(),
        Cone::new(dvec3(0.0, 1.5, 3.0), 0.5, dvec3(0.0, 3.0, 3.0), 0.0).expect("it has a height").into(),
    ];
    let bounds = enclosing_sphere(&primitives);
    println!("all within {:.3} of {:.3}", bounds.radius, bounds.center);
    for y in [0.0, -1.5, 1.75, 2.75, 20.0] {
        let ray = Ray::between(dvec3(0.0, 0.0, -1.0), dvec3(0.0, y, 5.0)).expect("two different points");
        let extent = primitives.iter().map(Primitive::extent).fold(0.0, f64::max);
        let slack = PARTITION_MARGIN * (ray.origin().abs().max_element() + extent);
        let set = VolumeSet::of(&ray, &bounds, slack);
        let hit = |p| Some((Primitive::intersect(p, &ray, Span::FORWARD, Sides::Both, None)?, p.kind()));
        match primitives.iter().filter_map(hit).min_by(|a, b| a.0.total_cmp(&b.0)) {
            Some((t, kind)) => println!("towards y = {y}: {set:?}, {kind:?} at {:.3}", ray.at(t)),
            None => println!("towards y = {y}: {set:?}, no hit"),
        }
    }
}
