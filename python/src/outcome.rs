//! What launches and shaders left behind: buffers and images as shaders left them.

use anyhit::{Explain, Format, Stats, Texels};
use anyhit_engine::machine::format::Class;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::array::from_bytes;
use crate::error::raised;
use crate::scene::Scene;
use crate::shader_test::TraceCall;
use crate::value::to_python;

/// R, G, B and A of all texels: an array (height, width, 4) of float32, or of the integers that the
/// format holds (uint32, int32, uint64, int64).
pub(crate) fn texels<'py>(py: Python<'py>, texels: &Texels) -> PyResult<Bound<'py, PyAny>> {
    let [width, height] = texels.size();
    let image = texels.image();
    let format = image.format();
    let plane = *image.shape() == anyhit::ImageShape::plane(width, height);
    let places = move || (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)));
    let (dtype, bytes): (&str, Vec<u8>) = py.detach(|| match (format.class(), format.is_wide()) {
        _ if format == Format::RGBA32F && plane => ("<f4", image.bytes()),
        (Class::Float, _) => {
            ("<f4", places().flat_map(|(x, y)| texels.at_f32(x, y)).flat_map(f32::to_le_bytes).collect())
        }
        (Class::Uint, false) => {
            ("<u4", places().flat_map(|(x, y)| texels.at_u32(x, y)).flat_map(u32::to_le_bytes).collect())
        }
        (Class::Sint, false) => {
            ("<i4", places().flat_map(|(x, y)| texels.at_i32(x, y)).flat_map(i32::to_le_bytes).collect())
        }
        (Class::Uint, true) => {
            ("<u8", places().flat_map(|(x, y)| texels.at_u64(x, y)).flat_map(u64::to_le_bytes).collect())
        }
        (Class::Sint, true) => {
            ("<i8", places().flat_map(|(x, y)| texels.at_i64(x, y)).flat_map(i64::to_le_bytes).collect())
        }
    });
    let dtype = py.import("numpy")?.call_method1("dtype", (dtype,))?;
    from_bytes(py, bytes, &dtype, &[height as isize, width as isize, 4])
}

/// The bytes of a buffer as an array of a dtype, one row.
pub(crate) fn buffer_array<'py>(
    py: Python<'py>,
    bytes: Vec<u8>,
    dtype: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let numpy = py.import("numpy")?;
    let dtype = match dtype {
        Some(dtype) => numpy.call_method1("dtype", (dtype,))?,
        None => numpy.call_method1("dtype", ("uint8",))?,
    };
    from_bytes(py, bytes, &dtype, &[-1])
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
    pub(crate) scene: Scene,
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
        self.scene.clone()
    }

    /// An image: an array of float32, (height, width, 4).
    #[pyo3(signature = (set, binding))]
    fn image<'py>(&self, py: Python<'py>, set: u32, binding: u32) -> PyResult<Bound<'py, PyAny>> {
        texels(py, &self.launched.image(set, binding).map_err(raised)?)
    }

    /// A buffer by the names of its members.
    fn buffer<'py>(&self, py: Python<'py>, set: u32, binding: u32) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.launched.buffer(set, binding).map_err(raised)?)
    }

    /// A buffer as an array of a dtype; of its bytes without one.
    #[pyo3(signature = (set, binding, dtype=None))]
    fn read_buffer<'py>(
        &self,
        py: Python<'py>,
        set: u32,
        binding: u32,
        dtype: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        buffer_array(py, self.launched.buffer_bytes(set, binding).map_err(raised)?, dtype)
    }
}

/// What one invocation of a shader left.
#[pyclass(frozen, module = "anyhit")]
pub(crate) struct ShaderOutcome {
    pub(crate) outcome: anyhit::ShaderOutcome,
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
            let dict = PyDict::new(py);
            dict.set_item("t", report.t)?;
            dict.set_item("kind", report.kind)?;
            dict.set_item("attributes", to_python(py, &report.attributes)?)?;
            dict.set_item("accepted", report.accepted)?;
            list.append(dict)?;
        }
        Ok(list)
    }

    /// The traces that it made, with what answered them.
    #[getter]
    fn traces(&self) -> Vec<TraceCall> {
        self.outcome.traces.iter().map(|call| TraceCall { call: call.clone() }).collect()
    }

    /// What it printed.
    #[getter]
    fn printed(&self) -> Vec<String> {
        self.outcome.printed.clone()
    }

    /// An image: an array of float32, (height, width, 4).
    fn image<'py>(&self, py: Python<'py>, set: u32, binding: u32) -> PyResult<Bound<'py, PyAny>> {
        texels(py, &self.outcome.image(set, binding).map_err(raised)?)
    }

    /// A buffer by the names of its members.
    fn buffer<'py>(&self, py: Python<'py>, set: u32, binding: u32) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.outcome.buffer(set, binding).map_err(raised)?)
    }

    /// A buffer as an array of a dtype; of its bytes without one.
    #[pyo3(signature = (set, binding, dtype=None))]
    fn read_buffer<'py>(
        &self,
        py: Python<'py>,
        set: u32,
        binding: u32,
        dtype: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        buffer_array(py, self.outcome.buffer_bytes(set, binding).map_err(raised)?, dtype)
    }

    /// What the shader did, as `anyhit trace-one-ray` tells it.
    fn explain(&self, py: Python<'_>) -> String {
        py.detach(|| self.outcome.explain())
    }
}
