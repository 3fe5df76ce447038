//! `proxel deform`: the pose of least energy.

mod args;
mod run;

pub use args::DeformArgs;
pub use run::{run, solve_and_write, Files, Inputs};
