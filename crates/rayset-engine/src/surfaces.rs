//! The surfaces at the hits of a level.

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Outward, Side, dot_lanes, unit_lanes};
use rayset_scene::{MaterialId, PrimitiveSurface, Scene, Spawns, SurfaceForm, SurfacePoint};
use rayset_simd::{LaneMask, Lanes, Simd};

use crate::lanes::{Numbers, ROWS, Vectors, load3, put, select, splat3, store, store3, vector};
use crate::{DEPARTURE_MARGIN, Hit, Surface};

/// The surfaces at the hits of sixteen rays; where a ray hits nothing, points and normals may be anything.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surfaces {
    /// The points, in world space.
    pub(crate) points: Vectors,
    /// The unit normals on the side the ray came from.
    pub(crate) normals: Vectors,
    /// The unit normals to shade with, on the same side.
    pub(crate) shading: Vectors,
    /// Where rays that leave begin to see other surfaces.
    pub(crate) starts: Numbers,
    /// The index of refraction of what is transmissive; [`ONLY_REFLECTS`] or [`SENDS_NOTHING`] of what is not.
    pub(crate) indices: Numbers,
    /// The material's number; [`NOTHING`] where a ray hits nothing.
    pub(crate) materials: [u32; ROWS],
    /// The rows whose rays hit something, as bits.
    pub(crate) hit: u32,
    /// The rows whose rays came from the back, as bits.
    pub(crate) backs: u32,
    /// The rows whose hits send rays, as bits.
    pub(crate) sending: u32,
    /// The rows whose surfaces are those of spheres, and of cones, as bits.
    spheres: u32,
    cones: u32,
    /// The rows whose normals to shade with are others than those of the surface, as bits.
    smooth: u32,
}

/// The material where a ray hits nothing.
pub(crate) const NOTHING: u32 = u32::MAX;

/// The index of refraction of what only reflects, and of what sends no ray: below those of all that is transmissive.
pub(crate) const ONLY_REFLECTS: f64 = 0.0;
const SENDS_NOTHING: f64 = -1.0;

impl Default for Surfaces {
    fn default() -> Self {
        Self {
            points: Vectors::default(),
            normals: Vectors::default(),
            shading: Vectors::default(),
            starts: Numbers::default(),
            indices: [SENDS_NOTHING; ROWS],
            materials: [NOTHING; ROWS],
            hit: 0,
            backs: 0,
            sending: 0,
            spheres: 0,
            cones: 0,
            smooth: 0,
        }
    }
}

impl Surfaces {
    /// Where some rays hit, and where what leaves begins to see other surfaces.
    #[inline(always)]
    pub(crate) fn arrive<S: Simd>(
        &mut self,
        simd: S,
        row: usize,
        (origin, direction, t): ([S::F64; 3], [S::F64; 3], S::F64),
        extent: f64,
    ) {
        let [[ox, oy, oz], [dx, dy, dz]] = [origin, direction];
        // As `Ray::at`.
        store3::<S>([ox + t * dx, oy + t * dy, oz + t * dz], &mut self.points, row);
        let largest = ox.abs().max(oy.abs().max(oz.abs()));
        let start = simd.splat_f64(DEPARTURE_MARGIN) * (largest + simd.splat_f64(extent));
        store::<S>(start, &mut self.starts, row);
    }

    /// Of what is hit: the normals of fronts, or what those of curved surfaces are found by, and what materials do with rays.
    #[expect(clippy::cast_possible_truncation, reason = "what is cut off is masked out")]
    pub(crate) fn find(&mut self, scene: &Scene, hits: &[Option<Hit>]) {
        // What is so of rows, a bit each: sixteen rows of one kind after the other, so that all are gathered at once.
        let mut rows = 0_u64;
        self.materials = [NOTHING; ROWS];
        self.indices = [SENDS_NOTHING; ROWS];
        for (hit, row) in hits.iter().zip(0..ROWS) {
            let Some(hit) = hit else { continue };
            let &PrimitiveSurface { vector, material, form } = scene.surface_of(hit.primitive);
            put(&mut self.normals, row, vector);
            let index = match scene.spawns_of(material) {
                Spawns::Nothing => SENDS_NOTHING,
                Spawns::Reflected => ONLY_REFLECTS,
                Spawns::Both { index } => index,
            };
            (self.materials[row], self.indices[row]) = (material.0, index);
            let sends = u64::from(index >= ONLY_REFLECTS);
            let is_sphere = u64::from(form == SurfaceForm::Sphere);
            let is_other = u64::from(matches!(form, SurfaceForm::Smooth | SurfaceForm::Cone));
            rows |= (1 | sends << ROWS | is_sphere << (2 * ROWS) | is_other << (3 * ROWS)) << row;
        }
        let [found, sending, spheres, others] =
            std::array::from_fn(|kind| (rows >> (kind * ROWS)) as u32 & (u32::MAX >> ROWS));
        (self.hit, self.sending, self.backs) = (found, sending, 0);
        (self.spheres, self.cones, self.smooth) = (spheres, 0, 0);
        if others != 0 {
            self.find_others(scene, hits, others);
        }
    }

    /// The same of cones, and of what is shaded with the normals of its vertices.
    fn find_others(&mut self, scene: &Scene, hits: &[Option<Hit>], mut rows: u32) {
        while rows != 0 {
            let row = rows.trailing_zeros() as usize;
            rows &= rows - 1;
            let Some(Some(hit)) = hits.get(row) else { continue };
            let point = vector(&self.points, row);
            if let Some(Outward { away, tilt }) = scene.outward_at(hit.primitive, point) {
                put(&mut self.normals, row, away);
                put(&mut self.shading, row, tilt.unwrap_or_default());
                self.cones |= 1 << row;
            } else {
                let SurfacePoint { normal, shading_normal } = scene.surface_at(hit.primitive, point);
                put(&mut self.normals, row, normal);
                put(&mut self.shading, row, shading_normal);
                self.smooth |= 1 << row;
            }
        }
    }

    /// Scales the normals of curved surfaces, and turns all to the sides that the rays came from; returns both kinds.
    #[inline(always)]
    pub(crate) fn turn<S: Simd>(
        &mut self,
        simd: S,
        row: usize,
        direction: [S::F64; 3],
        scene: &Scene,
        hits: &[Option<Hit>],
    ) -> [[S::F64; 3]; 2] {
        let zero = simd.splat_f64(0.0);
        let curved = (self.spheres | self.cones) >> row;
        let (is_curved, is_smooth) = (simd.mask_f64(curved), simd.mask_f64(self.smooth >> row));
        let mut normal = load3(simd, &self.normals, row);
        if is_curved.any() {
            normal = select::<S>(is_curved, self.scaled(simd, row, normal, scene, hits), normal);
        }
        let back = dot_lanes(normal, direction).gt(zero);
        let mut shading = turned::<S>(normal, back);
        if is_smooth.any() {
            let smooth = turned::<S>(load3(simd, &self.shading, row), back);
            // A normal that leans over so far that the ray would come from behind it shades nothing rightly.
            let is_kept = is_smooth & !dot_lanes(smooth, direction).gt(zero);
            shading = select::<S>(is_kept, smooth, shading);
        }
        let normal = turned::<S>(normal, back);
        store3::<S>(normal, &mut self.normals, row);
        store3::<S>(shading, &mut self.shading, row);
        self.backs |= back.bits() << row;
        [normal, shading]
    }

    /// The normals of curved surfaces, scaled, by what they are found by; of others, anything.
    #[inline(always)]
    fn scaled<S: Simd>(
        &mut self,
        simd: S,
        row: usize,
        found: [S::F64; 3],
        scene: &Scene,
        hits: &[Option<Hit>],
    ) -> [S::F64; 3] {
        let (is_sphere, is_cone) = (simd.mask_f64(self.spheres >> row), simd.mask_f64(self.cones >> row));
        let zero = simd.splat_f64(0.0);
        // What is scaled in vain has a length too.
        let upwards = splat3(simd, DVec3::Z);
        let point = load3(simd, &self.points, row);
        let from_center = [point[0] - found[0], point[1] - found[1], point[2] - found[2]];
        let away = select::<S>(is_sphere, from_center, select::<S>(is_cone, found, upwards));
        let (mut scaled, _) = unit_lanes(simd, away);
        let mut is_lost = !dot_lanes(scaled, scaled).gt(zero);
        if is_cone.any() {
            let tilt = load3(simd, &self.shading, row);
            let tilted = [scaled[0] - tilt[0], scaled[1] - tilt[1], scaled[2] - tilt[2]];
            let (tilted, _) = unit_lanes(simd, select::<S>(is_cone, tilted, upwards));
            is_lost = is_lost | !dot_lanes(tilted, tilted).gt(zero);
            scaled = select::<S>(is_cone, tilted, scaled);
        }
        if is_lost.any() {
            store3::<S>(scaled, &mut self.normals, row);
            self.find_lost(row, is_lost.bits(), scene, hits);
            scaled = load3(simd, &self.normals, row);
        }
        scaled
    }

    /// Normals of curved surfaces where none is defined: one by one.
    #[cold]
    fn find_lost(&mut self, first: usize, mut lanes: u32, scene: &Scene, hits: &[Option<Hit>]) {
        while lanes != 0 {
            let row = first + lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let Some(Some(hit)) = hits.get(row) else { continue };
            put(&mut self.normals, row, scene.surface_at(hit.primitive, vector(&self.points, row)).normal);
        }
    }

    /// The side that the ray of a row came from.
    #[inline]
    pub(crate) fn side(&self, row: usize) -> Side {
        if self.backs >> row & 1 == 1 { Side::Back } else { Side::Front }
    }

    /// The surface of a row whose ray hits something.
    pub(crate) fn surface(&self, row: usize) -> Surface {
        Surface {
            point: vector(&self.points, row),
            normal: vector(&self.normals, row),
            shading_normal: vector(&self.shading, row),
            side: self.side(row),
            material: MaterialId(self.materials[row]),
        }
    }
}

/// Vectors turned round in the lanes of a mask.
#[inline(always)]
fn turned<S: Simd>([x, y, z]: [S::F64; 3], mask: <S::F64 as Lanes>::Mask) -> [S::F64; 3] {
    [(-x).select(mask, x), (-y).select(mask, y), (-z).select(mask, z)]
}
