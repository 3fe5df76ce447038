//! Batched signed SVD, polar decomposition and sparse Cholesky of Proxel.
