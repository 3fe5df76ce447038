//! Uniform refinement: every tetrahedron into 8, every triangle into 4.
