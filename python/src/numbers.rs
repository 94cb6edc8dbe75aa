//! Python's numbers, lists and dicts as scalars for the members of a shader's value. The crate
//! alone decides what becomes of a scalar: docs/testing.md, "Value conversions".

use anyhit::{NestedScalars, ScalarValue, Value};
use anyhit_engine::module::ty::Type;
use numpy::{PyArrayDescr, PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyRange, PyTuple};

use crate::argument::{Argument, class};
use crate::array::array_of;
use crate::error::{invalid, invalid_type};
use crate::value::{Content, content};

/// Scalars with the path that leads to them, `path[1].weight`; empty for the value itself.
pub(crate) type Member = (String, NestedScalars);

/// Lists in lists that are read: a list may hold itself.
pub(crate) const MAX_DEPTH: usize = 32;
/// Elements of lists that are read: a range takes no memory itself, nor does a list that is an
/// element of others many times.
const MAX_NUMBERS: usize = 1 << 24;

/// The scalars of Python data for a value of a shader: dicts name members, lists are arrays,
/// vectors and the columns of matrices. Members that are not named are left out.
pub(crate) fn members(shape: &Value, data: &Bound<'_, PyAny>) -> PyResult<Vec<Member>> {
    let mut out = Vec::new();
    collect(Some(shape), data, "", 0, &mut out)?;
    Ok(out)
}

fn collect(
    shape: Option<&Value>,
    data: &Bound<'_, PyAny>,
    path: &str,
    depth: usize,
    out: &mut Vec<Member>,
) -> PyResult<()> {
    if depth > MAX_DEPTH {
        return Err(too_deep(path));
    }
    if let Some(record) = record(data)? {
        return collect(shape, &record, path, depth + 1, out);
    }
    if let Ok(dict) = data.cast::<PyDict>() {
        // A block of one member, into which naga puts a struct, is used like the member.
        if let Some(Content::Struct(fields)) = shape.map(content)
            && let [(name, inner)] = fields[..]
            && matches!(content(inner), Content::Struct(_))
            && !dict.contains(name)?
        {
            return collect(Some(inner), data, path, depth + 1, out);
        }
        for (name, part) in dict {
            let name = String::of("the name of a member", &name)?;
            let field = shape.and_then(|shape| shape.field(&name));
            let path = if path.is_empty() { name } else { format!("{path}.{name}") };
            collect(field, &part, &path, depth + 1, out)?;
        }
        return Ok(());
    }
    let Some(parts) = dicts_within(data, depth)? else {
        out.push((path.to_owned(), nested(path, data, depth)?));
        return Ok(());
    };
    // A list of dicts: structs, which are set member by member.
    let elements = shape.map_or(&[][..], |shape| shape.elements());
    // A runtime array has no elements here, and grows.
    if !elements.is_empty() && elements.len() != parts.len() {
        let (given, wanted) = (parts.len(), elements.len());
        return Err(invalid(format!("`{path}` has {wanted} elements, found {given}")));
    }
    for (at, part) in parts.iter().enumerate() {
        collect(elements.get(at), part, &format!("{path}[{at}]"), depth + 1, out)?;
    }
    Ok(())
}

/// A struct of numpy as a dict of its members, an array of structs as a list; `None` for other
/// data.
fn record<'py>(data: &Bound<'py, PyAny>) -> PyResult<Option<Bound<'py, PyAny>>> {
    let Ok(dtype) = data.getattr("dtype") else { return Ok(None) };
    let Ok(dtype) = dtype.cast::<PyArrayDescr>() else { return Ok(None) };
    let Some(names) = dtype.names() else { return Ok(None) };
    if data.getattr("ndim")?.extract::<usize>()? > 0 {
        let items: Vec<_> = data.try_iter()?.collect::<PyResult<_>>()?;
        return Ok(Some(PyList::new(data.py(), items)?.into_any()));
    }
    let members = PyDict::new(data.py());
    for name in names {
        members.set_item(&name, data.get_item(&name)?)?;
    }
    Ok(Some(members.into_any()))
}

/// The parts of a list in which there are dicts, at any depth.
fn dicts_within<'py>(data: &Bound<'py, PyAny>, depth: usize) -> PyResult<Option<Vec<Bound<'py, PyAny>>>> {
    if depth > MAX_DEPTH || data.cast::<PyUntypedArray>().is_ok() {
        return Ok(None);
    }
    let Some(parts) = parts(data)? else { return Ok(None) };
    // All elements of a list have the kind of the first.
    let is_dict = match parts.first() {
        Some(first) if first.is_instance_of::<PyDict>() || record(first)?.is_some() => true,
        Some(first) => dicts_within(first, depth + 1)?.is_some(),
        None => false,
    };
    Ok(is_dict.then_some(parts))
}

/// The elements of a list, a tuple or a range. Texts and sets are no lists of numbers.
fn parts<'py>(data: &Bound<'py, PyAny>) -> PyResult<Option<Vec<Bound<'py, PyAny>>>> {
    let is_list = data.is_instance_of::<PyList>()
        || data.is_instance_of::<PyTuple>()
        || data.is_instance_of::<PyRange>();
    if !is_list {
        return Ok(None);
    }
    let count = data.len()?;
    if count > MAX_NUMBERS {
        return Err(too_long());
    }
    data.try_iter()?.take(count).collect::<PyResult<_>>().map(Some)
}

/// The scalars of a number, of a list of numbers, or of an array of numpy, in their nesting.
pub(crate) fn nested(path: &str, data: &Bound<'_, PyAny>, depth: usize) -> PyResult<NestedScalars> {
    nested_within(path, data, depth, &mut 0)
}

/// [`nested`], after so many elements of lists.
fn nested_within(
    path: &str,
    data: &Bound<'_, PyAny>,
    depth: usize,
    count: &mut usize,
) -> PyResult<NestedScalars> {
    if depth > MAX_DEPTH {
        return Err(too_deep(path));
    }
    if let Some(scalar) = number(path, data)? {
        return Ok(NestedScalars::One(scalar));
    }
    if let Some(parts) = parts(data)? {
        *count += parts.len();
        if *count > MAX_NUMBERS {
            return Err(too_long());
        }
        let parts = parts.iter().map(|part| nested_within(path, part, depth + 1, count));
        return Ok(NestedScalars::Many(parts.collect::<PyResult<_>>()?));
    }
    if let Some(array) = array_of(path, data)? {
        check_kind(path, &array)?;
        return nested_within(path, &array.call_method0("tolist")?, depth + 1, count);
    }
    let class = class(data);
    Err(invalid_type(format!("{}expected a number, a list of numbers or a dict, found {class}", of(path))))
}

/// A number of Python or of numpy; `None` where the data are something else.
fn number(path: &str, data: &Bound<'_, PyAny>) -> PyResult<Option<ScalarValue>> {
    if let Some(number) = python_number(path, data)? {
        return Ok(Some(number));
    }
    // A scalar of numpy.
    if data.hasattr("dtype")? && data.cast::<PyUntypedArray>().is_err() {
        let array = data.py().import("numpy")?.call_method1("asarray", (data,))?;
        let array = array.cast_into::<PyUntypedArray>()?;
        check_kind(path, &array)?;
        // An object without an array, such as the module `numpy`, is its own only item.
        return python_number(path, &array.call_method0("item")?);
    }
    Ok(None)
}

/// A number of Python; `None` where the data are something else.
fn python_number(path: &str, data: &Bound<'_, PyAny>) -> PyResult<Option<ScalarValue>> {
    if let Ok(value) = data.cast::<PyBool>() {
        return Ok(Some(ScalarValue::Bool(value.is_true())));
    }
    if data.is_instance_of::<PyFloat>() {
        return Ok(Some(ScalarValue::Double(data.extract()?)));
    }
    if data.is_instance_of::<PyInt>() {
        let value: i128 = data.extract().map_err(|_| {
            invalid(format!("{}{} is out of the range of every integer type", of(path), short(data)))
        })?;
        return Ok(Some(ScalarValue::Whole(value)));
    }
    Ok(None)
}

/// Numbers of numpy that Python has: bools, integers, floats of up to 64 bits, and objects.
fn check_kind(path: &str, array: &Bound<'_, PyUntypedArray>) -> PyResult<()> {
    let dtype = array.dtype();
    match dtype.kind() {
        b'b' | b'i' | b'u' | b'O' => Ok(()),
        b'f' if dtype.itemsize() <= 8 => Ok(()),
        _ => Err(invalid(format!("{}an array of {dtype} has no equivalent in a shader", of(path)))),
    }
}

fn too_long() -> PyErr {
    invalid(format!("lists of more than {MAX_NUMBERS} elements are not read: use an array of numpy"))
}

fn too_deep(path: &str) -> PyErr {
    invalid(format!("{}lists are nested more than {MAX_DEPTH} deep", of(path)))
}

/// The begin of a message about a member.
fn of(path: &str) -> String {
    if path.is_empty() { String::new() } else { format!("{path}: ") }
}

/// The text of a large integer.
fn short(data: &Bound<'_, PyAny>) -> String {
    let text = data.call_method0("bit_length").and_then(|bits| bits.extract::<u64>());
    text.map_or_else(|_| "an integer".to_owned(), |bits| format!("an integer of {bits} bits"))
}

/// A scalar type of numpy and of shaders.
pub(crate) trait Number: numpy::Element + Copy {
    /// The shader's type.
    const TYPE: Type;
    /// The number of its bits, zero-extended.
    fn of_bits(bits: u64) -> Self;
}

macro_rules! numbers {
    ($($ty:ty: $type:expr, $bits:ident => $of:expr;)*) => {$(
        impl Number for $ty {
            const TYPE: Type = $type;
            fn of_bits($bits: u64) -> Self {
                $of
            }
        }
    )*};
}

numbers! {
    f32: Type::Float { width: 32, encoding: None }, bits => f32::from_bits(bits as u32);
    u8: Type::Int { width: 8, signed: false }, bits => bits as u8;
    u32: Type::Int { width: 32, signed: false }, bits => bits as u32;
    i32: Type::Int { width: 32, signed: true }, bits => bits as i32;
    u64: Type::Int { width: 64, signed: false }, bits => bits;
    i64: Type::Int { width: 64, signed: true }, bits => bits as i64;
}

/// The numbers of a list in which all lists of one depth are as long, row after row, and its shape.
pub(crate) fn rectangular<T: Number>(name: &str, data: &Bound<'_, PyAny>) -> PyResult<(Vec<T>, Vec<usize>)> {
    let nested = nested(name, data, 0)?;
    let (mut lengths, mut first) = (Vec::new(), &nested);
    while let NestedScalars::Many(list) = first {
        lengths.push(list.len());
        match list.first() {
            Some(inner) => first = inner,
            None => break,
        }
    }
    let mut out = Vec::new();
    flatten(name, &nested, &lengths, &mut out)?;
    Ok((out, lengths))
}

fn flatten<T: Number>(
    name: &str,
    nested: &NestedScalars,
    lengths: &[usize],
    out: &mut Vec<T>,
) -> PyResult<()> {
    match (nested, lengths) {
        (NestedScalars::One(scalar), []) => {
            let bits = scalar.bits(&T::TYPE).map_err(|why| invalid(format!("{name}: {why}")))?;
            out.push(T::of_bits(bits));
            Ok(())
        }
        (NestedScalars::Many(list), [length, inner @ ..]) if list.len() == *length => {
            list.iter().try_for_each(|part| flatten(name, part, inner, out))
        }
        _ => Err(invalid(format!("{name}: the lists in it have different lengths"))),
    }
}
