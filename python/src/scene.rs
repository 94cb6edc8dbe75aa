//! Scenes of instances, and what shaders have bound.

use std::path::PathBuf;

use anyhit::{Format, Image, ImageShape, StructData};
use anyhit_engine::geometry::Precision;
use anyhit_engine::machine::format::Class;
use anyhit_unit_test::data::HostBytes;
use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::{slice, typed, typed_bytes};
use crate::error::{invalid, raised};
use crate::instance::Instance;
use crate::loaded_scene::LoadedScene;
use crate::module::Module;
use crate::numbers::{Number, members};
use crate::outcome::{buffer_array, texels};
use crate::run::run;

/// Instances in an acceleration structure, and what the shaders have bound. Methods that bind
/// return a scene that shares the rest; what shaders write is in what a launch or trace returns.
#[pyclass(frozen, module = "anyhit")]
#[derive(Clone)]
pub(crate) struct Scene {
    pub(crate) scene: anyhit::Scene,
}

#[pymethods]
impl Scene {
    /// A scene of these instances; `InstanceId` is their order. `precision` is how intersections
    /// are computed: "exact", or "double" or "float" as a GPU may.
    #[new]
    #[pyo3(signature = (instances, precision="exact"))]
    fn new(py: Python<'_>, instances: Vec<Instance>, precision: &str) -> PyResult<Self> {
        let known = Precision::ALL.into_iter().find(|known| known.name() == precision);
        let precision = known.ok_or_else(|| {
            invalid(format!("there is no precision `{precision}`: it is exact, double or float"))
        })?;
        let instances = instances.into_iter().map(|one| one.instance);
        let scene = run(py, || Ok(anyhit::Scene::new(instances)?.precision(precision)))?;
        Ok(Self { scene })
    }

    /// Reads a scene file with everything that it names.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<LoadedScene> {
        run(py, || anyhit::LoadedScene::open(path)).map(LoadedScene::new)
    }

    /// Reads a scene from a text; its relative paths start at the folder of `path`, which need not
    /// exist.
    #[staticmethod]
    fn from_text(py: Python<'_>, path: PathBuf, text: &str) -> PyResult<LoadedScene> {
        run(py, || anyhit::LoadedScene::from_text(path, text)).map(LoadedScene::new)
    }

    /// Binds the scene's own acceleration structure, for shaders that trace.
    fn bind(&self, set: u32, binding: u32) -> Self {
        Self { scene: self.scene.clone().bind(set, binding) }
    }

    /// Binds a storage or uniform buffer: an array, C-contiguous, whose dtype and shape are
    /// compared with what the shaders declare; `bytes` or an array of `uint8`, which are not; or,
    /// with the module that declares it, a dict by the names of its members.
    #[pyo3(signature = (set, binding, data, module=None))]
    fn buffer(
        &self,
        set: u32,
        binding: u32,
        data: &Bound<'_, PyAny>,
        module: Option<&Module>,
    ) -> PyResult<Self> {
        let bytes = buffer_bytes(set, binding, data, module)?;
        Ok(Self { scene: self.scene.clone().buffer_of(set, binding, bytes) })
    }

    /// Binds a storage or sampled image of a format, which is the one that the shaders declare: an
    /// array (height, width, 4) of float32, or of uint32, int32, uint64 or int64 for a format of
    /// such integers. The names of formats are GLSL's: `"rgba32f"`, `"rgba8"`, `"r32ui"`.
    #[pyo3(signature = (set, binding, texels, format="rgba32f"))]
    fn image(&self, set: u32, binding: u32, texels: &Bound<'_, PyAny>, format: &str) -> PyResult<Self> {
        Ok(Self { scene: self.scene.clone().image(set, binding, image(texels, format)?) })
    }

    /// The content of a buffer, as an array of a dtype; of its bytes without one.
    #[pyo3(signature = (set, binding, dtype=None))]
    fn read_buffer<'py>(
        &self,
        py: Python<'py>,
        set: u32,
        binding: u32,
        dtype: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        buffer_array(py, self.scene.read_buffer::<u8>(set, binding).map_err(raised)?, dtype)
    }

    /// The texels of an image: an array of float32, (height, width, 4).
    fn read_image<'py>(&self, py: Python<'py>, set: u32, binding: u32) -> PyResult<Bound<'py, PyAny>> {
        texels(py, &self.scene.read_image(set, binding).map_err(raised)?)
    }

    /// Sets the push constants by the names of their members, as a module declares them.
    fn push_constants(&self, module: &Module, values: &Bound<'_, PyDict>) -> PyResult<Self> {
        let data = StructData::push_constants(&module.module).map_err(raised)?;
        let data = filled(data, values)?;
        Ok(Self { scene: self.scene.clone().push_constants_data(&data) })
    }
}

/// A struct of a module with the members that a dict names.
pub(crate) fn filled(mut data: StructData, values: &Bound<'_, PyAny>) -> PyResult<StructData> {
    for (path, value) in members(&data.value(), values)? {
        data = data.set(&path, value).map_err(raised)?;
    }
    Ok(data)
}

/// The bytes that a buffer is given.
pub(crate) fn buffer_bytes(
    set: u32,
    binding: u32,
    data: &Bound<'_, PyAny>,
    module: Option<&Module>,
) -> PyResult<HostBytes> {
    if !data.is_instance_of::<PyDict>() {
        return typed_bytes("data", data);
    }
    let Some(module) = module else {
        return Err(invalid("a dict is written as a module lays it out: `module=` names that module"));
    };
    let zeros = StructData::buffer(&module.module, set, binding).map_err(raised)?;
    Ok(HostBytes::raw(filled(zeros, data)?.bytes()))
}

/// An array (height, width, 4) of the numbers that a format holds, as an image.
pub(crate) fn image(texels: &Bound<'_, PyAny>, format: &str) -> PyResult<std::sync::Arc<Image>> {
    let known = Format::NAMED.iter().find(|(name, _)| *name == format);
    let Some(&(_, format)) = known else {
        let names: Vec<&str> = Format::NAMED.iter().map(|(name, _)| *name).collect();
        return Err(invalid(format!("there is no format `{format}`: write one of {}", names.join(", "))));
    };
    match (format.class(), format.is_wide()) {
        (Class::Float, _) => encoded::<f32>(texels, format, |number| number.to_bits().into()),
        (Class::Uint, false) => encoded::<u32>(texels, format, u64::from),
        (Class::Uint, true) => encoded::<u64>(texels, format, |number| number),
        (Class::Sint, false) => encoded::<i32>(texels, format, |number| i64::from(number) as u64),
        (Class::Sint, true) => encoded::<i64>(texels, format, |number| number as u64),
    }
}

/// An image of an array of numbers, each of which is one word of a texel.
fn encoded<T: Number>(
    texels: &Bound<'_, PyAny>,
    format: Format,
    word: impl Fn(T) -> u64,
) -> PyResult<std::sync::Arc<Image>> {
    let array = typed::<T>("texels", texels)?;
    let &[height, width, 4] = array.shape() else {
        let shape = texels.getattr("shape")?;
        return Err(invalid(format!("texels: an array of shape {shape}, not (height, width, 4)")));
    };
    let side = |side: usize| u32::try_from(side).map_err(|_| invalid("texels: the array is too large"));
    let shape = ImageShape::plane(side(width)?, side(height)?);
    let (size, is_signed) = (format.texel_size() as usize, format.class() == Class::Sint);
    let mut bytes = Vec::with_capacity(width * height * size);
    for texel in slice("texels", &array)?.as_chunks::<4>().0 {
        let bits = format.encode(texel.map(&word), is_signed);
        bytes.extend_from_slice(&bits.to_le_bytes()[..size]);
    }
    Image::new(format, shape, &bytes).map_err(raised)
}
