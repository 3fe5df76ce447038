//! `proxel.deform`.

use crate::arrays::{self, Faces, MESH, numbers, rows, table};
use crate::drive::{Cancel, Listener, hooked};
use crate::energy::Function;
use crate::error::{InputError, refused};
use crate::gradients::{Kept, pinned};
use crate::outcome::{Draw, Outcome};
use crate::settings::{self, given, to_value};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use proxel::deform::{DeformInput, OwnEnergy, deform as solve, draw_deformation, extras};
use proxel::mesh::Mesh;
use proxel::pins::{HalfSpace, Handles, PinFile};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use std::sync::Arc;

/// Vertices and where they are to be.
pub type Targets<'py> = (PyReadonlyArray1<'py, u32>, PyReadonlyArray2<'py, f64>);

/// Vertices, where they are drawn to, and how stiffly.
type Springs<'py> = (PyReadonlyArray1<'py, u32>, PyReadonlyArray2<'py, f64>, PyReadonlyArray1<'py, f64>);

/// A body and what holds and loads it, apart from its points.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct BodyInput<'py> {
    tets: Option<PyReadonlyArray2<'py, u32>>,
    faces: Option<Faces<'py>>,
    edges: Option<PyReadonlyArray2<'py, u32>>,
    regions: Option<PyReadonlyArray1<'py, i32>>,
    pins: Option<Targets<'py>>,
    groups: Option<Bound<'py, PyAny>>,
    start: Option<PyReadonlyArray2<'py, f64>>,
    springs: Option<Springs<'py>>,
    forces: Option<PyReadonlyArray2<'py, f64>>,
    pressure: Option<f64>,
    obstacles: Option<PyReadonlyArray2<'py, f64>>,
    reference: Option<PyReadonlyArray2<'py, f64>>,
    energy: Option<Bound<'py, PyAny>>,
}

impl BodyInput<'_> {
    fn mesh(&self, points: &PyReadonlyArray2<'_, f64>) -> PyResult<Mesh> {
        let mut mesh = Mesh { name: MESH.to_string(), points: rows(points)?, ..Mesh::default() };
        mesh.tets = self.tets.as_ref().map_or(Ok(Vec::new()), rows)?;
        if let Some(faces) = &self.faces {
            mesh.faces = arrays::polygons(faces)?;
        }
        mesh.edges = self.edges.as_ref().map_or(Ok(Vec::new()), rows)?;
        let regions = self.regions.as_ref().map(numbers).transpose()?;
        let elements = [mesh.tets.len(), mesh.faces.len(), mesh.edges.len()].into_iter().find(|n| *n > 0).unwrap_or(0);
        if let Some(regions) = regions.as_ref().filter(|r| r.len() != elements) {
            let text = format!("there are {} regions for {elements} elements; give one for each", regions.len());
            return Err(InputError::new_err(text));
        }
        match (mesh.tets.is_empty(), mesh.faces.is_empty()) {
            (false, _) => mesh.tet_regions = regions,
            (true, false) => mesh.face_regions = regions,
            (true, true) => mesh.edge_regions = regions,
        }
        Ok(mesh)
    }

    /// The groups of a pins file, by its path or as an object.
    fn handles(&self, mesh: &Mesh, start: Option<&[[f64; 3]]>) -> PyResult<Handles> {
        let Some(groups) = &self.groups else { return Ok(Handles::default()) };
        let file = match groups.extract::<PathBuf>() {
            Ok(path) => PinFile::read(&path),
            Err(_) => PinFile::from_json("pins", &to_value(groups, "pins")?.to_string()),
        };
        file.and_then(|file| file.resolve(&mesh.points, start)).map_err(refused)
    }

    /// With its points; and what is odd about it.
    pub fn input(&self, points: &PyReadonlyArray2<'_, f64>) -> PyResult<(DeformInput, Vec<String>)> {
        if self.energy.is_some() {
            return Err(InputError::new_err("a Deformer takes no energy of one's own; call deform"));
        }
        self.input_with(points, None)
    }

    /// With its points and perhaps an energy in the place of the material's; and what is odd about it.
    fn input_with(
        &self,
        points: &PyReadonlyArray2<'_, f64>,
        energy: Option<OwnEnergy>,
    ) -> PyResult<(DeformInput, Vec<String>)> {
        let rest = self.mesh(points)?;
        let n = rest.n_verts();
        let same = |what: &str, array: &Option<PyReadonlyArray2<'_, f64>>| -> PyResult<Option<Vec<[f64; 3]>>> {
            let Some(array) = array else { return Ok(None) };
            let points = rows(array)?;
            match points.len() == n {
                true => Ok(Some(points)),
                false => {
                    let text = format!("{what}: it has {} rows for {n} vertices; give one for each", points.len());
                    Err(InputError::new_err(text))
                }
            }
        };
        let start = same("start", &self.start)?;
        let mut handles = self.handles(&rest, start.as_deref())?;
        if let Some((vertices, places)) = &self.pins {
            let vertices = numbers(vertices)?;
            handles.groups.push(("pins".to_string(), vertices.clone()));
            handles.fixed.extend(vertices.into_iter().zip(rows(places)?));
        }
        if let Some((vertices, places, stiffness)) = &self.springs {
            let ends = numbers(vertices)?.into_iter().zip(rows(places)?).zip(numbers(stiffness)?);
            handles.soft.extend(ends.map(|((v, x), k)| (v, x, k)));
        }
        let forces = same("forces", &self.forces)?.unwrap_or_default();
        let loads = forces.into_iter().enumerate().filter(|(_, f)| *f != [0.0; 3]).map(|(v, f)| (v as u32, f));
        handles.loads.extend(loads);
        handles.pressures.extend(self.pressure.map(|p| ((0..n as u32).collect(), p)));
        let planes: Vec<[f64; 6]> = self.obstacles.as_ref().map_or(Ok(Vec::new()), rows)?;
        let plane = |o: [f64; 6]| HalfSpace { point: [o[0], o[1], o[2]], normal: [o[3], o[4], o[5]] };
        handles.obstacles.extend(planes.into_iter().map(plane));
        let input = DeformInput {
            rest,
            start,
            fixed: handles.fixed,
            soft: handles.soft,
            loads: handles.loads,
            pressures: handles.pressures,
            equalities: handles.equalities,
            obstacles: handles.obstacles,
            groups: handles.groups,
            reference: same("reference", &self.reference)?,
            energy,
            ..DeformInput::default()
        };
        Ok((input, handles.warnings))
    }
}

/// Positions of least energy: [`proxel::deform::deform`].
#[pyfunction]
#[pyo3(signature = (points, input, keywords, callback, cancel, traced))]
pub fn deform<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    input: BodyInput<'py>,
    keywords: &Bound<'py, PyDict>,
    callback: Option<Bound<'py, PyAny>>,
    cancel: Option<Py<Cancel>>,
    traced: bool,
) -> PyResult<(Bound<'py, PyAny>, Outcome)> {
    let settings = settings::deform(given(keywords)?)?;
    let own = input.energy.as_ref().map(Function::new).transpose()?.map(Arc::new);
    let energy = own.clone().map(|own| OwnEnergy(own));
    let (input, mut warnings) = input.input_with(&points, energy)?;
    let listener = Listener { callback, cancel };
    let (solved, trace) = hooked(py, &listener, traced, |hooks| solve(&input, &settings, hooks))?;
    if let Some(error) = own.as_ref().and_then(|own| own.error()) {
        return Err(error);
    }
    let mut result = solved.map_err(refused)?;
    warnings.append(&mut result.report.warnings);
    result.report.warnings = warnings;
    let arrays = PyDict::new(py);
    arrays.set_item("reaction", table(py, result.reaction.clone())?)?;
    arrays.set_item("pins", pinned(py, &input))?;
    let positions = table(py, result.positions.clone())?;
    let mut report = result.report.clone();
    // Colours are those of the material's energy density.
    let has_picture = own.is_none();
    let kept = Arc::new((input, settings, result));
    let drawn = kept.clone();
    let draw: Draw = Box::new(move || {
        let (input, settings, result) = &*drawn;
        let extras = extras(input, settings, result).map_err(|e| e.to_string())?;
        Ok(draw_deformation(input, settings.mixed, result, &extras))
    });
    let outcome = Outcome::new(&mut report, &arrays, has_picture.then_some(draw))?;
    Ok((positions, outcome.traced(trace).keeping(Kept::Body(kept))))
}
