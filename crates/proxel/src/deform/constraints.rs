//! What surrounds a body: linear equalities, obstacles, pressure.

use super::elements::Cells;
use super::{DeformError, DeformInput, Skin};
use crate::settings::DeformSettings;
use proxel_mesh::topology::boundary_surface;
use proxel_model::obstacle::{HalfSpace, Obstacle};
use proxel_model::points::{OfPoints, Points};
use proxel_model::pressure::Pressure;
use proxel_split::{Equalities, Equality, EqualityError, Problem, Term, VIOLATION, vector};
use std::sync::Arc;

/// Squared weights of obstacles over the stiffness that a node has from its elements.
pub(crate) const OBSTACLE_WEIGHT: f64 = 0.3;

/// The faces that pressure on some vertices acts on: of the skin, else of the boundary of tetrahedra, else triangles.
fn patch(kinds: &[Cells], input: &DeformInput, vertices: &[u32]) -> Vec<[u32; 3]> {
    if let Some(skin) = &input.skin {
        return skin.patch(vertices);
    }
    let n = input.rest.n_verts();
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
    input.pressures.iter().any(|(vertices, _)| !Pressure::border(&patch(kinds, input, vertices)).is_empty())
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
                "{} cannot hold equalities; use --method auto, wrapd, r-admm, w-admm or admm-pd",
                settings.method.as_str()
            )));
        }
        // Two dense triangles over the rows, and a column over the nodes for each.
        let rows = self.input.equalities.len();
        let bytes = 8.0 * rows as f64 * (2 * rows + problem.n_free) as f64;
        if bytes > settings.newton.memory {
            return Err(DeformError(format!(
                "{}: {rows} equalities over {} free vertices would take {:.1} GB; give fewer",
                self.name,
                problem.n_free,
                bytes / 1e9
            )));
        }
        problem.quadratic.equalities = self.equalities(problem)?;
        for (vertices, pressure) in &self.input.pressures {
            warnings.extend(self.add_pressure(problem, vertices, *pressure)?);
        }
        let stiffness = if self.input.obstacles.is_empty() { Vec::new() } else { problem.node_stiffness() };
        for k in 0..self.input.obstacles.len() {
            let term = match problem.dim {
                2 => self.obstacle::<2>(problem, k, &stiffness, settings.method.is_reweighted())?,
                _ => self.obstacle::<3>(problem, k, &stiffness, settings.method.is_reweighted())?,
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
            let lattice = if self.input.skin.is_some() { " in the lattice; raise --resolution or" } else { ";" };
            let (row, what) = match e {
                EqualityError::Redundant { row } => {
                    (row, format!("follows from those before it and from pins{lattice} remove it"))
                }
                EqualityError::Contradictory { row } => {
                    (row, format!("contradicts those before it or pins{lattice} correct or remove it"))
                }
                EqualityError::Row { row } => {
                    (row, "names no vertex of the mesh or has a number that is not finite; correct it".to_string())
                }
            };
            DeformError(format!("{}: equality {row} (0-based) {what}", self.name))
        })
    }

    fn add_pressure(&self, problem: &mut Problem, vertices: &[u32], p: f64) -> Result<Option<String>, DeformError> {
        if problem.dim == 2 {
            return Err(DeformError(format!("{}: pressure acts on faces; it does not go with --planar", self.name)));
        }
        if !p.is_finite() {
            return Err(DeformError(format!("{}: a pressure is {p}; give a finite number", self.name)));
        }
        let faces = patch(self.kinds, self.input, vertices);
        if faces.is_empty() {
            return Err(DeformError(format!(
                "{}: the pressure {p} acts on 0 faces; choose vertices so that all corners of some face are among them",
                self.name
            )));
        }
        let border = Pressure::border(&faces);
        let free = border.iter().filter(|[a, _]| self.is_free(*a, problem.n_free)).count();
        problem.quadratic.potentials.push(match &self.input.skin {
            Some(skin) => {
                let mut places = faces.as_flattened().to_vec();
                places.sort_unstable();
                places.dedup();
                let points = self.points(skin, &places);
                let at: Vec<f64> = (0..points.len()).flat_map(|k| points.at::<3>(k, &problem.x0)).collect();
                let number = |v: u32| places.binary_search(&v).unwrap_or_default() as u32;
                let faces = faces.iter().map(|f| f.map(number)).collect();
                Arc::new(OfPoints { potential: Pressure::new(faces, p, &at), points })
            }
            None => {
                let faces = faces.iter().map(|f| f.map(|v| self.number[v as usize])).collect();
                Arc::new(Pressure::new(faces, p, &problem.x0))
            }
        });
        Ok((free > 0).then(|| {
            format!(
                "{}: the patch under pressure is open and {free} vertices of its border are free; they feel the walls \
                 of the prism below the patch besides, since pressure on an open patch has no energy",
                self.name
            )
        }))
    }

    /// Vertices of the skin in the solver's numbering.
    fn points(&self, skin: &Skin, vertices: &[u32]) -> Points {
        let mut points = Points::default();
        for (nodes, weights) in vertices.iter().filter_map(|v| skin.at(*v)) {
            points.push(&nodes.map(|n| self.number[n as usize]), &weights);
        }
        points
    }

    /// Whether a vertex, of the skin where there is one, can move.
    fn is_free(&self, v: u32, n_free: usize) -> bool {
        let free = |v: u32| (self.number[v as usize] as usize) < n_free;
        match &self.input.skin {
            Some(skin) => skin.at(v).is_some_and(|(nodes, w)| (0..4).any(|i| w[i] != 0.0 && free(nodes[i]))),
            None => free(v),
        }
    }

    fn obstacle<const D: usize>(
        &self,
        problem: &Problem,
        k: usize,
        stiffness: &[f64],
        follows: bool,
    ) -> Result<Box<dyn Term>, DeformError> {
        let plane = self.plane::<D>(k)?;
        self.check_plane(problem, k, &plane)?;
        let size = vector::extent(&problem.x0, D);
        let free = match &self.input.skin {
            Some(skin) => {
                let free: Vec<u32> = skin.places().into_iter().filter(|v| self.is_free(*v, problem.n_free)).collect();
                self.points(skin, &free)
            }
            None => Points::of_nodes(self.touching(problem.n_free)),
        };
        let weight2 = shared(&free, stiffness).map(|k| OBSTACLE_WEIGHT * k).collect();
        let obstacle = Obstacle::new(plane, free, weight2, size);
        Ok(Box::new(if follows { obstacle.following(&problem.x0) } else { obstacle }))
    }

    /// Obstacle k as the solver sees it.
    fn plane<const D: usize>(&self, k: usize) -> Result<HalfSpace<D>, DeformError> {
        let written = self.input.obstacles[k];
        // In units of its largest component the length neither overflows nor vanishes.
        let largest = written.normal[..D].iter().fold(0.0, |m: f64, n| m.max(n.abs()));
        let given = crate::pins::HalfSpace { point: written.point, normal: written.normal.map(|n| n / largest) };
        let length = given.normal[..D].iter().map(|n| n * n).sum::<f64>().sqrt();
        let finite = given.point.iter().chain(&given.normal).all(|v| v.is_finite());
        let out_of_plane = D == 2 && given.normal[2] != 0.0;
        if !(length > 0.0 && finite) || out_of_plane {
            return Err(DeformError(format!(
                "{}: obstacle {k} (0-based) has the point {:?} and the normal {:?}; give finite numbers and a normal with a \
                 direction, in the plane with --planar",
                self.name, written.point, written.normal
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
        let size = vector::extent(&problem.x0, D);
        let held: Vec<u32> = match &self.input.skin {
            Some(skin) => skin.places().into_iter().filter(|v| !self.is_free(*v, problem.n_free)).collect(),
            None => self.input.fixed.iter().map(|f| f.0).collect(),
        };
        for v in held {
            let at = match &self.input.skin {
                Some(skin) => self.points(skin, &[v]).at::<D>(0, &problem.x0),
                None => Points::of_nodes(vec![self.number[v as usize]]).at::<D>(0, &problem.x0),
            };
            let distance = plane.distance(&at);
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

/// The stiffness that each point has from its free nodes, in equal parts with the other points that these carry.
pub(crate) fn shared(points: &Points, stiffness: &[f64]) -> impl Iterator<Item = f64> {
    let mut crowd = vec![0.0; stiffness.len()]; // the sum of weights at each free node
    (0..points.len()).for_each(|k| points.spread(k, [1.0], &mut crowd));
    (0..points.len()).map(move |k| {
        let (nodes, weights) = points.parts(k);
        let (mut sum, mut free) = (0.0, 0.0);
        for (n, w) in nodes.iter().zip(weights) {
            if let (Some(s), Some(c)) = (stiffness.get(*n as usize), crowd.get(*n as usize)) {
                sum += w * s / c.max(1.0);
                free += w;
            }
        }
        sum / free
    })
}
