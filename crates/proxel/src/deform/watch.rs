//! Observers with a clock: progress, trace rows, the time limit.

use crate::report::TraceRow;
use proxel_split::{Method, Observer, Status, StepReport, Stop, Verdict};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// Where a run stands.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Iterations done.
    pub iteration: usize,
    /// Wall time since the end of reading.
    pub seconds: f64,
    /// Objective.
    pub energy: f64,
    /// Elements with a measure of zero or below.
    pub inverted: u64,
}

/// What the caller wants to hear and say while a run goes on.
#[derive(Default)]
pub struct Hooks<'a> {
    /// Called after every iteration.
    pub progress: Option<&'a mut (dyn FnMut(&Progress) + Send)>,
    /// Called with every row of the trace; what a row costs is left out of its `seconds`.
    pub trace: Option<&'a mut (dyn FnMut(&TraceRow) + Send)>,
    /// Set it to end the run with the best so far.
    pub cancel: Arc<AtomicBool>,
}

/// Feeds the hooks.
pub(crate) struct Watcher<'a, 'b, E> {
    hooks: &'a mut Hooks<'b>,
    began: Instant,
    watching: Duration, // time spent on what only the hooks need
    error: E,
}

impl<'a, 'b, E: FnMut(&[f64]) -> f64> Watcher<'a, 'b, E> {
    /// `error` is the position error of an x.
    pub fn new(hooks: &'a mut Hooks<'b>, began: Instant, error: E) -> Self {
        Watcher { hooks, began, watching: Duration::ZERO, error }
    }
}

impl<E: FnMut(&[f64]) -> f64> Observer for Watcher<'_, '_, E> {
    fn observe(&mut self, method: &mut dyn Method, report: &StepReport) {
        let now = Instant::now();
        let seconds = (now - self.began).saturating_sub(self.watching).as_secs_f64();
        if let Some(progress) = self.hooks.progress.as_deref_mut() {
            let energy = method.energy();
            progress(&Progress {
                iteration: report.iteration,
                seconds,
                energy: energy.value,
                inverted: energy.inverted,
            });
        }
        if let Some(trace) = self.hooks.trace.as_deref_mut() {
            let position_error = (self.error)(method.x());
            trace(&row(method, report, seconds, position_error));
        }
        self.watching += now.elapsed();
    }
}

/// The row of the trace of a state.
pub(crate) fn row(method: &mut dyn Method, report: &StepReport, seconds: f64, position_error: f64) -> TraceRow {
    let (evaluation, residuals) = (method.evaluate(), method.residuals());
    TraceRow {
        iteration: report.iteration,
        seconds,
        energy: evaluation.energy.value,
        gradient_norm: evaluation.gradient_norm,
        position_error,
        primal_residual: residuals.primal,
        dual_residual: residuals.dual,
        merit: report.merit.unwrap_or(f64::INFINITY),
        inner: report.inner,
        refactorised: report.refactorised,
        accepted: report.took_proposal(),
        inverted: evaluation.energy.inverted,
    }
}

/// Stops after a wall time.
pub(crate) struct TimeLimit {
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
