//! Signed singular value, polar and symmetric eigen-decompositions of small matrices, in lanes and in batches.
//!
//! Every function here is a fixed sequence of operations without loops over a residual: it takes the same time for
//! every matrix, and what a lane holds never changes the result of another lane.
//!
//! # Method
//! The 3x3 case is direct. Of A^T A the eigenvalue that stands apart from the other two is found in closed form
//! ([`eigen`]), it belongs to the largest or to the smallest stretch, and its eigenvector w is well conditioned. Then
//! one singular pair (w, z) is known to machine precision, and in orthonormal frames around w and z what is left of A
//! is a 2x2 matrix, whose signed decomposition is closed again ([`plane`]). Squares are used only to find w, so small
//! stretches are not lost: the result is backward stable, |A - U S V^T| of a few machine epsilons times the largest
//! stretch.
//!
//! # Conventions
//! Matrices are arrays of rows. U and V are proper rotations (determinant +1). Stretches descend, and in the square
//! cases the last one carries the sign of det A, as deformation energies need it (Irving, Teran, Fedkiw 2004,
//! "Invertible finite elements for robust simulation of large deformation"). A thin matrix (more rows than columns) has
//! a square U whose last columns complete the first ones to a proper rotation, and no stretch is negative.
//!
//! Any finite matrix is accepted: it is scaled by a power of two of its largest entry. A lane with a NaN or an infinite
//! entry gives NaN in all its results.
//!
//! ```
//! use proxel_linalg::svd::{rotation, svd3};
//! // A quarter turn about z, after a stretch by 2 along x and a mirror along z.
//! let svd = svd3([[0.0, -1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, -0.5]]);
//! let turn = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
//! for k in 0..3 {
//!     assert!((svd.s[k] - [2.0, 1.0, -0.5][k]).abs() < 1e-14);
//!     assert!((0..3).all(|l| (rotation(&svd)[k][l] - turn[k][l]).abs() < 1e-14));
//! }
//! ```

mod batch;
pub mod eigen;
mod frame;
pub mod plane;
mod polar;
mod quaternion;
mod space;
mod thin;

pub use batch::{
    BatchSizeError, Par, eig2_sym_batch, eig3_sym_batch, svd2_batch, svd3_batch, svd21_batch, svd31_batch, svd32_batch,
};
pub use eigen::{eig2_sym, eig3_sym, max_eigenvalue3};
pub use plane::svd2;
pub use polar::{rotation, rotation_thin, stretch2, stretch3};
pub use quaternion::{quaternion_from_rotation, rotation_from_quaternion, svd3_quat};
pub use space::svd3;
pub use thin::{svd21, svd31, svd32};

/// A = U diag(s) V^T of a ROWS x COLS matrix, ROWS >= COLS.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Svd<T, const ROWS: usize, const COLS: usize> {
    /// A proper rotation, by rows; column k is the left singular vector of stretch k.
    pub u: [[T; ROWS]; ROWS],
    /// The stretches, descending; in the square cases the last one has the sign of det A.
    pub s: [T; COLS],
    /// A proper rotation, by rows; column k is the right singular vector of stretch k.
    pub v: [[T; COLS]; COLS],
}

/// A = Q diag(lambda) Q^T of a symmetric N x N matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eigen<T, const N: usize> {
    /// A proper rotation, by rows; column k is the eigenvector of eigenvalue k.
    pub q: [[T; N]; N],
    /// The eigenvalues, descending.
    pub lambda: [T; N],
}
