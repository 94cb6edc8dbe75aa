//! Scenes of instances, and what shaders have bound.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use anyhit::{Descriptor, Program, StructData, Texels};
use anyhit_engine::geometry::Precision;
use anyhit_engine::machine::Binding;
use anyhit_unit_test::data::HostBytes;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyString, PyTuple};

use crate::argument::{self, Argument, Buffers, Objects, wrong_class};
use crate::array::typed_bytes;
use crate::copies::never_changes;
use crate::dtype::buffer_array;
use crate::error::{invalid, raised};
use crate::images::{TexelArray, declared, texels};
use crate::instance::Instance;
use crate::loaded_scene::LoadedScene;
use crate::module::Module;
use crate::numbers::members;
use crate::place::{Place, split, split_with};
use crate::run::run;
use crate::sampler::Sampler;
use crate::used::Use;

/// Something that is bound when the shaders are known.
enum Pending {
    Image(TexelArray, Option<anyhit::Sampler>),
    Buffer(HostBytes),
    Sampler(anyhit::Sampler),
    Structure,
}

/// Instances in an acceleration structure, and what the shaders have bound. A scene is a value:
/// methods that bind return a scene that shares the rest; what shaders write is in what a launch or
/// trace returns. Set and binding may be the name of a variable of the shaders.
#[pyclass(frozen, module = "anyhit")]
#[derive(Clone)]
pub(crate) struct Scene {
    pub(crate) scene: anyhit::Scene,
    /// What waits for the shaders, by its place.
    pending: Vec<(Place, Arc<Pending>)>,
    /// The scene as it was last bound for programs.
    bound: Arc<Mutex<Option<BoundScene>>>,
    used: Use,
}

/// Programs, and a scene in which everything is bound as they declare it.
type BoundScene = (Vec<Arc<Program>>, anyhit::Scene);

impl Scene {
    pub(crate) fn new(scene: anyhit::Scene) -> Self {
        Self { scene, pending: Vec::new(), bound: Arc::default(), used: Use::free() }
    }

    /// Replaces what is bound at a place.
    fn with(&self, method: &'static str, place: Place, pending: Pending) -> Self {
        self.used.mark();
        let mut all = self.pending.clone();
        all.retain(|(known, _)| *known != place);
        let mut scene = self.scene.clone();
        match (&place, &pending) {
            (_, Pending::Image(..)) | (Place::Named(_), _) => all.push((place, Arc::new(pending))),
            (Place::At(at), _) => scene = pending.bound(scene, *at),
        }
        Self { scene, pending: all, bound: Arc::default(), used: Use::of("Scene", method) }
    }

    /// The scene with everything bound as the shaders declare it.
    pub(crate) fn bound(&self, programs: &[Arc<Program>]) -> PyResult<anyhit::Scene> {
        self.used.mark();
        if self.pending.is_empty() {
            return Ok(self.scene.clone());
        }
        let mut last = self.bound.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((known, scene)) = &*last
            && known.len() == programs.len()
            && known.iter().zip(programs).all(|(one, other)| Arc::ptr_eq(one, other))
        {
            return Ok(scene.clone());
        }
        let mut scene = self.scene.clone();
        for (place, pending) in &self.pending {
            let at = place.in_programs(programs)?;
            scene = match &**pending {
                Pending::Image(texels, sampler) => {
                    let image = texels.image(declared(programs, at))?;
                    match sampler {
                        Some(sampler) => scene.image_sampler(at.set, at.binding, image, *sampler),
                        None => scene.image(at.set, at.binding, image),
                    }
                }
                other => other.bound(scene, at),
            };
        }
        *last = Some((programs.to_vec(), scene.clone()));
        Ok(scene)
    }
}

impl Pending {
    /// Binds what needs no declaration.
    fn bound(&self, scene: anyhit::Scene, Binding { set, binding }: Binding) -> anyhit::Scene {
        match self {
            Self::Structure => scene.bind(set, binding),
            Self::Buffer(bytes) => scene.buffer_of(set, binding, bytes.clone()),
            Self::Sampler(sampler) => scene.descriptor(set, binding, Descriptor::Sampler(Arc::new(*sampler))),
            Self::Image(..) => scene,
        }
    }
}

#[pymethods]
impl Scene {
    /// A scene of these instances; `InstanceId` is their order. `precision` is how intersections
    /// are computed: "exact", or "double" or "float" as a GPU may.
    #[new]
    #[pyo3(signature = (instances, precision="exact".to_owned()), text_signature = "(instances, precision='exact')")]
    fn make(
        py: Python<'_>,
        #[pyo3(from_py_with = argument::instances)] instances: Vec<Instance>,
        #[pyo3(from_py_with = argument::precision)] precision: String,
    ) -> PyResult<Self> {
        let known = Precision::ALL.into_iter().find(|known| known.name() == precision);
        let precision = known.ok_or_else(|| {
            invalid(format!("precision: there is no precision `{precision}`: it is exact, double or float"))
        })?;
        let instances = instances.into_iter().map(|one| one.instance);
        Ok(Self::new(run(py, || Ok(anyhit::Scene::new(instances)?.precision(precision)))?))
    }

    /// Reads a scene file with everything that it names.
    #[staticmethod]
    fn open(py: Python<'_>, #[pyo3(from_py_with = argument::path)] path: PathBuf) -> PyResult<LoadedScene> {
        let scene = run(py, || anyhit::LoadedScene::open(&path))?;
        Ok(LoadedScene::new(scene, path))
    }

    /// Reads a scene from a text; its relative paths start at the folder of `path`, which need not
    /// exist.
    #[staticmethod]
    fn from_text(
        py: Python<'_>,
        #[pyo3(from_py_with = argument::path)] path: PathBuf,
        #[pyo3(from_py_with = argument::text)] text: String,
    ) -> PyResult<LoadedScene> {
        let scene = run(py, || anyhit::LoadedScene::from_text(&path, &text))?;
        Ok(LoadedScene::new(scene, path))
    }

    /// Binds the scene's own acceleration structure, for shaders that trace.
    #[pyo3(signature = (set, binding=None))]
    fn bind(&self, set: &Bound<'_, PyAny>, binding: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let (place, more) = split(set, binding, None)?;
        match more {
            Some(more) => Err(wrong_class("binding", "nothing behind a name", more)),
            None => Ok(self.with("bind", place, Pending::Structure)),
        }
    }

    /// Binds a storage or uniform buffer: an array, C-contiguous, whose dtype and shape are
    /// compared with what the shaders declare; `bytes` or an array of `uint8`, which are not; or,
    /// with the module that declares it, a dict by the names of its members.
    #[pyo3(signature = (set, binding=None, data=None, module=None))]
    fn buffer(
        &self,
        set: &Bound<'_, PyAny>,
        binding: Option<&Bound<'_, PyAny>>,
        data: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = argument::of_module)] module: Option<Module>,
    ) -> PyResult<Self> {
        let (place, data) = split_with("data", set, binding, data)?;
        let bytes = match is_values(data) {
            true => {
                let module = module.ok_or_else(|| {
                    invalid("data: dicts and lists are written as a module lays them out: `module=` names that module")
                })?;
                let at = place.binding([&*module.module])?;
                buffer_bytes(at, data, &module)?
            }
            false => typed_bytes("data", data)?,
        };
        Ok(self.with("buffer", place, Pending::Buffer(bytes)))
    }

    /// Binds a storage or sampled image: an array (height, width, 4) of float32, or of uint32,
    /// int32, uint64 or int64 for shaders that read integers. It is stored in the format that the
    /// shaders declare, unless `format` names another: GLSL's `"rgba32f"`, `"rgba8"`, `"r32ui"`.
    /// Images of other dimensions have their own axes; with a sampler it is a combined image
    /// sampler. `levels` are the arrays of its further mip levels, each of half the size.
    #[pyo3(signature = (set, binding=None, texels=None, format=None, sampler=None, *, levels=Objects::none()), text_signature = "($self, set, binding=None, texels=None, format=None, sampler=None, *, levels=())")]
    fn image(
        &self,
        set: &Bound<'_, PyAny>,
        binding: Option<&Bound<'_, PyAny>>,
        texels: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = argument::format)] format: Option<String>,
        #[pyo3(from_py_with = argument::of_sampler)] sampler: Option<Sampler>,
        #[pyo3(from_py_with = argument::levels)] levels: Objects,
    ) -> PyResult<Self> {
        let (place, texels) = split_with("texels", set, binding, texels)?;
        let texels = TexelArray::of(texels, format.as_deref(), &levels)?;
        Ok(self.with("image", place, Pending::Image(texels, sampler.map(|one| one.sampler))))
    }

    /// Binds a sampler.
    #[pyo3(signature = (set, binding=None, sampler=None))]
    fn sampler(
        &self,
        set: &Bound<'_, PyAny>,
        binding: Option<&Bound<'_, PyAny>>,
        sampler: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (place, sampler) = split_with("sampler", set, binding, sampler)?;
        let sampler = Sampler::of("sampler", sampler)?.sampler;
        Ok(self.with("sampler", place, Pending::Sampler(sampler)))
    }

    /// Puts buffers at their device addresses, for shaders that reach them by pointers.
    fn device_buffers(&self, #[pyo3(from_py_with = argument::buffers)] buffers: Buffers) -> Self {
        self.used.mark();
        let (scene, pending) = (self.scene.clone().device_buffers(&buffers.0), self.pending.clone());
        Self { scene, pending, bound: Arc::default(), used: Use::of("Scene", "device_buffers") }
    }

    /// The content of a buffer, as an array of a dtype; of its bytes without one.
    #[pyo3(signature = (set, binding=None, dtype=None))]
    fn read_buffer<'py>(
        &self,
        py: Python<'py>,
        set: &Bound<'py, PyAny>,
        binding: Option<&Bound<'py, PyAny>>,
        dtype: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.used.mark();
        let (place, dtype) = split(set, binding, dtype)?;
        let bytes = self.pending.iter().find_map(|(known, pending)| match &**pending {
            Pending::Buffer(bytes) if *known == place => Some(bytes.bytes.clone()),
            _ => None,
        });
        let bytes = match (bytes, &place) {
            (Some(bytes), _) => bytes,
            (None, Place::At(at)) => self.scene.read_buffer::<u8>(at.set, at.binding).map_err(raised)?,
            (None, Place::Named(name)) => return Err(invalid(format!("no buffer is bound as `{name}`"))),
        };
        buffer_array(py, bytes, dtype, None)
    }

    /// The texels of a mip level of an image: an array of float32, (height, width, 4), or of the
    /// integers that it holds.
    #[pyo3(signature = (set, binding=None, *, level=0))]
    fn read_image<'py>(
        &self,
        py: Python<'py>,
        set: &Bound<'py, PyAny>,
        binding: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = argument::level)] level: u32,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.used.mark();
        let (place, _) = split(set, binding, None)?;
        let pending = self.pending.iter().find_map(|(known, pending)| match &**pending {
            Pending::Image(texels, _) if *known == place => Some(texels.image(None)),
            _ => None,
        });
        match (pending, place) {
            (Some(image), _) => texels(py, &Texels::new(image?), level),
            (None, Place::At(at)) => {
                texels(py, &self.scene.read_image(at.set, at.binding).map_err(raised)?, level)
            }
            (None, Place::Named(name)) => Err(invalid(format!("no image is bound as `{name}`"))),
        }
    }

    /// Sets the push constants by the names of their members, as a module declares them.
    fn push_constants(
        &self,
        #[pyo3(from_py_with = argument::module)] module: Module,
        values: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let data = StructData::push_constants(&module.module).map_err(raised)?;
        let data = filled(data, "values", values)?;
        self.used.mark();
        let scene = self.scene.clone().push_constants_data(&data);
        let pending = self.pending.clone();
        Ok(Self { scene, pending, bound: Arc::default(), used: Use::of("Scene", "push_constants") })
    }

    fn __repr__(&self) -> String {
        let count = self.scene.tlas().instances().len();
        format!("<anyhit.Scene: {count} instance{}>", if count == 1 { "" } else { "s" })
    }
}

/// A struct of a module with the members that a dict names.
pub(crate) fn filled(mut data: StructData, name: &str, values: &Bound<'_, PyAny>) -> PyResult<StructData> {
    if values.is_none() || values.is_instance_of::<PyString>() {
        return Err(wrong_class(name, "dict", values));
    }
    for (path, value) in members(&data.value(), values)? {
        data = data.set(&path, value).map_err(raised)?;
    }
    Ok(data)
}

/// True for values that are written as a module lays them out.
fn is_values(data: &Bound<'_, PyAny>) -> bool {
    data.is_instance_of::<PyDict>() || data.is_instance_of::<PyList>() || data.is_instance_of::<PyTuple>()
}

/// The bytes that a buffer of a module is given: an array, bytes or a dict.
pub(crate) fn buffer_bytes(at: Binding, data: &Bound<'_, PyAny>, module: &Module) -> PyResult<HostBytes> {
    if !is_values(data) {
        return typed_bytes("data", data);
    }
    let zeros = StructData::buffer(&module.module, at.set, at.binding).map_err(raised)?;
    Ok(HostBytes::raw(filled(zeros, "data", data)?.bytes()))
}

never_changes!(Scene);
