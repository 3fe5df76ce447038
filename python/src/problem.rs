//! `proxel.Problem`.

use crate::arrays::{self, Faces, numbers, rows, table};
use crate::drive::{Cancel, Listener, hooked};
use crate::energy::Function;
use crate::error::refused;
use crate::outcome::Outcome;
use crate::settings::{self, given, merged};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use proxel::compose::{ComposeSettings, Composition, OwnSets, Part, Projection, solve};
use proxel::deform::OwnEnergy;
use proxel::settings::Material;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// Points with a place each.
type Places<'py> = (PyReadonlyArray1<'py, u32>, PyReadonlyArray2<'py, f64>);

/// Points, where they are drawn to, and how stiffly.
type Springs<'py> = (PyReadonlyArray1<'py, u32>, PyReadonlyArray2<'py, f64>, PyReadonlyArray1<'py, f64>);

/// Faces and how much their fairing weighs.
type Fairing<'py> = (Faces<'py>, f64);

/// A problem as the layer above has collected it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ProblemInput<'py> {
    start: PyReadonlyArray2<'py, f64>,
    fixed: Vec<Places<'py>>,
    springs: Vec<Springs<'py>>,
    forces: Vec<Places<'py>>,
    fairing: Vec<Fairing<'py>>,
    parts: Vec<PartInput<'py>>,
}

/// A part of it: the keys tell which.
#[derive(FromPyObject)]
pub enum PartInput<'py> {
    /// An energy in Python.
    #[pyo3(from_item_all)]
    Own {
        rest: PyReadonlyArray2<'py, f64>,
        elements: PyReadonlyArray2<'py, u32>,
        energy: Bound<'py, PyAny>,
        material: Bound<'py, PyDict>,
    },
    /// A material.
    #[pyo3(from_item_all)]
    Elastic { rest: PyReadonlyArray2<'py, f64>, elements: PyReadonlyArray2<'py, u32>, material: Bound<'py, PyDict> },
    /// A projection in Python.
    #[pyo3(from_item_all)]
    Sets { elements: PyReadonlyArray2<'py, u32>, projection: Bound<'py, PyAny>, centred: bool, hard: bool, weight: f64 },
    /// A surface.
    #[pyo3(from_item_all)]
    Near { points: PyReadonlyArray1<'py, u32>, surface: (PyReadonlyArray2<'py, f64>, Faces<'py>), weight: f64 },
}

/// A function of rows (m, k, 3) that returns the nearest points of their sets.
struct Sets {
    call: Py<PyAny>,
    corners: usize,
    error: Mutex<Option<PyErr>>,    // the first; nothing is asked after it
    cancel: Mutex<Arc<AtomicBool>>, // of the run: an error ends it
}

impl Sets {
    fn ask(&self, py: Python<'_>, points: &mut [[f64; 3]]) -> PyResult<()> {
        let given = PyArray1::from_slice(py, points.as_flattened());
        let shape = [points.len() / self.corners.max(1), self.corners, 3];
        let answer = self.call.bind(py).call1((given.reshape(shape)?,))?;
        // The layer above has checked the shape.
        let nearest: PyReadonlyArray3<'_, f64> = answer.extract()?;
        for (to, from) in points.as_flattened_mut().iter_mut().zip(nearest.as_slice()?) {
            *to = *from;
        }
        Ok(())
    }
}

impl Projection for Sets {
    fn project(&self, points: &mut [[f64; 3]]) {
        let Ok(mut error) = self.error.lock() else { return };
        if error.is_none() {
            *error = Python::attach(|py| self.ask(py, points)).err();
            if let (Some(_), Ok(cancel)) = (&*error, self.cancel.lock()) {
                cancel.store(true, Ordering::Relaxed);
            }
        }
    }
}

/// What Python has raised while it was asked.
#[derive(Default)]
struct Asked {
    sets: Vec<Arc<Sets>>,
    energies: Vec<Arc<Function>>,
}

impl Asked {
    fn error(&self) -> Option<PyErr> {
        let of_sets = self.sets.iter().find_map(|s| s.error.lock().ok()?.take());
        of_sets.or_else(|| self.energies.iter().find_map(|e| e.error()))
    }
}

fn material(of: &Bound<'_, PyDict>) -> PyResult<Material> {
    Ok(settings::deform(given(of)?)?.material)
}

fn flat(elements: &PyReadonlyArray2<'_, u32>) -> PyResult<(Vec<u32>, usize)> {
    let corners = elements.as_array().ncols();
    Ok((elements.as_slice().map_err(refused)?.to_vec(), corners))
}

impl PartInput<'_> {
    fn part(&self, asked: &mut Asked) -> PyResult<Part> {
        Ok(match self {
            PartInput::Elastic { rest, elements, material: of } => {
                let (elements, corners) = flat(elements)?;
                Part::Elastic { rest: rows(rest)?, elements, corners, material: material(of)? }
            }
            PartInput::Own { rest, elements, energy, material: of } => {
                let own = Arc::new(Function::new(energy)?);
                asked.energies.push(own.clone());
                Part::Own { rest: rows(rest)?, tets: rows(elements)?, energy: OwnEnergy(own), like: material(of)? }
            }
            PartInput::Sets { elements, projection, centred, hard, weight } => {
                let (elements, corners) = flat(elements)?;
                let call = projection.clone().unbind();
                let sets = Arc::new(Sets { call, corners, error: Mutex::default(), cancel: Mutex::default() });
                asked.sets.push(sets.clone());
                Part::Sets { elements, corners, centred: *centred, sets: OwnSets(sets), hard: *hard, weight: *weight }
            }
            PartInput::Near { points, surface: (at, faces), weight } => {
                let surface = arrays::surface(at, faces)?;
                Part::Near { points: numbers(points)?, surface, weight: *weight }
            }
        })
    }
}

impl ProblemInput<'_> {
    fn composition(&self, asked: &mut Asked) -> PyResult<Composition> {
        let mut out = Composition { start: rows(&self.start)?, ..Composition::default() };
        for (points, places) in &self.fixed {
            out.fixed.extend(numbers(points)?.into_iter().zip(rows(places)?));
        }
        for (points, places, stiffness) in &self.springs {
            let ends = numbers(points)?.into_iter().zip(rows(places)?).zip(numbers(stiffness)?);
            out.springs.extend(ends.map(|((v, x), k)| (v, x, k)));
        }
        for (points, forces) in &self.forces {
            out.loads.extend(numbers(points)?.into_iter().zip(rows(forces)?));
        }
        for (faces, weight) in &self.fairing {
            out.fairing.push((arrays::polygons(faces)?, *weight));
        }
        out.parts = self.parts.iter().map(|part| part.part(asked)).collect::<PyResult<_>>()?;
        Ok(out)
    }
}

/// Points that solve it, and what is known of the run: [`proxel::compose::solve`].
#[pyfunction]
#[pyo3(signature = (input, keywords, callback, cancel, traced))]
pub fn problem<'py>(
    py: Python<'py>,
    input: ProblemInput<'py>,
    keywords: &Bound<'py, PyDict>,
    callback: Option<Bound<'py, PyAny>>,
    cancel: Option<Py<Cancel>>,
    traced: bool,
) -> PyResult<(Bound<'py, PyAny>, Outcome)> {
    let settings: ComposeSettings = merged(&ComposeSettings::default(), given(keywords)?)?;
    let mut asked = Asked::default();
    let of = input.composition(&mut asked)?;
    let (solved, trace) = hooked(py, &Listener { callback, cancel }, traced, |hooks| {
        for sets in &asked.sets {
            if let Ok(mut cancel) = sets.cancel.lock() {
                *cancel = hooks.cancel.clone();
            }
        }
        solve(&of, &settings, hooks)
    })?;
    if let Some(error) = asked.error() {
        return Err(error);
    }
    let mut result = solved.map_err(refused)?;
    let known = PyDict::new(py);
    known.set_item("violation", result.violation)?;
    let positions = table(py, std::mem::take(&mut result.positions))?;
    Ok((positions, Outcome::new(&mut result.report, &known, None)?.traced(trace)))
}
