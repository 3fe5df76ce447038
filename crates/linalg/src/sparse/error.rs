//! What can be wrong with a sparse matrix, its order or its factor.

use std::fmt;

/// Why a pattern, an order, a factorisation or a solve was refused. Indices are those of the caller.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SparseError {
    /// A slice has the wrong length.
    Length {
        /// Which slice.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length it must have.
        expected: usize,
    },
    /// More unknowns than 32-bit row indices, or more entries than the order's 32-bit interface, can name.
    TooLarge {
        /// What is too large.
        what: &'static str,
        /// Its size.
        size: usize,
        /// The largest size supported.
        limit: usize,
    },
    /// Column pointers must start at 0, never fall, and end at the number of row indices.
    ColumnPointers {
        /// The first column whose range is wrong.
        column: usize,
    },
    /// The rows of a column must be strictly increasing and start with the diagonal.
    Row {
        /// The column.
        column: usize,
        /// The row that is out of order, above the diagonal, out of range or repeated.
        row: usize,
    },
    /// The diagonal entry of a column is missing.
    MissingDiagonal {
        /// The column.
        column: usize,
    },
    /// An edge or element names a vertex that does not exist.
    Vertex {
        /// The position of the element in its list.
        element: usize,
        /// The vertex it names.
        vertex: usize,
        /// The number of vertices.
        n: usize,
    },
    /// A given order is not a permutation: this index is out of range or repeated.
    NotPermutation {
        /// The position in the order.
        position: usize,
        /// The value found there.
        value: usize,
    },
    /// The ordering library refused the pattern.
    Ordering {
        /// Which library, and what it said.
        reason: String,
    },
    /// A matrix value is NaN or infinite.
    NonFinite {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// The value.
        value: f64,
    },
    /// The matrix is not positive definite to working precision: eliminating `column` left `pivot`,
    /// not positive or lost in rounding. Of several such columns the first in elimination order is named.
    NotPositiveDefinite {
        /// The column (index of the caller).
        column: usize,
        /// The pivot that was left.
        pivot: f64,
    },
    /// The factor holds no numbers: `refactor` was never called, or its last call failed.
    NotFactored,
    /// A corrected solve missed its tolerance.
    NotConverged {
        /// Relative residual |b - A x| / |b| reached, worst right-hand side.
        residual: f64,
        /// Corrections made.
        iterations: usize,
    },
}

impl fmt::Display for SparseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length { what, found, expected } => write!(f, "{what} has length {found}, expected {expected}"),
            Self::TooLarge { what, size, limit } => write!(f, "{what} is {size}, more than the limit {limit}"),
            Self::ColumnPointers { column } => {
                write!(f, "column pointers of column {column} are out of order or beyond the row indices")
            }
            Self::Row { column, row } => write!(
                f,
                "row {row} of column {column}: rows must be strictly increasing, in range and on or below the diagonal"
            ),
            Self::MissingDiagonal { column } => write!(f, "column {column} has no diagonal entry"),
            Self::Vertex { element, vertex, n } => {
                write!(f, "element {element} names vertex {vertex}, but there are {n} vertices")
            }
            Self::NotPermutation { position, value } => {
                write!(f, "order position {position} holds {value}, which is out of range or repeated")
            }
            Self::Ordering { reason } => write!(f, "the fill-reducing order failed: {reason}"),
            Self::NonFinite { row, column, value } => {
                write!(f, "matrix entry ({row}, {column}) is {value}; entries must be finite")
            }
            Self::NotPositiveDefinite { column, pivot } => {
                write!(f, "the matrix is not positive definite: eliminating column {column} left the pivot {pivot:e}")
            }
            Self::NotFactored => write!(f, "the factor holds no numbers: call refactor and check that it succeeds"),
            Self::NotConverged { residual, iterations } => {
                write!(f, "the solve stopped at relative residual {residual:e} after {iterations} corrections")
            }
        }
    }
}

impl std::error::Error for SparseError {}
