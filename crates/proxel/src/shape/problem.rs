//! From a mesh to a problem.

use super::finish::Constraints;
use super::measure::edge_lengths;
use super::reference::surface;
use super::ways::Way;
use super::{ShapeError, ShapeInput, ShapeSettings};
use proxel_mesh::{Mesh, Polygons};
use proxel_model::constraint::fairing::{Fairing, laplacian};
use proxel_model::constraint::{Batch, Cells, Closest, Hold, Near, Reduction, RowsOf, Set, V3, Vertex};
use proxel_split::{Problem, Quadratic, Term};
use std::sync::Arc;

/// A mesh in coordinates of its own: centred, and scaled by a power of two that makes its mean edge about 1, so that no
/// digit of a coordinate depends on units.
pub(super) struct Shape {
    pub faces: Polygons,
    pub surface: Arc<dyn Closest>,
    pub start: Vec<V3>,  // vertices likewise
    pub used: Vec<bool>, // whether a vertex is in a face
    pub mean_edge: f64,  // in own coordinates
    pub shortest: f64,   // edge of the start
    pub warnings: Vec<String>,
    center: V3,
    scale: f64,
}

/// Its problem: terms for the splitting, and hard sets by themselves.
pub(super) struct Posed {
    pub problem: Problem,
    pub constraints: Constraints, // the hard ones
    pub groups: Vec<Group>,       // all that a report tells of
    pub way: Way,                 // what the method makes of hard and soft
}

/// In what violations are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    /// Lengths, told over the mean edge.
    Length,
    /// Parts of what was wanted, or other numbers without a unit.
    Plain,
    /// Radians, told in degrees.
    Angle,
}

/// Elements under a set, as a report tells of them.
#[derive(Clone)]
pub(super) struct Group {
    pub kind: String, // "face", "edge", ..
    pub unit: Unit,
    pub hard: bool,
    pub cells: Arc<dyn RowsOf>,
    pub ids: Option<Vec<u32>>, // numbers of the elements, where they are others than 0, 1, ..
}

/// How much a constraint matters, and what it is called.
pub(super) struct Demand {
    pub hold: Hold,
    pub kind: String,
    pub unit: Unit,
    pub ids: Option<Vec<u32>>,
}

impl Demand {
    /// A hard one on elements that are numbered as they come.
    pub fn hard(mu: f64, kind: &str, unit: Unit) -> Self {
        Demand { hold: Hold::Hard(mu), kind: kind.to_string(), unit, ids: None }
    }

    /// With numbers for its elements.
    pub fn numbered(self, ids: Vec<u32>) -> Self {
        Demand { ids: Some(ids), ..self }
    }
}

fn check_faces(mesh: &Mesh) -> Result<(), ShapeError> {
    mesh.check_indices()?;
    if !mesh.tets.is_empty() || mesh.faces.is_empty() {
        let what = if mesh.tets.is_empty() { "has no faces" } else { "has tetrahedra" };
        return Err(ShapeError(format!("{}: it {what}; give a surface of polygons", mesh.name)));
    }
    if let Some((i, f)) = mesh.faces.iter().enumerate().find(|(_, f)| f.len() < 3) {
        let text = format!("{}: face {i} (0-based) has {} corners; remove it", mesh.name, f.len());
        return Err(ShapeError(text));
    }
    Ok(())
}

impl Shape {
    /// Checks the input and puts it into its own coordinates.
    pub fn new(input: &ShapeInput) -> Result<Self, ShapeError> {
        let mesh = &input.mesh;
        check_faces(mesh)?;
        mesh.check_repeated()?;
        let mut used = vec![false; mesh.n_verts()];
        mesh.faces.indices().iter().for_each(|v| used[*v as usize] = true);
        let (mean, _) = edge_lengths(&mesh.points, &mesh.faces);
        if !(mean > 0.0 && mean.is_finite()) {
            return Err(ShapeError(format!(
                "{}: its edges have the mean length {mean}; give a surface with an extent",
                mesh.name
            )));
        }
        let (low, high) = mesh.bounding_box().unwrap_or_default();
        let center = [0, 1, 2].map(|d| 0.5 * low[d] + 0.5 * high[d]);
        let scale = mean.log2().round().exp2();
        let own = |p: &V3| [0, 1, 2].map(|d| (p[d] - center[d]) / scale);
        let start: Vec<V3> = mesh.points.iter().map(own).collect();
        let reference = input.reference.as_ref().unwrap_or(mesh);
        check_faces(reference)?;
        let corners: Vec<V3> = reference.points.iter().map(own).collect();
        let (surface, dropped) = surface(&corners, &reference.faces.fan_triangles())
            .map_err(|e| ShapeError(format!("{}: {e}; give a reference surface with an extent", reference.name)))?;
        let mut warnings = Vec::new();
        if dropped > 0 {
            warnings.push(format!(
                "{}: {dropped} triangles of it have no area, and are no part of the reference",
                reference.name
            ));
        }
        let points = mesh.faces.iter().filter(|f| f.iter().all(|v| start[*v as usize] == start[f[0] as usize])).count();
        if points > 0 {
            warnings.push(format!("{}: {points} faces are collapsed to a point; they count as planar", mesh.name));
        }
        let loose = used.iter().filter(|used| !**used).count();
        if loose > 0 {
            warnings.push(format!("{}: {loose} vertices are in no face, and stay where they are", mesh.name));
        }
        let (mean_edge, shortest) = edge_lengths(&start, &mesh.faces);
        let faces = mesh.faces.clone();
        let surface = Arc::new(surface);
        Ok(Shape { faces, surface, start, used, mean_edge, shortest, warnings, center, scale })
    }

    /// Another surface in the same coordinates.
    ///
    /// # Errors
    /// Faces that are none, and a surface without an area.
    pub fn surface_of(&self, mesh: &Mesh) -> Result<Arc<dyn Closest>, ShapeError> {
        check_faces(mesh)?;
        let found = surface(&self.own(&mesh.points), &mesh.faces.fan_triangles());
        let (surface, _) =
            found.map_err(|e| ShapeError(format!("{}: {e}; give a surface with an extent", mesh.name)))?;
        Ok(Arc::new(surface))
    }

    /// From own coordinates to those of the user; vertices of no face as they came.
    pub fn positions(&self, x: &[f64], input: &Mesh) -> Vec<V3> {
        let of = |((x, used), point): ((&V3, &bool), &V3)| match used {
            true => [0, 1, 2].map(|d| x[d] * self.scale + self.center[d]),
            false => *point,
        };
        x.as_chunks::<3>().0.iter().zip(&self.used).zip(&input.points).map(of).collect()
    }

    /// The way back.
    pub fn own(&self, points: &[V3]) -> Vec<V3> {
        points.iter().map(|p| [0, 1, 2].map(|d| (p[d] - self.center[d]) / self.scale)).collect()
    }

    /// The mean edge in units of the mesh.
    pub fn mean_edge_of_user(&self) -> f64 {
        self.mean_edge * self.scale
    }

    /// A length of the user in own coordinates.
    pub fn own_length(&self, length: f64) -> f64 {
        length / self.scale
    }

    /// Distances of the vertices of faces from the reference.
    pub fn distances(&self, points: &[V3]) -> Vec<f64> {
        let off = |p: &V3| {
            let q = self.surface.closest(*p);
            (0..3).map(|d| (p[d] - q[d]).powi(2)).sum::<f64>().sqrt()
        };
        points.iter().zip(&self.used).filter(|(_, used)| **used).map(|(p, _)| off(p)).collect()
    }

    /// Adds a fairing of the faces, relative to the start.
    pub fn fair(&self, fairing: Fairing, quadratic: &mut Quadratic) {
        let stencils = laplacian(self.start.len(), self.faces.iter());
        fairing.add_to(&stencils, self.start.as_flattened(), quadratic);
    }

    /// Soft: closeness to the reference, and fairing; hard: nothing yet.
    pub fn posed(&self, settings: &ShapeSettings) -> Result<Posed, ShapeError> {
        let (n, way) = (self.start.len(), Way::of(settings));
        let nodes: Vec<u32> = (0..n as u32).filter(|v| self.used[*v as usize]).collect();
        let near = Cells::<Vertex, _>::new(nodes, 1, Near::Shared(self.surface.clone()))?;
        let near: Box<dyn Term> = Box::new(Batch::new(Arc::new(near), way.hold(Hold::Soft(settings.closeness))));
        let mut quadratic = Quadratic::default();
        self.fair(Fairing { smooth: 0.0, relative: settings.fairing }, &mut quadratic);
        let loose = (0..n as u32).filter(|v| !self.used[*v as usize]);
        quadratic.springs = loose.map(|v| (v, settings.closeness, self.start[v as usize])).collect();
        Ok(Posed { way, ..Posed::new(self.start.as_flattened().to_vec(), vec![near], quadratic) })
    }
}

impl Posed {
    /// A problem without hard constraints.
    pub fn new(x0: Vec<f64>, terms: Vec<Box<dyn Term>>, quadratic: Quadratic) -> Self {
        let n_free = x0.len() / 3;
        let problem = Problem { dim: 3, n_free, x0, terms, quadratic, barrier: false };
        Posed { problem, constraints: Vec::new(), groups: Vec::new(), way: Way::default() }
    }

    /// Adds elements under a set.
    pub fn constrain<R: Reduction, S: Set + 'static>(&mut self, cells: Cells<R, S>, demand: Demand) {
        if cells.is_empty() {
            return;
        }
        let cells = Arc::new(cells);
        let hard = matches!(demand.hold, Hold::Hard(_));
        self.problem.terms.push(Box::new(Batch::new(cells.clone(), self.way.hold(demand.hold))));
        if hard {
            self.constraints.push(cells.clone());
        }
        self.groups.push(Group { kind: demand.kind, unit: demand.unit, hard, cells, ids: demand.ids });
    }
}
