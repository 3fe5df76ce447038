//! Maps of surfaces into the plane, of least distortion.

mod chart;
mod flat;
mod start;
mod watch;

pub use watch::{Hooks, MapRow, Progress};

use crate::settings::UnwrapSettings;
use flat::Flat;
use std::time::Instant;

/// Why a map cannot be computed: a sentence that names the item and the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnwrapError(pub String);

impl std::fmt::Display for UnwrapError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for UnwrapError {}

/// Trial.
pub fn trial(points: &[[f64; 3]], triangles: &[[u32; 3]], loops: &[Vec<u32>], settings: &UnwrapSettings) -> Result<Vec<MapRow>, UnwrapError> {
    let flat = Flat::new(points, triangles, loops).ok_or_else(|| UnwrapError("no area".to_string()))?;
    let mut hooks = Hooks { traced: true, ..Hooks::default() };
    let map = chart::solve(&flat, None, settings, &mut hooks, Instant::now())?;
    eprintln!("{:?} {} E {:.12} ratio {:e} setup {:.3} solve {:.3} start {:?} {}", map.outcome.status, map.outcome.reason, map.energy,
        map.gradient_norm / map.reference_gradient, map.setup, map.solve, map.start.weights, map.start.flips);
    Ok(map.rows)
}
