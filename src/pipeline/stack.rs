//! The stack: shaders that run or wait, and between them what they wait for.

use std::sync::Arc;

use crate::accel::{RayFlags, Tlas, TraceRay};
use crate::error::{Error, ErrorKind, Place};
use crate::geometry::Ray;
use crate::interp;
use crate::machine::object::ObjectRef;
use crate::machine::stop::Rows;
use crate::machine::{
    Batch, Bindings, Exit, Invocation, Mask, Observer, Reg, Resources, Stop, Trap, TrapCode,
};
use crate::module::interface::Stage;
use crate::ops::decode::InterfaceRows;
use crate::ops::hit_object;
use crate::ops::pointer::storage;
use crate::ops::ray_tracing::TRACE_OPERANDS;
use crate::ops::row::{Row, Width};
use crate::pipeline::group::Shader;
use crate::pipeline::launch::Stats;
use crate::pipeline::report::Report;
use crate::pipeline::sbt::Record;
use crate::pipeline::trace::{Data, Query, RayState, Trace, general};
use crate::pipeline::witness::{Caller, Event, Witness};
use crate::pipeline::{Pipeline, PipelineFlags};
use crate::program::Program;

/// Why a shader runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    RayGeneration,
    AnyHit,
    /// An any-hit shader that decides on a report of an intersection shader.
    ReportedAnyHit,
    Intersection,
    ClosestHit,
    Miss,
    Callable,
}

/// A shader that is to run for some lanes of a caller.
pub(super) struct Called {
    shader: Shader,
    role: Role,
    lanes: Vec<Summons>,
}

/// What a lane of a called shader begins with.
struct Summons {
    /// The caller's lane.
    caller: usize,
    invocation: Invocation,
    /// Or callable data.
    payload: Data,
    attributes: Data,
}

impl Called {
    pub fn new(shader: Shader, role: Role, lanes: usize) -> Self {
        Self { shader, role, lanes: Vec::with_capacity(lanes) }
    }

    /// Adds the caller's lane with its invocation, payload (or callable data) and attributes.
    pub fn push(&mut self, lane: usize, invocation: Invocation, payload: Data, attributes: Data) {
        self.lanes.push(Summons { caller: lane, invocation, payload, attributes });
    }
}

/// A shader that runs or waits.
#[derive(Clone, Debug)]
pub(super) struct Running<const W: usize> {
    pub shader: Shader,
    role: Role,
    pub batch: Batch<W>,
    /// The caller's lane for each lane.
    callers: Vec<usize>,
    /// Where a witness sees the payload.
    data: Option<Rows>,
}

/// `OpExecuteCallableKHR` in progress.
#[derive(Clone, Debug)]
pub(super) struct Call {
    data: Rows,
    waiting: Vec<Callable>,
}

/// A callable shader and the lanes that call it, each through its record.
#[derive(Clone, Debug)]
struct Callable {
    shader: Shader,
    lanes: Vec<(usize, Option<Record>, u32)>,
}

#[derive(Clone, Debug)]
pub(super) enum Level<const W: usize> {
    Shader(Box<Running<W>>),
    /// `object` where the hit objects there take what is found.
    Trace {
        trace: Box<Trace>,
        payload: Option<Rows>,
        object: Option<ObjectRef>,
    },
    Call(Call),
    Report(Box<Report>),
}

/// A trap with all that is known of it.
#[derive(Clone, Debug)]
pub struct Trapped {
    /// The launch index of the invocation.
    pub launch_id: [u32; 3],
    /// Why.
    pub code: TrapCode,
    /// The offset or device address that an access asked for.
    pub asked: u64,
    /// The shader.
    pub shader: Shader,
    /// The instruction, in words from the start of the shader's module.
    pub offset: u32,
    /// The report.
    pub error: Error,
}

/// Runs the shaders of one batch of a launch, or of one ray.
pub(super) struct Stack<'a, const W: usize, T, O> {
    pub pipeline: &'a Pipeline,
    pub bindings: &'a [Bindings],
    pub witness: &'a mut T,
    pub observer: &'a mut O,
    pub stats: Stats,
    /// The trap of the lowest launch index.
    pub trapped: Option<Trapped>,
    pub levels: Vec<Level<W>>,
    /// Batches that can be used again, by shader.
    spare: Vec<Vec<Box<Running<W>>>>,
    /// Traces whose memory can be used again.
    #[allow(clippy::vec_box, reason = "the boxes are what is used again")]
    spare_traces: Vec<Box<Trace>>,
}

/// The bindings of each program of a pipeline.
pub(super) fn bindings(pipeline: &Pipeline, resources: &Resources) -> Vec<Bindings> {
    let mut memory = resources.memory.clone();
    if pipeline.programs.iter().any(|program| program.addresses_records) {
        let records = pipeline.sbt.hit.iter().chain(&pipeline.sbt.miss).flatten();
        for data in records.filter_map(|record| record.data.as_ref()) {
            memory.add_buffer(data);
        }
    }
    let of = |program: &Arc<Program>| {
        let mut bindings = resources.bindings(program.bindings());
        bindings.memory = memory.clone();
        bindings
    };
    pipeline.programs.iter().map(of).collect()
}

impl<'a, const W: usize, T: Witness, O: Observer<W>> Stack<'a, W, T, O>
where
    Row: Width<W>,
{
    pub fn new(
        pipeline: &'a Pipeline,
        bindings: &'a [Bindings],
        witness: &'a mut T,
        observer: &'a mut O,
    ) -> Self {
        let spare = pipeline.programs.iter().map(|_| Vec::new()).collect();
        Self {
            pipeline,
            bindings,
            witness,
            observer,
            stats: Stats::default(),
            trapped: None,
            levels: Vec::new(),
            spare,
            spare_traces: Vec::new(),
        }
    }

    /// Runs the ray generation shader for invocations with these launch indices.
    pub fn launch(&mut self, record: &Record, ids: &[[u32; 3]], launch_size: [u32; 3]) {
        let Some(shader) = general(self.pipeline, record) else { return };
        let mut called = Called::new(shader, Role::RayGeneration, ids.len());
        for (lane, &launch_id) in ids.iter().enumerate() {
            let record = record.shader_record();
            let invocation = Invocation { launch_id, launch_size, record, ..Invocation::default() };
            called.push(lane, invocation, Data::new(), Data::new());
        }
        self.enter(called);
        self.run();
    }

    /// Runs any shader but an intersection shader for one invocation, without what would call it.
    pub fn invoke(&mut self, shader: Shader, invocation: Invocation, payload: Data, attributes: Data) {
        let role = match self.pipeline.programs[shader.0 as usize].stage {
            Stage::RayGeneration => Role::RayGeneration,
            Stage::AnyHit => Role::AnyHit,
            Stage::ClosestHit => Role::ClosestHit,
            Stage::Callable => Role::Callable,
            _ => Role::Miss,
        };
        let mut called = Called::new(shader, role, 1);
        called.push(0, invocation, payload, attributes);
        self.enter(called);
        self.run();
    }

    /// Traces one ray without a ray generation shader; the ray's state afterwards.
    pub fn trace(&mut self, query: Query) -> Option<RayState> {
        self.stats.rays += 1;
        let mut trace = self.spare_trace(true);
        trace.push(0, query, None, self.witness);
        self.levels.push(Level::Trace { trace, payload: None, object: None });
        self.run()
    }

    /// Runs until the stack is empty; the ray of a trace that nothing called.
    fn run(&mut self) -> Option<RayState> {
        loop {
            match self.levels.last_mut()? {
                Level::Shader(running) => {
                    let program = &self.pipeline.programs[running.shader.0 as usize];
                    let bindings = &self.bindings[running.shader.0 as usize];
                    if O::active() {
                        self.observer.resumed(running.shader.0, &running.batch);
                    }
                    let stop = interp::run(&mut running.batch, program, bindings, self.observer);
                    if O::active() {
                        self.observer.stopped(running.shader.0, &running.batch);
                    }
                    if T::QUERIES
                        && let Some(told) = &mut running.batch.queries.told
                    {
                        told.drain(..).for_each(|event| self.witness.event(Event::RayQuery(event)));
                    }
                    match stop {
                        Stop::Done => self.leave(),
                        Stop::TraceRay { mask, operands, payload } => {
                            self.begin_trace(mask, operands, payload, None);
                        }
                        Stop::HitObjectTrace { mask, object, operands, payload } => {
                            self.begin_trace(mask, operands, payload, Some(object));
                        }
                        Stop::HitObjectExecute { mask, object, payload } => {
                            self.begin_execute(mask, object, payload);
                        }
                        Stop::HitObjectRecordHandle { mask, object, to } => {
                            self.record_handle(mask, object, to);
                        }
                        Stop::ExecuteCallable { mask, index, data } => self.begin_call(mask, index, data),
                        Stop::ReportIntersection { mask, t, hit_kind, accepted } => {
                            self.begin_report((mask, t, hit_kind, accepted));
                        }
                        Stop::Paused => {}
                        Stop::Barrier { .. } => {
                            unreachable!("bug in anyhit: a barrier of a workgroup outside compute")
                        }
                    }
                }
                Level::Trace { trace, .. } => match trace.advance(self.pipeline, self.witness) {
                    Some(called) => self.enter(called),
                    None => {
                        if let Some(ray) = self.end_trace() {
                            return Some(ray);
                        }
                    }
                },
                Level::Call(_) => self.advance_call(),
                Level::Report(_) => self.advance_report(),
            }
        }
    }

    /// Puts a shader on the stack.
    fn enter(&mut self, called: Called) {
        let pipeline = self.pipeline;
        let program = &*pipeline.programs[called.shader.0 as usize];
        let data = match called.role {
            Role::Callable => program.interface_rows(storage::INCOMING_CALLABLE_DATA),
            _ => program.interface_rows(storage::INCOMING_RAY_PAYLOAD),
        };
        let data = data.map(InterfaceRows::rows);
        let mut running = self.spare[called.shader.0 as usize].pop().unwrap_or_else(|| {
            let batch = program.batch();
            Box::new(Running { shader: called.shader, role: called.role, batch, callers: Vec::new(), data })
        });
        running.role = called.role;
        running.callers.clear();
        let mask = Mask::first(called.lanes.len());
        let attributes = program.interface_rows(storage::HIT_ATTRIBUTE).map(InterfaceRows::rows);
        let mut lanes = called.lanes;
        // Everything here is wide: it is taken from where it lies.
        for (lane, entry) in lanes.iter_mut().enumerate() {
            running.callers.push(entry.caller);
            let invocation = &mut running.batch.invocations[lane];
            *invocation = std::mem::take(&mut entry.invocation);
            invocation.subgroup_size = pipeline.subgroup_size;
        }
        program.begin(&mut running.batch, mask, pipeline.budget);
        for (lane, entry) in lanes.iter().enumerate() {
            for (rows, words) in [(data, &entry.payload), (attributes, &entry.attributes)] {
                if let Some(rows) = rows {
                    let words = words.iter().copied().take(rows.count as usize);
                    running.batch.registers.set_lane_words(rows.first, lane, words);
                }
            }
        }
        self.stats.count(program.stage, mask.count());
        if T::ACTIVE {
            running.batch.queries.told = T::QUERIES.then(Vec::new);
            for lane in mask.lanes() {
                let read =
                    |first: Reg, count| running.batch.registers.lane_words(first, count, lane).collect();
                self.witness.invocation(running.batch.invocations[lane].launch_id);
                self.witness.event(Event::Enter {
                    shader: called.shader,
                    stage: program.stage,
                    builtins: program
                        .inputs
                        .iter()
                        .map(|rows| (rows.builtin, read(rows.first, rows.count)))
                        .collect(),
                    payload: data.map_or_else(Vec::new, |rows| read(rows.first, rows.count)),
                    attributes: attributes.map_or_else(Vec::new, |rows| read(rows.first, rows.count)),
                });
            }
        }
        self.levels.push(Level::Shader(running));
    }

    /// Takes a shader that is done from the stack and gives its results to whoever called it.
    fn leave(&mut self) {
        let pipeline = self.pipeline;
        let Some(Level::Shader(running)) = self.levels.pop() else {
            unreachable!("bug in anyhit: what ends is no shader");
        };
        let program = &*pipeline.programs[running.shader.0 as usize];
        self.stats.ray_queries += running.batch.queries.initialized;
        self.stats.reorders += running.batch.reorders;
        for (lane, &caller) in running.callers.iter().enumerate() {
            let exit = running.batch.exits[lane];
            if let Exit::Trapped(trap) = exit {
                self.trap(&running, lane, trap);
            }
            if T::ACTIVE {
                let payload = running.data.map_or_else(Vec::new, |rows| {
                    running.batch.registers.lane_words(rows.first, rows.count, lane).collect()
                });
                let (shader, stage) = (running.shader, program.stage);
                self.witness.invocation(running.batch.invocations[lane].launch_id);
                self.witness.event(Event::Leave { shader, stage, exit, payload });
            }
            match &mut self.levels[..] {
                [] => {}
                [.., Level::Trace { trace, .. }] => {
                    trace.deliver(running.role, caller, program, &running.batch, lane);
                }
                [.., Level::Shader(below), Level::Call(call)] => {
                    if let Some(rows) = running.data {
                        let words: Data =
                            running.batch.registers.lane_words(rows.first, rows.count, lane).collect();
                        let words = words.into_iter().take(call.data.count as usize);
                        below.batch.registers.set_lane_words(call.data.first, caller, words);
                    }
                    if let Exit::Trapped(_) = exit {
                        let op = below.batch.op - 1;
                        below.batch.trap(Mask::lane(caller), TrapCode::Callee, op);
                    }
                }
                [.., Level::Trace { trace, .. }, Level::Shader(below), Level::Report(report)] => {
                    let witness = &mut *self.witness;
                    report.deliver(trace, &mut below.batch, caller, program, &running.batch, lane, witness);
                }
                _ => unreachable!("bug in anyhit: a shader without a caller"),
            }
        }
        self.spare[running.shader.0 as usize].push(running);
    }

    pub(super) fn spare_trace(&mut self, shades: bool) -> Box<Trace> {
        let mut trace = self.spare_traces.pop().unwrap_or_default();
        trace.clear(shades);
        trace.pipeline_flags = self.pipeline.flags.ray_flags();
        trace
    }

    fn begin_trace(&mut self, mask: Mask<W>, operands: Reg, payload: Rows, object: Option<ObjectRef>) {
        let mut trace = self.spare_trace(object.is_none());
        let Some(Level::Shader(running)) = self.levels.last_mut() else { return };
        let bindings = &self.bindings[running.shader.0 as usize];
        let caller = Caller { shader: running.shader, op: running.batch.op - 1, payload: payload.first };
        for lane in mask.lanes() {
            let batch = &running.batch;
            let mut words = [0; TRACE_OPERANDS as usize];
            let read = batch.registers.lane_words(operands, TRACE_OPERANDS, lane);
            words.iter_mut().zip(read).for_each(|(to, word)| *to = word);
            let invocation = &batch.invocations[lane];
            let depth = invocation.depth + 1;
            let place = object.map_or(Ok(Reg(0)), |object| object.row(&batch.registers, lane));
            let query = match bindings.acceleration_structure([words[0], words[1]]) {
                _ if let Err(code) = place => Err(code),
                None => Err(TrapCode::AccelerationStructureMissing),
                Some(_) if depth > self.pipeline.max_recursion => Err(TrapCode::RecursionTooDeep),
                Some(tlas) => {
                    let payload = batch.registers.lane_words(payload.first, payload.count, lane).collect();
                    query(tlas, &words, payload, invocation, depth, self.pipeline.flags)
                }
            };
            match query {
                Ok(query) => trace.push(lane, query, Some(caller), self.witness),
                Err(code) => {
                    let op = running.batch.op - 1;
                    running.batch.asked[lane] = u64::from(words[0]) | u64::from(words[1]) << 32;
                    running.batch.trap(Mask::lane(lane), code, op);
                }
            }
        }
        self.stats.rays += trace.lanes().len() as u64;
        self.levels.push(Level::Trace { trace, payload: Some(payload), object });
    }

    /// Takes a trace whose rays are done from the stack; its ray where nothing called it.
    fn end_trace(&mut self) -> Option<RayState> {
        let Some(Level::Trace { trace, payload, object }) = self.levels.pop() else { return None };
        if T::ACTIVE {
            for &lane in trace.lanes().iter().filter(|&&lane| !trace.ray(lane).is_settled()) {
                let payload = trace.ray(lane).query.payload.to_vec();
                self.witness.invocation(trace.ray(lane).query.launch_id);
                self.witness.event(Event::Traced { payload });
            }
        }
        let (Some(Level::Shader(below)), Some(payload)) = (self.levels.last_mut(), payload) else {
            return Some(trace.ray(0).clone());
        };
        for &lane in trace.lanes() {
            let ray = trace.ray(lane);
            below.batch.registers.set_lane_words(payload.first, lane, ray.query.payload.iter().copied());
            if ray.trapped {
                let op = below.batch.op - 1;
                below.batch.trap(Mask::lane(lane), TrapCode::Callee, op);
            } else if let Some(object) = object {
                hit_object::store(&mut below.batch, object, lane, ray.hit_object())
                    .expect("bug in anyhit: a hit object has moved");
            }
        }
        self.spare_traces.push(trace);
        None
    }

    fn begin_call(&mut self, mask: Mask<W>, index: Reg, data: Rows) {
        let Some(Level::Shader(running)) = self.levels.last_mut() else { return };
        let mut waiting: Vec<Callable> = Vec::new();
        for lane in mask.lanes() {
            let index = running.batch.registers[index].0[lane];
            let Some(record) = self.pipeline.sbt.callable.get(index as usize) else {
                let op = running.batch.op - 1;
                running.batch.trap(Mask::lane(lane), TrapCode::ShaderRecordMissing, op);
                continue;
            };
            let Some(shader) = record.as_ref().and_then(|record| general(self.pipeline, record)) else {
                if T::ACTIVE {
                    let caller =
                        Caller { shader: running.shader, op: running.batch.op - 1, payload: data.first };
                    let registers = &mut running.batch.registers;
                    let mut words: Data = registers.lane_words(data.first, data.count, lane).collect();
                    self.witness.absent(caller, &mut words);
                    registers.set_lane_words(data.first, lane, words);
                }
                continue;
            };
            match waiting.iter_mut().find(|group| group.shader == shader) {
                Some(group) => group.lanes.push((lane, record.clone(), index)),
                None => waiting.push(Callable { shader, lanes: vec![(lane, record.clone(), index)] }),
            }
        }
        waiting.reverse();
        self.levels.push(Level::Call(Call { data, waiting }));
    }

    fn advance_call(&mut self) {
        let [.., Level::Shader(below), Level::Call(call)] = &mut self.levels[..] else {
            unreachable!("bug in anyhit: a call without a caller");
        };
        let Some(Callable { shader, lanes }) = call.waiting.pop() else {
            self.levels.pop();
            return;
        };
        let mut called = Called::new(shader, Role::Callable, lanes.len());
        let depth = below.batch.invocations.iter().map(|invocation| invocation.depth).max().unwrap_or(0);
        for (lane, record, index) in lanes {
            let from = &below.batch.invocations[lane];
            let invocation = Invocation {
                launch_id: from.launch_id,
                launch_size: from.launch_size,
                record: record.as_ref().and_then(Record::shader_record),
                called_through: index.into(),
                depth,
                ..Invocation::default()
            };
            let data = below.batch.registers.lane_words(call.data.first, call.data.count, lane).collect();
            called.push(lane, invocation, data, Data::new());
        }
        if self.levels.len() as u64 > 2 * CALL_LIMIT {
            let [.., Level::Shader(below), Level::Call(_)] = &mut self.levels[..] else { return };
            let op = below.batch.op - 1;
            for entry in &called.lanes {
                below.batch.trap(Mask::lane(entry.caller), TrapCode::RecursionTooDeep, op);
            }
            return;
        }
        self.enter(called);
    }

    fn begin_report(&mut self, operands: (Mask<W>, Reg, Reg, Reg)) {
        let [.., Level::Trace { trace, .. }, Level::Shader(running)] = &mut self.levels[..] else {
            unreachable!("bug in anyhit: a report outside a trace");
        };
        let program = &self.pipeline.programs[running.shader.0 as usize];
        let callers = &running.callers;
        let report =
            Report::new(self.pipeline, trace, program, &mut running.batch, callers, operands, self.witness);
        self.levels.push(Level::Report(Box::new(report)));
    }

    fn advance_report(&mut self) {
        let [.., Level::Trace { trace, .. }, Level::Shader(running), Level::Report(report)] =
            &mut self.levels[..]
        else {
            unreachable!("bug in anyhit: a report outside a trace");
        };
        match report.advance(self.pipeline, trace) {
            Some(called) => self.enter(called),
            None => {
                // RayTmaxKHR may have shrunk.
                let program = &self.pipeline.programs[running.shader.0 as usize];
                program.refresh_inputs(&mut running.batch, Mask::ALL, true);
                self.levels.pop();
            }
        }
    }

    /// Keeps the report of a trap, if it is that of the lowest launch index so far.
    fn trap(&mut self, running: &Running<W>, lane: usize, trap: Trap) {
        if trap.code == TrapCode::Callee {
            return;
        }
        let launch_id = running.batch.invocations[lane].launch_id;
        let order = |id: [u32; 3]| [id[2], id[1], id[0]];
        if self.trapped.as_ref().is_some_and(|trapped| order(trapped.launch_id) <= order(launch_id)) {
            return;
        }
        let program = &*self.pipeline.programs[running.shader.0 as usize];
        let mut error = trap_error(program, &running.batch, lane, trap).note(format!(
            "in {} `{}`, launch id ({}, {}, {})",
            program.stage.name(),
            program.name,
            launch_id[0],
            launch_id[1],
            launch_id[2]
        ));
        let mut at = running.callers[lane];
        for level in self.levels.iter().rev() {
            if let Level::Shader(caller) = level {
                let program = &*self.pipeline.programs[caller.shader.0 as usize];
                let line = source_line(program, caller.batch.op.saturating_sub(1));
                error = error.note(format!("called by {} `{}`{line}", program.stage.name(), program.name));
                at = caller.callers.get(at).copied().unwrap_or(at);
            }
        }
        let offset = program.origins.get(trap.op as usize).map_or(0, |origin| origin.offset);
        let (code, asked, shader) = (trap.code, running.batch.asked[lane], running.shader);
        self.trapped = Some(Trapped { launch_id, code, asked, shader, offset, error });
    }
}

/// Callables may nest this deep: Vulkan sets no limit but the stack's size.
const CALL_LIMIT: u64 = 1024;

/// `SkipTrianglesKHR` and `SkipAABBsKHR`
const SKIPS: u32 = 0x300;

/// A trace as the operands of its instruction say. Where the pipeline skips one kind of primitive the
/// ray must not skip the other (VUID-RuntimeSpirv-OpTraceRayKHR-06553 and 06554).
fn query(
    tlas: &Arc<Tlas>,
    words: &[u32; TRACE_OPERANDS as usize],
    payload: Data,
    invocation: &Invocation,
    depth: u32,
    flags: PipelineFlags,
) -> Result<Query, TrapCode> {
    let trace = trace_operands(words)?;
    if (trace.flags.0 | flags.ray_flags()) & SKIPS == SKIPS {
        return Err(TrapCode::InvalidTrace);
    }
    Ok(Query {
        tlas: tlas.clone(),
        trace,
        time: f32::from_bits(words[15]),
        sbt_offset: words[4],
        sbt_stride: words[5],
        miss_index: words[6],
        payload,
        launch_id: invocation.launch_id,
        launch_size: invocation.launch_size,
        depth,
    })
}

/// Ray, flags and cull mask of a trace's operands, checked (Vulkan,
/// VUID-RuntimeSpirv-OpTraceRayKHR-06355 to 06359; VUID-RuntimeSpirv-OpTraceRayMotionNV-06361 to
/// 06366).
pub(crate) fn trace_operands(words: &[u32; TRACE_OPERANDS as usize]) -> Result<TraceRay, TrapCode> {
    let float = |at: usize| f32::from_bits(words[at]);
    let ray = Ray {
        origin: [float(7), float(8), float(9)],
        t_min: float(10),
        direction: [float(11), float(12), float(13)],
        t_max: float(14),
    };
    let trace = TraceRay { ray, flags: RayFlags(words[2]), cull_mask: words[3] };
    let time = float(15);
    if !trace.is_legal() || !(0.0..=1.0).contains(&time) {
        return Err(TrapCode::InvalidTrace);
    }
    Ok(trace)
}

/// The report of a trap by itself: what, where in the source, and which access.
pub(crate) fn trap_error<const W: usize>(
    program: &Program,
    batch: &Batch<W>,
    lane: usize,
    trap: Trap,
) -> Error {
    let error = located(program, trap.op, Error::new(ErrorKind::Trap, trap.code.message()), "");
    match program.describe_access(trap, batch.asked[lane], batch.accessed(lane)) {
        Some(access) => error.note(access),
        None => error,
    }
}

/// Adds the place of an operation to an error: its word, its source line, the inlined calls.
fn located(program: &Program, op: u32, error: Error, label: &str) -> Error {
    let Some(origin) = program.origins.get(op as usize) else { return error };
    let mut error = match program.place_at(origin.offset) {
        Some(line) => error.at_with(line, label).at(Place::Word(origin.offset as usize)),
        None => error.at_with(Place::Word(origin.offset as usize), label),
    };
    let mut scope = origin.scope;
    while scope != 0 {
        let inlined = program.scopes[scope as usize];
        let line =
            program.place_at(inlined.call).map_or_else(String::new, |place| format!(" at {}", words(&place)));
        error =
            error.note(format!("in function {}, called{line}", program.module.describe_id(inlined.function)));
        scope = inlined.parent;
    }
    error
}

fn words(place: &Place) -> String {
    match place {
        Place::Line { file, line, .. } => format!("{file}:{line}"),
        Place::Text { file, text, span } => {
            format!("{file}:{}", text[..span.start].matches('\n').count() + 1)
        }
        _ => String::new(),
    }
}

pub(super) fn source_line(program: &Program, op: u32) -> String {
    program.place(op).map_or_else(String::new, |place| format!(" at {}", words(&place)))
}

impl Stats {
    /// Counts a batch of a stage.
    pub(super) fn count(&mut self, stage: Stage, lanes: u32) {
        let entry = self.shaders.entry(stage).or_default();
        entry.batches += 1;
        entry.invocations += u64::from(lanes);
    }
}
