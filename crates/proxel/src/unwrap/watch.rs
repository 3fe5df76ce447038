//! What a caller hears of a run, and says to it.

use super::flat::{Flat, flips, symmetric_dirichlet};
use super::order::Order;
use super::problem::{MODULUS, local_energy, shown};
use crate::report::TraceRow;
use crate::settings::UnwrapSettings;
use proxel_split::{Method, Observer, StepReport};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

pub use crate::deform::Progress;
pub(super) use crate::deform::TimeLimit;

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
    /// The normalised energy of the local variable; infinite where there is none, or where another energy is minimised.
    pub energy_z: f64,
}

impl MapRow {
    /// The header of the CSV file: that of every command, and what maps have besides.
    pub fn header() -> String {
        format!("{},flips,energy_z", TraceRow::HEADER)
    }

    /// The row as CSV; numbers always parse, `inf` where undefined.
    pub fn to_csv(&self) -> String {
        let row = TraceRow {
            iteration: self.iteration,
            seconds: self.seconds,
            energy: self.energy,
            gradient_norm: self.gradient_norm,
            position_error: f64::INFINITY,
            primal_residual: self.primal_residual,
            dual_residual: self.dual_residual,
            merit: f64::INFINITY,
            inner: self.inner,
            refactorised: self.refactorised,
            accepted: self.accepted,
            inverted: self.flips,
        };
        format!("{},{},{}", row.to_csv(), self.flips, TraceRow::number(self.energy_z))
    }
}

/// Feeds the hooks; keeps the rows of the trace.
pub(super) struct Watcher<'a, 'b, 'c> {
    pub chart: &'a Flat<'c>,
    pub settings: &'a UnwrapSettings,
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
            progress(&Progress {
                iteration: report.iteration,
                seconds,
                energy: shown(self.settings, energy.value),
                inverted: energy.inverted,
            });
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
                energy_z: local_energy(self.settings, report.energy_z),
            });
        }
        self.watching += now.elapsed();
    }
}
