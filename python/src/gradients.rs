//! `info.adjoint`: gradients of a function of a result.

use crate::arrays::{column, rows, table};
use crate::error::{InputError, refused};
use numpy::PyReadonlyArray2;
use proxel::deform::{Adjoint, DeformInput, Deformation, Moduli, adjoint};
use proxel::settings::{DeformSettings, UnwrapSettings};
use proxel::unwrap::{MapAdjoint, UnwrapInput, Unwrapped, adjoint as map_adjoint};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// A run that is over, kept for what can be asked of it afterwards.
#[derive(Clone)]
pub enum Kept {
    /// A body.
    Body(Arc<(DeformInput, DeformSettings, Deformation)>),
    /// A pose of a body that follows its handles: the body with other targets, which are those of the pose.
    Pose(Arc<DeformInput>, Box<Pose>),
    /// A map, and whether its coordinates are numbered as vertices are.
    Map(Arc<(UnwrapInput, UnwrapSettings, Unwrapped)>, bool),
    /// What has no gradients, and the remedy.
    Not(&'static str),
}

/// What of a body changes from pose to pose.
#[derive(Clone)]
pub struct Pose {
    /// Where fixed vertices are.
    pub fixed: Vec<(u32, [f64; 3])>,
    /// Ends of springs.
    pub soft: Vec<(u32, [f64; 3], f64)>,
    /// How it solves.
    pub settings: DeformSettings,
    /// The positions, and how they were arrived at.
    pub result: Deformation,
}

impl Kept {
    /// The gradients by the names of arguments, from dL/dX (n, 3) or dL/duv (k, 2).
    pub fn gradients<'py>(&self, py: Python<'py>, slope: &PyReadonlyArray2<'_, f64>) -> PyResult<Bound<'py, PyDict>> {
        match self {
            Kept::Body(run) => {
                let slope = rows(slope)?;
                let (input, settings, result) = &**run;
                let found = py.detach(|| adjoint(input, settings, result, &slope)).map_err(refused)?;
                of_body(py, found)
            }
            Kept::Pose(body, pose) => {
                let slope = rows(slope)?;
                let Pose { fixed, soft, settings, result } = &**pose;
                let found = py.detach(|| {
                    let input = DeformInput { fixed: fixed.clone(), soft: soft.clone(), ..(**body).clone() };
                    adjoint(&input, settings, result, &slope)
                });
                of_body(py, found.map_err(refused)?)
            }
            Kept::Not(what) => Err(InputError::new_err(format!("there are no gradients through {what}"))),
            Kept::Map(run, shared) => {
                let (input, settings, result) = &**run;
                let slope = of_coordinates(rows(slope)?, input, result, *shared)?;
                let MapAdjoint { vertices, pins, distance } =
                    py.detach(|| map_adjoint(input, settings, result, &slope)).map_err(refused)?;
                let out = PyDict::new(py);
                out.set_item("V", table(py, vertices)?)?;
                out.set_item("targets", table(py, pins)?)?;
                out.set_item("distance", distance)?;
                Ok(out)
            }
        }
    }
}

fn of_body(py: Python<'_>, found: Adjoint) -> PyResult<Bound<'_, PyDict>> {
    let out = moduli(py, &found.material)?;
    out.set_item("targets", table(py, found.fixed)?)?;
    out.set_item("spring_targets", table(py, found.soft)?)?;
    out.set_item("forces", table(py, found.forces)?)?;
    out.set_item("V", table(py, found.rest)?)?;
    let materials = PyDict::new(py);
    for (region, of) in &found.materials {
        materials.set_item(region, moduli(py, of)?)?;
    }
    out.set_item("materials", materials)?;
    out.set_item("distance", found.distance)?;
    Ok(out)
}

fn moduli<'py>(py: Python<'py>, of: &Moduli) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    out.set_item("young", of.young)?;
    out.set_item("poisson", of.poisson)?;
    out.set_item("mu", of.mu)?;
    out.set_item("lambda_", of.lambda)?;
    Ok(out)
}

/// From rows as the caller numbers them to those of the coordinates of the map.
fn of_coordinates(
    given: Vec<[f64; 2]>,
    input: &UnwrapInput,
    result: &Unwrapped,
    shared: bool,
) -> PyResult<Vec<[f64; 2]>> {
    let expected = if shared { input.mesh.n_verts() } else { result.uv.coordinates.len() };
    if given.len() != expected {
        let text = format!("dL/duv: it has {} rows for {expected} of uv; give one for each", given.len());
        return Err(InputError::new_err(text));
    }
    if !shared {
        return Ok(given);
    }
    let mut out = vec![[0.0; 2]; result.uv.coordinates.len()];
    for (v, c) in input.mesh.faces.indices().iter().zip(&result.uv.corners) {
        if let (Some(to), Some(from)) = (out.get_mut(*c as usize), given.get(*v as usize)) {
            *to = *from;
        }
    }
    Ok(out)
}

/// The vertices of the fixed entries of a body, in the order of their gradients.
pub fn pinned<'py>(py: Python<'py>, input: &DeformInput) -> Bound<'py, PyAny> {
    column(py, input.fixed.iter().map(|(v, _)| i32::try_from(*v).unwrap_or(i32::MAX)).collect())
}
