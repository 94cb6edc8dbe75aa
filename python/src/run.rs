//! Runs the crate's functions without the GIL, so that a signal can interrupt them.

use std::sync::{Arc, Mutex, PoisonError};

use anyhit::Result;
use anyhit_base::interrupt::Interrupt;
use pyo3::prelude::*;

use crate::error::raised;

/// Runs a function without the GIL. Where a signal's handler raises an exception meanwhile
/// (`KeyboardInterrupt`), the function ends early and the exception is raised.
pub(crate) fn run<T: Send>(py: Python<'_>, function: impl FnOnce() -> Result<T> + Send) -> PyResult<T> {
    interruptible(py, function)?.map_err(raised)
}

/// As [`run`], for a function with errors of its own.
pub(crate) fn interruptible<T: Send>(py: Python<'_>, function: impl FnOnce() -> T + Send) -> PyResult<T> {
    let raised: Arc<Mutex<Option<PyErr>>> = Arc::default();
    let slot = raised.clone();
    let interrupt = Interrupt::new(move || {
        let error = Python::attach(|py| py.check_signals()).err();
        let is_raised = error.is_some();
        if is_raised {
            *slot.lock().unwrap_or_else(PoisonError::into_inner) = error;
        }
        is_raised
    });
    let result = py.detach(|| interrupt.scope(function));
    let error = raised.lock().unwrap_or_else(PoisonError::into_inner).take();
    error.map_or(Ok(result), Err)
}
