//! Sparse symmetric positive definite systems: analysed once, refactored often, solved very often.
//!
//! - [`SymPattern`]: where a symmetric matrix has entries.
//! - [`Symbolic`]: elimination order, supernodes and tasks of a pattern.
//! - [`Cholesky`]: the numbers of a factor, in `f64` or `f32`, and its solves.
//! - [`BlockMatrix`]: a symmetric matrix of small blocks over a pattern, which [`Symbolic::expanded`] factors.
//! - [`MixedCholesky`]: an `f32` factor whose solves are corrected with the `f64` matrix.
//!
//! Everything runs on the current rayon pool and gives the same bits on any number of threads: the elimination tree
//! is cut into tasks by the pattern alone, each task works on memory of its own, and sums are taken in a fixed order.
#![allow(unsafe_code)] // kernels over raw lines; every use says why it is sound

mod assemble;
mod blocks;
mod dense;
mod error;
mod etree;
mod expand;
mod factor;
mod front;
mod groups;
mod invert;
mod layout;
mod memory;
mod mixed;
mod ordering;
mod pattern;
mod solve;
mod supernodes;
mod sweep;
mod symbolic;
mod tile;
mod vector;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use blocks::BlockMatrix;
pub use error::SparseError;
pub use factor::{Cholesky, Purpose};
pub use mixed::{Corrected, MixedCholesky, MixedScratch};
pub use ordering::{Ordering, Permutation, order};
pub use pattern::SymPattern;
pub use solve::SolveScratch;
pub use symbolic::Symbolic;
pub use vector::Scalar;
