//! Results of launches and shaders: buffers, images and printed text.

use std::sync::Arc;

use anyhit::{Explain, Program, Stats, Texels, Value};
use anyhit_engine::machine::Binding;
use anyhit_engine::module::ty::Type;
use anyhit_engine::program::descriptors::declared_blocks;
use anyhit_engine::reflect::{Layout, Rules};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::argument;
use crate::dtype::{buffer_array, runtime_array};
use crate::error::raised;
use crate::images::texels;
use crate::place::split;
use crate::scene::Scene;
use crate::shader_test::{ExecuteCall, TraceCall};
use crate::value::to_python;

/// The methods of an outcome that read what was bound, by set and binding or by name.
pub(crate) fn image<'py>(
    py: Python<'py>,
    at: (&Bound<'py, PyAny>, Option<&Bound<'py, PyAny>>),
    programs: &[Arc<Program>],
    read: impl Fn(u32, u32) -> anyhit::Result<Texels>,
) -> PyResult<Bound<'py, PyAny>> {
    let (place, _) = split(at.0, at.1, None)?;
    let Binding { set, binding } = place.in_programs(programs)?;
    texels(py, &read(set, binding).map_err(raised)?)
}

/// A buffer by the names of its members.
pub(crate) fn buffer<'py>(
    py: Python<'py>,
    at: (&Bound<'py, PyAny>, Option<&Bound<'py, PyAny>>),
    programs: &[Arc<Program>],
    read: impl Fn(u32, u32) -> anyhit::Result<Value>,
    bytes: impl Fn(u32, u32) -> anyhit::Result<Vec<u8>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (place, _) = split(at.0, at.1, None)?;
    let at = place.in_programs(programs)?;
    if let Some(block) = block(programs, at)
        && let Some((name, offset)) = last_numbers(block)
    {
        return with_last_numbers(py, block, &name, offset, bytes(at.set, at.binding).map_err(raised)?);
    }
    to_python(py, &read(at.set, at.binding).map_err(raised)?)
}

/// The array of numbers or vectors that ends a block, whose length is open: its name and offset.
fn last_numbers(block: Layout<'_>) -> Option<(String, usize)> {
    let is_number = |ty| matches!(block.module.ty(ty), Type::Int { .. } | Type::Float { encoding: None, .. });
    let Type::Struct { members, .. } = block.module.ty(block.ty) else { return None };
    let (offset, last) = block.members().last()?;
    let Type::RuntimeArray { element, .. } = *block.module.ty(last.ty) else { return None };
    let fits = match *block.module.ty(element) {
        Type::Vector { component, .. } => is_number(component),
        _ => is_number(element),
    };
    let name = members.last().map(|member| member.name.to_string()).filter(|name| !name.is_empty());
    fits.then(|| (name.unwrap_or_else(|| format!("_{}", members.len() - 1)), offset))
}

/// A block whose last member may be millions of numbers: numpy converts them.
fn with_last_numbers<'py>(
    py: Python<'py>,
    block: Layout<'_>,
    name: &str,
    offset: usize,
    mut bytes: Vec<u8>,
) -> PyResult<Bound<'py, PyAny>> {
    let last = bytes.split_off(offset.min(bytes.len()));
    let values = to_python(py, &block.read(&bytes))?;
    let numbers = runtime_array(py, block, last)?;
    values.set_item(name, numbers.call_method0("tolist")?)?;
    Ok(values)
}

/// A buffer as an array of a dtype, else of the type that a shader declares.
pub(crate) fn read_buffer<'py>(
    py: Python<'py>,
    at: (&Bound<'py, PyAny>, Option<&Bound<'py, PyAny>>, Option<&Bound<'py, PyAny>>),
    programs: &[Arc<Program>],
    read: impl Fn(u32, u32) -> anyhit::Result<Vec<u8>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (place, dtype) = split(at.0, at.1, at.2)?;
    let at = place.in_programs(programs)?;
    let bytes = read(at.set, at.binding).map_err(raised)?;
    buffer_array(py, bytes, dtype, block(programs, at))
}

/// The block that a shader of these uses at a binding.
pub(crate) fn block(programs: &[Arc<Program>], at: Binding) -> Option<Layout<'_>> {
    programs.iter().find_map(|program| {
        let (ty, ..) = declared_blocks(program).find(|(_, _, place)| *place == Some(at))?;
        Some(Layout::new(&program.module, ty, Rules::Explicit))
    })
}

/// The counts of a run by name: rays, and invocations of each stage that ran.
pub(crate) fn stats<'py>(py: Python<'py>, stats: &Stats) -> PyResult<Bound<'py, PyDict>> {
    let counts = PyDict::new(py);
    counts.set_item("rays", stats.rays)?;
    counts.set_item("ray_queries", stats.ray_queries)?;
    counts.set_item("zero_directions", stats.zero_directions)?;
    counts.set_item("reorders", stats.reorders)?;
    for (stage, shaders) in &stats.shaders {
        counts.set_item(stage.name(), shaders.invocations)?;
    }
    Ok(counts)
}

/// Printed lines with their launch indices.
pub(crate) fn printed(lines: &[anyhit::PrintedLine]) -> Vec<([u32; 3], String)> {
    lines.iter().map(|line| (line.launch_id, line.text.clone())).collect()
}

/// What a launch left behind.
#[pyclass(frozen, module = "anyhit")]
pub(crate) struct Launched {
    pub(crate) launched: anyhit::Launched,
    pub(crate) programs: Vec<Arc<Program>>,
    pub(crate) scene: anyhit::Scene,
}

#[pymethods]
impl Launched {
    /// How many rays were traced, and how often shaders of each stage ran.
    #[getter]
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        stats(py, &self.launched.stats)
    }

    /// What shaders printed, in launch order: launch index and text.
    #[getter]
    fn printed(&self) -> Vec<([u32; 3], String)> {
        printed(&self.launched.printed)
    }

    /// The scene with what shaders wrote, for a further launch.
    #[getter]
    fn scene(&self) -> Scene {
        Scene::new(self.scene.clone())
    }

    /// An image: an array of float32, (height, width, 4), or of the integers that it holds.
    #[pyo3(signature = (set, binding=None))]
    fn image<'py>(
        &self,
        py: Python<'py>,
        set: &Bound<'py, PyAny>,
        binding: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        image(py, (set, binding), &self.programs, |set, binding| self.launched.image(set, binding))
    }

    /// A buffer by the names of its members.
    #[pyo3(signature = (set, binding=None))]
    fn buffer<'py>(
        &self,
        py: Python<'py>,
        set: &Bound<'py, PyAny>,
        binding: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let bytes = |set, binding| self.launched.buffer_bytes(set, binding);
        let read = |set, binding| self.launched.buffer(set, binding);
        buffer(py, (set, binding), &self.programs, read, bytes)
    }

    /// A buffer as an array of a dtype; without one, of the type that the shader declares.
    #[pyo3(signature = (set, binding=None, dtype=None))]
    fn read_buffer<'py>(
        &self,
        py: Python<'py>,
        set: &Bound<'py, PyAny>,
        binding: Option<&Bound<'py, PyAny>>,
        dtype: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let read = |set, binding| self.launched.buffer_bytes(set, binding);
        read_buffer(py, (set, binding, dtype), &self.programs, read)
    }

    /// The buffer at a device address, from that address on, as an array of a dtype; of its bytes
    /// without one.
    #[pyo3(signature = (address, dtype=None))]
    fn read_buffer_at<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::address)] address: u64,
        dtype: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        buffer_array(py, self.launched.read_buffer_at::<u8>(address).map_err(raised)?, dtype, None)
    }

    /// What lies at a device address by the names of its members, as the type of the first pointer
    /// that leads there.
    fn buffer_at<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::address)] address: u64,
    ) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.launched.buffer_at(address).map_err(raised)?)
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.launched == other.launched
    }

    fn __repr__(&self) -> String {
        let rays = self.launched.stats.rays;
        format!("<anyhit.Launched: {rays} rays, {} printed lines>", self.launched.printed.len())
    }
}

/// A report of an intersection shader.
pub(crate) fn report_dict<'py>(
    py: Python<'py>,
    report: &anyhit::ReportedHit,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("t", report.t)?;
    dict.set_item("kind", report.kind)?;
    dict.set_item("attributes", to_python(py, &report.attributes)?)?;
    dict.set_item("accepted", report.accepted)?;
    Ok(dict)
}

/// What one invocation of a shader left.
#[pyclass(frozen, module = "anyhit")]
pub(crate) struct ShaderOutcome {
    pub(crate) outcome: anyhit::ShaderOutcome,
    pub(crate) programs: [Arc<Program>; 1],
}

#[pymethods]
impl ShaderOutcome {
    /// How it ended: "Returned", "Ignored" (the intersection) or "Terminated" (the ray).
    #[getter]
    fn exit(&self) -> String {
        format!("{:?}", self.outcome.exit)
    }

    /// The payload, or the callable data, by the names of its members.
    #[getter]
    fn payload<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.outcome.payload)
    }

    /// The hit attributes.
    #[getter]
    fn attributes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.outcome.attributes)
    }

    /// The reports of an intersection shader: `t`, `kind`, `attributes`, `accepted`.
    #[getter]
    fn reports<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let list = PyList::empty(py);
        for report in &self.outcome.reports {
            list.append(report_dict(py, report)?)?;
        }
        Ok(list)
    }

    /// The traces that it made, with what answered them.
    #[getter]
    fn traces(&self) -> Vec<TraceCall> {
        self.outcome
            .traces
            .iter()
            .map(|call| TraceCall { call: call.clone(), found: Arc::default() })
            .collect()
    }

    /// The hit objects that it executed, with what answered them.
    #[getter]
    fn executes(&self) -> Vec<ExecuteCall> {
        self.outcome.executes.iter().map(|call| ExecuteCall { call: call.clone() }).collect()
    }

    /// The callable shaders that it called: `index`, and the data before (`given`) and after the
    /// answer (`data`).
    #[getter]
    fn calls<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let list = PyList::empty(py);
        for call in &self.outcome.calls {
            let dict = PyDict::new(py);
            dict.set_item("index", call.index)?;
            dict.set_item("given", to_python(py, &call.given)?)?;
            dict.set_item("data", to_python(py, &call.data.value())?)?;
            list.append(dict)?;
        }
        Ok(list)
    }

    /// The exact normal of the surface that was hit, in world space; `None` of a box.
    #[getter]
    fn exact_normal(&self) -> Option<[f32; 3]> {
        self.outcome.exact_normal()
    }

    /// The exact normal in the object space of the instance.
    #[getter]
    fn exact_object_normal(&self) -> Option<[f32; 3]> {
        self.outcome.exact_object_normal()
    }

    /// Raises `Expectation` where a member of the payload is farther from the exact normal than so
    /// many degrees.
    fn check_normal(
        &self,
        #[pyo3(from_py_with = argument::member)] member: String,
        #[pyo3(from_py_with = argument::degrees)] degrees: f32,
    ) -> PyResult<()> {
        self.outcome.check_normal(&member, degrees.into()).map_err(raised)
    }

    /// What it printed.
    #[getter]
    fn printed(&self) -> Vec<String> {
        self.outcome.printed.clone()
    }

    /// An image: an array of float32, (height, width, 4), or of the integers that it holds.
    #[pyo3(signature = (set, binding=None))]
    fn image<'py>(
        &self,
        py: Python<'py>,
        set: &Bound<'py, PyAny>,
        binding: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        image(py, (set, binding), &self.programs, |set, binding| self.outcome.image(set, binding))
    }

    /// A buffer by the names of its members.
    #[pyo3(signature = (set, binding=None))]
    fn buffer<'py>(
        &self,
        py: Python<'py>,
        set: &Bound<'py, PyAny>,
        binding: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let bytes = |set, binding| self.outcome.buffer_bytes(set, binding);
        let read = |set, binding| self.outcome.buffer(set, binding);
        buffer(py, (set, binding), &self.programs, read, bytes)
    }

    /// A buffer as an array of a dtype; without one, of the type that the shader declares.
    #[pyo3(signature = (set, binding=None, dtype=None))]
    fn read_buffer<'py>(
        &self,
        py: Python<'py>,
        set: &Bound<'py, PyAny>,
        binding: Option<&Bound<'py, PyAny>>,
        dtype: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let read = |set, binding| self.outcome.buffer_bytes(set, binding);
        read_buffer(py, (set, binding, dtype), &self.programs, read)
    }

    /// The buffer at a device address, from that address on, as an array of a dtype; of its bytes
    /// without one.
    #[pyo3(signature = (address, dtype=None))]
    fn read_buffer_at<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::address)] address: u64,
        dtype: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        buffer_array(py, self.outcome.read_buffer_at::<u8>(address).map_err(raised)?, dtype, None)
    }

    /// What lies at a device address by the names of its members, as the type of the first pointer
    /// that leads there.
    fn buffer_at<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::address)] address: u64,
    ) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.outcome.buffer_at(address).map_err(raised)?)
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.outcome == other.outcome
    }

    fn __repr__(&self) -> String {
        format!("<anyhit.ShaderOutcome: {:?}, payload {:?}>", self.outcome.exit, self.outcome.payload)
    }

    /// Returns the explanation that `anyhit trace-one-ray` prints.
    fn explain(&self, py: Python<'_>) -> String {
        py.detach(|| self.outcome.explain())
    }
}
