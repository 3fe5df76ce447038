//! What is measured of shapes, in users' terms.

use super::problem::Shape;
use super::solve::Solved;
use proxel_mesh::Polygons;
use proxel_mesh::topology::face_edges;
use proxel_model::constraint::{BestPlane, V3};
use serde::{Deserialize, Serialize};

/// A figure of the mesh as it came, and as it goes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// Of the input.
    pub before: f64,
    /// Of the result as it is written.
    pub after: f64,
}

/// What shaping adds to a report. Lengths are over the mean edge of the input, unless called absolute.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ShapeReport {
    /// The mean length of the edges of the input.
    pub mean_edge: f64,
    /// The largest distance of a corner of a face from the best plane of its corners.
    pub planarity_max: Option<Change>,
    /// The mean over faces of the largest distance in each.
    pub planarity_mean: Option<Change>,
    /// The largest in units of the mesh.
    pub planarity_max_absolute: Option<Change>,
    /// The mean in units of the mesh.
    pub planarity_mean_absolute: Option<Change>,
    /// The largest distance between the diagonals of four corners that follow each other, over the mean length of the
    /// two.
    pub planarity_diagonals_max: Option<Change>,
    /// | |e| - l | / l, A(30): largest.
    pub edge_error_max: Option<Change>,
    /// Mean of the same.
    pub edge_error_mean: Option<Change>,
    /// Degrees outside the range: largest.
    pub angle_error_max: Option<Change>,
    /// Mean of the same.
    pub angle_error_mean: Option<Change>,
    /// Distance of a vertex from the reference: largest.
    pub reference_distance_max: Option<Change>,
    /// Mean of the same.
    pub reference_distance_mean: Option<Change>,
    /// The shortest edge.
    pub shortest_edge: Option<Change>,
    /// The constraints of a recipe, in their order.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub constraints: Vec<ConstraintReport>,
    /// Elements whose hard constraint is violated by more than 1e-9; the worst come first, ten at most.
    pub violated: Vec<Violated>,
}

/// A constraint of a recipe, before and after. Violations are distances over the mean edge, of lengths over the length
/// wanted, of angles in degrees.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ConstraintReport {
    /// What the recipe calls it, or its kind and number.
    pub name: String,
    /// Its kind.
    pub kind: String,
    /// Whether it is hard.
    pub hard: bool,
    /// Of how many vertices, edges, faces it is.
    pub elements: usize,
    /// The largest violation.
    pub violation_max: Change,
    /// The mean.
    pub violation_mean: Change,
}

/// An element that is not as it is to be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Violated {
    /// "face", "edge", "angle".
    pub kind: String,
    /// Its number, 0-based: of the face in the file, of the edge among (smaller, larger) vertex pairs in their order.
    pub index: usize,
    /// The vertices that it is of; of an angle the tip first.
    pub vertices: Vec<u32>,
    /// By how much: distances over the mean edge, edges over the length wanted, angles in degrees.
    pub violation: f64,
}

fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn norm(a: V3) -> f64 {
    dot(a, a).sqrt()
}

/// Mean and shortest length of the edges of faces.
pub fn edge_lengths(points: &[V3], faces: &Polygons) -> (f64, f64) {
    let edges = face_edges(faces);
    let lengths = edges.iter().map(|[a, b]| norm(sub(points[*b as usize], points[*a as usize])));
    let (sum, shortest) = lengths.fold((0.0, f64::INFINITY), |(sum, least): (f64, f64), l| (sum + l, least.min(l)));
    (sum / edges.len().max(1) as f64, shortest)
}

/// The largest distance of a corner of each face from the best plane of its corners.
pub fn planarity(points: &[V3], faces: &Polygons) -> Vec<f64> {
    let of = |face: &[u32]| {
        if face.len() < 4 {
            return 0.0;
        }
        let first = points[face[0] as usize];
        let mut v: Vec<V3> = face.iter().map(|c| sub(points[*c as usize], first)).collect();
        let mean = v.iter().fold([0.0; 3], |s, v| [s[0] + v[0], s[1] + v[1], s[2] + v[2]]).map(|s| s / v.len() as f64);
        v.iter_mut().for_each(|v| *v = sub(*v, mean));
        let n = BestPlane::of(&v).normal;
        v.iter().map(|v| dot(n, *v).abs()).fold(0.0, f64::max)
    };
    faces.iter().map(of).collect()
}

/// The largest distance between the diagonals (lines) of four corners that follow each other, over the mean of their
/// lengths, of each face; 0 where they are parallel.
pub fn diagonals(points: &[V3], faces: &Polygons) -> Vec<f64> {
    let of_four = |c: [u32; 4]| {
        let [a, b, c, d] = c.map(|v| points[v as usize]);
        let (e, f) = (sub(c, a), sub(d, b));
        let n = cross(e, f);
        let size = 0.5 * (norm(e) + norm(f)) * norm(n);
        if size > 0.0 { dot(n, sub(b, a)).abs() / size } else { 0.0 }
    };
    let of = |face: &[u32]| {
        let k = face.len();
        // Of four corners all starts are alike.
        let starts = if k < 4 { 0..0 } else { 0..if k == 4 { 1 } else { k } };
        starts.map(|s| of_four([0, 1, 2, 3].map(|i| face[(s + i) % k]))).fold(0.0, f64::max)
    };
    faces.iter().map(of).collect()
}

/// Largest and mean.
pub fn spread(values: &[f64]) -> [f64; 2] {
    [values.iter().copied().fold(0.0, f64::max), values.iter().sum::<f64>() / values.len().max(1) as f64]
}

/// Largest and mean, before and after.
pub(super) fn changes(before: &[f64], after: &[f64]) -> [Change; 2] {
    let (before, after) = (spread(before), spread(after));
    [0, 1].map(|k| Change { before: before[k], after: after[k] })
}

/// The worst ten.
pub(super) fn worst(violated: impl Iterator<Item = Violated>) -> Vec<Violated> {
    let mut bad: Vec<Violated> = violated.collect();
    bad.sort_by(|a, b| {
        let order = b.violation.total_cmp(&a.violation).then_with(|| a.kind.cmp(&b.kind));
        order.then_with(|| a.index.cmp(&b.index))
    });
    bad.truncate(10);
    bad
}

/// What is told of every shape.
pub(super) fn common(shape: &Shape, solved: &Solved) -> ShapeReport {
    let distances =
        |points: &[V3]| shape.distances(points).into_iter().map(|d| d / shape.mean_edge).collect::<Vec<_>>();
    let [max, mean] = changes(&distances(&shape.start), &distances(&solved.after));
    let shortest = |points: &[V3]| edge_lengths(points, &shape.faces).1 / shape.mean_edge;
    ShapeReport {
        mean_edge: shape.mean_edge_of_user(),
        reference_distance_max: Some(max),
        reference_distance_mean: Some(mean),
        shortest_edge: Some(Change { before: shortest(&shape.start), after: shortest(&solved.after) }),
        violated: solved.violated.clone(),
        ..ShapeReport::default()
    }
}
