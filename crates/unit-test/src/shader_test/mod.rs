//! One shader, run by itself: no scene, no pipeline, no ray generation shader.

mod begin;
#[cfg(feature = "debugger")]
mod debug;
mod run;
mod serve;
#[cfg(test)]
mod tests;

use std::fmt::Debug;
use std::sync::Arc;

use bytemuck::NoUninit;

use crate::data::HostBytes;
use crate::given::{Given, gives_resources};
use crate::hit::Hit;
use crate::mock::{Answer, CallableCall, ExecuteCall, TraceCall, in_turn};
use crate::scalars::{NestedScalars, Scalars, builtin_words};
use crate::shader_outcome::ReportedHit;
use crate::struct_data::StructData;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::accel::{RayFlags, TraceRay};
use anyhit_engine::geometry::Ray;
use anyhit_engine::machine::{Batch, Buffer, LaunchLimits};
use anyhit_engine::module::Module;
use anyhit_engine::module::interface::Stage;
use anyhit_engine::ops::builtin::Builtin;
use anyhit_engine::pipeline::{DEFAULT_FUEL, Event};
use anyhit_engine::program::Program;

/// A shader with everything that one invocation of it sees.
///
/// Builtins follow from a [`Hit`] (closest-hit, any-hit and intersection shaders) or a ray (miss
/// shaders), and any of them can be set to any value. What is not given is zero.
///
/// ```
/// use anyhit::{Hit, Module, Ray, ShaderTest};
///
/// # fn main() -> anyhit::Result<()> {
/// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
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
#[must_use]
pub struct ShaderTest {
    pub(crate) program: Arc<Program>,
    hit: Option<Hit>,
    trace: Option<TraceRay>,
    launch: [[u32; 3]; 2],
    builtins: Vec<(&'static Builtin, Vec<u32>)>,
    payload: Option<HostBytes>,
    members: Vec<(String, NestedScalars)>,
    attributes: Option<HostBytes>,
    record: Option<HostBytes>,
    given: Given,
    traces: Option<Answer<TraceCall>>,
    executes: Option<Answer<ExecuteCall>>,
    object_record: Option<Arc<Buffer>>,
    calls: Option<Answer<CallableCall>>,
    reports: Option<Answer<ReportedHit>>,
    fuel: u64,
    launch_limits: LaunchLimits,
    /// The first mistake, which [`ShaderTest::run`] returns.
    mistake: Option<Error>,
}

/// The invocation of a shader under test that has begun.
#[derive(Clone, Debug)]
struct RunningTest {
    batch: Batch<1>,
    /// What an explanation of the run tells.
    events: Vec<Event>,
    traces: Vec<TraceCall>,
    executes: Vec<ExecuteCall>,
    calls: Vec<CallableCall>,
    reports: Vec<ReportedHit>,
}

impl ShaderTest {
    /// The shader with an entry point's name.
    ///
    /// # Errors
    /// `InvalidArgument` where no entry point or several have the name, and what makes a module
    /// unusable.
    pub fn new(module: &Arc<Module>, entry: &str) -> Result<Self> {
        Self::of(Program::of(module, entry)?)
    }

    /// The shader with a stage and an entry point's name, where several stages share the name.
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
            let message = format!("`ShaderTest` does not support {} shaders", program.stage.name());
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
            given: Given::default(),
            traces: None,
            executes: None,
            object_record: None,
            calls: None,
            reports: None,
            fuel: DEFAULT_FUEL,
            launch_limits: LaunchLimits::UNIT_TESTS,
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

    /// `LaunchIdKHR` and `LaunchSizeKHR`; (0, 0, 0) of (1, 1, 1) unless set. An id outside the size
    /// is an error of the run.
    #[must_use]
    pub fn launch(self, id: [u32; 3], size: [u32; 3]) -> Self {
        Self { launch: [id, size], ..self }
    }

    /// Sets a builtin by its name in SPIR-V, consistent with the rest or not: `"HitKindKHR"`,
    /// `"PrimitiveId"`, `"RayTmaxKHR"`. The suffix may be left out. One that the shader does not
    /// read is an error of the run.
    #[must_use]
    pub fn builtin(mut self, name: &str, value: impl Scalars) -> Self {
        match builtin_words(&self.program.module, name, &value.nested()) {
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
        Self { payload: Some(HostBytes::of(payload)), ..self }
    }

    /// Sets a member of the payload, or of the callable data, by its path:
    /// `.payload_member("path[1].weight", 0.5f32)`.
    #[must_use]
    pub fn payload_member(mut self, path: &str, value: impl Scalars) -> Self {
        self.members.push((path.to_owned(), value.nested()));
        self
    }

    /// The hit attributes, in place of those of the [`Hit`].
    #[must_use]
    pub fn attributes<T: NoUninit + Debug>(self, attributes: &T) -> Self {
        Self { attributes: Some(HostBytes::of(attributes)), ..self }
    }

    /// The data of the shader record behind its handle (`shaderRecordEXT`).
    #[must_use]
    pub fn shader_record<T: NoUninit + Debug>(self, record: &T) -> Self {
        Self { record: Some(HostBytes::of(record)), ..self }
    }

    /// The data of the shader record as bytes, little-endian, whatever types the shader declares.
    #[must_use]
    pub fn shader_record_bytes(self, bytes: &[u8]) -> Self {
        Self { record: Some(HostBytes::raw(bytes)), ..self }
    }

    /// The data of the shader record, written by the names of its members.
    #[must_use]
    pub fn shader_record_data(self, record: &StructData) -> Self {
        Self { record: Some(record.given()), ..self }
    }

    /// Answers the traces that the shader makes, in place of a scene: the closure sees ray and
    /// operands, and leaves the payload that the shader goes on with.
    ///
    /// ```
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
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

    /// Answers the hit objects that the shader executes (`OpHitObjectExecuteShaderEXT`), in place
    /// of closest-hit and miss shaders: the closure sees what is executed, and leaves the payload
    /// that the shader goes on with.
    ///
    /// A trace into a hit object is answered by [`ShaderTest::on_trace`], where
    /// [`TraceCall::hit`] says what it finds.
    #[must_use]
    pub fn on_execute(self, answer: impl Fn(&mut ExecuteCall) -> Result<()> + Send + Sync + 'static) -> Self {
        Self { executes: Some(Answer::new(answer)), ..self }
    }

    /// Answers the hit objects that the shader executes with these payloads, one after the other. A
    /// shader that executes more, or fewer, is an error of the run.
    #[must_use]
    pub fn execute_answers<T: NoUninit + Debug>(self, payloads: &[T]) -> Self {
        Self { executes: Some(in_turn(payloads, "execution", ExecuteCall::parts)), ..self }
    }

    /// The data behind the handle of every hit object's shader record
    /// (`OpHitObjectGetShaderRecordBufferHandleEXT`).
    #[must_use]
    pub fn hit_object_record<T: NoUninit + Debug>(self, record: &T) -> Self {
        Self { object_record: Some(Buffer::new(bytemuck::bytes_of(record))), ..self }
    }

    /// Answers the shader's traces with these payloads, one after the other. A shader that makes
    /// more traces, or fewer, is an error of the run.
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

    /// Answers the shader's calls with these data, one after the other. A shader that makes more
    /// calls, or fewer, is an error of the run.
    #[must_use]
    pub fn call_answers<T: NoUninit + Debug>(self, data: &[T]) -> Self {
        Self { calls: Some(in_turn(data, "call", CallableCall::parts)), ..self }
    }

    /// Decides on the reports of an intersection shader, as an any-hit shader would: `true`
    /// accepts. Reports outside the ray's interval are not asked about.
    #[must_use]
    pub fn on_report(self, decide: impl Fn(&ReportedHit) -> bool + Send + Sync + 'static) -> Self {
        let answer = Answer::new(move |report: &mut ReportedHit| {
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

    /// Sets how many instructions the shader may execute, counted at back edges and calls.
    #[must_use]
    pub fn fuel(self, instructions: u64) -> Self {
        Self { fuel: instructions, ..self }
    }

    /// Sets the limits of the run; unless set, the shader is stopped after 8 seconds, as by
    /// `anyhit test`. Limits without a time leave an endless loop to [`ShaderTest::fuel`] alone.
    ///
    /// ```
    /// use std::time::Duration;
    ///
    /// use anyhit::{LaunchLimits, Module, ShaderTest};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// # let module = Module::open("spirv-fixtures/pass/sphere/closest-hit/main.rchit.spv")?;
    /// let limits = LaunchLimits::default().timeout(Duration::from_secs(300));
    /// let test = ShaderTest::new(&module, "main")?.launch_limits(limits);
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn launch_limits(self, limits: LaunchLimits) -> Self {
        Self { launch_limits: limits, ..self }
    }

    /// Keeps the first mistake.
    fn mistaken(mut self, error: Error) -> Self {
        self.mistake.get_or_insert(error);
        self
    }
}

gives_resources!(ShaderTest);

fn invalid(message: String) -> Error {
    Error::new(ErrorKind::InvalidArgument, message)
}
