//! A picture in characters, with nothing but a hierarchy: spheres, what is seen of them, and their shadows.
//!
//! `cargo run --release -p rayset-bvh --example depth_picture`

#![expect(clippy::print_stdout, reason = "an example prints")]

use rayset_bvh::{Hierarchy, Query};
use rayset_geometry::glam::{DVec3, dvec3};
use rayset_geometry::{Ray, Side, Span, Sphere, unit};

const WIDTH: u32 = 72;
const HEIGHT: u32 = 30;
/// From dark to bright.
const SHADES: &[u8] = b".:-=+*#%@";

fn main() {
    let spheres = spiral();
    let hierarchy = Hierarchy::of_spheres(&spheres);

    // One list of eye rays, one call.
    let eye = dvec3(0.0, 3.0, -7.0);
    let mut eye_rays: Vec<Query> = Vec::new();
    for (row, column) in (0..HEIGHT).flat_map(|row| (0..WIDTH).map(move |column| (row, column))) {
        let across = 3.6 * (f64::from(column) / f64::from(WIDTH - 1) - 0.5);
        let up = 3.0 * (0.5 - f64::from(row) / f64::from(HEIGHT - 1));
        let target = dvec3(2.0 * across, 1.0 + 2.0 * up, 0.0);
        eye_rays.extend(Ray::between(eye, target).map(Query::from));
    }
    let mut hits = Vec::new();
    hierarchy.nearest_batch(&eye_rays, &mut hits);

    // From each hit a ray to the light: it leaves the sphere's outside, so it cannot meet that sphere again.
    let light = unit(dvec3(-1.0, 2.0, -1.5)).unwrap_or(DVec3::Y);
    let mut pixels = Vec::new();
    let mut light_rays = Vec::new();
    for (pixel, (query, hit)) in eye_rays.iter().zip(&hits).enumerate() {
        if let Some(hit) = hit {
            let point = query.ray.at(hit.t);
            let brightness = spheres[hit.primitive as usize].normal_at(point).dot(light);
            pixels.push((pixel, brightness));
            let ray = Ray::new(point, light);
            light_rays.push(Query::leaving(ray, Span::FORWARD, hit.primitive, Side::Front));
        }
    }
    let mut shadows = Vec::new();
    hierarchy.occluded_batch(&light_rays, &mut shadows);

    let mut picture = vec![b' '; eye_rays.len()];
    for (&(pixel, brightness), &is_shadowed) in pixels.iter().zip(&shadows) {
        let brightness = if is_shadowed { 0.0 } else { brightness.max(0.0) };
        picture[pixel] = shade(brightness);
    }
    for row in picture.chunks(WIDTH as usize) {
        println!("{}", String::from_utf8_lossy(row));
    }
    let n_shadowed = shadows.iter().filter(|&&is_shadowed| is_shadowed).count();
    println!(
        "{} spheres, {} eye rays, {} hits, {n_shadowed} of them in shadow; {} bytes, {} nodes deep",
        spheres.len(),
        eye_rays.len(),
        pixels.len(),
        hierarchy.bytes(),
        hierarchy.depth()
    );
}

/// Small spheres that wind up round a large one.
fn spiral() -> Vec<Sphere> {
    let mut spheres = vec![Sphere::new(dvec3(0.0, 0.8, 0.0), 1.5)];
    // Turning a vector by a fixed step needs no sine.
    let (mut x, mut z) = (2.4, 0.0);
    for i in 0..400 {
        let height = -1.2 + 0.01 * f64::from(i);
        spheres.push(Sphere::new(dvec3(x, height, z), 0.12));
        (x, z) = (0.995 * x - 0.1 * z, 0.1 * x + 0.995 * z);
        let length = (x * x + z * z).sqrt();
        (x, z) = (2.4 * x / length, 2.4 * z / length);
    }
    spheres
}

fn shade(brightness: f64) -> u8 {
    let mut shade = SHADES[0];
    for (i, &other) in (0..).zip(SHADES) {
        if brightness * 9.0 >= f64::from(i) {
            shade = other;
        }
    }
    shade
}
