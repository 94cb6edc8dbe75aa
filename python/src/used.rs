//! Warns of a builder's method as a statement of its own, which changes nothing: its result is
//! deleted unused on the line that made it.

use std::ffi::CString;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use pyo3::exceptions::PyRuntimeWarning;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

/// Tracks whether the result of a builder method is used. A clone is a use.
pub(crate) struct Use {
    /// What returned the result; `None` for a constructor.
    of: Option<Method>,
    is_used: AtomicBool,
}

/// A method that returned a result.
struct Method {
    class: &'static str,
    name: &'static str,
    caller: Caller,
}

/// A line of Python that runs: the address of its frame, and its number.
#[derive(PartialEq)]
struct Caller(usize, u32);

impl Caller {
    fn current(py: Python<'_>) -> PyResult<Self> {
        static GET_FRAME: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        let import = || Ok::<_, PyErr>(py.import("sys")?.getattr("_getframe")?.unbind());
        let frame = GET_FRAME.get_or_try_init(py, import)?.bind(py).call0()?;
        Ok(Self(frame.as_ptr().addr(), frame.getattr("f_lineno")?.extract()?))
    }
}

impl Use {
    /// The result of a constructor, which may stay unused.
    pub(crate) fn free() -> Self {
        Self { of: None, is_used: AtomicBool::new(true) }
    }

    /// The result of a method of a class.
    pub(crate) fn of(class: &'static str, name: &'static str) -> Self {
        let caller = Python::attach(Caller::current);
        let of = caller.ok().map(|caller| Method { class, name, caller });
        Self { of, is_used: AtomicBool::new(false) }
    }

    /// Records a use.
    pub(crate) fn mark(&self) {
        self.is_used.store(true, Relaxed);
    }
}

impl Clone for Use {
    fn clone(&self) -> Self {
        self.mark();
        Self::free()
    }
}

impl Drop for Use {
    fn drop(&mut self) {
        if let (Some(method), false) = (&self.of, self.is_used.load(Relaxed)) {
            Python::try_attach(|py| method.warn(py));
        }
    }
}

impl Method {
    /// Warns where the line that called the method still runs.
    fn warn(&self, py: Python<'_>) {
        // An exception that is being raised while the object is deleted stays.
        let pending = PyErr::take(py);
        if pending.is_none() && Caller::current(py).is_ok_and(|caller| caller == self.caller) {
            let Self { class, name, .. } = self;
            let text = format!(
                "the {class} that `{name}` returned was not used: the method changes a copy, so write \
                 `x = x.{name}(...)` or chain the calls"
            );
            let text = CString::new(text).unwrap_or_default();
            if let Err(error) = PyErr::warn(py, &py.get_type::<PyRuntimeWarning>(), &text, 1) {
                error.write_unraisable(py, None);
            }
        }
        if let Some(pending) = pending {
            pending.restore(py);
        }
    }
}
