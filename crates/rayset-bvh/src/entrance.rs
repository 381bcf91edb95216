//! The first steps of rays that are traced one by one, taken together.
//!
//! Every ray of a list tests the same node first. As many rays as there are lanes test one child after the other, which
//! waits for nothing and guesses nothing; and where any hit will do, and rays share their work, the same once more for the
//! nodes that several of them go on to: all that is entered has to be visited, unless something is hit before. Then each ray
//! goes on by itself, and most rays that meet nothing end here.

use rayset_simd::{CullLanes, LaneMask, Lanes, Part, Simd};

use crate::node::{Child, Node, Tree};
use crate::packet::Mask;
use crate::ray::{CullRays, FacesOfRays, SlabsOfRays};
use crate::traverse::{Begin, put_all, put_by_distance};

/// Fewer rays than this test a node below the root one by one.
const LEAST_RAYS: u32 = 4;

/// What rays enter of the root, and of nodes below it.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct Entrance<const W: usize> {
    /// By child of the root, where the ray of each lane enters it, or nearer; zero at least. Only if it is asked where hits
    /// are.
    near: [[f32; W]; W],
    /// By ray, the children of the root that it enters, as a sum: see [`Entering`].
    entered: [f32; W],
    /// By child of the root, of those that were tested: the same, of its children.
    entered_below: [[f32; W]; W],
    /// The children of the root that were tested, a bit each.
    tested: u32,
}

/// The children that rays enter, by ray: the sum of `2^child` over them, which is exact, since there are at most 16.
struct Entering<S: Simd> {
    sums: S::F32,
    bit: f32,
}

impl<S: Simd> Entering<S> {
    #[inline(always)]
    fn new(simd: S) -> Self {
        Self { sums: simd.splat_f32(0.0), bit: 1.0 }
    }

    /// The rays in some lanes enter the next child.
    #[inline(always)]
    fn push(&mut self, simd: S, lanes: Mask<S>) {
        (self.sums + simd.splat_f32(self.bit)).put(lanes, &mut self.sums);
        self.bit *= 2.0;
    }
}

/// The rays that do not leave the box of a child behind.
#[inline(always)]
pub(crate) fn ahead<S: Simd, const W: usize>(
    simd: S,
    node: &Node<W>,
    child: usize,
    rays: &SlabsOfRays<S>,
    faces: &FacesOfRays<S>,
) -> Mask<S> {
    let mut ahead = simd.mask_f32(u32::MAX >> (32 - W));
    for k in 0..3 {
        let (low, high) = (node.planes[k][child], node.planes[3 + k][child]);
        let last = simd.splat_f32(low).select(rays.turned[k], simd.splat_f32(high));
        ahead = ahead & (last * faces.sense[k]).gt(faces.place[k]);
    }
    ahead
}

/// The rays that enter the box of a child, and where.
#[inline(always)]
pub(crate) fn enter<S: Simd, const W: usize>(
    simd: S,
    node: &Node<W>,
    child: usize,
    rays: &SlabsOfRays<S>,
    ends: S::F32,
) -> (Mask<S>, S::F32) {
    let [mut near, mut far] = [rays.start, ends];
    for k in 0..3 {
        let (low, high) = (node.planes[k][child], node.planes[3 + k][child]);
        let (low, high) = (simd.splat_f32(low), simd.splat_f32(high));
        let (first, last) = (high.select(rays.turned[k], low), low.select(rays.turned[k], high));
        near = near.max(first.mul_add(rays.inverse[k], rays.near_offset[k]));
        far = far.min(last.mul_add(rays.inverse[k], rays.far_offset[k]));
    }
    (near.le(far), near)
}

impl<const W: usize> Entrance<W> {
    /// No ray enters anything.
    pub(crate) const NONE: Self =
        Self { near: [[0.0; W]; W], entered: [0.0; W], entered_below: [[0.0; W]; W], tested: 0 };

    /// Prepared rays, those in open lanes, enter a tree up to the ends of their spans; how many nodes they tested, counted
    /// by ray. The root may be a leaf, which rays enter untested.
    ///
    /// With `SECOND` they go on to nodes below the root, which a ray by itself might have been stopped before.
    #[inline(always)]
    pub(crate) fn begin<S: Simd, const SECOND: bool, const FACES: bool>(
        &mut self,
        simd: S,
        tree: &Tree<W>,
        rays: &CullRays<W>,
        ends: &[f32; W],
        open: u32,
    ) -> u64 {
        if tree.root.is_leaf() {
            // It stands in the first slot of the first node.
            (self.near[0], self.entered, self.tested) = ([0.0; W], [1.0; W], 0);
            return 0;
        }
        if SECOND {
            simd.outline(BeginAny::<W, FACES> { entrance: self, tree, rays, ends, open })
        } else {
            self.test_root(simd, &tree.nodes[0], rays, ends);
            self.tested = 0;
            u64::from(open.count_ones())
        }
    }

    /// Tests prepared rays, up to the ends of their spans, against the boxes of the root.
    #[inline(always)]
    fn test_root<S: Simd>(&mut self, simd: S, root: &Node<W>, rays: &CullRays<W>, ends: &[f32; W]) {
        let (rays, ends) = (rays.slabs(simd), simd.load_f32(ends));
        let mut entering = Entering::new(simd);
        for (child, at) in self.near.iter_mut().enumerate() {
            // The slots in use stand first.
            if root.is_empty(child) {
                break;
            }
            let (enters, near) = enter(simd, root, child, &rays, ends);
            entering.push(simd, enters);
            near.max(simd.splat_f32(0.0)).store(at);
        }
        entering.sums.store(&mut self.entered);
    }

    /// The children of the root that a ray enters, a bit each.
    #[inline(always)]
    pub(crate) fn of(&self, ray: usize) -> u32 {
        bits(self.entered[ray])
    }
}

/// A sum of small powers of two.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small whole number")]
fn bits(sum: f32) -> u32 {
    sum as u32
}

/// Rays begin to look for any hit; they may leave faces behind, which they look for below the root.
struct BeginAny<'a, const W: usize, const FACES: bool> {
    entrance: &'a mut Entrance<W>,
    tree: &'a Tree<W>,
    rays: &'a CullRays<W>,
    ends: &'a [f32; W],
    open: u32,
}

impl<S: Simd, const W: usize, const FACES: bool> Part<S> for BeginAny<'_, W, FACES> {
    type Output = u64;

    #[inline(always)]
    fn run(self, simd: S) -> u64 {
        let Self { entrance, tree, rays, ends, open } = self;
        let faces = rays.faces(simd);
        let (rays, ends) = (rays.slabs(simd), simd.load_f32(ends));
        let root = &tree.nodes[0];
        let mut entering = Entering::new(simd);
        // How many rays go on to each child, and the children that several do.
        let (mut counts, mut shared) = ([0; W], 0);
        for child in (0..W).take_while(|&child| !root.is_empty(child)) {
            let (enters, _) = enter(simd, root, child, &rays, ends);
            entering.push(simd, enters);
            let count = (enters.bits() & open).count_ones();
            counts[child] = count;
            shared |= u32::from(count >= LEAST_RAYS && !Child(root.children[child]).is_leaf()) << child;
        }
        entering.sums.store(&mut entrance.entered);
        entrance.tested = shared;
        let mut tests = open.count_ones();
        while shared != 0 {
            let number = shared.trailing_zeros() as usize % W;
            shared &= shared - 1;
            tests += counts[number];
            let node = &tree.nodes[Child(root.children[number]).node_index()];
            let mut entering = Entering::new(simd);
            for child in (0..W).take_while(|&child| !node.is_empty(child)) {
                let (mut enters, _) = enter(simd, node, child, &rays, ends);
                if FACES {
                    enters = enters & ahead(simd, node, child, &rays, &faces);
                }
                entering.push(simd, enters);
            }
            entering.sums.store(&mut entrance.entered_below[number]);
        }
        u64::from(tests)
    }
}

/// Goes on from the children of the root that a ray enters, of which there is one at least.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entered<'a, const W: usize> {
    pub(crate) entrance: &'a Entrance<W>,
    pub(crate) ray: usize,
}

impl<const W: usize> Begin<W> for Entered<'_, W> {
    #[inline(always)]
    fn nearest(&self, tree: &Tree<W>, stack: &mut [u64], height: &mut usize) -> Child {
        let Self { entrance, ray } = *self;
        put_by_distance(&tree.nodes[0], entrance.of(ray), (&entrance.near, ray), stack, height)
    }

    #[inline(always)]
    fn any<S: Simd>(
        &self,
        simd: S,
        tree: &Tree<W>,
        turned: u32,
        stack: &mut [u32],
        height: &mut usize,
    ) -> Option<Child> {
        let Self { entrance, ray } = *self;
        let (root, entered) = (&tree.nodes[0], entrance.of(ray));
        let (mut tested, others) = (entered & entrance.tested, entered & !entrance.tested);
        let is_turned = tree.root.is_turned(turned);
        let mut next = None;
        if others != 0 {
            next = Some(put_all(simd, (root, is_turned), others, stack, height));
        }
        // What is put last is visited first.
        while tested != 0 {
            let lane = if is_turned { 31 - tested.leading_zeros() } else { tested.trailing_zeros() };
            tested ^= 1 << lane;
            let slot = lane as usize % W;
            let below = bits(entrance.entered_below[slot][ray]);
            if below != 0 {
                if let Some(next) = next {
                    stack[*height] = next.0;
                    *height += 1;
                }
                let child = Child(root.children[slot]);
                let node = (&tree.nodes[child.node_index()], child.is_turned(turned));
                next = Some(put_all(simd, node, below, stack, height));
            }
        }
        next
    }
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use rayset_geometry::glam::{DVec3, dvec3};
    use rayset_geometry::{BoundingBox, Ray, unit};
    use rayset_simd::{Backend, Kernel};

    use super::*;
    use crate::columns::RayColumns;
    use crate::frame::Frame;
    use crate::ray::Targets;
    use crate::traverse::{Stack, children_of};

    /// Whether each of many rays enters the same children together as by itself, and as far away; whether all that it
    /// goes on to, where any hit will do, is what it enters.
    struct Together;

    impl Kernel for Together {
        type Output = [usize; 4];

        fn run<S: Simd>(self, simd: S) -> [usize; 4] {
            if S::F32::LANES == 16 { compare::<S, 16>(simd) } else { compare::<S, 8>(simd) }
        }
    }

    /// Points strewn in a cube.
    fn point(rng: &mut ChaCha8Rng, size: f64) -> DVec3 {
        let mut number = || size * (f64::from(rng.next_u32()) / f64::from(u32::MAX) * 2.0 - 1.0);
        dvec3(number(), number(), number())
    }

    /// A root some of whose children are nodes, the others and theirs leaves; boxes of children lie anywhere.
    fn tree<const W: usize>(rng: &mut ChaCha8Rng, frame: &Frame, slots: usize) -> Tree<W> {
        let mut nodes = vec![Node::EMPTY];
        let mut leaf = 0;
        let mut set = |node: &mut Node<W>, slot: usize, child: Option<Child>| {
            let (a, b) = (point(rng, 1.0), point(rng, 1.0));
            leaf += 1;
            let bounds = BoundingBox { min: a.min(b), max: a.max(b) };
            node.set(slot, &frame.cull_box(&bounds), child.unwrap_or(Child::leaf(leaf)));
        };
        for slot in 0..slots {
            let mut below = None;
            if slot % 3 != 1 {
                let mut node = Node::EMPTY;
                (0..=(slot * 5) % W).for_each(|slot| set(&mut node, slot, None));
                below = Some(Child::node(nodes.len(), [0, 1, 2][slot % 3]));
                nodes.push(node);
            }
            set(&mut nodes[0], slot, below);
        }
        Tree { root: Child::node(0, 1), nodes, depth: 2 }
    }

    fn compare<S: Simd, const W: usize>(simd: S) -> [usize; 4] {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let frame = Frame::of(&BoundingBox { min: DVec3::NEG_ONE, max: DVec3::ONE });
        let (mut entrance, mut prepared) = (Entrance::<W>::NONE, CullRays::<W>::NONE);
        let (mut entered, mut missed, mut tested, mut untested) = (0, 0, 0, 0);
        for case in 0..1000 {
            let tree = tree::<W>(&mut rng, &frame, (case % W) + 1);
            // Rays from anywhere, and rays that stay together.
            let (eye, spread) = (point(&mut rng, 1.5), [1.0, 0.1][case / 3 % 2]);
            let middle = point(&mut rng, 0.5);
            let rays: Vec<_> = (0..W)
                .map(|i| {
                    let origin = eye + point(&mut rng, spread);
                    let toward = unit(middle + point(&mut rng, spread) - origin).unwrap_or(DVec3::X);
                    // Along an axis, both ways, where nothing but zeros is across.
                    let along = [DVec3::X, DVec3::NEG_Y, dvec3(0.0, -0.0, -1.0)][i % 3];
                    let direction = if (i + case) % 8 == 0 { along } else { toward };
                    Ray::new(origin, direction)
                })
                .collect();
            let of = |at: &dyn Fn(&Ray) -> f64| rays.iter().map(at).collect::<Vec<_>>();
            let origins = [0, 1, 2].map(|k| of(&|ray| ray.origin()[k]));
            let directions = [0, 1, 2].map(|k| of(&|ray| ray.direction()[k]));
            let starts: Vec<f64> = (0..W).map(|i| [0.0, 0.3][i % 2]).collect();
            let ends: Vec<f64> =
                (0..W).map(|i| [f64::INFINITY, 2.0, f64::INFINITY, f64::NAN][i % 4]).collect();
            let columns = RayColumns {
                origins: [&origins[0], &origins[1], &origins[2]],
                directions: [&directions[0], &directions[1], &directions[2]],
                spans: (&starts, &ends),
                left: &[],
            };
            prepared.prepare(simd, &frame, &columns, (0, W), Targets::default());
            let (ends, open) = (prepared.ends(), rng.next_u32() & prepared.found(W));
            let by_itself =
                |node: &Node<W>, i: usize| prepared.ray(i).map(|cull| children_of(simd, node, cull, ends[i]));
            let root = &tree.nodes[0];
            let tests = entrance.begin::<S, false, false>(simd, &tree, &prepared, ends, open);
            assert_eq!(tests, u64::from(open.count_ones()));
            for i in 0..W {
                let Some((bits, near)) = by_itself(root, i) else { continue };
                assert_eq!(entrance.of(i), bits, "case {case}, ray {i}");
                for (child, near) in near.iter().enumerate().filter(|(child, _)| bits >> child & 1 == 1) {
                    assert_eq!(entrance.near[child][i].to_bits(), near.max(0.0).to_bits());
                }
                entered += bits.count_ones() as usize;
                missed += usize::from(bits == 0);
            }
            // Every ray that is open counts where it would have tested a node by itself.
            let tests = entrance.begin::<S, true, false>(simd, &tree, &prepared, ends, open);
            let mut expected_tests = u64::from(open.count_ones());
            for i in 0..W {
                let Some((bits, _)) = by_itself(root, i) else { continue };
                assert_eq!(entrance.of(i), bits, "case {case}, ray {i}");
                let mut expected = Vec::new();
                for child in (0..W).filter(|child| bits >> child & 1 == 1) {
                    let at = Child(root.children[child]);
                    if entrance.tested >> child & 1 == 0 {
                        expected.push(at.0);
                        untested += 1;
                        continue;
                    }
                    expected_tests += u64::from(open >> i & 1);
                    tested += 1;
                    let node = &tree.nodes[at.node_index()];
                    let below = by_itself(node, i).expect("it enters something").0;
                    expected.extend(
                        (0..W).filter(|child| below >> child & 1 == 1).map(|child| node.children[child]),
                    );
                }
                if bits != 0 {
                    let (mut stack, mut height) = (Stack::of(&tree), 0);
                    let begin = Entered { entrance: &entrance, ray: i };
                    let turned = [0, 1, 2, 3, 4, 5, 6, 7][i % 8];
                    let next = begin.any(simd, &tree, turned, &mut stack.children, &mut height);
                    let mut found = stack.children[..height].to_vec();
                    found.extend(next.map(|child| child.0));
                    found.sort_unstable();
                    expected.sort_unstable();
                    assert_eq!(found, expected, "case {case}, ray {i}");
                }
            }
            assert_eq!(tests, expected_tests, "case {case}");
        }
        [entered, missed, tested, untested]
    }

    #[test]
    fn rays_enter_together_what_each_enters_alone() {
        for &backend in Backend::available() {
            let [entered, missed, tested, untested] = backend.run(Together);
            assert!(entered > 1000 && missed > 500, "{backend}: {entered}, {missed}");
            assert!(tested > 500 && untested > 500, "{backend}: {tested}, {untested}");
        }
    }
}
