//! The stack: shaders that run or wait, and between them what they wait for.

use std::sync::Arc;

use crate::accel::Tlas;
use crate::interp;
use crate::machine::object::ObjectRef;
use crate::machine::stop::Rows;
use crate::machine::{Batch, Bindings, Exit, Invocation, Mask, Observer, Reg, Resources, Stop, TrapCode};
use crate::module::interface::Stage;
use crate::ops::decode::InterfaceRows;
use crate::ops::pointer::storage;
use crate::ops::row::{Row, Width};
use crate::pipeline::Pipeline;
use crate::pipeline::group::Shader;
use crate::pipeline::launch::Stats;
use crate::pipeline::report::Report;
use crate::pipeline::sbt::Record;
use crate::pipeline::trace::{Data, Query, RayState, Trace, Waiting, general};
use crate::pipeline::trapped::Trapped;
use crate::pipeline::witness::{Caller, Event, Witness};
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
    pub callers: Vec<usize>,
    /// The rows of the payload, or of callable data.
    data: Option<Rows>,
    attributes: Option<Rows>,
}

impl<const W: usize> Running<W> {
    /// Gives a lane what it begins with: the words of its payload (or callable data), or of its attributes.
    #[inline]
    fn give(&mut self, rows: Option<Rows>, lane: usize, words: &[u32]) {
        if let Some(rows) = rows {
            let rows = self.batch.registers.rows_mut(rows.first, rows.count);
            rows.iter_mut().zip(words).for_each(|(row, &word)| row.0[lane] = word);
        }
    }
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
    pub spare_traces: Vec<Box<Trace>>,
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
        let mut running = self.ready(shader, Role::RayGeneration);
        let subgroup_size = self.pipeline.subgroup_size;
        for ((lane, &launch_id), invocation) in ids.iter().enumerate().zip(&mut running.batch.invocations) {
            running.callers.push(lane);
            let record = record.shader_record();
            *invocation =
                Invocation { launch_id, launch_size, record, subgroup_size, ..Invocation::default() };
        }
        let program = &*self.pipeline.programs[shader.0 as usize];
        program.begin(&mut running.batch, Mask::first(ids.len()), self.pipeline.budget);
        self.push(running);
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
    pub fn trace(&mut self, query: Query<&Arc<Tlas>, impl Iterator<Item = u32>>) -> Option<RayState> {
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
                        self.observer.resumed(running.shader.0, &mut running.batch);
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
                    Some(waiting) => self.enter_traced(waiting),
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
        let mut running = self.ready(called.shader, called.role);
        let program = &*self.pipeline.programs[called.shader.0 as usize];
        let mut lanes = called.lanes;
        // Everything here is wide: it is taken from where it lies.
        for (entry, invocation) in lanes.iter_mut().zip(&mut running.batch.invocations) {
            running.callers.push(entry.caller);
            *invocation = std::mem::take(&mut entry.invocation);
            invocation.subgroup_size = self.pipeline.subgroup_size;
        }
        program.begin(&mut running.batch, Mask::first(lanes.len()), self.pipeline.budget);
        for (lane, entry) in lanes.iter().enumerate() {
            running.give(running.data, lane, &entry.payload);
            running.give(running.attributes, lane, &entry.attributes);
        }
        self.push(running);
    }

    /// Puts a shader on the stack that the rays of the trace there wait for.
    fn enter_traced(&mut self, waiting: Waiting) {
        let mut running = self.ready(waiting.shader, waiting.role);
        let program = &*self.pipeline.programs[waiting.shader.0 as usize];
        let Some(Level::Trace { trace, .. }) = self.levels.last() else {
            unreachable!("bug in anyhit: a shader outside a trace");
        };
        let count = waiting.lanes.len();
        for ((lane, record, through), invocation) in
            waiting.lanes.into_iter().zip(&mut running.batch.invocations)
        {
            running.callers.push(lane);
            trace.ray(lane).show(waiting.role, program, record, invocation);
            invocation.called_through = through;
            invocation.subgroup_size = self.pipeline.subgroup_size;
        }
        program.begin(&mut running.batch, Mask::first(count), self.pipeline.budget);
        for at in 0..count {
            let ray = trace.ray(running.callers[at]);
            running.give(running.data, at, &ray.query.payload);
            if running.attributes.is_some() {
                running.give(running.attributes, at, &ray.shown_attributes(waiting.role));
            }
        }
        self.push(running);
    }

    /// A batch of a shader without lanes.
    fn ready(&mut self, shader: Shader, role: Role) -> Box<Running<W>> {
        let mut running = self.spare[shader.0 as usize].pop().unwrap_or_else(|| {
            let program = &*self.pipeline.programs[shader.0 as usize];
            let data = match role {
                Role::Callable => program.interface_rows(storage::INCOMING_CALLABLE_DATA),
                _ => program.interface_rows(storage::INCOMING_RAY_PAYLOAD),
            };
            Box::new(Running {
                shader,
                role,
                batch: program.batch(),
                callers: Vec::new(),
                data: data.map(InterfaceRows::rows),
                attributes: program.interface_rows(storage::HIT_ATTRIBUTE).map(InterfaceRows::rows),
            })
        });
        running.role = role;
        running.callers.clear();
        running
    }

    /// Puts a batch on the stack whose lanes have begun.
    fn push(&mut self, mut running: Box<Running<W>>) {
        let program = &*self.pipeline.programs[running.shader.0 as usize];
        let mask = Mask::<W>::first(running.callers.len());
        self.stats.count(program.stage, mask.count());
        if T::ACTIVE {
            running.batch.queries.told = T::QUERIES.then(Vec::new);
            running.batch.queries.traversal = T::TRAVERSAL;
            for lane in mask.lanes() {
                let read =
                    |first: Reg, count| running.batch.registers.lane_words(first, count, lane).collect();
                let rows =
                    |rows: Option<Rows>| rows.map_or_else(Vec::new, |rows| read(rows.first, rows.count));
                self.witness.invocation(running.batch.invocations[lane].launch_id);
                self.witness.event(Event::Enter {
                    shader: running.shader,
                    stage: program.stage,
                    builtins: program
                        .inputs
                        .iter()
                        .map(|rows| (rows.builtin, read(rows.first, rows.count)))
                        .collect(),
                    payload: rows(running.data),
                    attributes: rows(running.attributes),
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
                    trace.deliver(running.role, caller, running.data, &running.batch, lane);
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
                    report.deliver(
                        trace,
                        &mut below.batch,
                        caller,
                        running.data,
                        &running.batch,
                        lane,
                        witness,
                    );
                }
                _ => unreachable!("bug in anyhit: a shader without a caller"),
            }
        }
        self.spare[running.shader.0 as usize].push(running);
    }

    pub(super) fn spare_trace(&mut self, shades: bool) -> Box<Trace> {
        let mut trace = self.spare_traces.pop().unwrap_or_default();
        trace.clear(shades);
        trace.watched = T::ACTIVE || O::active();
        trace.pipeline_flags = self.pipeline.flags.ray_flags();
        trace
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
                below.batch.trap(Mask::lane(entry.caller), TrapCode::CallablesTooDeep, op);
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
}

/// Callables may nest this deep: Vulkan sets no limit but the stack's size.
const CALL_LIMIT: u64 = 1024;

impl Stats {
    /// Counts a batch of a stage.
    pub(super) fn count(&mut self, stage: Stage, lanes: u32) {
        let entry = self.shaders.entry(stage).or_default();
        entry.batches += 1;
        entry.invocations += u64::from(lanes);
    }
}
