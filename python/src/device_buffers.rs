//! Buffers with device addresses.

use std::sync::{Mutex, PoisonError};

use anyhit::{ErrorKind, InputLimit, InputLimits};
use pyo3::prelude::*;

use crate::argument;
use crate::array::bytes;
use crate::error::raised;
use crate::scene::Scene;

/// Buffers at device addresses, by name, for shaders that reach them by pointers: `ShaderTest`,
/// `ComputeTest` and `Scene` take them with `device_buffers`. Contents may hold the addresses of
/// other buffers. A test or scene has the contents of the time at which it was given them.
#[pyclass(frozen, module = "anyhit")]
pub(crate) struct DeviceBuffers {
    buffers: Mutex<anyhit::DeviceBuffers>,
}

impl DeviceBuffers {
    /// A copy of them as they are.
    pub(crate) fn now(&self) -> anyhit::DeviceBuffers {
        self.buffers.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn change<T>(&self, change: impl FnOnce(&mut anyhit::DeviceBuffers) -> anyhit::Result<T>) -> PyResult<T> {
        change(&mut self.buffers.lock().unwrap_or_else(PoisonError::into_inner)).map_err(raised)
    }
}

#[pymethods]
impl DeviceBuffers {
    /// No buffers yet.
    #[new]
    fn new() -> Self {
        Self { buffers: Mutex::default() }
    }

    /// Adds a buffer of so many zeros, to be written later. Returns its address.
    fn reserve(
        &self,
        #[pyo3(from_py_with = argument::name)] name: String,
        #[pyo3(from_py_with = argument::byte_count)] size: usize,
    ) -> PyResult<u64> {
        let (limits, kind) = (InputLimits::default(), ErrorKind::InvalidArgument);
        limits.check(InputLimit::BufferBytes, size as u64, kind).map_err(raised)?;
        self.change(|buffers| buffers.reserve(&name, size))
    }

    /// Adds a buffer with the bytes of an array, or of `bytes`. Returns its address.
    fn add(
        &self,
        #[pyo3(from_py_with = argument::name)] name: String,
        data: &Bound<'_, PyAny>,
    ) -> PyResult<u64> {
        let bytes = bytes("data", data)?;
        self.change(|buffers| buffers.add(&name, &bytes))
    }

    /// Writes the content of a buffer, which keeps its size.
    fn write(
        &self,
        #[pyo3(from_py_with = argument::name)] name: String,
        data: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let bytes = bytes("data", data)?;
        self.change(|buffers| buffers.write(&name, &bytes))
    }

    /// Gives an address to the acceleration structure of a scene; the one that it has, where it has
    /// one.
    fn structure(&self, #[pyo3(from_py_with = argument::scene)] scene: Scene) -> PyResult<u64> {
        self.change(|buffers| Ok(buffers.structure(&scene.scene)))
    }

    fn __repr__(&self) -> String {
        format!("<anyhit.{:?}>", self.now())
    }
}
