//! The report of a simulation.

use super::{FrameRecord, Simulation};
use crate::report::{Report, Seconds, peak_bytes};

impl Simulation {
    /// The report of a run with these frames: how it ended and why, and its wall time.
    pub fn report(&self, records: &[FrameRecord], (status, reason): (&str, &str), seconds: Seconds) -> Report {
        let last = records.last();
        let (warnings, repaired) = self.notes();
        let solver = &self.scene().solver;
        let ratio = last.and_then(|r| Some(r.gradient? / r.gradient_bound * solver.tol));
        Report {
            version: env!("CARGO_PKG_VERSION").to_string(),
            command: "simulate".to_string(),
            settings: serde_json::to_value(self.scene()).unwrap_or_default(),
            method: solver.method.as_str().to_string(),
            status: status.to_string(),
            reason: reason.to_string(),
            iterations: records.iter().map(|r| r.iterations).sum(),
            energy: last.map(|r| r.energy()),
            gradient_norm: last.and_then(|r| r.gradient),
            gradient_ratio: ratio.filter(|r| r.is_finite()),
            inverted: last.map(|r| r.inverted),
            primal_residual: last.and_then(|r| r.forward),
            accepted: records.iter().map(|r| r.iterations.saturating_sub(r.rejected)).sum(),
            rejected: records.iter().map(|r| r.rejected).sum(),
            warnings: warnings.to_vec(),
            repaired: repaired.to_vec(),
            seconds,
            peak_bytes: peak_bytes(),
            factor_bytes: Some(self.factor_bytes()),
            threads: self.threads(),
            ..Report::default()
        }
    }
}
