//! Values of shaders as Python's: structs are dicts, vectors, matrices (their columns) and arrays
//! are lists, scalars are numbers.

use anyhit::Value;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};

/// What a scalar is, by its type in GLSL's words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ScalarKind {
    Bool,
    Int,
    Float,
    /// A type without a number: a handle.
    Opaque,
}

/// What the parts of a value are.
pub(crate) enum Content<'v> {
    Scalar(ScalarKind),
    List(&'v [Value]),
    Struct(Vec<(&'v str, &'v Value)>),
}

/// The parts of a value.
pub(crate) fn content(value: &Value) -> Content<'_> {
    let fields: Vec<_> = value.fields().collect();
    if !fields.is_empty() {
        return Content::Struct(fields);
    }
    // An array without elements has no other sign than its type.
    if !value.elements().is_empty() || value.ty().ends_with(']') {
        return Content::List(value.elements());
    }
    Content::Scalar(scalar_kind(value))
}

fn scalar_kind(value: &Value) -> ScalarKind {
    match (value.ty(), value.bytes().len()) {
        (_, 0) => ScalarKind::Opaque,
        ("bool", _) => ScalarKind::Bool,
        ("float" | "double" | "float16_t" | "bfloat16_t" | "floate4m3_t" | "floate5m2_t", _) => {
            ScalarKind::Float
        }
        ("int" | "int8_t" | "int16_t" | "int64_t" | "uint" | "uint8_t" | "uint16_t" | "uint64_t", _) => {
            ScalarKind::Int
        }
        _ => ScalarKind::Opaque,
    }
}

/// A value as plain Python data; one without a type is `None`, a handle its bytes.
pub(crate) fn to_python<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match content(value) {
        Content::Struct(fields) => {
            let dict = PyDict::new(py);
            for (name, field) in fields {
                dict.set_item(name, to_python(py, field)?)?;
            }
            dict.into_any()
        }
        Content::List(elements) => {
            let list = PyList::empty(py);
            for element in elements {
                list.append(to_python(py, element)?)?;
            }
            list.into_any()
        }
        Content::Scalar(ScalarKind::Bool) => value.bool().into_pyobject(py)?.to_owned().into_any(),
        Content::Scalar(ScalarKind::Int) => value.integer().into_pyobject(py)?.into_any(),
        Content::Scalar(ScalarKind::Float) => value.f64().into_pyobject(py)?.into_any(),
        Content::Scalar(ScalarKind::Opaque) if value.bytes().is_empty() => py.None().into_bound(py),
        Content::Scalar(ScalarKind::Opaque) => PyBytes::new(py, value.bytes()).into_any(),
    })
}
