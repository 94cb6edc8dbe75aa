//! Observers of a pipeline: the events of traces and shaders, and who receives them.

use std::sync::Arc;

use crate::accel::hit::HitPrimitive;
use crate::accel::observer::{InstanceVerdict, PrimitiveVerdict};
use crate::accel::{
    Candidate, Committed, HitKind, RecordIndex, TestCounts, Tlas, TraceRay, TraversalObserver,
};
use crate::machine::{Buffer, Exit, OpIndex, RayQueryEvent, Reg, ShaderIndex};
use crate::module::interface::Stage;
use crate::ops::builtin::Builtin;

/// Receives the events of a pipeline, as a trait object: the pipeline is compiled once, for any
/// observer and for none.
pub trait PipelineObserver {
    /// Whether ray queries emit events, too.
    fn observes_queries(&self) -> bool {
        true
    }

    /// Whether traversal reports every node, instance and primitive that it tests, and why a
    /// primitive is not hit: that takes twice the time of the traversal.
    fn observes_traversal(&self) -> bool {
        true
    }

    /// Whether [`tests`](Self::tests) is called with the numbers of nodes and primitives that a
    /// traversal tests, in place of all events of traces and traversals.
    fn counts_tests(&self) -> bool {
        false
    }

    /// Whether events hold payloads, builtins, hit attributes and push constants, which are empty
    /// otherwise.
    fn observes_values(&self) -> bool {
        true
    }

    /// Whether ray queries report every node, instance and primitive that they test.
    fn observes_query_traversal(&self) -> bool {
        false
    }

    /// Announces that the following events belong to the invocation with this launch index.
    fn invocation(&mut self, _launch_id: [u32; 3]) {}

    /// Receives an event.
    fn event(&mut self, event: Event);

    /// Receives the numbers of nodes and primitives that a traversal of the last announced
    /// invocation has tested, up to a candidate or to its end.
    fn tests(&mut self, _counts: TestCounts) {}

    /// Announces that the last announced invocation selects a null shader, so that none runs. The
    /// observer may write the words that a shader would have left in the payload or callable data
    /// of `caller`; it returns whether it has.
    fn null_shader(&mut self, _caller: Caller, _words: &mut [u32]) -> bool {
        false
    }
}

/// The observer that a pipeline tells its events to, if there is one.
pub(super) type EventReceiver<'a> = Option<&'a mut dyn PipelineObserver>;

/// Collects all events, those of ray queries included.
impl PipelineObserver for Vec<Event> {
    fn observes_query_traversal(&self) -> bool {
        true
    }

    fn event(&mut self, event: Event) {
        self.push(event);
    }
}

/// Passes on the events of one invocation only, but those of its ray queries.
pub(super) struct OnlyInvocation<'a> {
    pub pipeline_observer: &'a mut dyn PipelineObserver,
    pub launch_id: [u32; 3],
    is_selected: bool,
}

impl<'a> OnlyInvocation<'a> {
    pub(super) fn new(launch_id: [u32; 3], pipeline_observer: &'a mut dyn PipelineObserver) -> Self {
        Self { pipeline_observer, launch_id, is_selected: true }
    }
}

impl PipelineObserver for OnlyInvocation<'_> {
    fn observes_queries(&self) -> bool {
        false
    }

    fn observes_traversal(&self) -> bool {
        self.pipeline_observer.observes_traversal()
    }

    fn invocation(&mut self, launch_id: [u32; 3]) {
        self.is_selected = launch_id == self.launch_id;
    }

    fn event(&mut self, event: Event) {
        if self.is_selected {
            self.pipeline_observer.event(event);
        }
    }

    fn null_shader(&mut self, caller: Caller, words: &mut [u32]) -> bool {
        self.pipeline_observer.null_shader(caller, words)
    }
}

/// An instruction that traces a ray or calls a shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Caller {
    /// The shader that holds the instruction.
    pub shader: ShaderIndex,
    /// The instruction.
    pub op: OpIndex,
    /// The first register of the payload variable, or of the callable data.
    pub payload: Reg,
}

/// Passes events to a closure. Ray queries emit events of instructions and commits, not of
/// traversal.
impl<F: FnMut(Event)> PipelineObserver for F {
    fn event(&mut self, event: Event) {
        self(event);
    }
}

/// An event of a pipeline. Words are 32-bit words in the order of a value's scalars.
///
/// The events of one lane nest: the events of a shader are between `Enter` and its `Leave`, those
/// of a ray and its shaders between `Trace` and its `Traced`.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Event {
    /// A trace begins.
    Trace {
        /// The instruction that traces; `None` for a ray from the host.
        caller: Option<Caller>,
        /// The acceleration structure.
        tlas: Arc<Tlas>,
        /// `LaunchIdKHR` of the ray.
        launch_id: [u32; 3],
        /// The recursion depth: 1 for a trace by ray generation.
        depth: u32,
        /// The ray, its flags and its cull mask.
        trace: TraceRay,
        /// The operands SBT offset, SBT stride and miss index.
        sbt: [u32; 3],
        /// The payload before the trace.
        payload: Vec<u32>,
    },
    /// Traversal opened a node of an instance's BVH, or of the TLAS (`None`).
    Node(Option<u32>),
    /// Traversal reached an instance.
    Instance(u32, InstanceVerdict),
    /// Traversal tested a primitive.
    Primitive(HitPrimitive, PrimitiveVerdict),
    /// Traversal found a candidate that a shader decides on. Without a shader (`None`) a triangle,
    /// sphere or linear swept sphere is accepted, and a box is dropped.
    Candidate {
        /// `LaunchIdKHR` of the ray.
        launch_id: [u32; 3],
        /// The candidate.
        candidate: Candidate,
        /// The hit record's index.
        record: RecordIndex,
        /// The terms of `record`: instance offset, geometry index, SBT stride and SBT offset.
        arithmetic: [u32; 4],
        /// The any-hit or intersection shader that decides.
        shader: Option<ShaderIndex>,
    },
    /// An opaque hit was committed without a shader.
    Opaque(Committed),
    /// A shader begins.
    Enter {
        /// The shader that begins.
        shader: ShaderIndex,
        /// The shader's stage.
        stage: Stage,
        /// The builtins that the shader reads, with their words.
        builtins: Vec<(&'static Builtin, Vec<u32>)>,
        /// The payload before the shader runs, if it declares one.
        payload: Vec<u32>,
        /// The hit attributes before the shader runs, if it declares them.
        attributes: Vec<u32>,
        /// The push constants.
        push_constants: Option<Arc<Buffer>>,
    },
    /// A shader ended.
    Leave {
        /// The shader that ended.
        shader: ShaderIndex,
        /// The shader's stage.
        stage: Stage,
        /// How the shader ended.
        exit: Exit,
        /// The payload after the shader ran.
        payload: Vec<u32>,
    },
    /// `OpReportIntersectionKHR` returned.
    Report {
        /// The hit distance.
        t: f32,
        /// The hit kind.
        hit_kind: HitKind,
        /// Whether the hit was accepted.
        accepted: bool,
    },
    /// A ray query of the running shader changed its state, or tested an instance or primitive.
    RayQuery(RayQueryEvent),
    /// Traversal is over; the closest-hit or miss shader has not run yet.
    Traversed {
        /// `LaunchIdKHR` of the ray.
        launch_id: [u32; 3],
        /// The closest hit.
        committed: Option<Committed>,
        /// The index of the hit or miss record.
        record: RecordIndex,
        /// The shader that runs; `None` for a null shader, if the ray's flags skip closest-hit, and
        /// if a hit object records the result.
        shader: Option<ShaderIndex>,
        /// Whether a hit object records the result, so that no shader runs.
        to_hit_object: bool,
    },
    /// A trace and all its shaders have ended.
    Traced {
        /// The payload after the trace.
        payload: Vec<u32>,
    },
}

/// Passes the events of a traversal on as events of the pipeline.
pub(super) struct TraversalAdapter<'a> {
    observer: &'a mut dyn PipelineObserver,
    /// Whether the observer wants to know what is tested, not only what is hit.
    observes_tests: bool,
}

impl<'a> TraversalAdapter<'a> {
    pub(super) fn new(observer: &'a mut dyn PipelineObserver) -> Self {
        let observes_tests = observer.observes_traversal();
        Self { observer, observes_tests }
    }
}

impl TraversalObserver for TraversalAdapter<'_> {
    fn explains_misses(&self) -> bool {
        self.observes_tests
    }

    fn node(&mut self, instance: Option<u32>) {
        if self.observes_tests {
            self.observer.event(Event::Node(instance));
        }
    }

    fn instance(&mut self, instance: u32, verdict: InstanceVerdict) {
        if self.observes_tests {
            self.observer.event(Event::Instance(instance, verdict));
        }
    }

    fn primitive(&mut self, hit_primitive: HitPrimitive, verdict: PrimitiveVerdict) {
        if self.observes_tests {
            self.observer.event(Event::Primitive(hit_primitive, verdict));
        }
    }

    fn commit(&mut self, committed: &Committed) {
        self.observer.event(Event::Opaque(*committed));
    }
}
