//! What packets have found, in double precision: one by one, or a ray and its primitive a lane.

use rayset_geometry::{PrimitiveKind, RayLanes, Shear, ShearedLanes, Sides, Sphere, Triangle};
use rayset_simd::{LaneMask, Lanes, Simd};

use crate::frame::Frame;
use crate::packet::{Packet, RayColumns};
use crate::shapes::{Hit, Run, Shapes};

/// How many bits of a record's number say where in its run it stands.
pub(crate) const PLACE_BITS: u32 = 4;
/// No record.
pub(crate) const NONE: u32 = u32::MAX;

/// The number of what stands at a place of a run.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "`Shapes::suits_packets` has counted the runs")]
pub(crate) fn record_of(run: usize, place: u32) -> u32 {
    (run as u32) << PLACE_BITS | place
}

/// What the exact tests are made with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exact<'a, const W: usize> {
    pub(crate) shapes: &'a Shapes<W>,
    pub(crate) frame: &'a Frame,
    pub(crate) rays: &'a RayColumns<'a>,
}

impl<const W: usize> Exact<'_, W> {
    #[inline(always)]
    pub(crate) fn run_of(&self, record: u32) -> &Run {
        &self.shapes.runs()[(record >> PLACE_BITS) as usize]
    }

    /// The exact hit of a ray of the columns, if there is one, of a record.
    #[inline(never)]
    pub(crate) fn hit(&self, ray: usize, record: u32) -> Option<Hit> {
        let run = self.run_of(record);
        let index = run.first + (record & ((1 << PLACE_BITS) - 1));
        let departure = self.shapes.departure(self.rays.left(ray));
        let (ray, span) = self.rays.ray(ray);
        self.shapes.exact_alone(&ray, span, departure, run, index)
    }
}

/// Rays of which each is tested against a primitive of its own, a lane each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pairs<S: Simd> {
    rays: RayLanes<S>,
    span: [S::F64; 2],
}

impl<S: Simd> Pairs<S> {
    /// The rays of columns from a place on.
    #[inline(always)]
    pub(crate) fn new(simd: S, columns: &RayColumns<'_>, at: usize) -> Self {
        let zero = simd.splat_f64(0.0);
        let (mut origin, mut direction) = ([zero; 3], [zero; 3]);
        for k in 0..3 {
            origin[k] = simd.load_f64(&columns.origins[k][at..]);
            direction[k] = simd.load_f64(&columns.directions[k][at..]);
        }
        let (starts, ends) = columns.spans;
        let span = [simd.load_f64(&starts[at..]).max(zero), simd.load_f64(&ends[at..])];
        Self { rays: RayLanes { origin, direction }, span }
    }
}

/// The lanes of pairs that were asked for and are tested, and those whose front and back may be hit.
#[derive(Clone, Copy, Debug, Default)]
struct Wanted {
    lanes: u32,
    front: u32,
    back: u32,
}

impl Wanted {
    /// Adds a lane that leaves its primitive, or not, and into its front.
    #[inline(always)]
    fn add(&mut self, lane: usize, run: &Run, (leaves, outwards): (bool, bool)) {
        let never_again = if run.kind == PrimitiveKind::Triangle { leaves } else { outwards };
        self.lanes |= 1 << lane;
        self.front |= u32::from(run.sides != Sides::Back && !leaves) << lane;
        self.back |= u32::from(run.sides != Sides::Front && !never_again) << lane;
    }

    /// Writes the hits of the lanes that were wanted; gives these.
    #[inline(always)]
    fn write<L: Lanes<Scalar = f64>, const W: usize>(
        &self,
        (is_hit, t): (L::Mask, L),
        primitives: &[u32; W],
        found: &mut [Option<Hit>],
    ) -> u32 {
        let mut hits = is_hit.bits() & self.lanes;
        debug_assert_eq!(hits, self.lanes, "a sure hit is one");
        let mut distances = [0.0; W];
        t.store(&mut distances);
        while hits != 0 {
            let lane = hits.trailing_zeros() as usize;
            hits &= hits - 1;
            found[lane] = Some(Hit { t: distances[lane], primitive: primitives[lane] });
        }
        self.lanes
    }
}

impl<const W: usize> Exact<'_, W> {
    /// Of some rays of a packet, counted from a lane on, the exact hits of spheres; gives the rays that have one.
    #[inline(always)]
    pub(crate) fn spheres<S: Simd>(
        &self,
        simd: S,
        packet: &Packet<S, W>,
        pairs: &Pairs<S>,
        records: &[u32],
        (first, mut lanes): (usize, u32),
        found: &mut [Option<Hit>],
    ) -> u32 {
        let mut spheres = [[0.0; W]; 4];
        let mut primitives = [0; W];
        let mut wanted = Wanted::default();
        while lanes != 0 {
            let i = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let run = self.run_of(records[i]);
            if run.kind != PrimitiveKind::Sphere {
                continue;
            }
            let place = records[i] & ((1 << PLACE_BITS) - 1);
            let sphere = self.shapes.sphere(run.first + place);
            primitives[i] = self.shapes.number(run, place);
            let [x, y, z] = sphere.center().to_array();
            for (column, value) in spheres.iter_mut().zip([x, y, z, sphere.radius()]) {
                column[i] = value;
            }
            wanted.add(i, run, packet.leaves_from(first + i, primitives[i]));
        }
        if wanted.lanes == 0 {
            return 0;
        }
        let [x, y, z, radius] = &spheres;
        let center = [simd.load_f64(x), simd.load_f64(y), simd.load_f64(z)];
        let sphere = (center, simd.load_f64(radius));
        let sides = (simd.mask_f64(wanted.front), simd.mask_f64(wanted.back));
        let hits = Sphere::intersect_pairs(simd, &pairs.rays, pairs.span, sphere, sides);
        wanted.write(hits, &primitives, &mut found[first..])
    }

    /// The same for triangles, of the rays whose shear has the axes of the first.
    #[inline(always)]
    pub(crate) fn triangles<S: Simd>(
        &self,
        simd: S,
        packet: &Packet<S, W>,
        pairs: &Pairs<S>,
        records: &[u32],
        (first, mut lanes): (usize, u32),
        found: &mut [Option<Hit>],
    ) -> u32 {
        let mut corners = [[[0.0; W]; 3]; 3];
        let mut primitives = [0; W];
        let mut wanted = Wanted::default();
        while lanes != 0 {
            let i = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let run = self.run_of(records[i]);
            if run.kind != PrimitiveKind::Triangle {
                continue;
            }
            let place = records[i] & ((1 << PLACE_BITS) - 1);
            primitives[i] = self.shapes.number(run, place);
            let vertices = self.shapes.triangle(run.first + place).vertices();
            for (columns, vertex) in corners.iter_mut().zip(vertices) {
                for (column, value) in columns.iter_mut().zip(vertex.to_array()) {
                    column[i] = value;
                }
            }
            wanted.add(i, run, packet.leaves_from(first + i, primitives[i]));
        }
        if wanted.lanes == 0 {
            return 0;
        }
        let at = packet.first + first + wanted.lanes.trailing_zeros() as usize;
        let [x, y, z] = self.rays.directions;
        let axes = Shear::axes_of([x[at], y[at], z[at]]);
        let (rays, is_alike) = ShearedLanes::along(simd, axes, &pairs.rays, pairs.span);
        let is_alike = is_alike.bits();
        wanted.lanes &= is_alike;
        let zero = simd.splat_f64(0.0);
        let mut vertices = [[zero; 3]; 3];
        for (vertex, columns) in vertices.iter_mut().zip(&corners) {
            for k in 0..3 {
                vertex[k] = simd.load_f64(&columns[axes[k]]);
            }
        }
        let sides = (simd.mask_f64(wanted.front & is_alike), simd.mask_f64(wanted.back & is_alike));
        let hits = Triangle::intersect_pairs(simd, &rays, vertices, sides);
        wanted.write(hits, &primitives, &mut found[first..])
    }
}
