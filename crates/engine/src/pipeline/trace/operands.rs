//! The beginning of a trace: the operands of its rays, who traces them, and hit objects that stand
//! for a traversal.

use std::sync::Arc;

use crate::accel::{RecordIndex, Tlas, TraceRay};
use crate::machine::hit_object::EncodedHit;
use crate::machine::invocation::Invocations;
use crate::machine::{Lanes, Mask, ShaderIndex, TrapCode};
use crate::pipeline::observer::Caller;
use crate::pipeline::stats::Stats;
use crate::pipeline::trace::{RayTrap, Trace, Words};
use crate::pipeline::{Pipeline, payload};

impl<const W: usize> Trace<W> {
    /// Resets the trace for the rays of another instruction. `invokes_hit_or_miss` says whether
    /// closest-hit and miss shaders run at the end.
    pub(crate) fn reset(&mut self, invokes_hit_or_miss: bool) {
        self.invokes_hit_or_miss = invokes_hit_or_miss;
        self.lanes = Mask::NONE;
        self.traversing = Mask::NONE;
        self.structures.clear_several();
        self.host_payload = None;
        self.from_hit_objects = false;
        self.traps.clear();
        self.trapped_lanes = Mask::NONE;
        self.pending.clear();
        (self.started, self.finished) = (false, false);
        (self.caller, self.payload_scalars) = (None, None);
        self.stats = Stats::default();
    }

    /// Sets the instruction that traces, and copies the launch indices of its invocations.
    pub(crate) fn set_caller(
        &mut self,
        caller: Caller,
        payload_scalars: Option<u64>,
        invocations: &Invocations<W>,
    ) {
        (self.caller, self.payload_scalars) = (Some(caller), payload_scalars);
        (self.launch_id, self.launch_size) = (invocations.launch_id, invocations.launch_size);
        self.depth = invocations.depth + 1;
    }

    /// Whether the payload of the rays matches the one that a shader declares.
    pub(crate) fn payload_matches(&self, pipeline: &Pipeline, shader: ShaderIndex) -> bool {
        payload::accepts(&pipeline.programs[shader.index()], self.payload_scalars)
    }

    /// Traps a lane whose payload does not match the one that the called shader declares.
    pub(super) fn trap_payload_mismatch(&mut self, lane: usize, shader: ShaderIndex) {
        let fault_value = Some(shader.0.into());
        self.add_trap(RayTrap { lane, code: TrapCode::PayloadMismatch, fault_value, terms: None });
    }

    /// Sets the launch index of a ray from the host: 0, in a launch of one invocation.
    pub(crate) fn set_host_caller(&mut self) {
        (self.launch_id, self.launch_size, self.depth) = ([Lanes::splat(0); 3], [1; 3], 1);
    }

    /// Begins the rays of some lanes. Their operands must be set.
    pub(crate) fn begin(&mut self, lanes: Mask<W>) {
        self.lanes = lanes;
        self.traversing = if self.from_hit_objects { Mask::NONE } else { lanes };
    }

    /// Sets a lane's ray and its result from a hit object.
    pub(crate) fn add_hit_object(
        &mut self,
        lane: usize,
        tlas: &Arc<Tlas>,
        trace: &TraceRay,
        record: RecordIndex,
        hit: Option<&EncodedHit>,
    ) {
        self.structures.set(Mask::lane(lane), tlas);
        self.rays.set(lane, trace);
        self.record_indices[lane] = record;
        self.committed[lane] = hit.map(|hit| hit.committed);
        let attributes = hit.map_or_else(Words::new, |hit| hit.attributes.iter().copied().collect());
        self.commit_attributes(lane, attributes);
    }
}
