//! How the primitives of a scene are laid out for testing.

use std::cmp::Ordering;

use rayset_geometry::glam::DVec3;
use rayset_geometry::{BoundingBox, BoundingSphere, ColumnRun, Primitive, PrimitiveKind, enclosing_sphere};

use crate::{
    MaterialId, Object, ObjectId, Part, PrimitiveId, PrimitiveLocation, PrimitiveSurface, Scene, SurfaceForm,
    VolumeId,
};

impl Scene {
    /// Appends an object under one volume, or several if it has more primitives than a volume may hold; of its material,
    /// the first that is the same is given too.
    pub(crate) fn push_object(
        &mut self,
        name: String,
        (material, first_material): (MaterialId, MaterialId),
        parts: &[Part],
        patch_normals: &[Vec<DVec3>],
        max_volume_primitives: Option<u32>,
    ) {
        let object = ObjectId(id(self.objects.len() + 1));
        let first = id(self.locations.len() + 1);
        let nowhere = PrimitiveLocation { kind: PrimitiveKind::Sphere, index: 0, volume: VolumeId(0) };
        self.locations.resize(self.locations.len() + parts.len(), nowhere);
        let unknown =
            PrimitiveSurface { vector: DVec3::ZERO, material: first_material, form: SurfaceForm::Cone };
        self.surfaces.resize(self.locations.len(), unknown);
        let mut all: Vec<usize> = (0..parts.len()).collect();
        let max = max_volume_primitives.map_or(usize::MAX, |max| max as usize);
        let mut only = None;
        for_each_piece(parts, &mut all, max, &mut |piece| {
            let bounds = self.push_volume(object, first, parts, patch_normals, piece);
            only = (piece.len() == parts.len()).then_some(bounds);
        });
        let bounds = only.unwrap_or_else(|| enclosing_sphere(parts.iter().map(|part| &part.primitive)));
        let primitives = first..id(self.locations.len() + 1);
        self.objects.push(Object { name, material, bounds, primitives });
    }

    /// Appends a volume round a piece of an object; columns are sorted by kind and sides, so that every run is
    /// uniform.
    fn push_volume(
        &mut self,
        object: ObjectId,
        first: u32,
        parts: &[Part],
        patch_normals: &[Vec<DVec3>],
        piece: &mut [usize],
    ) -> BoundingSphere {
        let volume = VolumeId(id(self.volumes.len() + 1));
        piece.sort_unstable_by_key(|&i| (parts[i].primitive.kind(), parts[i].sides, i));
        let first_run = id(self.runs.len() + 1);
        for &i in &*piece {
            let part = &parts[i];
            self.extent = self.extent.max(part.primitive.extent());
            self.bounds = self.bounds.union(part.primitive.bounding_box());
            let run = self.primitives.push(&part.primitive, part.sides);
            let primitive = first + id(i + 1);
            self.locations[primitive as usize] =
                PrimitiveLocation { kind: run.kind, index: run.range.start, volume };
            self.ids[run.kind as usize].push(PrimitiveId(primitive));
            let is_smooth =
                part.normals.is_some() || patch_normals.get(i).is_some_and(|normals| !normals.is_empty());
            let flat = if is_smooth { SurfaceForm::Smooth } else { SurfaceForm::Flat };
            let surface = &mut self.surfaces[primitive as usize];
            (surface.vector, surface.form) = match &part.primitive {
                Primitive::Sphere(sphere) => (sphere.center(), SurfaceForm::Sphere),
                Primitive::Triangle(triangle) => (triangle.normal(), flat),
                Primitive::Polygon(polygon) => (polygon.normal(), flat),
                Primitive::Cone(_) => (DVec3::ZERO, SurfaceForm::Cone),
            };
            if let Some(normals) = part.normals {
                self.vertex_normal_index.resize(run.range.start as usize, u32::MAX);
                self.vertex_normal_index.push(id(self.vertex_normals.len() + 1));
                self.vertex_normals.push(normals);
            }
            if let (Primitive::Polygon(polygon), Some(normals)) = (&part.primitive, patch_normals.get(i)) {
                self.patches.push(run.range.start, polygon.vertices(), normals);
            }
            self.extend_runs(first_run, run);
        }
        let bounds = enclosing_sphere(piece.iter().map(|&i| &parts[i].primitive));
        self.volumes.push(&bounds);
        self.volume_objects.push(object);
        self.volume_runs.push(first_run..id(self.runs.len() + 1));
        bounds
    }

    fn extend_runs(&mut self, first_run: u32, run: ColumnRun) {
        match self.runs[first_run as usize..].last_mut() {
            Some(last)
                if (last.kind, last.sides, last.range.end) == (run.kind, run.sides, run.range.start) =>
            {
                last.range.end = run.range.end;
            }
            _ => self.runs.push(run),
        }
    }
}

/// Halves a set of parts, across the longest side of the box round their middles, until no piece exceeds `max`.
fn for_each_piece(parts: &[Part], piece: &mut [usize], max: usize, visit: &mut impl FnMut(&mut [usize])) {
    if piece.len() <= max {
        visit(piece);
        return;
    }
    let middle = |i: usize| parts[i].primitive.bounding_box().center();
    let size = piece.iter().map(|&i| middle(i)).collect::<BoundingBox>().diagonal();
    let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b]).then(b.cmp(&a))).unwrap_or(0);
    piece.sort_by_cached_key(|&i| (OrderedBits(middle(i)[axis]), i));
    // Pieces of equal size, as few as can be.
    let n_pieces = piece.len().div_ceil(max);
    let cut = piece.len() * (n_pieces / 2) / n_pieces;
    let (low, high) = piece.split_at_mut(cut);
    for_each_piece(parts, low, max, visit);
    for_each_piece(parts, high, max, visit);
}

/// A float in its total order.
struct OrderedBits(f64);

impl Ord for OrderedBits {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for OrderedBits {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for OrderedBits {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for OrderedBits {}

/// The id of the last of `len` things.
pub(crate) fn id(len: usize) -> u32 {
    u32::try_from(len - 1).expect("fewer than 2^32 of anything")
}

#[cfg(test)]
mod tests {
    #![expect(clippy::float_cmp, reason = "numbers that no rounding touches")]

    use rayset_geometry::{Sides, Sphere, Triangle};

    use super::*;
    use crate::{Material, SceneBuilder};

    fn sphere(x: f64) -> Part {
        Sphere::new(DVec3::new(x, 0.0, 0.0), 1.0).into()
    }

    fn triangle() -> Part {
        Triangle::new(DVec3::ZERO, DVec3::X, DVec3::Y).into()
    }

    #[test]
    fn primitives_are_numbered_by_object_whatever_their_kind() {
        let mut builder = SceneBuilder::new();
        let material = builder.add_material(Material::default());
        builder.add_object("a", material, [triangle(), sphere(0.0), triangle()]);
        builder.add_object("b", material, [sphere(3.0)]);
        let scene = builder.build().unwrap();
        assert_eq!(scene.objects()[0].primitives, 0..3);
        assert_eq!(scene.objects()[1].primitives, 3..4);
        for i in 0..4 {
            let PrimitiveLocation { kind, index, .. } = scene.location(PrimitiveId(i));
            assert_eq!(scene.primitive_id(kind, index), PrimitiveId(i));
        }
        assert_eq!(scene.location(PrimitiveId(2)).kind, PrimitiveKind::Triangle);
        let runs = scene.volume_runs(VolumeId(0));
        assert_eq!(runs.len(), 2);
        assert_eq!((runs[0].kind, runs[0].range.clone()), (PrimitiveKind::Sphere, 0..1));
        assert_eq!((runs[1].kind, runs[1].range.clone()), (PrimitiveKind::Triangle, 0..2));
        assert_eq!(scene.volume_runs(VolumeId(1))[0].range, 1..2);
        assert_eq!(scene.volume_object(VolumeId(1)), ObjectId(1));
        assert_eq!(scene.extent(), 4.0);
    }

    #[test]
    fn split_objects_keep_their_ids_and_every_volume_is_small() {
        let build = |max| {
            let mut builder = SceneBuilder::new();
            let material = builder.add_material(Material::default());
            // 23 spheres in two rows, out of order along x, and triangles between them.
            let ball = |i: u32| sphere(f64::from(i * 7 % 23));
            builder.add_object("a", material, (0..23).map(ball).chain([triangle(), triangle()]));
            builder.add_object("b", material, [sphere(30.0)]);
            builder.max_volume_primitives(max);
            builder.build().unwrap()
        };
        let (whole, split) = (build(None), build(Some(4)));
        assert_eq!((whole.volumes().len(), split.volumes().len()), (2, 8));
        assert_eq!(whole.objects(), split.objects());
        for i in 0..26 {
            let id = PrimitiveId(i);
            let primitive = |scene: &Scene| {
                let PrimitiveLocation { kind, index, volume } = scene.location(id);
                assert_eq!(scene.primitive_id(kind, index), id);
                assert_eq!(scene.volume_object(volume), ObjectId(u32::from(i == 25)));
                let is_inside = scene
                    .volume_runs(volume)
                    .iter()
                    .any(|run| run.kind == kind && run.range.contains(&index));
                assert!(is_inside, "{i}");
                // Tells spheres apart by their centres.
                scene.primitives().normal_at(kind, index, DVec3::splat(100.0))
            };
            assert_eq!(primitive(&whole), primitive(&split), "{i}");
        }
        let size = |volume: u32| -> u32 {
            split.volume_runs(VolumeId(volume)).iter().map(|run| run.range.end - run.range.start).sum()
        };
        assert_eq!((0..8).map(size).collect::<Vec<_>>(), [3, 3, 4, 3, 4, 4, 4, 1]);
    }

    #[test]
    fn runs_have_one_kind_of_sides() {
        let mut builder = SceneBuilder::new();
        let material = builder.add_material(Material::default());
        let front = Part { sides: Sides::Front, ..sphere(1.0) };
        builder.add_object("a", material, [sphere(0.0), front, sphere(2.0)]);
        let scene = builder.build().unwrap();
        let runs = scene.volume_runs(VolumeId(0));
        assert_eq!(runs.iter().map(|run| run.sides).collect::<Vec<_>>(), [Sides::Front, Sides::Both]);
        assert_eq!(scene.primitive_id(PrimitiveKind::Sphere, 0), PrimitiveId(1));
    }
}
