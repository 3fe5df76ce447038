//! Models: real ones from files, and a beam that needs none.

use crate::BenchError;
use crate::published::PUBLISHED;
use proxel::deform::{DeformInput, Hooks, deform};
use proxel::mesh::generate::{CellSplit, beam};
use proxel::mesh::{read_mesh, read_points, refine};
use proxel::pins::PinFile;
use proxel::settings::{DeformSettings, Material};
use std::path::{Path, PathBuf};

/// Name of the generated model.
pub const BEAM: &str = "beam";

/// A deformation problem with its solution.
#[derive(Clone, Debug)]
pub struct Model {
    /// Name of its folder, or [`BEAM`].
    pub name: String,
    /// What is solved; `reference` is its minimum.
    pub input: DeformInput,
    /// Seconds that reading took.
    pub read: f64,
}

impl Model {
    /// Vertices and tetrahedra, in thousands as in Table 1.
    pub fn size(&self) -> String {
        let thousands = |n: usize| format!("{:.1}", n as f64 / 1000.0);
        format!("{}/{}", thousands(self.input.rest.n_verts()), thousands(self.input.rest.tets.len()))
    }

    /// The objective at the reference: the start of a run that begins there.
    ///
    /// # Errors
    /// A model without a reference, or one that is no problem.
    pub fn least_energy(&self) -> Result<f64, BenchError> {
        self.least_energy_of(&Material::default())
    }

    /// The same for another material.
    ///
    /// # Errors
    /// As [`Self::least_energy`].
    pub fn least_energy_of(&self, material: &Material) -> Result<f64, BenchError> {
        let Some(reference) = &self.input.reference else {
            return Err(BenchError(format!("{}: it has no solution to measure against", self.name)));
        };
        let input = DeformInput { start: Some(reference.clone()), ..self.input.clone() };
        let settings = DeformSettings { max_iters: 0, material: material.clone(), ..DeformSettings::default() };
        let end = deform(&input, &settings, &mut Hooks::default()).map_err(BenchError::from_display)?;
        end.report.energy.ok_or_else(|| BenchError(format!("{}: the energy of its solution is infinite", self.name)))
    }

    /// Every tetrahedron into 8; without a reference.
    ///
    /// # Errors
    /// A mesh that cannot be refined.
    pub fn refined(&self) -> Result<Model, BenchError> {
        let began = std::time::Instant::now();
        let refined = refine::refine(&self.input.rest).map_err(BenchError::from_display)?;
        let start = match &self.input.start {
            Some(start) => refined.positions(start).map_err(BenchError::from_display)?,
            None => refined.mesh.points.clone(),
        };
        let coarse: Vec<u32> = self.input.fixed.iter().map(|(v, _)| *v).collect();
        let pins = refined.pins(&coarse).map_err(BenchError::from_display)?;
        let fixed = pins.into_iter().map(|v| (v, start[v as usize])).collect();
        let input = DeformInput { rest: refined.mesh, start: Some(start), fixed, ..DeformInput::default() };
        Ok(Model { name: format!("{} refined", self.name), input, read: began.elapsed().as_secs_f64() })
    }
}

/// The folder with a subfolder for each model, where `PROXEL_DATA` names one that exists.
pub fn folder() -> Option<PathBuf> {
    let folder = PathBuf::from(std::env::var_os("PROXEL_DATA")?).join("quasistatic");
    folder.is_dir().then_some(folder)
}

/// Names of the models found: known ones in the order of the paper, then others by name.
pub fn found() -> Vec<String> {
    let Some(folder) = folder() else { return Vec::new() };
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut names: Vec<String> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.join("rest.node").is_file())
        .filter_map(|path| Some(path.file_name()?.to_string_lossy().into_owned()))
        .collect();
    let place = |name: &String| PUBLISHED.iter().position(|p| p.model == name).unwrap_or(PUBLISHED.len());
    names.sort_by_key(|name| (place(name), name.clone()));
    names
}

/// A sentence that says which data was found.
pub fn describe(names: &[String]) -> String {
    let files = found();
    match (folder(), names) {
        (_, [name]) if name == BEAM => "Data: a generated beam, no files.".to_string(),
        (None, _) => "Data: none. Set PROXEL_DATA to the folder that holds `quasistatic/`, or ask for the generated \
                      one with `--models beam`."
            .to_string(),
        (Some(_), _) => {
            format!("Data: {} models found ({}); used here: {}.", files.len(), files.join(", "), names.join(", "))
        }
    }
}

/// Loads a model by name.
///
/// # Errors
/// A model that is not there or cannot be read.
pub fn load(name: &str) -> Result<Model, BenchError> {
    if name == BEAM {
        return solved(twisted_beam([10, 3, 3])?, 1e-10);
    }
    let Some(folder) = folder() else {
        return Err(BenchError(format!(
            "{name}: no data; set PROXEL_DATA to the folder that holds quasistatic/{name}"
        )));
    };
    read(name, &folder.join(name))
}

fn read(name: &str, folder: &Path) -> Result<Model, BenchError> {
    let began = std::time::Instant::now();
    let explain = BenchError::from_display;
    let rest = read_mesh(&folder.join("rest.node")).map_err(explain)?;
    let start = read_points(&folder.join("init.node")).map_err(explain)?;
    let pins = PinFile::read(&folder.join("handles.txt")).map_err(BenchError::from_display)?;
    let fixed = pins.resolve(&rest.points, Some(&start)).map_err(BenchError::from_display)?.fixed;
    let read = began.elapsed().as_secs_f64();
    // The polished minimum where there is one, else the authors' solution.
    let polished = folder.join("minimum.npy");
    let reference = if polished.is_file() { polished } else { folder.join("solution.node") };
    let reference = read_points(&reference).map_err(BenchError::from_display)?;
    let input = DeformInput { rest, start: Some(start), fixed, reference: Some(reference), ..DeformInput::default() };
    Ok(Model { name: name.to_string(), input, read })
}

/// A beam held at both ends, one of them turned by a third of a turn and pulled by a tenth; its inside starts at rest.
///
/// # Errors
/// No cells.
pub fn twisted_beam(cells: [usize; 3]) -> Result<Model, BenchError> {
    let began = std::time::Instant::now();
    let size = cells.map(|n| n as f64 / cells[0] as f64);
    let rest = beam(cells, size, CellSplit::Six).map_err(BenchError::from_display)?;
    let (sin, cos) = (std::f64::consts::TAU / 3.0).sin_cos();
    let mut start = rest.points.clone();
    let mut fixed = Vec::new();
    let tolerance = 1e-9 * size[0];
    for (v, p) in start.iter_mut().enumerate() {
        let [x, y, z] = *p;
        if x > 0.5 * size[0] - tolerance {
            *p = [x + 0.1 * size[0], cos * y - sin * z, sin * y + cos * z];
        }
        if x.abs() > 0.5 * size[0] - tolerance {
            fixed.push((v as u32, *p));
        }
    }
    let input = DeformInput { rest, start: Some(start), fixed, ..DeformInput::default() };
    Ok(Model { name: BEAM.to_string(), input, read: began.elapsed().as_secs_f64() })
}

/// The model with its own minimum, to a gradient of `tol`, as reference.
///
/// # Errors
/// A model that is no problem or does not converge.
pub fn solved(model: Model, tol: f64) -> Result<Model, BenchError> {
    solved_of(model, &Material::default(), tol)
}

/// The same for another material.
///
/// # Errors
/// As [`solved`].
pub fn solved_of(mut model: Model, material: &Material, tol: f64) -> Result<Model, BenchError> {
    let settings = DeformSettings { tol, max_iters: 20_000, material: material.clone(), ..DeformSettings::default() };
    let end = deform(&model.input, &settings, &mut Hooks::default()).map_err(BenchError::from_display)?;
    if end.report.status != "converged" {
        return Err(BenchError(format!("{}: its reference did not converge: {}", model.name, end.report.reason)));
    }
    model.input.reference = Some(end.positions);
    Ok(model)
}
