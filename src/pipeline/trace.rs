//! A trace in progress: the rays of a batch's lanes, from their operands to closest-hit or miss.

use std::sync::Arc;

use smallvec::SmallVec;

use crate::accel::{Candidate, Cursor, HitKind, RayFlags, Tlas, TraceRay, hit_record_index};
use crate::machine::hit_object::HitEncoded;
use crate::machine::stop::Rows;
use crate::machine::{Batch, Exit, Hit, Invocation, ShaderRecord, TrapCode};
use crate::module::interface::Stage;
use crate::pipeline::Pipeline;
use crate::pipeline::group::{Group, HitGroup, Shader};
use crate::pipeline::launch::{RayOperands, Stats};
use crate::pipeline::plain::{PlainRay, PlainRays};
use crate::pipeline::sbt::Record;
use crate::pipeline::stack::Role;
use crate::pipeline::witness::{Caller, Event, Traversal, Witness};
use crate::program::Program;

/// Words of a payload or of hit attributes.
pub(super) type Data = SmallVec<[u32; 16]>;

/// `SkipClosestHitShaderKHR`
const SKIP_CLOSEST_HIT: u32 = 8;

/// What one ray is traced with; at first with what it is taken from.
#[derive(Clone, Debug)]
pub(super) struct Query<S = Arc<Tlas>, P = Data> {
    pub tlas: S,
    pub trace: TraceRay,
    pub sbt_offset: u32,
    pub sbt_stride: u32,
    pub miss_index: u32,
    pub payload: P,
    pub launch_id: [u32; 3],
    pub launch_size: [u32; 3],
    /// 1 for a trace by ray generation.
    pub depth: u32,
}

impl<'a> Query<&'a Arc<Tlas>, std::vec::IntoIter<u32>> {
    /// A ray that no shader traces.
    pub fn by_nobody(tlas: &'a Arc<Tlas>, operands: RayOperands) -> Self {
        Self {
            tlas,
            trace: operands.trace,
            sbt_offset: operands.sbt_offset,
            sbt_stride: operands.sbt_stride,
            miss_index: operands.miss_index,
            payload: operands.payload.into_iter(),
            launch_id: [0; 3],
            launch_size: [1; 3],
            depth: 1,
        }
    }
}

impl<P: Iterator<Item = u32>> Query<&Arc<Tlas>, P> {
    /// With a structure and a payload of its own.
    fn owned(self) -> Query {
        let Self { tlas, trace, sbt_offset, sbt_stride, miss_index, payload, launch_id, launch_size, depth } =
            self;
        let (tlas, payload) = (tlas.clone(), payload.collect());
        Query { tlas, trace, sbt_offset, sbt_stride, miss_index, payload, launch_id, launch_size, depth }
    }

    /// The same in the memory of another one. Threads share the count of a structure's references: it is left
    /// alone where that will do.
    fn replace(self, old: &mut Query) {
        if !Arc::ptr_eq(&old.tlas, self.tlas) {
            old.tlas = self.tlas.clone();
        }
        old.trace = self.trace;
        (old.sbt_offset, old.sbt_stride, old.miss_index) =
            (self.sbt_offset, self.sbt_stride, self.miss_index);
        (old.launch_id, old.launch_size, old.depth) = (self.launch_id, self.launch_size, self.depth);
        old.payload.clear();
        old.payload.extend(self.payload);
    }
}

/// One ray of a trace.
#[derive(Clone, Debug)]
pub(super) struct RayState {
    pub query: Query,
    pub cursor: Cursor,
    /// Attributes of the committed hit.
    attributes: Data,
    /// The shader record, and with it the attributes, where a hit object says which.
    pub(super) record: Option<u64>,
    traversing: bool,
    /// Whether any hit will do where no shader is asked on the way.
    any_will_do: bool,
    /// What its caller traps for: a shader that this ray called trapped, or is null where it must not be.
    pub trapped: Option<TrapCode>,
}

/// A lane that waits for a shader, the data of the record that it calls it through, and the record's
/// index.
type WaitingLane = (usize, Option<ShaderRecord>, u64);

/// Lanes that wait for a shader.
#[derive(Clone, Debug)]
pub(super) struct Waiting {
    pub shader: Shader,
    pub role: Role,
    pub lanes: Vec<WaitingLane>,
}

/// The rays of one `OpTraceRayKHR`; its memory is used again for the next.
#[derive(Clone, Debug, Default)]
pub(super) struct Trace {
    /// By lane of the caller; the memory of a lane that does not trace may lie idle.
    rays: Vec<Option<RayState>>,
    /// The lanes that trace, ascending.
    lanes: Vec<usize>,
    waiting: Vec<Waiting>,
    plain: PlainRays,
    traversing: bool,
    /// The instruction that traces.
    caller: Option<Caller>,
    /// Whether closest-hit and miss shaders run at the end.
    shades: bool,
    /// Whether somebody watches shaders run.
    pub watched: bool,
    /// Ray flags that every ray has besides its own, and no shader sees.
    pub pipeline_flags: u32,
    /// What its rays did not need.
    pub stats: Stats,
}

impl Trace {
    /// Makes it ready for the rays of another instruction, which runs closest-hit and miss shaders or
    /// does not.
    pub fn clear(&mut self, shades: bool) {
        self.shades = shades;
        self.lanes.clear();
        self.waiting.clear();
        self.traversing = true;
        self.stats = Stats::default();
    }

    /// Adds the ray of a lane; lanes come in ascending order.
    pub fn push<T: Witness>(
        &mut self,
        lane: usize,
        query: Query<&Arc<Tlas>, impl Iterator<Item = u32>>,
        caller: Option<Caller>,
        witness: &mut T,
    ) {
        self.lanes.push(lane);
        self.caller = caller;
        // Nobody sees which hit a shadow ray commits, where no shader is asked on the way and no
        // hit object keeps it.
        let only_whether = RayFlags(RayFlags::TERMINATE_ON_FIRST_HIT.0 | RayFlags::SKIP_CLOSEST_HIT_SHADER.0);
        let flags = query.trace.flags;
        let any_will_do = !T::ACTIVE
            && self.shades
            && caller.is_some()
            && flags.contains(only_whether)
            && query.tlas.is_decided_without_shaders(flags);
        let mut traversal = query.trace;
        traversal.flags = traversal.flags | RayFlags(self.pipeline_flags);
        let ray = self.place(lane, query, |ray| ray.cursor.reset(&ray.query.tlas, traversal), traversal);
        ray.record = None;
        ray.traversing = true;
        ray.any_will_do = any_will_do;
        self.stats.spared.occlusion += u64::from(any_will_do);
        if T::ACTIVE {
            let query = &self.ray(lane).query;
            witness.invocation(query.launch_id);
            witness.event(Event::Trace {
                caller,
                tlas: query.tlas.clone(),
                launch_id: query.launch_id,
                depth: query.depth,
                trace: query.trace,
                sbt: [query.sbt_offset, query.sbt_stride, query.miss_index],
                payload: query.payload.to_vec(),
            });
        }
    }

    /// Adds a ray that a hit object knows the end of; lanes come in ascending order.
    pub fn push_settled(
        &mut self,
        lane: usize,
        query: Query<&Arc<Tlas>, impl Iterator<Item = u32>>,
        caller: Caller,
        (record, hit): (u64, Option<&HitEncoded>),
    ) {
        self.lanes.push(lane);
        self.caller = Some(caller);
        let trace = query.trace;
        let ray = self.place(lane, query, |_| (), trace);
        ray.cursor.settle(trace, hit.map(|hit| hit.committed));
        ray.attributes = hit.map_or_else(Data::new, |hit| hit.attributes.iter().copied().collect());
        ray.record = Some(record);
        ray.traversing = false;
    }

    /// The state of a lane's ray, in the memory of the ray before it where there was one, which is `reset`.
    fn place(
        &mut self,
        lane: usize,
        query: Query<&Arc<Tlas>, impl Iterator<Item = u32>>,
        reset: impl FnOnce(&mut RayState),
        traversal: TraceRay,
    ) -> &mut RayState {
        if self.rays.len() <= lane {
            self.rays.resize_with(lane + 1, || None);
        }
        let place = &mut self.rays[lane];
        match place {
            Some(ray) => {
                query.replace(&mut ray.query);
                ray.trapped = None;
                reset(ray);
                ray
            }
            None => place.insert(RayState::new(query.owned(), traversal)),
        }
    }

    /// The lanes that trace.
    pub fn lanes(&self) -> &[usize] {
        &self.lanes
    }

    /// Goes on until a shader must run; `None` when every ray is done.
    pub fn advance<T: Witness>(&mut self, pipeline: &Pipeline, witness: &mut T) -> Option<Waiting> {
        loop {
            if let Some(waiting) = self.waiting.pop() {
                return Some(waiting);
            }
            if !self.traversing {
                return None;
            }
            self.traverse(pipeline, witness);
            if self.waiting.is_empty() {
                self.traversing = false;
                self.finish(pipeline, witness);
            }
            // The last is called first: keep the order of lanes.
            self.waiting.reverse();
        }
    }

    /// Lets each ray go on to its next candidate that a shader decides.
    fn traverse<T: Witness>(&mut self, pipeline: &Pipeline, witness: &mut T) {
        if !T::ACTIVE {
            self.traverse_plain();
        }
        for &lane in &self.lanes {
            let Some(ray) = self.rays[lane].as_mut().filter(|ray| ray.traversing) else { continue };
            witness.invocation(ray.query.launch_id);
            loop {
                let candidate = ray.cursor.proceed_with(&ray.query.tlas, &mut Traversal(witness));
                let Some(candidate) = candidate else {
                    ray.traversing = false;
                    break;
                };
                let (index, record, group) = hit_group(pipeline, &ray.query, &candidate);
                let shader = if candidate.is_box() { group.intersection } else { group.any_hit };
                if T::ACTIVE {
                    let instance = &ray.query.tlas.instances()[candidate.instance as usize];
                    let arithmetic = [
                        instance.sbt_record_offset,
                        candidate.geometry,
                        ray.query.sbt_stride & 0xF,
                        ray.query.sbt_offset & 0xF,
                    ];
                    witness.event(Event::Candidate { candidate, record: index, arithmetic, shader });
                }
                // A witness sees every shader run.
                if !T::ACTIVE && shader.is_some_and(|shader| pipeline.is_empty(shader)) {
                    // An empty intersection shader reports nothing, an empty any-hit shader accepts.
                    self.stats.spare(if candidate.is_box() { Stage::Intersection } else { Stage::AnyHit });
                    ray.cursor.confirm();
                    continue;
                }
                match shader {
                    Some(shader) => {
                        let role = if candidate.is_box() { Role::Intersection } else { Role::AnyHit };
                        let record = record.and_then(Record::shader_record);
                        wait(&mut self.waiting, shader, role, (lane, record, index));
                        break;
                    }
                    None if candidate.is_box() => {
                        if pipeline.flags.no_null_intersection_shaders {
                            ray.trap(TrapCode::NullIntersection);
                        }
                    }
                    None if pipeline.flags.no_null_any_hit_shaders => ray.trap(TrapCode::NullAnyHit),
                    None => {
                        ray.cursor.confirm();
                    }
                }
            }
        }
    }

    /// Traces all rays at once that no shader is asked about, and that go through the same structure as the
    /// first.
    fn traverse_plain(&mut self) {
        let Self { rays, lanes, plain, .. } = self;
        let Some(tlas) =
            lanes.first().and_then(|&lane| rays[lane].as_ref()).map(|ray| ray.query.tlas.clone())
        else {
            return;
        };
        let is_plain = |ray: &&mut RayState| {
            ray.traversing
                && Arc::ptr_eq(&ray.query.tlas, &tlas)
                && tlas.is_decided_without_shaders(ray.cursor.trace().flags)
        };
        plain.rays.clear();
        let mut lanes_of_plain = SmallVec::<[usize; 64]>::new();
        for &lane in &*lanes {
            if let Some(ray) = rays[lane].as_mut().filter(is_plain) {
                ray.traversing = false;
                plain.rays.push(PlainRay { trace: *ray.cursor.trace(), any_will_do: ray.any_will_do });
                lanes_of_plain.push(lane);
            }
        }
        plain.trace(&tlas);
        for (&lane, &hit) in lanes_of_plain.iter().zip(&plain.hits) {
            if let Some(ray) = &mut rays[lane] {
                let trace = *ray.cursor.trace();
                ray.cursor.settle(trace, hit);
            }
        }
    }

    /// Chooses closest-hit or miss for each ray.
    fn finish<T: Witness>(&mut self, pipeline: &Pipeline, witness: &mut T) {
        for place in 0..self.lanes.len() {
            let lane = self.lanes[place];
            let Some(ray) = self.rays[lane].as_ref().filter(|ray| ray.trapped.is_none()) else { continue };
            let committed = ray.cursor.committed().copied();
            let (mut skipped, mut spared) = (false, false);
            let (index, record, shader, role) = match &committed {
                Some(committed) => {
                    let index = ray.record.unwrap_or_else(|| hit_index(&ray.query, &committed.candidate));
                    let (record, group) = hit_group_at(pipeline, index);
                    spared = committed.candidate.opaque && group.any_hit.is_some();
                    skipped = ray.query.trace.flags.0 & SKIP_CLOSEST_HIT != 0;
                    (index, record, group.closest_hit.filter(|_| !skipped), Role::ClosestHit)
                }
                None => {
                    let index = ray.record.unwrap_or_else(|| ray.query.miss_record());
                    let record = at(&pipeline.sbt.miss, index);
                    (index, record, record.and_then(|record| general(pipeline, record)), Role::Miss)
                }
            };
            let shader = shader.filter(|_| self.shades);
            if T::ACTIVE && ray.record.is_none() {
                witness.invocation(ray.query.launch_id);
                witness.event(Event::Traversed { committed, record: index, shader, kept: !self.shades });
            }
            self.stats.spared.any_hit += u64::from(spared);
            let promised = match role {
                Role::Miss => pipeline.flags.no_null_miss_shaders.then_some(TrapCode::NullMiss),
                _ => pipeline.flags.no_null_closest_hit_shaders.then_some(TrapCode::NullClosestHit),
            };
            match (shader, self.caller) {
                (None, _) if let Some(code) = promised.filter(|_| self.shades && !skipped) => {
                    self.ray_mut(lane).trap(code);
                }
                (Some(shader), _) if !T::ACTIVE && pipeline.is_empty(shader) => {
                    self.stats.spare(pipeline.programs[shader.0 as usize].stage);
                }
                (Some(shader), Some(caller)) if !self.watched && leaves_unread(pipeline, caller, shader) => {
                    self.stats.spare_unread(pipeline.programs[shader.0 as usize].stage);
                }
                (Some(shader), _) => {
                    let record = record.and_then(Record::shader_record);
                    wait(&mut self.waiting, shader, role, (lane, record, index));
                }
                (None, Some(caller)) if self.shades && !skipped => {
                    witness.absent(caller, &mut self.ray_mut(lane).query.payload);
                }
                (None, _) => {}
            }
        }
    }

    /// The ray of a lane that traces.
    pub fn ray(&self, lane: usize) -> &RayState {
        self.rays[lane].as_ref().expect("bug in anyhit: a lane without a ray called a shader")
    }

    /// The ray of a lane that traces.
    pub fn ray_mut(&mut self, lane: usize) -> &mut RayState {
        self.rays[lane].as_mut().expect("bug in anyhit: a lane without a ray called a shader")
    }

    /// Takes what a shader that this trace called leaves for a lane.
    pub fn deliver<const W: usize>(
        &mut self,
        role: Role,
        lane: usize,
        payload: Option<Rows>,
        batch: &Batch<W>,
        from: usize,
    ) {
        let ray = self.ray_mut(lane);
        ray.take_payload(payload, batch, from);
        let exit = batch.exits[from];
        if let Exit::Trapped(_) = exit {
            ray.trap(TrapCode::Callee);
            return;
        }
        if role == Role::AnyHit {
            match exit {
                Exit::Ignored => {}
                _ => {
                    ray.cursor.confirm();
                }
            }
            if exit == Exit::Terminated {
                ray.cursor.terminate();
            }
        }
    }
}

/// Whether a shader leaves nothing behind but words of the payload that its caller does not read.
fn leaves_unread(pipeline: &Pipeline, caller: Caller, shader: Shader) -> bool {
    let [caller_program, program] = [caller.shader, shader].map(|one| &pipeline.programs[one.0 as usize]);
    let read = || caller_program.payloads.reads_behind(caller.op);
    program.payloads.writes_only.is_some_and(|written| !written.meets(read()))
}

impl Query {
    /// The index of the record of the miss shader.
    pub fn miss_record(&self) -> u64 {
        u64::from(self.miss_index & 0xFFFF)
    }
}

impl RayState {
    /// `traversal` is the ray with the flags that the pipeline adds.
    fn new(query: Query, traversal: TraceRay) -> Self {
        let cursor = Cursor::new(&query.tlas, traversal);
        Self {
            query,
            cursor,
            attributes: Data::new(),
            record: None,
            traversing: true,
            any_will_do: false,
            trapped: None,
        }
    }

    /// Ends the ray: its caller traps.
    pub fn trap(&mut self, code: TrapCode) {
        self.trapped = Some(code);
        self.traversing = false;
        self.cursor.terminate();
    }

    /// Takes the payload as a lane of a shader that this ray called leaves it.
    #[inline]
    pub fn take_payload<const W: usize>(&mut self, rows: Option<Rows>, batch: &Batch<W>, lane: usize) {
        if let Some(rows) = rows {
            let words = batch.registers.lane_words(rows.first, rows.count, lane);
            self.query.payload.iter_mut().zip(words).for_each(|(to, word)| *to = word);
        }
    }

    /// Remembers the attributes of a hit that was committed by a report.
    pub fn commit_attributes(&mut self, attributes: Data) {
        self.attributes = attributes;
    }

    /// The attributes of the hit.
    pub fn committed_attributes(&self) -> Data {
        match self.cursor.committed() {
            Some(committed) if self.record.is_none() && !committed.candidate.is_box() => {
                candidate_attributes(&committed.candidate)
            }
            _ => self.attributes.clone(),
        }
    }

    /// The invocation of a shader for the cursor's current candidate, seen at a t.
    pub fn candidate_invocation(&self, program: &Program, record: Option<ShaderRecord>) -> Invocation {
        let mut invocation = Invocation::default();
        self.show(Role::AnyHit, program, record, &mut invocation);
        invocation
    }

    /// Shows a shader that plays a role what its builtins read, in the memory of another invocation.
    #[inline]
    pub fn show(&self, role: Role, program: &Program, record: Option<ShaderRecord>, to: &mut Invocation) {
        let Query { trace, launch_id, launch_size, depth, .. } = self.query;
        let (mut t_max, mut hit) = (trace.ray.t_max, None);
        match role {
            Role::AnyHit | Role::Intersection => {
                t_max = self.cursor.t_max();
                if let Some(candidate) = self.cursor.candidate() {
                    if !candidate.is_box() {
                        t_max = candidate.intersection.t;
                    }
                    hit = Some((candidate, candidate.hit_kind().unwrap_or(HitKind(0))));
                }
            }
            Role::ClosestHit => {
                t_max = self.cursor.t_max();
                hit = self.cursor.committed().map(|committed| (&committed.candidate, committed.hit_kind));
            }
            _ => {}
        }
        (to.launch_id, to.launch_size, to.depth) = (launch_id, launch_size, depth);
        (to.trace, to.t_max) = (Some(trace), t_max);
        to.record = record;
        match (hit.filter(|_| !program.inputs.is_empty()), &mut to.hit) {
            (None, old) => *old = None,
            // Threads share the count of a structure's references: it is left alone where that will do.
            (Some((&candidate, kind)), Some(old)) if Arc::ptr_eq(&old.tlas, &self.query.tlas) => {
                (old.candidate, old.kind) = (candidate, kind);
            }
            (Some((&candidate, kind)), old) => {
                *old = Some(Hit { tlas: self.query.tlas.clone(), candidate, kind });
            }
        }
    }

    /// The attributes that a shader in a role begins with.
    #[inline]
    pub fn shown_attributes(&self, role: Role) -> Data {
        match role {
            Role::AnyHit => self.cursor.candidate().map_or_else(Data::new, candidate_attributes),
            Role::ClosestHit => self.committed_attributes(),
            _ => Data::new(),
        }
    }
}

/// Attributes of a built-in primitive, as words.
fn candidate_attributes(candidate: &Candidate) -> Data {
    Data::from_slice(&candidate.intersection.attributes.map(f32::to_bits))
}

fn wait(waiting: &mut Vec<Waiting>, shader: Shader, role: Role, lane: WaitingLane) {
    match waiting.iter_mut().find(|group| group.shader == shader && group.role == role) {
        Some(group) => group.lanes.push(lane),
        None => {
            let mut lanes = Vec::with_capacity(64);
            lanes.push(lane);
            waiting.push(Waiting { shader, role, lanes });
        }
    }
}

/// The hit record of a candidate, with its index.
pub(super) fn hit_group<'a>(
    pipeline: &'a Pipeline,
    query: &Query,
    candidate: &Candidate,
) -> (u64, Option<&'a Record>, HitGroup) {
    let index = hit_index(query, candidate);
    let (record, group) = hit_group_at(pipeline, index);
    (index, record, group)
}

/// The index of the hit record of a candidate.
pub(super) fn hit_index(query: &Query, candidate: &Candidate) -> u64 {
    let instance = candidate.instance_in(&query.tlas);
    hit_record_index(instance.sbt_record_offset, candidate.geometry, query.sbt_stride, query.sbt_offset)
}

fn hit_group_at(pipeline: &Pipeline, index: u64) -> (Option<&Record>, HitGroup) {
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
