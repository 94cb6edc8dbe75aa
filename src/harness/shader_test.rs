//! One shader, run by itself: no scene, no pipeline, no ray generation shader.

use std::fmt::Debug;
use std::sync::Arc;

use bytemuck::NoUninit;

use crate::accel::{RayFlags, TraceRay};
use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Ray;
use crate::harness::bound::{Bound, blocks};
use crate::harness::data::{Bytes, Data};
use crate::harness::hit::Hit;
use crate::harness::layout::{Layout, Rules};
use crate::harness::memory;
use crate::harness::mock::{Answer, CallableCall, TraceCall, in_turn};
use crate::harness::rust_layout::RustLayout;
use crate::harness::scalars::{Scalar, Scalars, builtin_words};
use crate::harness::shader_outcome::{Report, ShaderOutcome};
use crate::harness::told::{Told, What};
use crate::harness::value::Value;
use crate::interp;
use crate::machine::image::Image;
use crate::machine::sampler::Sampler;
use crate::machine::stop::{Rows, Stop};
use crate::machine::{
    Batch, Binding, Buffer, Descriptor, Exit, Invocation, Mask, Reg, Resources, ShaderRecord, TrapCode,
};
use crate::module::Module;
use crate::module::interface::Stage;
use crate::ops::builtin::Builtin;
use crate::ops::decode::InterfaceRows;
use crate::ops::pointer::storage;
use crate::ops::ray_tracing::TRACE_OPERANDS;
use crate::pipeline::{DEFAULT_BUDGET, Event, Pipeline, Shader, trace_operands, trap_error};
use crate::program::Program;
use crate::scene::read::nearest;

/// A shader with everything that one invocation of it sees.
///
/// Builtins follow from a [`Hit`] (closest-hit, any-hit and intersection shaders) or a ray (miss
/// shaders), and any of them can be set to any value. What is not given is zero.
///
/// ```
/// use anyhit::{Hit, Module, Ray, ShaderTest};
///
/// # fn main() -> anyhit::Result<()> {
/// let module = Module::open("spirv-fixtures/pass/sphere/closest-hit/main.rchit.spv")?;
/// let outcome = ShaderTest::new(&module, "main")?
///     .hit(Hit::sphere([0.0, 0.0, 0.0], 0.5).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0])))
///     .run()?;
/// assert_eq!(outcome.payload["normal"].vec3(), [0.0, 0.0, 1.0]);
/// assert_eq!(outcome.payload["t"].f32(), 3.5);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct ShaderTest {
    program: Arc<Program>,
    hit: Option<Hit>,
    trace: Option<TraceRay>,
    launch: [[u32; 3]; 2],
    builtins: Vec<(&'static Builtin, Vec<u32>)>,
    payload: Option<Bytes>,
    members: Vec<(String, Vec<Scalar>)>,
    attributes: Option<Bytes>,
    record: Option<Bytes>,
    push_constants: Option<Bytes>,
    resources: Resources,
    traces: Option<Answer<TraceCall>>,
    calls: Option<Answer<CallableCall>>,
    reports: Option<Answer<Report>>,
    budget: u64,
    /// The first mistake, told by [`ShaderTest::run`].
    mistake: Option<Error>,
}

impl ShaderTest {
    /// The shader with an entry point's name.
    ///
    /// # Errors
    /// `InvalidArgument` where no entry point or several have the name, and what makes a module
    /// unusable.
    pub fn new(module: &Arc<Module>, entry: &str) -> Result<Self> {
        let names = module.entry_points.iter().map(|known| known.name.as_str());
        let program = Program::of(module, entry);
        Self::of(program.map_err(|error| match nearest(entry, names) {
            Some(near) if near != entry => error.note(format!("did you mean `{near}`?")),
            _ => error,
        })?)
    }

    /// The shader with a stage and an entry point's name, where the name alone does not tell.
    ///
    /// # Errors
    /// As [`ShaderTest::new`].
    pub fn with_stage(module: &Arc<Module>, stage: Stage, entry: &str) -> Result<Self> {
        Self::of(Program::with_stage(module, stage, entry)?)
    }

    /// The shader of a program that is lowered already.
    ///
    /// # Errors
    /// `UnsupportedModule` for a stage that is not of ray tracing.
    pub fn of(program: impl Into<Arc<Program>>) -> Result<Self> {
        let program = program.into();
        if matches!(program.stage, Stage::Compute | Stage::Other(_)) {
            let message = format!("a test of a {} shader", program.stage.name());
            return Err(Error::new(ErrorKind::UnsupportedModule, message));
        }
        Ok(Self {
            program,
            hit: None,
            trace: None,
            launch: [[0; 3], [1; 3]],
            builtins: Vec::new(),
            payload: None,
            members: Vec::new(),
            attributes: None,
            record: None,
            push_constants: None,
            resources: Resources::default(),
            traces: None,
            calls: None,
            reports: None,
            budget: DEFAULT_BUDGET,
            mistake: None,
        })
    }

    /// What was hit, and by which ray: all builtins of a hit shader, and its hit attributes.
    #[must_use]
    pub fn hit(self, hit: Hit) -> Self {
        Self { hit: Some(hit), ..self }
    }

    /// The ray of a miss shader, or of a hit shader whose builtins are all set by name.
    #[must_use]
    pub fn ray(self, ray: Ray) -> Self {
        Self { trace: Some(TraceRay { ray, flags: RayFlags(0), cull_mask: 0xFF, time: 0.0 }), ..self }
    }

    /// `LaunchIdKHR` and `LaunchSizeKHR`; (0, 0, 0) of (1, 1, 1) unless set.
    #[must_use]
    pub fn launch(self, id: [u32; 3], size: [u32; 3]) -> Self {
        Self { launch: [id, size], ..self }
    }

    /// Sets a builtin by its name in SPIR-V, consistent with the rest or not: `"HitKindKHR"`,
    /// `"PrimitiveId"`, `"RayTmaxKHR"`. The suffix may be left out.
    #[must_use]
    pub fn builtin(mut self, name: &str, value: impl Scalars) -> Self {
        match builtin_words(name, &value) {
            Ok((builtin, words)) => {
                self.builtins.retain(|(known, _)| known.number != builtin.number);
                self.builtins.push((builtin, words));
                self
            }
            Err(error) => self.mistaken(error),
        }
    }

    /// The payload that the shader is given, or the callable data; zeros unless set.
    #[must_use]
    pub fn payload<T: NoUninit + Debug>(self, payload: &T) -> Self {
        Self { payload: Some(Bytes::of(payload)), ..self }
    }

    /// Sets a member of the payload, or of the callable data, by its path:
    /// `.payload_member("path[1].weight", 0.5f32)`.
    #[must_use]
    pub fn payload_member(mut self, path: &str, value: impl Scalars) -> Self {
        self.members.push((path.to_owned(), value.scalars()));
        self
    }

    /// The hit attributes, in place of those of the [`Hit`].
    #[must_use]
    pub fn attributes<T: NoUninit + Debug>(self, attributes: &T) -> Self {
        Self { attributes: Some(Bytes::of(attributes)), ..self }
    }

    /// The data of the shader record behind its handle (`shaderRecordEXT`).
    #[must_use]
    pub fn shader_record<T: NoUninit + Debug>(self, record: &T) -> Self {
        Self { record: Some(Bytes::of(record)), ..self }
    }

    /// The push constants.
    #[must_use]
    pub fn push_constants<T: NoUninit + Debug>(self, constants: &T) -> Self {
        Self { push_constants: Some(Bytes::of(constants)), ..self }
    }

    /// A storage or uniform buffer with these elements.
    #[must_use]
    pub fn buffer<T: NoUninit>(mut self, set: u32, binding: u32, elements: &[T]) -> Self {
        let bytes: &[u8] = bytemuck::cast_slice(elements);
        if let Some(error) = self.misfit(set, binding, &RustLayout::opaque::<[T]>(bytes.len())) {
            return self.mistaken(error);
        }
        self.resources = self.resources.bind(set, binding, Descriptor::Buffer(Buffer::new(bytes)));
        self
    }

    /// An image. A run works on a copy: [`ShaderOutcome::image`] reads it.
    #[must_use]
    pub fn image(self, set: u32, binding: u32, image: Arc<Image>) -> Self {
        self.descriptor(set, binding, Descriptor::Image(image))
    }

    /// A combined image sampler.
    #[must_use]
    pub fn image_sampler(self, set: u32, binding: u32, image: Arc<Image>, sampler: Sampler) -> Self {
        self.descriptor(set, binding, Descriptor::ImageSampler(image, Arc::new(sampler)))
    }

    /// Any descriptor.
    #[must_use]
    pub fn descriptor(mut self, set: u32, binding: u32, descriptor: Descriptor) -> Self {
        self.resources = self.resources.bind(set, binding, descriptor);
        self
    }

    /// Answers the traces that the shader makes, in place of a scene: the closure sees ray and
    /// operands, and leaves the payload that the shader goes on with.
    ///
    /// ```
    /// # use anyhit::{Hit, Module, Ray, ShaderTest};
    /// # let module = Module::open("spirv-fixtures/pass/payload/structs/main.rchit.spv")?;
    /// # let hit = Hit::sphere([0.0; 3], 0.5).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
    /// # let test = ShaderTest::new(&module, "main")?.hit(hit);
    /// let outcome = test
    ///     .on_trace(|trace| {
    ///         assert_eq!(trace.trace.ray.direction, [1.0, 0.0, 0.0]);
    ///         trace.payload.set("counts", [0, 1])
    ///     })
    ///     .run()?;
    /// assert_eq!(outcome.traces.len(), 1);
    /// # Ok::<(), anyhit::Error>(())
    /// ```
    #[must_use]
    pub fn on_trace(self, answer: impl Fn(&mut TraceCall) -> Result<()> + Send + Sync + 'static) -> Self {
        Self { traces: Some(Answer::new(answer)), ..self }
    }

    /// Answers the shader's traces with these payloads, one after the other.
    #[must_use]
    pub fn trace_answers<T: NoUninit + Debug>(self, payloads: &[T]) -> Self {
        Self { traces: Some(in_turn(payloads, "trace", TraceCall::parts)), ..self }
    }

    /// Answers the callable shaders that the shader calls: the closure sees index and data, and
    /// leaves the data that the shader goes on with.
    #[must_use]
    pub fn on_call(self, answer: impl Fn(&mut CallableCall) -> Result<()> + Send + Sync + 'static) -> Self {
        Self { calls: Some(Answer::new(answer)), ..self }
    }

    /// Answers the shader's calls with these data, one after the other.
    #[must_use]
    pub fn call_answers<T: NoUninit + Debug>(self, data: &[T]) -> Self {
        Self { calls: Some(in_turn(data, "call", CallableCall::parts)), ..self }
    }

    /// Decides on the reports of an intersection shader, as an any-hit shader would: `true` accepts.
    /// Reports outside the ray's interval are not asked about.
    #[must_use]
    pub fn on_report(self, decide: impl Fn(&Report) -> bool + Send + Sync + 'static) -> Self {
        let answer = Answer::new(move |report: &mut Report| {
            report.accepted = decide(report);
            Ok(())
        });
        Self { reports: Some(answer), ..self }
    }

    /// Answers every report of an intersection shader with "rejected".
    #[must_use]
    pub fn reject_reports(self) -> Self {
        self.on_report(|_| false)
    }

    /// How many operations the shader may spend at back edges and calls.
    #[must_use]
    pub fn budget(self, operations: u64) -> Self {
        Self { budget: operations, ..self }
    }

    /// Runs the shader once. Buffers and images are copied first: a test can be run again.
    ///
    /// # Errors
    /// `Trap` where the shader misbehaves, with its source line; `InvalidArgument` for a builtin or a
    /// layout that does not fit, with both layouts, where the ray misses, and where the shader traces
    /// or calls and nothing answers; what an answer returns.
    pub fn run(&self) -> Result<ShaderOutcome> {
        if let Some(mistake) = &self.mistake {
            return Err(mistake.clone());
        }
        let program = &*self.program;
        let mut resources = memory::copied(&self.resources);
        resources.push_constants = self.constants()?;
        resources.printed = Some(Arc::default());
        let bindings = resources.bindings(program.bindings());
        let (invocation, attributes) = self.invocation()?;
        let mut batch: Batch<1> = program.batch();
        batch.invocations[0] = invocation;
        program.begin(&mut batch, Mask::ALL, self.budget);
        self.override_builtins(&mut batch);
        self.fill_payload(&mut batch)?;
        let attribute_rows = program.interface_rows(storage::HIT_ATTRIBUTE);
        if let (Some(rows), Some(words)) = (attribute_rows, attributes) {
            batch.registers.set_lane_words(rows.first, 0, words.into_iter().take(rows.count as usize));
        }
        self.fill_attributes(&mut batch)?;
        let mut events = vec![self.enter(&batch)];
        let (mut traces, mut calls, mut reports) = (Vec::new(), Vec::new(), Vec::new());
        loop {
            match interp::run(&mut batch, program, &bindings, &mut ()) {
                Stop::Done => break,
                Stop::Paused => {}
                Stop::Barrier { .. } => {
                    unreachable!("bug in anyhit: a barrier of a workgroup outside compute")
                }
                Stop::ReportIntersection { t, hit_kind, accepted, .. } => {
                    let report = self.report(&mut batch, t, hit_kind)?;
                    batch.registers[accepted].0[0] = u32::from(report.accepted);
                    let hit_kind = crate::accel::HitKind(report.kind);
                    events.push(Event::Report { t: report.t, hit_kind, accepted: report.accepted });
                    reports.push(report);
                }
                Stop::TraceRay { operands, payload, .. } => {
                    traces.extend(self.trace(&mut batch, operands, payload, traces.len())?);
                }
                Stop::ExecuteCallable { index, data, .. } => {
                    calls.push(self.call(&mut batch, index, data, calls.len())?);
                }
                Stop::HitObjectTrace { .. } => return Err(self.calls_out("traces a ray", "")),
                Stop::HitObjectExecute { .. } | Stop::HitObjectRecordHandle { .. } => {
                    return Err(self.calls_out("uses shader records through a hit object", ""));
                }
            }
        }
        let exit = batch.exits[0];
        if let Exit::Trapped(trap) = exit {
            return Err(trap_error(program, &batch, 0, trap));
        }
        let words = self.payload_rows().map_or_else(Vec::new, |rows| words(&batch, rows));
        events.push(Event::Leave { shader: Shader(0), stage: program.stage, exit, payload: words });
        let told = Arc::new(Told { pipeline: self.pipeline(), what: What::shader(events, &traces, &calls) });
        let mut payload = self.read(&batch, self.payload_rows());
        payload.explained_by(&told);
        let printed = resources.printed.take().map_or_else(Vec::new, |printed| printed.take());
        Ok(ShaderOutcome {
            exit,
            payload,
            attributes: self.read(&batch, attribute_rows),
            reports,
            traces,
            calls,
            printed: printed.into_iter().map(|line| line.text).collect(),
            data: self.payload_rows().map(|rows| self.data(&batch, rows, "the payload")),
            bound: Bound { programs: vec![self.program.clone()], resources },
            told,
        })
    }

    /// Keeps the first mistake.
    fn mistaken(mut self, error: Error) -> Self {
        self.mistake.get_or_insert(error);
        self
    }

    fn calls_out(&self, what: &str, answer: &str) -> Error {
        let message = format!("{} `{}` {what}", self.program.stage.name(), self.program.name);
        let error = invalid(message).note("test it with others in a pipeline: `pipeline.trace(&scene, ray)`");
        if answer.is_empty() { error } else { error.note(answer) }
    }

    /// A pipeline of this shader alone, to explain its run.
    fn pipeline(&self) -> Pipeline {
        let mut builder = Pipeline::builder();
        builder.shader(self.program.clone());
        builder.build().expect("bug in anyhit: a pipeline without groups is refused")
    }

    fn enter(&self, batch: &Batch<1>) -> Event {
        let read = |first: Reg, count| batch.registers.lane_words(first, count, 0).collect();
        let inputs = self.program.inputs.iter();
        let rows = |rows: Option<&InterfaceRows>| rows.map_or_else(Vec::new, |rows| words(batch, rows));
        Event::Enter {
            shader: Shader(0),
            stage: self.program.stage,
            builtins: inputs.map(|rows| (rows.builtin, read(rows.first, rows.count))).collect(),
            payload: rows(self.payload_rows()),
            attributes: rows(self.program.interface_rows(storage::HIT_ATTRIBUTE)),
        }
    }

    /// The variable of the interface whose rows an instruction names.
    fn data_at(&self, batch: &Batch<1>, at: Rows, what: &'static str) -> Data {
        let rows = self.program.interface.iter().find(|rows| rows.first == at.first);
        let rows = rows.expect("bug in anyhit: a payload that is no variable of the interface");
        self.data(batch, rows, what)
    }

    fn data(&self, batch: &Batch<1>, rows: &InterfaceRows, what: &'static str) -> Data {
        let words = batch.registers.lane_words(rows.first, rows.count, 0);
        Data::new(&self.program.module, rows.ty, what, words)
    }

    /// Serves a trace; `None` where the shader traps at it.
    fn trace(
        &self,
        batch: &mut Batch<1>,
        at: Reg,
        payload: Rows,
        number: usize,
    ) -> Result<Option<TraceCall>> {
        let answer = self.traces.as_ref().ok_or_else(|| {
            let how = "or answer it: `.on_trace(|trace| trace.payload.set(\"colour\", [1.0f32, 0.0, 0.0]))`";
            self.calls_out("traces a ray", how)
        })?;
        let mut operands = [0; TRACE_OPERANDS as usize];
        let read = batch.registers.lane_words(at, TRACE_OPERANDS, 0);
        operands.iter_mut().zip(read).for_each(|(to, word)| *to = word);
        let trace = match trace_operands(&operands) {
            Ok(trace) => trace,
            Err(broken) => {
                let op = batch.op - 1;
                batch.asked[0] = broken as u64;
                batch.trap(Mask::ALL, TrapCode::InvalidTrace, op);
                return Ok(None);
            }
        };
        let data = self.data_at(batch, payload, "the payload");
        let mut call = TraceCall {
            number,
            trace,
            sbt_offset: operands[4],
            sbt_stride: operands[5],
            miss_index: operands[6],
            given: data.value(),
            payload: data,
        };
        answer.give(&mut call).map_err(|error| error.context(format!("trace {}", number + 1)))?;
        batch.registers.set_lane_words(payload.first, 0, call.payload.words().take(payload.count as usize));
        Ok(Some(call))
    }

    fn call(&self, batch: &mut Batch<1>, index: Reg, rows: Rows, number: usize) -> Result<CallableCall> {
        let answer = self.calls.as_ref().ok_or_else(|| {
            let how = "or answer it: `.on_call(|call| call.data.set(\"\", 1.0f32))`";
            self.calls_out("calls a callable shader", how)
        })?;
        let index = batch.registers[index].0[0];
        let data = self.data_at(batch, rows, "the callable data");
        let mut call = CallableCall { number, index, given: data.value(), data };
        answer.give(&mut call).map_err(|error| error.context(format!("call {}", number + 1)))?;
        batch.registers.set_lane_words(rows.first, 0, call.data.words().take(rows.count as usize));
        Ok(call)
    }

    fn invocation(&self) -> Result<(Invocation, Option<[u32; 2]>)> {
        let mut invocation = Invocation {
            launch_id: self.launch[0],
            launch_size: self.launch[1],
            trace: self.trace,
            t_max: self.trace.map_or(0.0, |trace| trace.ray.t_max),
            record: self.record()?,
            depth: 1,
            ..Invocation::default()
        };
        let Some(hit) = self.hit.clone() else { return Ok((invocation, None)) };
        let resolved = hit.resolve()?;
        let attributes = resolved.hit.candidate.intersection.attributes.map(f32::to_bits);
        invocation.trace = Some(resolved.trace);
        invocation.t_max = resolved.t;
        invocation.hit = Some(resolved.hit);
        Ok((invocation, Some(attributes)))
    }

    fn override_builtins(&self, batch: &mut Batch<1>) {
        for (builtin, words) in &self.builtins {
            for rows in self.program.inputs.iter().filter(|rows| rows.builtin == *builtin) {
                batch.registers.set_lane_words(rows.first, 0, words.iter().copied());
            }
        }
    }

    fn report(&self, batch: &mut Batch<1>, t: Reg, kind: Reg) -> Result<Report> {
        let (t, kind) = (f32::from_bits(batch.registers[t].0[0]), batch.registers[kind].0[0]);
        let attributes = self.read(batch, self.program.interface_rows(storage::HIT_ATTRIBUTE));
        let invocation = &batch.invocations[0];
        let t_min = invocation.trace.map_or(0.0, |trace| trace.ray.t_min);
        let accepted = kind < 128 && (t_min..=invocation.t_max).contains(&t);
        let mut report = Report { t, kind, attributes, accepted };
        if let Some(answer) = self.reports.as_ref().filter(|_| accepted) {
            answer.give(&mut report)?;
        }
        if kind > 127 {
            let op = batch.op - 1;
            batch.trap(Mask::ALL, TrapCode::InvalidHitKind, op);
        } else if report.accepted {
            batch.invocations[0].t_max = t;
            self.program.refresh_inputs(batch, Mask::ALL, true);
            self.override_builtins(batch);
        }
        Ok(report)
    }

    fn payload_rows(&self) -> Option<&InterfaceRows> {
        let class = match self.program.stage {
            Stage::Callable => storage::INCOMING_CALLABLE_DATA,
            _ => storage::INCOMING_RAY_PAYLOAD,
        };
        self.program.interface_rows(class)
    }

    fn fill_payload(&self, batch: &mut Batch<1>) -> Result<()> {
        if self.payload.is_none() && self.members.is_empty() {
            return Ok(());
        }
        let Some(rows) = self.payload_rows() else {
            let given = self.payload.as_ref().map_or("members", |given| &given.rust.name);
            return Err(invalid(format!("the shader does not use the payload that it is given: `{given}`")));
        };
        let mut data = self.data(batch, rows, "the payload");
        if let Some(given) = &self.payload {
            data.take(given)?;
        }
        for (path, scalars) in &self.members {
            data.set(path, &scalars[..])?;
        }
        batch.registers.set_lane_words(rows.first, 0, data.words());
        Ok(())
    }

    fn fill_attributes(&self, batch: &mut Batch<1>) -> Result<()> {
        let Some(given) = &self.attributes else { return Ok(()) };
        let Some(rows) = self.program.interface_rows(storage::HIT_ATTRIBUTE) else {
            let given = &given.rust.name;
            return Err(invalid(format!(
                "the shader does not use the hit attributes that it is given: `{given}`"
            )));
        };
        let mut data = self.data(batch, rows, "the hit attributes");
        data.take(given)?;
        batch.registers.set_lane_words(rows.first, 0, data.words());
        Ok(())
    }

    fn read(&self, batch: &Batch<1>, rows: Option<&InterfaceRows>) -> Value {
        let Some(rows) = rows else { return Value::nothing() };
        self.data(batch, rows, "").value()
    }

    fn constants(&self) -> Result<Option<Arc<Buffer>>> {
        self.block(self.push_constants.as_ref(), storage::PUSH_CONSTANT, "the push constants")
    }

    fn record(&self) -> Result<Option<ShaderRecord>> {
        let class = storage::SHADER_RECORD_BUFFER;
        let data = self.block(self.record.as_ref(), class, "the shader record")?;
        Ok(data.map(|data| ShaderRecord { offset: 0, size: data.size(), data }))
    }

    /// The bytes of a block that has no binding.
    fn block(&self, given: Option<&Bytes>, class: u32, what: &str) -> Result<Option<Arc<Buffer>>> {
        let Some(given) = given else { return Ok(None) };
        let block = blocks(&self.program).find(|block| block.1 == class);
        if let Some((ty, ..)) = block {
            let layout = Layout::new(&self.program.module, ty, Rules::Explicit);
            if given.bytes.len() < layout.size() {
                return Err(layout.mismatch(what, &given.rust));
            }
        }
        Ok(Some(Buffer::new(&given.bytes)))
    }

    /// Why bytes cannot be the content of a buffer of the shader.
    fn misfit(&self, set: u32, binding: u32, rust: &RustLayout) -> Option<Error> {
        let (ty, ..) = blocks(&self.program).find(|block| block.2 == Some(Binding { set, binding }))?;
        let layout = Layout::new(&self.program.module, ty, Rules::Explicit);
        let fits = match layout.runtime_stride() {
            Some((offset, stride)) => {
                rust.size >= offset && (rust.size - offset).is_multiple_of(stride.max(1))
            }
            None => rust.size >= layout.size(),
        };
        (!fits).then(|| layout.mismatch(&format!("buffer {binding} of set {set}"), rust))
    }
}

/// The words of an interface variable.
fn words(batch: &Batch<1>, rows: &InterfaceRows) -> Vec<u32> {
    batch.registers.lane_words(rows.first, rows.count, 0).collect()
}

fn invalid(message: String) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}
