//! One shader by itself.

use std::sync::{Arc, Mutex, PoisonError};

use anyhit::{StructData, Value};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::{from_python, invalid, raised};
use crate::instance::{Hit, Ray};
use crate::module::{Module, Program};
use crate::numbers::{F32, Member, Plain, members, nested};
use crate::outcome::ShaderOutcome;
use crate::payload;
use crate::run::{interruptible, run};
use crate::scene::{buffer_bytes, filled, image};
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
    /// What a callback has raised, which `run` raises again.
    raised: Arc<Mutex<Option<PyErr>>>,
}

impl ShaderTest {
    fn with(&self, change: impl FnOnce(anyhit::ShaderTest) -> anyhit::ShaderTest) -> Self {
        Self { test: change(self.test.clone()), ..self.clone() }
    }
}

#[pymethods]
impl ShaderTest {
    /// The entry point of a module; with its stage, where several stages share the name.
    #[new]
    #[pyo3(signature = (module, entry="main", stage=None))]
    fn new(py: Python<'_>, module: &Module, entry: &str, stage: Option<&str>) -> PyResult<Self> {
        let test = match stage {
            None => run(py, || anyhit::ShaderTest::new(&module.module, entry))?,
            Some(_) => {
                let program = Program::of(py, module, entry, stage)?.program;
                anyhit::ShaderTest::of(program).map_err(raised)?
            }
        };
        let payload = payload::of_program(&Program::of(py, module, entry, stage)?.program);
        Ok(Self { test, module: module.clone(), payload, raised: Arc::default() })
    }

    /// What was hit, and by which ray: all builtins of a hit shader, and its hit attributes.
    fn hit(&self, hit: &Hit) -> Self {
        self.with(|test| test.hit(hit.hit.clone()))
    }

    /// The ray of a miss shader, or of a hit shader whose builtins are all set by name.
    fn ray(&self, ray: &Ray) -> Self {
        self.with(|test| test.ray(ray.ray))
    }

    /// Sets `LaunchIdKHR` and `LaunchSizeKHR`.
    #[pyo3(name = "launch")]
    fn at_launch(&self, id: [u32; 3], size: [u32; 3]) -> Self {
        self.with(|test| test.launch(id, size))
    }

    /// Sets a builtin by its name in SPIR-V, consistent with the rest or not: "HitKindKHR",
    /// "RayTmax". A number, or a list of them.
    fn builtin(&self, name: &str, value: &Bound<'_, PyAny>) -> PyResult<Self> {
        let value = nested(name, value, 0)?;
        Ok(self.with(|test| test.builtin(name, value)))
    }

    /// Sets the payload that the shader is given, or the callable data: a dict by the names of its
    /// members, of which those left out are zero.
    fn payload(&self, values: &Bound<'_, PyAny>) -> PyResult<Self> {
        let Some(shape) = &self.payload else {
            return Err(invalid("the shader takes no payload"));
        };
        let members = members(shape, values)?;
        Ok(self.with(|test| {
            members.into_iter().fold(test, |test, (path, value)| test.payload_member(&path, value))
        }))
    }

    /// Sets the hit attributes, in place of those of the hit.
    fn attributes(&self, attributes: [F32; 2]) -> Self {
        self.with(|test| test.attributes(&attributes.plain()))
    }

    /// Sets the data of the shader record, by the names of its members.
    fn shader_record(&self, values: &Bound<'_, PyDict>) -> PyResult<Self> {
        let data = filled(StructData::shader_record(&self.module.module).map_err(raised)?, values)?;
        Ok(self.with(|test| test.shader_record_data(&data)))
    }

    /// Sets the push constants, by the names of their members.
    fn push_constants(&self, values: &Bound<'_, PyDict>) -> PyResult<Self> {
        let data = filled(StructData::push_constants(&self.module.module).map_err(raised)?, values)?;
        Ok(self.with(|test| test.push_constants_data(&data)))
    }

    /// Binds a storage or uniform buffer: an array, C-contiguous, whose dtype and shape are
    /// compared with what the shader declares; `bytes` or an array of `uint8`, which are not; or
    /// a dict by the names of its members.
    fn buffer(&self, set: u32, binding: u32, data: &Bound<'_, PyAny>) -> PyResult<Self> {
        let bytes = buffer_bytes(set, binding, data, Some(&self.module))?;
        Ok(self.with(|test| test.buffer_of(set, binding, bytes)))
    }

    /// Binds a storage or sampled image of a format, which is the one that the shader declares: an
    /// array (height, width, 4) of float32, or of uint32, int32, uint64 or int64 for a format of
    /// such integers. The names of formats are GLSL's: `"rgba32f"`, `"rgba8"`, `"r32ui"`.
    #[pyo3(signature = (set, binding, texels, format="rgba32f"))]
    fn image(&self, set: u32, binding: u32, texels: &Bound<'_, PyAny>, format: &str) -> PyResult<Self> {
        let image = image(texels, format)?;
        Ok(self.with(|test| test.image(set, binding, image)))
    }

    /// Sets how many instructions the shader may execute.
    fn fuel(&self, instructions: u64) -> Self {
        self.with(|test| test.fuel(instructions))
    }

    /// Answers the traces that the shader makes, in place of a scene: the callback sees a
    /// `TraceCall` and returns a dict of the members of the payload that it changes, or `None`.
    fn on_trace(&self, callback: Py<PyAny>) -> Self {
        let raised = self.raised.clone();
        let answer = move |trace: &mut anyhit::TraceCall| {
            let answered = Python::attach(|py| {
                let call = TraceCall { call: trace.clone() };
                let answer = callback.bind(py).call1((call,)).and_then(|answer| match answer.is_none() {
                    true => Ok(Vec::new()),
                    false => members(&trace.payload.value(), &answer),
                });
                answer.map_err(|error| keep(py, &raised, error))
            });
            write(&mut trace.payload, answered?)
        };
        self.with(|test| test.on_trace(answer))
    }

    /// Answers the callable shaders that the shader calls: the callback sees the SBT index and the
    /// callable data, and returns a dict of the members that it changes, or `None`.
    fn on_call(&self, callback: Py<PyAny>) -> Self {
        let raised = self.raised.clone();
        let answer = move |call: &mut anyhit::CallableCall| {
            let answered = Python::attach(|py| {
                let shape = call.data.value();
                let answer = to_python(py, &shape)
                    .and_then(|data| callback.bind(py).call1((call.index, data)))
                    .and_then(|answer| match answer.is_none() {
                        true => Ok(Vec::new()),
                        false => members(&shape, &answer),
                    });
                answer.map_err(|error| keep(py, &raised, error))
            });
            write(&mut call.data, answered?)
        };
        self.with(|test| test.on_call(answer))
    }

    /// Answers every report of an intersection shader with "rejected".
    fn reject_reports(&self) -> Self {
        self.with(anyhit::ShaderTest::reject_reports)
    }

    /// Runs the shader once.
    fn run(&self, py: Python<'_>) -> PyResult<ShaderOutcome> {
        match interruptible(py, || self.test.clone().run())? {
            Ok(outcome) => Ok(ShaderOutcome { outcome }),
            Err(error) => Err(self.raised(error)),
        }
    }

    /// Runs the shader once under the sanitizer. Returns the reports of what it only warns of.
    fn sanitize(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        match interruptible(py, || self.test.clone().sanitize())? {
            Ok(warnings) => Ok(warnings.iter().map(anyhit::Error::render).collect()),
            Err(error) => Err(self.raised(error)),
        }
    }
}

impl ShaderTest {
    /// What a callback has raised, or else the error.
    fn raised(&self, error: anyhit::Error) -> PyErr {
        let callback = self.raised.lock().unwrap_or_else(PoisonError::into_inner).take();
        callback.unwrap_or_else(|| raised(error))
    }
}

/// Keeps what a callback has raised, and returns an error that ends the run.
fn keep(py: Python<'_>, slot: &Mutex<Option<PyErr>>, error: PyErr) -> anyhit::Error {
    let ends = from_python(py, &error);
    *slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
    ends
}

/// Writes the members that a callback has returned.
fn write(data: &mut anyhit::TypedBytes, members: Vec<Member>) -> anyhit::Result<()> {
    members.into_iter().try_for_each(|(path, value)| data.set(&path, value))
}

/// A trace as the tested shader executes it.
#[pyclass(frozen, module = "anyhit")]
pub(crate) struct TraceCall {
    pub(crate) call: anyhit::TraceCall,
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
