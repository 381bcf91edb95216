//! The planes of a frame while it is rendered.

use crate::ray_set::RaySetTally;
use crate::sampling::Grid;
use crate::{IntersectionTrees, Layer, Layers, Node, Plane, PlaneSamples, RayKind};

/// What is written where an initial ray hits nothing, and an id is asked for.
const NO_ID: u32 = u32::MAX;

/// The planes of all layers but beauty; those not asked for are empty.
#[derive(Debug)]
pub(crate) struct Film {
    layers: Layers,
    depth: Vec<f32>,
    normal: [Vec<f32>; 3],
    object: Vec<u32>,
    primitive: Vec<u32>,
    rays: [Vec<u32>; 4],
    volumes: Vec<u32>,
    primitive_tests: Vec<u32>,
    pierce_checks: Vec<u32>,
    /// By level: rays, and coherent ones among them.
    levels: Vec<[Vec<u32>; 2]>,
    certificate: Vec<f32>,
}

impl Film {
    pub(crate) fn new(layers: Layers, n_pixels: usize, max_depth: u32) -> Self {
        fn plane<T: Clone>(is_asked_for: bool, value: T, len: usize) -> Vec<T> {
            vec![value; if is_asked_for { len } else { 0 }]
        }
        let asked = |layer| layers.contain(layer);
        let counts = |layer| plane(asked(layer), 0_u32, n_pixels);
        let ids = |layer| plane(asked(layer), NO_ID, n_pixels);
        let n_levels = if asked(Layer::Coherent) { max_depth } else { 0 };
        Self {
            layers,
            depth: plane(asked(Layer::Depth), f32::INFINITY, n_pixels),
            normal: std::array::from_fn(|_| plane(asked(Layer::Normal), 0.0, n_pixels)),
            object: ids(Layer::Object),
            primitive: ids(Layer::Primitive),
            rays: std::array::from_fn(|_| counts(Layer::Rays)),
            volumes: counts(Layer::Volumes),
            primitive_tests: counts(Layer::PrimitiveTests),
            pierce_checks: counts(Layer::PierceChecks),
            levels: (0..n_levels).map(|_| std::array::from_fn(|_| counts(Layer::Coherent))).collect(),
            certificate: plane(asked(Layer::Certificate), 0.0, n_pixels),
        }
    }

    /// Writes down what a bundle found and took: `places` are the places of its rays in the grid.
    pub(crate) fn expose(
        &mut self,
        grid: &Grid,
        places: &[(u32, u32)],
        trees: &IntersectionTrees,
        tallies: &[RaySetTally],
    ) {
        for (i, (place, node)) in places.iter().zip(trees.nodes()).enumerate() {
            let Some((pixel, is_first)) = grid.owner(*place) else { continue };
            if is_first && self.layers.need_hits() {
                self.expose_hit(pixel, &node);
            }
            if let Some(tally) = tallies.get(i) {
                self.expose_tally(pixel, is_first, tally);
            }
        }
    }

    #[expect(clippy::cast_possible_truncation, reason = "a layer is rounded to f32 once, here")]
    fn expose_hit(&mut self, pixel: usize, node: &Node) {
        let Some((hit, surface)) = &node.hit else { return };
        set(&mut self.depth, pixel, hit.t as f32);
        for (plane, value) in self.normal.iter_mut().zip(surface.shading_normal.to_array()) {
            set(plane, pixel, value as f32);
        }
        set(&mut self.object, pixel, hit.object.0);
        set(&mut self.primitive, pixel, hit.primitive.0);
    }

    #[expect(clippy::cast_possible_truncation, reason = "a layer is rounded to f32 once, here")]
    fn expose_tally(&mut self, pixel: usize, is_first: bool, tally: &RaySetTally) {
        for (plane, (_, rays)) in self.rays.iter_mut().zip(tally.rays.iter()) {
            add(plane, pixel, *rays);
        }
        let narrow = |count: u64| u32::try_from(count).unwrap_or(u32::MAX);
        add(&mut self.volumes, pixel, narrow(tally.work.volumes_classified));
        add(&mut self.primitive_tests, pixel, narrow(tally.work.primitive_tests));
        add(&mut self.pierce_checks, pixel, narrow(tally.work.pierce_checks));
        for (planes, level) in self.levels.iter_mut().zip(&tally.levels) {
            add(&mut planes[0], pixel, level.rays);
            add(&mut planes[1], pixel, level.coherent);
        }
        if is_first {
            set(&mut self.certificate, pixel, tally.certificate_radius as f32);
        }
    }

    /// The finished planes, in the order of [`Layer::ALL`].
    pub(crate) fn develop(self) -> Vec<Plane> {
        let mut planes = Vec::new();
        let mut push = |name: &str, samples: PlaneSamples| {
            if !samples.is_empty() {
                planes.push(Plane { name: name.to_owned(), samples });
            }
        };
        push("depth.Z", PlaneSamples::F32(self.depth));
        for (name, plane) in ["normal.X", "normal.Y", "normal.Z"].into_iter().zip(self.normal) {
            push(name, PlaneSamples::F32(plane));
        }
        push("object.id", PlaneSamples::U32(self.object));
        push("primitive.id", PlaneSamples::U32(self.primitive));
        for (kind, plane) in RayKind::ALL.into_iter().zip(self.rays) {
            push(&format!("rays.{}", kind.name()), PlaneSamples::U32(plane));
        }
        push("volumes.classified", PlaneSamples::U32(self.volumes));
        push("primitives.tested", PlaneSamples::U32(self.primitive_tests));
        push("pierce.checks", PlaneSamples::U32(self.pierce_checks));
        let sum = |k: usize| {
            let n_pixels = self.levels.first().map_or(0, |level| level[k].len());
            let of_all = |pixel: usize| {
                self.levels.iter().fold(0_u32, |sum, level| sum.saturating_add(level[k][pixel]))
            };
            (0..n_pixels).map(of_all).collect::<Vec<u32>>()
        };
        push("coherent.all", PlaneSamples::F32(fraction(&sum(1), &sum(0))));
        for (i, [rays, coherent]) in self.levels.iter().enumerate() {
            push(&format!("coherent.level{}", i + 1), PlaneSamples::F32(fraction(coherent, rays)));
        }
        push("certificate.radius", PlaneSamples::F32(self.certificate));
        planes
    }
}

fn set<T>(plane: &mut [T], pixel: usize, value: T) {
    if let Some(sample) = plane.get_mut(pixel) {
        *sample = value;
    }
}

fn add(plane: &mut [u32], pixel: usize, count: u32) {
    if let Some(sample) = plane.get_mut(pixel) {
        *sample = sample.saturating_add(count);
    }
}

/// Part by part; NaN where there are none.
fn fraction(parts: &[u32], wholes: &[u32]) -> Vec<f32> {
    #[expect(clippy::cast_possible_truncation, reason = "the nearest f32 of a ratio")]
    let ratio = |(&part, &whole): (&u32, &u32)| match whole {
        // One NaN, whatever the machine would divide out.
        0 => f32::NAN,
        _ => (f64::from(part) / f64::from(whole)) as f32,
    };
    parts.iter().zip(wholes).map(ratio).collect()
}
