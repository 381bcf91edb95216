//! From what tobj has parsed to triangles.

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Sides, Triangle};

use super::ObjGroup;
use super::polygon::{Fanned, Triangulator};
use super::runs::{Run, Used};
use crate::Part;

/// The group of each run, from tobj's groups, which are called by the number of their run.
///
/// What tobj holds of a group is dropped as soon as it is converted. `resolved` has the materials of the names that
/// were unknown. Also tells which faces were cut into fans.
pub(super) fn from_models(
    models: Vec<tobj::Model>,
    runs: Vec<Run>,
    resolved: &[Option<usize>],
) -> (Vec<ObjGroup>, Fanned) {
    let mut groups: Vec<_> = runs
        .into_iter()
        .map(|run| {
            let material = match run.material {
                Used::Nothing => None,
                Used::Known(index) => Some(index),
                Used::Unknown(index) => resolved[index],
            };
            // The triangles are made room for when they come.
            (run.triangles, ObjGroup { name: run.name, material, triangles: Vec::new() })
        })
        .collect();
    let mut triangulator = Triangulator::default();
    for model in models {
        // The last one is empty if there are no faces at all.
        let run = model.name.parse().ok().and_then(|run: usize| groups.get_mut(run));
        let Some((n_triangles, group)) = run else { continue };
        group.triangles.reserve_exact(n_triangles.saturating_sub(group.triangles.len()));
        add_faces(&model.mesh, &mut triangulator, &mut group.triangles);
    }
    (groups.into_iter().map(|(_, group)| group).collect(), triangulator.fanned())
}

fn add_faces(mesh: &tobj::Mesh, triangulator: &mut Triangulator, triangles: &mut Vec<Part>) {
    let vector = |values: &[f64], index: u32| {
        let start = index as usize * 3;
        DVec3::new(values[start], values[start + 1], values[start + 2])
    };
    let mut positions: Vec<DVec3> = Vec::new();
    let mut start = 0;
    // Without arities all faces are triangles.
    let arities = mesh.face_arities.iter().map(|&arity| arity as usize);
    let all_three = std::iter::repeat(3).take_while(|_| mesh.face_arities.is_empty());
    for n_corners in arities.chain(all_three) {
        let face = start..start + n_corners;
        let Some(indices) = mesh.indices.get(face.clone()) else { break };
        // All corners of a cut have a normal, or none has.
        let normals = mesh.normal_indices.get(face);
        start += n_corners;
        positions.clear();
        positions.extend(indices.iter().map(|&index| vector(&mesh.positions, index)));
        for &corners in triangulator.triangulate(&positions) {
            let [a, b, c] = corners.map(|corner| positions[corner as usize]);
            let normals = normals
                .map(|normals| corners.map(|corner| vector(&mesh.normals, normals[corner as usize])))
                .filter(|normals| normals.iter().all(|normal| *normal != DVec3::ZERO));
            triangles.push(Part { primitive: Triangle::new(a, b, c).into(), sides: Sides::Both, normals });
        }
    }
}
