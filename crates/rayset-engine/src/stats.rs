//! What a strategy did: exact counts.

use std::fmt;
use std::ops::{AddAssign, Sub};

use crate::{ByKind, Histogram};

/// Work, in counts that depend on strategy and options, and never on the number of threads.
///
/// Those of `standard` depend on nothing else. Those of `speer-1985` also depend on the pixel order and on where sweeps
/// begin, since it keeps what it learnt; those of `coherent` also on the bundle length, since the rays of a bundle
/// share what they may spend; those of `hierarchical` on the number of lanes, which is the width of its nodes, and those
/// of `bundle` and `auto` on the order and the bundle length too, since the rays of a shaft share its work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Work {
    /// Region partitions: the `k n` term of section 3 is one of them.
    pub partitions: u64,
    /// Volumes classified by partitions into B, N and I.
    pub volumes_classified: u64,
    /// Primitives tested for a hit, one at a time as a scalar loop would.
    pub primitive_tests: u64,
    /// Pierce checks of a cylinder, or whether a ray belongs to a pencil: two tests each.
    pub pierce_checks: u64,
    /// Cylinders, or certificates, built.
    pub cylinders_built: u64,
    /// Members of N looked at for the radius of a cylinder: the `lambda n` term of section 3. For a certificate, two for
    /// every volume tested.
    pub radius_comparisons: u64,
    /// Cells of a grid that rays passed through.
    pub cells_visited: u64,
    /// Boxes of a hierarchy that rays were tested against, empty slots of a node included.
    pub boxes_tested: u64,
}

/// How the rays of one kind fared with what was retained.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct CoherenceCounts {
    /// Rays for which the retained tree had a corresponding ray with a certificate.
    pub guided: u64,
    /// Guided rays that missed the predicted object.
    pub predicted_missed: u64,
    /// Guided rays that hit the predicted object, but pierced the cylinder.
    pub pierced: u64,
    /// Pierced rays that a nearer object intercepted indeed: the case of Figure 2.
    pub false_coherence: u64,
    /// Rays answered without a partition.
    pub coherent: u64,
    /// Coherent answers that a partition contradicts; counted only in an audit.
    pub wrong: u64,
}

/// How many rays of one kind each stage of `bundle` answered, the rays that it is coherence for first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct StageCounts {
    /// Under the shaft of a tile of packets, or in a tile that misses everything.
    pub tiles: u64,
    /// Under the shaft of a packet.
    pub packets: u64,
    /// By what blocked a light ray before them.
    pub blockers: u64,
    /// One by one.
    pub alone: u64,
}

/// Everything a strategy counted in one or more sweeps.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Stats {
    /// The work done.
    pub work: Work,
    /// How the rays fared, by kind.
    pub coherence: ByKind<CoherenceCounts>,
    /// Which stage answered the rays, by kind; of strategies that trace bundles in stages.
    pub stages: ByKind<StageCounts>,
    /// Radii of the cylinders built, in units of the scene's extent.
    pub radii: Histogram,
    /// Lengths of the cylinders built, in units of the scene's extent.
    pub lengths: Histogram,
}

impl Work {
    /// Every count, with the name that statistics and reports give it, in the order of the fields.
    pub fn counts(mut self) -> impl Iterator<Item = (&'static str, u64)> {
        self.counts_mut().map(|(name, count)| (name, *count)).into_iter()
    }

    /// The same, to be changed.
    pub fn counts_mut(&mut self) -> [(&'static str, &mut u64); 8] {
        let Self {
            partitions,
            volumes_classified,
            primitive_tests,
            pierce_checks,
            cylinders_built,
            radius_comparisons,
            cells_visited,
            boxes_tested,
        } = self;
        [
            ("partitions", partitions),
            ("volumes_classified", volumes_classified),
            ("primitive_tests", primitive_tests),
            ("pierce_checks", pierce_checks),
            ("cylinders_built", cylinders_built),
            ("radius_comparisons", radius_comparisons),
            ("cells_visited", cells_visited),
            ("boxes_tested", boxes_tested),
        ]
    }

    /// The work in tests of one primitive or volume: primitive tests, volumes classified, two for each pierce check,
    /// radius comparisons, and one for each cell visited and each box tested.
    ///
    /// Source: Speer et al. 1985, section 4 ("about as much as two ray-sphere intersection tests"). Stepping to a cell
    /// takes fewer operations than a test, but waits for memory.
    #[must_use]
    pub fn in_tests(&self) -> u64 {
        self.primitive_tests
            + self.volumes_classified
            + 2 * self.pierce_checks
            + self.radius_comparisons
            + self.cells_visited
            + self.boxes_tested
    }
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        for ((_, sum), (_, count)) in self.counts_mut().into_iter().zip(other.counts()) {
            *sum += count;
        }
    }
}

impl Sub for Work {
    type Output = Self;

    /// What was done since an earlier count.
    fn sub(mut self, earlier: Self) -> Self {
        for ((_, rest), (_, count)) in self.counts_mut().into_iter().zip(earlier.counts()) {
            *rest -= count;
        }
        self
    }
}

impl AddAssign for CoherenceCounts {
    fn add_assign(&mut self, other: Self) {
        self.guided += other.guided;
        self.predicted_missed += other.predicted_missed;
        self.pierced += other.pierced;
        self.false_coherence += other.false_coherence;
        self.coherent += other.coherent;
        self.wrong += other.wrong;
    }
}

impl StageCounts {
    /// How many rays were answered together with others.
    #[must_use]
    pub fn together(&self) -> u64 {
        self.tiles + self.packets + self.blockers
    }
}

impl AddAssign for StageCounts {
    fn add_assign(&mut self, other: Self) {
        self.tiles += other.tiles;
        self.packets += other.packets;
        self.blockers += other.blockers;
        self.alone += other.alone;
    }
}

impl AddAssign<&Self> for Stats {
    fn add_assign(&mut self, other: &Self) {
        self.work += other.work;
        self.coherence += other.coherence;
        self.stages += other.stages;
        self.radii += &other.radii;
        self.lengths += &other.lengths;
    }
}

impl fmt::Display for Stats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for pair in self.work.counts().collect::<Vec<_>>().chunks(2) {
            let shown: Vec<_> =
                pair.iter().map(|(name, count)| format!("{count} {}", name.replace('_', " "))).collect();
            writeln!(f, "{}", shown.join(", "))?;
        }
        for (kind, counts) in self.coherence.iter() {
            let CoherenceCounts { guided, predicted_missed, pierced, false_coherence, coherent, wrong } =
                counts;
            writeln!(
                f,
                "{:9} rays: {guided} guided, {predicted_missed} missed the prediction, {pierced} pierced, \
                 {false_coherence} of them falsely coherent, {coherent} coherent, {wrong} wrong",
                kind.name()
            )?;
        }
        for (kind, &StageCounts { tiles, packets, blockers, alone }) in self.stages.iter() {
            if tiles + packets + blockers + alone > 0 {
                writeln!(
                    f,
                    "{:9} rays: {tiles} in tiles, {packets} in packets, {blockers} by blockers, {alone} alone",
                    kind.name()
                )?;
            }
        }
        Ok(())
    }
}
