//! What a caller hears of a run, and says to it.

use super::flat::{Flat, flips, symmetric_dirichlet};
use super::order::Order;
use super::problem::MODULUS;
use proxel_split::{Method, Observer, Status, StepReport, Stop, Verdict};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

pub use crate::deform::Progress;

/// What the caller wants to hear and say while a run goes on.
#[derive(Default)]
pub struct Hooks<'a> {
    /// Called after every iteration.
    pub progress: Option<&'a mut (dyn FnMut(&Progress) + Send)>,
    /// Whether rows of a trace are kept; what a row costs is left out of its `seconds`.
    pub traced: bool,
    /// Set it to end the run with the best so far.
    pub cancel: Arc<AtomicBool>,
}

/// One row of the trace: the state after `iteration` iterations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapRow {
    /// 0 is the start.
    pub iteration: usize,
    /// Wall time since the end of reading, without what only the trace needs.
    pub seconds: f64,
    /// The normalised energy, with |det J| where a triangle is flipped.
    pub energy: f64,
    /// Norm of its gradient.
    pub gradient_norm: f64,
    /// |W(c(Dx) - z)| / |W z|
    pub primal_residual: f64,
    /// |W(z - z_before)| / |W z|
    pub dual_residual: f64,
    /// Inner steps of this iteration.
    pub inner: usize,
    /// Whether the system was factored anew after it.
    pub refactorised: bool,
    /// Whether it was taken.
    pub accepted: bool,
    /// Triangles without positive area.
    pub flips: u64,
    /// The energy of the local variable; infinite where there is none.
    pub energy_z: f64,
}

impl MapRow {
    /// The header of the CSV file.
    pub const HEADER: &'static str = "iteration,seconds,energy,gradient_norm,position_error,primal_residual,dual_residual,\
                                      merit,inner,refactorised,accepted,inverted,flips,energy_z";

    /// The row as CSV; numbers always parse, `inf` where undefined.
    pub fn to_csv(&self) -> String {
        let number = |v: f64| if v.is_finite() { format!("{v:e}") } else { "inf".to_string() };
        [
            self.iteration.to_string(),
            number(self.seconds),
            number(self.energy),
            number(self.gradient_norm),
            "inf".to_string(),
            number(self.primal_residual),
            number(self.dual_residual),
            "inf".to_string(),
            self.inner.to_string(),
            u8::from(self.refactorised).to_string(),
            u8::from(self.accepted).to_string(),
            self.flips.to_string(),
            self.flips.to_string(),
            number(self.energy_z),
        ]
        .join(",")
    }
}

/// Stops after a wall time.
pub(super) struct TimeLimit {
    began: Instant,
    limit: Option<f64>,
}

impl TimeLimit {
    pub fn new(began: Instant, limit: Option<f64>) -> Self {
        TimeLimit { began, limit }
    }
}

impl Stop for TimeLimit {
    fn check(&mut self, _: &mut dyn Method, _: &StepReport) -> Option<Verdict> {
        let limit = self.limit?;
        (self.began.elapsed().as_secs_f64() >= limit)
            .then(|| Verdict { status: Status::Stopped, reason: format!("{limit} seconds are over (--time-limit)") })
    }
}

/// Feeds the hooks; keeps the rows of the trace.
pub(super) struct Watcher<'a, 'b, 'c> {
    pub chart: &'a Flat<'c>,
    pub order: &'a Order,
    pub hooks: &'a mut Hooks<'b>,
    pub began: Instant,
    pub watching: Duration, // time spent on what only the hooks need
    pub rows: Vec<MapRow>,
}

impl Observer for Watcher<'_, '_, '_> {
    fn observe(&mut self, method: &mut dyn Method, report: &StepReport) {
        let now = Instant::now();
        let seconds = (now - self.began).saturating_sub(self.watching).as_secs_f64();
        if let Some(progress) = self.hooks.progress.as_deref_mut() {
            let energy = method.energy();
            let value = 1.0 + energy.value / MODULUS;
            progress(&Progress { iteration: report.iteration, seconds, energy: value, inverted: energy.inverted });
        }
        if self.hooks.traced {
            let evaluation = method.evaluate();
            let uv = self.order.user(method.x());
            let residuals = method.residuals();
            self.rows.push(MapRow {
                iteration: report.iteration,
                seconds,
                energy: symmetric_dirichlet(self.chart, &uv),
                gradient_norm: evaluation.gradient_norm / MODULUS,
                primal_residual: residuals.primal,
                dual_residual: residuals.dual,
                inner: report.inner,
                refactorised: report.refactorised,
                accepted: report.accepted,
                flips: flips(self.chart.triangles, &uv) as u64,
                energy_z: 1.0 + report.energy_z / MODULUS,
            });
        }
        self.watching += now.elapsed();
    }
}
