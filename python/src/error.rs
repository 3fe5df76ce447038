//! What Python is told of errors.

use pyo3::PyErr;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use std::fmt::Display;

pyo3::create_exception!(
    proxel,
    InputError,
    PyValueError,
    "Input that describes no problem. The message names the item, by its 0-based index, and the remedy."
);
pyo3::create_exception!(
    proxel,
    SolveError,
    PyRuntimeError,
    "A run that failed. The message says why; `info` is its report, where there is one."
);
pyo3::create_exception!(
    proxel,
    BusyError,
    PyRuntimeError,
    "A call of an object that is at work in another call, which goes on. The message names the class and the remedy."
);

/// What the facade refuses.
pub fn refused(e: impl Display) -> PyErr {
    InputError::new_err(e.to_string())
}
