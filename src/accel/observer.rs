//! Observers of a traversal, for counters and for the explanation of a ray.

use crate::accel::cursor::{Candidate, Committed};
use crate::geometry::Intersection;

/// Receives the steps of a traversal. `()` receives none and costs nothing.
///
/// What the tree culls is not reported: boxes that the ray misses, and what lies behind a hit that
/// is known already.
pub trait TraversalObserver {
    /// Whether reasons are wanted. They cost a second test of each primitive that is not hit.
    const REASONS: bool;

    /// Whether nothing is reported: traversal then takes the shortest way.
    const QUIET: bool = false;

    /// A node was opened: of an instance's tree, or (`None`) of the tree over the instances.
    fn node(&mut self, _instance: Option<u32>) {}

    /// An instance was reached.
    fn instance(&mut self, _instance: u32, _verdict: InstanceVerdict) {}

    /// A primitive was tested.
    fn primitive(&mut self, _place: HitPrimitive, _verdict: PrimitiveVerdict) {}

    /// `count` primitives were tested together and missed; reported only without `REASONS`.
    fn missed(&mut self, _count: u32) {}

    /// A candidate is handed to the shaders.
    fn present(&mut self, _candidate: &Candidate) {}

    /// An opaque hit was committed. (What the caller confirms or generates it knows itself.)
    fn commit(&mut self, _committed: &Committed) {}

    /// The traversal ended; `complete` is false where a hit ended it early.
    fn end(&mut self, _complete: bool) {}
}

impl TraversalObserver for () {
    const REASONS: bool = false;
    const QUIET: bool = true;
}

/// The identity of a primitive in a TLAS.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct HitPrimitive {
    /// `InstanceId`
    pub instance: u32,
    /// `RayGeometryIndexKHR`
    pub geometry: u32,
    /// `PrimitiveId`
    pub primitive: u32,
}

/// What became of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum InstanceVerdict {
    /// Its primitives are looked at.
    Entered,
    /// Its mask and the ray's cull mask share no bit.
    Masked,
    /// The ray's flags skip its kind of primitive.
    Skipped,
    /// The ray passes by the box around all its primitives, or that lies outside the interval.
    Missed,
}

/// What became of a primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PrimitiveVerdict {
    /// The ray does not meet it.
    Missed,
    /// The ray meets it before t_min or after t_max.
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
    const REASONS: bool = false;

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

/// The methods of [`TraversalObserver`] as an object-safe trait.
trait DynObserver {
    fn node(&mut self, instance: Option<u32>);
    fn instance(&mut self, instance: u32, verdict: InstanceVerdict);
    fn primitive(&mut self, hit_primitive: HitPrimitive, verdict: PrimitiveVerdict);
    fn missed(&mut self, count: u32);
    fn present(&mut self, candidate: &Candidate);
    fn commit(&mut self, committed: &Committed);
    fn end(&mut self, complete: bool);
}

/// An observer of any type, so that traversal is compiled for two types and not for each.
pub(super) struct ErasedObserver<'a, const REASONS: bool>(&'a mut dyn DynObserver);

impl<'a, const REASONS: bool> ErasedObserver<'a, REASONS> {
    pub fn new<V: TraversalObserver>(observer: &'a mut ObserverAdapter<V>) -> Self {
        Self(observer)
    }
}

/// Makes an observer a [`DynObserver`].
pub(super) struct ObserverAdapter<'a, V>(pub &'a mut V);

macro_rules! forward {
    ($($method:ident($($argument:ident: $type:ty),*))*) => {
        impl<V: TraversalObserver> DynObserver for ObserverAdapter<'_, V> {
            $(fn $method(&mut self, $($argument: $type),*) {
                self.0.$method($($argument),*);
            })*
        }

        impl<const REASONS: bool> TraversalObserver for ErasedObserver<'_, REASONS> {
            const REASONS: bool = REASONS;

            $(fn $method(&mut self, $($argument: $type),*) {
                self.0.$method($($argument),*);
            })*
        }
    };
}
forward! {
    node(instance: Option<u32>)
    instance(instance: u32, verdict: InstanceVerdict)
    primitive(hit_primitive: HitPrimitive, verdict: PrimitiveVerdict)
    missed(count: u32)
    present(candidate: &Candidate)
    commit(committed: &Committed)
    end(complete: bool)
}
