//! What Proxel minimises: energies (one file each) and the batches of elements that carry them.

pub mod elements;
pub mod energy;
