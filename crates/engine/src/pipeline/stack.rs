//! The stack of shader calls: shaders that run or wait, and between them the traces, callable calls
//! and reports that they wait for.

use std::ops::Range;
use std::sync::Arc;

use crate::accel::{RecordIndex, Tlas};
use crate::interp;
use crate::machine::object::ObjectRef;
use crate::machine::stop::RegSpan;
use crate::machine::{
    Batch, Bindings, Exit, Invocation, LaneTrap, Lanes, Mask, Observer, Reg, Registers, Resources,
    ShaderIndex, Stop, TaskWatch, TrapCode,
};
use crate::module::interface::Stage;
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::ops::pointer::storage;
use crate::ops::translate::InterfaceRegisters;
use crate::pipeline::group::Role;
use crate::pipeline::host_ray::RayOperands;
use crate::pipeline::observer::{Caller, Event, EventReceiver, PipelineObserver};
use crate::pipeline::order::InvocationOrder;
use crate::pipeline::report::{IntersectionReport, ReportRegisters};
use crate::pipeline::sbt::SbtRecord;
use crate::pipeline::stats::Stats;
use crate::pipeline::trace::{PendingCall, Trace, Words, general_shader, record_at};
use crate::pipeline::trapped::{Trapped, ended_without_shader};
use crate::pipeline::{Pipeline, payload};
use crate::program::Program;

/// A shader that runs or waits, in the lanes of its caller that called it.
#[derive(Clone, Debug)]
pub(super) struct RunningShader<const W: usize> {
    pub shader: ShaderIndex,
    /// Number of shaders below it in the stack.
    pub number: usize,
    role: Role,
    pub batch: Batch<W>,
    lanes: Mask<W>,
    /// The registers of the incoming payload or callable data.
    data: Option<RegSpan>,
    attributes: Option<RegSpan>,
}

impl<const W: usize> RunningShader<W> {
    /// Copies the payload (or callable data) in from the caller's registers.
    fn copy_data_in(&mut self, from: &Registers<W>, span: RegSpan) {
        if let Some(own) = self.data {
            let count = own.count.min(span.count);
            // All lanes are copied: nothing reads those that did not call.
            self.batch.registers.copy_span(own.first, from, span.first, count, Mask::ALL);
        }
    }

    /// Copies the payload (or callable data) out to the caller's registers.
    fn copy_data_out(&self, to: &mut Registers<W>, span: RegSpan) {
        if let Some(own) = self.data {
            let count = own.count.min(span.count);
            to.copy_span(span.first, &self.batch.registers, own.first, count, self.lanes);
        }
    }

    /// The registers of the hit attributes.
    fn attributes(&mut self) -> Option<&mut [Lanes<W>]> {
        self.attributes.map(|span| self.batch.registers.span_mut(span.first, span.count))
    }
}

/// `OpExecuteCallableKHR` in progress.
#[derive(Clone, Debug)]
pub(super) struct ExecuteCallable<const W: usize> {
    /// The register of the callable records' indices.
    index: Reg,
    data: RegSpan,
    /// Number of callable shaders in progress below it.
    depth: u32,
    /// The callable shaders still to run, and the lanes that call them.
    pending: Vec<(ShaderIndex, Mask<W>)>,
}

/// One frame of the stack of shader calls: a shader that runs, or what it waits for.
#[derive(Clone, Debug)]
pub(super) enum ShaderCallFrame<const W: usize> {
    Shader(Box<RunningShader<W>>),
    /// A trace. `object` is the variable of hit objects that receive the result, if any.
    Trace {
        trace: Box<Trace<W>>,
        payload: RegSpan,
        object: Option<ObjectRef>,
    },
    ExecuteCallable(ExecuteCallable<W>),
    Report(Box<IntersectionReport<W>>),
}

/// The observer of the operations of a pipeline's shaders, if there is one.
pub(super) type OperationObserver<'a, const W: usize> = Option<&'a mut dyn Observer<W>>;

/// Runs the shaders of one batch of a launch, or of one ray.
pub(super) struct Stack<'a, const W: usize> {
    pub pipeline: &'a Pipeline,
    pub bindings: &'a [Bindings],
    pub pipeline_observer: EventReceiver<'a>,
    pub observer: OperationObserver<'a, W>,
    pub stats: Stats,
    /// The trap of the lowest launch index.
    pub trapped: Option<Trapped>,
    pub frames: Vec<ShaderCallFrame<W>>,
    /// Bytes of registers, for each invocation, of the shaders in the frames.
    pub stack_size: u64,
    /// What ends the launch; `None` where one shader runs by itself.
    pub watch: Option<Arc<TaskWatch>>,
    /// By shader, the batches whose memory can be reused.
    free_batches: Vec<Vec<Box<RunningShader<W>>>>,
    /// Traces whose memory can be reused.
    #[allow(clippy::vec_box, reason = "the boxes are what is reused")]
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
    let of = |(shader, program): (usize, &Arc<Program>)| {
        let mut bindings = resources.bindings(program.bindings());
        bindings.memory = memory.clone();
        bindings.choices =
            bindings.choices.map(|choices| Arc::new(choices.in_shader(ShaderIndex::new(shader))));
        bindings
    };
    pipeline.programs.iter().enumerate().map(of).collect()
}

impl<'a, const W: usize> Stack<'a, W>
where
    LaneKernel: Width<W>,
{
    pub(super) fn new(
        pipeline: &'a Pipeline,
        bindings: &'a [Bindings],
        pipeline_observer: Option<&'a mut (dyn PipelineObserver + '_)>,
        observer: Option<&'a mut (dyn Observer<W> + '_)>,
    ) -> Self {
        let free_batches = pipeline.programs.iter().map(|_| Vec::new()).collect();
        Self {
            pipeline,
            bindings,
            pipeline_observer: pipeline_observer.map(|observer| observer as _),
            observer: observer.map(|observer| observer as _),
            stats: Stats::default(),
            trapped: None,
            frames: Vec::new(),
            stack_size: 0,
            watch: None,
            free_batches,
            free_traces: Vec::new(),
        }
    }

    /// Returns the stack under the watch of a launch.
    pub(super) fn watched(self, watch: Arc<TaskWatch>) -> Self {
        Self { watch: Some(watch), ..self }
    }

    /// Runs the ray generation shader for the invocations at a range of positions, batch by batch,
    /// up to one that a limit stops.
    pub(super) fn launch_batches(
        &mut self,
        record: &SbtRecord,
        order: &InvocationOrder,
        positions: Range<u64>,
    ) {
        for start in positions.clone().step_by(W) {
            let batch = start..positions.end.min(start + W as u64);
            if let Some(watch) = &self.watch {
                if watch.is_over() {
                    break;
                }
                if watch.is_beyond(order.min_linear_index(&batch)) {
                    continue;
                }
                watch.begin_batch();
            }
            self.launch_batch(record, order, batch);
        }
    }

    /// Runs the ray generation shader for one batch: the invocations at a range of positions in a
    /// launch's order.
    pub(super) fn launch_batch(
        &mut self,
        record: &SbtRecord,
        order: &InvocationOrder,
        positions: Range<u64>,
    ) {
        let count = (positions.end - positions.start) as usize;
        let Some(shader) = general_shader(self.pipeline, record) else { return };
        let mut running = self.acquire_batch(shader, Role::RayGeneration);
        let record = record.shader_record();
        let invocations = &mut running.batch.invocations;
        invocations.launch_size = order.size();
        let mut lane = 0;
        for (first, run) in order.scanline_runs(positions) {
            invocations.set_launch_ids(lane, first, run);
            lane += run;
        }
        (0..count).for_each(|lane| invocations.set_record(lane, record.as_ref()));
        begin(self.pipeline, &mut self.observer, &mut running, Mask::first(count));
        self.push_shader(running);
        self.run();
    }

    /// Runs one invocation of a shader that is no intersection shader, without a caller.
    pub(super) fn invoke(
        &mut self,
        shader: ShaderIndex,
        invocation: Invocation,
        payload: Words,
        attributes: Words,
    ) {
        let role = match self.pipeline.programs[shader.index()].stage {
            Stage::RayGeneration => Role::RayGeneration,
            Stage::AnyHit => Role::AnyHit,
            Stage::ClosestHit => Role::ClosestHit,
            Stage::Callable => Role::Callable,
            _ => Role::Miss,
        };
        let mut running = self.acquire_batch(shader, role);
        running.batch.invocations.set(0, invocation);
        begin(self.pipeline, &mut self.observer, &mut running, Mask::lane(0));
        for (span, words) in [(running.data, payload), (running.attributes, attributes)] {
            if let Some(span) = span {
                let words = words.into_iter().take(span.count as usize);
                running.batch.registers.set_lane_words(span.first, 0, words);
            }
        }
        self.push_shader(running);
        self.run();
    }

    /// Traces one ray from the host in the first lane; returns the finished trace.
    pub(super) fn trace(&mut self, tlas: &Arc<Tlas>, operands: RayOperands) -> Option<Box<Trace<W>>> {
        let mut trace = self.acquire_trace(true);
        let payload = trace.set_host_operands(tlas, operands, self.observer.is_some());
        self.push_trace(trace, payload, None);
        self.run()
    }

    /// Runs until the stack is empty, or until the observer pauses it; returns the finished trace
    /// if the host called it.
    pub(super) fn run(&mut self) -> Option<Box<Trace<W>>> {
        loop {
            if self.watch.is_some() && self.is_over() {
                self.abandon();
                return None;
            }
            match self.frames.last_mut()? {
                ShaderCallFrame::Shader(running) => {
                    let program = &self.pipeline.programs[running.shader.index()];
                    let bindings = &self.bindings[running.shader.index()];
                    let stop = match &mut self.observer {
                        None => interp::run(&mut running.batch, program, bindings, &mut ()),
                        Some(observer) => interp::run_shader(
                            running.shader,
                            &mut running.batch,
                            program,
                            bindings,
                            observer,
                        ),
                    };
                    if let (Some(observer), Some(events)) =
                        (&mut self.pipeline_observer, &mut running.batch.queries.events)
                    {
                        for event in events.drain(..) {
                            let id = running.batch.invocations.launch_id(event.lane as usize);
                            observer.invocation(id);
                            observer.event(Event::RayQuery(event));
                        }
                    }
                    match stop {
                        Stop::Done => self.pop_shader(),
                        Stop::TraceRay { mask, operands, payload } => {
                            self.begin_trace(mask, operands, payload, None);
                        }
                        Stop::HitObjectTrace { mask, object, operands, payload } => {
                            self.begin_trace(mask, operands, payload, Some(object));
                        }
                        Stop::HitObjectExecute { mask, object, payload } => {
                            self.begin_hit_object_execute(mask, object, payload);
                        }
                        Stop::HitObjectRecordHandle { mask, object, to } => {
                            self.record_handle(mask, object, to);
                        }
                        Stop::ExecuteCallable { mask, index, data } => {
                            self.begin_execute_callable(mask, index, data)
                        }
                        Stop::ReportIntersection { mask, t, hit_kind, accepted } => {
                            self.begin_report(mask, ReportRegisters { t, hit_kind, accepted });
                        }
                        Stop::Paused => return None,
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
                ShaderCallFrame::ExecuteCallable(_) => self.advance_execute_callable(),
                ShaderCallFrame::Report(_) => self.advance_report(),
            }
        }
    }

    /// Pushes a shader that rays of the trace on top of the stack call.
    pub(super) fn push_traced_shader(&mut self, call: PendingCall<W>) {
        let PendingCall { shader, role, lanes } = call;
        let mut running = self.acquire_batch(shader, role);
        let [below @ .., ShaderCallFrame::Trace { trace, payload, .. }] = &mut self.frames[..] else {
            unreachable!("bug in anyhit: a shader outside a trace");
        };
        trace.write_builtins(self.pipeline, role, lanes, &mut running.batch.invocations);
        begin(self.pipeline, &mut self.observer, &mut running, lanes);
        running.copy_data_in(trace.payload(below), *payload);
        if let Some(attributes) = running.attributes() {
            trace.write_hit_attributes(role, lanes, attributes);
        }
        self.push_shader(running);
    }

    /// Takes a free batch for a shader, or makes one; no lane runs yet.
    fn acquire_batch(&mut self, shader: ShaderIndex, role: Role) -> Box<RunningShader<W>> {
        let mut running = self.free_batches[shader.index()].pop().unwrap_or_else(|| {
            let program = &*self.pipeline.programs[shader.index()];
            let data = match role {
                Role::Callable => program.interface_registers(storage::INCOMING_CALLABLE_DATA),
                _ => program.interface_registers(storage::INCOMING_RAY_PAYLOAD),
            };
            Box::new(RunningShader {
                shader,
                number: 0,
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

    /// Pushes a shader whose lanes have begun.
    fn push_shader(&mut self, mut running: Box<RunningShader<W>>) {
        let program = &*self.pipeline.programs[running.shader.index()];
        let mask = running.lanes;
        let below = self.frames.iter().rev().find_map(|frame| match frame {
            ShaderCallFrame::Shader(below) => Some(below.number),
            _ => None,
        });
        running.number = below.map_or(0, |below| below + 1);
        self.stack_size += u64::from(program.register_count) * 4;
        self.stats.count(program.stage, mask.count());
        if let Some(watch) = &self.watch {
            watch.charge(u64::from(program.entry_cost()) * u64::from(mask.count()));
        }
        if let Some(observer) = &mut self.pipeline_observer {
            running.batch.queries.events = observer.observes_queries().then(Vec::new);
            running.batch.queries.records_traversal = observer.observes_query_traversal();
            let has_values = observer.observes_values();
            let inputs = if has_values { &program.inputs[..] } else { &[] };
            let push_constants = self.bindings[running.shader.index()].push_constants.as_ref();
            let push_constants = push_constants.filter(|_| has_values);
            for lane in mask.lanes() {
                let read =
                    |first: Reg, count| running.batch.registers.lane_words(first, count, lane).collect();
                let words = |span: Option<RegSpan>| {
                    let span = span.filter(|_| has_values);
                    span.map_or_else(Vec::new, |span| read(span.first, span.count))
                };
                observer.invocation(running.batch.invocations.launch_id(lane));
                observer.event(Event::Enter {
                    shader: running.shader,
                    stage: program.stage,
                    builtins: inputs
                        .iter()
                        .map(|input| (input.builtin, read(input.first, input.count)))
                        .collect(),
                    payload: words(running.data),
                    attributes: words(running.attributes),
                    push_constants: push_constants.cloned(),
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
                self.trap(&running, lane, LaneTrap { code, op: running.batch.stopped_at() });
                break;
            }
        }
        self.frames.clear();
        self.stack_size = 0;
        if let (Some(code), Some(watch), None) = (code, &self.watch, &self.trapped) {
            // A ray that no shader has traced.
            self.trapped = Some(ended_without_shader(code, self.pipeline.fuel, watch.watchdog()));
        }
    }

    /// Pops a shader that has returned, and passes its payload and exits to its caller.
    fn pop_shader(&mut self) {
        let pipeline = self.pipeline;
        let Some(ShaderCallFrame::Shader(mut running)) = self.frames.pop() else {
            unreachable!("bug in anyhit: the returning frame is not a shader");
        };
        let program = &*pipeline.programs[running.shader.index()];
        self.stack_size -= u64::from(program.register_count) * 4;
        self.stats.ray_queries += running.batch.queries.initialized;
        self.stats.zero_directions += running.batch.queries.zero_directions;
        self.stats.reorders += running.batch.reorders;
        if let Some(watch) = &self.watch {
            watch.charge(running.batch.take_charged());
        }
        let told = match &self.pipeline_observer {
            Some(_) => running.lanes,
            None => running.lanes & running.batch.trapped(),
        };
        for lane in told.lanes() {
            let exit = running.batch.exits[lane];
            if let Exit::Trapped(trap) = exit {
                self.trap(&running, lane, trap);
            }
            if let Some(observer) = &mut self.pipeline_observer {
                let data = running.data.filter(|_| observer.observes_values());
                let payload = data.map_or_else(Vec::new, |span| {
                    running.batch.registers.lane_words(span.first, span.count, lane).collect()
                });
                let (shader, stage) = (running.shader, program.stage);
                observer.invocation(running.batch.invocations.launch_id(lane));
                observer.event(Event::Leave { shader, stage, exit, payload });
            }
        }
        let (lanes, batch) = (running.lanes, &running.batch);
        match &mut self.frames[..] {
            [] => {}
            [below @ .., ShaderCallFrame::Trace { trace, payload, .. }] => {
                running.copy_data_out(trace.payload(below), *payload);
                trace.apply_exits(running.role, lanes, batch);
            }
            [.., ShaderCallFrame::Shader(below), ShaderCallFrame::ExecuteCallable(call)] => {
                running.copy_data_out(&mut below.batch.registers, call.data);
                for lane in (lanes & batch.trapped()).lanes() {
                    let op = below.batch.stopped_at();
                    below.batch.trap(Mask::lane(lane), TrapCode::Callee, op);
                }
            }
            [
                below @ ..,
                ShaderCallFrame::Trace { trace, payload, .. },
                ShaderCallFrame::Shader(intersection),
                ShaderCallFrame::Report(report),
            ] => {
                running.copy_data_out(trace.payload(below), *payload);
                let observer = &mut self.pipeline_observer;
                report.apply_any_hit(trace, &mut intersection.batch, batch, lanes, observer);
            }
            _ => unreachable!("bug in anyhit: a shader without a caller"),
        }
        self.free_batches[running.shader.index()].push(running);
    }

    fn begin_execute_callable(&mut self, mask: Mask<W>, index: Reg, data: RegSpan) {
        let Some(ShaderCallFrame::Shader(running)) = self.frames.last_mut() else { return };
        let mut pending: Vec<(ShaderIndex, Mask<W>)> = Vec::new();
        for lane in mask.lanes() {
            let index = RecordIndex(running.batch.registers[index].0[lane].into());
            let Some(record) = index.get(&self.pipeline.sbt.callable) else {
                let op = running.batch.stopped_at();
                running.batch.fault_value[lane] = index.0;
                running.batch.trap(Mask::lane(lane), TrapCode::ShaderRecordMissing, op);
                continue;
            };
            let Some(shader) = record.as_ref().and_then(|record| general_shader(self.pipeline, record))
            else {
                if let Some(observer) = &mut self.pipeline_observer {
                    let caller = Caller {
                        shader: running.shader,
                        op: running.batch.stopped_at(),
                        payload: data.first,
                    };
                    let registers = &mut running.batch.registers;
                    let mut words: Words = registers.lane_words(data.first, data.count, lane).collect();
                    observer.invocation(running.batch.invocations.launch_id(lane));
                    if observer.null_shader(caller, &mut words) {
                        registers.set_lane_words(data.first, lane, words);
                        registers.define(data.first, data.count, Mask::lane(lane));
                    }
                }
                continue;
            };
            match pending.iter_mut().find(|group| group.0 == shader) {
                Some(group) => group.1 = group.1 | Mask::lane(lane),
                None => pending.push((shader, Mask::lane(lane))),
            }
        }
        pending.reverse();
        let around = self.frames.iter().rev().find_map(|frame| match frame {
            ShaderCallFrame::ExecuteCallable(call) => Some(call.depth),
            _ => None,
        });
        let depth = around.map_or(0, |depth| depth + 1);
        self.frames.push(ShaderCallFrame::ExecuteCallable(ExecuteCallable { index, data, depth, pending }));
    }

    /// Whether the shaders in the frames hold so much that none of them may call another.
    pub(super) fn is_full(&self) -> bool {
        self.stack_size > self.pipeline.max_stack_size
    }

    fn advance_execute_callable(&mut self) {
        let is_full = self.is_full();
        let [.., ShaderCallFrame::Shader(below), ShaderCallFrame::ExecuteCallable(call)] =
            &mut self.frames[..]
        else {
            unreachable!("bug in anyhit: a call without a caller");
        };
        let deep = match call.depth >= self.pipeline.max_callable_depth {
            true => Some(TrapCode::CallablesTooDeep),
            false => is_full.then_some(TrapCode::StackOverflow),
        };
        let Some((shader, lanes)) = call.pending.pop() else {
            self.frames.pop();
            return;
        };
        if let Some(code) = deep {
            let op = below.batch.stopped_at();
            below.batch.trap(lanes, code, op);
            return;
        }
        let (data, index) = (call.data, call.index);
        let given = payload::outgoing_scalars(&self.pipeline.programs[below.shader.index()], data);
        if !payload::accepts(&self.pipeline.programs[shader.index()], given) {
            let op = below.batch.stopped_at();
            lanes.lanes().for_each(|lane| below.batch.fault_value[lane] = shader.0.into());
            below.batch.trap(lanes, TrapCode::PayloadMismatch, op);
            return;
        }
        let mut running = self.acquire_batch(shader, Role::Callable);
        let [.., ShaderCallFrame::Shader(below), ShaderCallFrame::ExecuteCallable(_)] = &self.frames[..]
        else {
            return;
        };
        let (from, to) = (&below.batch.invocations, &mut running.batch.invocations);
        to.copy_launch_ids(from);
        to.depth = from.depth;
        for lane in lanes.lanes() {
            let index = RecordIndex(below.batch.registers[index].0[lane].into());
            to.record_indices[lane] = index;
            let record = record_at(&self.pipeline.sbt.callable, index).and_then(SbtRecord::shader_record);
            to.set_record(lane, record.as_ref());
        }
        begin(self.pipeline, &mut self.observer, &mut running, lanes);
        running.copy_data_in(&below.batch.registers, data);
        self.push_shader(running);
    }

    fn begin_report(&mut self, mask: Mask<W>, registers: ReportRegisters) {
        let [.., ShaderCallFrame::Trace { trace, .. }, ShaderCallFrame::Shader(running)] =
            &mut self.frames[..]
        else {
            unreachable!("bug in anyhit: a report outside a trace");
        };
        let program = &self.pipeline.programs[running.shader.index()];
        let report = IntersectionReport::new(
            self.pipeline,
            trace,
            program,
            &mut running.batch,
            mask,
            registers,
            &mut self.pipeline_observer,
        );
        self.frames.push(ShaderCallFrame::Report(Box::new(report)));
    }

    fn advance_report(&mut self) {
        let [.., ShaderCallFrame::Shader(running), ShaderCallFrame::Report(report)] = &mut self.frames[..]
        else {
            unreachable!("bug in anyhit: a report outside a trace");
        };
        match report.advance() {
            Some((shader, lanes)) => self.push_reported_any_hit(shader, lanes),
            None => {
                // An accepted hit lowers RayTmaxKHR.
                let program = &self.pipeline.programs[running.shader.index()];
                program.refresh_inputs(&mut running.batch, Mask::ALL, true);
                self.frames.pop();
            }
        }
    }

    /// Pushes the any-hit shader that decides on reported hits.
    fn push_reported_any_hit(&mut self, shader: ShaderIndex, lanes: Mask<W>) {
        let role = Role::ReportedAnyHit;
        let mut running = self.acquire_batch(shader, role);
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
        begin(self.pipeline, &mut self.observer, &mut running, lanes);
        running.copy_data_in(trace.payload(below), *payload);
        if let Some(attributes) = running.attributes() {
            report.write_hit_attributes(lanes, attributes);
        }
        self.push_shader(running);
    }
}

/// Begins the lanes of a batch. Their invocations must be set.
fn begin<const W: usize>(
    pipeline: &Pipeline,
    observer: &mut OperationObserver<'_, W>,
    running: &mut RunningShader<W>,
    lanes: Mask<W>,
) {
    let program = &pipeline.programs[running.shader.index()];
    running.lanes = lanes;
    program.begin(&mut running.batch, lanes, pipeline.fuel);
    if let Some(observer) = observer {
        observer.began(running.shader, &mut running.batch);
    }
}
