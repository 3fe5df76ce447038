//! Arrays of numpy, there and back.

use crate::error::{InputError, refused};
use numpy::{PyArray, PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use proxel::mesh::uv::UvMap;
use proxel::mesh::{Mesh, Polygons};
use pyo3::prelude::*;

/// What messages call the mesh of two arrays.
pub const MESH: &str = "the mesh";

/// Faces: the corners of all of them, and where each begins, (m + 1,).
pub type Faces<'py> = (PyReadonlyArray1<'py, u32>, PyReadonlyArray1<'py, u32>);

/// The rows of an array (n, D).
pub fn rows<T: numpy::Element + Copy, const D: usize>(array: &PyReadonlyArray2<'_, T>) -> PyResult<Vec<[T; D]>> {
    let (rows, rest) = array.as_slice().map_err(refused)?.as_chunks::<D>();
    let shape = array.as_array().dim();
    match shape.1 == D && rest.is_empty() {
        true => Ok(rows.to_vec()),
        false => Err(InputError::new_err(format!("an array is {} x {}; give rows of {D}", shape.0, shape.1))),
    }
}

/// The numbers of an array (n,).
pub fn numbers<T: numpy::Element + Copy>(array: &PyReadonlyArray1<'_, T>) -> PyResult<Vec<T>> {
    Ok(array.as_slice().map_err(refused)?.to_vec())
}

/// The polygons of [`Faces`].
pub fn polygons(faces: &Faces<'_>) -> PyResult<Polygons> {
    let (corners, offsets) = (faces.0.as_slice().map_err(refused)?, faces.1.as_slice().map_err(refused)?);
    let mut polygons = Polygons::new();
    for ends in offsets.windows(2) {
        let face = corners.get(ends[0] as usize..ends[1] as usize);
        polygons.push(face.ok_or_else(|| InputError::new_err("faces end beyond their corners"))?);
    }
    Ok(polygons)
}

/// A surface.
pub fn surface(points: &PyReadonlyArray2<'_, f64>, faces: &Faces<'_>) -> PyResult<Mesh> {
    Ok(Mesh { name: MESH.to_string(), points: rows(points)?, faces: polygons(faces)?, ..Mesh::default() })
}

/// A map as coordinates (k, 2) and which of them each corner has, -1 for none: `shared` where no vertex has two, so
/// that they are numbered as the vertices are, NaN where no face is. And whether that is so.
pub fn map<'py>(py: Python<'py>, mesh: &Mesh, map: &UvMap) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, bool)> {
    let index = |c: u32| if c == UvMap::NONE { -1 } else { i32::try_from(c).unwrap_or(i32::MAX) };
    let (coordinates, corners, shared) = match per_vertex(mesh, map) {
        Some(uv) => {
            let vertex = |(c, v): (&u32, &u32)| if *c == UvMap::NONE { -1 } else { index(*v) };
            (uv, map.corners.iter().zip(mesh.faces.indices()).map(vertex).collect(), true)
        }
        None => (map.coordinates.clone(), map.corners.iter().map(|c| index(*c)).collect::<Vec<i32>>(), false),
    };
    Ok((table(py, coordinates)?, PyArray1::from_vec(py, corners).into_any(), shared))
}

/// The coordinate of each vertex, unless one has two.
fn per_vertex(mesh: &Mesh, map: &UvMap) -> Option<Vec<[f64; 2]>> {
    let mut of = vec![UvMap::NONE; mesh.n_verts()];
    for (v, c) in mesh.faces.indices().iter().zip(&map.corners).filter(|(_, c)| **c != UvMap::NONE) {
        let known = of.get_mut(*v as usize)?;
        if *known != UvMap::NONE && known != c {
            return None;
        }
        *known = *c;
    }
    Some(of.iter().map(|c| map.coordinates.get(*c as usize).copied().unwrap_or([f64::NAN; 2])).collect())
}

/// An array (n, D), without a copy.
pub fn table<const D: usize>(py: Python<'_>, rows: Vec<[f64; D]>) -> PyResult<Bound<'_, PyAny>> {
    let n = rows.len();
    Ok(PyArray1::from_vec(py, rows.into_flattened()).reshape([n, D])?.into_any())
}

/// An array (n,), without a copy.
pub fn column<T: numpy::Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyAny> {
    PyArray1::from_vec(py, values).into_any()
}

/// An array of the shape of an image: (h, w), or (h, w, c) where `has_channels`.
pub fn pixels<'py>(py: Python<'py>, image: &proxel::imaging::Image, has_channels: bool) -> PyResult<Bound<'py, PyAny>> {
    let (w, h, c) = (image.width, image.height, image.channels.len());
    if !has_channels {
        let plane = image.channels.first().cloned().unwrap_or_default();
        return Ok(PyArray1::from_vec(py, plane).reshape([h, w])?.into_any());
    }
    let mut flat = vec![0.0; w * h * c];
    for (k, plane) in image.channels.iter().enumerate() {
        for (pixel, value) in flat.chunks_exact_mut(c).zip(plane) {
            pixel[k] = *value;
        }
    }
    let array: Bound<'py, PyArray<f64, numpy::Ix3>> = PyArray1::from_vec(py, flat).reshape([h, w, c])?;
    Ok(array.into_any())
}
