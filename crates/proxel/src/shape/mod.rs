//! Shapes under geometric constraints: A(29) for meshes.
//!
//! [`planarize`] moves the vertices of a mesh of polygons so that each face lies in a plane, near to a reference
//! surface; [`wire`] so that all edges have one length, and angles stay within a range; [`shape`] so that the constraints
//! of a [`Recipe`] hold. Vertices and faces keep number and order. The mesh is centred and scaled by a power of two inside.

mod finish;
mod measure;
mod picture;
mod planar;
mod problem;
mod recipe;
mod reference;
mod run;
mod settings;
mod solve;
mod subdivide;
mod ways;
mod wire;

pub use measure::{Change, ConstraintReport, ShapeReport, Violated, diagonals, edge_lengths, planarity};
pub use picture::draw_shaped;
pub use planar::planarize;
pub use recipe::{
    ConstraintSpec, Corners, EdgeSpec, FaceSpec, Kind, LengthName, LengthSpec, Recipe, RecipeFile, RecipeSolver,
    Region, VertexSpec, recipe_schema, shape,
};
pub(crate) use reference::surface;
pub use settings::{ShapeMethod, ShapeSettings};
pub use subdivide::subdivide;
pub use wire::{WireSettings, wire};

use crate::report::Report;
use proxel_mesh::Mesh;
use proxel_model::constraint::CellsError;
use proxel_split::{Status, SystemError};

/// Hard sets that are violated by no more hold: distances over the mean edge.
pub(crate) const EXACT: f64 = 1e-10;

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

/// An error of each face: `planarity` over the mean edge; of its worst edge, `edge_error`, over the length wanted; of its
/// worst angle, `angle_error`, in degrees.
#[derive(Clone, Debug, PartialEq)]
pub struct FaceErrors {
    /// Its name.
    pub name: String,
    /// Of the input.
    pub before: Vec<f64>,
    /// Of the positions as returned.
    pub after: Vec<f64>,
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
    /// What is measured of each face.
    pub faces: Vec<FaceErrors>,
    /// The distance of each vertex from the reference, in units of the mesh; 0 where it is in no face.
    pub distance: Vec<f64>,
}
