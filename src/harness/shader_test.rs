//! One shader, run by itself: no scene, no pipeline, no ray generation shader.

use std::sync::Arc;

use bytemuck::{AnyBitPattern, NoUninit};

use crate::accel::{RayFlags, TraceRay};
use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Ray;
use crate::harness::builtin_value::{BuiltinValue, words_of};
use crate::harness::hit::Hit;
use crate::harness::layout::{Layout, Rules};
use crate::harness::memory;
use crate::harness::value::Value;
use crate::interp;
use crate::machine::image::Image;
use crate::machine::sampler::Sampler;
use crate::machine::stop::Stop;
use crate::machine::{
    Batch, Binding, Buffer, Descriptor, Exit, Invocation, Mask, Reg, Resources, ShaderRecord, TrapCode,
};
use crate::module::Module;
use crate::module::interface::Stage;
use crate::module::ty::{Type, TypeId};
use crate::ops::builtin::Builtin;
use crate::ops::decode::InterfaceRows;
use crate::ops::pointer::storage;
use crate::pipeline::{DEFAULT_BUDGET, trap_error};
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
    attributes: Option<Bytes>,
    record: Option<Bytes>,
    push_constants: Option<Bytes>,
    resources: Resources,
    accepts: bool,
    budget: u64,
    /// The first mistake, told by [`ShaderTest::run`].
    mistake: Option<Error>,
}

/// Bytes of a Rust value with its type's name.
#[derive(Clone, Debug)]
struct Bytes {
    rust: &'static str,
    bytes: Vec<u8>,
}

impl Bytes {
    fn of<T: NoUninit>(value: &T) -> Self {
        Self { rust: std::any::type_name::<T>(), bytes: bytemuck::bytes_of(value).to_vec() }
    }
}

/// A report of an intersection shader.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The hit distance.
    pub t: f32,
    /// The hit kind.
    pub kind: u32,
    /// The hit attributes.
    pub attributes: Value,
    /// The answer: whether t lies in the ray's interval, unless told otherwise.
    pub accepted: bool,
}

/// What one invocation left.
#[derive(Clone, Debug)]
pub struct ShaderOutcome {
    /// How it ended: returned, ignored the intersection, terminated the ray.
    pub exit: Exit,
    /// The payload, or the callable data, by the names of its members.
    pub payload: Value,
    /// The hit attributes.
    pub attributes: Value,
    /// The reports of an intersection shader, in order.
    pub reports: Vec<Report>,
    program: Arc<Program>,
    resources: Resources,
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
            attributes: None,
            record: None,
            push_constants: None,
            resources: Resources::default(),
            accepts: true,
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
        Self { trace: Some(TraceRay { ray, flags: RayFlags(0), cull_mask: 0xFF }), ..self }
    }

    /// `LaunchIdKHR` and `LaunchSizeKHR`; (0, 0, 0) of (1, 1, 1) unless set.
    #[must_use]
    pub fn launch(self, id: [u32; 3], size: [u32; 3]) -> Self {
        Self { launch: [id, size], ..self }
    }

    /// Sets a builtin by its name in SPIR-V, consistent with the rest or not: `"HitKindKHR"`,
    /// `"PrimitiveId"`, `"RayTmaxKHR"`. The suffix may be left out.
    #[must_use]
    pub fn builtin(mut self, name: &str, value: impl BuiltinValue) -> Self {
        match words_of(name, &value) {
            Ok((builtin, words)) => {
                self.builtins.retain(|(known, _)| known.number != builtin.number);
                self.builtins.push((builtin, words));
                self
            }
            Err(error) => self.mistaken(error),
        }
    }

    /// The payload that the shader is given, or the callable data.
    #[must_use]
    pub fn payload<T: NoUninit>(self, payload: &T) -> Self {
        Self { payload: Some(Bytes::of(payload)), ..self }
    }

    /// The hit attributes, in place of those of the [`Hit`].
    #[must_use]
    pub fn attributes<T: NoUninit>(self, attributes: &T) -> Self {
        Self { attributes: Some(Bytes::of(attributes)), ..self }
    }

    /// The data of the shader record behind its handle (`shaderRecordEXT`).
    #[must_use]
    pub fn shader_record<T: NoUninit>(self, record: &T) -> Self {
        Self { record: Some(Bytes::of(record)), ..self }
    }

    /// The push constants.
    #[must_use]
    pub fn push_constants<T: NoUninit>(self, constants: &T) -> Self {
        Self { push_constants: Some(Bytes::of(constants)), ..self }
    }

    /// A storage or uniform buffer with these elements.
    #[must_use]
    pub fn buffer<T: NoUninit>(mut self, set: u32, binding: u32, elements: &[T]) -> Self {
        let bytes: &[u8] = bytemuck::cast_slice(elements);
        if let Some(error) = self.misfit(set, binding, std::any::type_name::<[T]>(), bytes.len()) {
            return self.mistaken(error);
        }
        self.resources = self.resources.bind(set, binding, Descriptor::Buffer(Buffer::new(bytes)));
        self
    }

    /// An image; its texels are read back from the same `Arc`.
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

    /// Answers every report of an intersection shader with "rejected".
    #[must_use]
    pub fn reject_reports(self) -> Self {
        Self { accepts: false, ..self }
    }

    /// How many operations the shader may spend at back edges and calls.
    #[must_use]
    pub fn budget(self, operations: u64) -> Self {
        Self { budget: operations, ..self }
    }

    /// Runs the shader once. Buffers are copied first: a test can be run again.
    ///
    /// # Errors
    /// `Trap` where the shader misbehaves, with its source line; `InvalidArgument` for a builtin or a
    /// layout that does not fit, with both layouts, where the ray misses, and where the shader traces
    /// or calls: such a shader is tested in a [`Scene`](crate::Scene).
    pub fn run(&self) -> Result<ShaderOutcome> {
        if let Some(mistake) = &self.mistake {
            return Err(mistake.clone());
        }
        let program = &*self.program;
        let mut resources = memory::copied(&self.resources);
        resources.push_constants = self.constants()?;
        let bindings = resources.bindings(program.bindings());
        let (invocation, attributes) = self.invocation()?;
        let mut batch: Batch<1> = program.batch();
        batch.invocations[0] = invocation;
        program.begin(&mut batch, Mask::ALL, self.budget);
        self.override_builtins(&mut batch);
        self.fill(&mut batch, self.payload_rows(), self.payload.as_ref(), "the payload")?;
        let attribute_rows = program.interface_rows(storage::HIT_ATTRIBUTE);
        if let (Some(rows), Some(words)) = (attribute_rows, attributes) {
            batch.registers.set_lane_words(rows.first, 0, words.into_iter().take(rows.count as usize));
        }
        self.fill(&mut batch, attribute_rows, self.attributes.as_ref(), "the hit attributes")?;
        let mut reports = Vec::new();
        loop {
            match interp::run(&mut batch, program, &bindings, &mut ()) {
                Stop::Done => break,
                Stop::Paused => {}
                Stop::Barrier { .. } => {
                    unreachable!("bug in anyhit: a barrier of a workgroup outside compute")
                }
                Stop::ReportIntersection { t, hit_kind, accepted, .. } => {
                    let report = self.report(&mut batch, t, hit_kind);
                    batch.registers[accepted].0[0] = u32::from(report.accepted);
                    reports.push(report);
                }
                Stop::TraceRay { .. } => return Err(self.calls("traces a ray")),
                Stop::HitObjectTrace { .. } => return Err(self.calls("traces a ray")),
                Stop::HitObjectExecute { .. } | Stop::HitObjectRecordHandle { .. } => {
                    return Err(self.calls("uses shader records through a hit object"));
                }
                Stop::ExecuteCallable { .. } => return Err(self.calls("calls a callable shader")),
            }
        }
        let exit = batch.exits[0];
        if let Exit::Trapped(trap) = exit {
            return Err(trap_error(program, &batch, 0, trap));
        }
        Ok(ShaderOutcome {
            exit,
            payload: self.read(&batch, self.payload_rows()),
            attributes: self.read(&batch, attribute_rows),
            reports,
            program: self.program.clone(),
            resources,
        })
    }

    /// Keeps the first mistake.
    fn mistaken(mut self, error: Error) -> Self {
        self.mistake.get_or_insert(error);
        self
    }

    fn calls(&self, what: &str) -> Error {
        let message = format!("{} `{}` {what}", self.program.stage.name(), self.program.name);
        invalid(message).note("test it with others in a pipeline: `pipeline.trace(&scene, ray)`")
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

    fn report(&self, batch: &mut Batch<1>, t: Reg, kind: Reg) -> Report {
        let (t, kind) = (f32::from_bits(batch.registers[t].0[0]), batch.registers[kind].0[0]);
        let attributes = self.read(batch, self.program.interface_rows(storage::HIT_ATTRIBUTE));
        let invocation = &batch.invocations[0];
        let t_min = invocation.trace.map_or(0.0, |trace| trace.ray.t_min);
        let accepted = self.accepts && kind < 128 && (t_min..=invocation.t_max).contains(&t);
        if kind > 127 {
            let op = batch.op - 1;
            batch.trap(Mask::ALL, TrapCode::InvalidHitKind, op);
        } else if accepted {
            batch.invocations[0].t_max = t;
            self.program.refresh_inputs(batch, Mask::ALL, true);
            self.override_builtins(batch);
        }
        Report { t, kind, attributes, accepted }
    }

    fn payload_rows(&self) -> Option<&InterfaceRows> {
        let class = match self.program.stage {
            Stage::Callable => storage::INCOMING_CALLABLE_DATA,
            _ => storage::INCOMING_RAY_PAYLOAD,
        };
        self.program.interface_rows(class)
    }

    /// Puts the bytes of a Rust value into rows.
    fn fill(
        &self,
        batch: &mut Batch<1>,
        rows: Option<&InterfaceRows>,
        given: Option<&Bytes>,
        what: &str,
    ) -> Result<()> {
        let Some(given) = given else { return Ok(()) };
        let Some(rows) = rows else {
            return Err(invalid(format!(
                "the shader does not use {what} that it is given: `{}`",
                given.rust
            )));
        };
        let layout = Layout::new(&self.program.module, rows.ty, Rules::Packed);
        if given.bytes.len() != rows.count as usize * 4 {
            return Err(layout.mismatch(what, given.rust, given.bytes.len()));
        }
        let words = given.bytes.chunks_exact(4).map(bytemuck::pod_read_unaligned::<u32>);
        batch.registers.set_lane_words(rows.first, 0, words);
        Ok(())
    }

    fn read(&self, batch: &Batch<1>, rows: Option<&InterfaceRows>) -> Value {
        let Some(rows) = rows else { return Value::nothing() };
        let words = batch.registers.lane_words(rows.first, rows.count, 0);
        let bytes: Vec<u8> = words.flat_map(u32::to_le_bytes).collect();
        Layout::new(&self.program.module, rows.ty, Rules::Packed).read(&bytes)
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
                return Err(layout.mismatch(what, given.rust, given.bytes.len()));
            }
        }
        Ok(Some(Buffer::new(&given.bytes)))
    }

    /// Why bytes cannot be the content of a buffer of the shader.
    fn misfit(&self, set: u32, binding: u32, rust: &str, size: usize) -> Option<Error> {
        let (ty, ..) = blocks(&self.program).find(|block| block.2 == Some(Binding { set, binding }))?;
        let layout = Layout::new(&self.program.module, ty, Rules::Explicit);
        let fits = match layout.runtime_stride() {
            Some((offset, stride)) => size >= offset && (size - offset).is_multiple_of(stride.max(1)),
            None => size >= layout.size(),
        };
        (!fits).then(|| layout.mismatch(&format!("buffer {binding} of set {set}"), rust, size))
    }
}

impl ShaderOutcome {
    /// The payload, or the callable data, as a plain Rust type: see [`layout`](crate::harness::layout)
    /// for how its scalars lie.
    ///
    /// # Errors
    /// `InvalidArgument` where the size differs; it shows both layouts.
    pub fn payload<T: AnyBitPattern>(&self) -> Result<T> {
        self.payload.read()
    }

    /// The bytes of a buffer, as the shader left them.
    ///
    /// # Errors
    /// `InvalidArgument` where no buffer is bound there.
    pub fn buffer_bytes(&self, set: u32, binding: u32) -> Result<Vec<u8>> {
        match self.resources.buffer(set, binding) {
            Some(buffer) => Ok(buffer.bytes()),
            None => Err(invalid(format!("no buffer is bound at set {set}, binding {binding}"))),
        }
    }

    /// A buffer by the names of its members: `outcome.buffer(0, 1)?["outputs"][2].vec4()`.
    ///
    /// # Errors
    /// `InvalidArgument` where no buffer is bound there, or the shader does not use it.
    pub fn buffer(&self, set: u32, binding: u32) -> Result<Value> {
        let bytes = self.buffer_bytes(set, binding)?;
        let block = blocks(&self.program).find(|block| block.2 == Some(Binding { set, binding }));
        match block {
            Some((ty, ..)) => Ok(Layout::new(&self.program.module, ty, Rules::Explicit).read(&bytes)),
            None => Err(invalid(format!("the shader uses no buffer at set {set}, binding {binding}"))
                .note("`buffer_bytes` gives its bytes nevertheless")),
        }
    }
}

fn invalid(message: String) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}

/// The blocks of a program's module: type, storage class and binding.
fn blocks(program: &Program) -> impl Iterator<Item = (TypeId, u32, Option<Binding>)> + '_ {
    let module = &*program.module;
    let entry =
        module.entry_points.iter().find(|entry| entry.stage == program.stage && entry.name == program.name);
    let variables = entry.map_or_else(Vec::new, |entry| module.interface_of(entry));
    variables.into_iter().filter_map(|variable| {
        let binding = variable.descriptor_set.zip(variable.binding);
        let ty = variable.ty.filter(|ty| matches!(module.ty(*ty), Type::Struct { .. }))?;
        Some((ty, variable.storage_class, binding.map(|(set, binding)| Binding { set, binding })))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fixture(name: &str) -> Arc<Module> {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass");
        Module::open(root.join(name)).expect("a fixture")
    }

    fn sphere() -> ShaderTest {
        ShaderTest::new(&fixture("sphere/closest-hit/main.rchit.spv"), "main").expect("a closest-hit shader")
    }

    fn front() -> Hit {
        Hit::sphere([0.0; 3], 0.5).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -2.0]))
    }

    #[repr(C)]
    #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
    struct Payload {
        normal: [f32; 3],
        t: f32,
        hits: u32,
    }

    #[test]
    fn a_payload_goes_in_and_out_as_a_rust_struct_and_by_name() {
        let before = Payload { normal: [9.0; 3], t: 9.0, hits: 41 };
        let outcome = sphere().hit(front()).payload(&before).run().unwrap();
        // (4 - 1/2) / 2
        let expected = Payload { normal: [0.0, 0.0, 1.0], t: 1.75, hits: 42 };
        assert_eq!(outcome.payload::<Payload>().unwrap(), expected);
        assert_eq!(outcome.payload["normal"].vec3(), expected.normal);
        assert_eq!(outcome.payload["hits"].u32(), 42);
        assert_eq!(outcome.exit, Exit::Returned);
    }

    #[test]
    fn a_builtin_takes_any_value() {
        let outcome = sphere().hit(front()).builtin("HitSphereRadius", 2.0f32).run().unwrap();
        assert_eq!(outcome.payload["normal"].vec3(), [0.0, 0.0, 0.25]);
        let outcome = sphere()
            .builtin("ObjectRayOriginKHR", [3.0f32, 0.0, 0.0])
            .builtin("HitSphereRadiusNV", 1.0f32)
            .builtin("RayTmaxKHR", 7.0f32)
            .run()
            .unwrap();
        assert_eq!(outcome.payload["normal"].vec3(), [3.0, 0.0, 0.0]);
        assert_eq!(outcome.payload["t"].f32(), 7.0);
    }

    #[test]
    fn mistakes_are_told_with_both_sides() {
        let error = |test: ShaderTest| test.run().unwrap_err().render();
        let text = error(sphere().hit(front()).payload(&[0.0f32; 4]));
        assert!(text.contains("`[f32; 4]` has 16 bytes, the shader's struct Payload 20 bytes"), "{text}");
        assert!(text.contains("12  float t"), "{text}");
        assert!(text.contains("16  uint hits"), "{text}");
        let text = error(sphere().builtin("HitSphereRadiusNV", 1u32));
        assert!(text.contains("HitSphereRadiusNV is a 32-bit float"), "{text}");
        let text = error(sphere().builtin("HitSphereRadus", 1.0f32));
        assert!(text.contains("did you mean `HitSphereRadiusNV`?"), "{text}");
        let text = error(sphere().hit(Hit::sphere([9.0; 3], 0.5).ray(Ray::new([0.0; 3], [1.0, 0.0, 0.0]))));
        assert!(text.contains("the ray misses the primitive"), "{text}");
        let text = error(sphere().hit(Hit::sphere([9.0; 3], 0.5)));
        assert!(text.contains("a hit needs its ray"), "{text}");
        let text = error(sphere().attributes(&1.0f32));
        assert!(text.contains("does not use the hit attributes"), "{text}");
        let text =
            ShaderTest::new(&fixture("sphere/closest-hit/main.rchit.spv"), "mian").unwrap_err().render();
        assert!(text.contains("did you mean `main`?"), "{text}");
    }

    #[test]
    fn any_hit_shaders_ignore_and_terminate() {
        let test =
            |name: &str| ShaderTest::new(&fixture(&format!("any-hit/ignore-and-terminate/{name}")), "main");
        let run = |name: &str, primitive: u32| {
            test(name).unwrap().builtin("PrimitiveId", primitive).payload(&[5u32, 5, 0, 0]).run().unwrap()
        };
        let ignored = run("ignore.rahit.spv", 2);
        assert_eq!(ignored.exit, Exit::Ignored);
        // What the payload got before the ignore counts.
        assert_eq!((ignored.payload["seen"].u32(), ignored.payload["ignored"].u32()), (6, 6));
        assert_eq!(run("ignore.rahit.spv", 3).exit, Exit::Returned);
        assert_eq!(run("terminate.rahit.spv", 3).exit, Exit::Terminated);
        assert_eq!(run("terminate.rahit.spv", 0).exit, Exit::Ignored);
    }

    #[test]
    fn an_intersection_shader_reports() {
        let module = fixture("intersection/sphere-in-box/main.rint.spv");
        let hit = Hit::aabb([-1.0; 3], [1.0; 3]).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
        let test = ShaderTest::new(&module, "main").unwrap().hit(hit);
        let test = test.shader_record(&[[0.0f32, 0.0, 0.0, 1.0], [0.0; 4], [0.0; 4], [0.0; 4]]);
        let outcome = test.run().unwrap();
        let found: Vec<_> =
            outcome.reports.iter().map(|report| (report.t, report.kind, report.accepted)).collect();
        assert_eq!(found, [(5.0, 6, true), (3.0, 5, true)]);
        assert_eq!(outcome.reports[1].attributes["normal"].vec3(), [0.0, 0.0, 1.0]);
        // The far root lies behind the ray's end.
        let hit = Hit::aabb([-1.0; 3], [1.0; 3])
            .ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]).with_interval(0.0, 4.0));
        let outcome = test.clone().hit(hit).run().unwrap();
        assert_eq!(outcome.reports.iter().map(|report| report.accepted).collect::<Vec<_>>(), [false, true]);
        assert!(test.reject_reports().run().unwrap().reports.iter().all(|report| !report.accepted));
    }

    #[test]
    fn buffers_are_read_by_name_and_checked() {
        let module = fixture("arithmetic/elementary/main.rgen.spv");
        let test = ShaderTest::new(&module, "main").unwrap().buffer(0, 2, &[[4.0f32, 0.0, 0.0, 0.0]]);
        let outcome = test.clone().buffer(0, 1, &[[0.0f32; 4]; 8]).run().unwrap();
        let outputs = outcome.buffer(0, 1).unwrap();
        // sqrt(4.5), 1 / sqrt(4.5), fract(4), floor(4)
        assert_eq!(outputs["outputs"][0][3].vec4(), [4.5f32.sqrt(), (1.0 / 4.5f64.sqrt()) as f32, 0.0, 4.0]);
        assert_eq!(outputs.read_all::<[f32; 4]>().unwrap()[3][3], 4.0);
        let text = test.buffer(0, 1, &[[0.0f32; 4]; 9]).run().unwrap_err().render();
        assert!(
            text.contains("has 144 bytes") && text.contains("0 bytes and 128 for each element"),
            "{text}"
        );
    }

    #[test]
    fn a_shader_that_traces_is_sent_to_a_scene() {
        let module = fixture("payload/structs/main.rchit.spv");
        let hit = Hit::triangle([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let hit = hit.ray(Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]));
        let error = ShaderTest::new(&module, "main").unwrap().hit(hit).run().unwrap_err();
        assert!(error.message().contains("traces a ray"), "{error:?}");
    }
}
