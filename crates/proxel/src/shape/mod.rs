//! Shapes under geometric constraints: A(29) for meshes.
//!
//! [`planarize`] moves the vertices of a mesh of polygons so that each face lies in a plane, near to a reference
//! surface. Vertices and faces keep number and order. The mesh is centred and scaled by a power of two inside.

mod finish;
mod measure;
mod problem;
mod reference;
mod run;
mod settings;

pub use measure::{Change, ShapeReport, Violated, diagonals, edge_lengths, planarity};
pub use settings::{ShapeMethod, ShapeSettings};

use crate::deform::Hooks;
use crate::report::{Report, Seconds};
use problem::Shape;
use proxel_mesh::Mesh;
use proxel_model::constraint::CellsError;
use proxel_split::{Status, SystemError};
use std::time::Instant;

/// Hard sets that are violated by no more hold: distances over the mean edge.
pub(crate) const EXACT: f64 = 1e-10;
/// What a report calls violated.
const TOLD: f64 = 1e-9;

/// What is to be shaped.
#[derive(Clone, Debug, Default)]
pub struct ShapeInput {
    /// The mesh: polygons of any size.
    pub mesh: Mesh,
    /// The surface that its vertices are to be near; the mesh as it comes, its faces as fans of triangles, without one.
    pub reference: Option<Mesh>,
}

/// Why a mesh cannot be shaped: a sentence that names the item and the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShapeError(pub String);

impl std::fmt::Display for ShapeError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ShapeError {}

impl From<proxel_mesh::MeshError> for ShapeError {
    fn from(e: proxel_mesh::MeshError) -> Self {
        ShapeError(e.to_string())
    }
}

impl From<CellsError> for ShapeError {
    fn from(e: CellsError) -> Self {
        ShapeError(e.to_string())
    }
}

impl From<SystemError> for ShapeError {
    fn from(e: SystemError) -> Self {
        ShapeError(e.to_string())
    }
}

/// A mesh in shape.
#[derive(Clone, Debug)]
pub struct Shaped {
    /// Positions, in the order of the input.
    pub positions: Vec<[f64; 3]>,
    /// How it ended.
    pub status: Status,
    /// All figures; `seconds.read`, `seconds.write` and `peak_bytes` are the caller's to fill.
    pub report: Report,
    /// By how much each face is violated: over the mean edge.
    pub violation: Vec<f64>,
    /// The distance of each vertex from the reference, in units of the mesh; 0 where it is in no face.
    pub distance: Vec<f64>,
}

/// Moves vertices until every face is planar: least closeness to the reference and fairing under hard planarity, A(29).
/// What is returned holds for the positions as returned.
///
/// # Errors
/// Input that describes no problem. A run that does not converge is no error: see [`Shaped::status`].
pub fn planarize(input: &ShapeInput, settings: &ShapeSettings, hooks: &mut Hooks<'_>) -> Result<Shaped, ShapeError> {
    let began = Instant::now();
    settings.check().map_err(ShapeError)?;
    let threads = settings.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, |n| n.get()));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| ShapeError(format!("{threads} threads cannot be started: {e}")))?;
    pool.install(|| {
        let shape = Shape::new(input)?;
        let posed = shape.planarize(settings)?;
        let run = run::run(&shape, posed, settings, hooks, began)?;
        let positions = shape.positions(&run.x, &input.mesh);
        let after = shape.own(&positions);
        let faces = &shape.faces;
        let flat =
            |points: &[[f64; 3]]| planarity(points, faces).into_iter().map(|h| h / shape.mean_edge).collect::<Vec<_>>();
        let (violation, flat_before) = (flat(&after), flat(&shape.start));
        let unit = shape.mean_edge_of_user();
        let [max, mean] = changes(&flat_before, &violation);
        let [diagonals_max, _] = changes(&diagonals(&shape.start, faces), &diagonals(&after, faces));
        let distances =
            |points: &[[f64; 3]]| shape.distances(points).into_iter().map(|d| d / shape.mean_edge).collect::<Vec<_>>();
        let off = distances(&after);
        let [reference_max, reference_mean] = changes(&distances(&shape.start), &off);
        let absolute = |c: Change| Change { before: c.before * unit, after: c.after * unit };
        let shortest = |points: &[[f64; 3]]| edge_lengths(points, faces).1 / shape.mean_edge;
        let told = ShapeReport {
            mean_edge: unit,
            planarity_max: Some(max),
            planarity_mean: Some(mean),
            planarity_max_absolute: Some(absolute(max)),
            planarity_mean_absolute: Some(absolute(mean)),
            planarity_diagonals_max: Some(diagonals_max),
            reference_distance_max: Some(reference_max),
            reference_distance_mean: Some(reference_mean),
            shortest_edge: Some(Change { before: shortest(&shape.start), after: shortest(&after) }),
            violated: measure::worst("face", &violation, TOLD),
            ..ShapeReport::default()
        };
        let mut each = off.into_iter().map(|d| d * unit);
        let distance = shape.used.iter().map(|used| if *used { each.next().unwrap_or(0.0) } else { 0.0 }).collect();
        let report = Report {
            version: env!("CARGO_PKG_VERSION").to_string(),
            command: "planarize".to_string(),
            settings: serde_json::to_value(settings).unwrap_or_default(),
            method: settings.method.as_str().to_string(),
            status: run.status.as_str().to_string(),
            reason: run.reason,
            iterations: run.iterations,
            inner_iterations: run.inner,
            refactorisations: run.refactorisations,
            energy: Some(run.energy).filter(|e| e.is_finite()),
            primal_residual: Some(run.residuals.primal).filter(|r| r.is_finite()),
            dual_residual: Some(run.residuals.dual).filter(|r| r.is_finite()),
            accepted: run.accepted,
            rejected: run.rejected,
            warnings: shape.warnings.clone(),
            seconds: Seconds { read: 0.0, setup: run.setup, solve: run.solve, write: 0.0 },
            factor_bytes: Some(run.factor_bytes),
            threads,
            shape: Some(told),
            ..Report::default()
        };
        Ok(Shaped { positions, status: run.status, report, violation, distance })
    })
}

/// Largest and mean, before and after.
fn changes(before: &[f64], after: &[f64]) -> [Change; 2] {
    let (before, after) = (measure::spread(before), measure::spread(after));
    [0, 1].map(|k| Change { before: before[k], after: after[k] })
}
