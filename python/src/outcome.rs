//! Results of launches and shaders: buffers, images and printed text.

use std::sync::Arc;

use anyhit::{Explain, Program, Stats};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::argument;
use crate::bound::reads_what_is_bound;
use crate::error::raised;
use crate::scene::Scene;
use crate::shader_test::{ExecuteCall, TraceCall};
use crate::value::to_python;

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
    pub(crate) outcome: anyhit::Launched,
    pub(crate) programs: Vec<Arc<Program>>,
    pub(crate) scene: anyhit::Scene,
}

#[pymethods]
impl Launched {
    /// How many rays were traced, and how often shaders of each stage ran.
    #[getter]
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        stats(py, &self.outcome.stats)
    }

    /// What shaders printed, in launch order: launch index and text.
    #[getter]
    fn printed(&self) -> Vec<([u32; 3], String)> {
        printed(&self.outcome.printed)
    }

    /// The scene with what shaders wrote, for a further launch.
    #[getter]
    fn scene(&self) -> Scene {
        Scene::new(self.scene.clone())
    }

    fn __repr__(&self) -> String {
        let rays = self.outcome.stats.rays;
        format!("<anyhit.Launched: {rays} rays, {} printed lines>", self.outcome.printed.len())
    }
}

reads_what_is_bound!(Launched);

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

    fn __repr__(&self) -> String {
        format!("<anyhit.ShaderOutcome: {:?}, payload {:?}>", self.outcome.exit, self.outcome.payload)
    }

    /// Returns the explanation that `anyhit trace-one-ray` prints.
    fn explain(&self, py: Python<'_>) -> String {
        py.detach(|| self.outcome.explain())
    }
}

reads_what_is_bound!(ShaderOutcome);
