//! `proxel unwrap`: a map of least distortion.

mod args;
mod lists;
mod original;
mod run;

pub use args::UnwrapArgs;
pub use run::{Files, Job, run};
