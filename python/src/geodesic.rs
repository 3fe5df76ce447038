//! `proxel.geodesic`.

use crate::arrays::{self, Faces, column, numbers};
use crate::drive::{Cancel, Listener, drive};
use crate::error::refused;
use crate::outcome::{Draw, Outcome, trace};
use crate::settings::{given, merged};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use proxel::geodesic::{Hooks, geodesic as solve};
use proxel::mesh::topology::surface;
use proxel::preview::draw_distances;
use proxel::report::TraceRow;
use proxel::settings::GeodesicSettings;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Size of the picture: two views side by side.
const PICTURE: [usize; 2] = [1440, 720];

/// Distances on a surface: [`proxel::geodesic::geodesic`].
#[pyfunction]
#[pyo3(signature = (points, faces, sources, keywords, callback, cancel, traced))]
pub fn geodesic<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    faces: Faces<'py>,
    sources: PyReadonlyArray1<'py, u32>,
    keywords: &Bound<'py, PyDict>,
    callback: Option<Bound<'py, PyAny>>,
    cancel: Option<Py<Cancel>>,
    traced: bool,
) -> PyResult<(Bound<'py, PyAny>, Outcome)> {
    let settings: GeodesicSettings = merged(&GeodesicSettings::default(), given(keywords)?)?;
    let mesh = arrays::surface(&points, &faces)?;
    let sources = numbers(&sources)?;
    let mut lines: Vec<TraceRow> = Vec::new();
    let solved = drive(py, &Listener { callback, cancel }, |link| {
        let mut on_row = |row: &TraceRow| {
            link.tell(row.into());
            lines.push(*row);
        };
        let mut hooks = Hooks { cancel: link.cancel.clone(), ..Hooks::default() };
        if traced || link.is_heard() {
            hooks.trace = Some(&mut on_row);
        }
        solve(&mesh, &sources, &settings, &mut hooks)
    })?;
    let mut result = solved.map_err(refused)?;
    let trace = traced.then(|| trace(py, &lines)).transpose()?;
    let distance = column(py, result.distance.clone());
    let values = std::mem::take(&mut result.distance);
    let draw: Draw = Box::new(move || {
        let triangles = surface(&mesh).fan_triangles();
        Ok(draw_distances(&mesh.points, &triangles, &values, PICTURE[0], PICTURE[1]))
    });
    Ok((distance, Outcome::new(&mut result.report, &PyDict::new(py), Some(draw))?.traced(trace)))
}
