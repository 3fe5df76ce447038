//! `proxel simulate`: a scene in motion, frame by frame into a folder.

mod args;
mod run;

pub use args::{SchemaArgs, SimulateArgs};
pub use run::{run, schema};
