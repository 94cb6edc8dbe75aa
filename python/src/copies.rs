//! Copies of objects that never change: themselves.

/// `copy.copy` and `copy.deepcopy` of a class whose objects never change.
macro_rules! never_changes {
    ($($class:ident),*) => {$(
        #[pyo3::pymethods]
        impl $class {
            fn __copy__(slf: pyo3::Bound<'_, Self>) -> pyo3::Bound<'_, Self> {
                slf
            }

            fn __deepcopy__<'py>(
                slf: pyo3::Bound<'py, Self>,
                _memo: &pyo3::Bound<'py, pyo3::PyAny>,
            ) -> pyo3::Bound<'py, Self> {
                slf
            }
        }
    )*};
}
pub(crate) use never_changes;
