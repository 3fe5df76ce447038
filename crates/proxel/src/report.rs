//! The report: what a run did, for programs. Keys are the same for every command; null where one does not apply.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Wall time of the parts of a run, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Seconds {
    /// Reading files.
    pub read: f64,
    /// Checks, orders, the first factor.
    pub setup: f64,
    /// Iterating.
    pub solve: f64,
    /// Writing files.
    pub write: f64,
}

/// The report of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Version of Proxel.
    pub version: String,
    /// The command.
    pub command: String,
    /// All settings, with defaults filled in.
    pub settings: serde_json::Value,
    /// The method.
    pub method: String,
    /// converged, stopped, failed or cancelled.
    pub status: String,
    /// Why it ended.
    pub reason: String,
    /// Iterations done.
    pub iterations: usize,
    /// Their inner steps.
    pub inner_iterations: usize,
    /// Factorisations after the first.
    pub refactorisations: usize,
    /// Objective of the result.
    pub energy: Option<f64>,
    /// Norm of its gradient over free vertices.
    pub gradient_norm: Option<f64>,
    /// The same over min(|g(X0)|, characteristic gradient).
    pub gradient_ratio: Option<f64>,
    /// Elements of the result with a measure of zero or below.
    pub inverted: Option<u64>,
    /// Least signed stretch.
    pub min_stretch: Option<f64>,
    /// Largest stretch.
    pub max_stretch: Option<f64>,
    /// |X - X*| / |X0 - X*| over free vertices, where a reference was given.
    pub position_error: Option<f64>,
    /// |W(c(Dx) - z)| / |W z| at the last iterate.
    pub primal_residual: Option<f64>,
    /// |W(z - z_before)| / |W z| likewise.
    pub dual_residual: Option<f64>,
    /// Iterations taken.
    pub accepted: usize,
    /// Iterations refused.
    pub rejected: usize,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// What was repaired in the input.
    pub repaired: Vec<String>,
    /// Wall time.
    pub seconds: Seconds,
    /// Largest resident memory of the process.
    pub peak_bytes: Option<u64>,
    /// Memory of the factor.
    pub factor_bytes: Option<u64>,
    /// Threads used.
    pub threads: usize,
    /// The sum of the reaction forces of each group of pins and of each obstacle (`obstacle 0`, ..): what the body exerts on
    /// it.
    #[serde(default)]
    pub reactions: BTreeMap<String, [f64; 3]>,
    /// The lattice, where a surface was carried by one.
    pub lattice: Option<LatticeReport>,
}

/// The lattice of tetrahedra that carried a surface.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LatticeReport {
    /// Cells along the longest side of the surface's bounding box.
    pub resolution: usize,
    /// The length of a cell's side.
    pub cell: f64,
    /// Its nodes.
    pub nodes: usize,
    /// Its tetrahedra, six a cell.
    pub tetrahedra: usize,
    /// The mean winding number at the surface: 0.5 where it is closed, 0 for an open plane.
    pub closedness: f64,
    /// Cells that join what the surface parts.
    pub joined_cells: usize,
    /// The largest distance of a pinned vertex from where it is to be, over the diagonal of the bounding box.
    pub pin_error: f64,
}

/// One row of the trace: the state after `iteration` iterations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TraceRow {
    /// 0 is the start.
    pub iteration: usize,
    /// Wall time since the end of reading, without what only the trace needs.
    pub seconds: f64,
    /// Objective.
    pub energy: f64,
    /// Norm of its gradient over free vertices.
    pub gradient_norm: f64,
    /// |X - X*| / |X0 - X*| over free vertices.
    pub position_error: f64,
    /// |W(c(Dx) - z)| / |W z|
    pub primal_residual: f64,
    /// |W(z - z_before)| / |W z|
    pub dual_residual: f64,
    /// What an accelerator looks at.
    pub merit: f64,
    /// Inner steps of this iteration.
    pub inner: usize,
    /// Whether the system was factored anew after it.
    pub refactorised: bool,
    /// Whether it was taken.
    pub accepted: bool,
    /// Elements with a measure of zero or below.
    pub inverted: u64,
}

impl TraceRow {
    /// The header of the CSV file.
    pub const HEADER: &'static str = "iteration,seconds,energy,gradient_norm,position_error,primal_residual,dual_residual,\
                                      merit,inner,refactorised,accepted,inverted";

    /// The row as CSV; numbers always parse, `inf` where undefined.
    pub fn to_csv(&self) -> String {
        let number = |v: f64| if v.is_finite() { format!("{v:e}") } else { "inf".to_string() };
        [
            self.iteration.to_string(),
            number(self.seconds),
            number(self.energy),
            number(self.gradient_norm),
            number(self.position_error),
            number(self.primal_residual),
            number(self.dual_residual),
            number(self.merit),
            self.inner.to_string(),
            u8::from(self.refactorised).to_string(),
            u8::from(self.accepted).to_string(),
            self.inverted.to_string(),
        ]
        .join(",")
    }
}
