//! A trace in progress: the rays of a batch's lanes, from their operands to closest-hit or miss.
//!
//! A shader that a lane's ray calls runs in the same lane of another batch, so that operands,
//! payloads and builtins are copied as whole registers of lanes.

mod operands;
mod resolve;
mod traverse;

use std::sync::Arc;

use smallvec::SmallVec;

use crate::accel::{Candidate, Committed, Cursor, LookAhead, RecordIndex, Tlas};
use crate::machine::invocation::{LaneTlases, RayLanes};
use crate::machine::stop::RegSpan;
use crate::machine::{HitRecordTerms, Lanes, Mask, OpenChoices, Registers, ShaderIndex, TrapCode};
use crate::math::array;
use crate::pipeline::Pipeline;
use crate::pipeline::group::{Group, HitGroup, Role};
use crate::pipeline::observer::{Caller, EventReceiver};
use crate::pipeline::opaque_batch::OpaqueBatch;
use crate::pipeline::sbt::SbtRecord;
use crate::pipeline::stats::Stats;

/// The words of a payload, of callable data or of hit attributes, in one lane.
pub(super) type Words = SmallVec<[u32; 16]>;

/// A shader call that is still to run, and the lanes that wait for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct PendingCall<const W: usize> {
    pub shader: ShaderIndex,
    pub role: Role,
    pub lanes: Mask<W>,
}

/// Why the caller of a ray traps when the trace ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct RayTrap {
    /// The lane of the ray.
    lane: usize,
    pub code: TrapCode,
    /// The index of the record that is missing or has no shader, or of the shader whose payload
    /// does not match.
    pub fault_value: Option<u64>,
    /// What the index of a hit record is made of, where a trace makes it.
    pub terms: Option<HitRecordTerms>,
}

/// The rays of one `OpTraceRayKHR`, each in the lane that traces it. Its memory is reused for later
/// traces.
#[derive(Clone, Debug)]
pub(super) struct Trace<const W: usize> {
    /// The lanes that trace.
    lanes: Mask<W>,
    /// Rays, flags, cull masks.
    pub rays: RayLanes<W>,
    pub sbt_offset: Lanes<W>,
    pub sbt_stride: Lanes<W>,
    pub miss_index: Lanes<W>,
    pub structures: LaneTlases<W>,
    launch_id: [Lanes<W>; 3],
    launch_size: [u32; 3],
    /// The recursion depth: 1 for a trace by ray generation.
    pub depth: u32,
    /// The payload of a ray from the host.
    pub host_payload: Option<Registers<W>>,
    /// By lane, the resumable traversal of a ray that may call shaders; unused in other lanes.
    cursors: Vec<Option<Cursor>>,
    /// The closest hits of rays whose traversal is over.
    pub committed: [Option<Committed>; W],
    /// By lane, the attributes of a hit that was reported or that a hit object holds.
    attributes: Vec<Words>,
    /// By lane, the index of the shader record that is called, or that is missing.
    pub(super) record_indices: [RecordIndex; W],
    /// Whether hits, records and attributes come from hit objects, so that nothing is traversed.
    pub from_hit_objects: bool,
    /// Why callers trap when the trace ends: a shader that their ray called trapped, or could not
    /// be called.
    traps: SmallVec<[RayTrap; 0]>,
    /// The lanes in `traps`.
    trapped_lanes: Mask<W>,
    opaque: OpaqueBatch,
    look_ahead: LookAhead,
    pending: SmallVec<[PendingCall<W>; 2]>,
    /// The lanes whose traversal is in progress.
    traversing: Mask<W>,
    started: bool,
    finished: bool,
    /// The instruction that traces; `None` for a ray from the host.
    caller: Option<Caller>,
    /// A fingerprint of the scalars in the caller's payload.
    payload_scalars: Option<u64>,
    /// Whether closest-hit and miss shaders run at the end; `OpHitObjectTraceRayEXT` runs neither.
    invokes_hit_or_miss: bool,
    /// Whether an observer sees shaders run.
    pub observed: bool,
    /// Ray flags of the pipeline, added to those of every ray; shaders do not see them.
    pub pipeline_flags: u32,
    /// Counts of the work of these rays, and of elided work.
    pub stats: Stats,
}

impl<const W: usize> Default for Trace<W> {
    fn default() -> Self {
        let zero = Lanes([0; W]);
        Self {
            lanes: Mask::NONE,
            rays: RayLanes::ZERO,
            sbt_offset: zero,
            sbt_stride: zero,
            miss_index: zero,
            structures: LaneTlases::default(),
            launch_id: [zero; 3],
            launch_size: [0; 3],
            depth: 0,
            host_payload: None,
            cursors: Vec::new(),
            committed: [None; W],
            attributes: Vec::new(),
            record_indices: [RecordIndex(0); W],
            from_hit_objects: false,
            traps: SmallVec::new(),
            trapped_lanes: Mask::NONE,
            opaque: OpaqueBatch::default(),
            look_ahead: LookAhead::default(),
            pending: SmallVec::new(),
            traversing: Mask::NONE,
            started: false,
            finished: false,
            caller: None,
            payload_scalars: None,
            invokes_hit_or_miss: false,
            observed: false,
            pipeline_flags: 0,
            stats: Stats::default(),
        }
    }
}

impl<const W: usize> Trace<W> {
    /// The lanes that trace.
    pub(super) fn lanes(&self) -> Mask<W> {
        self.lanes
    }

    /// The acceleration structure that a lane's ray traverses.
    pub(super) fn tlas(&self, lane: usize) -> &Arc<Tlas> {
        self.structures.get(lane).expect("bug in anyhit: a ray without a structure")
    }

    /// The instruction that traces.
    pub(super) fn caller(&self) -> Option<Caller> {
        self.caller
    }

    /// `LaunchIdKHR` of a lane.
    pub(super) fn launch_id(&self, lane: usize) -> [u32; 3] {
        array::map(self.launch_id.each_ref(), |register| register.0[lane])
    }

    /// The traversal of a lane's ray that may call shaders.
    #[inline]
    pub(super) fn cursor(&self, lane: usize) -> &Cursor {
        let cursor = self.cursors.get(lane).and_then(Option::as_ref);
        cursor.expect("bug in anyhit: a lane without a ray called a shader")
    }

    /// The traversal of a lane's ray that may call shaders.
    #[inline]
    pub(super) fn cursor_mut(&mut self, lane: usize) -> &mut Cursor {
        let cursor = self.cursors.get_mut(lane).and_then(Option::as_mut);
        cursor.expect("bug in anyhit: a lane without a ray called a shader")
    }

    /// The trap of a lane that traps when the trace is over.
    pub(super) fn ray_trap(&self, lane: usize) -> Option<RayTrap> {
        self.traps.iter().find(|trap| trap.lane == lane).copied()
    }

    /// The lanes that trap when the trace is over.
    pub(super) fn trapped_lanes(&self) -> Mask<W> {
        self.trapped_lanes
    }

    /// Ends the ray of a lane, so that its caller traps.
    fn trap(&mut self, lane: usize, code: TrapCode) {
        self.add_trap(RayTrap { lane, code, fault_value: None, terms: None });
    }

    /// As [`Trace::trap`], about the record of the lane, which is that of a candidate unless a miss
    /// or a hit object chose it.
    fn trap_at_record(&mut self, lane: usize, code: TrapCode, candidate: Option<&Candidate>) {
        let candidate = candidate.filter(|_| !self.from_hit_objects);
        let terms = candidate.map(|candidate| self.hit_record_terms(lane, candidate));
        self.add_trap(RayTrap { lane, code, fault_value: Some(self.record_indices[lane].0), terms });
    }

    fn add_trap(&mut self, trap: RayTrap) {
        let lane = trap.lane;
        self.traps.retain(|known| known.lane != lane);
        self.traps.push(trap);
        self.trapped_lanes = self.trapped_lanes | Mask::lane(lane);
        self.traversing = self.traversing.without(Mask::lane(lane));
    }

    /// Advances until a shader must run; `None` when every ray is done. `payload` holds the
    /// registers of the rays' payload.
    pub(super) fn advance(
        &mut self,
        pipeline: &Pipeline,
        choices: Option<&OpenChoices>,
        payload: Option<(&mut Registers<W>, RegSpan)>,
        observer: &mut EventReceiver<'_>,
    ) -> Option<PendingCall<W>> {
        loop {
            if let Some(call) = self.pending.pop() {
                return Some(call);
            }
            if self.finished {
                return None;
            }
            if !std::mem::replace(&mut self.started, true) {
                self.begin_traversal(observer.is_some(), choices);
            }
            self.traverse(pipeline, observer);
            if self.pending.is_empty() {
                self.finished = true;
                self.begin_hit_or_miss(pipeline, payload, observer);
                self.pending.reverse();
                return self.pending.pop();
            }
            // The list is popped from its end: this keeps the order of lanes.
            self.pending.reverse();
        }
    }

    /// Adds lanes to the pending call of a shader in a role.
    fn enqueue_call(&mut self, shader: ShaderIndex, role: Role, lanes: Mask<W>) {
        match self.pending.iter_mut().find(|group| group.shader == shader && group.role == role) {
            Some(group) => group.lanes = group.lanes | lanes,
            None if lanes.is_empty() => {}
            None => self.pending.push(PendingCall { shader, role, lanes }),
        }
    }
}

/// The record at an index of the hit table, with its hit group.
pub(super) fn hit_group_at(pipeline: &Pipeline, index: RecordIndex) -> (Option<&SbtRecord>, HitGroup) {
    let record = record_at(&pipeline.sbt.hit, index);
    let group = match record.map(|record| pipeline.group_of(record)) {
        Some(Group::Hit(group)) => group,
        _ => HitGroup::default(),
    };
    (record, group)
}

/// The record of a table at an index; `None` for a null handle and beyond the end.
pub(super) fn record_at(table: &[Option<SbtRecord>], index: RecordIndex) -> Option<&SbtRecord> {
    index.get(table).and_then(Option::as_ref)
}

/// The shader of a record's general group; `None` for a hit group.
pub(super) fn general_shader(pipeline: &Pipeline, record: &SbtRecord) -> Option<ShaderIndex> {
    match pipeline.group_of(record) {
        Group::General(shader) => Some(shader),
        Group::Hit(_) => None,
    }
}
