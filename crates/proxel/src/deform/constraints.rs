//! What surrounds a body: linear equalities, obstacles, pressure.

use super::elements::Cells;
use super::{DeformError, DeformInput};
use crate::settings::DeformSettings;
use proxel_mesh::topology::boundary_surface;
use proxel_model::obstacle::{HalfSpace, Obstacle};
use proxel_model::pressure::Pressure;
use proxel_split::{Equalities, Equality, EqualityError, Problem, Term, VIOLATION};
use std::sync::Arc;

/// Squared weights of obstacles over the stiffness that a node has from its elements.
const OBSTACLE_WEIGHT: f64 = 0.3;

/// The faces that pressure on some vertices acts on: of the boundary of tetrahedra, else triangles.
fn patch(kinds: &[Cells], vertices: &[u32], n: usize) -> Vec<[u32; 3]> {
    let faces = kinds.first().map_or_else(Vec::new, |cells| match cells {
        Cells::Tets(tets) => boundary_surface(tets),
        Cells::Triangles(triangles) => triangles.clone(),
        Cells::Springs(_) => Vec::new(),
    });
    let mut chosen = vec![false; n];
    for v in vertices {
        if let Some(chosen) = chosen.get_mut(*v as usize) {
            *chosen = true;
        }
    }
    faces.into_iter().filter(|f| f.iter().all(|v| chosen[*v as usize])).collect()
}

/// Whether some pressure acts on an open patch, and so pushes the body somewhere.
pub(super) fn pushes(input: &DeformInput, kinds: &[Cells]) -> bool {
    let n = input.rest.n_verts();
    input.pressures.iter().any(|(vertices, _)| !Pressure::border(&patch(kinds, vertices, n)).is_empty())
}

/// The body, as far as its surroundings are concerned.
pub(super) struct Around<'a> {
    pub name: &'a str,
    pub input: &'a DeformInput,
    pub number: &'a [u32],
    pub center: [f64; 3],
    pub kinds: &'a [Cells],
}

impl Around<'_> {
    /// Adds them to the problem, obstacles as its last terms; returns warnings.
    pub fn add(&self, problem: &mut Problem, settings: &DeformSettings) -> Result<Vec<String>, DeformError> {
        let mut warnings = Vec::new();
        if !self.input.equalities.is_empty() && !settings.method.takes_hard_sets() {
            return Err(DeformError(format!(
                "{} cannot hold equalities; use --method wrapd, r-admm, w-admm or admm-pd",
                settings.method.as_str()
            )));
        }
        problem.quadratic.equalities = self.equalities(problem)?;
        for (vertices, pressure) in &self.input.pressures {
            warnings.extend(self.add_pressure(problem, vertices, *pressure)?);
        }
        let stiffness = if self.input.obstacles.is_empty() { Vec::new() } else { problem.node_stiffness() };
        for k in 0..self.input.obstacles.len() {
            let term = match problem.dim {
                2 => self.obstacle::<2>(problem, k, &stiffness)?,
                _ => self.obstacle::<3>(problem, k, &stiffness)?,
            };
            problem.terms.push(term);
        }
        Ok(warnings)
    }

    /// The rows over free nodes; fixed ones are read from the problem's start.
    pub fn equalities(&self, problem: &Problem) -> Result<Equalities, DeformError> {
        let rows = self.input.equalities.iter().map(|Equality { nodes, value }| {
            let sum: f64 = nodes.iter().map(|n| n.1).sum();
            Equality {
                nodes: nodes
                    .iter()
                    .map(|(v, a)| (self.number.get(*v as usize).copied().unwrap_or(u32::MAX), *a))
                    .collect(),
                value: [0, 1, 2].map(|d| value[d] - sum * self.center[d]),
            }
        });
        Equalities::new(rows.collect(), problem.n_free, &problem.x0, problem.dim).map_err(|e| {
            let (row, what) = match e {
                EqualityError::Redundant { row } => (row, "follows from those before it and from pins; remove it"),
                EqualityError::Contradictory { row } => {
                    (row, "contradicts those before it or pins; correct or remove it")
                }
                EqualityError::Row { row } => {
                    (row, "names no vertex of the mesh or has a number that is not finite; correct it")
                }
            };
            DeformError(format!("{}: equality {row} (0-based) {what}", self.name))
        })
    }

    fn add_pressure(&self, problem: &mut Problem, vertices: &[u32], p: f64) -> Result<Option<String>, DeformError> {
        if problem.dim == 2 {
            return Err(DeformError(format!("{}: pressure acts on faces; it does not go with --planar", self.name)));
        }
        let faces = patch(self.kinds, vertices, self.number.len());
        if faces.is_empty() || !p.is_finite() {
            return Err(DeformError(format!(
                "{}: the pressure {p} acts on {} faces; choose vertices so that all corners of some face are among them",
                self.name,
                faces.len()
            )));
        }
        let faces: Vec<[u32; 3]> = faces.iter().map(|f| f.map(|v| self.number[v as usize])).collect();
        let border = Pressure::border(&faces);
        let free = border.iter().filter(|[a, _]| (*a as usize) < problem.n_free).count();
        problem.quadratic.potentials.push(Arc::new(Pressure::new(faces, p, &problem.x0)));
        Ok((free > 0).then(|| {
            format!(
                "{}: the patch under pressure is open and {free} vertices of its border are free; they feel the walls \
                 of the prism below the patch besides, since pressure on an open patch has no energy",
                self.name
            )
        }))
    }

    fn obstacle<const D: usize>(
        &self,
        problem: &Problem,
        k: usize,
        stiffness: &[f64],
    ) -> Result<Box<dyn Term>, DeformError> {
        let plane = self.plane::<D>(k)?;
        self.check_plane(problem, k, &plane)?;
        let size = size_of(&problem.x0, D);
        let nodes = self.touching(problem.n_free);
        let weight2 = nodes.iter().map(|v| OBSTACLE_WEIGHT * stiffness[*v as usize]).collect();
        Ok(Box::new(Obstacle::new(plane, nodes, weight2, size)))
    }

    /// Obstacle k as the solver sees it.
    fn plane<const D: usize>(&self, k: usize) -> Result<HalfSpace<D>, DeformError> {
        let given = self.input.obstacles[k];
        let length = given.normal[..D].iter().map(|n| n * n).sum::<f64>().sqrt();
        let finite = given.point.iter().chain(&given.normal).all(|v| v.is_finite());
        let out_of_plane = D == 2 && given.normal[2] != 0.0;
        if !(length > 0.0 && finite) || out_of_plane {
            return Err(DeformError(format!(
                "{}: obstacle {k} (0-based) has the point {:?} and the normal {:?}; give finite numbers and a normal with a \
                 direction, in the plane with --planar",
                self.name, given.point, given.normal
            )));
        }
        let normal: [f64; D] = std::array::from_fn(|d| given.normal[d] / length);
        let height = (0..D).map(|d| normal[d] * (given.point[d] - self.center[d])).sum();
        Ok(HalfSpace { normal, height })
    }

    /// Whether all fixed vertices are in front of all obstacles; they are read from the problem's start.
    pub fn check_held(&self, problem: &Problem) -> Result<(), DeformError> {
        for k in 0..self.input.obstacles.len() {
            match problem.dim {
                2 => self.check_plane(problem, k, &self.plane::<2>(k)?)?,
                _ => self.check_plane(problem, k, &self.plane::<3>(k)?)?,
            }
        }
        Ok(())
    }

    fn check_plane<const D: usize>(
        &self,
        problem: &Problem,
        k: usize,
        plane: &HalfSpace<D>,
    ) -> Result<(), DeformError> {
        let size = size_of(&problem.x0, D);
        for (v, _) in &self.input.fixed {
            let at = self.number[*v as usize] as usize * D;
            let distance = plane.distance(&problem.x0[at..at + D]);
            if distance < -VIOLATION * size {
                return Err(DeformError(format!(
                    "{}: vertex {v} (0-based) is held {:e} behind obstacle {k} (0-based); move the pin or the obstacle",
                    self.name, -distance
                )));
            }
        }
        Ok(())
    }

    /// Free nodes that can touch something: all but those inside of tetrahedra, in the solver's numbering.
    fn touching(&self, n_free: usize) -> Vec<u32> {
        let mut outside = Vec::new();
        for cells in self.kinds {
            match cells {
                Cells::Tets(tets) => outside.extend_from_slice(boundary_surface(tets).as_flattened()),
                other => outside.extend_from_slice(other.corners()),
            }
        }
        let mut nodes: Vec<u32> =
            outside.iter().map(|v| self.number[*v as usize]).filter(|v| (*v as usize) < n_free).collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }
}

/// The largest side of the box around flat positions.
fn size_of(x: &[f64], dim: usize) -> f64 {
    (0..dim)
        .map(|d| {
            let (low, high) = x
                .iter()
                .skip(d)
                .step_by(dim)
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
            high - low
        })
        .fold(f64::MIN_POSITIVE, f64::max)
}
