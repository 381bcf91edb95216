//! Faces of any shape become triangles that cover them.
#![cfg(feature = "obj")]

use std::fmt::Write as _;
use std::io;
use std::path::Path;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rayset_scene::geometry::Primitive;
use rayset_scene::glam::DVec3;
use rayset_scene::{LoadOptions, read_obj};

fn config() -> ProptestConfig {
    ProptestConfig { cases: 2000, rng_seed: RngSeed::Fixed(1985), ..ProptestConfig::default() }
}

/// Twice the vector areas of the triangles of one face.
fn triangles(corners: &[DVec3]) -> Vec<DVec3> {
    let mut obj = String::new();
    for corner in corners {
        writeln!(obj, "v {:e} {:e} {:e}", corner.x, corner.y, corner.z).unwrap();
    }
    obj.push('f');
    (1..=corners.len()).for_each(|i| write!(obj, " {i}").unwrap());
    let no_library = |_: &Path| Err(io::Error::from(io::ErrorKind::NotFound));
    let model = read_obj(obj.as_bytes(), Path::new("a.obj"), &LoadOptions::default(), no_library).unwrap();
    let area = |primitive: &Primitive| match primitive {
        Primitive::Triangle(triangle) => {
            let [a, b, c] = triangle.vertices();
            (b - a).cross(c - a)
        }
        other => panic!("{other:?} is no triangle"),
    };
    model.groups[0].triangles.iter().map(|part| area(&part.primitive)).collect()
}

proptest! {
    #![proptest_config(config())]

    /// Polygons that are seen whole from a point inside, concave as a rule, in any plane, of any size.
    #[test]
    fn star_shaped_faces_are_covered_once(
        radii in prop::collection::vec(0.05..1.0_f64, 4..60),
        normal in (-1.0..1.0_f64, -1.0..1.0_f64, 0.1..1.0_f64),
        exponent in -70..50_i32,
        reversed: bool,
    ) {
        let normal = DVec3::from(normal).normalize();
        let (across, up) = normal.any_orthonormal_pair();
        let scale: f64 = format!("1e{exponent}").parse().unwrap();
        let step = std::f64::consts::TAU / radii.len() as f64;
        let mut corners: Vec<DVec3> = radii.iter().enumerate().map(|(i, radius)| {
            let angle = step * i as f64;
            scale * *radius * (libm::cos(angle) * across + libm::sin(angle) * up)
        }).collect();
        if reversed {
            corners.reverse();
        }
        let expected = (0..radii.len())
            .map(|i| radii[i] * radii[(i + 1) % radii.len()] * libm::sin(step))
            .sum::<f64>() * scale * scale;
        let triangles = triangles(&corners);
        prop_assert_eq!(triangles.len(), corners.len() - 2);
        let front = if reversed { -normal } else { normal };
        let covered: f64 = triangles.iter().map(|area| area.length()).sum();
        let facing: f64 = triangles.iter().map(|area| area.dot(front)).sum();
        prop_assert!((covered - expected).abs() < 1e-9 * expected, "{} is covered of {}", covered, expected);
        prop_assert!((facing - expected).abs() < 1e-9 * expected, "{} faces the front of {}", facing, expected);
    }

    /// Corners on a grid: many coincide, lie on one line, or make edges that cross.
    #[test]
    fn any_face_becomes_triangles(corners in prop::collection::vec((0..4_i32, 0..4_i32, 0..2_i32), 3..20)) {
        let corners: Vec<_> = corners
            .into_iter()
            .map(|(x, y, z)| DVec3::new(f64::from(x), f64::from(y), f64::from(z)))
            .collect();
        let triangles = triangles(&corners);
        prop_assert!(!triangles.is_empty() && triangles.len() <= corners.len() - 2);
        // In both cuttings the vector area is that of the face, as far as it lies in one plane.
        let face = corners.windows(2).map(|pair| (pair[0] - corners[0]).cross(pair[1] - corners[0]));
        let face = face.fold(DVec3::ZERO, |sum, area| sum + area);
        if triangles.len() == corners.len() - 2 {
            let sum = triangles.iter().fold(DVec3::ZERO, |sum, area| sum + *area);
            prop_assert!((sum - face).length() < 1e-9, "{} is no {}", sum, face);
        }
    }
}
