//! Grows the intersection trees of a bundle of ray-sets, one generation at a time.

use std::time::{Duration, Instant};

use rayset_geometry::Ray;
use rayset_scene::Scene;
use rayset_simd::{Backend, Kernel, LaneMask, Lanes, Simd};

use crate::intersection_tree::{Level, Run};
use crate::lanes::{ROWS, column3, load3, n_blocks, place};
use crate::leaving::{Children, LightRays};
use crate::sampling::EyeRayMaker;
use crate::{
    Answers, ByKind, Generation, Hit, IntersectionTrees, MAX_DEPTH, QueryWork, RayCounts, RayKind,
    RaySetIndex, Recording, ShadowGeneration, Slot, Tracer, Work,
};

/// How far from the surface it leaves a ray begins to see other surfaces, relative to the coordinates involved.
///
/// A hit point is off its surface by rounding. A ray that leaves from there takes no notice of anything nearer than
/// `DEPARTURE_MARGIN * (the largest coordinate of the incoming ray's origin + the scene's)`: of surfaces that coincide
/// with the one it leaves, if it leaves them at more than a degree. The surface itself is left by its identity, not
/// by this margin. 2^-40 is 8192 roundings; derived in `docs/numerics.md`.
pub const DEPARTURE_MARGIN: f64 = 1.0 / (1_u64 << 40) as f64;

/// When a tree stops to grow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TreeOptions {
    /// The greatest depth; the initial ray has depth 1.
    pub max_depth: u32,
    /// Hall and Greenberg's adaptive termination: no ray is spawned that can contribute less than this share of its
    /// intensity to the pixel; `None` to spawn all.
    ///
    /// Source: Hall, Greenberg 1983, "A testbed for realistic image synthesis"; Speer et al. 1985, section 2.2.
    pub cutoff: Option<f64>,
}

/// Grows trees; keeps its memory from one bundle to the next.
#[derive(Debug)]
pub struct RaySets {
    backend: Backend,
    trees: IntersectionTrees,
    shadow: ShadowGeneration,
    /// The row whose hit each light ray leaves.
    shadow_rows: Vec<u32>,
    occluded: Answers<bool>,
    tallies: Vec<RaySetTally>,
    counts: RayCounts,
    strategy_time: Duration,
}

/// What the rays of one ray-set took, counted when work is recorded.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RaySetTally {
    pub(crate) rays: ByKind<u32>,
    pub(crate) work: Work,
    /// By depth, from 1; light rays belong to the level of the hit they leave.
    pub(crate) levels: [LevelTally; MAX_DEPTH as usize],
    /// Of the initial ray.
    pub(crate) certificate_radius: f64,
}

/// The rays of one level of a ray-set.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LevelTally {
    pub(crate) rays: u32,
    pub(crate) coherent: u32,
}

impl Default for RaySets {
    /// Works on the lanes of [`Backend::active`].
    fn default() -> Self {
        Self::on(Backend::active())
    }
}

impl RaySets {
    /// Works on the lanes of a backend; the bits are the same.
    #[must_use]
    pub fn on(backend: Backend) -> Self {
        Self {
            backend,
            trees: IntersectionTrees::default(),
            shadow: ShadowGeneration::default(),
            shadow_rows: Vec::new(),
            occluded: Answers::default(),
            tallies: Vec::new(),
            counts: RayCounts::default(),
            strategy_time: Duration::ZERO,
        }
    }

    /// The rays counted so far.
    #[must_use]
    pub fn counts(&self) -> &RayCounts {
        &self.counts
    }

    /// The time spent inside the strategy's calls so far.
    #[must_use]
    pub fn strategy_time(&self) -> Duration {
        self.strategy_time
    }

    /// The rays counted so far, and the time spent inside the strategy's calls; both begin anew.
    pub(crate) fn take_totals(&mut self) -> (RayCounts, Duration) {
        (std::mem::take(&mut self.counts), std::mem::take(&mut self.strategy_time))
    }

    /// The trees of the bundle grown last.
    #[must_use]
    pub fn trees(&self) -> &IntersectionTrees {
        &self.trees
    }

    /// What each ray-set of the bundle grown last took; empty unless recorded.
    pub(crate) fn tallies(&self) -> &[RaySetTally] {
        &self.tallies
    }

    /// Grows the trees of one bundle: the ray-sets `first`, `first + 1`, ... of the given initial rays.
    ///
    /// # Panics
    ///
    /// If there are 2^32 nodes, or the tracer does not answer every query once.
    pub fn grow(
        &mut self,
        scene: &Scene,
        tracer: &mut dyn Tracer,
        first: RaySetIndex,
        initial_rays: impl IntoIterator<Item = Ray>,
        options: &TreeOptions,
    ) -> &IntersectionTrees {
        self.trees.begin(first).rays.extend_initial(first, initial_rays);
        self.grow_roots(scene, tracer, first, options)
    }

    /// Grows the trees of the ray-sets of an image that pass through some places of it.
    pub(crate) fn grow_places(
        &mut self,
        scene: &Scene,
        tracer: &mut dyn Tracer,
        first: RaySetIndex,
        (eye_rays, places): (&EyeRayMaker<'_>, &[(u32, u32)]),
        options: &TreeOptions,
    ) -> &IntersectionTrees {
        eye_rays.fill(self.backend, first, places, &mut self.trees.begin(first).rays);
        self.grow_roots(scene, tracer, first, options)
    }

    /// Grows the trees whose initial rays stand in the first level.
    fn grow_roots(
        &mut self,
        scene: &Scene,
        tracer: &mut dyn Tracer,
        first: RaySetIndex,
        options: &TreeOptions,
    ) -> &IntersectionTrees {
        let roots = self.trees.roots();
        let n = roots.len();
        roots.make_room(n);
        roots.weights[..n].fill(1.0);
        roots.runs.push(Run { slot: Slot::ROOT, rows: 0..n });
        self.tallies.clear();
        if tracer.recording() == Recording::PerQuery {
            self.tallies.resize(n, RaySetTally::default());
        }
        let mut n_levels = 0;
        let mut n_rays = n;
        while n_rays > 0 {
            n_rays = self.grow_level(n_levels, scene, tracer, first, options);
            n_levels += 1;
        }
        self.trees.close(n_levels);
        &self.trees
    }

    /// Answers one level and gathers the next; returns how many rays that has.
    fn grow_level(
        &mut self,
        depth: usize,
        scene: &Scene,
        tracer: &mut dyn Tracer,
        first: RaySetIndex,
        options: &TreeOptions,
    ) -> usize {
        let Self { backend, trees, shadow, shadow_rows, occluded, tallies, counts, strategy_time } = self;
        let (level, next) = trees.open(depth);
        let start = Instant::now();
        tracer.nearest_bundle(&level.rays, &mut level.answers);
        *strategy_time += start.elapsed();
        assert_eq!(level.answers.values.len(), level.len(), "one answer a query");
        tally(tallies, &level.answers.work, &level.rays, first, false);

        let backend = *backend;
        let is_last = level.runs.first().is_none_or(|run| run.slot.depth() >= options.max_depth);
        let (n_facing, n_sent) = backend.run(LookRound { scene, level, is_last, cutoff: options.cutoff });
        for Run { slot, rows } in &level.runs {
            let tally = &mut counts[slot.kind()];
            tally.cast += rows.len() as u64;
            tally.hit += level.n_hits(rows);
        }
        if n_sent > 0 {
            backend.run(Children { level, n_sent, next });
        }

        shadow.clear();
        backend.run(LightRays { level, n_facing, shadow, rows: shadow_rows });
        if !shadow.is_empty() {
            occluded.clear();
            let start = Instant::now();
            tracer.occluded_bundle(shadow, occluded);
            *strategy_time += start.elapsed();
            assert_eq!(occluded.values.len(), shadow.len(), "one answer a query");
            let (lights, n_lights) = (&mut level.lights[..], level.n_lights);
            for ((&row, light), &is_hidden) in shadow_rows.iter().zip(shadow.lights()).zip(&occluded.values) {
                let (block, row) = place(row as usize);
                lights[block * n_lights + light.index()].hide(row, is_hidden);
            }
            counts.shadow.cast += shadow.len() as u64;
            counts.shadow.hit += occluded.values.iter().filter(|is_hidden| **is_hidden).count() as u64;
            tally(tallies, &occluded.work, shadow.rays(), first, true);
        }
        next.len()
    }
}

/// What is seen from the hits of a level: surfaces, lights, and, but on the last level, where rays are reflected and
/// refracted.
struct LookRound<'a> {
    scene: &'a Scene,
    level: &'a mut Level,
    is_last: bool,
    /// The least weight of a ray that is sent, if there is one.
    cutoff: Option<f64>,
}

impl Kernel for LookRound<'_> {
    /// How many light rays there will be at most, and how many rays are sent.
    type Output = (usize, usize);

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> (usize, usize) {
        let Self { scene, level, is_last, cutoff } = self;
        level.make_room_for_hits(scene.lights().len());
        let n = n_blocks(level.len());
        let Level { rays, weights, answers, surfaces, lights, n_lights, spawning, is_spawning, .. } = level;
        for (block, surfaces) in surfaces[..n].iter_mut().enumerate() {
            let (first, hits) = of_block(&answers.values, block);
            for i in 0..hits.len().div_ceil(S::F64::LANES) {
                let row = i * S::F64::LANES;
                let origin = column3(simd, &rays.origins, first + row);
                let direction = column3(simd, &rays.directions, first + row);
                let t = simd.collect_f64(|lane| match hits.get(row + lane) {
                    Some(Some(hit)) => hit.t,
                    _ => 0.0,
                });
                surfaces.arrive(simd, row, (origin, direction, t), scene.extent());
            }
            surfaces.find(scene, hits);
            *is_spawning |= !is_last && surfaces.sending != 0;
        }
        // In a loop of its own: lanes that are read just after they were written one by one wait for the memory.
        let cutoff = simd.splat_f64(cutoff.unwrap_or(f64::NEG_INFINITY));
        let (mut n_facing, mut n_sent) = (0, 0);
        for (block, surfaces) in surfaces[..n].iter_mut().enumerate() {
            let (first, hits) = of_block(&answers.values, block);
            let seen = &mut lights[block * *n_lights..][..*n_lights];
            let spawning = &mut spawning[block];
            spawning.total = 0;
            for i in 0..ROWS / S::F64::LANES {
                let row = i * S::F64::LANES;
                let hit = simd.mask_f64(surfaces.hit >> row);
                if hit.any() {
                    let direction = column3(simd, &rays.directions, first + row);
                    let normals = surfaces.turn(simd, row, direction, scene, hits);
                    let point = load3(simd, &surfaces.points, row);
                    for (seen, light) in seen.iter_mut().zip(scene.lights()) {
                        n_facing += seen.look(simd, row, light, point, normals, hit);
                    }
                    if *is_spawning {
                        spawning.aim(simd, row, direction, normals, surfaces);
                        let weights = simd.load_f64(&weights[first + row..]);
                        n_sent += spawning.weigh(simd, row, scene, surfaces, (weights, cutoff));
                    }
                } else {
                    let lanes = row..row + S::F64::LANES;
                    seen.iter_mut().for_each(|seen| seen.cosines[lanes.clone()].fill(0.0));
                    spawning.send_nothing(lanes);
                }
            }
        }
        (n_facing, n_sent)
    }
}

/// The first row of a block, and the hits of its rows.
#[inline(always)]
fn of_block(hits: &[Option<Hit>], block: usize) -> (usize, &[Option<Hit>]) {
    let first = block * ROWS;
    (first, &hits[first..hits.len().min(first + ROWS)])
}

/// Adds the recorded rays of a generation to their ray-sets.
fn tally(
    tallies: &mut [RaySetTally],
    work: &[QueryWork],
    rays: &Generation,
    first: RaySetIndex,
    shadow: bool,
) {
    for ((query, ray_set), slot) in work.iter().zip(rays.ray_sets()).zip(rays.slots()) {
        let Some(tally) = tallies.get_mut((ray_set.0 - first.0) as usize) else { continue };
        let kind = if shadow { RayKind::Shadow } else { slot.kind() };
        tally.rays[kind] += 1;
        tally.work += query.work;
        let level = &mut tally.levels[slot.depth() as usize - 1];
        level.rays += 1;
        level.coherent += u32::from(query.coherent);
        if kind == RayKind::Initial {
            tally.certificate_radius = query.certificate_radius;
        }
    }
}
