//! Linear algebra of Proxel: eight-lane arithmetic with the instruction set chosen at run time, signed singular value
//! and polar decompositions of small matrices in batches, sparse symmetric factorisation and triangular solves.

pub mod simd;
pub mod sparse;
pub mod svd;
