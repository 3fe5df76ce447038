//! `proxel deform`: the pose of least energy.

mod animate;
mod args;
mod run;

pub use animate::{Outlets, animate};
pub use args::DeformArgs;
pub use run::{Files, Inputs, run, solve_and_write};
