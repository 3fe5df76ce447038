//! The flag, the pit and the cylinders, from the authors' meshes or stand-ins for them.

use super::{Walls, Wind};
use crate::BenchError;
use proxel::mesh::generate::{cloth, torus};
use proxel::mesh::{Mesh, read_mesh};
use proxel::model::elements::BatchShape;
use proxel::model::energy::Lame;
use std::path::PathBuf;

/// A body at rest, what acts on it and what is in its way.
#[derive(Clone, Debug)]
pub struct Body {
    /// At rest, where it starts.
    pub mesh: Mesh,
    /// Triangles or tetrahedra.
    pub shape: BatchShape,
    /// Its material.
    pub lame: Lame,
    /// Young's modulus in Pa and Poisson's ratio.
    pub moduli: (f64, f64),
    /// kg/m^3, or kg/m^2 of a sheet.
    pub density: f64,
    /// Hard limits of stretches.
    pub limits: Option<(f64, f64)>,
    /// Vertices that are held in place, ascending.
    pub pins: Vec<u32>,
    /// Wind.
    pub wind: Option<Wind>,
    /// Obstacles.
    pub walls: Option<Walls>,
}

impl Body {
    /// The diagonal of its box.
    pub fn size(&self) -> f64 {
        let reach = |d: usize| {
            let values = || self.mesh.points.iter().map(|p| p[d]);
            values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
        };
        (0..3).map(|d| reach(d).powi(2)).sum::<f64>().sqrt()
    }

    /// The mean length of its edges, each counted once.
    pub fn mean_edge(&self) -> f64 {
        let mut edges: Vec<[u32; 2]> = Vec::new();
        let mut add = |corners: &[u32]| {
            for (k, a) in corners.iter().enumerate() {
                edges.extend(corners[..k].iter().map(|b| [*a.min(b), *a.max(b)]));
            }
        };
        match self.shape {
            BatchShape::Triangles => self.mesh.faces.fan_triangles().iter().for_each(|t| add(t)),
            _ => self.mesh.tets.iter().for_each(|t| add(t)),
        }
        edges.sort_unstable();
        edges.dedup();
        let length = |e: &[u32; 2]| {
            let [a, b] = e.map(|v| self.mesh.points[v as usize]);
            (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt()
        };
        edges.iter().map(length).sum::<f64>() / edges.len().max(1) as f64
    }
}

/// A body and whether its mesh is the authors'.
#[derive(Clone, Debug)]
pub struct Find {
    /// The body.
    pub body: Body,
    /// Where its mesh is from, a sentence.
    pub source: String,
    /// Whether it is the authors'.
    pub is_original: bool,
}

/// The folder with the meshes of simulations, where `PROXEL_DATA` names one that exists.
pub fn simulation() -> Option<PathBuf> {
    let folder = PathBuf::from(std::env::var_os("PROXEL_DATA")?).join("simulation");
    folder.is_dir().then_some(folder)
}

/// The mesh of this name, or its stand-in.
fn mesh(name: &str, stand_in: impl FnOnce() -> Result<Mesh, BenchError>) -> Result<(Mesh, bool, String), BenchError> {
    match simulation().map(|folder| folder.join(name)).filter(|path| path.is_file()) {
        Some(path) => {
            let mesh = read_mesh(&path).map_err(BenchError::from_display)?;
            Ok((mesh, true, format!("Data: {name} of $PROXEL_DATA/simulation, the authors' mesh.")))
        }
        None => {
            let mesh = stand_in()?;
            let folder = "$PROXEL_DATA/simulation";
            Ok((mesh, false, format!("Data: {name} was not found in {folder}; a generated mesh stands in for it.")))
        }
    }
}

/// Numbers as the authors' implementation has them before it computes with them in double precision.
fn single(v: f64) -> f64 {
    f64::from(v as f32)
}

fn lame((young, poisson): (f64, f64)) -> Result<Lame, BenchError> {
    Lame::from_young_poisson(young, poisson).map_err(BenchError::from_display)
}

/// Figure 4: a flag of 1.5 by 1 m held at two corners, strains within 5 %.
///
/// # Errors
/// A mesh that cannot be read.
pub fn flag() -> Result<Find, BenchError> {
    let (mut mesh, is_original, source) =
        mesh("cloth.obj", || cloth([50, 24], [1.5, 1.0]).map_err(BenchError::from_display))?;
    mesh.points.iter_mut().for_each(|p| *p = p.map(single));
    // The corners of the edge of least x.
    let least = mesh.points.iter().map(|p| p[0]).fold(f64::INFINITY, f64::min);
    let edge: Vec<(f64, u32)> =
        mesh.points.iter().zip(0u32..).filter(|(p, _)| p[0] <= least + 1e-3).map(|(p, v)| (p[1], v)).collect();
    let by_height = |a: &&(f64, u32), b: &&(f64, u32)| a.0.total_cmp(&b.0);
    let mut pins: Vec<u32> =
        [edge.iter().min_by(by_height), edge.iter().max_by(by_height)].into_iter().flatten().map(|p| p.1).collect();
    pins.sort_unstable();
    pins.dedup();
    let moduli = (50.0, 0.1);
    let body = Body {
        mesh,
        shape: BatchShape::Triangles,
        lame: lame(moduli)?,
        moduli,
        density: 1.0,
        limits: Some((0.95, 1.05)),
        pins,
        wind: Some(Wind { velocity: [25.0, 0.0, 5.0], coupling: 1000.0, share: 0.33 }),
        walls: None,
    };
    Ok(Find { body, source, is_original })
}

/// The horse, or a ring, in its place above the obstacles.
fn horse(height: f64, walls: Walls) -> Result<Find, BenchError> {
    let (mut mesh, is_original, source) =
        mesh("horse759.node", || torus(0.55, 0.25, 0.12).map_err(BenchError::from_display))?;
    let shift = [0.25, height, 0.0];
    for p in &mut mesh.points {
        *p = match is_original {
            true => [0, 1, 2].map(|d| single(single(13.0 * single(p[d])) + shift[d])),
            // The ring lies; turned by 60 degrees it comes down on its rim.
            false => {
                let (s, c) = 60.0_f64.to_radians().sin_cos();
                let turned = [p[0], c * p[1] - s * p[2], s * p[1] + c * p[2]];
                [0, 1, 2].map(|d| turned[d] + shift[d])
            }
        };
    }
    let moduli = (1e7, 0.499);
    let body = Body {
        mesh,
        shape: BatchShape::Tetrahedra,
        lame: lame(moduli)?,
        moduli,
        density: 1522.0,
        limits: None,
        pins: Vec::new(),
        wind: None,
        walls: Some(walls),
    };
    Ok(Find { body, source, is_original })
}

/// Figure 5: the horse falls on the ground beside and into a bowl.
///
/// # Errors
/// A mesh that cannot be read.
pub fn pit() -> Result<Find, BenchError> {
    horse(2.5, Walls::Pit { floor: -3.0, radius: 1.0 })
}

/// Figure 6: it falls among 23 cylinders onto a slope.
///
/// # Errors
/// A mesh that cannot be read.
pub fn cylinders() -> Result<Find, BenchError> {
    let row = |n: usize, x: f64, y: f64| (0..n).map(move |i| [1.5 * i as f64 - x, y]);
    let mut centers: Vec<[f64; 2]> = (0..3).flat_map(|j| row(5, 3.0, 3.0 * f64::from(j) - 3.0)).collect();
    centers.extend((0..2).flat_map(|j| row(4, 2.25, 3.0 * f64::from(j) - 1.5)));
    let slope = ([0.0, -6.5, 0.0], [0.5, 0.75_f64.sqrt(), 0.0]);
    horse(5.0, Walls::Cylinders { centers, radius: single(0.4), slope })
}
