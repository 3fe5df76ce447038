//! `proxel.unwrap`.

use crate::arrays::{self, Faces, numbers, rows};
use crate::drive::{Cancel, Listener, drive, pooled};
use crate::error::{InputError, refused};
use crate::gradients::Kept;
use crate::outcome::{Draw, Outcome, map_trace};
use crate::settings::{given, merged};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use proxel::mesh::Mesh;
use proxel::mesh::uv::{CertificateOptions, UvMap, certify};
use proxel::settings::UnwrapSettings;
use proxel::unwrap::{Hooks, MapPictures, UnwrapInput, unwrap as solve};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// Vertices and where they are held.
pub type Pins<'py> = (PyReadonlyArray1<'py, u32>, PyReadonlyArray2<'py, f64>);

/// What is to be mapped, apart from points and faces.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct MapInput<'py> {
    seams: Option<PyReadonlyArray2<'py, u32>>,
    pins: Option<Pins<'py>>,
    weights: Option<PyReadonlyArray1<'py, f64>>,
    metric: Option<PyReadonlyArray2<'py, f64>>,
    start: Option<(PyReadonlyArray2<'py, f64>, PyReadonlyArray1<'py, i64>)>,
}

impl MapInput<'_> {
    /// With points and faces.
    pub fn input(&self, points: &PyReadonlyArray2<'_, f64>, faces: &Faces<'_>) -> PyResult<UnwrapInput> {
        let mesh = arrays::surface(points, faces)?;
        Ok(UnwrapInput {
            seams: self.seams.as_ref().map_or(Ok(Vec::new()), rows)?,
            start: self.start.as_ref().map(|(uv, corners)| start(uv, corners, &mesh)).transpose()?,
            pins: self.pins.as_ref().map_or(Ok(Vec::new()), pins)?,
            weights: self.weights.as_ref().map(numbers).transpose()?,
            metric: self.metric.as_ref().map(rows).transpose()?,
            mesh,
        })
    }
}

/// Vertices with their places.
pub fn pins((vertices, places): &Pins<'_>) -> PyResult<Vec<(u32, [f64; 2])>> {
    Ok(numbers(vertices)?.into_iter().zip(rows(places)?).collect())
}

fn start(uv: &PyReadonlyArray2<'_, f64>, corners: &PyReadonlyArray1<'_, i64>, mesh: &Mesh) -> PyResult<UvMap> {
    let index = |c: i64| if c < 0 { UvMap::NONE } else { u32::try_from(c).unwrap_or(UvMap::NONE - 1) };
    let map = UvMap { coordinates: rows(uv)?, corners: numbers(corners)?.into_iter().map(index).collect() };
    map.check(&mesh.faces).map_err(|e| InputError::new_err(format!("start: {e}")))?;
    Ok(map)
}

/// Coordinates (k, 2), the coordinate of each corner, and what is known of the run.
type Mapped<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Outcome);

/// Maps a surface into the plane: [`proxel::unwrap::unwrap`].
#[pyfunction]
#[pyo3(signature = (points, faces, input, keywords, callback, cancel, traced))]
pub fn unwrap<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    faces: Faces<'py>,
    input: MapInput<'py>,
    keywords: &Bound<'py, PyDict>,
    callback: Option<Bound<'py, PyAny>>,
    cancel: Option<Py<Cancel>>,
    traced: bool,
) -> PyResult<Mapped<'py>> {
    let settings: UnwrapSettings = merged(&UnwrapSettings::default(), given(keywords)?)?;
    let input = input.input(&points, &faces)?;
    let listener = Listener { callback, cancel };
    let result = drive(py, &listener, |link| {
        let mut on_progress = |p: &proxel::unwrap::Progress| link.tell(p.into());
        let mut hooks = Hooks { traced, cancel: link.cancel.clone(), ..Hooks::default() };
        if link.is_heard() {
            hooks.progress = Some(&mut on_progress);
        }
        let mut result = solve(&input, &settings, &mut hooks).map_err(|e| e.to_string())?;
        if result.uv.coordinates.as_flattened().iter().all(|v| v.is_finite()) {
            let options = CertificateOptions { reversed_faces: result.charts.reversed_faces.clone() };
            let (mesh, uv) = (&input.mesh, &result.uv);
            let certify = || certify(&mesh.points, &mesh.faces, uv, &options).map_err(|e| e.to_string());
            let found = pooled(settings.threads, certify)?;
            result.certified(&found, mesh);
        }
        Ok::<_, String>(result)
    })?;
    let mut result = result.map_err(refused)?;
    let (uv, corners, shared) = arrays::map(py, &input.mesh, &result.uv)?;
    let packed = result.report.map.as_ref().is_some_and(|m| m.density.is_some());
    let trace = traced.then(|| map_trace(py, &result.rows)).transpose()?;
    let mut report = result.report.clone();
    result.rows = Vec::new();
    let kept = Arc::new((input, settings, result));
    let drawn = kept.clone();
    let draw: Draw = Box::new(move || Ok(MapPictures::new(&drawn.0.mesh, &drawn.2.uv, packed).map()));
    let outcome = Outcome::new(&mut report, &PyDict::new(py), Some(draw))?.traced(trace);
    Ok((uv, corners, outcome.keeping(Kept::Map(kept, shared))))
}
