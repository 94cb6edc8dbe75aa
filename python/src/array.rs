//! Arrays of numpy as slices, without a copy. An array of another dtype or layout is an error that
//! says what to call; the numbers of lists and tuples are converted one by one.

use anyhit_unit_test::data::HostBytes;
use numpy::{Element, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn};
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyBufferError, PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyMemoryView, PyTuple, PyType};

use crate::argument::{bytes_of, class, wrong_class};
use crate::dtype::{check_byte_order, host_type};
use crate::error::invalid;
use crate::numbers::{Number, rectangular};

/// An array of numpy, or of an object that has one: by `__array__`, DLPack (tensors of a CPU) or
/// the buffer protocol (`array.array`, `ctypes`, a typed `memoryview`); `None` for another object,
/// and for `bytes` and other buffers of bytes, which have no type.
///
/// # Errors
/// `InvalidArgument` for an array with a mask, whose masked numbers are none, and for an object
/// that gives no array.
pub(crate) fn array_of<'py>(
    name: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<Option<Bound<'py, PyUntypedArray>>> {
    if let Ok(array) = given.cast::<PyUntypedArray>() {
        if class(given) == "MaskedArray" {
            return Err(invalid(format!("{name}: the array has a mask: `numpy.ma.filled({name})` has none")));
        }
        return Ok(Some(array.clone()));
    }
    // Common types without an array.
    if given.is_instance_of::<PyList>() || given.is_instance_of::<PyTuple>() || given.is_none() {
        return Ok(None);
    }
    let numpy = given.py().import("numpy")?;
    let is_class = given.is_instance_of::<PyType>();
    let array = if !is_class && given.hasattr("__array__")? {
        numpy.call_method1("asarray", (given,))
    } else if !is_class && given.hasattr("__dlpack__")? {
        numpy.call_method1("from_dlpack", (given,))
    } else {
        match buffer_of(name, given)? {
            Some(view) if !is_untyped(&view)? => numpy.call_method1("asarray", (view,)),
            _ => return Ok(None),
        }
    };
    let array = array.map_err(|error| named(name, given.py(), error))?;
    let array = array
        .cast_into::<PyUntypedArray>()
        .map_err(|error| wrong_class(name, "an array from `__array__`", &error.into_inner()))?;
    Ok(Some(array))
}

/// An error of NumPy or of an object about an argument with a name.
fn named(name: &str, py: Python<'_>, error: PyErr) -> PyErr {
    let is_about_argument = [
        error.is_instance_of::<PyTypeError>(py),
        error.is_instance_of::<PyValueError>(py),
        error.is_instance_of::<PyBufferError>(py),
        error.is_instance_of::<PyRuntimeError>(py),
    ];
    match is_about_argument.contains(&true) {
        true => invalid(format!("{name}: {}", error.value(py))),
        false => error,
    }
}

/// The memory of an object with the buffer protocol; `None` for one without.
///
/// # Errors
/// `InvalidArgument` with the argument's name for an object that refuses its memory.
pub(crate) fn buffer_of<'py>(
    name: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<Option<Bound<'py, PyMemoryView>>> {
    match PyMemoryView::from(given) {
        Ok(view) => Ok(Some(view)),
        Err(error) if error.is_instance_of::<PyTypeError>(given.py()) => Ok(None),
        Err(error) => Err(named(name, given.py(), error)),
    }
}

/// Returns whether a buffer consists of bytes.
pub(crate) fn is_untyped(view: &Bound<'_, PyMemoryView>) -> PyResult<bool> {
    let format: String = view.getattr("format")?.extract()?;
    Ok(matches!(format.trim_start_matches(['@', '=', '<', '>', '!']), "B" | "b" | "c"))
}

/// The array of an argument, C-contiguous and of this dtype.
pub(crate) fn typed<'py, T: Number>(
    name: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let py = given.py();
    let wanted = numpy::dtype::<T>(py);
    let array = match array_of(name, given)? {
        Some(array) => array,
        None => {
            let (numbers, lengths) = rectangular::<T>(name, given)?;
            let array = numpy::PyArray1::from_vec(py, numbers);
            array.call_method1("reshape", (lengths,))?.cast_into::<PyUntypedArray>()?
        }
    };
    if !array.dtype().is_equiv_to(&wanted) {
        let dtype = array.dtype().str()?;
        return Err(invalid(format!(
            "{name}: an array of {dtype}, not of {wanted}: `{name}.astype(numpy.{wanted})` converts it"
        )));
    }
    if !array.is_c_contiguous() {
        return Err(invalid(format!(
            "{name}: the array is not C-contiguous: `numpy.ascontiguousarray({name})` copies it"
        )));
    }
    let array = array.cast_into::<PyArrayDyn<T>>().map_err(PyErr::from)?;
    array.try_readonly().map_err(|error| invalid(format!("{name}: {error}")))
}

/// The numbers of an array, row after row.
pub(crate) fn slice<'a, T: Element>(name: &str, array: &'a PyReadonlyArrayDyn<'_, T>) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|error| invalid(format!("{name}: {error}")))
}

fn wrong_shape(name: &str, shape: &[usize], wanted: &str) -> PyErr {
    invalid(format!("{name}: an array of shape {}, not {wanted}", shape_text(shape)))
}

/// A shape as Python writes it: `(3,)`.
pub(crate) fn shape_text(shape: &[usize]) -> String {
    let sides: Vec<String> = shape.iter().map(ToString::to_string).collect();
    format!("({}{})", sides.join(", "), if sides.len() == 1 { "," } else { "" })
}

/// Rows of three floats: (N, 3), or (3,) for a single one.
pub(crate) struct Points<'py> {
    name: &'static str,
    array: PyReadonlyArrayDyn<'py, f32>,
}

impl<'py> Points<'py> {
    pub(crate) fn of(name: &'static str, given: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = typed::<f32>(name, given)?;
        match array.shape() {
            [3] | [_, 3] => Ok(Self { name, array }),
            shape => Err(wrong_shape(name, shape, "(N, 3)")),
        }
    }

    /// The rows, in the memory of the array.
    pub(crate) fn rows(&self) -> PyResult<&[[f32; 3]]> {
        Ok(bytemuck::cast_slice(slice(self.name, &self.array)?))
    }

    /// Whether it is a single row, which counts for all rays.
    pub(crate) fn is_single(&self) -> bool {
        self.array.shape().len() == 1
    }
}

/// A number for each of so many rows: (N,), or a single one.
pub(crate) struct Scalars<'py> {
    name: &'static str,
    array: PyReadonlyArrayDyn<'py, f32>,
}

impl<'py> Scalars<'py> {
    pub(crate) fn of(name: &'static str, given: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = typed::<f32>(name, given)?;
        match array.shape() {
            [] | [_] => Ok(Self { name, array }),
            shape => Err(wrong_shape(name, shape, "(N,)")),
        }
    }

    /// The numbers: one, or one for each row.
    pub(crate) fn numbers(&self) -> PyResult<&[f32]> {
        slice(self.name, &self.array)
    }

    pub(crate) fn is_single(&self) -> bool {
        self.array.shape().is_empty()
    }
}

/// The floats of an array in rows of `N`, copied, as a scene keeps them. `inner` are the shapes
/// that an element may have: `[3]` for (N, 3).
pub(crate) fn copied_rows<const N: usize>(
    name: &str,
    given: &Bound<'_, PyAny>,
    inner: &[&[usize]],
) -> PyResult<Vec<[f32; N]>> {
    let array = typed::<f32>(name, given)?;
    let shape = array.shape();
    if !inner.iter().any(|inner| shape == *inner || shape.get(1..) == Some(inner)) {
        let wanted: Vec<String> = inner
            .iter()
            .map(|inner| {
                let sides: Vec<String> = inner.iter().map(ToString::to_string).collect();
                if sides.is_empty() { "(N,)".to_owned() } else { format!("(N, {})", sides.join(", ")) }
            })
            .collect();
        return Err(wrong_shape(name, shape, &wanted.join(" or ")));
    }
    Ok(slice(name, &array)?.as_chunks::<N>().0.to_vec())
}

/// The bytes of an array of any dtype, C-contiguous, or of an object that is made of bytes.
pub(crate) fn bytes(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<u8>> {
    if let Some(bytes) = bytes_of(name, given)? {
        return Ok(bytes);
    }
    let Some(array) = array_of(name, given)? else {
        return Err(wrong_class(name, "a numpy array, a dict or bytes", given));
    };
    if !array.is_c_contiguous() {
        return Err(invalid(format!(
            "{name}: the array is not C-contiguous: `numpy.ascontiguousarray({name})` copies it"
        )));
    }
    let flat = array.call_method1("reshape", (-1,))?.call_method1("view", ("uint8",))?;
    let flat = typed::<u8>(name, &flat)?;
    Ok(slice(name, &flat)?.to_vec())
}

/// An array with its type, which is compared with the shaders'. Bytes and arrays of `uint8` have
/// none.
pub(crate) fn typed_bytes(name: &str, given: &Bound<'_, PyAny>) -> PyResult<HostBytes> {
    let Some(array) = array_of(name, given)? else { return Ok(HostBytes::raw(&bytes(name, given)?)) };
    let dtype = array.dtype();
    check_byte_order(name, &dtype)?;
    let size = dtype.itemsize();
    let scalar = match dtype.kind() {
        b'f' if size <= 8 => format!("f{}", 8 * size),
        b'u' => format!("u{}", 8 * size),
        b'i' => format!("i{}", 8 * size),
        b'V' if dtype.has_fields() => {
            return Ok(HostBytes::of_structs(host_type(name, &dtype)?, bytes(name, given)?));
        }
        b'V' => return Ok(HostBytes::raw(&bytes(name, given)?)),
        b'b' => {
            return Err(invalid(format!(
                "{name}: an array of bool does not match a bool in a buffer, which has 32 bits: use \
                 `{name}.astype(numpy.uint32)`"
            )));
        }
        _ => return Err(invalid(format!("{name}: an array of {dtype} has no equivalent in a shader"))),
    };
    let known = HostBytes::of_array(&scalar, array.shape(), bytes(name, given)?);
    known.ok_or_else(|| invalid(format!("{name}: an array of {dtype} has no equivalent in a shader")))
}

/// Bytes as an array of a dtype and shape, without a copy.
pub(crate) fn from_bytes<'py>(
    py: Python<'py>,
    bytes: Vec<u8>,
    dtype: &Bound<'py, PyAny>,
    shape: &[isize],
) -> PyResult<Bound<'py, PyAny>> {
    let array = numpy::PyArray1::from_vec(py, bytes);
    array.call_method1("view", (dtype,))?.call_method1("reshape", (shape.to_vec(),))
}
