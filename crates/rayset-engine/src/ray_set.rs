//! Grows the intersection trees of a bundle of ray-sets, one generation at a time.

use std::ops::Range;
use std::time::{Duration, Instant};

use rayset_geometry::glam::DVec3;
use rayset_geometry::{Ray, Side, VectorColumns, unit};
use rayset_scene::{LightId, Material, Scene};

use crate::intersection_tree::Lit;
use crate::query::{Columns, run_len};
use crate::{
    Answers, Branch, ByKind, Generation, Hit, IntersectionTrees, LightState, MAX_DEPTH, Node, Originating,
    RayCounts, RayKind, RaySetIndex, Recording, ShadowGeneration, Slot, Surface, Tracer, Work,
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
    /// Those of them that face a light.
    facing: Vec<u32>,
    /// The rays that are reflected from them, and those that are refracted.
    reflected: Vec<Sent>,
    refracted: Vec<Sent>,
    /// Where the hits of a slot send rays: to a light, or reflected.
    aimed: VectorColumns,
    /// Where those of glass refract them.
    bent: VectorColumns,
    /// The node that each shadow ray leaves.
    shadow_nodes: Vec<u32>,
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
        self.trees.nodes.clear();
        self.trees.lights.clear();
        self.trees.lit.clear();
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
        self.shadow_nodes.clear();
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
        let n_hidden = self.take_lights();
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
            self.push_secondary_rays(scene, slot, options);
        }
    }

    /// The surfaces that the rays of a slot hit: into their nodes, and in a list.
    fn take_hits(&mut self, scene: &Scene, rays: Range<usize>, base: usize) {
        self.leaving.clear();
        self.leaving.reserve(rays.len());
        let columns = Columns::of(&self.generation);
        let ray_sets = &self.generation.ray_sets()[rays.clone()];
        let nodes = &mut self.trees.nodes[base + rays.start..base + rays.end];
        let hits = &self.hits.values[rays.clone()];
        for (((i, hit), node), &ray_set) in rays.zip(hits).zip(nodes).zip(ray_sets) {
            let Some(hit) = *hit else { continue };
            let ray = columns.ray(i);
            let surface = surface_at(scene, &ray, &hit);
            node.hit = Some((hit, surface));
            let from = Originating { object: hit.object, primitive: hit.primitive, side: surface.side };
            let start = departure(scene, &ray);
            self.leaving.push(Leaving { ray_set, node: index(base + i), start, from, surface });
        }
    }

    /// The rays that ask for a light, from the hits of a slot.
    fn push_shadow_rays(&mut self, scene: &Scene, slot: Slot, light: LightId) {
        let Self { leaving, aimed, facing, shadow, shadow_nodes, .. } = self;
        let source = &scene.lights()[light.index()];
        aimed.clear();
        // As `Light::seen_from`; zero at the light, from where no side of a surface is lit.
        if let Some(position) = source.position() {
            aimed.extend(leaving.iter().map(|leaving| position - leaving.surface.point));
            aimed.normalize();
        } else if let Some(seen) = source.seen_from(DVec3::ZERO) {
            aimed.extend(leaving.iter().map(|_| seen.direction));
        }
        facing.resize(leaving.len(), 0);
        let mut n_facing = 0;
        for (i, Leaving { surface, .. }) in leaving.iter().enumerate() {
            let direction = aimed.get(i);
            // Without a branch to guess: what does not face the light gives its place to the next.
            facing[n_facing] = index(i);
            // Light reaches a surface from the side of both normals, or not at all.
            let (normal, shading_normal) = (surface.normal, surface.shading_normal);
            n_facing += usize::from((normal.dot(direction) > 0.0) & (shading_normal.dot(direction) > 0.0));
        }
        let facing = &facing[..n_facing];
        let lengths = aimed.lengths();
        let sent = facing.iter().map(|&from| {
            let distance = lengths.get(from as usize).copied().unwrap_or(f64::INFINITY);
            Sent { from, direction: aimed.get(from as usize), distance }
        });
        shadow.extend(slot, light, leaving, sent);
        shadow_nodes.extend(facing.iter().map(|&i| leaving[i as usize].node));
    }

    /// Takes in which lights shine on the hits of a generation; returns how many do not.
    fn take_lights(&mut self) -> u64 {
        let Self { trees, shadow, shadow_nodes, occluded, .. } = self;
        let directions = shadow.rays().directions();
        let mut n_hidden = 0;
        for (i, ((&node, &light), &occluded)) in
            shadow_nodes.iter().zip(shadow.lights()).zip(&occluded.values).enumerate()
        {
            let state = &mut trees.lights[node as usize * trees.n_lights + light.index()];
            if occluded {
                n_hidden += 1;
                *state = LightState::Hidden;
            } else {
                *state = LightState::Visible;
                let direction = DVec3::from_array(directions.each_ref().map(|column| column[i]));
                trees.lit.push(Lit { node, light, direction });
            }
        }
        n_hidden
    }

    /// Where the hits of a slot reflect rays, and where those of glass refract them: zero under total reflection.
    fn aim(&mut self, scene: &Scene) {
        let Self { leaving, aimed, bent, trees, .. } = self;
        aimed.clear();
        bent.clear();
        for Leaving { node, surface, .. } in &*leaving {
            let material = &scene.materials()[surface.material.index()];
            if material.is_reflective() {
                let direction = trees.nodes[*node as usize].direction;
                aimed.push(mirrored(direction, surface.shading_normal));
                if material.is_transmissive() {
                    let eta = eta(surface, material);
                    bent.push(bent_by(direction, surface.shading_normal, eta).unwrap_or(DVec3::ZERO));
                }
            }
        }
        aimed.normalize();
        bent.normalize();
    }

    /// The rays that the hits of a slot reflect, then those that they refract.
    fn push_secondary_rays(&mut self, scene: &Scene, slot: Slot, options: &TreeOptions) {
        self.aim(scene);
        let Self { leaving, reflected, refracted, aimed, bent, next, trees, .. } = self;
        let materials = scene.materials();
        reflected.clear();
        refracted.clear();
        let is_cut_off = |weight: f64| options.cutoff.is_some_and(|cutoff| weight < cutoff);
        let (mut n_aimed, mut n_bent) = (0, 0);
        for (i, Leaving { node, surface, .. }) in leaving.iter().enumerate() {
            let material = &materials[surface.material.index()];
            if !material.is_reflective() {
                continue;
            }
            let child = index(trees.nodes.len());
            let parent = &mut trees.nodes[*node as usize];
            let mut share = material.reflectance;
            if material.is_transmissive() {
                if let Some(direction) = refract(parent.direction, surface, material, bent.get(n_bent)) {
                    refracted.push(Sent { from: index(i), direction, distance: f64::INFINITY });
                } else {
                    parent.refracted = Branch::TotalReflection;
                    share += material.transmittance;
                }
                n_bent += 1;
            }
            let direction = reflect(parent.direction, surface, aimed.get(n_aimed));
            n_aimed += 1;
            let weight = parent.weight * share.max_element();
            if is_cut_off(weight) {
                continue;
            }
            parent.reflected = Branch::Node(child);
            let ray_set = parent.ray_set;
            trees.nodes.push(self::node(ray_set, slot.reflected(), direction, weight));
            reflected.push(Sent { from: index(i), direction, distance: f64::INFINITY });
        }
        next.extend(slot.reflected(), leaving, reflected.iter().copied(), |side| side);
        refracted.retain(|Sent { from, direction, .. }| {
            let Leaving { node, surface, .. } = &leaving[*from as usize];
            let child = index(trees.nodes.len());
            let parent = &mut trees.nodes[*node as usize];
            let weight = parent.weight * materials[surface.material.index()].transmittance.max_element();
            if is_cut_off(weight) {
                return false;
            }
            parent.refracted = Branch::Node(child);
            let ray_set = parent.ray_set;
            trees.nodes.push(self::node(ray_set, slot.refracted(), *direction, weight));
            true
        });
        next.extend(slot.refracted(), leaving, refracted.iter().copied(), Side::opposite);
    }
}

/// A hit of a slot: what rays that leave it are made of.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leaving {
    pub(crate) ray_set: RaySetIndex,
    pub(crate) node: u32,
    /// Where rays that leave begin to see other surfaces.
    pub(crate) start: f64,
    /// With the side that the ray came from.
    pub(crate) from: Originating,
    pub(crate) surface: Surface,
}

/// A ray that leaves a hit of a slot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sent {
    /// The place of the hit among those of the slot.
    pub(crate) from: u32,
    pub(crate) direction: DVec3,
    /// How far away is what it is sent to; its span ends there.
    pub(crate) distance: f64,
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

/// `d - 2 (n . d) n`.
#[inline]
fn mirrored(d: DVec3, n: DVec3) -> DVec3 {
    d - 2.0 * n.dot(d) * n
}

/// The reflected direction: `aimed`, which is [`mirrored`] scaled to unit length; about the surface's own normal where the
/// shading normal would lead into it.
#[inline]
fn reflect(d: DVec3, surface: &Surface, aimed: DVec3) -> DVec3 {
    if aimed.dot(surface.normal) > 0.0 {
        return aimed;
    }
    let about = |n: DVec3| unit(mirrored(d, n)).unwrap_or(n);
    let direction = about(surface.shading_normal);
    if direction.dot(surface.normal) > 0.0 { direction } else { about(surface.normal) }
}

/// The ratio of the indices of refraction where a ray enters or leaves a material.
#[inline]
fn eta(surface: &Surface, material: &Material) -> f64 {
    match surface.side {
        Side::Front => 1.0 / material.index,
        Side::Back => material.index,
    }
}

/// The refracted direction, of about unit length, by Snell's law; `None` under total internal reflection.
///
/// With `eta` the ratio of the indices and `c = -n . d`: `eta d + (eta c - sqrt(1 - eta^2 (1 - c^2))) n`.
#[inline]
fn bent_by(d: DVec3, n: DVec3, eta: f64) -> Option<DVec3> {
    let cosine = -n.dot(d);
    let discriminant = 1.0 - eta * eta * (1.0 - cosine * cosine);
    if discriminant < 0.0 {
        return None;
    }
    Some(eta * d + (eta * cosine - discriminant.sqrt()) * n)
}

/// The refracted direction: `aimed`, which is [`bent_by`] scaled to unit length; about the surface's own normal where the
/// shading normal would lead out of it; `None` under total internal reflection.
#[inline]
fn refract(d: DVec3, surface: &Surface, material: &Material, aimed: DVec3) -> Option<DVec3> {
    if (material.index - 1.0).abs() <= 0.0 {
        return Some(d);
    }
    if aimed.dot(surface.normal) < 0.0 {
        return Some(aimed);
    }
    let about = |n: DVec3| bent_by(d, n, eta(surface, material)).and_then(unit);
    let direction = about(surface.shading_normal)?;
    if direction.dot(surface.normal) < 0.0 { Some(direction) } else { about(surface.normal) }
}
