//! Geometric constraints: sets that parts of a mesh are to be in, or near to.
//!
//! ```text
//! min over x   1/2 |L (x - x~)|^2 + sum_soft w_i/2 dist(D_i x, C_i)^2   subject to   D_j x in C_j, j hard      A(29)
//! ```
//!
//! A [`Set`] knows its nearest points; a [`Reduction`] takes the corners of an element to the rows that the set is of:
//! to their mean ([`MeanCentred`]), to the first of them ([`TipDifferences`]), the difference of two
//! ([`EdgeDifference`]), or the vertex itself ([`Vertex`]). [`Cells`] are like elements with one set each, [`Batch`] is
//! the [`proxel_split::Term`] over them: hard, a split variable with a dual, or soft, z = the nearest point, which has
//! none; [`Whole`] is that of sets which are asked for all elements at once. [`fairing`] makes the quadratic that holds
//! x near the shape of before, [`Rows`] are the hard sets to first order.
//!
//! | set | reduction | violation |
//! |---|---|---|
//! | [`Planar`] | [`MeanCentred`] | largest distance of a corner from the best plane |
//! | [`Line`] | [`MeanCentred`] | largest distance of a corner from the best line |
//! | [`Circle`] | [`MeanCentred`] | largest distance of a corner from the best circle |
//! | [`Parallelogram`], [`Rectangle`], [`RegularPolygon`] | [`MeanCentred`] | farthest way of a corner |
//! | [`Rigid`], [`Similar`] to given shapes | [`MeanCentred`] | farthest way of a corner |
//! | [`Conical`] | [`Spokes`] to four neighbours | radians by which opposite angles sum differently |
//! | [`Length`] | [`EdgeDifference`] | what is missing or too much, over the length wanted |
//! | [`AngleRange`] | [`TipDifferences`] | radians outside |
//! | [`Near`] a [`Surface`], a [`Curve`] or a point of its own | [`Vertex`] | distance |
//! | [`Plane`], or one side of it | [`Vertex`] | distance |
//! | [`Symmetric`] in a plane | [`Vertices`], two | by how much each is off |
//!
//! A vertex is fixed by [`Near::At`], hard; the border of a mesh slides along a [`Curve`] by [`Near::Shared`]. Every set is
//! tested by the same laws: no other point of it is nearer, motions and scales change nothing, rows are derivatives that lead
//! to the nearest point up to squares, and ADMM ends in it.

mod angle;
mod batch;
mod boxes;
mod cells;
mod circle;
mod complement;
mod conical;
mod curve;
pub mod fairing;
mod gather;
#[cfg(test)]
mod laws;
mod length;
mod line;
mod near;
mod planar;
mod plane;
mod quads;
mod reduction;
mod regular;
mod rows;
mod surface;
mod template;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_soft;
mod whole;

pub use angle::AngleRange;
pub use batch::{Batch, Hold};
pub use boxes::Hint;
pub use cells::{Cells, CellsError};
pub use circle::{BestCircle, Circle};
pub use conical::Conical;
pub use curve::Curve;
pub use length::Length;
pub use line::Line;
pub use near::{Closest, Near, Points};
pub use planar::{BestPlane, Planar};
pub use plane::{Plane, PlaneError, Symmetric};
pub use quads::{Parallelogram, Rectangle};
pub use reduction::{EdgeDifference, MeanCentred, Reduction, Spokes, TipDifferences, Vertex, Vertices};
pub use regular::{RegularPolygon, TooFewCorners};
pub use rows::{Relation, Row, RowKey, Rows, RowsOf};
pub use surface::{ShapeIndexError, Surface};
pub use template::{Rigid, Similar, Template, TemplateError};
pub use whole::{Projection, Whole};

/// A point, or a row of a local vector.
pub type V3 = [f64; 3];

/// A set of local vectors for each of a batch of like elements.
pub trait Set: Send + Sync {
    /// v, the rows of element `e`, becomes the nearest point of its set. Where there are several, always the same one.
    fn project(&self, e: usize, v: &mut [V3]);

    /// The same, from where it has ended before: a hint for each element, which changes no result. For sets that search.
    fn project_from(&self, e: usize, v: &mut [V3], hint: &mut Hint) {
        let _ = hint;
        self.project(e, v);
    }

    /// Whether hints save anything.
    fn takes_hints(&self) -> bool {
        false
    }

    /// How far v is outside of the set of element `e`, in the units of the set; 0 within.
    fn violation(&self, e: usize, v: &[V3]) -> f64;

    /// The set of element `e` to first order around v: what has to vanish, or not to be above 0, and its gradient by
    /// rows. Inequalities that hold by more than `near` may be left out.
    fn linearize(&self, e: usize, v: &[V3], near: f64, row: &mut dyn FnMut(Row<'_>));
}

pub(crate) fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn norm(a: V3) -> f64 {
    dot(a, a).sqrt()
}

pub(crate) fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// a + s b
pub(crate) fn add(a: V3, s: f64, b: V3) -> V3 {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

pub(crate) fn scale(s: f64, a: V3) -> V3 {
    a.map(|c| s * c)
}

/// The largest of distances; one that is not a number stays.
pub(crate) fn largest(of: impl Iterator<Item = f64>) -> f64 {
    of.fold(0.0, |m, off| if off <= m { m } else { off })
}

/// A unit vector that is normal to a: across the axis that a is least along.
pub(crate) fn across(a: V3) -> V3 {
    let least = (0..3).min_by(|i, j| a[*i].abs().total_cmp(&a[*j].abs())).unwrap_or(0);
    let axis = [0, 1, 2].map(|d| f64::from(u8::from(d == least)));
    let n = cross(a, axis);
    let length = norm(n);
    if length > 0.0 { scale(1.0 / length, n) } else { [1.0, 0.0, 0.0] }
}
