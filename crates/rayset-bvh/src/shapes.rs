//! The primitives of a hierarchy, in the order of its leaves.

use std::ops::Range;

use rayset_geometry::{ColumnRun, Departure, PrimitiveColumns, PrimitiveKind, Probe, Side, Sides};
use rayset_simd::Simd;

/// What is hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The distance along the ray, in world units.
    pub t: f64,
    /// The number of the primitive, in the order in which the hierarchy was given them.
    pub primitive: u32,
}

impl Hit {
    /// Whether this hit comes before another in the order `(t, primitive)`.
    #[inline(always)]
    fn precedes(&self, other: &Self) -> bool {
        self.t < other.t || (self.t.total_cmp(&other.t).is_eq() && self.primitive < other.primitive)
    }
}

/// Primitives of any shape, each with the sides it can be hit from.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shapes {
    columns: PrimitiveColumns,
    /// Runs of one kind and visibility, leaf by leaf.
    runs: Vec<ColumnRun>,
    /// Where each leaf's runs start, and one past the end of the last.
    leaf_runs: Vec<u32>,
    /// The number of each primitive of a kind.
    numbers: [Vec<u32>; 4],
    /// Where each primitive went.
    places: Vec<(PrimitiveKind, u32)>,
}

impl Shapes {
    /// Puts primitives in the order of leaves.
    pub(crate) fn arrange(
        source: &PrimitiveColumns,
        items: &[(PrimitiveKind, u32, Sides)],
        order: impl Fn(usize) -> u32,
        leaves: &[Range<u32>],
    ) -> Self {
        let mut shapes = Self {
            places: vec![(PrimitiveKind::Sphere, 0); items.len()],
            leaf_runs: vec![0],
            ..Self::default()
        };
        let mut members = Vec::new();
        for leaf in leaves {
            members.clear();
            members.extend(leaf.clone().map(|i| order(i as usize)));
            // By kind and sides for long runs; by number within, since the least number wins a tie.
            members.sort_unstable_by_key(|&number| {
                let (kind, _, sides) = items[number as usize];
                (kind as u8, sides as u8, number)
            });
            let first_run = shapes.runs.len();
            for &number in &members {
                let (kind, index, sides) = items[number as usize];
                let run = shapes.columns.push_from(source, kind, index, sides);
                shapes.places[number as usize] = (kind, run.range.start);
                shapes.numbers[kind as usize].push(number);
                match shapes.runs[first_run..].last_mut() {
                    Some(last) if last.kind == kind && last.sides == sides => last.range.end = run.range.end,
                    _ => shapes.runs.push(run),
                }
            }
            shapes.leaf_runs.push(u32::try_from(shapes.runs.len()).expect("no more runs than primitives"));
        }
        shapes
    }

    /// Whether there is any triangle or polygon.
    pub(crate) fn is_flat(&self) -> bool {
        self.columns.is_flat()
    }

    /// A ray's departure, as the columns know it.
    #[inline]
    pub(crate) fn departure(&self, from: Option<(u32, Side)>) -> Option<Departure> {
        from.map(|(primitive, side)| {
            let (kind, index) = self.places[primitive as usize];
            Departure { kind, index, side }
        })
    }

    #[inline(always)]
    fn runs_of(&self, leaf: usize) -> &[ColumnRun] {
        &self.runs[self.leaf_runs[leaf] as usize..self.leaf_runs[leaf + 1] as usize]
    }

    /// Keeps the least of a hit and those in a leaf; returns whether it is a new one.
    #[inline(always)]
    pub(crate) fn nearest<S: Simd>(
        &self,
        leaf: usize,
        probe: &Probe<S>,
        departure: Option<Departure>,
        nearest: &mut Option<Hit>,
        tests: &mut u64,
    ) -> bool {
        let mut is_new = false;
        for run in self.runs_of(leaf) {
            *tests += u64::from(run.range.end - run.range.start);
            if let Some(hit) = self.columns.nearest(probe, run, departure) {
                let hit =
                    Hit { t: hit.t, primitive: self.numbers[run.kind as usize][hit.index as usize] };
                if nearest.is_none_or(|nearest| hit.precedes(&nearest)) {
                    *nearest = Some(hit);
                    is_new = true;
                }
            }
        }
        is_new
    }

    /// Whether anything in a leaf is hit.
    #[inline(always)]
    pub(crate) fn any<S: Simd>(
        &self,
        leaf: usize,
        probe: &Probe<S>,
        departure: Option<Departure>,
        tests: &mut u64,
    ) -> bool {
        for run in self.runs_of(leaf) {
            *tests += u64::from(run.range.end - run.range.start);
            if self.columns.any(probe, run, departure).is_some() {
                return true;
            }
        }
        false
    }
}
