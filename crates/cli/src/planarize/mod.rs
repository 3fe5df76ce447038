//! `proxel planarize`: faces of a mesh made planar, near to a reference.

mod args;
mod run;

pub use args::PlanarizeArgs;
pub use run::run;
