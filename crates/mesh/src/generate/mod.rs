//! Meshes without files: deterministic samples for demonstrations, tests and benches.

mod bars;
mod grid;
mod octopus;
mod shapes;
mod smoothing;
mod stuffing;

pub use bars::{Bars, bars};
pub use grid::{CellSplit, beam, cloth, cube};
pub use octopus::{Arm, ArmPoint, Octopus, OctopusSettings, octopus};
pub use shapes::{ball, torus};
pub use stuffing::stuff;

use crate::error::{ErrorKind, MeshError, Result};

fn invalid(what: String, remedy: &str) -> MeshError {
    MeshError::new(ErrorKind::InvalidParameter, "generator", what, remedy)
}

/// Checks that a length is positive and finite.
fn positive(name: &str, x: f64) -> Result<()> {
    if x > 0.0 && x.is_finite() {
        Ok(())
    } else {
        Err(invalid(format!("{name} is {x}"), "give a positive finite length"))
    }
}
