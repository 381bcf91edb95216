//! Grows the intersection trees of a bundle of ray-sets, one generation at a time.

use std::ops::Range;
use std::time::{Duration, Instant};

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Ray, Side, Span, VectorColumns, unit};
use rayset_scene::{LightId, Material, Scene};

use crate::query::{Columns, run_len};
use crate::{
    Answers, Branch, ByKind, Generation, Hit, IntersectionTrees, LightState, MAX_DEPTH, Node, Originating,
    RayCounts, RayKind, RayQuery, RaySetIndex, Recording, ShadowGeneration, ShadowQuery, Slot, Surface,
    Tracer, Work,
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
#[derive(Debug, Default)]
pub struct RaySets {
    trees: IntersectionTrees,
    initial_rays: Vec<Ray>,
    generation: Generation,
    next: Generation,
    shadow: ShadowGeneration,
    /// The hits of the rays of one slot.
    leaving: Vec<Leaving>,
    /// What the hits of a slot refract: their place among them, and the direction.
    refracted: Vec<(usize, DVec3)>,
    /// From the hits of a slot to a light.
    to_light: VectorColumns,
    /// Where in the table of light states each shadow ray's answer goes.
    shadow_places: Vec<usize>,
    hits: Answers<Option<Hit>>,
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

impl RaySets {
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
        self.trees.nodes.clear();
        self.trees.lights.clear();
        self.trees.n_lights = scene.lights().len();
        self.generation.clear();
        self.initial_rays.clear();
        self.initial_rays.extend(initial_rays);
        assert!(u32::try_from(self.initial_rays.len()).is_ok(), "fewer than 2^32 ray-sets");
        self.generation.extend_initial(first, &self.initial_rays);
        let roots = (0..).zip(&self.initial_rays).map(|(i, ray)| node(i, Slot::ROOT, ray.direction(), 1.0));
        self.trees.nodes.extend(roots);
        self.tallies.clear();
        if tracer.recording() == Recording::PerQuery {
            self.tallies.resize(self.generation.len(), RaySetTally::default());
        }
        while !self.generation.is_empty() {
            self.grow_generation(scene, tracer, first, options);
            std::mem::swap(&mut self.generation, &mut self.next);
        }
        &self.trees
    }

    /// Answers one level and gathers the next.
    fn grow_generation(
        &mut self,
        scene: &Scene,
        tracer: &mut dyn Tracer,
        first: RaySetIndex,
        options: &TreeOptions,
    ) {
        let base = self.trees.nodes.len() - self.generation.len();
        self.hits.clear();
        let start = Instant::now();
        tracer.nearest_bundle(&self.generation, &mut self.hits);
        self.strategy_time += start.elapsed();
        assert_eq!(self.hits.values.len(), self.generation.len(), "one answer a query");

        self.shadow.clear();
        self.shadow_places.clear();
        self.next.clear();
        self.trees.lights.resize(self.trees.nodes.len() * self.trees.n_lights, LightState::FacesAway);
        let mut start = 0;
        while start < self.generation.len() {
            let end = start + run_len(&self.generation.slots()[start..]);
            self.grow_slot(scene, start..end, base, options);
            start = end;
        }
        self.tally(first, false);

        self.occluded.clear();
        if self.shadow.is_empty() {
            return;
        }
        let start = Instant::now();
        tracer.occluded_bundle(&self.shadow, &mut self.occluded);
        self.strategy_time += start.elapsed();
        assert_eq!(self.occluded.values.len(), self.shadow.len(), "one answer a query");
        let mut n_hidden = 0;
        for (place, &occluded) in self.shadow_places.iter().zip(&self.occluded.values) {
            n_hidden += u64::from(occluded);
            self.trees.lights[*place] = if occluded { LightState::Hidden } else { LightState::Visible };
        }
        self.counts.shadow.cast += self.shadow.len() as u64;
        self.counts.shadow.hit += n_hidden;
        self.tally(first, true);
    }

    /// Adds the recorded rays of a generation to their ray-sets.
    fn tally(&mut self, first: RaySetIndex, shadow: bool) {
        let (work, rays) = match shadow {
            false => (&self.hits.work, &self.generation),
            true => (&self.occluded.work, self.shadow.rays()),
        };
        for ((query, ray_set), slot) in work.iter().zip(rays.ray_sets()).zip(rays.slots()) {
            let Some(tally) = self.tallies.get_mut((ray_set.0 - first.0) as usize) else { continue };
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

    /// Takes in the hits of the rays of one slot, and gathers what they spawn: light by light, then the reflected rays,
    /// then the refracted, so that rays that correspond stand together.
    fn grow_slot(&mut self, scene: &Scene, rays: Range<usize>, base: usize, options: &TreeOptions) {
        let slot = self.generation.slots()[rays.start];
        self.counts[slot.kind()].cast += rays.len() as u64;
        self.take_hits(scene, rays, base);
        self.counts[slot.kind()].hit += self.leaving.len() as u64;
        if self.leaving.is_empty() {
            return;
        }
        for light in (0..self.trees.n_lights).map(|i| LightId(index(i))) {
            self.push_shadow_rays(scene, slot, light);
        }
        if slot.depth() < options.max_depth {
            self.push_reflected(scene, slot.reflected(), options);
            self.push_refracted(scene, slot.refracted(), options);
        }
    }

    /// The surfaces that the rays of a slot hit: into their nodes, and in a list.
    fn take_hits(&mut self, scene: &Scene, rays: Range<usize>, base: usize) {
        self.leaving.clear();
        let columns = Columns::of(&self.generation);
        let ray_sets = &self.generation.ray_sets()[rays.clone()];
        let nodes = &mut self.trees.nodes[base + rays.start..base + rays.end];
        let hits = &self.hits.values[rays.clone()];
        for (((i, hit), node), &ray_set) in rays.zip(hits).zip(nodes).zip(ray_sets) {
            let Some(hit) = *hit else { continue };
            let ray = columns.ray(i);
            let surface = surface_at(scene, &ray, &hit);
            node.hit = Some((hit, surface));
            self.leaving.push(Leaving { ray_set, node: index(base + i), start: departure(scene, &ray) });
        }
    }

    /// The rays that ask for a light, from the hits of a slot.
    fn push_shadow_rays(&mut self, scene: &Scene, slot: Slot, light: LightId) {
        let Self { leaving, shadow, shadow_places, trees, to_light, .. } = self;
        let (source, n_lights) = (&scene.lights()[light.index()], trees.n_lights);
        shadow.reserve(leaving.len());
        shadow_places.reserve(leaving.len());
        to_light.clear();
        if let Some(position) = source.position() {
            for Leaving { node, .. } in &*leaving {
                let hit = trees.nodes[*node as usize].hit.as_ref();
                to_light.push(hit.map_or(DVec3::ZERO, |(_, surface)| position - surface.point));
            }
            to_light.normalize();
        }
        for (i, Leaving { ray_set, node, start }) in leaving.iter().enumerate() {
            let Some((hit, surface)) = &trees.nodes[*node as usize].hit else { continue };
            // As `Light::seen_from`; zero at the light, from where no side of a surface is lit.
            let (direction, distance) = if to_light.is_empty() {
                let Some(illumination) = source.seen_from(surface.point) else { continue };
                (illumination.direction, illumination.distance)
            } else {
                (to_light.get(i), to_light.length(i))
            };
            // Light reaches a surface from the side of both normals, or not at all.
            if !(surface.normal.dot(direction) > 0.0 && surface.shading_normal.dot(direction) > 0.0) {
                continue;
            }
            shadow.push(&ShadowQuery {
                ray_set: *ray_set,
                slot,
                light,
                originating: Originating { object: hit.object, primitive: hit.primitive, side: surface.side },
                ray: Ray::new(surface.point, direction),
                span: Span { start: *start, end: distance - start },
            });
            shadow_places.push(*node as usize * n_lights + light.index());
        }
    }

    /// The rays that the hits of a slot reflect; leaves what they refract in `self.refracted`.
    fn push_reflected(&mut self, scene: &Scene, slot: Slot, options: &TreeOptions) {
        let Self { leaving, refracted, next, trees, .. } = self;
        refracted.clear();
        for (i, leaving) in leaving.iter().enumerate() {
            let parent = &mut trees.nodes[leaving.node as usize];
            let Some((_, surface)) = &parent.hit else { continue };
            let material = &scene.materials()[surface.material.index()];
            if !material.is_reflective() {
                continue;
            }
            let mut share = material.reflectance;
            if material.is_transmissive() {
                if let Some(direction) = refract(parent.direction, surface, material) {
                    refracted.push((i, direction));
                } else {
                    parent.refracted = Branch::TotalReflection;
                    share += material.transmittance;
                }
            }
            let direction = reflect(parent.direction, surface);
            let spawned = Spawned { slot, direction, share: share.max_element(), side: surface.side };
            let branch = spawn(trees, next, leaving, &spawned, options);
            trees.nodes[leaving.node as usize].reflected = branch;
        }
    }

    /// The rays of `self.refracted`.
    fn push_refracted(&mut self, scene: &Scene, slot: Slot, options: &TreeOptions) {
        let Self { leaving, refracted, next, trees, .. } = self;
        for &(i, direction) in &*refracted {
            let leaving = &leaving[i];
            let Some((_, surface)) = &trees.nodes[leaving.node as usize].hit else { continue };
            let share = scene.materials()[surface.material.index()].transmittance.max_element();
            let spawned = Spawned { slot, direction, share, side: surface.side.opposite() };
            let branch = spawn(trees, next, leaving, &spawned, options);
            trees.nodes[leaving.node as usize].refracted = branch;
        }
    }
}

/// A hit of a slot, with what its node does not know of the rays that leave it.
#[derive(Clone, Copy, Debug)]
struct Leaving {
    ray_set: RaySetIndex,
    node: u32,
    /// Where rays that leave begin to see other surfaces.
    start: f64,
}

/// A ray that leaves a hit.
struct Spawned {
    slot: Slot,
    direction: DVec3,
    /// The greatest share of the intensity of what it meets that the surface passes on.
    share: f64,
    side: Side,
}

/// Adds a ray to the next generation, if it is not cut off.
#[inline]
fn spawn(
    trees: &mut IntersectionTrees,
    next: &mut Generation,
    leaving: &Leaving,
    &Spawned { slot, direction, share, side }: &Spawned,
    options: &TreeOptions,
) -> Branch {
    let Node { weight, ray_set, hit: Some((hit, surface)), .. } = &trees.nodes[leaving.node as usize] else {
        return Branch::None;
    };
    let (weight, ray_set) = (weight * share, *ray_set);
    if options.cutoff.is_some_and(|cutoff| weight < cutoff) {
        return Branch::None;
    }
    next.push(&RayQuery {
        ray_set: leaving.ray_set,
        slot,
        originating: Some(Originating { object: hit.object, primitive: hit.primitive, side }),
        ray: Ray::new(surface.point, direction),
        span: Span { start: leaving.start, end: f64::INFINITY },
    });
    let child = index(trees.nodes.len());
    trees.nodes.push(node(ray_set, slot, direction, weight));
    Branch::Node(child)
}

#[inline]
fn node(ray_set: u32, slot: Slot, direction: DVec3, weight: f64) -> Node {
    Node { ray_set, slot, direction, hit: None, weight, reflected: Branch::None, refracted: Branch::None }
}

#[inline]
fn index(i: usize) -> u32 {
    u32::try_from(i).expect("a bundle holds fewer than 2^32 nodes")
}

/// Where a ray that leaves a hit begins to see other surfaces.
#[inline]
fn departure(scene: &Scene, incoming: &Ray) -> f64 {
    DEPARTURE_MARGIN * (incoming.origin().abs().max_element() + scene.extent())
}

#[inline]
fn surface_at(scene: &Scene, ray: &Ray, hit: &Hit) -> Surface {
    let point = ray.at(hit.t);
    let surface = scene.surface_at(hit.primitive, point);
    let side = if surface.normal.dot(ray.direction()) > 0.0 { Side::Back } else { Side::Front };
    let flip = |normal: DVec3| if side == Side::Back { -normal } else { normal };
    let normal = flip(surface.normal);
    let shading_normal = flip(surface.shading_normal);
    // A normal that leans over so far that the ray would come from behind it shades nothing rightly.
    let leans_over = shading_normal.dot(ray.direction()) > 0.0;
    let material = scene.material_id_of(hit.object);
    Surface {
        point,
        normal,
        shading_normal: if leans_over { normal } else { shading_normal },
        side,
        material,
    }
}

/// The direction `d - 2 (n . d) n`; about the surface's own normal where the shading normal would lead into it.
#[inline]
fn reflect(d: DVec3, surface: &Surface) -> DVec3 {
    let about = |n: DVec3| unit(d - 2.0 * n.dot(d) * n).unwrap_or(n);
    let direction = about(surface.shading_normal);
    if direction.dot(surface.normal) > 0.0 { direction } else { about(surface.normal) }
}

/// The refracted direction by Snell's law; `None` under total internal reflection.
///
/// With `eta` the ratio of the indices and `c = -n . d`: `eta d + (eta c - sqrt(1 - eta^2 (1 - c^2))) n`.
#[inline]
fn refract(d: DVec3, surface: &Surface, material: &Material) -> Option<DVec3> {
    if (material.index - 1.0).abs() <= 0.0 {
        return Some(d);
    }
    let eta = match surface.side {
        Side::Front => 1.0 / material.index,
        Side::Back => material.index,
    };
    let direction = refract_about(surface.shading_normal, d, eta)?;
    if direction.dot(surface.normal) < 0.0 { Some(direction) } else { refract_about(surface.normal, d, eta) }
}

#[inline]
fn refract_about(n: DVec3, d: DVec3, eta: f64) -> Option<DVec3> {
    let cosine = -n.dot(d);
    let discriminant = 1.0 - eta * eta * (1.0 - cosine * cosine);
    if discriminant < 0.0 {
        return None;
    }
    unit(eta * d + (eta * cosine - discriminant.sqrt()) * n)
}
