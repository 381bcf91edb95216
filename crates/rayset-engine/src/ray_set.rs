//! Grows the intersection trees of a bundle of ray-sets, one generation at a time.

use std::ops::Range;
use std::time::{Duration, Instant};

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Ray, Side, Span, unit};
use rayset_scene::{LightId, Material, Scene};

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
    generation: Generation,
    next: Generation,
    shadow: ShadowGeneration,
    /// What the rays of a slot refract: their place in the generation, their node, and the direction.
    refracted: Vec<(usize, usize, DVec3)>,
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
        for (i, ray) in initial_rays.into_iter().enumerate() {
            let i = u32::try_from(i).expect("fewer than 2^32 ray-sets");
            let ray_set = RaySetIndex(first.0 + i);
            let query = RayQuery { ray_set, slot: Slot::ROOT, originating: None, ray, span: Span::FORWARD };
            self.generation.push(&query);
            self.trees.nodes.push(node(i, Slot::ROOT, ray.direction(), 1.0));
        }
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
            let slots = &self.generation.slots()[start..];
            let end = start + slots.iter().take_while(|slot| **slot == slots[0]).count();
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
        for (place, &occluded) in self.shadow_places.iter().zip(&self.occluded.values) {
            self.counts.shadow.cast += 1;
            self.counts.shadow.hit += u64::from(occluded);
            let state = if occluded { LightState::Hidden } else { LightState::Visible };
            self.trees.lights[*place] = state;
        }
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
        let mut n_hits = 0;
        for i in rays.clone() {
            if let Some(hit) = self.hits.values[i] {
                n_hits += 1;
                let surface = surface_at(scene, &self.generation.query(i).ray, &hit);
                self.trees.nodes[base + i].hit = Some((hit, surface));
            }
        }
        let tally = &mut self.counts[slot.kind()];
        tally.cast += rays.len() as u64;
        tally.hit += n_hits;
        if n_hits == 0 {
            return;
        }
        for light in (0..self.trees.n_lights).map(|i| LightId(index(i))) {
            self.push_shadow_rays(scene, rays.clone(), base, light);
        }
        if slot.depth() < options.max_depth {
            self.push_reflected(scene, rays, base, options);
            self.push_refracted(scene, slot.refracted(), options);
        }
    }

    /// The rays of a slot that ask for a light.
    fn push_shadow_rays(&mut self, scene: &Scene, rays: Range<usize>, base: usize, light: LightId) {
        for i in rays {
            let Some((hit, surface)) = &self.trees.nodes[base + i].hit else { continue };
            let Some(illumination) = scene.lights()[light.index()].seen_from(surface.point) else { continue };
            let direction = illumination.direction;
            // Light reaches a surface from the side of both normals, or not at all.
            if !(surface.normal.dot(direction) > 0.0 && surface.shading_normal.dot(direction) > 0.0) {
                continue;
            }
            let query = self.generation.query(i);
            let start = departure(scene, &query.ray);
            self.shadow.push(&ShadowQuery {
                ray_set: query.ray_set,
                slot: query.slot,
                light,
                originating: Originating { object: hit.object, primitive: hit.primitive, side: surface.side },
                ray: Ray::new(surface.point, direction),
                span: Span { start, end: illumination.distance - start },
            });
            self.shadow_places.push((base + i) * self.trees.n_lights + light.index());
        }
    }

    /// The rays that those of a slot reflect; leaves those that they refract in `self.refracted`.
    fn push_reflected(&mut self, scene: &Scene, rays: Range<usize>, base: usize, options: &TreeOptions) {
        self.refracted.clear();
        for i in rays {
            let Some((hit, surface)) = self.trees.nodes[base + i].hit else { continue };
            let material = &scene.materials()[surface.material.index()];
            if !material.is_reflective() {
                continue;
            }
            let query = self.generation.query(i);
            let incoming = query.ray.direction();
            let mut share = material.reflectance;
            if material.is_transmissive() {
                if let Some(direction) = refract(incoming, &surface, material) {
                    self.refracted.push((i, base + i, direction));
                } else {
                    self.trees.nodes[base + i].refracted = Branch::TotalReflection;
                    share += material.transmittance;
                }
            }
            let spawned = Spawned {
                slot: query.slot.reflected(),
                direction: reflect(incoming, &surface),
                share,
                side: surface.side,
            };
            self.trees.nodes[base + i].reflected =
                self.spawn(scene, &query, base + i, &hit, surface.point, &spawned, options);
        }
    }

    /// The rays of `self.refracted`.
    fn push_refracted(&mut self, scene: &Scene, slot: Slot, options: &TreeOptions) {
        let refracted = std::mem::take(&mut self.refracted);
        for &(i, node, direction) in &refracted {
            let Some((hit, surface)) = self.trees.nodes[node].hit else { continue };
            let share = scene.materials()[surface.material.index()].transmittance;
            let spawned = Spawned { slot, direction, share, side: surface.side.opposite() };
            let query = self.generation.query(i);
            self.trees.nodes[node].refracted =
                self.spawn(scene, &query, node, &hit, surface.point, &spawned, options);
        }
        self.refracted = refracted;
    }

    /// Adds a ray to the next generation, if it is not cut off.
    #[expect(clippy::too_many_arguments, reason = "where a ray comes from, and what it becomes")]
    fn spawn(
        &mut self,
        scene: &Scene,
        query: &RayQuery,
        parent: usize,
        hit: &Hit,
        point: DVec3,
        &Spawned { slot, direction, share, side }: &Spawned,
        options: &TreeOptions,
    ) -> Branch {
        let Node { weight, ray_set, .. } = self.trees.nodes[parent];
        let weight = weight * share.max_element();
        if options.cutoff.is_some_and(|cutoff| weight < cutoff) {
            return Branch::None;
        }
        let child = index(self.trees.nodes.len());
        self.next.push(&RayQuery {
            ray_set: query.ray_set,
            slot,
            originating: Some(Originating { object: hit.object, primitive: hit.primitive, side }),
            ray: Ray::new(point, direction),
            span: Span { start: departure(scene, &query.ray), end: f64::INFINITY },
        });
        self.trees.nodes.push(node(ray_set, slot, direction, weight));
        Branch::Node(child)
    }
}

/// A ray that leaves a hit.
struct Spawned {
    slot: Slot,
    direction: DVec3,
    /// The share of the intensity of what it meets that the surface passes on.
    share: DVec3,
    side: Side,
}

fn node(ray_set: u32, slot: Slot, direction: DVec3, weight: f64) -> Node {
    Node { ray_set, slot, direction, hit: None, weight, reflected: Branch::None, refracted: Branch::None }
}

fn index(i: usize) -> u32 {
    u32::try_from(i).expect("a bundle holds fewer than 2^32 nodes")
}

/// Where a ray that leaves a hit begins to see other surfaces.
fn departure(scene: &Scene, incoming: &Ray) -> f64 {
    DEPARTURE_MARGIN * (incoming.origin().abs().max_element() + scene.extent())
}

fn surface_at(scene: &Scene, ray: &Ray, hit: &Hit) -> Surface {
    let point = ray.at(hit.t);
    let surface = scene.surface_at(hit.primitive, point);
    let side = if surface.normal.dot(ray.direction()) > 0.0 { Side::Back } else { Side::Front };
    let flip = |normal: DVec3| if side == Side::Back { -normal } else { normal };
    let normal = flip(surface.normal);
    let shading_normal = flip(surface.shading_normal);
    // A normal that leans over so far that the ray would come from behind it shades nothing rightly.
    let leans_over = shading_normal.dot(ray.direction()) > 0.0;
    let material = scene.objects()[hit.object.index()].material;
    Surface {
        point,
        normal,
        shading_normal: if leans_over { normal } else { shading_normal },
        side,
        material,
    }
}

/// The direction `d - 2 (n . d) n`; about the surface's own normal where the shading normal would lead into it.
fn reflect(d: DVec3, surface: &Surface) -> DVec3 {
    let about = |n: DVec3| unit(d - 2.0 * n.dot(d) * n).unwrap_or(n);
    let direction = about(surface.shading_normal);
    if direction.dot(surface.normal) > 0.0 { direction } else { about(surface.normal) }
}

/// The refracted direction by Snell's law; `None` under total internal reflection.
///
/// With `eta` the ratio of the indices and `c = -n . d`: `eta d + (eta c - sqrt(1 - eta^2 (1 - c^2))) n`.
fn refract(d: DVec3, surface: &Surface, material: &Material) -> Option<DVec3> {
    if (material.index - 1.0).abs() <= 0.0 {
        return Some(d);
    }
    let eta = match surface.side {
        Side::Front => 1.0 / material.index,
        Side::Back => material.index,
    };
    let about = |n: DVec3| {
        let cosine = -n.dot(d);
        let discriminant = 1.0 - eta * eta * (1.0 - cosine * cosine);
        if discriminant < 0.0 {
            return None;
        }
        unit(eta * d + (eta * cosine - discriminant.sqrt()) * n)
    };
    let direction = about(surface.shading_normal)?;
    if direction.dot(surface.normal) < 0.0 { Some(direction) } else { about(surface.normal) }
}
