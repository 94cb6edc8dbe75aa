//! Errors of the crate as exceptions: `anyhit.errors` has the classes.

use anyhit::{Error, ErrorKind, Place, Trap};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::words::in_python;

/// An error of the crate as the exception of its kind.
pub(crate) fn raised(error: Error) -> PyErr {
    Python::attach(|py| match exception(py, &error) {
        Ok(exception) => PyErr::from_value(exception),
        Err(instead) => instead,
    })
}

/// An error of one of many rays, which the exception names as `ray`.
pub(crate) fn raised_of_ray(error: Error, ray: usize) -> PyErr {
    Python::attach(|py| {
        let exception = exception(py, &error.context(format!("ray {ray}"))).and_then(|exception| {
            exception.getattr("_details")?.set_item("ray", ray)?;
            Ok(exception)
        });
        exception.map_or_else(|instead| instead, PyErr::from_value)
    })
}

/// A mistake in the arguments of a call.
pub(crate) fn invalid(message: impl Into<String>) -> PyErr {
    raised(Error::new(ErrorKind::InvalidArgument, message))
}

/// An object of the wrong class among the arguments of a call.
pub(crate) fn invalid_type(message: impl Into<String>) -> PyErr {
    Python::attach(|py| {
        let error = Error::new(ErrorKind::InvalidArgument, message);
        let exception = details(py, &error).and_then(|details| {
            py.import("anyhit.errors")?.getattr("InvalidType")?.call1((error.render(), details))
        });
        exception.map_or_else(|instead| instead, PyErr::from_value)
    })
}

/// An exception, raised by a callback of Python's, as an error that passes through the crate.
pub(crate) fn from_python(py: Python<'_>, raised: &PyErr) -> Error {
    let text = raised.value(py).to_string();
    Error::new(ErrorKind::InvalidArgument, format!("{}: {text}", raised.get_type(py)))
}

fn exception<'py>(py: Python<'py>, error: &Error) -> PyResult<Bound<'py, PyAny>> {
    let make = py.import("anyhit.errors")?.getattr("of")?;
    make.call1((in_python(&error.render()), details(py, error)?))
}

/// What the exception has as attributes.
fn details<'py>(py: Python<'py>, error: &Error) -> PyResult<Bound<'py, PyDict>> {
    let details = PyDict::new(py);
    details.set_item("kind", format!("{:?}", error.kind()))?;
    details.set_item("message", in_python(error.message()))?;
    let notes: Vec<String> = error.notes().iter().map(|note| in_python(note)).collect();
    details.set_item("notes", notes)?;
    let places = PyList::empty(py);
    for (place, _) in error.places() {
        if let Some(place) = span(place) {
            places.append(place)?;
        }
    }
    details.set_item("places", places)?;
    let others: PyResult<Vec<_>> = error
        .others()
        .iter()
        .map(|other| Ok((in_python(&other.render()), self::details(py, other)?)))
        .collect();
    details.set_item("others", others?)?;
    let io = std::error::Error::source(error).and_then(|source| source.downcast_ref::<std::io::Error>());
    details.set_item("errno", io.and_then(std::io::Error::raw_os_error))?;
    if let Some(trap) = error.trap() {
        details.set_item("trap", trap_details(py, trap)?)?;
    }
    Ok(details)
}

/// File, line and column of a place; of a word of a module nothing.
pub(crate) fn span(place: &Place) -> Option<(String, u32, u32)> {
    match (place, place.file_line()) {
        (_, Some((file, line))) => {
            Some((file.to_owned(), line, place.columns().map_or(0, |columns| columns.start)))
        }
        (Place::File(path), None) => Some((path.display().to_string(), 0, 0)),
        _ => None,
    }
}

/// The trap as the crate writes it in JSON.
fn trap_details<'py>(py: Python<'py>, trap: &Trap) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(trap)
        .map_err(|error| pyo3::exceptions::PyRuntimeError::new_err(error.to_string()))?;
    py.import("json")?.getattr("loads")?.call1((text,))
}
