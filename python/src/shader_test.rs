//! One shader by itself.

use std::cell::RefCell;
use std::sync::{Arc, Mutex, PoisonError};

use anyhit::{StructData, Value};
use anyhit_engine::machine::Binding;
use pyo3::call::PyCallArgs;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::argument::{self, wrong_class};
use crate::copies::never_changes;
use crate::coverage::counted;
use crate::debugger::Prompt;
use crate::error::{from_python, invalid, raised};
use crate::given::binds_resources;
use crate::instance::{Hit, Instance, Ray};
use crate::module::{Module, Program};
use crate::numbers::{Member, members, nested};
use crate::outcome::{ShaderOutcome, report_dict};
use crate::payload;
use crate::place::Place;
use crate::run::interruptible;
use crate::scene::filled;
use crate::used::Use;
use crate::value::to_python;

/// A shader with everything that one invocation of it sees. Methods return a test that also has
/// what they are given; what is not given is zero.
#[pyclass(frozen, module = "anyhit")]
#[derive(Clone)]
pub(crate) struct ShaderTest {
    test: anyhit::ShaderTest,
    module: Module,
    /// Zeros of the payload that the shader takes.
    payload: Option<Value>,
    program: Arc<anyhit::Program>,
    used: Use,
}

thread_local! {
    /// Exception of a callback of this thread's running test, which `run` raises again.
    static RAISED: RefCell<Option<PyErr>> = const { RefCell::new(None) };
}

impl ShaderTest {
    fn with(
        &self,
        method: &'static str,
        change: impl FnOnce(anyhit::ShaderTest) -> anyhit::ShaderTest,
    ) -> Self {
        Self { test: change(self.test.clone()), used: Use::of("ShaderTest", method), ..self.clone() }
    }

    fn binding(&self, place: &Place) -> PyResult<Binding> {
        self.used.mark();
        place.binding([&*self.module.module])
    }
}

#[pymethods]
impl ShaderTest {
    /// The entry point of a module; with its stage, where several stages share the name.
    /// `specialization` is a dict of constants by their `SpecId`.
    #[new]
    #[pyo3(
        signature = (module, entry="main".to_owned(), stage=None, *, specialization=None),
        text_signature = "(module, entry='main', stage=None, *, specialization=None)"
    )]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = argument::module)] module: Module,
        #[pyo3(from_py_with = argument::entry)] entry: String,
        #[pyo3(from_py_with = argument::of_stage)] stage: Option<String>,
        specialization: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let module = module.specialized(specialization)?;
        let program = Program::of(py, &module, &entry, stage.as_deref())?.program;
        let test = anyhit::ShaderTest::of(program.clone()).map_err(raised)?;
        let payload = payload::of_program(&program);
        Ok(Self { test, module, payload, program, used: Use::free() })
    }

    /// What was hit, and by which ray: all builtins of a hit shader, and its hit attributes.
    fn hit(&self, #[pyo3(from_py_with = argument::hit)] hit: Hit) -> Self {
        self.with("hit", |test| test.hit(hit.hit))
    }

    /// The ray of a miss shader, or of a hit shader whose builtins are all set by name.
    fn ray(&self, #[pyo3(from_py_with = argument::ray)] ray: Ray) -> Self {
        self.with("ray", |test| test.ray(ray.ray))
    }

    /// Sets `LaunchIdKHR` and `LaunchSizeKHR`.
    #[pyo3(name = "launch")]
    fn at_launch(
        &self,
        #[pyo3(from_py_with = argument::id)] id: [u32; 3],
        #[pyo3(from_py_with = argument::size)] size: [u32; 3],
    ) -> Self {
        self.with("launch", |test| test.launch(id, size))
    }

    /// Sets a builtin by its name in SPIR-V, consistent with the rest or not: "HitKindKHR",
    /// "RayTmax". A number, or a list of them.
    fn builtin(
        &self,
        #[pyo3(from_py_with = argument::name)] name: String,
        value: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let value = nested(&name, value, 0)?;
        Ok(self.with("builtin", |test| test.builtin(&name, value)))
    }

    /// Sets the payload that the shader is given, or the callable data: a dict by the names of its
    /// members, of which those left out are zero.
    fn payload(&self, values: &Bound<'_, PyAny>) -> PyResult<Self> {
        let Some(shape) = &self.payload else {
            return Err(invalid("values: the shader takes no payload"));
        };
        if values.is_none() {
            return Err(wrong_class("values", "a dict, or a value where the payload is no struct", values));
        }
        let members = members(shape, values)?;
        Ok(self.with("payload", |test| {
            members.into_iter().fold(test, |test, (path, value)| test.payload_member(&path, value))
        }))
    }

    /// Sets the hit attributes, in place of those of the hit.
    fn attributes(&self, #[pyo3(from_py_with = argument::attributes)] attributes: [f32; 2]) -> Self {
        self.with("attributes", |test| test.attributes(&attributes))
    }

    /// Sets the data of the shader record, by the names of its members.
    fn shader_record(&self, values: &Bound<'_, PyAny>) -> PyResult<Self> {
        let data = StructData::shader_record(&self.module.module).map_err(raised)?;
        let data = filled(data, "values", values)?;
        Ok(self.with("shader_record", |test| test.shader_record_data(&data)))
    }

    /// Answers the traces that the shader makes, in place of a scene: the callback sees a
    /// `TraceCall` and returns a dict of the members of the payload that it changes, or `None`.
    fn on_trace(&self, callback: Py<PyAny>) -> Self {
        let answer = move |trace: &mut anyhit::TraceCall| {
            let answered = Python::attach(|py| {
                let found = Arc::default();
                let call = TraceCall { call: trace.clone(), found: Arc::clone(&found) };
                let answer = answered(callback.bind(py), (call,), &trace.payload.value());
                if let Some(instance) = found.lock().unwrap_or_else(PoisonError::into_inner).take() {
                    trace.hit(instance);
                }
                answer.map_err(|error| keep(py, error))
            });
            write(&mut trace.payload, answered?)
        };
        self.with("on_trace", |test| test.on_trace(answer))
    }

    /// Answers the callable shaders that the shader calls: the callback sees the SBT index and the
    /// callable data, and returns a dict of the members that it changes, or `None`.
    fn on_call(&self, callback: Py<PyAny>) -> Self {
        let answer = move |call: &mut anyhit::CallableCall| {
            let answered = Python::attach(|py| {
                let shape = call.data.value();
                let answer = to_python(py, &shape)
                    .and_then(|data| answered(callback.bind(py), (call.index, data), &shape));
                answer.map_err(|error| keep(py, error))
            });
            write(&mut call.data, answered?)
        };
        self.with("on_call", |test| test.on_call(answer))
    }

    /// Answers the hit objects that the shader executes, in place of closest-hit and miss shaders:
    /// the callback sees an `ExecuteCall` and returns a dict of the members of the payload that it
    /// changes, or `None`.
    fn on_execute(&self, callback: Py<PyAny>) -> Self {
        let answer = move |execute: &mut anyhit::ExecuteCall| {
            let answered = Python::attach(|py| {
                let call = ExecuteCall { call: execute.clone() };
                let answer = answered(callback.bind(py), (call,), &execute.payload.value());
                answer.map_err(|error| keep(py, error))
            });
            write(&mut execute.payload, answered?)
        };
        self.with("on_execute", |test| test.on_execute(answer))
    }

    /// Decides on the reports of an intersection shader, as an any-hit shader would: the callback
    /// sees a dict of `t`, `kind` and `attributes`, and returns whether it accepts. It is not asked
    /// about reports outside of the ray's interval.
    fn on_report(&self, callback: Py<PyAny>) -> Self {
        let decide = move |report: &anyhit::ReportedHit| {
            let decided = Python::attach(|py| {
                let asked = report_dict(py, report).and_then(|dict| {
                    dict.del_item("accepted")?;
                    callback.bind(py).call1((dict,))?.is_truthy()
                });
                asked.map_err(|error| keep(py, error))
            });
            decided.unwrap_or(false)
        };
        self.with("on_report", |test| test.on_report(decide))
    }

    /// Answers every report of an intersection shader with "rejected".
    fn reject_reports(&self) -> Self {
        self.with("reject_reports", anyhit::ShaderTest::reject_reports)
    }

    /// Runs the shader once.
    fn run(&self, py: Python<'_>) -> PyResult<ShaderOutcome> {
        self.used.mark();
        let test = &self.test;
        let outcome =
            self.finish(py, || counted(&self.program, || test.run(), |counts| test.run_counted(counts)))?;
        Ok(ShaderOutcome { outcome, programs: [self.program.clone()] })
    }

    /// Runs the shader in the debugger, and returns the transcript of commands, one a line.
    fn debug(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::commands)] commands: String,
    ) -> PyResult<String> {
        self.used.mark();
        self.finish(py, || self.test.debug(&commands))
    }

    /// Runs the shader in the debugger, which `read` gives commands.
    fn _debug_with(
        &self,
        read: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = argument::colours)] colours: bool,
    ) -> PyResult<()> {
        self.used.mark();
        let session = Prompt { read, colours }.run(|| self.test.debugger());
        RAISED.take().map_or(session, Err)
    }

    fn __repr__(&self) -> String {
        format!("<anyhit.ShaderTest: {} {}>", self.program.stage.name(), self.program.name)
    }

    /// Runs the shader once under the sanitizer. Returns the reports of what it only warns of.
    fn sanitize(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.used.mark();
        let warnings = self.finish(py, || self.test.clone().sanitize())?;
        Ok(warnings.iter().map(anyhit::Error::render).collect())
    }
}

impl ShaderTest {
    /// The result of a run, or the exception that a callback raises meanwhile.
    fn finish<T: Send>(&self, py: Python<'_>, run: impl FnOnce() -> anyhit::Result<T> + Send) -> PyResult<T> {
        let result = interruptible(py, run);
        match RAISED.take() {
            Some(exception) => Err(exception),
            None => result?.map_err(raised),
        }
    }
}

binds_resources!(ShaderTest);

/// The members that a callback changes; none where it returns `None`.
fn answered<'py>(
    callback: &Bound<'py, PyAny>,
    arguments: impl PyCallArgs<'py>,
    shape: &Value,
) -> PyResult<Vec<Member>> {
    let answer = callback.call1(arguments)?;
    if answer.is_none() { Ok(Vec::new()) } else { members(shape, &answer) }
}

/// Keeps what a callback has raised, and returns an error that ends the run.
fn keep(py: Python<'_>, error: PyErr) -> anyhit::Error {
    let ends = from_python(py, &error);
    RAISED.set(Some(error));
    ends
}

/// Writes the members that a callback has returned.
fn write(data: &mut anyhit::TypedBytes, members: Vec<Member>) -> anyhit::Result<()> {
    members.into_iter().try_for_each(|(path, value)| data.set(&path, value))
}

/// A hit object as the tested shader executes it.
#[pyclass(frozen, module = "anyhit")]
pub(crate) struct ExecuteCall {
    pub(crate) call: anyhit::ExecuteCall,
}

#[pymethods]
impl ExecuteCall {
    /// How many hit objects the shader executed before.
    #[getter]
    fn number(&self) -> usize {
        self.call.number
    }

    /// The ray that the hit object encodes.
    #[getter]
    fn ray(&self) -> Ray {
        Ray { ray: self.call.trace.ray }
    }

    /// The closest hit, a dict of its indices, `t`, `kind` and `attributes`; `None` for a miss.
    #[getter]
    fn hit<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(hit) = self.call.hit else { return Ok(None) };
        let dict = PyDict::new(py);
        dict.set_item("instance", hit.instance)?;
        dict.set_item("custom_index", hit.custom_index)?;
        dict.set_item("geometry", hit.geometry)?;
        dict.set_item("primitive", hit.primitive)?;
        dict.set_item("t", hit.t)?;
        dict.set_item("kind", hit.kind.0)?;
        dict.set_item("attributes", hit.attributes)?;
        Ok(Some(dict))
    }

    /// The index into the table of hit groups, or of miss shaders.
    #[getter]
    fn record(&self) -> u64 {
        self.call.record
    }

    /// The payload as the shader gives it.
    #[getter]
    fn given<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.call.given)
    }

    /// The payload as the answer leaves it.
    #[getter]
    fn payload<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.call.payload.value())
    }

    fn __repr__(&self) -> String {
        format!("<anyhit.ExecuteCall {}: record {}>", self.call.number, self.call.record)
    }
}

/// A trace as the tested shader executes it.
#[pyclass(frozen, module = "anyhit")]
pub(crate) struct TraceCall {
    pub(crate) call: anyhit::TraceCall,
    /// What a trace into a hit object finds.
    pub(crate) found: Arc<Mutex<Option<anyhit::Instance>>>,
}

#[pymethods]
impl TraceCall {
    /// How many traces the shader made before.
    #[getter]
    fn number(&self) -> usize {
        self.call.number
    }

    /// The ray.
    #[getter]
    fn ray(&self) -> Ray {
        Ray { ray: self.call.trace.ray }
    }

    /// The ray flags.
    #[getter]
    fn flags(&self) -> u32 {
        self.call.trace.flags.0
    }

    /// The cull mask.
    #[getter]
    fn cull_mask(&self) -> u32 {
        self.call.trace.cull_mask
    }

    /// The time of the ray.
    #[getter]
    fn time(&self) -> f32 {
        self.call.trace.time
    }

    /// The SBT offset.
    #[getter]
    fn sbt_offset(&self) -> u32 {
        self.call.sbt_offset
    }

    /// The SBT stride.
    #[getter]
    fn sbt_stride(&self) -> u32 {
        self.call.sbt_stride
    }

    /// The miss index.
    #[getter]
    fn miss_index(&self) -> u32 {
        self.call.miss_index
    }

    /// Whether it is traced into a hit object: `hit` says what that finds.
    #[getter(into_hit_object)]
    fn is_into_hit_object(&self) -> bool {
        self.call.into_hit_object
    }

    /// Lets a trace into a hit object meet this instance alone; where the ray passes by, and
    /// without this, the hit object encodes a miss.
    fn hit(&self, #[pyo3(from_py_with = argument::instance)] instance: Instance) {
        *self.found.lock().unwrap_or_else(PoisonError::into_inner) = Some(instance.instance);
    }

    fn __repr__(&self) -> String {
        let anyhit::Ray { origin, direction, .. } = self.call.trace.ray;
        format!("<anyhit.TraceCall {}: from {origin:?} towards {direction:?}>", self.call.number)
    }

    /// The payload as the shader gives it.
    #[getter]
    fn given<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.call.given)
    }

    /// The payload as the answer leaves it.
    #[getter]
    fn payload<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.call.payload.value())
    }
}

never_changes!(ShaderTest, ExecuteCall, TraceCall);
