//! An energy written in Python.

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray3};
use proxel::deform::{ElementEnergy, Matrix};
use pyo3::prelude::*;
use std::sync::Mutex;

/// A function of deformation gradients (e, 3, 3) that returns densities (e,) and their derivatives (e, 3, 3).
pub struct Function {
    call: Py<PyAny>,
    barrier: bool,
    error: Mutex<Option<PyErr>>, // the first; nothing is asked after it
}

impl Function {
    /// Of what the layer above has made: a function and whether it is infinite where elements are inverted.
    pub fn new(of: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (call, barrier): (Bound<'_, PyAny>, bool) = of.extract()?;
        Ok(Function { call: call.unbind(), barrier, error: Mutex::new(None) })
    }

    /// What the function has raised.
    pub fn error(&self) -> Option<PyErr> {
        self.error.lock().ok()?.take()
    }

    fn ask(&self, py: Python<'_>, gradients: &[Matrix], values: &mut [f64], stresses: &mut [Matrix]) -> PyResult<()> {
        let f = PyArray1::from_slice(py, gradients.as_flattened().as_flattened());
        let answer = self.call.bind(py).call1((f.reshape([gradients.len(), 3, 3])?,))?;
        let (psi, p): (PyReadonlyArray1<'_, f64>, PyReadonlyArray3<'_, f64>) = answer.extract()?;
        // The layer above has checked both shapes.
        for (value, psi) in values.iter_mut().zip(psi.as_slice()?) {
            *value = *psi;
        }
        for (entry, p) in stresses.as_flattened_mut().as_flattened_mut().iter_mut().zip(p.as_slice()?) {
            *entry = *p;
        }
        Ok(())
    }
}

impl ElementEnergy for Function {
    fn evaluate(&self, gradients: &[Matrix], values: &mut [f64], stresses: &mut [Matrix]) {
        // Nothing descends to infinity, so that a run ends soon after an error.
        values.fill(f64::INFINITY);
        let Ok(mut error) = self.error.lock() else { return };
        if error.is_none() {
            *error = Python::attach(|py| self.ask(py, gradients, values, stresses)).err();
        }
    }

    fn is_barrier(&self) -> bool {
        self.barrier
    }
}
