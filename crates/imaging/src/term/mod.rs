//! Terms whose elements are pixels.

mod gradient;
mod pass;

pub use gradient::GradientTerm;
