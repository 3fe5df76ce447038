//! `proxel simulate`: a scene in motion, frame by frame into a folder.

mod args;
mod report;
mod run;

pub use args::{SchemaArgs, SimulateArgs};
pub use report::report;
pub use run::{run, schema};
