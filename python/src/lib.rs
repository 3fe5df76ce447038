//! The Python package `proxel`: the facade crate for numpy.
//!
//! This module converts and never computes. Arrays come in as the pure Python layer (`python/proxel`) has made
//! them: contiguous, of 64-bit floats and 32-bit indices. Settings are the serialised settings of the facade with
//! the caller's in their places; a run is driven by `drive`, without Python's lock and where Ctrl-C is heard.

mod arrays;
mod deform;
mod deformer;
mod drive;
mod energy;
mod error;
mod exclusive;
mod geodesic;
mod gradients;
mod image;
mod outcome;
mod problem;
mod settings;
mod shape;
mod simulate;
mod unwrap;
mod unwrapper;

use pyo3::prelude::*;

/// The compiled part of the package proxel.
///
/// It needs no global lock. It has no statics; all classes are frozen, and what changes in them is atomic or behind a
/// lock. What a `Deformer`, an `Unwrapper` and a `Simulator` wrap, a call has exclusively (`exclusive`), and a second call
/// meanwhile is refused. Arrays are copied before a run begins.
#[pymodule(gil_used = false)]
mod _core {
    #[pymodule_export]
    use super::deform::deform;
    #[pymodule_export]
    use super::deformer::Deformer;
    #[pymodule_export]
    use super::drive::{Cancel, Progress};
    #[pymodule_export]
    use super::error::{BusyError, InputError, SolveError};
    #[pymodule_export]
    use super::geodesic::geodesic;
    #[pymodule_export]
    use super::image::{restore, wavefront};
    #[pymodule_export]
    use super::outcome::Outcome;
    #[pymodule_export]
    use super::problem::problem;
    #[pymodule_export]
    use super::settings::settings;
    #[pymodule_export]
    use super::shape::{planarize, shape, wire};
    #[pymodule_export]
    use super::simulate::Simulator;
    #[pymodule_export]
    use super::unwrap::unwrap;
    #[pymodule_export]
    use super::unwrapper::Unwrapper;

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
