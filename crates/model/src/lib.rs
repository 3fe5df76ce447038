//! Energies, constraint sets and element batches of Proxel.

pub mod energy;
