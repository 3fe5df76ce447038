//! What a simulation and a frame of one that is replayed report alike.

use proxel::report::{Report, Seconds};
use proxel::simulate::{FrameRecord, Simulation};

use crate::files::peak_bytes;

/// Of these frames, with how it ended and why.
pub fn report(
    simulation: &Simulation,
    records: &[FrameRecord],
    (status, reason): (&str, &str),
    seconds: Seconds,
) -> Report {
    let last = records.last();
    let (warnings, repaired) = simulation.notes();
    let solver = &simulation.scene().solver;
    let ratio = last.and_then(|r| Some(r.gradient? / r.gradient_bound * solver.tol));
    Report {
        version: env!("CARGO_PKG_VERSION").to_string(),
        command: "simulate".to_string(),
        settings: serde_json::to_value(simulation.scene()).unwrap_or_default(),
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
        factor_bytes: Some(simulation.factor_bytes()),
        threads: simulation.threads(),
        ..Report::default()
    }
}
