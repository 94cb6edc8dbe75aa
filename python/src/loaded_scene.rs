//! Scenes of files: changed, launched, taken apart.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use anyhit::{Error, ExplainRequest, Motion};
use anyhit_debugger::debugger::Debugger;
use pyo3::prelude::*;
use pyo3::types::PyString;

use crate::argument::{self, Argument, Bytes, wrong_class};
use crate::array::typed_bytes;
use crate::copies::never_changes;
use crate::debugger::Prompt;
use crate::dtype::buffer_array;
use crate::error::{invalid, raised};
use crate::images::texels;
use crate::instance::matrix as matrix_of;
use crate::module::Module;
use crate::outcome::{printed, stats};
use crate::pipeline::Pipeline;
use crate::run::run;
use crate::scene::Scene;
use crate::value::to_python;

/// A scene file with everything that it names: `Scene.open` and `Scene.from_text` make one. What
/// runs does so on the scene as it was when it began, whatever other threads change.
#[pyclass(frozen, module = "anyhit")]
pub(crate) struct LoadedScene {
    scene: Mutex<Arc<anyhit::LoadedScene>>,
    path: PathBuf,
}

impl LoadedScene {
    pub(crate) fn new(scene: anyhit::LoadedScene, path: PathBuf) -> Self {
        Self { scene: Mutex::new(Arc::new(scene)), path }
    }

    fn now(&self) -> Arc<anyhit::LoadedScene> {
        self.scene.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Changes the scene; a change that fails leaves it as it was.
    fn change(
        &self,
        py: Python<'_>,
        change: impl FnOnce(&mut anyhit::LoadedScene) -> anyhit::Result<()> + Send,
    ) -> PyResult<()> {
        run(py, || {
            let mut scene = self.scene.lock().unwrap_or_else(PoisonError::into_inner);
            let mut changed = (**scene).clone();
            change(&mut changed)?;
            *scene = Arc::new(changed);
            Ok(())
        })
    }
}

fn texts(errors: anyhit::WarningReports) -> Vec<String> {
    errors.iter().map(Error::render).collect()
}

#[pymethods]
impl LoadedScene {
    /// Runs the passes of the scene; with width and height of another launch than the file's.
    /// Buffers and images begin as the scene describes them.
    #[pyo3(signature = (width=None, height=None))]
    fn launch(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::some_width)] width: Option<u32>,
        #[pyo3(from_py_with = argument::some_height)] height: Option<u32>,
    ) -> PyResult<SceneOutcome> {
        let scene = self.now();
        let size = match (width, height) {
            (None, None) => None,
            (Some(width), Some(height)) => Some([width, height]),
            _ => return Err(invalid("a launch of another size needs both its width and its height")),
        };
        let outcome = run(py, || match size {
            None => scene.launch(),
            Some(size) => (*scene).clone().set_launch_size(size)?.launch(),
        })?;
        Ok(SceneOutcome { outcome })
    }

    /// The pipeline of the scene, and a `Scene` of its first acceleration structure with everything
    /// that it binds: to trace rays of one's own with `Pipeline.trace`.
    fn pipeline(&self, py: Python<'_>) -> PyResult<(Pipeline, Scene)> {
        let scene = self.now();
        let (pipeline, scene) = run(py, || scene.pipeline())?;
        Ok((Pipeline { pipeline }, Scene::new(scene)))
    }

    /// The module of a shader, by its name below `[shaders]`.
    fn module(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::name)] name: String,
    ) -> PyResult<Module> {
        let scene = self.now();
        Ok(Module { module: run(py, || scene.module(&name))? })
    }

    /// Reads every file that the scene names, also those that nothing reads, which are otherwise
    /// only checked to be there; pictures are otherwise decoded when a shader first reads a texel.
    fn read_all(&self, py: Python<'_>) -> PyResult<()> {
        self.change(py, |scene| scene.read_all().map(drop))
    }

    /// Replaces the content of a buffer, by the resource's name: an array of the buffer's size,
    /// C-contiguous, whose dtype and shape are compared with what the shaders declare; or `bytes`
    /// or an array of `uint8` of any size, which are not compared.
    fn set_buffer(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::name)] name: String,
        data: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let bytes = typed_bytes("data", data)?;
        self.change(py, |scene| scene.set_buffer_of(&name, bytes).map(drop))
    }

    /// Replaces the push constants: an array, which is compared with what the shaders declare, or
    /// `bytes` or an array of `uint8`, which are not.
    fn set_push_constants(&self, py: Python<'_>, data: &Bound<'_, PyAny>) -> PyResult<()> {
        let bytes = typed_bytes("data", data)?;
        self.change(py, |scene| scene.set_push_constants_of(bytes).map(drop))
    }

    /// Replaces the transform of an instance, by its `InstanceId`: (3, 4).
    fn set_transform(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::instance_index)] instance: usize,
        matrix: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let rows = matrix_of("matrix", matrix)?;
        self.change(py, |scene| scene.set_transform(instance, rows).map(drop))
    }

    /// The transform of an instance, by its `InstanceId`; at time 0 where it moves: (3, 4).
    fn transform<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::instance_index)] instance: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let rows = self.now().transform(instance).map_err(raised)?;
        Ok(numpy::PyArray2::from_vec2(py, &rows.map(|row| row.to_vec())).map_err(PyErr::from)?.into_any())
    }

    /// Replaces the motion of an instance, by its `InstanceId`: its transforms at time 0 and 1.
    fn set_motion(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::instance_index)] instance: usize,
        start: &Bound<'_, PyAny>,
        end: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let motion = Motion::Matrix([matrix_of("start", start)?, matrix_of("end", end)?]);
        self.change(py, |scene| scene.set_motion(instance, motion).map(drop))
    }

    /// Sets `maxPipelineRayRecursionDepth`.
    fn set_max_recursion(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::depth)] depth: u32,
    ) -> PyResult<()> {
        self.change(py, |scene| scene.set_max_recursion(depth).map(drop))
    }

    /// Runs one pass alone, by its name or its number from 0, on buffers and images as the scene
    /// describes them.
    fn launch_pass(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::name)] name: String,
    ) -> PyResult<SceneOutcome> {
        let scene = self.now();
        Ok(SceneOutcome { outcome: run(py, || scene.launch_pass(&name))? })
    }

    /// The device address of a buffer, by the resource's name.
    fn address_of(&self, #[pyo3(from_py_with = argument::name)] name: String) -> PyResult<u64> {
        self.now().address_of(&name).map_err(raised)
    }

    /// Replaces a shader, by its name below `[shaders]`, by a source text in the language of
    /// the extension of `file_name`.
    fn set_shader_source(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::name)] name: String,
        #[pyo3(from_py_with = argument::file_name)] file_name: String,
        #[pyo3(from_py_with = argument::text)] text: String,
    ) -> PyResult<()> {
        self.change(py, |scene| scene.set_shader_source(&name, &file_name, &text).map(drop))
    }

    /// Replaces a shader, by its name below `[shaders]`, by the bytes of a SPIR-V module.
    fn set_shader_spirv(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::name)] name: String,
        #[pyo3(from_py_with = argument::spirv)] spirv: Bytes,
    ) -> PyResult<()> {
        self.change(py, |scene| scene.set_shader_spirv(&name, &spirv.0).map(drop))
    }

    /// Runs the passes under the sanitizer. Returns the reports of what it only warns of.
    fn sanitize(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let scene = self.now();
        run(py, || scene.sanitize()).map(texts)
    }

    /// Runs the passes once more for each of so many seeds, from which is drawn what the
    /// specifications leave open. Returns the reports of differences that are only warned of.
    fn many_seeds(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::seeds)] seeds: u64,
    ) -> PyResult<Vec<String>> {
        let scene = self.now();
        run(py, || scene.many_seeds(seeds)).map(texts)
    }

    /// Explains a pixel, or the `[[ray]]` with a name, as `anyhit trace-one-ray` prints it.
    fn explain(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::what)] what: PixelOrRay,
    ) -> PyResult<String> {
        let scene = self.now();
        run(py, || scene.explain(what.0))
    }

    /// Runs what `explain` would explain in the debugger, which `read` gives commands; without it
    /// the first ray, or the pixel in the middle.
    fn _debug_with(
        &self,
        #[pyo3(from_py_with = argument::what_or_default)] what: Option<PixelOrRay>,
        read: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = argument::colours)] colours: bool,
    ) -> PyResult<()> {
        let scene = self.now();
        let request = what.map_or(ExplainRequest::Default, |what| what.0);
        Prompt { read, colours }.run(|| Debugger::of_scene(&scene.session()?, &request))
    }

    fn __copy__(&self) -> Self {
        Self { scene: Mutex::new(self.now()), path: self.path.clone() }
    }

    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.__copy__()
    }

    fn __repr__(&self) -> String {
        format!("<anyhit.LoadedScene: {}>", self.path.display())
    }
}

/// Subject of an explanation: a pixel, or the ray with a name.
pub(crate) struct PixelOrRay(ExplainRequest);

impl Argument for PixelOrRay {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        if given.is_instance_of::<PyString>() {
            return Ok(Self(ExplainRequest::from(&*String::of(name, given)?)));
        }
        if given.try_iter().is_err() {
            return Err(wrong_class(name, "a pixel (x, y) or the name of a ray", given));
        }
        Ok(Self(ExplainRequest::from(<[u32; 2]>::of(name, given)?)))
    }
}

/// What the passes of a scene left behind.
#[pyclass(frozen, module = "anyhit")]
pub(crate) struct SceneOutcome {
    outcome: anyhit::SceneOutcome,
}

#[pymethods]
impl SceneOutcome {
    /// How many rays were traced, and how often shaders of each stage ran.
    #[getter]
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, pyo3::types::PyDict>> {
        stats(py, &self.outcome.stats)
    }

    /// What shaders printed, in launch order: launch index and text.
    #[getter]
    fn printed(&self) -> Vec<([u32; 3], String)> {
        printed(&self.outcome.printed)
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.outcome == other.outcome
    }

    /// A mip level of an image, by the resource's name: an array of float32, (height, width, 4), or
    /// of the integers that it holds.
    #[pyo3(signature = (name, *, level=0))]
    fn image<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::name)] name: String,
        #[pyo3(from_py_with = argument::level)] level: u32,
    ) -> PyResult<Bound<'py, PyAny>> {
        texels(py, &self.outcome.image(&name).map_err(raised)?, level)
    }

    /// A buffer by the names of its members.
    fn buffer<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::name)] name: String,
    ) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.outcome.buffer(&name).map_err(raised)?)
    }

    /// A buffer as an array of a dtype; of its bytes without one.
    #[pyo3(signature = (name, dtype=None))]
    fn read_buffer<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::name)] name: String,
        dtype: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        buffer_array(py, self.outcome.read_buffer::<u8>(&name).map_err(raised)?, dtype, None)
    }
}

never_changes!(SceneOutcome);
