//! One compute shader by itself.

use std::sync::Arc;

use anyhit::SeededRuns;
use anyhit_engine::machine::Binding;
use anyhit_unit_test::data::HostBytes;
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyInt};

use crate::argument::{self, Argument, items, wrong_class};
use crate::bound::{block, reads_what_is_bound};
use crate::copies::never_changes;
use crate::coverage::counted;
use crate::debugger::Prompt;
use crate::dtype::buffer_array;
use crate::error::raised;
use crate::given::binds_resources;
use crate::module::{Module, Program};
use crate::outcome::{printed, stats};
use crate::place::{Place, split_with};
use crate::run::run;
use crate::scene::{Scene, buffer_bytes};
use crate::used::Use;

/// A compute shader with what it has bound, and how many workgroups of it run. A test is a value:
/// methods return a test that also has what they are given. Set and binding may be the name of a
/// variable of the shader.
#[pyclass(frozen, module = "anyhit")]
#[derive(Clone)]
pub(crate) struct ComputeTest {
    test: anyhit::ComputeTest,
    module: Module,
    program: Arc<anyhit::Program>,
    used: Use,
}

impl ComputeTest {
    fn with(
        &self,
        method: &'static str,
        change: impl FnOnce(anyhit::ComputeTest) -> anyhit::ComputeTest,
    ) -> Self {
        Self { test: change(self.test.clone()), used: Use::of("ComputeTest", method), ..self.clone() }
    }

    fn binding(&self, place: &Place) -> PyResult<Binding> {
        self.used.mark();
        place.binding([&*self.module.module])
    }

    fn bytes(&self, place: &Place, data: &Bound<'_, PyAny>) -> PyResult<(Binding, HostBytes)> {
        let at = self.binding(place)?;
        Ok((at, buffer_bytes(at, data, &self.module)?))
    }

    /// The content that an output buffer begins with: data, or zeros for so many elements.
    fn output(&self, at: Binding, data: &Bound<'_, PyAny>) -> PyResult<HostBytes> {
        if !data.is_instance_of::<PyInt>() {
            return buffer_bytes(at, data, &self.module);
        }
        let count = usize::of("a number of elements", data)?;
        let programs = [self.program.clone()];
        let size = match block(&programs, at).map(|block| (block.size(), block.runtime_stride())) {
            None => Some(count),
            Some((_, Some((offset, stride)))) => {
                stride.checked_mul(count).and_then(|size| size.checked_add(offset))
            }
            Some((size, None)) => Some(size),
        };
        let (limit, size) = (anyhit::InputLimit::BufferBytes, size.unwrap_or(usize::MAX));
        let limits = &self.module.module.limits;
        limits.check(limit, size as u64, anyhit::ErrorKind::InvalidArgument).map_err(raised)?;
        Ok(HostBytes::raw(&vec![0; size]))
    }
}

/// Numbers of workgroups along x, y and z: one number, or a list of up to three.
fn groups_of(given: &Bound<'_, PyAny>) -> PyResult<[u32; 3]> {
    if given.is_instance_of::<PyInt>() {
        return Ok([u32::of("groups", given)?, 1, 1]);
    }
    let mut groups = [1; 3];
    let items =
        items("groups", given, 4).map_err(|_| wrong_class("groups", "int or up to three of them", given))?;
    let all: Vec<u32> = items.map(|one| u32::of("groups", &one?)).collect::<PyResult<_>>()?;
    if all.is_empty() || all.len() > 3 {
        return Err(wrong_class("groups", "int or up to three of them", given));
    }
    groups[..all.len()].copy_from_slice(&all);
    Ok(groups)
}

/// The most outputs of a test.
const MAX_OUTPUTS: usize = 1 << 16;

/// The keys of outputs, and what their buffers begin with, where that is given.
type Outputs<'py> = Vec<(Bound<'py, PyAny>, Option<Bound<'py, PyAny>>)>;

fn outputs_of<'py>(given: &Bound<'py, PyAny>) -> PyResult<Outputs<'py>> {
    if let Ok(dict) = given.cast::<PyDict>() {
        return Ok(dict.iter().map(|(key, data)| (key, Some(data))).collect());
    }
    let keys = items("outputs", given, MAX_OUTPUTS);
    let keys = keys.map_err(|_| wrong_class("outputs", "a dict or a list of bindings", given))?;
    keys.map(|key| Ok((key?, None))).collect()
}

#[pymethods]
impl ComputeTest {
    /// The compute shader of a module; `specialization` is a dict of constants by their `SpecId`.
    #[new]
    #[pyo3(
        signature = (module, entry="main".to_owned(), *, specialization=None),
        text_signature = "(module, entry='main', *, specialization=None)"
    )]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = argument::module)] module: Module,
        #[pyo3(from_py_with = argument::entry)] entry: String,
        specialization: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let module = module.specialized(specialization)?;
        let program = Program::of(py, &module, &entry, Some("GLCompute"))?.program;
        let test = anyhit::ComputeTest::of(program.clone()).map_err(raised)?;
        Ok(Self { test, module, program, used: Use::free() })
    }

    /// Sets the number of workgroups along x, y and z; one unless set.
    #[pyo3(signature = (x, y=1, z=1))]
    fn workgroups(
        &self,
        #[pyo3(from_py_with = argument::x)] x: u32,
        #[pyo3(from_py_with = argument::y)] y: u32,
        #[pyo3(from_py_with = argument::z)] z: u32,
    ) -> Self {
        self.with("workgroups", |test| test.workgroups([x, y, z]))
    }

    /// Binds the acceleration structure of a scene, for ray queries.
    #[pyo3(signature = (set, binding=None, scene=None))]
    fn scene(
        &self,
        set: &Bound<'_, PyAny>,
        binding: Option<&Bound<'_, PyAny>>,
        scene: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (place, scene) = split_with("scene", set, binding, scene)?;
        let (at, scene) = (self.binding(&place)?, Scene::of("scene", scene)?);
        Ok(self.with("scene", |test| test.scene(at.set, at.binding, &scene.scene)))
    }

    /// Sets `SubgroupSize`: a power of two from 1 to 128.
    fn subgroup_size(&self, #[pyo3(from_py_with = argument::subgroup_size)] size: u32) -> PyResult<Self> {
        let test = self.test.clone().subgroup_size(size).map_err(raised)?;
        Ok(self.with("subgroup_size", |_| test))
    }

    /// Runs all workgroups. `inputs` is a dict of buffers, and `groups` the number of workgroups,
    /// in place of those that are set. With `outputs` it returns a dict of these buffers as arrays:
    /// a list of bindings, or a dict of what each buffer begins with, data or a number of elements.
    /// Keys are names, bindings of set 0, or `(set, binding)`. Without `outputs` it returns a
    /// `ComputeOutcome`.
    #[pyo3(signature = (inputs=None, outputs=None, *, groups=None))]
    fn run<'py>(
        &self,
        py: Python<'py>,
        inputs: Option<&Bound<'py, PyAny>>,
        outputs: Option<&Bound<'py, PyAny>>,
        groups: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.used.mark();
        let mut test = self.clone();
        if let Some(inputs) = inputs {
            let inputs = inputs.cast::<PyDict>().map_err(|_| wrong_class("inputs", "dict", inputs))?;
            for (key, data) in inputs {
                let (at, bytes) = test.bytes(&Place::of_key(&key)?, &data)?;
                test.test = test.test.buffer_of(at.set, at.binding, bytes);
            }
        }
        let outputs = outputs.map(outputs_of).transpose()?;
        let mut places = Vec::new();
        for (key, data) in outputs.iter().flatten() {
            let at = self.binding(&Place::of_key(key)?)?;
            if let Some(data) = data {
                test.test = test.test.buffer_of(at.set, at.binding, self.output(at, data)?);
            }
            places.push(at);
        }
        if let Some(groups) = groups {
            test.test = test.test.workgroups(groups_of(groups)?);
        }
        let one = &test.test;
        let outcome = run(py, || counted(&self.program, || one.run(), |counts| one.run_counted(counts)))?;
        let programs = [self.program.clone()];
        let Some(outputs) = outputs else {
            return Ok(Bound::new(py, ComputeOutcome { outcome, programs })?.into_any());
        };
        let arrays = PyDict::new(py);
        for ((key, data), at) in outputs.into_iter().zip(places) {
            let bytes = outcome.buffer_bytes(at.set, at.binding).map_err(raised)?;
            let array = match data.as_ref().map(|data| data.cast::<PyUntypedArray>()) {
                Some(Ok(given)) => {
                    let array = buffer_array(py, bytes, Some(given.dtype().as_any()), None)?;
                    array.call_method1("reshape", (given.getattr("shape")?,))?
                }
                _ => buffer_array(py, bytes, None, block(&programs, at))?,
            };
            arrays.set_item(key, array)?;
        }
        Ok(arrays.into_any())
    }

    /// Runs all workgroups once more for each of so many seeds, from which is drawn what the
    /// specifications leave open: the order of invocations, what memory of workgroups holds before
    /// it is written. Returns the reports of differences that are only warned of.
    fn many_seeds(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::seeds)] seeds: u64,
    ) -> PyResult<Vec<String>> {
        self.used.mark();
        Ok(run(py, || self.test.many_seeds(seeds))?.iter().map(anyhit::Error::render).collect())
    }

    /// Explains an invocation, given by its `GlobalInvocationId`: its builtins, its ray queries,
    /// its last lines and what it changed in memory.
    fn explain(&self, py: Python<'_>, #[pyo3(from_py_with = argument::id)] id: [u32; 3]) -> PyResult<String> {
        self.used.mark();
        run(py, || self.test.explain(id))
    }

    /// Runs all workgroups under the sanitizer. Returns the reports of what it only warns of.
    fn sanitize(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.used.mark();
        Ok(run(py, || self.test.sanitize())?.iter().map(anyhit::Error::render).collect())
    }

    /// Runs the workgroup of an invocation, given by its `GlobalInvocationId`, in the debugger, and
    /// returns the transcript of commands, one a line.
    fn debug(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::id)] id: [u32; 3],
        #[pyo3(from_py_with = argument::commands)] commands: String,
    ) -> PyResult<String> {
        self.used.mark();
        run(py, || self.test.debug(id, &commands))
    }

    /// Runs the workgroup of an invocation in the debugger, which `read` gives commands.
    fn _debug_with(
        &self,
        #[pyo3(from_py_with = argument::id)] id: [u32; 3],
        read: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = argument::colours)] colours: bool,
    ) -> PyResult<()> {
        self.used.mark();
        Prompt { read, colours }.run(|| self.test.debugger(id))
    }

    fn __repr__(&self) -> String {
        format!("<anyhit.ComputeTest: {}>", self.program.name)
    }
}

binds_resources!(ComputeTest);

/// Results of a dispatch.
#[pyclass(frozen, module = "anyhit")]
pub(crate) struct ComputeOutcome {
    outcome: anyhit::ComputeOutcome,
    programs: [Arc<anyhit::Program>; 1],
}

#[pymethods]
impl ComputeOutcome {
    /// How many invocations ran, and how many ray queries were made.
    #[getter]
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        stats(py, &self.outcome.stats)
    }

    /// What the shader printed: invocation and text.
    #[getter]
    fn printed(&self) -> Vec<([u32; 3], String)> {
        printed(&self.outcome.printed)
    }

    fn __repr__(&self) -> String {
        format!("<anyhit.ComputeOutcome: {} printed lines>", self.outcome.printed.len())
    }
}

reads_what_is_bound!(ComputeOutcome);

never_changes!(ComputeTest);
