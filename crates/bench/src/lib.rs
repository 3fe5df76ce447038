//! Benches and reproductions of Proxel.
