//! Watching a pipeline at work: what a trace did and why.

use std::sync::Arc;

use crate::accel::visit::{InstanceVerdict, Place, PrimitiveVerdict};
use crate::accel::{Candidate, Committed, HitKind, Tlas, TraceRay, Visit};
use crate::machine::{Exit, RayQueryEvent, Reg};
use crate::module::interface::Stage;
use crate::ops::builtin::Builtin;
use crate::pipeline::group::Shader;

/// Is told what a pipeline does; the unit type looks away and costs nothing.
pub trait Witness {
    /// Whether events are made at all.
    const ACTIVE: bool;

    /// Whether ray queries are to be told, too.
    const QUERIES: bool = false;

    /// Whether they are told with every node and primitive that they look at.
    const TRAVERSAL: bool = Self::QUERIES;

    /// The events that follow are about the invocation with this launch index.
    fn invocation(&mut self, _launch_id: [u32; 3]) {}

    /// Something happened.
    fn event(&mut self, event: Event);

    /// A null record was chosen by the invocation that was named last, so no shader runs: may write
    /// what one would have left in the payload or callable data of the instruction that traces or
    /// calls.
    fn absent(&mut self, _caller: Caller, _words: &mut [u32]) {}
}

impl Witness for () {
    const ACTIVE: bool = false;

    fn event(&mut self, _event: Event) {}
}

/// Collects events.
impl Witness for Vec<Event> {
    const ACTIVE: bool = true;
    const QUERIES: bool = true;

    fn event(&mut self, event: Event) {
        self.push(event);
    }
}

/// Lets another witness see the events of one invocation among several.
pub(super) struct Only<'a, T> {
    pub witness: &'a mut T,
    pub launch_id: [u32; 3],
    seen: bool,
}

impl<'a, T: Witness> Only<'a, T> {
    pub fn new(launch_id: [u32; 3], witness: &'a mut T) -> Self {
        Self { witness, launch_id, seen: true }
    }
}

impl<T: Witness> Witness for Only<'_, T> {
    const ACTIVE: bool = T::ACTIVE;

    fn invocation(&mut self, launch_id: [u32; 3]) {
        self.seen = launch_id == self.launch_id;
    }

    fn event(&mut self, event: Event) {
        if self.seen {
            self.witness.event(event);
        }
    }

    fn absent(&mut self, caller: Caller, words: &mut [u32]) {
        self.witness.absent(caller, words);
    }
}

/// The instruction that traces or calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Caller {
    /// The shader that it stands in.
    pub shader: Shader,
    /// Its operation.
    pub op: u32,
    /// The first row of the payload variable, or of the callable data.
    pub payload: Reg,
}

/// Hands events to a closure; of ray queries what they are asked and what they commit.
impl Witness for &mut dyn FnMut(Event) {
    const ACTIVE: bool = true;
    const QUERIES: bool = true;
    const TRAVERSAL: bool = false;

    fn event(&mut self, event: Event) {
        self(event);
    }
}

/// Something that happened. Words are 32-bit words in the order of a value's scalars.
///
/// At one lane events nest: between `Enter` and its `Leave` stands what the shader did, between
/// `Trace` and its `Traced` what the ray did, its shaders included.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Event {
    /// A trace begins.
    Trace {
        /// Who traces; `None` for a ray that no shader traced.
        caller: Option<Caller>,
        /// The acceleration structure.
        tlas: Arc<Tlas>,
        /// `LaunchIdKHR` of the ray.
        launch_id: [u32; 3],
        /// How deep in the tree of traces: 1 for a trace by ray generation.
        depth: u32,
        /// Ray, flags, cull mask.
        trace: TraceRay,
        /// SBT offset, SBT stride and miss index, as given.
        sbt: [u32; 3],
        /// The payload as given.
        payload: Vec<u32>,
    },
    /// A node of an instance's tree was opened, or (`None`) one of the tree over the instances.
    Node(Option<u32>),
    /// Traversal reached an instance.
    Instance(u32, InstanceVerdict),
    /// Traversal tested a primitive.
    Primitive(Place, PrimitiveVerdict),
    /// A candidate needs a shader's decision, or has no shader to decide: `None` accepts it (a
    /// triangle, sphere or linear swept sphere) or drops it (a box).
    Candidate {
        /// What was met.
        candidate: Candidate,
        /// The hit record's index.
        record: u64,
        /// Instance offset, geometry index, SBT stride and SBT offset that make it.
        arithmetic: [u32; 4],
        /// The shader that decides.
        shader: Option<Shader>,
    },
    /// An opaque hit was committed without a shader.
    Opaque(Committed),
    /// A shader begins.
    Enter {
        /// Which.
        shader: Shader,
        /// Its stage.
        stage: Stage,
        /// The builtins that it reads, with their words.
        builtins: Vec<(&'static Builtin, Vec<u32>)>,
        /// The payload that it sees, where it declares one.
        payload: Vec<u32>,
        /// The hit attributes that it sees, where it declares them.
        attributes: Vec<u32>,
    },
    /// A shader ended.
    Leave {
        /// Which.
        shader: Shader,
        /// Its stage.
        stage: Stage,
        /// How.
        exit: Exit,
        /// The payload that it leaves.
        payload: Vec<u32>,
    },
    /// `OpReportIntersectionKHR` was answered.
    Report {
        /// The hit distance.
        t: f32,
        /// The hit kind.
        hit_kind: HitKind,
        /// The answer.
        accepted: bool,
    },
    /// A ray query of the shader that runs did something.
    RayQuery(RayQueryEvent),
    /// A trace is over, but for its closest-hit or miss shader.
    Traversed {
        /// The closest hit.
        committed: Option<Committed>,
        /// The index of the hit or miss record.
        record: u64,
        /// The shader that runs; `None` for a null record, where the ray skips closest-hit, and where
        /// a hit object keeps what was found.
        shader: Option<Shader>,
        /// Whether a hit object keeps what was found: no shader runs.
        kept: bool,
    },
    /// A trace is over with all its shaders.
    Traced {
        /// The payload as the caller finds it.
        payload: Vec<u32>,
    },
}

/// Passes what traversal tells on to a witness.
pub(super) struct Traversal<'a, T>(pub &'a mut T);

impl<T: Witness> Visit for Traversal<'_, T> {
    const REASONS: bool = T::ACTIVE;
    const QUIET: bool = !T::ACTIVE;

    fn node(&mut self, instance: Option<u32>) {
        if T::ACTIVE {
            self.0.event(Event::Node(instance));
        }
    }

    fn instance(&mut self, instance: u32, verdict: InstanceVerdict) {
        if T::ACTIVE {
            self.0.event(Event::Instance(instance, verdict));
        }
    }

    fn primitive(&mut self, place: Place, verdict: PrimitiveVerdict) {
        if T::ACTIVE {
            self.0.event(Event::Primitive(place, verdict));
        }
    }

    fn commit(&mut self, committed: &Committed) {
        if T::ACTIVE {
            self.0.event(Event::Opaque(*committed));
        }
    }
}
