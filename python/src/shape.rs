//! `proxel.planarize`, `proxel.wire` and `proxel.shape`.

use crate::arrays::{self, Faces, column, table};
use crate::drive::{Cancel, Listener, hooked};
use crate::error::{InputError, refused};
use crate::outcome::{Draw, Outcome};
use crate::settings::{self, given, merged, to_value};
use numpy::PyReadonlyArray2;
use proxel::deform::Hooks;
use proxel::mesh::{Mesh, read_mesh_lenient};
use proxel::shape::{
    RecipeFile, ShapeError, ShapeInput, ShapeSettings, Shaped, draw_shaped, planarize as make_planar,
    shape as make_shape, subdivide, wire as make_wire,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Points and faces.
type Surface<'py> = (PyReadonlyArray2<'py, f64>, Faces<'py>);

/// What is heard of a run, and said to it.
type Caller<'py> = (Option<Bound<'py, PyAny>>, Option<Py<Cancel>>, bool);

fn input(mesh: &Surface<'_>, reference: Option<&Surface<'_>>) -> PyResult<ShapeInput> {
    let of = |(points, faces): &Surface<'_>| arrays::surface(points, faces);
    let reference = reference.map(of).transpose()?.map(|r| Mesh { name: "the reference".to_string(), ..r });
    Ok(ShapeInput { mesh: of(mesh)?, reference })
}

/// Positions, and what is known of the run.
type Run<'py> = PyResult<(Bound<'py, PyAny>, Outcome)>;

fn run<'py>(
    py: Python<'py>,
    input: ShapeInput,
    (callback, cancel, traced): Caller<'py>,
    solve: impl FnOnce(&ShapeInput, &mut Hooks<'_>) -> Result<Shaped, ShapeError> + Send,
) -> Run<'py> {
    let (solved, trace) = hooked(py, &Listener { callback, cancel }, traced, |hooks| solve(&input, hooks))?;
    let mut result = solved.map_err(refused)?;
    let arrays = PyDict::new(py);
    for errors in &result.faces {
        arrays.set_item(&errors.name, column(py, errors.after.clone()))?;
    }
    arrays.set_item("distance", column(py, result.distance.clone()))?;
    let positions = table(py, result.positions.clone())?;
    let mut report = std::mem::take(&mut result.report);
    let draw: Draw = Box::new(move || {
        let after = input.mesh.with_points(result.positions.clone()).map_err(|e| e.to_string())?;
        Ok(draw_shaped(&input.mesh, &after, &result.faces))
    });
    Ok((positions, Outcome::new(&mut report, &arrays, Some(draw))?.traced(trace)))
}

/// Makes faces planar: [`proxel::shape::planarize`].
#[pyfunction]
#[pyo3(signature = (mesh, reference, keywords, caller))]
pub fn planarize<'py>(
    py: Python<'py>,
    mesh: Surface<'py>,
    reference: Option<Surface<'py>>,
    keywords: &Bound<'py, PyDict>,
    caller: Caller<'py>,
) -> Run<'py> {
    let settings = settings::planarize(given(keywords)?)?;
    run(py, input(&mesh, reference.as_ref())?, caller, |input, hooks| make_planar(input, &settings, hooks))
}

/// Positions, the faces they are of where those were subdivided, and what is known of the run.
type Wired<'py> = PyResult<(Bound<'py, PyAny>, Option<Bound<'py, PyAny>>, Outcome)>;

/// Makes edges of one length: [`proxel::shape::wire`].
#[pyfunction]
#[pyo3(signature = (mesh, reference, keywords, caller))]
pub fn wire<'py>(
    py: Python<'py>,
    mesh: Surface<'py>,
    reference: Option<Surface<'py>>,
    keywords: &Bound<'py, PyDict>,
    caller: Caller<'py>,
) -> Wired<'py> {
    let settings = settings::wire(given(keywords)?)?;
    settings.check().map_err(refused)?;
    let mut input = input(&mesh, reference.as_ref())?;
    if settings.subdivide > 0 && input.reference.is_none() {
        input.reference = Some(input.mesh.clone());
    }
    for _ in 0..settings.subdivide {
        input.mesh = subdivide(&input.mesh).map_err(refused)?;
    }
    // Faces that were subdivided are quads.
    let quads: Vec<i32> = match settings.subdivide {
        0 => Vec::new(),
        _ => input.mesh.faces.indices().iter().map(|v| i32::try_from(*v).unwrap_or(i32::MAX)).collect(),
    };
    let (positions, outcome) = run(py, input, caller, |input, hooks| make_wire(input, &settings, hooks))?;
    let quads = (settings.subdivide > 0).then(|| column(py, quads));
    Ok((positions, quads, outcome))
}

/// Makes the constraints of a recipe hold: [`proxel::shape::shape`]. The recipe is a path or an object.
#[pyfunction]
#[pyo3(signature = (mesh, reference, recipe, keywords, caller))]
pub fn shape<'py>(
    py: Python<'py>,
    mesh: Surface<'py>,
    reference: Option<Surface<'py>>,
    recipe: &Bound<'py, PyAny>,
    keywords: &Bound<'py, PyDict>,
    caller: Caller<'py>,
) -> Run<'py> {
    let mut file = match recipe.extract::<PathBuf>() {
        Ok(path) => RecipeFile::read(&path).map_err(refused)?,
        Err(_) => {
            let mut recipe = to_value(recipe, "recipe")?;
            let Some(keys) = recipe.as_object_mut() else {
                return Err(InputError::new_err(
                    "the recipe is no dict; give a dict, or the path of a .toml or .json file",
                ));
            };
            // The mesh is what was given, whatever a recipe calls it.
            keys.entry("mesh").or_insert_with(|| arrays::MESH.into());
            RecipeFile::parse("the recipe".to_string(), &recipe.to_string(), true, PathBuf::new()).map_err(refused)?
        }
    };
    let solver = &file.recipe.solver;
    let (method, mu, anderson) = (solver.method, solver.mu, solver.anderson);
    let base = ShapeSettings { method, mu, anderson, ..ShapeSettings::recipe() };
    let settings: ShapeSettings = merged(&base, given(keywords)?)?;
    let solver = &mut file.recipe.solver;
    (solver.method, solver.mu, solver.anderson) = (settings.method, settings.mu, settings.anderson);
    let mut others: BTreeMap<String, Mesh> = BTreeMap::new();
    for name in file.recipe.constraints.iter().filter_map(|c| c.to.as_ref()) {
        if !others.contains_key(name) {
            others.insert(name.clone(), read_mesh_lenient(&file.path(name)).map_err(refused)?);
        }
    }
    let mut input = input(&mesh, reference.as_ref())?;
    if let (None, Some(name)) = (&input.reference, &file.recipe.reference) {
        input.reference = Some(read_mesh_lenient(&file.path(name)).map_err(refused)?);
    }
    let recipe = &file.recipe;
    run(py, input, caller, |input, hooks| make_shape(recipe, input, &others, &settings, hooks))
}
