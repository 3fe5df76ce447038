//! Recipes: any constraints on any part of a mesh.
//!
//! ```toml
//! mesh = "roof.obj"                  # files are seen from the folder of the recipe
//! reference = "scan.ply"
//!
//! [select]
//! feet = { box = [[-10, -10, -1], [10, 10, 0.1]] }
//!
//! [[constraint]]
//! kind = "planar"                    # hard, as all without a weight
//!
//! [[constraint]]
//! kind = "fixed"
//! vertices = "feet"
//!
//! [[constraint]]
//! kind = "near"
//! weight = 1
//! ```

mod build;
mod check;
mod file;
mod select;

pub use build::shape;
pub use file::RecipeFile;
pub use select::{Corners, EdgeSpec, FaceSpec, Region, VertexSpec};

use super::ShapeMethod;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A shape as a list of constraints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
#[schemars(title = "Proxel recipe")]
pub struct Recipe {
    /// What it is, for the reader.
    pub title: String,
    /// The mesh: a surface of polygons.
    pub mesh: String,
    /// The surface that `near` is about; the mesh as it comes without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<String>,
    /// Weight of the squared distance of each vertex from where it was, which decides what nothing else decides.
    pub stay: f64,
    /// How it is solved.
    pub solver: RecipeSolver,
    /// Sets of vertices by name.
    pub select: BTreeMap<String, VertexSpec>,
    /// What is asked for.
    #[serde(rename = "constraint")]
    pub constraints: Vec<ConstraintSpec>,
}

impl Default for Recipe {
    fn default() -> Self {
        Recipe {
            title: String::new(),
            mesh: String::new(),
            reference: None,
            stay: 1e-3,
            solver: RecipeSolver::default(),
            select: BTreeMap::new(),
            constraints: Vec::new(),
        }
    }
}

/// How a recipe is solved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecipeSolver {
    /// The method.
    pub method: ShapeMethod,
    /// mu, the squared weight of hard constraints in the splitting.
    pub mu: f64,
    /// Columns of Anderson acceleration.
    pub anderson: usize,
}

impl Default for RecipeSolver {
    fn default() -> Self {
        RecipeSolver { method: ShapeMethod::default(), mu: 100.0, anderson: 6 }
    }
}

/// A constraint. What it is about is all of the mesh where nothing is named; keys that its kind has no use for are refused.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default, rename_all = "kebab-case")]
pub struct ConstraintSpec {
    /// What it asks for.
    pub kind: Kind,
    /// What the report calls it; its kind and its number without one.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// w of w/2 dist^2 for a soft constraint; a hard one has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weight: Option<f64>,
    /// Vertices that it is about.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vertices: Option<VertexSpec>,
    /// Faces that it is about.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faces: Option<FaceSpec>,
    /// Edges that it is about.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub edges: Option<EdgeSpec>,
    /// Vertices that mirror each other; without them those whose mirror images are nearest to each other.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pairs: Option<Vec<[u32; 2]>>,
    /// Of edges: a length, "mean" for that of the edges named, or "keep" for that of each.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length: Option<LengthSpec>,
    /// Least length, or angle in degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// Largest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
    /// A file: the surface of `near`, the curve of `curve`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
    /// Points of a curve, or where each vertex is to be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<Vec<[f64; 3]>>,
    /// Whether the last point of a curve is joined to the first one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub closed: Option<bool>,
    /// A point of a plane.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point: Option<[f64; 3]>,
    /// Its normal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal: Option<[f64; 3]>,
    /// Whether the side that the normal points to is as good as the plane.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub one_sided: Option<bool>,
}

/// What a constraint asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Each of the `faces` lies in a plane; or all `vertices` in one.
    #[default]
    Planar,
    /// The corners of each of the `faces` lie on a circle.
    Circle,
    /// Faces around each of the `vertices`, which have four, touch a common cone.
    Conical,
    /// Each of the `faces` is a parallelogram.
    Parallelogram,
    /// Each of the `faces` is a rectangle.
    Rectangle,
    /// Each of the `faces` is a regular polygon.
    Regular,
    /// Each of the `faces`, or the `vertices` as a whole, keeps its shape and size.
    Rigid,
    /// Likewise its shape.
    Similar,
    /// The `vertices` lie on a straight line.
    Line,
    /// `edges` have a `length`, or one from `min` to `max`.
    EdgeLength,
    /// Angles at the corners of `faces` are from `min` to `max` degrees.
    Angle,
    /// `vertices` lie on the reference, or the surface `to`.
    Near,
    /// `vertices`, those of the border without them, lie on a curve: the border as it comes, the edges of the file `to`, or
    /// `points` and the lines between them.
    Curve,
    /// `vertices` are at `points`, one each.
    At,
    /// `vertices` stay where they are.
    Fixed,
    /// `vertices` lie in the plane through `point` with `normal`, or beyond it (`one-sided`).
    Plane,
    /// `pairs` of vertices mirror each other in such a plane.
    Symmetric,
    /// The fairing of `planarize`: vertices are where they were among their neighbours. Soft.
    RelativeLaplacian,
    /// Vertices are in the middle of their neighbours. Soft.
    Laplacian,
}

/// The length of an edge.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum LengthSpec {
    /// In units of the mesh.
    Units(f64),
    /// "mean" or "keep".
    Named(LengthName),
}

/// A length that comes from the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LengthName {
    /// The mean of all edges named.
    Mean,
    /// That of each.
    Keep,
}

/// The JSON Schema of recipes.
pub fn recipe_schema() -> serde_json::Value {
    schemars::schema_for!(Recipe).into()
}
