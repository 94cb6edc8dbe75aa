//! Pipelines: shaders, and the records that name them.

use std::sync::Arc;

use anyhit::{Buffer, Explain, SbtRecord, StructData};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::argument::{self, Objects};
use crate::array::typed_bytes;
use crate::copies::never_changes;
use crate::error::{invalid, raised};
use crate::instance::Ray;
use crate::module::Shader;
use crate::outcome::Launched;
use crate::payload;
use crate::run::run;
use crate::scene::{Scene, filled};
use crate::trace::{RayArguments, Traced, trace};

/// A hit group: one shader, or a list of closest-hit, any-hit and intersection shader.
pub(crate) struct HitGroup(pub(crate) Vec<Shader>);

/// Shaders, hit groups and the shader binding table.
#[pyclass(frozen, module = "anyhit")]
pub(crate) struct Pipeline {
    pub(crate) pipeline: anyhit::Pipeline,
}

#[pymethods]
impl Pipeline {
    /// A pipeline with a record of the shader binding table for each hit group, miss shader and
    /// callable shader, in their order. A shader is a `Program`, or a `Module` with a single entry
    /// point; a hit group is one shader or a list. `hit_records`, `miss_records` and
    /// `callable_records` are the data of the records, `None` for those without: a dict by the
    /// names of the members that the first shader declares, an array or bytes.
    #[new]
    #[pyo3(signature = (*, ray_generation=None, hit=Vec::new(), miss=Vec::new(), callable=Vec::new(), max_recursion=None, fuel=None, hit_records=Objects::none(), miss_records=Objects::none(), callable_records=Objects::none()))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = argument::ray_generation)] ray_generation: Option<Shader>,
        #[pyo3(from_py_with = argument::hit_groups)] hit: Vec<HitGroup>,
        #[pyo3(from_py_with = argument::miss)] miss: Vec<Shader>,
        #[pyo3(from_py_with = argument::callable)] callable: Vec<Shader>,
        #[pyo3(from_py_with = argument::max_recursion)] max_recursion: Option<u32>,
        #[pyo3(from_py_with = argument::fuel)] fuel: Option<u64>,
        #[pyo3(from_py_with = argument::hit_records)] hit_records: Objects,
        #[pyo3(from_py_with = argument::miss_records)] miss_records: Objects,
        #[pyo3(from_py_with = argument::callable_records)] callable_records: Objects,
    ) -> PyResult<Self> {
        let mut builder = anyhit::Pipeline::builder();
        if let Some(shader) = ray_generation {
            builder = builder.ray_generation(shader.program(py)?).map_err(raised)?;
        }
        let (mut hit_modules, mut miss_modules, mut callable_modules) = (Vec::new(), Vec::new(), Vec::new());
        for group in hit {
            let programs: PyResult<Vec<_>> =
                group.0.into_iter().map(|shader| shader.program(py).map(Arc::unwrap_or_clone)).collect();
            let programs = programs?;
            hit_modules.push(programs.first().map(|program| program.module.clone()));
            builder = builder.hit(programs).map_err(raised)?;
        }
        for shader in miss {
            let program = shader.program(py)?;
            miss_modules.push(Some(program.module.clone()));
            builder = builder.miss(program).map_err(raised)?;
        }
        for shader in callable {
            let program = shader.program(py)?;
            callable_modules.push(Some(program.module.clone()));
            builder = builder.callable(program).map_err(raised)?;
        }
        let sbt = builder.sbt();
        for (name, records, modules, data) in [
            ("hit_records", &mut sbt.hit, hit_modules, hit_records),
            ("miss_records", &mut sbt.miss, miss_modules, miss_records),
            ("callable_records", &mut sbt.callable, callable_modules, callable_records),
        ] {
            set_records(py, name, records, &modules, data.0)?;
        }
        if let Some(depth) = max_recursion {
            builder = builder.max_recursion(depth);
        }
        if let Some(instructions) = fuel {
            builder = builder.fuel(instructions);
        }
        Ok(Self { pipeline: builder.build().map_err(raised)? })
    }

    /// The dtype of the payload of rays that `trace` traces; `None` where no shader takes one.
    #[getter]
    fn payload_dtype<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let shape = payload::of_pipeline(&self.pipeline);
        shape.map(|shape| payload::row_dtype(py, &shape)).transpose()
    }

    /// Traces rays through a scene, without a ray generation shader: origins and directions are
    /// arrays of float32, (N, 3), of which one may be (3,) and counts for all; `t_min`, `t_max` and
    /// `time` are numbers or arrays of float32, (N,). `payload` is an array of `payload_dtype`,
    /// (N,): zeros unless given. Rays run side by side unless a shader stores to memory or prints.
    /// The result's `scene` holds what they store; the given scene does not change.
    #[pyo3(signature = (scene, origins, directions, *, t_min=None, t_max=None, flags=0, cull_mask=0xFF, sbt_offset=0, sbt_stride=1, miss_index=0, time=None, payload=None))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn trace<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::scene)] scene: Scene,
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = argument::flags)] flags: u32,
        #[pyo3(from_py_with = argument::cull_mask)] cull_mask: u8,
        #[pyo3(from_py_with = argument::sbt_offset)] sbt_offset: u32,
        #[pyo3(from_py_with = argument::sbt_stride)] sbt_stride: u32,
        #[pyo3(from_py_with = argument::miss_index)] miss_index: u32,
        time: Option<&Bound<'py, PyAny>>,
        payload: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Traced> {
        let operands = anyhit::RayOperands::from(anyhit::Ray::new([0.0; 3], [0.0; 3]));
        let operands = operands.flags(anyhit::RayFlags(flags)).cull_mask(cull_mask.into());
        let operands = operands.sbt(sbt_offset, sbt_stride).miss(miss_index);
        let arguments = RayArguments { origins, directions, t_min, t_max, time, payload, operands };
        trace(py, &self.pipeline, &scene.bound(&self.pipeline.programs)?, &arguments)
    }

    /// Explains one ray through a scene: candidates, decisions, shaders and what they wrote, as
    /// `anyhit trace-one-ray` prints it.
    #[pyo3(signature = (scene, ray, *, flags=0, cull_mask=0xFF, sbt_offset=0, sbt_stride=1, miss_index=0, time=0.0))]
    #[expect(clippy::too_many_arguments, reason = "they are keywords in Python")]
    fn explain(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::scene)] scene: Scene,
        #[pyo3(from_py_with = argument::ray)] ray: Ray,
        #[pyo3(from_py_with = argument::flags)] flags: u32,
        #[pyo3(from_py_with = argument::cull_mask)] cull_mask: u8,
        #[pyo3(from_py_with = argument::sbt_offset)] sbt_offset: u32,
        #[pyo3(from_py_with = argument::sbt_stride)] sbt_stride: u32,
        #[pyo3(from_py_with = argument::miss_index)] miss_index: u32,
        #[pyo3(from_py_with = argument::time)] time: f32,
    ) -> PyResult<String> {
        let scene = scene.bound(&self.pipeline.programs)?;
        let operands = anyhit::RayOperands::from(ray.ray).flags(anyhit::RayFlags(flags));
        let operands = operands.cull_mask(cull_mask.into()).sbt(sbt_offset, sbt_stride);
        let operands = operands.miss(miss_index).time(time);
        run(py, || Ok(self.pipeline.trace(&scene, operands)?.explain()))
    }

    /// Runs the ray generation shader over a grid. What shaders write is in what is returned, whose
    /// `scene` a further launch continues with; the given scene does not change.
    #[pyo3(signature = (scene, width, height=1, depth=1))]
    fn launch(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::scene)] scene: Scene,
        #[pyo3(from_py_with = argument::width)] width: u32,
        #[pyo3(from_py_with = argument::height)] height: u32,
        #[pyo3(from_py_with = argument::depth)] depth: u32,
    ) -> PyResult<Launched> {
        let mut scene = scene.bound(&self.pipeline.programs)?;
        let outcome = run(py, || self.pipeline.launch_mut(&mut scene, [width, height, depth]))?;
        Ok(Launched { outcome, programs: self.pipeline.programs.clone(), scene })
    }

    fn __repr__(&self) -> String {
        let programs = self.pipeline.programs.iter();
        let names: Vec<_> = programs.map(|one| format!("{} {}", one.stage.name(), one.name)).collect();
        format!("<anyhit.Pipeline: {}>", names.join(", "))
    }
}

/// Sets the data of records.
fn set_records(
    py: Python<'_>,
    name: &str,
    records: &mut [Option<SbtRecord>],
    modules: &[Option<Arc<anyhit::Module>>],
    data: Vec<Py<PyAny>>,
) -> PyResult<()> {
    if data.len() > records.len() {
        let (given, wanted) = (data.len(), records.len());
        return Err(invalid(format!("{name}: {given} elements for {wanted} records")));
    }
    for (at, ((record, module), data)) in records.iter_mut().zip(modules).zip(data).enumerate() {
        let data = data.into_bound(py);
        let (Some(record), Some(module)) = (record, module) else { continue };
        if data.is_none() {
            continue;
        }
        let name = format!("{name}[{at}]");
        let bytes = match data.is_instance_of::<PyDict>() {
            true => {
                let zeros = StructData::shader_record(module).map_err(raised)?;
                filled(zeros, &name, &data)?.bytes().to_vec()
            }
            false => typed_bytes(&name, &data)?.bytes,
        };
        record.data = Some(Buffer::new(&bytes));
    }
    Ok(())
}

never_changes!(Pipeline);
