//! Slow twins for tests of Proxel: finite differences, brute-force prox, tiny meshes.
