//! Benches and reproductions of Proxel.
//!
//! - `cargo bench -p proxel-bench`: a whole iteration and each of its parts alone ([`parts`]).
//! - `cargo run --release -p proxel-bench --bin ratios`: the same as ratios within one run, beside their thresholds
//!   ([`ratios`]).
//! - `cargo run --release -p proxel-bench --bin repro -- NAME --out DIR`: the tables and figures of the WRAPD paper
//!   (Brown and Narain 2021), and what was compared to choose the defaults ([`repro`]).
//!
//! Real meshes are looked for in the folder that `PROXEL_DATA` names ([`data`]); what was found is said in every result.

pub mod bars;
pub mod data;
pub mod disks;
mod error;
pub mod maps;
pub mod metric;
pub mod motion;
pub mod parts;
pub mod plot;
pub mod published;
pub mod ratios;
pub mod repro;
pub mod runs;
pub mod table;

pub use error::BenchError;

/// The guide to contributing, whose new energy and new constraint are compiled and run as tests: here, since crates that are
/// published have nothing from outside their folders.
#[cfg(doctest)]
#[doc = include_str!("../../../CONTRIBUTING.md")]
struct Contributing;
