//! The methods that outcomes share: they read what was bound, by set and binding or by name.

use std::sync::Arc;

use anyhit::{Program, Texels, Value};
use anyhit_engine::machine::Binding;
use anyhit_engine::module::ty::Type;
use anyhit_engine::program::descriptors::declared_blocks;
use anyhit_engine::reflect::{Layout, Rules};
use pyo3::prelude::*;

use crate::dtype::{buffer_array, runtime_array};
use crate::error::raised;
use crate::images::texels;
use crate::place::split;
use crate::value::to_python;

/// Methods of an outcome class with the fields `outcome` and `programs`.
macro_rules! reads_what_is_bound {
    ($outcome:ident) => {
        #[pymethods]
        impl $outcome {
            /// A mip level of an image: an array of float32, (height, width, 4), or of the integers
            /// that it holds.
            #[pyo3(signature = (set, binding=None, *, level=0))]
            fn image<'py>(
                &self,
                py: Python<'py>,
                set: &Bound<'py, PyAny>,
                binding: Option<&Bound<'py, PyAny>>,
                #[pyo3(from_py_with = crate::argument::level)] level: u32,
            ) -> PyResult<Bound<'py, PyAny>> {
                let read = |set, binding| self.outcome.image(set, binding);
                crate::bound::image(py, (set, binding), &self.programs, level, read)
            }

            /// A buffer by the names of its members.
            #[pyo3(signature = (set, binding=None))]
            fn buffer<'py>(
                &self,
                py: Python<'py>,
                set: &Bound<'py, PyAny>,
                binding: Option<&Bound<'py, PyAny>>,
            ) -> PyResult<Bound<'py, PyAny>> {
                let bytes = |set, binding| self.outcome.buffer_bytes(set, binding);
                let read = |set, binding| self.outcome.buffer(set, binding);
                crate::bound::buffer(py, (set, binding), &self.programs, read, bytes)
            }

            /// A buffer as an array of a dtype; without one, of the type that the shader declares.
            #[pyo3(signature = (set, binding=None, dtype=None))]
            fn read_buffer<'py>(
                &self,
                py: Python<'py>,
                set: &Bound<'py, PyAny>,
                binding: Option<&Bound<'py, PyAny>>,
                dtype: Option<&Bound<'py, PyAny>>,
            ) -> PyResult<Bound<'py, PyAny>> {
                let read = |set, binding| self.outcome.buffer_bytes(set, binding);
                crate::bound::read_buffer(py, (set, binding, dtype), &self.programs, read)
            }

            /// The buffer at a device address, from that address on, as an array of a dtype; of its
            /// bytes without one.
            #[pyo3(signature = (address, dtype=None))]
            fn read_buffer_at<'py>(
                &self,
                py: Python<'py>,
                #[pyo3(from_py_with = crate::argument::address)] address: u64,
                dtype: Option<&Bound<'py, PyAny>>,
            ) -> PyResult<Bound<'py, PyAny>> {
                let bytes = self.outcome.read_buffer_at::<u8>(address).map_err(crate::error::raised)?;
                crate::dtype::buffer_array(py, bytes, dtype, None)
            }

            /// The value at a device address by the names of its members, as the type of the first
            /// pointer that leads there.
            fn buffer_at<'py>(
                &self,
                py: Python<'py>,
                #[pyo3(from_py_with = crate::argument::address)] address: u64,
            ) -> PyResult<Bound<'py, PyAny>> {
                let value = self.outcome.buffer_at(address).map_err(crate::error::raised)?;
                crate::value::to_python(py, &value)
            }

            fn __eq__(&self, other: &Self) -> bool {
                self.outcome == other.outcome
            }
        }

        crate::copies::never_changes!($outcome);
    };
}
pub(crate) use reads_what_is_bound;

/// A mip level of an image.
pub(crate) fn image<'py>(
    py: Python<'py>,
    at: (&Bound<'py, PyAny>, Option<&Bound<'py, PyAny>>),
    programs: &[Arc<Program>],
    level: u32,
    read: impl Fn(u32, u32) -> anyhit::Result<Texels>,
) -> PyResult<Bound<'py, PyAny>> {
    let (place, _) = split(at.0, at.1, None)?;
    let Binding { set, binding } = place.in_programs(programs)?;
    texels(py, &read(set, binding).map_err(raised)?, level)
}

/// A buffer by the names of its members.
pub(crate) fn buffer<'py>(
    py: Python<'py>,
    at: (&Bound<'py, PyAny>, Option<&Bound<'py, PyAny>>),
    programs: &[Arc<Program>],
    read: impl Fn(u32, u32) -> anyhit::Result<Value>,
    bytes: impl Fn(u32, u32) -> anyhit::Result<Vec<u8>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (place, _) = split(at.0, at.1, None)?;
    let at = place.in_programs(programs)?;
    if let Some(block) = block(programs, at)
        && let Some((name, offset)) = last_numbers(block)
    {
        return with_last_numbers(py, block, &name, offset, bytes(at.set, at.binding).map_err(raised)?);
    }
    to_python(py, &read(at.set, at.binding).map_err(raised)?)
}

/// The array of numbers or vectors that ends a block, whose length is open: its name and offset.
fn last_numbers(block: Layout<'_>) -> Option<(String, usize)> {
    let is_number = |ty| matches!(block.module.ty(ty), Type::Int { .. } | Type::Float { encoding: None, .. });
    let Type::Struct { members, .. } = block.module.ty(block.ty) else { return None };
    let (offset, last) = block.members().last()?;
    let Type::RuntimeArray { element, .. } = *block.module.ty(last.ty) else { return None };
    let fits = match *block.module.ty(element) {
        Type::Vector { component, .. } => is_number(component),
        _ => is_number(element),
    };
    let name = members.last().map(|member| member.name.to_string()).filter(|name| !name.is_empty());
    fits.then(|| (name.unwrap_or_else(|| format!("_{}", members.len() - 1)), offset))
}

/// A block whose last member may be millions of numbers: numpy converts them.
fn with_last_numbers<'py>(
    py: Python<'py>,
    block: Layout<'_>,
    name: &str,
    offset: usize,
    mut bytes: Vec<u8>,
) -> PyResult<Bound<'py, PyAny>> {
    let last = bytes.split_off(offset.min(bytes.len()));
    let values = to_python(py, &block.read(&bytes))?;
    let numbers = runtime_array(py, block, last)?;
    values.set_item(name, numbers.call_method0("tolist")?)?;
    Ok(values)
}

/// A buffer as an array of a dtype, else of the type that a shader declares.
pub(crate) fn read_buffer<'py>(
    py: Python<'py>,
    at: (&Bound<'py, PyAny>, Option<&Bound<'py, PyAny>>, Option<&Bound<'py, PyAny>>),
    programs: &[Arc<Program>],
    read: impl Fn(u32, u32) -> anyhit::Result<Vec<u8>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (place, dtype) = split(at.0, at.1, at.2)?;
    let at = place.in_programs(programs)?;
    let bytes = read(at.set, at.binding).map_err(raised)?;
    buffer_array(py, bytes, dtype, block(programs, at))
}

/// The block that a shader of these uses at a binding.
pub(crate) fn block(programs: &[Arc<Program>], at: Binding) -> Option<Layout<'_>> {
    programs.iter().find_map(|program| {
        let (ty, ..) = declared_blocks(program).find(|(_, _, place)| *place == Some(at))?;
        Some(Layout::new(&program.module, ty, Rules::Explicit))
    })
}
