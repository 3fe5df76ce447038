//! `proxel deform`: the pose of least energy.

mod args;
mod run;

pub use args::DeformArgs;
pub use run::{Files, Inputs, run, solve_and_write};
