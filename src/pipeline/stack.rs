//! The stack of shader calls: shaders that run or wait, and between them the traces, calls and
//! reports that they wait for.

use std::ops::Range;
use std::sync::Arc;

use crate::accel::Tlas;
use crate::error::{Error, ErrorKind};
use crate::interp;
use crate::machine::object::ObjectRef;
use crate::machine::stop::RegSpan;
use crate::machine::{
    Batch, Bindings, Exit, Invocation, Lanes, Mask, Observer, Reg, Registers, Resources, Stop, TaskWatch,
    Trap, TrapCode,
};
use crate::module::interface::Stage;
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::ops::pointer::storage;
use crate::ops::translate::InterfaceRegisters;
use crate::pipeline::Pipeline;
use crate::pipeline::group::Shader;
use crate::pipeline::launch::{RayOperands, Stats};
use crate::pipeline::observer::{Caller, Event, PipelineObserver};
use crate::pipeline::order::Order;
use crate::pipeline::payload;
use crate::pipeline::report::IntersectionReport;
use crate::pipeline::sbt::Record;
use crate::pipeline::trace::{Data, Trace, Waiting, at, general};
use crate::pipeline::trapped::{Trapped, limit_note};
use crate::program::Program;

/// The role in which a shader runs.
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

/// A shader that runs or waits. Its lanes are the lanes of its caller that called it.
#[derive(Clone, Debug)]
pub(super) struct Running<const W: usize> {
    pub shader: Shader,
    role: Role,
    pub batch: Batch<W>,
    lanes: Mask<W>,
    /// The registers of the payload, or of callable data.
    data: Option<RegSpan>,
    attributes: Option<RegSpan>,
}

impl<const W: usize> Running<W> {
    /// Copies the payload (or callable data) from a caller's registers.
    fn take_data(&mut self, from: &Registers<W>, span: RegSpan) {
        if let Some(own) = self.data {
            let count = own.count.min(span.count);
            // Nothing reads the other lanes.
            self.batch.registers.copy_span(own.first, from, span.first, count, Mask::ALL);
        }
    }

    /// Copies the payload (or callable data) back to a caller's registers.
    fn leave_data(&self, to: &mut Registers<W>, span: RegSpan) {
        if let Some(own) = self.data {
            let count = own.count.min(span.count);
            to.copy_span(span.first, &self.batch.registers, own.first, count, self.lanes);
        }
    }

    /// The registers of its hit attributes.
    fn attributes(&mut self) -> Option<&mut [Lanes<W>]> {
        self.attributes.map(|span| self.batch.registers.span_mut(span.first, span.count))
    }
}

/// `OpExecuteCallableKHR` in progress.
#[derive(Clone, Debug)]
pub(super) struct Call<const W: usize> {
    /// The register of the record indices.
    index: Reg,
    data: RegSpan,
    /// Callable shaders and the lanes that call them.
    waiting: Vec<(Shader, Mask<W>)>,
}

/// One frame of the stack of shader calls: a shader that runs, or what it waits for.
#[derive(Clone, Debug)]
pub(super) enum ShaderCallFrame<const W: usize> {
    Shader(Box<Running<W>>),
    /// `object`: the hit objects that receive the result, if any.
    Trace {
        trace: Box<Trace<W>>,
        payload: RegSpan,
        object: Option<ObjectRef>,
    },
    Call(Call<W>),
    Report(Box<IntersectionReport<W>>),
}

/// Runs the shaders of one batch of a launch, or of one ray.
pub(super) struct Stack<'a, const W: usize, T, O> {
    pub pipeline: &'a Pipeline,
    pub bindings: &'a [Bindings],
    pub pipeline_observer: &'a mut T,
    pub observer: &'a mut O,
    pub stats: Stats,
    /// The trap of the lowest launch index.
    pub trapped: Option<Trapped>,
    pub frames: Vec<ShaderCallFrame<W>>,
    /// What ends the launch; `None` where one shader runs by itself.
    pub watch: Option<Arc<TaskWatch>>,
    /// Batches whose memory can be used again, by shader.
    free_batches: Vec<Vec<Box<Running<W>>>>,
    /// Traces whose memory can be used again.
    #[allow(clippy::vec_box, reason = "the boxes are what is used again")]
    pub free_traces: Vec<Box<Trace<W>>>,
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

impl<'a, const W: usize, T: PipelineObserver, O: Observer<W>> Stack<'a, W, T, O>
where
    LaneKernel: Width<W>,
{
    pub fn new(
        pipeline: &'a Pipeline,
        bindings: &'a [Bindings],
        pipeline_observer: &'a mut T,
        observer: &'a mut O,
    ) -> Self {
        let free_batches = pipeline.programs.iter().map(|_| Vec::new()).collect();
        Self {
            pipeline,
            bindings,
            pipeline_observer,
            observer,
            stats: Stats::default(),
            trapped: None,
            frames: Vec::new(),
            watch: None,
            free_batches,
            free_traces: Vec::new(),
        }
    }

    /// Returns the stack under the watch of a launch.
    pub fn watched(self, watch: Arc<TaskWatch>) -> Self {
        Self { watch: Some(watch), ..self }
    }

    /// Runs the ray generation shader for the invocations at a range of positions, batch by batch,
    /// up to one that a limit stops.
    pub fn launch_all(&mut self, record: &Record, order: &Order, positions: Range<u64>) {
        for start in positions.clone().step_by(W) {
            let batch = start..positions.end.min(start + W as u64);
            if let Some(watch) = &self.watch {
                if watch.is_over() {
                    break;
                }
                if watch.is_beyond(order.least_number(&batch)) {
                    continue;
                }
                watch.begin_batch();
            }
            self.launch(record, order, batch);
        }
    }

    /// Runs the ray generation shader for one batch: the invocations at a range of positions in a
    /// launch's order.
    pub fn launch(&mut self, record: &Record, order: &Order, positions: Range<u64>) {
        let count = (positions.end - positions.start) as usize;
        let Some(shader) = general(self.pipeline, record) else { return };
        let mut running = self.ready(shader, Role::RayGeneration);
        let record = record.shader_record();
        let invocations = &mut running.batch.invocations;
        invocations.launch_size = order.size();
        let mut lane = 0;
        for (first, run) in order.lines(positions) {
            invocations.set_line(lane, first, run);
            lane += run;
        }
        (0..count).for_each(|lane| invocations.set_record(lane, record.as_ref()));
        begin(self.pipeline, &mut running, Mask::first(count));
        self.push(running);
        self.run();
    }

    /// Runs any shader but an intersection shader for one invocation, without a caller.
    pub fn invoke(&mut self, shader: Shader, invocation: Invocation, payload: Data, attributes: Data) {
        let role = match self.pipeline.programs[shader.0 as usize].stage {
            Stage::RayGeneration => Role::RayGeneration,
            Stage::AnyHit => Role::AnyHit,
            Stage::ClosestHit => Role::ClosestHit,
            Stage::Callable => Role::Callable,
            _ => Role::Miss,
        };
        let mut running = self.ready(shader, role);
        running.batch.invocations.set(0, invocation);
        begin(self.pipeline, &mut running, Mask::lane(0));
        for (span, words) in [(running.data, payload), (running.attributes, attributes)] {
            if let Some(span) = span {
                let words = words.into_iter().take(span.count as usize);
                running.batch.registers.set_lane_words(span.first, 0, words);
            }
        }
        self.push(running);
        self.run();
    }

    /// Traces one ray without a ray generation shader, in the first lane; returns the finished
    /// trace.
    pub fn trace(&mut self, tlas: &Arc<Tlas>, operands: RayOperands) -> Option<Box<Trace<W>>> {
        let mut trace = self.spare_trace(true);
        let payload = trace.take_host_operands(tlas, operands);
        self.push_trace(trace, payload, None);
        self.run()
    }

    /// Runs until the stack is empty; returns the trace if it has no caller.
    fn run(&mut self) -> Option<Box<Trace<W>>> {
        loop {
            if self.watch.is_some() && self.is_over() {
                self.abandon();
                return None;
            }
            match self.frames.last_mut()? {
                ShaderCallFrame::Shader(running) => {
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
                        && let Some(events) = &mut running.batch.queries.events
                    {
                        events
                            .drain(..)
                            .for_each(|event| self.pipeline_observer.event(Event::RayQuery(event)));
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
                ShaderCallFrame::Trace { .. } => {
                    if let Some(trace) = self.advance_trace() {
                        return Some(trace);
                    }
                }
                ShaderCallFrame::Call(_) => self.advance_call(),
                ShaderCallFrame::Report(_) => self.advance_report(),
            }
        }
    }

    /// Pushes a shader that rays of the trace on top of the stack wait for.
    pub(super) fn enter_traced(&mut self, waiting: Waiting<W>) {
        let Waiting { shader, role, lanes } = waiting;
        let mut running = self.ready(shader, role);
        let [below @ .., ShaderCallFrame::Trace { trace, payload, .. }] = &mut self.frames[..] else {
            unreachable!("bug in anyhit: a shader outside a trace");
        };
        trace.write_builtins(self.pipeline, role, lanes, &mut running.batch.invocations);
        begin(self.pipeline, &mut running, lanes);
        running.take_data(trace.payload(below), *payload);
        if let Some(attributes) = running.attributes() {
            trace.write_hit_attributes(role, lanes, attributes);
        }
        self.push(running);
    }

    /// A batch for a shader, without lanes yet.
    fn ready(&mut self, shader: Shader, role: Role) -> Box<Running<W>> {
        let mut running = self.free_batches[shader.0 as usize].pop().unwrap_or_else(|| {
            let program = &*self.pipeline.programs[shader.0 as usize];
            let data = match role {
                Role::Callable => program.interface_registers(storage::INCOMING_CALLABLE_DATA),
                _ => program.interface_registers(storage::INCOMING_RAY_PAYLOAD),
            };
            Box::new(Running {
                shader,
                role,
                batch: program.batch(),
                lanes: Mask::NONE,
                data: data.map(InterfaceRegisters::span),
                attributes: program.interface_registers(storage::HIT_ATTRIBUTE).map(InterfaceRegisters::span),
            })
        });
        if let Some(watch) = &self.watch {
            match running.batch.watch {
                None => running.batch.watch = Some(watch.clone()),
                Some(_) if watch.expired().is_some() => running.batch.look_soon(),
                Some(_) => {}
            }
        }
        running.role = role;
        running.batch.invocations.subgroup_size = self.pipeline.subgroup_size;
        running
    }

    /// Pushes a batch whose lanes have begun.
    fn push(&mut self, mut running: Box<Running<W>>) {
        let program = &*self.pipeline.programs[running.shader.0 as usize];
        let mask = running.lanes;
        self.stats.count(program.stage, mask.count());
        if let Some(watch) = &self.watch {
            watch.charge(u64::from(program.entry_cost()) * u64::from(mask.count()));
        }
        if T::ACTIVE {
            running.batch.queries.events = T::QUERIES.then(Vec::new);
            running.batch.queries.records_traversal = T::TRAVERSAL;
            for lane in mask.lanes() {
                let read =
                    |first: Reg, count| running.batch.registers.lane_words(first, count, lane).collect();
                let words =
                    |span: Option<RegSpan>| span.map_or_else(Vec::new, |span| read(span.first, span.count));
                self.pipeline_observer.invocation(running.batch.invocations.launch_id(lane));
                self.pipeline_observer.event(Event::Enter {
                    shader: running.shader,
                    stage: program.stage,
                    builtins: program
                        .inputs
                        .iter()
                        .map(|input| (input.builtin, read(input.first, input.count)))
                        .collect(),
                    payload: words(running.data),
                    attributes: words(running.attributes),
                });
            }
        }
        self.frames.push(ShaderCallFrame::Shader(running));
    }

    /// Whether a limit of the launch is passed, and its grace.
    fn is_over(&self) -> bool {
        let Some(watch) = &self.watch else { return false };
        watch.look_at_clock();
        watch.step_behind().is_some()
    }

    /// Ends all that runs and waits, with the report of the innermost shader.
    fn abandon(&mut self) {
        let code = self.watch.as_ref().and_then(|watch| watch.expired());
        let told = self.trapped.as_ref().map(|trapped| trapped.code) == code;
        while let (Some(code), Some(frame)) = (code, self.frames.pop()) {
            let ShaderCallFrame::Shader(running) = frame else { continue };
            let live = running.batch.live().lanes();
            let first = live.min_by_key(|&lane| running.batch.invocations.number(lane));
            if let Some(lane) = first.filter(|_| !told) {
                self.trap(&running, lane, Trap { code, op: running.batch.op.saturating_sub(1) });
                break;
            }
        }
        self.frames.clear();
        if let (Some(code), Some(watch), None) = (code, &self.watch, &self.trapped) {
            // A ray that no shader has traced.
            let note = limit_note(code, self.pipeline.fuel, Some(watch.watchdog()));
            let error = note.into_iter().fold(Error::new(ErrorKind::Trap, code.message()), Error::note);
            self.trapped = Some(Trapped {
                launch_id: [0; 3],
                code,
                fault_value: 0,
                shader: Shader(0),
                offset: 0,
                error,
            });
        }
    }

    /// Pops a shader that is done and passes its results to its caller.
    fn leave(&mut self) {
        let pipeline = self.pipeline;
        let Some(ShaderCallFrame::Shader(mut running)) = self.frames.pop() else {
            unreachable!("bug in anyhit: what ends is no shader");
        };
        let program = &*pipeline.programs[running.shader.0 as usize];
        self.stats.ray_queries += running.batch.queries.initialized;
        self.stats.reorders += running.batch.reorders;
        if let Some(watch) = &self.watch {
            watch.charge(running.batch.take_charged());
        }
        for lane in running.lanes.lanes() {
            let exit = running.batch.exits[lane];
            if let Exit::Trapped(trap) = exit {
                self.trap(&running, lane, trap);
            }
            if T::ACTIVE {
                let payload = running.data.map_or_else(Vec::new, |span| {
                    running.batch.registers.lane_words(span.first, span.count, lane).collect()
                });
                let (shader, stage) = (running.shader, program.stage);
                self.pipeline_observer.invocation(running.batch.invocations.launch_id(lane));
                self.pipeline_observer.event(Event::Leave { shader, stage, exit, payload });
            }
        }
        let (lanes, batch) = (running.lanes, &running.batch);
        match &mut self.frames[..] {
            [] => {}
            [below @ .., ShaderCallFrame::Trace { trace, payload, .. }] => {
                running.leave_data(trace.payload(below), *payload);
                trace.deliver(running.role, lanes, batch);
            }
            [.., ShaderCallFrame::Shader(below), ShaderCallFrame::Call(call)] => {
                running.leave_data(&mut below.batch.registers, call.data);
                for lane in lanes.lanes().filter(|&lane| matches!(batch.exits[lane], Exit::Trapped(_))) {
                    let op = below.batch.op - 1;
                    below.batch.trap(Mask::lane(lane), TrapCode::Callee, op);
                }
            }
            [
                below @ ..,
                ShaderCallFrame::Trace { trace, payload, .. },
                ShaderCallFrame::Shader(intersection),
                ShaderCallFrame::Report(report),
            ] => {
                running.leave_data(trace.payload(below), *payload);
                report.deliver(trace, &mut intersection.batch, (batch, lanes), self.pipeline_observer);
            }
            _ => unreachable!("bug in anyhit: a shader without a caller"),
        }
        self.free_batches[running.shader.0 as usize].push(running);
    }

    fn begin_call(&mut self, mask: Mask<W>, index: Reg, data: RegSpan) {
        let Some(ShaderCallFrame::Shader(running)) = self.frames.last_mut() else { return };
        let mut waiting: Vec<(Shader, Mask<W>)> = Vec::new();
        for lane in mask.lanes() {
            let Some(record) =
                self.pipeline.sbt.callable.get(running.batch.registers[index].0[lane] as usize)
            else {
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
                    self.pipeline_observer.invocation(running.batch.invocations.launch_id(lane));
                    self.pipeline_observer.absent(caller, &mut words);
                    registers.set_lane_words(data.first, lane, words);
                }
                continue;
            };
            match waiting.iter_mut().find(|group| group.0 == shader) {
                Some(group) => group.1 = group.1 | Mask::lane(lane),
                None => waiting.push((shader, Mask::lane(lane))),
            }
        }
        waiting.reverse();
        self.frames.push(ShaderCallFrame::Call(Call { index, data, waiting }));
    }

    /// How many callable shaders are in progress.
    fn callable_depth(&self) -> u32 {
        let is_callable = |frame: &&ShaderCallFrame<W>| matches!(frame, ShaderCallFrame::Shader(running) if running.role == Role::Callable);
        self.frames.iter().rev().filter(is_callable).count() as u32
    }

    fn advance_call(&mut self) {
        let deep = self.callable_depth() >= self.pipeline.max_callable_depth;
        let [.., ShaderCallFrame::Shader(below), ShaderCallFrame::Call(call)] = &mut self.frames[..] else {
            unreachable!("bug in anyhit: a call without a caller");
        };
        let Some((shader, lanes)) = call.waiting.pop() else {
            self.frames.pop();
            return;
        };
        if deep {
            let op = below.batch.op - 1;
            below.batch.trap(lanes, TrapCode::CallablesTooDeep, op);
            return;
        }
        let (data, index) = (call.data, call.index);
        let given = payload::scalars_given(&self.pipeline.programs[below.shader.0 as usize], data);
        if !payload::takes(&self.pipeline.programs[shader.0 as usize], given) {
            let op = below.batch.op - 1;
            lanes.lanes().for_each(|lane| below.batch.fault_value[lane] = shader.0.into());
            below.batch.trap(lanes, TrapCode::PayloadMismatch, op);
            return;
        }
        let mut running = self.ready(shader, Role::Callable);
        let [.., ShaderCallFrame::Shader(below), ShaderCallFrame::Call(_)] = &self.frames[..] else { return };
        let (from, to) = (&below.batch.invocations, &mut running.batch.invocations);
        to.take_places(from);
        to.depth = from.depth;
        for lane in lanes.lanes() {
            let index = u64::from(below.batch.registers[index].0[lane]);
            to.called_through[lane] = index;
            let record = at(&self.pipeline.sbt.callable, index).and_then(Record::shader_record);
            to.set_record(lane, record.as_ref());
        }
        begin(self.pipeline, &mut running, lanes);
        running.take_data(&below.batch.registers, data);
        self.push(running);
    }

    fn begin_report(&mut self, operands: (Mask<W>, Reg, Reg, Reg)) {
        let [.., ShaderCallFrame::Trace { trace, .. }, ShaderCallFrame::Shader(running)] =
            &mut self.frames[..]
        else {
            unreachable!("bug in anyhit: a report outside a trace");
        };
        let program = &self.pipeline.programs[running.shader.0 as usize];
        let report = IntersectionReport::new(
            self.pipeline,
            trace,
            program,
            &mut running.batch,
            operands,
            self.pipeline_observer,
        );
        self.frames.push(ShaderCallFrame::Report(Box::new(report)));
    }

    fn advance_report(&mut self) {
        let [.., ShaderCallFrame::Shader(running), ShaderCallFrame::Report(report)] = &mut self.frames[..]
        else {
            unreachable!("bug in anyhit: a report outside a trace");
        };
        match report.advance() {
            Some((shader, lanes)) => self.enter_reported(shader, lanes),
            None => {
                // RayTmaxKHR may have shrunk.
                let program = &self.pipeline.programs[running.shader.0 as usize];
                program.refresh_inputs(&mut running.batch, Mask::ALL, true);
                self.frames.pop();
            }
        }
    }

    /// Pushes an any-hit shader that decides on reports.
    fn enter_reported(&mut self, shader: Shader, lanes: Mask<W>) {
        let role = Role::ReportedAnyHit;
        let mut running = self.ready(shader, role);
        let [
            below @ ..,
            ShaderCallFrame::Trace { trace, payload, .. },
            ShaderCallFrame::Shader(_),
            ShaderCallFrame::Report(report),
        ] = &mut self.frames[..]
        else {
            unreachable!("bug in anyhit: a report outside a trace");
        };
        trace.write_builtins(self.pipeline, role, lanes, &mut running.batch.invocations);
        report.write_builtins(lanes, &mut running.batch);
        begin(self.pipeline, &mut running, lanes);
        running.take_data(trace.payload(below), *payload);
        if let Some(attributes) = running.attributes() {
            report.write_hit_attributes(lanes, attributes);
        }
        self.push(running);
    }
}

/// Begins the lanes of a batch, whose invocations are set.
fn begin<const W: usize>(pipeline: &Pipeline, running: &mut Running<W>, lanes: Mask<W>) {
    let program = &pipeline.programs[running.shader.0 as usize];
    running.lanes = lanes;
    program.begin(&mut running.batch, lanes, pipeline.fuel);
}

impl Stats {
    /// Counts a batch of a stage and its lanes.
    pub(super) fn count(&mut self, stage: Stage, lanes: u32) {
        let entry = self.shaders.entry(stage).or_default();
        entry.batches += 1;
        entry.invocations += u64::from(lanes);
    }
}
