//! A trace in progress: the rays of a batch's lanes, from their operands to closest-hit or miss.
//!
//! A shader that a lane's ray calls runs in the same lane of another batch, so that operands,
//! payloads and builtins are copied as whole registers.

mod ending;

use std::sync::Arc;

use smallvec::SmallVec;

use crate::accel::{Candidate, Committed, Cursor, HitKind, RayFlags, Tlas, TraceRay, hit_record_index};
use crate::machine::hit_object::EncodedHit;
use crate::machine::invocation::{Invocations, LaneTlases, RayLanes};
use crate::machine::stop::RegSpan;
use crate::machine::{Batch, Exit, Lanes, Mask, Registers, TrapCode};
use crate::module::interface::Stage;
use crate::pipeline::Pipeline;
use crate::pipeline::group::{Group, HitGroup, Shader};
use crate::pipeline::launch::Stats;
use crate::pipeline::observer::{Caller, Event, PipelineObserver, Traversal};
use crate::pipeline::opaque_batch::OpaqueBatch;
use crate::pipeline::payload;
use crate::pipeline::sbt::{Record, ends_before};
use crate::pipeline::stack::Role;

/// Words of a payload or of hit attributes.
pub(super) type Data = SmallVec<[u32; 16]>;

/// Lanes that wait for a shader.
#[derive(Clone, Copy, Debug)]
pub(super) struct Waiting<const W: usize> {
    pub shader: Shader,
    pub role: Role,
    pub lanes: Mask<W>,
}

/// The rays of one `OpTraceRayKHR`, each in the lane that traces it; its memory is reused for the
/// next.
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
    /// 1 for a trace by ray generation.
    pub depth: u32,
    /// The payload of a ray from the host.
    pub host_payload: Option<Registers<W>>,
    /// The traversals of rays that may call shaders on the way, by lane; those of other lanes are
    /// unused.
    cursors: Vec<Option<Cursor>>,
    /// The closest hits of rays whose traversal is over.
    pub committed: [Option<Committed>; W],
    /// Attributes of hits that were reported or that hit objects hold, by lane.
    attributes: Vec<Data>,
    /// The indices of the shader records that are called. For a lane that traps, the index of the
    /// missing record, or of the shader whose payload does not match.
    pub(super) records: [u64; W],
    /// Whether hit objects give the records and attributes, so that nothing is traversed.
    pub settled: bool,
    /// Lanes whose caller traps: a shader that their ray called trapped, or is null where it must
    /// not be.
    trapped: SmallVec<[(usize, TrapCode); 0]>,
    /// The lanes in `trapped`.
    trapping: Mask<W>,
    opaque: OpaqueBatch,
    waiting: SmallVec<[Waiting<W>; 2]>,
    /// The lanes whose traversal is not over.
    traversing: Mask<W>,
    begun: bool,
    finished: bool,
    /// The instruction that traces.
    caller: Option<Caller>,
    /// A fingerprint of the scalars in the caller's payload.
    payload_scalars: Option<u64>,
    /// Whether closest-hit and miss shaders run at the end.
    shades: bool,
    /// Whether an observer sees shaders run.
    pub observed: bool,
    /// Ray flags that are added to every ray's own; shaders do not see them.
    pub pipeline_flags: u32,
    /// Counts of what its rays did, and of what was elided.
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
            records: [0; W],
            settled: false,
            trapped: SmallVec::new(),
            trapping: Mask::NONE,
            opaque: OpaqueBatch::default(),
            waiting: SmallVec::new(),
            traversing: Mask::NONE,
            begun: false,
            finished: false,
            caller: None,
            payload_scalars: None,
            shades: false,
            observed: false,
            pipeline_flags: 0,
            stats: Stats::default(),
        }
    }
}

impl<const W: usize> Trace<W> {
    /// Resets the trace for the rays of another instruction. `shades`: whether closest-hit and miss
    /// shaders run at the end.
    pub fn clear(&mut self, shades: bool) {
        self.shades = shades;
        self.lanes = Mask::NONE;
        self.traversing = Mask::NONE;
        self.structures.clear();
        self.host_payload = None;
        self.settled = false;
        self.trapped.clear();
        self.trapping = Mask::NONE;
        self.waiting.clear();
        (self.begun, self.finished) = (false, false);
        (self.caller, self.payload_scalars) = (None, None);
        self.stats = Stats::default();
    }

    /// Copies the launch indices of the invocations that trace.
    pub fn called_from_shader(
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
    pub fn suits(&self, pipeline: &Pipeline, shader: Shader) -> bool {
        payload::takes(&pipeline.programs[shader.0 as usize], self.payload_scalars)
    }

    /// Ends the ray of a lane whose payload does not match that of the shader it calls.
    fn end_by_mismatch(&mut self, lane: usize, shader: Shader) {
        self.records[lane] = shader.0.into();
        self.trap(lane, TrapCode::PayloadMismatch);
    }

    /// Gives a ray from the host a launch index: 0 in a launch of one invocation.
    pub fn called_from_host(&mut self) {
        (self.launch_id, self.launch_size, self.depth) = ([Lanes::splat(0); 3], [1; 3], 1);
    }

    /// Begins the rays of some lanes, whose operands are set.
    pub fn begin(&mut self, lanes: Mask<W>) {
        self.lanes = lanes;
        self.traversing = if self.settled { Mask::NONE } else { lanes };
    }

    /// Adds a ray whose result a hit object holds.
    pub fn add_settled(
        &mut self,
        lane: usize,
        (tlas, trace): (&Arc<Tlas>, &TraceRay),
        record: u64,
        hit: Option<&EncodedHit>,
    ) {
        self.structures.set(Mask::lane(lane), tlas);
        self.rays.set(lane, trace);
        self.records[lane] = record;
        self.committed[lane] = hit.map(|hit| hit.committed);
        let attributes = hit.map_or_else(Data::new, |hit| hit.attributes.iter().copied().collect());
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
    pub fn trapped(&self, lane: usize) -> Option<TrapCode> {
        self.trapped.iter().find(|(trapped, _)| *trapped == lane).map(|&(_, code)| code)
    }

    /// The lanes that trap when the trace is over.
    pub fn trapping(&self) -> Mask<W> {
        self.trapping
    }

    /// Ends the ray of a lane: its caller traps.
    fn trap(&mut self, lane: usize, code: TrapCode) {
        self.trapped.retain(|&mut (trapped, _)| trapped != lane);
        self.trapped.push((lane, code));
        self.trapping = self.trapping | Mask::lane(lane);
        self.traversing = self.traversing.without(Mask::lane(lane));
    }

    /// Advances until a shader must run; `None` when every ray is done. `payload` is that of the
    /// rays.
    pub fn advance<T: PipelineObserver>(
        &mut self,
        pipeline: &Pipeline,
        payload: Option<(&mut Registers<W>, RegSpan)>,
        observer: &mut T,
    ) -> Option<Waiting<W>> {
        loop {
            if let Some(waiting) = self.waiting.pop() {
                return Some(waiting);
            }
            if self.finished {
                return None;
            }
            if !std::mem::replace(&mut self.begun, true) {
                self.set_out::<T>();
            }
            self.traverse(pipeline, observer);
            if self.waiting.is_empty() {
                self.finished = true;
                self.finish(pipeline, payload, observer);
                self.waiting.reverse();
                return self.waiting.pop();
            }
            // The list is popped from its end: keep the order of lanes.
            self.waiting.reverse();
        }
    }

    /// Traces all rays that can hit only opaque geometry; the others get a traversal that can be
    /// resumed.
    fn set_out<T: PipelineObserver>(&mut self) {
        if !T::ACTIVE {
            for number in 0..self.structures.all().len() {
                self.trace_opaque(number);
            }
        }
        for lane in self.traversing.lanes() {
            let trace = self.traversal(lane);
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
    fn traversal(&self, lane: usize) -> TraceRay {
        let trace = self.rays.get(lane);
        TraceRay { flags: trace.flags | RayFlags(self.pipeline_flags), ..trace }
    }

    /// Traces the rays in one structure that can hit only opaque geometry.
    fn trace_opaque(&mut self, number: usize) {
        let through = match self.structures.all().len() {
            1 => self.traversing,
            _ => self.traversing & Mask::equal(self.structures.indices(), number as u32),
        };
        // Nothing reads which hit an occlusion ray commits, unless a hit object keeps it.
        let occlusion = RayFlags::TERMINATE_ON_FIRST_HIT | RayFlags::SKIP_CLOSEST_HIT_SHADER;
        let unread = self.shades && self.caller.is_some();
        let tlas = &self.structures.all()[number];
        let mut rest = through;
        while let Some(first) = rest.lanes().next() {
            let flags = self.traversal(first).flags;
            let mut alike = Mask::NONE;
            self.opaque.rays.clear();
            for lane in rest.lanes() {
                let ray = self.traversal(lane);
                if ray.flags == flags {
                    self.opaque.rays.push(ray);
                    alike = alike | Mask::lane(lane);
                }
            }
            rest = rest.without(alike);
            if !tlas.is_fully_opaque(flags) {
                continue;
            }
            let occlusion_only = unread && flags.contains(occlusion);
            if occlusion_only {
                self.stats.elided.occlusion += self.opaque.rays.len() as u64;
            }
            self.opaque.trace(tlas, occlusion_only);
            for (lane, hit) in alike.lanes().zip(&self.opaque.hits) {
                self.committed[lane] = *hit;
            }
            self.traversing = self.traversing.without(alike);
        }
    }

    /// Advances each ray to its next candidate that a shader decides.
    fn traverse<T: PipelineObserver>(&mut self, pipeline: &Pipeline, observer: &mut T) {
        for lane in self.traversing.lanes() {
            observer.invocation(self.launch_id(lane));
            loop {
                let tlas = self.structures.get(lane).expect("bug in anyhit: a ray without a structure");
                let cursor = self.cursors[lane].as_mut().expect("bug in anyhit: a ray without a traversal");
                let Some(candidate) = cursor.proceed_with(tlas, &mut Traversal(observer)) else {
                    self.committed[lane] = cursor.committed().copied();
                    self.traversing = self.traversing.without(Mask::lane(lane));
                    break;
                };
                let index = self.hit_index(lane, &candidate);
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
                if let Some(shader) = shader.filter(|shader| !self.suits(pipeline, *shader)) {
                    self.end_by_mismatch(lane, shader);
                    self.cursor_mut(lane).terminate();
                    continue;
                }
                // An observer sees every shader run.
                if !T::ACTIVE && shader.is_some_and(|shader| pipeline.is_empty(shader)) {
                    // An empty intersection shader reports nothing, an empty any-hit shader
                    // accepts.
                    self.stats.elide(if candidate.is_box() { Stage::Intersection } else { Stage::AnyHit }, 1);
                    self.cursor_mut(lane).confirm();
                    continue;
                }
                match shader {
                    _ if ends_before(&pipeline.sbt.hit, index) => {
                        self.records[lane] = index;
                        self.end_by_trap(lane, TrapCode::HitRecordMissing);
                    }
                    Some(shader) => {
                        let role = if candidate.is_box() { Role::Intersection } else { Role::AnyHit };
                        self.records[lane] = index;
                        self.wait(shader, role, Mask::lane(lane));
                        break;
                    }
                    None if candidate.is_box() => {
                        if pipeline.flags.no_null_intersection_shaders {
                            self.end_by_trap(lane, TrapCode::NullIntersection);
                        }
                    }
                    None if pipeline.flags.no_null_any_hit_shaders => {
                        self.end_by_trap(lane, TrapCode::NullAnyHit);
                    }
                    None => {
                        self.cursor_mut(lane).confirm();
                    }
                }
            }
        }
    }

    /// Ends a ray during traversal: its caller traps.
    fn end_by_trap(&mut self, lane: usize, code: TrapCode) {
        self.trap(lane, code);
        self.cursor_mut(lane).terminate();
    }

    /// Adds lanes to those that wait for a shader.
    fn wait(&mut self, shader: Shader, role: Role, lanes: Mask<W>) {
        match self.waiting.iter_mut().find(|group| group.shader == shader && group.role == role) {
            Some(group) => group.lanes = group.lanes | lanes,
            None if lanes.is_empty() => {}
            None => self.waiting.push(Waiting { shader, role, lanes }),
        }
    }

    /// The index of the record of a lane's miss shader.
    pub fn miss_record(&self, lane: usize) -> u64 {
        u64::from(self.miss_index.0[lane] & 0xFFFF)
    }

    /// The index of the hit record of a lane's candidate.
    pub fn hit_index(&self, lane: usize, candidate: &Candidate) -> u64 {
        let instance = candidate.instance_in(self.tlas(lane));
        let (stride, offset) = (self.sbt_stride.0[lane], self.sbt_offset.0[lane]);
        hit_record_index(instance.sbt_record_offset, candidate.geometry, stride, offset)
    }

    /// Applies the exits of a shader that the lanes' rays called.
    pub fn deliver(&mut self, role: Role, lanes: Mask<W>, batch: &Batch<W>) {
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

    /// Stores the attributes of a hit that was committed by a report.
    pub fn commit_attributes(&mut self, lane: usize, attributes: Data) {
        if self.attributes.len() <= lane {
            self.attributes.resize_with(lane + 1, Data::new);
        }
        self.attributes[lane] = attributes;
    }

    /// A lane's hit of a primitive whose attributes traversal computes.
    #[inline]
    fn built_in(&self, lane: usize) -> Option<&Candidate> {
        let candidate = self.committed[lane].as_ref().map(|committed| &committed.candidate);
        candidate.filter(|candidate| !self.settled && !candidate.is_box())
    }

    /// The attributes of a lane's hit.
    pub fn committed_attributes(&self, lane: usize) -> Data {
        match self.built_in(lane) {
            Some(candidate) => Data::from_slice(&candidate.intersection.attributes.map(f32::to_bits)),
            None => self.attributes.get(lane).cloned().unwrap_or_default(),
        }
    }

    /// Writes the builtins of a shader that runs in a role.
    pub fn write_builtins(&self, pipeline: &Pipeline, role: Role, lanes: Mask<W>, to: &mut Invocations<W>) {
        (to.launch_id, to.launch_size, to.depth) = (self.launch_id, self.launch_size, self.depth);
        to.rays = self.rays;
        to.structures.copy(&self.structures);
        to.record_indices = self.records;
        to.hit = role != Role::Miss;
        let table = if to.hit { &pipeline.sbt.hit } else { &pipeline.sbt.miss };
        let mut record = None;
        for lane in lanes.lanes() {
            let index = self.records[lane];
            if record.as_ref().is_none_or(|(known, _)| *known != index) {
                record = Some((index, at(table, index).and_then(Record::shader_record)));
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
                Role::ClosestHit => self.built_in(lane),
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

/// The record at an index of the hit table with its group.
pub(super) fn hit_group_at(pipeline: &Pipeline, index: u64) -> (Option<&Record>, HitGroup) {
    let record = at(&pipeline.sbt.hit, index);
    let group = match record.map(|record| pipeline.groups[record.group as usize]) {
        Some(Group::Hit(group)) => group,
        _ => HitGroup::default(),
    };
    (record, group)
}

/// The record of a table at an index; `None` for a hole and beyond the end.
pub(super) fn at(table: &[Option<Record>], index: u64) -> Option<&Record> {
    usize::try_from(index).ok().and_then(|at| table.get(at)).and_then(Option::as_ref)
}

/// The shader of a general record.
pub(super) fn general(pipeline: &Pipeline, record: &Record) -> Option<Shader> {
    match pipeline.groups[record.group as usize] {
        Group::General(shader) => Some(shader),
        Group::Hit(_) => None,
    }
}
