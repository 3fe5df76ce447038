//! What Proxel minimises: energies (one file each) and the batches of elements that carry them.

pub mod bending;
pub mod constraint;
pub mod contact;
pub mod elements;
pub mod energy;
pub mod gradient_field;
pub mod obstacle;
pub mod points;
pub mod pressure;
pub mod solid;
pub mod strain_limit;
