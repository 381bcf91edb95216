//! The hierarchy and what it answers.

use rayset_geometry::{BoundingBox, Primitive, PrimitiveColumns, PrimitiveKind, Probe, Ray, Side, Sides, Span};
use rayset_simd::{Backend, Kernel, Lanes, Simd};

use crate::build::{Reference, build};
use crate::frame::Frame;
use crate::node::Tree;
use crate::ray::CullRay;
use crate::shapes::{Hit, Shapes};
use crate::traverse::{Stack, Steps, Visitor, traverse};

/// A bounding volume hierarchy over primitives of any shape.
#[derive(Clone, Debug)]
pub struct Hierarchy {
    backend: Backend,
    frame: Frame,
    tree: Width,
    shapes: Shapes,
}

/// A tree as wide as the lanes that traverse it.
#[derive(Clone, Debug)]
enum Width {
    Eight(Tree<8>),
    Sixteen(Tree<16>),
}

/// What a caller keeps between rays, so that tracing one allocates nothing.
#[derive(Clone, Debug)]
pub struct Scratch {
    stack: Stack,
    /// What was done with it.
    pub steps: Steps,
    /// How many primitives were tested.
    pub primitive_tests: u64,
}

impl Hierarchy {
    /// Builds a hierarchy over primitives, numbered in their order, for the lanes of [`Backend::active`].
    ///
    /// # Panics
    ///
    /// If there are 2^31 primitives or more.
    #[must_use]
    pub fn new<'p>(primitives: impl IntoIterator<Item = (&'p Primitive, Sides)>) -> Self {
        let mut columns = PrimitiveColumns::default();
        let mut items = Vec::new();
        for (primitive, sides) in primitives {
            let run = columns.push(primitive, sides);
            items.push((run.kind, run.range.start, sides));
        }
        Self::over(&columns, &items, Backend::active())
    }

    /// Builds a hierarchy over primitives that stand in columns: their kinds, indices in the columns of the kind, and
    /// the sides they can be hit from.
    ///
    /// # Panics
    ///
    /// If an index is not in the columns, or there are 2^31 primitives or more.
    #[must_use]
    pub fn over(
        columns: &PrimitiveColumns,
        items: &[(PrimitiveKind, u32, Sides)],
        backend: Backend,
    ) -> Self {
        assert!(items.len() < 1 << 31, "fewer than 2^31 primitives");
        let boxes: Vec<BoundingBox> =
            items.iter().map(|&(kind, index, _)| columns.bounding_box(kind, index)).collect();
        let frame = Frame::of(&boxes.iter().copied().collect());
        let mut references: Vec<Reference> = (0..)
            .zip(&boxes)
            .map(|(primitive, bounds)| Reference { bounds: frame.cull_box(bounds), primitive })
            .collect();
        let is_wide = backend == Backend::Avx512 && backend.is_available();
        let (tree, leaves) = if is_wide {
            let (tree, leaves) = build::<16>(&mut references, LEAF_LEN);
            (Width::Sixteen(tree), leaves)
        } else {
            let (tree, leaves) = build::<8>(&mut references, LEAF_LEN);
            (Width::Eight(tree), leaves)
        };
        let shapes = Shapes::arrange(columns, items, |i| references[i].primitive, &leaves);
        Self { backend, frame, tree, shapes }
    }

    /// The lanes it was built for.
    #[must_use]
    pub fn backend(&self) -> Backend {
        self.backend
    }

    /// What [`Hierarchy::nearest_on`] and [`Hierarchy::occluded_on`] need to keep between rays.
    #[must_use]
    pub fn scratch(&self) -> Scratch {
        let stack = match &self.tree {
            Width::Eight(tree) => Stack::of(tree),
            Width::Sixteen(tree) => Stack::of(tree),
        };
        Scratch { stack, steps: Steps::default(), primitive_tests: 0 }
    }

    /// The least hit of a ray in the order `(t, primitive)`.
    #[must_use]
    pub fn nearest(&self, ray: &Ray, span: Span) -> Option<Hit> {
        self.backend.run(NearestOf { hierarchy: self, ray, span, scratch: &mut self.scratch() })
    }

    /// Whether a ray hits anything.
    #[must_use]
    pub fn occluded(&self, ray: &Ray, span: Span) -> bool {
        self.backend.run(OccludedOf { hierarchy: self, ray, span, scratch: &mut self.scratch() })
    }

    /// The least hit, within a kernel that runs on the lanes the hierarchy was built for; `from` is the primitive that
    /// the ray leaves, and into which side.
    #[inline(always)]
    pub fn nearest_on<S: Simd>(
        &self,
        simd: S,
        ray: &Ray,
        span: Span,
        from: Option<(u32, Side)>,
        scratch: &mut Scratch,
    ) -> Option<Hit> {
        let cull = CullRay::new(&self.frame, ray, span)?;
        let Scratch { stack, steps, primitive_tests } = scratch;
        let mut visitor = NearestVisitor {
            shapes: &self.shapes,
            probe: Probe::new(simd, ray, span, self.shapes.is_flat()),
            departure: self.shapes.departure(from),
            cull,
            end: cull.end(span.end),
            nearest: None,
            tests: primitive_tests,
        };
        self.traverse(simd, stack, &cull, visitor.end, steps, &mut visitor);
        visitor.nearest
    }

    /// Whether anything is hit, within a kernel that runs on the lanes the hierarchy was built for.
    #[inline(always)]
    pub fn occluded_on<S: Simd>(
        &self,
        simd: S,
        ray: &Ray,
        span: Span,
        from: Option<(u32, Side)>,
        scratch: &mut Scratch,
    ) -> bool {
        let Some(cull) = CullRay::new(&self.frame, ray, span) else { return false };
        let Scratch { stack, steps, primitive_tests } = scratch;
        let mut visitor = AnyVisitor {
            shapes: &self.shapes,
            probe: Probe::new(simd, ray, span, self.shapes.is_flat()),
            departure: self.shapes.departure(from),
            end: cull.end(span.end),
            is_hit: false,
            tests: primitive_tests,
        };
        self.traverse(simd, stack, &cull, visitor.end, steps, &mut visitor);
        visitor.is_hit
    }

    #[inline(always)]
    fn traverse<S: Simd>(
        &self,
        simd: S,
        stack: &mut Stack,
        ray: &CullRay,
        end: f32,
        steps: &mut Steps,
        visitor: &mut impl Visitor,
    ) {
        match &self.tree {
            Width::Eight(tree) if S::F32::LANES == 8 => traverse(simd, tree, stack, ray, end, steps, visitor),
            Width::Sixteen(tree) if S::F32::LANES == 16 => traverse(simd, tree, stack, ray, end, steps, visitor),
            _ => unreachable!("a hierarchy runs on the lanes it was built for"),
        }
    }
}

/// How many primitives a leaf holds at most.
const LEAF_LEN: usize = 8;

struct NearestVisitor<'h, S: Simd> {
    shapes: &'h Shapes,
    probe: Probe<S>,
    departure: Option<rayset_geometry::Departure>,
    cull: CullRay,
    end: f32,
    nearest: Option<Hit>,
    tests: &'h mut u64,
}

impl<S: Simd> Visitor for NearestVisitor<'_, S> {
    #[inline(always)]
    fn leaf(&mut self, leaf: usize) -> Option<f32> {
        if self.shapes.nearest(leaf, &self.probe, self.departure, &mut self.nearest, self.tests)
            && let Some(hit) = &self.nearest
        {
            self.end = self.cull.end(hit.t);
        }
        Some(self.end)
    }
}

struct AnyVisitor<'h, S: Simd> {
    shapes: &'h Shapes,
    probe: Probe<S>,
    departure: Option<rayset_geometry::Departure>,
    end: f32,
    is_hit: bool,
    tests: &'h mut u64,
}

impl<S: Simd> Visitor for AnyVisitor<'_, S> {
    #[inline(always)]
    fn leaf(&mut self, leaf: usize) -> Option<f32> {
        self.is_hit = self.shapes.any(leaf, &self.probe, self.departure, self.tests);
        if self.is_hit { None } else { Some(self.end) }
    }
}

struct NearestOf<'a> {
    hierarchy: &'a Hierarchy,
    ray: &'a Ray,
    span: Span,
    scratch: &'a mut Scratch,
}

impl Kernel for NearestOf<'_> {
    type Output = Option<Hit>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<Hit> {
        self.hierarchy.nearest_on(simd, self.ray, self.span, None, self.scratch)
    }
}

struct OccludedOf<'a> {
    hierarchy: &'a Hierarchy,
    ray: &'a Ray,
    span: Span,
    scratch: &'a mut Scratch,
}

impl Kernel for OccludedOf<'_> {
    type Output = bool;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> bool {
        self.hierarchy.occluded_on(simd, self.ray, self.span, None, self.scratch)
    }
}
