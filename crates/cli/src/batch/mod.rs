//! `proxel batch`: a command on thousands of meshes, each in a process of its own.
//!
//! ```text
//! folder or manifest -> list of jobs -> this shard's part -> minus what is done -> workers -> results.jsonl
//! ```
//!
//! [`list`] knows what is to be done, [`results`] what has been done, [`mesh`] makes a line of results from a mesh by a
//! [`child`] under its limits, and [`supervise`] keeps as many children busy as it may.

mod args;
mod child;
mod hash;
mod list;
mod manifest;
mod mesh;
mod options;
mod results;
mod supervise;
mod tally;

pub use args::BatchCommand;
pub use child::limit_this_process;

use crate::refusal::Refusal;

/// Runs what was asked for.
pub fn run(command: BatchCommand) -> Result<u8, Refusal> {
    match command {
        BatchCommand::Unwrap(args) => supervise::run(*args),
    }
}
