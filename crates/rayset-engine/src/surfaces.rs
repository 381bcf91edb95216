//! The surfaces at the hits of a level.

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Outward, Side, unit_lanes};
use rayset_scene::{MaterialId, Scene, Spawns, SurfacePoint};
use rayset_simd::{LaneMask, Lanes, Simd};

use crate::lanes::{Numbers, ROWS, Vectors, dot, load3, select, splat3, store, store3, vector};
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
    /// The rows whose surfaces are curved, and those of cones among them, as bits.
    curved: u32,
    cones: u32,
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
            curved: 0,
            cones: 0,
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

    /// The normals of the fronts, those of curved surfaces before they are scaled, and what the materials do with rays.
    pub(crate) fn find(&mut self, scene: &Scene, hits: &[Option<Hit>]) {
        let [mut found, mut sending, mut curved, mut cones] = [0_u32; 4];
        self.materials = [NOTHING; ROWS];
        self.indices = [SENDS_NOTHING; ROWS];
        for (row, hit) in hits.iter().enumerate().take(ROWS) {
            let Some(hit) = hit else { continue };
            found |= 1 << row;
            let point = vector(&self.points, row);
            if let Some(Outward { away, tilt }) = scene.outward_at(hit.primitive, point) {
                self.put(row, away, tilt.unwrap_or_default());
                curved |= 1 << row;
                cones |= u32::from(tilt.is_some()) << row;
            } else {
                let SurfacePoint { normal, shading_normal } = scene.surface_at(hit.primitive, point);
                self.put(row, normal, shading_normal);
            }
            let material = scene.material_id_of(hit.object);
            let index = match scene.spawns_of(material) {
                Spawns::Nothing => SENDS_NOTHING,
                Spawns::Reflected => ONLY_REFLECTS,
                Spawns::Both { index } => index,
            };
            sending |= u32::from(index >= ONLY_REFLECTS) << row;
            (self.materials[row], self.indices[row]) = (material.0, index);
        }
        (self.hit, self.sending, self.curved, self.cones, self.backs) = (found, sending, curved, cones, 0);
    }

    #[inline(always)]
    fn put(&mut self, row: usize, normal: DVec3, shading: DVec3) {
        let ([nx, ny, nz], [sx, sy, sz]) = (&mut self.normals, &mut self.shading);
        (nx[row], ny[row], nz[row]) = normal.into();
        (sx[row], sy[row], sz[row]) = shading.into();
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
        if simd.mask_f64(self.curved >> row).any() {
            self.scale(simd, row, scene, hits);
        }
        let (normal, shading) = (load3(simd, &self.normals, row), load3(simd, &self.shading, row));
        let back = dot(normal, direction).gt(zero);
        let (normal, shading) = (turned::<S>(normal, back), turned::<S>(shading, back));
        // A normal that leans over so far that the ray would come from behind it shades nothing rightly.
        let shading = select::<S>(dot(shading, direction).gt(zero), normal, shading);
        store3::<S>(normal, &mut self.normals, row);
        store3::<S>(shading, &mut self.shading, row);
        self.backs |= back.bits() << row;
        [normal, shading]
    }

    /// Scales the normals of curved surfaces.
    #[inline(always)]
    fn scale<S: Simd>(&mut self, simd: S, row: usize, scene: &Scene, hits: &[Option<Hit>]) {
        let (is_curved, is_cone) = (simd.mask_f64(self.curved >> row), simd.mask_f64(self.cones >> row));
        let zero = simd.splat_f64(0.0);
        let (normal, shading) = (load3(simd, &self.normals, row), load3(simd, &self.shading, row));
        // What is scaled in vain has a length too.
        let upwards = splat3(simd, DVec3::Z);
        let (mut scaled, _) = unit_lanes(simd, select::<S>(is_curved, normal, upwards));
        let mut is_lost = !dot(scaled, scaled).gt(zero);
        if is_cone.any() {
            let tilted = [scaled[0] - shading[0], scaled[1] - shading[1], scaled[2] - shading[2]];
            let (tilted, _) = unit_lanes(simd, select::<S>(is_cone, tilted, upwards));
            is_lost = is_lost | !dot(tilted, tilted).gt(zero);
            scaled = select::<S>(is_cone, tilted, scaled);
        }
        store3::<S>(select::<S>(is_curved, scaled, normal), &mut self.normals, row);
        store3::<S>(select::<S>(is_curved, scaled, shading), &mut self.shading, row);
        if is_lost.any() {
            self.find_lost(row, is_lost.bits(), scene, hits);
        }
    }

    /// Normals of curved surfaces where none is defined: one by one.
    #[cold]
    fn find_lost(&mut self, first: usize, mut lanes: u32, scene: &Scene, hits: &[Option<Hit>]) {
        while lanes != 0 {
            let row = first + lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let Some(Some(hit)) = hits.get(row) else { continue };
            let SurfacePoint { normal, shading_normal } =
                scene.surface_at(hit.primitive, vector(&self.points, row));
            self.put(row, normal, shading_normal);
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
