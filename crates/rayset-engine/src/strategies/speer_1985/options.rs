//! The places where the text of section 2.3 leaves a choice.

/// What is retained of a ray that hits nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum MissRule {
    /// Nothing. The text speaks of cylinders that end at a point of intersection, so a miss has none.
    #[default]
    Partition,
    /// A cylinder that ends behind the last volume in front: a corresponding ray that does not pierce it hits nothing
    /// either.
    Cylinder,
}

/// Which light rays build cylinders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum LightRule {
    /// Those that an object blocks: "If an object is intersected by such a ray, a cylinder is built" (2.3.3).
    #[default]
    Blocked,
    /// Those too that reach the light: theirs ends at the light.
    All,
    /// None.
    None,
}

/// Where the cylinder of a blocked light ray ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BlockerRule {
    /// At the nearest blocker: the cylinder is built "in the manner discussed earlier" (2.3.3), which is for nearest
    /// intersections.
    #[default]
    Nearest,
    /// At the first blocker found, which is all that shadowing asks for.
    First,
}

/// When a volume of N is "between the bounding plane of the ray and a parallel plane" (2.3.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SlabRule {
    /// When any part of it is: the reading that protects most.
    #[default]
    Overlapping,
    /// When its centre is.
    Centre,
    /// When all of it is.
    Inside,
}

/// What a segment must not pierce.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum EndPlaneRule {
    /// "the side of the relevant container" (2.3.1).
    #[default]
    SideOnly,
    /// The side and the two end planes.
    Closed,
}

/// Which rays correspond, beside being at the same place in the tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum MatchRule {
    /// All: the text demands nothing.
    #[default]
    AnyOrigin,
    /// Those with the same originating object.
    SameObject,
    /// Those with the same originating object, left on the same side.
    SameObjectAndSide,
}

/// What a coherent ray leaves for the next ray-set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum InheritanceRule {
    /// The cylinder that served it: "formative ray" (2.3.2) tells it from the ray that uses the cylinder.
    #[default]
    Formative,
    /// Its hit without a cylinder, so that the next ray partitions: at most every other ray is coherent.
    Nothing,
}

/// Whether the volume that a ray leaves limits its cylinder.
///
/// In a render it does not matter: a ray starts inside its originating volume or on it, so the partition puts that
/// volume into I, and only N limits the radius.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum OriginatingRule {
    /// No: the container reaches "to the nearest object not intersected by that ray" (2.3.1), and a ray starts on its
    /// originating object.
    #[default]
    Excluded,
    /// Yes, wherever the partition puts it into N: the radius is then zero or less, and the cylinder useless.
    Included,
}

/// The choices that the text leaves open; the default takes each as literally as the text allows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Speer1985Options {
    /// What is retained of a ray that hits nothing.
    pub misses: MissRule,
    /// Which light rays build cylinders.
    pub light_rays: LightRule,
    /// Where the cylinder of a blocked light ray ends.
    pub blocker: BlockerRule,
    /// Which members of N limit the radius.
    pub slab: SlabRule,
    /// What a segment must not pierce.
    pub end_planes: EndPlaneRule,
    /// Which rays correspond.
    pub matching: MatchRule,
    /// What a coherent ray leaves for the next ray-set.
    pub inheritance: InheritanceRule,
    /// Whether the originating volume limits the radius.
    pub originating: OriginatingRule,
    /// Whether every coherent answer is traced again by partition, and the wrong ones counted.
    ///
    /// An audit changes no answer and no other count; it takes the time that coherence saved.
    pub audit: bool,
}
