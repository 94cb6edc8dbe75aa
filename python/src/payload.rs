//! The payload of a pipeline's rays: its shape, and the dtype of numpy for rows of it.

use anyhit::Value;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::reflect::{Layout, Rules};
use numpy::PyArrayDescr;
use pyo3::prelude::*;

use crate::dtype::{ArrayType, structure, with_sides};
use crate::error::invalid;
use crate::value::{Content, ScalarKind, content};

/// Zeros of the payload, or the callable data, that a shader is given; `None` where it takes none.
pub(crate) fn of_program(program: &anyhit::Program) -> Option<Value> {
    let classes = [storage::INCOMING_RAY_PAYLOAD, storage::INCOMING_CALLABLE_DATA];
    let registers = classes.into_iter().find_map(|class| program.interface_registers(class))?;
    let layout = Layout::new(&program.module, registers.ty, Rules::Packed);
    Some(layout.read(&vec![0; layout.size()]))
}

/// Zeros of the largest payload that a shader of a pipeline declares: that of rays which are traced
/// without a ray generation shader.
pub(crate) fn of_pipeline(pipeline: &anyhit::Pipeline) -> Option<Value> {
    let programs = pipeline.programs.iter().filter_map(|program| {
        let registers = program.interface_registers(storage::INCOMING_RAY_PAYLOAD)?;
        Some((registers.count, program))
    });
    programs.max_by_key(|(count, _)| *count).and_then(|(_, program)| of_program(program))
}

/// The dtype of one element, and the shape of its array: of a `vec3` float32 and (3,).
pub(crate) fn dtype<'py>(py: Python<'py>, shape: &Value) -> PyResult<ArrayType<'py>> {
    match content(shape) {
        Content::Struct(fields) => {
            let mut parts = Vec::new();
            let mut offset = 0;
            for (name, field) in fields {
                parts.push((name.to_owned(), offset, dtype(py, field)?));
                offset += field.bytes().len();
            }
            Ok((structure(py, &parts, shape.bytes().len())?, Vec::new()))
        }
        Content::List(elements) => {
            let first = elements.first().ok_or_else(|| invalid("an array without elements has no dtype"))?;
            let (element, inner) = dtype(py, first)?;
            Ok((element, [vec![elements.len()], inner].concat()))
        }
        Content::Scalar(kind) => {
            Ok((PyArrayDescr::new(py, scalar_dtype(kind, shape))?.into_any(), Vec::new()))
        }
    }
}

/// The dtype of a scalar. In a payload those of up to 32 bits take four bytes: booleans are 0 or 1,
/// and what is smaller shows its bits.
fn scalar_dtype(kind: ScalarKind, scalar: &Value) -> String {
    let size = scalar.bytes().len();
    match (kind, scalar.ty()) {
        (ScalarKind::Float, "float" | "double") => format!("<f{size}"),
        (ScalarKind::Int, "int" | "int64_t") => format!("<i{size}"),
        (ScalarKind::Bool | ScalarKind::Int | ScalarKind::Float, _) => format!("<u{size}"),
        (ScalarKind::Opaque, _) => format!("V{size}"),
    }
}

/// The dtype of rows of this payload.
pub(crate) fn row_dtype<'py>(py: Python<'py>, shape: &Value) -> PyResult<Bound<'py, PyAny>> {
    with_sides(py, dtype(py, shape)?)
}
