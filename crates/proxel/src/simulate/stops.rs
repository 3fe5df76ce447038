//! What ends the run of a method, and who looks on.

use crate::deform::TimeLimit;
use crate::report::TraceRow;
use proxel_split::{
    Cancel, Evaluation, IterationLimit, Method, Observer, Outcome, Residuals, Status, StepReport, Stop, Verdict,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Converged when the gradient is at most this, and nothing is inverted that must not be.
pub(super) struct Bound(pub f64);

/// Iterations between two looks at a gradient that is far from the bound and costs a pass of its own.
const FAR: usize = 10;

impl Stop for Bound {
    fn check(&mut self, method: &mut dyn Method, report: &StepReport) -> Option<Verdict> {
        if !method.is_evaluated() && report.iteration > FAR && !report.iteration.is_multiple_of(FAR) {
            return None;
        }
        let Evaluation { energy, gradient_norm } = method.evaluate();
        let barred = method.problem().barrier && energy.inverted > 0;
        (gradient_norm <= self.0 && !barred).then(|| Verdict {
            status: Status::Converged,
            reason: format!("gradient {gradient_norm:e} is at most {:e}", self.0),
        })
    }
}

/// Where a simulation stands.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// The frame under way.
    pub frame: usize,
    /// Iterations of its steps so far.
    pub iterations: usize,
}

/// What is called with the frame, the step in it, and a row of the trace.
pub type Trace<'a> = dyn FnMut(usize, usize, &TraceRow) + Send + 'a;

/// What the caller wants to hear and say while a simulation runs.
#[derive(Default)]
pub struct Hooks<'a> {
    /// Called after every iteration.
    pub progress: Option<&'a mut (dyn FnMut(&Progress) + Send)>,
    /// Called with the frame, the step in it, and every row of the trace.
    pub trace: Option<&'a mut Trace<'a>>,
    /// Set it to end the run; the frame under way is dropped.
    pub cancel: Arc<AtomicBool>,
    /// Seconds that the whole run may take, and since when.
    pub time_limit: Option<(Instant, f64)>,
}

/// The stops of all runs of a frame.
pub(super) struct Stops<'a> {
    hooks: &'a mut (dyn Listener + 'a),
    began: Instant,
    watching: Duration, // time spent on what only the hooks need
    frame: usize,
    /// The step of the frame that is being solved.
    pub step: usize,
    iterations: usize,
}

/// [`Hooks`], without their lifetimes.
trait Listener: Send {
    fn cancel(&self) -> Arc<AtomicBool>;
    fn time_limit(&self) -> Option<(Instant, f64)>;
    fn is_tracing(&self) -> bool;
    fn progress(&mut self, at: &Progress);
    fn trace(&mut self, frame: usize, step: usize, row: &TraceRow);
}

impl Listener for Hooks<'_> {
    fn cancel(&self) -> Arc<AtomicBool> {
        self.cancel.clone()
    }
    fn time_limit(&self) -> Option<(Instant, f64)> {
        self.time_limit
    }
    fn is_tracing(&self) -> bool {
        self.trace.is_some()
    }
    fn progress(&mut self, at: &Progress) {
        if let Some(progress) = self.progress.as_deref_mut() {
            progress(at);
        }
    }
    fn trace(&mut self, frame: usize, step: usize, row: &TraceRow) {
        if let Some(trace) = self.trace.as_deref_mut() {
            trace(frame, step, row);
        }
    }
}

impl<'a> Stops<'a> {
    /// For a frame.
    pub fn new(hooks: &'a mut Hooks<'_>, frame: usize) -> Self {
        Stops { hooks, began: Instant::now(), watching: Duration::ZERO, frame, step: 0, iterations: 0 }
    }

    /// Whether the run is to end.
    pub fn is_over(&self) -> bool {
        let late = self.hooks.time_limit().is_some_and(|(since, limit)| since.elapsed().as_secs_f64() >= limit);
        late || self.is_cancelled()
    }

    /// Whether the user asked for the end.
    pub fn is_cancelled(&self) -> bool {
        self.hooks.cancel().load(Ordering::Relaxed)
    }

    /// Iterates until one of `first`, the user, the time or the limit of iterations speaks.
    pub fn run(&mut self, method: &mut dyn Method, first: &mut [&mut dyn Stop], limit: usize) -> Outcome {
        let mut cancel = Cancel(self.hooks.cancel());
        let (since, seconds) = self.hooks.time_limit().map_or((self.began, None), |(since, s)| (since, Some(s)));
        let mut time = TimeLimit::new(since, seconds);
        let mut limit = IterationLimit(limit);
        let mut stops: Vec<&mut dyn Stop> = Vec::with_capacity(first.len() + 3);
        for stop in first {
            stops.push(&mut **stop);
        }
        stops.extend([&mut cancel as &mut dyn Stop, &mut time, &mut limit]);
        proxel_split::run(method, &mut stops, self)
    }
}

impl Observer for Stops<'_> {
    fn observe(&mut self, method: &mut dyn Method, report: &StepReport) {
        let now = Instant::now();
        self.iterations += usize::from(report.iteration > 0);
        self.hooks.progress(&Progress { frame: self.frame, iterations: self.iterations });
        if self.hooks.is_tracing() {
            let seconds = (now - self.began).saturating_sub(self.watching).as_secs_f64();
            let evaluation = method.evaluate();
            let Residuals { primal, dual } = method.residuals();
            let row = TraceRow {
                iteration: report.iteration,
                seconds,
                energy: evaluation.energy.value,
                gradient_norm: evaluation.gradient_norm,
                position_error: f64::INFINITY,
                primal_residual: primal,
                dual_residual: dual,
                merit: report.merit.unwrap_or(f64::INFINITY),
                inner: report.inner,
                refactorised: report.refactorised,
                accepted: report.accepted,
                inverted: evaluation.energy.inverted,
            };
            self.hooks.trace(self.frame, self.step, &row);
        }
        self.watching += now.elapsed();
    }
}
