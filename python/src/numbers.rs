//! Python's numbers, lists and dicts as scalars for the members of a shader's value.

use anyhit::Value;
use anyhit::ScalarValue;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt};

use crate::error::invalid;
use crate::value::{Content, ScalarKind, content};

/// A scalar with the path that leads to it, `path[1].weight`; empty for the value itself.
pub(crate) type Member = (String, ScalarValue);

/// The scalars of Python data for a value of a shader: dicts name members, lists are arrays,
/// vectors and the columns of matrices. An `int` is taken where the shader has a float; members
/// that are not named are left out.
pub(crate) fn members(shape: &Value, data: &Bound<'_, PyAny>) -> PyResult<Vec<Member>> {
    let mut out = Vec::new();
    collect(Some(shape), data, "", &mut out)?;
    Ok(out)
}

fn collect(
    shape: Option<&Value>,
    data: &Bound<'_, PyAny>,
    path: &str,
    out: &mut Vec<Member>,
) -> PyResult<()> {
    if let Ok(dict) = data.cast::<PyDict>() {
        // A block of one member, into which naga puts a struct, is used like the member.
        if let Some(Content::Struct(fields)) = shape.map(content)
            && let [(name, inner)] = fields[..]
            && matches!(content(inner), Content::Struct(_))
            && !dict.contains(name)?
        {
            return collect(Some(inner), data, path, out);
        }
        for (name, part) in dict {
            let name: String = name.extract()?;
            let field = shape.and_then(|shape| shape.field(&name));
            let path = if path.is_empty() { name } else { format!("{path}.{name}") };
            collect(field, &part, &path, out)?;
        }
        return Ok(());
    }
    if let Some(scalar) = scalar(shape, data)? {
        out.push((path.to_owned(), scalar));
        return Ok(());
    }
    let parts = data.try_iter().map_err(|_| {
        let ty = data.get_type();
        invalid(format!("`{path}` is given a {ty}: neither a number, a list nor a dict"))
    })?;
    let elements = shape.map_or(&[][..], |shape| shape.elements());
    for (at, part) in parts.enumerate() {
        // Those of a runtime array are all like the first one.
        let element = elements.get(at).or(elements.first());
        collect(element, &part?, &format!("{path}[{at}]"), out)?;
    }
    Ok(())
}

/// A number of Python or of numpy; `None` where the data are something else.
fn scalar(shape: Option<&Value>, data: &Bound<'_, PyAny>) -> PyResult<Option<ScalarValue>> {
    let is_float = shape.is_some_and(|shape| matches!(content(shape), Content::Scalar(ScalarKind::Float)));
    number(data, is_float)
}

/// A number of Python or of numpy, with integers as floats where these are wanted.
fn number(data: &Bound<'_, PyAny>, is_float: bool) -> PyResult<Option<ScalarValue>> {
    if let Ok(value) = data.cast::<PyBool>() {
        return Ok(Some(ScalarValue::Bool(value.is_true())));
    }
    if data.is_instance_of::<PyFloat>() {
        return Ok(Some(ScalarValue::Double(data.extract()?)));
    }
    if data.is_instance_of::<PyInt>() {
        if is_float {
            return Ok(Some(ScalarValue::Double(data.extract()?)));
        }
        let value = match data.extract::<i64>() {
            Ok(value) if value < 0 => ScalarValue::Int(value),
            _ => ScalarValue::Uint(data.extract()?),
        };
        return Ok(Some(value));
    }
    // Scalars of numpy, and arrays without dimensions.
    if data.hasattr("dtype")? && data.getattr("ndim")?.extract::<usize>()? == 0 {
        return number(&data.call_method0("item")?, is_float);
    }
    Ok(None)
}

/// The scalars of a number, or of nested lists of numbers, in order.
pub(crate) fn flat(data: &Bound<'_, PyAny>, is_float: bool) -> PyResult<Vec<ScalarValue>> {
    if let Some(scalar) = number(data, is_float)? {
        return Ok(vec![scalar]);
    }
    let mut out = Vec::new();
    for part in data.try_iter()? {
        out.extend(flat(&part?, is_float)?);
    }
    Ok(out)
}
