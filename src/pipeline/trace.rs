//! A trace in progress: the rays of a batch's lanes, from their operands to closest-hit or miss.
//!
//! A shader that a lane's ray calls runs in the same lane of another batch, so that operands,
//! payloads and builtins are copied as whole registers of lanes.

mod ending;

use std::sync::Arc;

use smallvec::SmallVec;

use crate::accel::{Candidate, Committed, Cursor, HitKind, RayFlags, Tlas, TraceRay, hit_record_index};
use crate::machine::hit_object::EncodedHit;
use crate::machine::invocation::{Invocations, LaneTlases, RayLanes};
use crate::machine::stop::RegSpan;
use crate::machine::{Batch, Exit, Lanes, Mask, Registers, TrapCode};
use crate::module::interface::Stage;
use crate::pipeline::group::{Group, HitGroup, Role, Shader};
use crate::pipeline::observer::{Caller, Event, PipelineObserver, TraversalAdapter};
use crate::pipeline::opaque_batch::OpaqueBatch;
use crate::pipeline::sbt::{Record, is_beyond_end};
use crate::pipeline::stats::Stats;
use crate::pipeline::{Pipeline, payload};

/// The words of a payload, of callable data or of hit attributes, in one lane.
pub(super) type Words = SmallVec<[u32; 16]>;

/// A shader call that is still to run, and the lanes that wait for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct PendingCall<const W: usize> {
    pub shader: Shader,
    pub role: Role,
    pub lanes: Mask<W>,
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
    /// By lane, the index of the shader record that is called. In a lane that traps it is the index
    /// of the missing record, or of the shader whose payload does not match.
    pub(super) record_indices: [u64; W],
    /// Whether hits, records and attributes come from hit objects, so that nothing is traversed.
    pub from_hit_objects: bool,
    /// Lanes whose caller traps when the trace ends, with the code: a shader that their ray called
    /// trapped, or could not be called.
    trap_codes: SmallVec<[(usize, TrapCode); 0]>,
    /// The lanes in `trap_codes`.
    trapped_lanes: Mask<W>,
    opaque: OpaqueBatch,
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
            record_indices: [0; W],
            from_hit_objects: false,
            trap_codes: SmallVec::new(),
            trapped_lanes: Mask::NONE,
            opaque: OpaqueBatch::default(),
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
    /// Resets the trace for the rays of another instruction. `invokes_hit_or_miss` says whether
    /// closest-hit and miss shaders run at the end.
    pub fn reset(&mut self, invokes_hit_or_miss: bool) {
        self.invokes_hit_or_miss = invokes_hit_or_miss;
        self.lanes = Mask::NONE;
        self.traversing = Mask::NONE;
        self.structures.clear();
        self.host_payload = None;
        self.from_hit_objects = false;
        self.trap_codes.clear();
        self.trapped_lanes = Mask::NONE;
        self.pending.clear();
        (self.started, self.finished) = (false, false);
        (self.caller, self.payload_scalars) = (None, None);
        self.stats = Stats::default();
    }

    /// Sets the instruction that traces, and copies the launch indices of its invocations.
    pub fn set_caller(&mut self, caller: Caller, payload_scalars: Option<u64>, invocations: &Invocations<W>) {
        (self.caller, self.payload_scalars) = (Some(caller), payload_scalars);
        (self.launch_id, self.launch_size) = (invocations.launch_id, invocations.launch_size);
        self.depth = invocations.depth + 1;
    }

    /// Whether the payload of the rays matches the one that a shader declares.
    pub fn payload_matches(&self, pipeline: &Pipeline, shader: Shader) -> bool {
        payload::accepts(&pipeline.programs[shader.0 as usize], self.payload_scalars)
    }

    /// Traps a lane whose payload does not match the one that the called shader declares.
    fn trap_payload_mismatch(&mut self, lane: usize, shader: Shader) {
        self.record_indices[lane] = shader.0.into();
        self.trap(lane, TrapCode::PayloadMismatch);
    }

    /// Sets the launch index of a ray from the host: 0, in a launch of one invocation.
    pub fn set_host_caller(&mut self) {
        (self.launch_id, self.launch_size, self.depth) = ([Lanes::splat(0); 3], [1; 3], 1);
    }

    /// Begins the rays of some lanes. Their operands must be set.
    pub fn begin(&mut self, lanes: Mask<W>) {
        self.lanes = lanes;
        self.traversing = if self.from_hit_objects { Mask::NONE } else { lanes };
    }

    /// Sets a lane's ray and its result from a hit object.
    pub fn add_hit_object(
        &mut self,
        lane: usize,
        (tlas, trace): (&Arc<Tlas>, &TraceRay),
        record: u64,
        hit: Option<&EncodedHit>,
    ) {
        self.structures.set(Mask::lane(lane), tlas);
        self.rays.set(lane, trace);
        self.record_indices[lane] = record;
        self.committed[lane] = hit.map(|hit| hit.committed);
        let attributes = hit.map_or_else(Words::new, |hit| hit.attributes.iter().copied().collect());
        self.commit_attributes(lane, attributes);
    }

    /// The lanes that trace.
    pub fn lanes(&self) -> Mask<W> {
        self.lanes
    }

    /// The acceleration structure that a lane's ray traverses.
    pub fn tlas(&self, lane: usize) -> &Arc<Tlas> {
        self.structures.get(lane).expect("bug in anyhit: a ray without a structure")
    }

    /// The instruction that traces.
    pub fn caller(&self) -> Option<Caller> {
        self.caller
    }

    /// `LaunchIdKHR` of a lane.
    pub fn launch_id(&self, lane: usize) -> [u32; 3] {
        self.launch_id.each_ref().map(|register| register.0[lane])
    }

    /// The traversal of a lane's ray that may call shaders.
    pub fn cursor(&self, lane: usize) -> &Cursor {
        let cursor = self.cursors.get(lane).and_then(Option::as_ref);
        cursor.expect("bug in anyhit: a lane without a ray called a shader")
    }

    /// The traversal of a lane's ray that may call shaders.
    pub fn cursor_mut(&mut self, lane: usize) -> &mut Cursor {
        let cursor = self.cursors.get_mut(lane).and_then(Option::as_mut);
        cursor.expect("bug in anyhit: a lane without a ray called a shader")
    }

    /// The trap code of a lane that traps when the trace is over.
    pub fn trap_code(&self, lane: usize) -> Option<TrapCode> {
        self.trap_codes.iter().find(|(trapped, _)| *trapped == lane).map(|&(_, code)| code)
    }

    /// The lanes that trap when the trace is over.
    pub fn trapped_lanes(&self) -> Mask<W> {
        self.trapped_lanes
    }

    /// Ends the ray of a lane, so that its caller traps.
    fn trap(&mut self, lane: usize, code: TrapCode) {
        self.trap_codes.retain(|&mut (trapped, _)| trapped != lane);
        self.trap_codes.push((lane, code));
        self.trapped_lanes = self.trapped_lanes | Mask::lane(lane);
        self.traversing = self.traversing.without(Mask::lane(lane));
    }

    /// Advances until a shader must run; `None` when every ray is done. `payload` holds the
    /// registers of the rays' payload.
    pub fn advance<T: PipelineObserver>(
        &mut self,
        pipeline: &Pipeline,
        payload: Option<(&mut Registers<W>, RegSpan)>,
        observer: &mut T,
    ) -> Option<PendingCall<W>> {
        loop {
            if let Some(call) = self.pending.pop() {
                return Some(call);
            }
            if self.finished {
                return None;
            }
            if !std::mem::replace(&mut self.started, true) {
                self.begin_traversal::<T>();
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

    /// Traces all rays that can hit only opaque geometry, and gives the others a resumable
    /// traversal.
    fn begin_traversal<T: PipelineObserver>(&mut self) {
        if !T::ACTIVE {
            for number in 0..self.structures.all().len() {
                self.trace_opaque(number);
            }
        }
        for lane in self.traversing.lanes() {
            let trace = self.ray_with_pipeline_flags(lane);
            if self.cursors.len() <= lane {
                self.cursors.resize_with(lane + 1, || None);
            }
            let tlas = self.structures.get(lane).expect("bug in anyhit: a ray without a structure");
            match &mut self.cursors[lane] {
                Some(cursor) => cursor.reset(tlas, trace),
                empty => *empty = Some(Cursor::new(tlas, trace)),
            }
        }
    }

    /// A lane's ray with the flags that the pipeline adds.
    #[inline]
    fn ray_with_pipeline_flags(&self, lane: usize) -> TraceRay {
        let trace = self.rays.get(lane);
        TraceRay { flags: trace.flags | RayFlags(self.pipeline_flags), ..trace }
    }

    /// Traces the rays of one acceleration structure that can hit only opaque geometry.
    fn trace_opaque(&mut self, number: usize) {
        let in_structure = match self.structures.all().len() {
            1 => self.traversing,
            _ => self.traversing & Mask::equal(self.structures.indices(), number as u32),
        };
        // Nothing reads which hit an occlusion ray commits, unless a hit object records it.
        let occlusion = RayFlags::TERMINATE_ON_FIRST_HIT | RayFlags::SKIP_CLOSEST_HIT_SHADER;
        let hit_is_unread = self.invokes_hit_or_miss && self.caller.is_some();
        let tlas = &self.structures.all()[number];
        let mut remaining = in_structure;
        while let Some(first) = remaining.lanes().next() {
            let flags = self.ray_with_pipeline_flags(first).flags;
            let mut same_flags = Mask::NONE;
            self.opaque.rays.clear();
            for lane in remaining.lanes() {
                let ray = self.ray_with_pipeline_flags(lane);
                if ray.flags == flags {
                    self.opaque.rays.push(ray);
                    same_flags = same_flags | Mask::lane(lane);
                }
            }
            remaining = remaining.without(same_flags);
            if !tlas.is_fully_opaque(flags) {
                continue;
            }
            let occlusion_only = hit_is_unread && flags.contains(occlusion);
            if occlusion_only {
                self.stats.elided.occlusion += self.opaque.rays.len() as u64;
            }
            self.opaque.trace(tlas, occlusion_only);
            for (lane, hit) in same_flags.lanes().zip(&self.opaque.hits) {
                self.committed[lane] = *hit;
            }
            self.traversing = self.traversing.without(same_flags);
        }
    }

    /// Advances each ray to the next candidate that needs a shader's decision.
    fn traverse<T: PipelineObserver>(&mut self, pipeline: &Pipeline, observer: &mut T) {
        for lane in self.traversing.lanes() {
            observer.invocation(self.launch_id(lane));
            loop {
                let tlas = self.structures.get(lane).expect("bug in anyhit: a ray without a structure");
                let cursor = self.cursors[lane].as_mut().expect("bug in anyhit: a ray without a traversal");
                let Some(candidate) = cursor.proceed_with(tlas, &mut TraversalAdapter(observer)) else {
                    self.committed[lane] = cursor.committed().copied();
                    self.traversing = self.traversing.without(Mask::lane(lane));
                    break;
                };
                let index = self.hit_record_index(lane, &candidate);
                let (_, group) = hit_group_at(pipeline, index);
                let shader = if candidate.is_box() { group.intersection } else { group.any_hit };
                if T::ACTIVE {
                    let instance = &self.tlas(lane).instances()[candidate.instance as usize];
                    let arithmetic = [
                        instance.sbt_record_offset,
                        candidate.geometry,
                        self.sbt_stride.0[lane] & 0xF,
                        self.sbt_offset.0[lane] & 0xF,
                    ];
                    observer.event(Event::Candidate { candidate, record: index, arithmetic, shader });
                }
                if let Some(shader) = shader.filter(|shader| !self.payload_matches(pipeline, *shader)) {
                    self.trap_payload_mismatch(lane, shader);
                    self.cursor_mut(lane).terminate();
                    continue;
                }
                // Under an observer every shader runs.
                if !T::ACTIVE && shader.is_some_and(|shader| pipeline.is_empty(shader)) {
                    // An empty intersection shader reports no hit, an empty any-hit shader accepts.
                    self.stats.elide(if candidate.is_box() { Stage::Intersection } else { Stage::AnyHit }, 1);
                    self.cursor_mut(lane).confirm();
                    continue;
                }
                match shader {
                    _ if is_beyond_end(&pipeline.sbt.hit, index) => {
                        self.record_indices[lane] = index;
                        self.trap_and_terminate(lane, TrapCode::HitRecordMissing);
                    }
                    Some(shader) => {
                        let role = if candidate.is_box() { Role::Intersection } else { Role::AnyHit };
                        self.record_indices[lane] = index;
                        self.enqueue_call(shader, role, Mask::lane(lane));
                        break;
                    }
                    None if candidate.is_box() => {
                        if pipeline.flags.no_null_intersection_shaders {
                            self.trap_and_terminate(lane, TrapCode::NullIntersection);
                        }
                    }
                    None if pipeline.flags.no_null_any_hit_shaders => {
                        self.trap_and_terminate(lane, TrapCode::NullAnyHit);
                    }
                    None => {
                        self.cursor_mut(lane).confirm();
                    }
                }
            }
        }
    }

    /// Ends a ray during its traversal, so that its caller traps.
    fn trap_and_terminate(&mut self, lane: usize, code: TrapCode) {
        self.trap(lane, code);
        self.cursor_mut(lane).terminate();
    }

    /// Adds lanes to the pending call of a shader in a role.
    fn enqueue_call(&mut self, shader: Shader, role: Role, lanes: Mask<W>) {
        match self.pending.iter_mut().find(|group| group.shader == shader && group.role == role) {
            Some(group) => group.lanes = group.lanes | lanes,
            None if lanes.is_empty() => {}
            None => self.pending.push(PendingCall { shader, role, lanes }),
        }
    }

    /// The index of the record of a lane's miss shader.
    pub fn miss_record_index(&self, lane: usize) -> u64 {
        u64::from(self.miss_index.0[lane] & 0xFFFF)
    }

    /// The index of the hit record of a lane's candidate.
    pub fn hit_record_index(&self, lane: usize, candidate: &Candidate) -> u64 {
        let instance = candidate.instance_in(self.tlas(lane));
        let (stride, offset) = (self.sbt_stride.0[lane], self.sbt_offset.0[lane]);
        hit_record_index(instance.sbt_record_offset, candidate.geometry, stride, offset)
    }

    /// Applies the exits of a shader that the lanes' rays called.
    pub fn apply_exits(&mut self, role: Role, lanes: Mask<W>, batch: &Batch<W>) {
        for lane in lanes.lanes() {
            let exit = batch.exits[lane];
            if let Exit::Trapped(_) = exit {
                self.trap(lane, TrapCode::Callee);
                continue;
            }
            if role != Role::AnyHit {
                continue;
            }
            let cursor = self.cursor_mut(lane);
            if exit != Exit::Ignored {
                cursor.confirm();
            }
            if exit == Exit::Terminated {
                cursor.terminate();
            }
        }
    }

    /// Stores the attributes of a lane's committed hit.
    pub fn commit_attributes(&mut self, lane: usize, attributes: Words) {
        if self.attributes.len() <= lane {
            self.attributes.resize_with(lane + 1, Words::new);
        }
        self.attributes[lane] = attributes;
    }

    /// A lane's hit of a built-in primitive (no box), whose attributes traversal computes.
    #[inline]
    fn built_in_candidate(&self, lane: usize) -> Option<&Candidate> {
        let candidate = self.committed[lane].as_ref().map(|committed| &committed.candidate);
        candidate.filter(|candidate| !self.from_hit_objects && !candidate.is_box())
    }

    /// The attributes of a lane's committed hit.
    pub fn committed_attributes(&self, lane: usize) -> Words {
        match self.built_in_candidate(lane) {
            Some(candidate) => Words::from_slice(&candidate.intersection.attributes.map(f32::to_bits)),
            None => self.attributes.get(lane).cloned().unwrap_or_default(),
        }
    }

    /// Writes the builtins of a shader that runs in a role.
    pub fn write_builtins(&self, pipeline: &Pipeline, role: Role, lanes: Mask<W>, to: &mut Invocations<W>) {
        (to.launch_id, to.launch_size, to.depth) = (self.launch_id, self.launch_size, self.depth);
        to.rays = self.rays;
        to.structures.copy(&self.structures);
        to.record_indices = self.record_indices;
        to.hit = role != Role::Miss;
        let table = if to.hit { &pipeline.sbt.hit } else { &pipeline.sbt.miss };
        let mut record = None;
        for lane in lanes.lanes() {
            let index = self.record_indices[lane];
            if record.as_ref().is_none_or(|(known, _)| *known != index) {
                record = Some((index, record_at(table, index).and_then(Record::shader_record)));
            }
            to.set_record(lane, record.as_ref().and_then(|(_, record)| record.as_ref()));
        }
        match role {
            Role::ClosestHit => {
                for lane in lanes.lanes() {
                    if let Some(Committed { candidate, t, hit_kind }) = &self.committed[lane] {
                        to.hits.set(lane, candidate.hit_primitive(), *hit_kind);
                        to.set_t_max(lane, *t);
                    }
                }
            }
            Role::AnyHit | Role::ReportedAnyHit | Role::Intersection => {
                for lane in lanes.lanes() {
                    let cursor = self.cursor(lane);
                    let Some(candidate) = cursor.candidate() else { continue };
                    let kind = candidate.hit_kind().unwrap_or(HitKind(0));
                    to.hits.set(lane, candidate.hit_primitive(), kind);
                    let t = if candidate.is_box() { cursor.t_max() } else { candidate.intersection.t };
                    to.set_t_max(lane, t);
                }
            }
            _ => to.t_max = self.rays.t_max,
        }
    }

    /// Writes the initial hit attributes of a shader that runs in a role.
    pub fn write_hit_attributes(&self, role: Role, lanes: Mask<W>, registers: &mut [Lanes<W>]) {
        for lane in lanes.lanes() {
            let candidate = match role {
                Role::AnyHit => self.cursor(lane).candidate(),
                Role::ClosestHit => self.built_in_candidate(lane),
                _ => return,
            };
            if let Some(candidate) = candidate {
                let values = candidate.intersection.attributes;
                registers
                    .iter_mut()
                    .zip(values)
                    .for_each(|(register, value)| register.0[lane] = value.to_bits());
            } else if role == Role::ClosestHit {
                let words = self.attributes.get(lane).into_iter().flatten();
                registers.iter_mut().zip(words).for_each(|(register, &word)| register.0[lane] = word);
            }
        }
    }
}

/// The record at an index of the hit table, with its hit group.
pub(super) fn hit_group_at(pipeline: &Pipeline, index: u64) -> (Option<&Record>, HitGroup) {
    let record = record_at(&pipeline.sbt.hit, index);
    let group = match record.map(|record| pipeline.groups[record.group as usize]) {
        Some(Group::Hit(group)) => group,
        _ => HitGroup::default(),
    };
    (record, group)
}

/// The record of a table at an index; `None` for a null handle and beyond the end.
pub(super) fn record_at(table: &[Option<Record>], index: u64) -> Option<&Record> {
    usize::try_from(index).ok().and_then(|at| table.get(at)).and_then(Option::as_ref)
}

/// The shader of a record's general group; `None` for a hit group.
pub(super) fn general_shader(pipeline: &Pipeline, record: &Record) -> Option<Shader> {
    match pipeline.groups[record.group as usize] {
        Group::General(shader) => Some(shader),
        Group::Hit(_) => None,
    }
}
