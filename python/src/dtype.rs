//! Types of numpy as layouts that are compared with those of shaders, and layouts of shaders as
//! types of numpy.

use anyhit_engine::module::ty::Type;
use anyhit_engine::reflect::Layout;
use anyhit_unit_test::fit::{WholeArray, whole_array};
use anyhit_unit_test::host_struct::{HostField, HostType, ScalarClass};
use numpy::{PyArrayDescr, PyArrayDescrMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::array::from_bytes;
use crate::error::invalid;
use crate::numbers::MAX_DEPTH;

/// The layout of a dtype. Members without a type (`V4`) are padding.
pub(crate) fn host_type(argument: &str, dtype: &Bound<'_, PyArrayDescr>) -> PyResult<HostType> {
    nested(argument, dtype, 0)
}

fn nested(argument: &str, dtype: &Bound<'_, PyArrayDescr>, depth: usize) -> PyResult<HostType> {
    if depth > MAX_DEPTH {
        return Err(invalid(format!("{argument}: a dtype is nested more than {MAX_DEPTH} deep")));
    }
    if dtype.has_subarray() {
        let element = nested(argument, &dtype.base(), depth + 1)?;
        return Ok(dtype.shape().into_iter().rev().fold(element, HostType::array));
    }
    if let Some(names) = dtype.names() {
        let mut fields = Vec::new();
        for name in names {
            let (field, offset) = dtype.get_field(&name)?;
            if !is_padding(&field) {
                fields.push(HostField { name, offset, ty: nested(argument, &field, depth + 1)? });
            }
        }
        return Ok(HostType::structure("dtype", dtype.itemsize(), dtype.alignment(), fields));
    }
    check_byte_order(argument, dtype)?;
    let class = match dtype.kind() {
        b'f' if dtype.itemsize() <= 8 => ScalarClass::Float,
        b'b' | b'i' | b'u' => ScalarClass::Integer,
        _ => return Err(invalid(format!("{argument}: {dtype} has no equivalent in a shader"))),
    };
    Ok(HostType::scalar(dtype.to_string(), class, dtype.itemsize()))
}

fn is_padding(dtype: &Bound<'_, PyArrayDescr>) -> bool {
    let element = if dtype.has_subarray() { dtype.base() } else { dtype.clone() };
    element.kind() == b'V' && !element.has_fields()
}

/// # Errors
/// `InvalidArgument` for scalars of the other byte order.
pub(crate) fn check_byte_order(argument: &str, dtype: &Bound<'_, PyArrayDescr>) -> PyResult<()> {
    if dtype.is_native_byteorder().unwrap_or(true) {
        return Ok(());
    }
    Err(invalid(format!(
        "{argument}: {dtype} has another byte order: convert it with \
         `{argument}.astype({argument}.dtype.newbyteorder('='))`"
    )))
}

/// The dtype of a value of a shader, and the lengths of arrays around it.
pub(crate) type ArrayType<'py> = (Bound<'py, PyAny>, Vec<usize>);

/// The dtype of the elements of a block that is an array, and of a whole block otherwise. The array
/// that ends a block has `count` elements. Padding belongs to the dtype: of elements that are no
/// structs, it is a struct with the member `value`, of the columns or rows of a matrix one with
/// `column` or `row`.
pub(crate) fn of_block<'py>(py: Python<'py>, block: Layout<'_>, count: usize) -> PyResult<ArrayType<'py>> {
    let block = unwrapped(block);
    match whole_array(block) {
        Some(WholeArray { array, element, .. }) => padded(py, "value", element, array.stride(), count),
        None => of_layout(py, block, block.size(), count),
    }
}

/// The only member of a block without a name, into which compilers put what is no struct.
fn unwrapped(block: Layout<'_>) -> Layout<'_> {
    match block.module.ty(block.ty) {
        Type::Struct { members, .. } if members.len() == 1 && members[0].name.is_empty() => {
            block.members().next().map_or(block, |(_, member)| member)
        }
        _ => block,
    }
}

/// Returns whether the elements of an array have padding that their dtype shows as a struct.
fn is_padded(part: Layout<'_>, stride: usize) -> bool {
    part.size() != stride && !matches!(part.module.ty(part.ty), Type::Struct { .. })
}

/// The dtype of a part that takes so many bytes of what it is a part of.
fn padded<'py>(
    py: Python<'py>,
    name: &str,
    part: Layout<'_>,
    stride: usize,
    count: usize,
) -> PyResult<ArrayType<'py>> {
    let inner = of_layout(py, part, stride, count)?;
    if is_padded(part, stride) { wrapped(py, name, inner, stride) } else { Ok(inner) }
}

/// A struct of one member.
fn wrapped<'py>(py: Python<'py>, name: &str, inner: ArrayType<'py>, size: usize) -> PyResult<ArrayType<'py>> {
    Ok((structure(py, &[(name.to_owned(), 0, inner)], size)?, Vec::new()))
}

/// A struct of these members, each with its offset.
pub(crate) fn structure<'py>(
    py: Python<'py>,
    fields: &[(String, usize, ArrayType<'py>)],
    size: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let parts = PyDict::new(py);
    let formats: PyResult<Vec<_>> =
        fields.iter().map(|(_, _, (dtype, sides))| Ok((dtype, PyTuple::new(py, sides)?))).collect();
    parts.set_item("names", fields.iter().map(|(name, ..)| name).collect::<Vec<_>>())?;
    parts.set_item("formats", formats?)?;
    parts.set_item("offsets", fields.iter().map(|(_, offset, _)| offset).collect::<Vec<_>>())?;
    parts.set_item("itemsize", size)?;
    Ok(PyArrayDescr::new(py, parts)?.into_any())
}

/// The dtype of an array of these lengths; without lengths, of an element.
pub(crate) fn with_sides<'py>(
    py: Python<'py>,
    (element, sides): ArrayType<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    match sides.is_empty() {
        true => Ok(element),
        false => Ok(PyArrayDescr::new(py, (element, PyTuple::new(py, sides)?))?.into_any()),
    }
}

fn of_layout<'py>(
    py: Python<'py>,
    layout: Layout<'_>,
    size: usize,
    count: usize,
) -> PyResult<ArrayType<'py>> {
    let named = |name: String| Ok((PyArrayDescr::new(py, name)?.into_any(), Vec::new()));
    let with = |(dtype, mut sides): ArrayType<'py>, length: usize| {
        sides.insert(0, length);
        (dtype, sides)
    };
    match layout.module.ty(layout.ty) {
        Type::Int { width, signed } => named(format!("<{}{}", if *signed { 'i' } else { 'u' }, width / 8)),
        Type::Float { width, encoding: None } => named(format!("<f{}", width / 8)),
        Type::Bool | Type::Float { .. } | Type::Pointer { .. } => named(format!("<u{}", layout.size())),
        Type::Vector { component, count: lanes } => {
            let part = of_layout(py, layout.part(*component), 0, count)?;
            Ok(with(part, *lanes as usize))
        }
        Type::Matrix { column, count: columns } => {
            let (part, rows) = (of_layout(py, layout.scalar(*column), 0, count)?, layout.lanes(*column));
            let scalar = layout.scalar(*column).size();
            let (name, length, lines, stride) = match layout.matrix.filter(|_| layout.explicit()) {
                Some(matrix) if matrix.row_major => ("row", *columns as usize, rows, matrix.stride as usize),
                Some(matrix) => ("column", rows, *columns as usize, matrix.stride as usize),
                None => ("column", rows, *columns as usize, rows * scalar),
            };
            let line = with(part, length);
            let line = if length * scalar == stride { line } else { wrapped(py, name, line, stride)? };
            Ok(with(line, lines))
        }
        Type::Struct { members, .. } => {
            let mut fields = Vec::new();
            for ((index, member), (offset, part)) in members.iter().enumerate().zip(layout.members()) {
                let name = match member.name.as_str() {
                    "" => format!("_{index}"),
                    name => name.to_owned(),
                };
                fields.push((name, offset, of_layout(py, part, part.size(), count)?));
            }
            let end = layout.runtime_stride().map_or(0, |(offset, stride)| offset + stride * count);
            Ok((structure(py, &fields, size.max(end))?, Vec::new()))
        }
        _ => match layout.element() {
            Some((element, length)) => {
                let element = padded(py, "value", element, layout.stride(), count)?;
                Ok(with(element, length.unwrap_or(count)))
            }
            None => Err(invalid(format!("{} has no dtype", layout.module.describe_type(layout.ty)))),
        },
    }
}

/// The bytes of the array without a length that ends a block as an array.
pub(crate) fn runtime_array<'py>(
    py: Python<'py>,
    block: Layout<'_>,
    mut bytes: Vec<u8>,
) -> PyResult<Bound<'py, PyAny>> {
    let array = block.members().last().map_or(block, |(_, member)| member);
    let (stride, (element, _)) = (array.stride(), array.element().unwrap_or((array, None)));
    let (dtype, sides) = padded(py, "value", element, stride, 0)?;
    let count = bytes.len() / stride.max(1);
    bytes.truncate(count * stride);
    let lengths = std::iter::once(count).chain(sides).map(|side| side as isize);
    let numbers = from_bytes(py, bytes, &dtype, &lengths.collect::<Vec<_>>())?;
    if is_padded(element, stride) { numbers.get_item("value") } else { Ok(numbers) }
}

/// The bytes of a buffer as an array of the type that a shader declares, or of a given dtype;
/// without both of bytes.
pub(crate) fn buffer_array<'py>(
    py: Python<'py>,
    bytes: Vec<u8>,
    dtype: Option<&Bound<'py, PyAny>>,
    block: Option<Layout<'_>>,
) -> PyResult<Bound<'py, PyAny>> {
    if let Some(dtype) = dtype {
        let dtype = PyArrayDescr::new(py, dtype)?;
        let size = dtype.itemsize();
        if size == 0 || !bytes.len().is_multiple_of(size) {
            let count = bytes.len();
            return Err(invalid(format!(
                "dtype: {count} bytes are no whole number of {dtype}, of {size} bytes"
            )));
        }
        return from_bytes(py, bytes, &dtype, &[-1]);
    }
    let Some(block) = block else {
        return from_bytes(py, bytes, &py.import("numpy")?.getattr("uint8")?, &[-1]);
    };
    let count = match block.runtime_stride() {
        Some((offset, stride)) => bytes.len().saturating_sub(offset) / stride.max(1),
        None => 0,
    };
    let (dtype, sides) = of_block(py, block, count)?;
    let size: usize = dtype.getattr("itemsize")?.extract()?;
    let inner: usize = sides.iter().product();
    let whole = whole_array(block);
    let elements = match whole {
        Some(WholeArray { length: Some(length), .. }) => length,
        Some(_) => bytes.len() / (size * inner).max(1),
        None => 1,
    };
    let mut bytes = bytes;
    bytes.resize(elements * size * inner, 0);
    let lengths = whole.map(|_| elements).into_iter().chain(sides).map(|side| side as isize);
    let array = from_bytes(py, bytes, &dtype, &lengths.collect::<Vec<_>>())?;
    if whole.is_some_and(|whole| is_padded(whole.element, whole.array.stride())) {
        array.get_item("value")
    } else {
        Ok(array)
    }
}
