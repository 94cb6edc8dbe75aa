//! Observers of a traversal, for counters and for the explanation of a ray.

use crate::accel::hit::{Candidate, Committed, HitPrimitive};
use crate::geometry::Intersection;

/// Receives the steps of a traversal. `()` receives none and costs nothing.
///
/// Primitives that the BVH culls are not reported: those in boxes that the ray misses, and those
/// behind a hit that is known already.
pub trait TraversalObserver {
    /// Whether a traversal with observers of this type is compiled for each instruction set, and
    /// not for the baseline alone.
    fn is_fast() -> bool
    where
        Self: Sized,
    {
        false
    }

    /// Whether observers of this type are told anything: a constant of the type, so that all that
    /// only an observer needs compiles away.
    fn is_active() -> bool
    where
        Self: Sized,
    {
        true
    }

    /// Whether the observer wants to know why a primitive is not hit. Then nothing is culled within
    /// a leaf, and each primitive that is not hit is tested a second time.
    fn explains_misses(&self) -> bool {
        false
    }

    /// Whether an observer that [explains misses](Self::explains_misses) only counts what it would
    /// see: primitives that are tested together are then reported by
    /// [`missed`](Self::missed), and none is tested a second time.
    fn only_counts(&self) -> bool {
        false
    }

    /// Whether every hit in the ray's interval is wanted as a candidate: no hit culls what lies
    /// behind it, and opaque ones are not committed.
    fn wants_all_hits(&self) -> bool {
        false
    }

    /// A node was opened: of an instance's tree, or (`None`) of the tree over the instances.
    fn node(&mut self, _instance: Option<u32>) {}

    /// An instance was reached.
    fn instance(&mut self, _instance: u32, _verdict: InstanceVerdict) {}

    /// A primitive was tested.
    fn primitive(&mut self, _hit_primitive: HitPrimitive, _verdict: PrimitiveVerdict) {}

    /// `count` primitives were tested together and missed, or cannot be hit; reported only where
    /// nobody asks why.
    fn missed(&mut self, _count: u32) {}

    /// A candidate is handed to the shaders.
    fn present(&mut self, _candidate: &Candidate) {}

    /// An opaque hit was committed. (Hits that the caller confirms or generates are not reported.)
    fn commit(&mut self, _committed: &Committed) {}

    /// The traversal ended; `complete` is false where a hit ended it early.
    fn end(&mut self, _complete: bool) {}
}

impl TraversalObserver for () {
    fn is_fast() -> bool {
        true
    }

    fn is_active() -> bool {
        false
    }
}

/// What became of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum InstanceVerdict {
    /// Its primitives are tested.
    Entered,
    /// Its mask and the ray's cull mask share no bit.
    Masked,
    /// The ray's flags skip its kind of primitive.
    Skipped,
    /// The ray misses the box around all its primitives, or that box lies outside the interval.
    Missed,
}

/// What became of a primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PrimitiveVerdict {
    /// The ray misses it.
    Missed,
    /// The ray hits it before t_min or after t_max.
    OutsideInterval(Intersection),
    /// The opacity micromap is transparent there.
    Transparent(Intersection),
    /// The ray's flags cull its opacity.
    CulledByOpacity(Intersection),
    /// The ray's flags cull the side that it shows.
    CulledByFace(Intersection),
    /// It lies behind a hit that is known already.
    Behind(Intersection),
    /// An opaque hit, the closest so far.
    Opaque(Intersection),
    /// A candidate for the shaders.
    Candidate(Intersection),
}

impl PrimitiveVerdict {
    /// Where the ray meets the primitive, whatever becomes of that; `None` where it misses it.
    pub fn intersection(self) -> Option<Intersection> {
        match self {
            Self::Missed => None,
            Self::OutsideInterval(at)
            | Self::Transparent(at)
            | Self::CulledByOpacity(at)
            | Self::CulledByFace(at)
            | Self::Behind(at)
            | Self::Opaque(at)
            | Self::Candidate(at) => Some(at),
        }
    }
}

/// Counts the work of traversals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Nodes opened.
    pub nodes: u64,
    /// Instances reached.
    pub instances: u64,
    /// Primitives tested.
    pub primitives: u64,
    /// Candidates handed out.
    pub candidates: u64,
}

impl TraversalObserver for Counters {
    fn node(&mut self, _: Option<u32>) {
        self.nodes += 1;
    }

    fn instance(&mut self, _: u32, _: InstanceVerdict) {
        self.instances += 1;
    }

    fn primitive(&mut self, _: HitPrimitive, _: PrimitiveVerdict) {
        self.primitives += 1;
    }

    fn missed(&mut self, count: u32) {
        self.primitives += u64::from(count);
    }

    fn present(&mut self, _: &Candidate) {
        self.candidates += 1;
    }
}

/// Counts the nodes and primitives that an observer sees that explains misses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TestCounts {
    /// Nodes opened.
    pub nodes: u64,
    /// Primitives tested.
    pub primitives: u64,
}

impl TraversalObserver for TestCounts {
    fn is_fast() -> bool {
        true
    }

    #[inline(always)]
    fn explains_misses(&self) -> bool {
        true
    }

    #[inline(always)]
    fn only_counts(&self) -> bool {
        true
    }

    #[inline(always)]
    fn node(&mut self, _: Option<u32>) {
        self.nodes += 1;
    }

    #[inline(always)]
    fn primitive(&mut self, _: HitPrimitive, _: PrimitiveVerdict) {
        self.primitives += 1;
    }

    #[inline(always)]
    fn missed(&mut self, count: u32) {
        self.primitives += u64::from(count);
    }
}

/// Any observer, as a trait object: of all observers but [`TestCounts`], traversal is compiled for
/// this one only.
impl TraversalObserver for &mut dyn TraversalObserver {
    fn explains_misses(&self) -> bool {
        (**self).explains_misses()
    }

    fn only_counts(&self) -> bool {
        (**self).only_counts()
    }

    fn wants_all_hits(&self) -> bool {
        (**self).wants_all_hits()
    }

    fn node(&mut self, instance: Option<u32>) {
        (**self).node(instance);
    }

    fn instance(&mut self, instance: u32, verdict: InstanceVerdict) {
        (**self).instance(instance, verdict);
    }

    fn primitive(&mut self, hit_primitive: HitPrimitive, verdict: PrimitiveVerdict) {
        (**self).primitive(hit_primitive, verdict);
    }

    fn missed(&mut self, count: u32) {
        (**self).missed(count);
    }

    fn present(&mut self, candidate: &Candidate) {
        (**self).present(candidate);
    }

    fn commit(&mut self, committed: &Committed) {
        (**self).commit(committed);
    }

    fn end(&mut self, complete: bool) {
        (**self).end(complete);
    }
}
