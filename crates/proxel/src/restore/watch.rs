//! What looks at a run.

use super::Hooks;
use crate::report::TraceRow;
use proxel_imaging::Image;
use proxel_imaging::restore::{Field, duality_gap, psnr};
use proxel_split::{Method, Observer, Status, StepReport, Stop, Verdict};
use std::time::{Duration, Instant};

/// Converged when the duality gap is at most `tol` times the objective.
pub(super) struct GapTolerance<'a> {
    tol: f64,
    field: &'a Field,
    next: usize,
    rounding: f64, // a gap of this size is one
}

/// Part of the objective at the start, an image of zeros, below which a gap is rounding: the objective of an image of one
/// value is 0.
const ROUNDING: f64 = 1e-11;

/// The gap is looked at every so many iterations: it costs about as much as one.
const EVERY: usize = 5;

impl<'a> GapTolerance<'a> {
    pub(super) fn new(tol: f64, field: &'a Field) -> Self {
        GapTolerance { tol, field, next: EVERY, rounding: 0.0 }
    }
}

impl Stop for GapTolerance<'_> {
    fn check(&mut self, method: &mut dyn Method, report: &StepReport) -> Option<Verdict> {
        if report.iteration == 0 {
            self.rounding = ROUNDING * method.energy().value;
        }
        if report.iteration < self.next {
            return None;
        }
        self.next = report.iteration + EVERY;
        let gap = duality_gap(method, self.field)?;
        let [low, high] = gap.range;
        let reason = if gap.relative() <= self.tol {
            format!(
                "the duality gap is {:.2e} of the objective, at most {:e} (images with values from {low:.3} to {high:.3})",
                gap.relative(),
                self.tol
            )
        } else if gap.gap <= self.rounding {
            format!(
                "the duality gap is {:.2e}, which is rounding: at most {ROUNDING:e} of the objective of an image of zeros \
                 (images with values from {low:.3} to {high:.3})",
                gap.gap
            )
        } else {
            return None;
        };
        Some(Verdict { status: Status::Converged, reason })
    }
}

/// A row of the trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestoreRow {
    /// What every trace has.
    pub row: TraceRow,
    /// How much lower the objective can be at most; infinite where there is no bound.
    pub duality_gap: f64,
    /// In dB against the truth; infinite where there is none.
    pub psnr: f64,
}

impl RestoreRow {
    /// The header of the CSV file.
    pub fn header() -> String {
        format!("{},duality_gap,psnr", TraceRow::HEADER)
    }

    /// A line of it.
    pub fn to_csv(&self) -> String {
        format!("{},{},{}", self.row.to_csv(), TraceRow::number(self.duality_gap), TraceRow::number(self.psnr))
    }
}

/// Feeds the hooks.
pub(super) struct Watcher<'a, 'b> {
    hooks: &'a mut Hooks<'b>,
    began: Instant,
    watching: Duration, // time spent on what only the hooks need
    field: &'a Field,
    truth: Option<&'a Image>,
}

impl<'a, 'b> Watcher<'a, 'b> {
    pub(super) fn new(hooks: &'a mut Hooks<'b>, began: Instant, field: &'a Field, truth: Option<&'a Image>) -> Self {
        Watcher { hooks, began, watching: Duration::ZERO, field, truth }
    }
}

impl Observer for Watcher<'_, '_> {
    fn observe(&mut self, method: &mut dyn Method, report: &StepReport) {
        let now = Instant::now();
        let seconds = (now - self.began).saturating_sub(self.watching).as_secs_f64();
        if let Some(progress) = self.hooks.progress.as_deref_mut() {
            progress(report.iteration, method.energy().value);
        }
        if let Some(trace) = self.hooks.trace.as_deref_mut() {
            let (energy, residuals) = (method.energy(), method.residuals());
            let row = TraceRow {
                iteration: report.iteration,
                seconds,
                energy: energy.value,
                // Total variation has no gradient where the image is flat.
                gradient_norm: f64::INFINITY,
                position_error: f64::INFINITY,
                primal_residual: residuals.primal,
                dual_residual: residuals.dual,
                merit: report.merit.unwrap_or(f64::INFINITY),
                inner: report.inner,
                refactorised: report.refactorised,
                accepted: report.took_proposal(),
                inverted: 0,
            };
            // Before the first step forces are no subgradients, and there is no bound.
            let bound = (report.iteration > 0).then(|| duality_gap(method, self.field)).flatten();
            let gap = bound.map_or(f64::INFINITY, |gap| gap.gap);
            let psnr = self.truth.map_or(f64::INFINITY, |t| psnr(&self.field.image(method.x()), &t.channels));
            trace(&RestoreRow { row, duality_gap: gap, psnr });
        }
        self.watching += now.elapsed();
    }
}
