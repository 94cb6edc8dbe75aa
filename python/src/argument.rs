//! Arguments of calls: every mistake in one is an `anyhit.InvalidArgument` that names it, also a
//! `TypeError` for an object of another class. `#[pyo3(from_py_with = argument::mask)]` converts
//! the argument `mask`.

use std::path::PathBuf;

use numpy::PyUntypedArray;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyDict, PyString};

use crate::array::{buffer_of, is_untyped, shape_text};
use crate::device_buffers::DeviceBuffers;
use crate::error::{invalid, invalid_type};
use crate::instance::{Hit, Instance, Ray};
use crate::loaded_scene::PixelOrRay;
use crate::module::{Module, Program, Shader};
use crate::numbers::{Number, rectangular};
use crate::pipeline::HitGroup;
use crate::sampler::Sampler;
use crate::scene::Scene;

/// A type of an argument.
pub(crate) trait Argument: Sized {
    /// Converts the argument with a name.
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self>;
}

/// The name of an object's class.
pub(crate) fn class(given: &Bound<'_, PyAny>) -> String {
    given.get_type().name().map_or_else(|_| "an object".to_owned(), |name| name.to_string())
}

/// An object of another class than the wanted one.
pub(crate) fn wrong_class(name: &str, wanted: &str, given: &Bound<'_, PyAny>) -> PyErr {
    invalid_type(format!("{name}: expected {wanted}, found {}", class(given)))
}

/// The only number of an argument.
fn number<T: Number>(name: &str, wanted: &str, given: &Bound<'_, PyAny>) -> PyResult<T> {
    let is_text = given.is_instance_of::<PyString>() || given.is_none() || given.is_instance_of::<PyDict>();
    if is_text {
        return Err(wrong_class(name, wanted, given));
    }
    let (numbers, lengths) = rectangular::<T>(name, given)?;
    match (&numbers[..], &lengths[..]) {
        (&[number], []) => Ok(number),
        _ => Err(wrong_class(name, wanted, given)),
    }
}

macro_rules! numbers {
    ($($ty:ty: $wanted:literal;)*) => {$(
        impl Argument for $ty {
            fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
                number(name, $wanted, given)
            }
        }
    )*};
}

numbers! {
    u8: "int";
    u32: "int";
    u64: "int";
    f32: "float";
}

impl Argument for usize {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let number = u64::of(name, given)?;
        Self::try_from(number).map_err(|_| invalid(format!("{name}: {number} is too large")))
    }
}

impl Argument for bool {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let found = given.cast::<PyBool>().map(|value| value.is_true());
        found.or_else(|_| given.extract()).map_err(|_| wrong_class(name, "bool", given))
    }
}

impl Argument for String {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let text = given.cast::<PyString>().map_err(|_| wrong_class(name, "str", given))?;
        let text = text.to_cow().map_err(|error| invalid(format!("{name}: {error}")))?;
        Ok(text.into_owned())
    }
}

impl Argument for PathBuf {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        given.extract().map_err(|error: PyErr| match error.is_instance_of::<PyTypeError>(given.py()) {
            true => wrong_class(name, "str or os.PathLike", given),
            false => invalid(format!("{name}: {error}")),
        })
    }
}

/// Bytes of `bytes` or of any other object that has them, such as `bytearray`.
pub(crate) struct Bytes(pub(crate) Vec<u8>);

/// The bytes of an object that is made of them; `None` for another one.
pub(crate) fn bytes_of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Option<Vec<u8>>> {
    if let Ok(bytes) = given.cast::<PyBytes>() {
        return Ok(Some(bytes.as_bytes().to_vec()));
    }
    // An array of numpy is one.
    if given.is_instance_of::<PyUntypedArray>() {
        return Ok(None);
    }
    match buffer_of(name, given)? {
        Some(view) if is_untyped(&view)? => {
            let bytes = view.call_method0("tobytes")?;
            Ok(Some(bytes.cast::<PyBytes>().map_err(PyErr::from)?.as_bytes().to_vec()))
        }
        _ => Ok(None),
    }
}

impl Argument for Bytes {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        bytes_of(name, given)?.map(Self).ok_or_else(|| wrong_class(name, "bytes", given))
    }
}

impl<T: Argument> Argument for Option<T> {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        if given.is_none() { Ok(None) } else { T::of(name, given).map(Some) }
    }
}

/// The most elements of a list of arguments: an iterator may have no end.
const MAX_ITEMS: usize = 1 << 24;
/// The most elements of a list of any objects, such as data of records.
const MAX_OBJECTS: usize = 1 << 20;

/// The elements of an iterable object, of which an error ends too many.
pub(crate) fn items<'py>(
    name: &str,
    given: &Bound<'py, PyAny>,
    most: usize,
) -> PyResult<impl Iterator<Item = PyResult<Bound<'py, PyAny>>>> {
    let all = given.try_iter().ok().filter(|_| !is_whole(given));
    let all = all.ok_or_else(|| wrong_class(name, "a list", given))?;
    let too_many = format!("{name}: more than {most} elements");
    Ok(all.take(most + 1).enumerate().map(move |(at, item)| match at == most {
        true => Err(invalid(too_many.as_str())),
        false => item,
    }))
}

/// Objects of any class.
pub(crate) struct Objects(pub(crate) Vec<Py<PyAny>>);

impl Objects {
    /// The default of an argument that is a list.
    pub(crate) fn none() -> Self {
        Self(Vec::new())
    }
}

impl Argument for Objects {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let items = items(name, given, MAX_OBJECTS)?;
        Ok(Self(items.map(|item| Ok(item?.unbind())).collect::<PyResult<_>>()?))
    }
}

/// Returns true for an iterable object that counts as a single value.
fn is_whole(given: &Bound<'_, PyAny>) -> bool {
    given.is_instance_of::<PyString>()
        || given.is_instance_of::<PyBytes>()
        || given.is_instance_of::<PyDict>()
}

/// A list of arguments, of any iterable but a text or a dict.
impl<T: Argument> Argument for Vec<T> {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let items = items(name, given, MAX_ITEMS).map_err(|error| match T::of(name, given) {
            // One in place of a list of one.
            Ok(_) => invalid_type(format!(
                "{name}: expected a list, found {0}: write `{name}=[...]`",
                class(given)
            )),
            Err(_) => error,
        })?;
        items.enumerate().map(|(at, item)| T::of(&format!("{name}[{at}]"), &item?)).collect()
    }
}

/// Rows of so many numbers, of an array or of nested lists.
fn rows<T: Number, const N: usize>(
    name: &str,
    wanted: &[usize],
    given: &Bound<'_, PyAny>,
) -> PyResult<Vec<[T; N]>> {
    let (numbers, lengths) = rectangular::<T>(name, given)?;
    if lengths != wanted {
        let (wanted, found) = (shape_text(wanted), shape_text(&lengths));
        return Err(invalid(format!("{name}: expected numbers of shape {wanted}, found {found}")));
    }
    Ok(numbers.as_chunks::<N>().0.to_vec())
}

impl<T: Number, const N: usize> Argument for [T; N] {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(rows(name, &[N], given)?[0])
    }
}

/// Vertices, one behind the other.
pub(crate) struct Vertices<const N: usize>(pub(crate) [[f32; 3]; N]);

impl<const N: usize> Argument for Vertices<N> {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut vertices = [[0.0; 3]; N];
        vertices.copy_from_slice(&rows(name, &[N, 3], given)?);
        Ok(Self(vertices))
    }
}

macro_rules! classes {
    ($($ty:ident),*) => {$(
        impl Argument for $ty {
            fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
                let found = given.cast::<$ty>().map_err(|_| {
                    wrong_class(name, concat!("anyhit.", stringify!($ty)), given)
                })?;
                Ok(found.get().clone())
            }
        }
    )*};
}

classes!(Hit, Instance, Module, Program, Ray, Sampler, Scene);

impl Argument for HitGroup {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        match given.is_instance_of::<Program>() || given.is_instance_of::<Module>() {
            true => Ok(Self(vec![Argument::of(name, given)?])),
            false if given.is_instance_of::<PyString>() || given.try_iter().is_err() => {
                Err(wrong_class(name, "anyhit.Program, anyhit.Module or a list of them", given))
            }
            false => Vec::of(name, given).map(Self),
        }
    }
}

macro_rules! arguments {
    ($($function:ident $(as $name:ident)?: $ty:ty,)*) => {$(
        pub(crate) fn $function(given: &Bound<'_, PyAny>) -> PyResult<$ty> {
            Argument::of([stringify!($function) $(, stringify!($name))?].last().unwrap_or(&""), given)
        }
    )*};
}

/// Buffers with device addresses, as they are.
pub(crate) struct Buffers(pub(crate) anyhit::DeviceBuffers);

impl Argument for Buffers {
    fn of(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Self> {
        let found = given.cast::<DeviceBuffers>();
        let found = found.map_err(|_| wrong_class(name, "anyhit.DeviceBuffers", given))?;
        Ok(Self(found.get().now()))
    }
}

arguments! {
    address: u64,
    all_widths: bool,
    at: usize,
    binding: u32,
    binding_type as type_: String,
    attributes: [f32; 2],
    buffers: Buffers,
    by: [f32; 3],
    byte_count as size: usize,
    callable: Vec<Shader>,
    callable_records: Objects,
    cluster_id: u32,
    commands: String,
    compiler_flags as flags: Vec<String>,
    colours: bool,
    count: usize,
    coverage: bool,
    cull_mask: u8,
    data: Bytes,
    custom_index: u32,
    degrees: f32,
    depth: u32,
    direction: [f32; 3],
    end: u64,
    end_caps: bool,
    entry: String,
    explanation: bool,
    file_name: String,
    first: u64,
    flags: u32,
    format: Option<String>,
    fuel: Option<u64>,
    height: u32,
    hit: Hit,
    hit_records: Objects,
    hit_groups as hit: Vec<HitGroup>,
    id: [u32; 3],
    include_folders: Vec<PathBuf>,
    instance: Instance,
    instance_index as instance: usize,
    instances: Vec<Instance>,
    instructions: u64,
    json: Option<String>,
    level: u32,
    levels: Objects,
    many_seeds: Option<u64>,
    mask: u8,
    max_recursion: Option<u32>,
    maximum: [f32; 3],
    member: String,
    minimum: [f32; 3],
    miss: Vec<Shader>,
    miss_index: u32,
    miss_records: Objects,
    module: Module,
    name: String,
    of_module as module: Option<Module>,
    of_sampler as sampler: Option<Sampler>,
    of_stage as stage: Option<String>,
    origin: [f32; 3],
    other: Instance,
    path: PathBuf,
    perturb: Option<u32>,
    pictures: Option<PathBuf>,
    port: Option<u32>,
    position: [f32; 3],
    precision: String,
    radius: f32,
    ray: Ray,
    ray_flags: u32,
    ray_generation: Option<Shader>,
    sanitize: bool,
    sbt_offset: u32,
    sbt_stride: u32,
    set: u32,
    stage: String,
    scene: Scene,
    seed: u64,
    seeds: u64,
    size: [u32; 3],
    some_height as height: Option<u32>,
    some_width as width: Option<u32>,
    spirv: Bytes,
    subgroup_size as size: u32,
    t_max: f32,
    t_min: f32,
    text: String,
    time: f32,
    two_ends as positions: Vertices<2>,
    two_radii as radii: [f32; 2],
    vertices: Vertices<3>,
    what: PixelOrRay,
    what_or_default as what: Option<PixelOrRay>,
    width: u32,
    x: u32,
    y: u32,
    z: u32,
}
