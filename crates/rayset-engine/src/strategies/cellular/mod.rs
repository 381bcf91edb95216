//! Cellular subdivision: single rays through a uniform grid over all primitives.
//!
//! The alternative that section 1 of Speer et al. 1985 names beside coherence. A ray visits the cells it passes through
//! from its origin on, and is tested against what overlaps them, until no later cell can hold a nearer hit. The grid
//! only culls: every hit is that of the geometry's test, and the cells are wide enough that none is lost.
//!
//! Source: Glassner 1984, "Space subdivision for fast ray tracing"; Fujimoto, Tanaka, Iwata 1986, "ARTS: accelerated
//! ray-tracing system", for equal cells and the digital differential analyser; Amanatides, Woo 1987, "A fast voxel
//! traversal algorithm for ray tracing", for the steps and for testing no primitive twice.
//! Deviation: crossings are computed from the planes and not added up, and rays that are in doubt are partitioned, so
//! that no rounding loses a hit: see `docs/numerics.md`.

mod grid;
#[cfg(test)]
mod tests;
mod walk;

use rayset_geometry::{ColumnRun, PrimitiveKind, Probe};
use rayset_scene::Scene;
use rayset_simd::{Backend, Kernel, Scalar, Simd};

use self::grid::{CELL_MARGIN, Grid};
use self::walk::{Entry, Walk};
use super::partition::{Partition, departure};
use super::standard::Standard;
use crate::strategy::LaneTracer;
use crate::{Hit, IntersectionStrategy, Originating, RayQuery, Recording, ShadowQuery, Stats, Tracer};

/// A uniform grid, exact.
#[derive(Debug)]
pub struct Cellular<'s> {
    standard: Standard<'s>,
    scene: &'s Scene,
    backend: Backend,
    /// None where there is nothing to hold, or where no proof would hold.
    grid: Option<Grid>,
}

impl<'s> Cellular<'s> {
    /// Binds the strategy to a scene, on the lanes of [`Backend::active`]: builds the grid.
    #[must_use]
    pub fn new(scene: &'s Scene) -> Self {
        Self::on(scene, Backend::active())
    }

    /// Binds the strategy to a scene, on the lanes of a backend: builds the grid.
    #[must_use]
    pub fn on(scene: &'s Scene, backend: Backend) -> Self {
        Self::with_margin(scene, backend, CELL_MARGIN)
    }

    fn with_margin(scene: &'s Scene, backend: Backend, margin: f64) -> Self {
        Self { standard: Standard::on(scene, backend), scene, backend, grid: Grid::of(scene, margin) }
    }
}

impl IntersectionStrategy for Cellular<'_> {
    fn name(&self) -> &'static str {
        "cellular"
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn scene(&self) -> &Scene {
        self.scene
    }

    fn begin_sweep(&self, recording: Recording) -> Box<dyn Tracer + '_> {
        let Some(grid) = &self.grid else { return self.standard.begin_sweep(recording) };
        Box::new(CellularTracer {
            scene: self.scene,
            grid,
            backend: self.backend,
            recording,
            mailboxes: Mailboxes::of(grid),
            partition: Partition::default(),
            stats: Stats::default(),
        })
    }
}

struct CellularTracer<'s> {
    scene: &'s Scene,
    grid: &'s Grid,
    backend: Backend,
    recording: Recording,
    mailboxes: Mailboxes,
    partition: Partition,
    stats: Stats,
}

/// Which primitives the ray in hand was tested against.
///
/// Source: Amanatides, Woo 1987, section 3 (ray ids kept with the objects; here with the tracer, so that threads share
/// none).
#[derive(Debug)]
struct Mailboxes {
    /// The last ray that each member was tested against; 0 for none.
    rays: Vec<u32>,
    ray: u32,
}

impl Mailboxes {
    fn of(grid: &Grid) -> Self {
        Self { rays: vec![0; grid.n_members()], ray: 0 }
    }

    /// Goes on to the next ray.
    #[inline(always)]
    fn next_ray(&mut self) {
        self.ray = self.ray.wrapping_add(1);
        if self.ray == 0 {
            self.rays.fill(0);
            self.ray = 1;
        }
    }

    /// Whether a member is new to the ray; it is not any more.
    #[inline(always)]
    fn is_new(&mut self, member: u32) -> bool {
        std::mem::replace(&mut self.rays[member as usize], self.ray) != self.ray
    }
}

/// The members of a cell that are new to a ray, as runs.
struct NewRuns<'a> {
    grid: &'a Grid,
    references: &'a [u32],
    mailboxes: &'a mut Mailboxes,
}

impl Iterator for NewRuns<'_> {
    type Item = ColumnRun;

    #[inline(always)]
    fn next(&mut self) -> Option<ColumnRun> {
        while let Some((&first, mut rest)) = self.references.split_first() {
            self.references = rest;
            if !self.mailboxes.is_new(first) {
                continue;
            }
            let mut run = self.grid.member(first).run.clone();
            let mut last = first;
            while let Some((&next, after)) = rest.split_first()
                && next == last + 1
                && self.grid.member(next).follows
                && self.mailboxes.is_new(next)
            {
                run.range.end += 1;
                last = next;
                rest = after;
            }
            self.references = rest;
            return Some(run);
        }
        None
    }
}

/// Whether a run has work for one lane only: one primitive, but for a polygon, whose edges fill the lanes.
#[inline(always)]
fn is_single(run: &ColumnRun) -> bool {
    run.range.end - run.range.start == 1 && run.kind != PrimitiveKind::Polygon
}

impl CellularTracer<'_> {
    /// The runs to test in the cell that a walk has come to.
    #[inline(always)]
    fn new_runs<'a>(grid: &'a Grid, walk: &Walk<'_>, mailboxes: &'a mut Mailboxes) -> NewRuns<'a> {
        NewRuns { grid, references: grid.references(walk.cell), mailboxes }
    }

    #[inline(always)]
    fn walk<S: Simd>(
        &mut self,
        mut walk: Walk<'_>,
        probe: &Probe<S>,
        originating: Option<Originating>,
    ) -> Option<Hit> {
        let (scene, work) = (self.scene, &mut self.stats.work);
        let departure = departure(scene, originating);
        let mut nearest: Option<Hit> = None;
        let single = Probe::new(Scalar, probe.ray(), probe.span(), scene.primitives().is_flat());
        self.mailboxes.next_ray();
        loop {
            work.cells_visited += 1;
            for run in Self::new_runs(self.grid, &walk, &mut self.mailboxes) {
                work.primitive_tests += u64::from(run.range.end - run.range.start);
                let hit = if is_single(&run) {
                    scene.primitives().nearest(&single, &run, departure)
                } else {
                    scene.primitives().nearest(probe, &run, departure)
                };
                let Some(hit) = hit else { continue };
                let primitive = scene.primitive_id(run.kind, hit.index);
                let object = scene.volume_object(scene.location(primitive).volume);
                let hit = Hit { t: hit.t, object, primitive };
                if nearest.is_none_or(|nearest| hit.precedes(&nearest)) {
                    nearest = Some(hit);
                }
            }
            if !walk.step(nearest.map_or(f64::INFINITY, |hit| hit.t)) {
                return nearest;
            }
        }
    }

    #[inline(always)]
    fn walk_to_light<S: Simd>(
        &mut self,
        mut walk: Walk<'_>,
        probe: &Probe<S>,
        originating: Originating,
    ) -> bool {
        let (scene, work) = (self.scene, &mut self.stats.work);
        let departure = departure(scene, Some(originating));
        let single = Probe::new(Scalar, probe.ray(), probe.span(), scene.primitives().is_flat());
        self.mailboxes.next_ray();
        loop {
            work.cells_visited += 1;
            for run in Self::new_runs(self.grid, &walk, &mut self.mailboxes) {
                let hit = if is_single(&run) {
                    scene.primitives().any(&single, &run, departure)
                } else {
                    scene.primitives().any(probe, &run, departure)
                };
                if let Some(hit) = hit {
                    work.primitive_tests += u64::from(hit.index + 1 - run.range.start);
                    return true;
                }
                work.primitive_tests += u64::from(run.range.end - run.range.start);
            }
            if !walk.step(f64::INFINITY) {
                return false;
            }
        }
    }

    /// A ray that is in doubt; a call of its own, so that the way of the others is short.
    #[inline(never)]
    fn partition(&mut self, query: &RayQuery) -> Option<Hit> {
        self.backend.run(PartitionRay { tracer: self, query })
    }

    /// A ray to a light that is in doubt.
    #[inline(never)]
    fn partition_to_light(&mut self, query: &ShadowQuery) -> bool {
        self.backend.run(PartitionLightRay { tracer: self, query })
    }
}

impl LaneTracer for CellularTracer<'_> {
    #[inline(always)]
    fn nearest_on<S: Simd>(&mut self, simd: S, query: &RayQuery) -> Option<Hit> {
        match self.grid.enter(&query.ray, query.span) {
            Entry::Missed => None,
            Entry::InDoubt => self.partition(query),
            Entry::Inside(walk) => {
                let probe = Probe::new(simd, &query.ray, query.span, self.scene.primitives().is_flat());
                self.walk(walk, &probe, query.originating)
            }
        }
    }

    #[inline(always)]
    fn occluded_on<S: Simd>(&mut self, simd: S, query: &ShadowQuery) -> bool {
        match self.grid.enter(&query.ray, query.span) {
            Entry::Missed => false,
            Entry::InDoubt => self.partition_to_light(query),
            Entry::Inside(walk) => {
                let probe = Probe::new(simd, &query.ray, query.span, self.scene.primitives().is_flat());
                self.walk_to_light(walk, &probe, query.originating)
            }
        }
    }

    fn lane_stats(&self) -> &Stats {
        &self.stats
    }

    fn lane_recording(&self) -> Recording {
        self.recording
    }

    fn backend(&self) -> Backend {
        self.backend
    }
}

struct PartitionRay<'a, 's> {
    tracer: &'a mut CellularTracer<'s>,
    query: &'a RayQuery,
}

impl Kernel for PartitionRay<'_, '_> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<Hit> {
        let Self { tracer: CellularTracer { scene, partition, stats, .. }, query } = self;
        let probe = Probe::new(simd, &query.ray, query.span, scene.primitives().is_flat());
        let departure = departure(scene, query.originating);
        partition.nearest::<S, false>(simd, scene, &probe, departure, &mut stats.work)
    }
}

struct PartitionLightRay<'a, 's> {
    tracer: &'a mut CellularTracer<'s>,
    query: &'a ShadowQuery,
}

impl Kernel for PartitionLightRay<'_, '_> {
    type Output = bool;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        let Self { tracer: CellularTracer { scene, partition, stats, .. }, query } = self;
        let probe = Probe::new(simd, &query.ray, query.span, scene.primitives().is_flat());
        let departure = departure(scene, Some(query.originating));
        partition.any(simd, scene, &probe, departure, &mut stats.work)
    }
}
