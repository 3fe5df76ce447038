//! The course of a run: a splitting, and its finish.

use super::finish::{Constraints, Finish, Program};
use super::problem::{Posed, Shape};
use super::{EXACT, ShapeError, ShapeMethod, ShapeSettings, ways};
use crate::deform::{Hooks, Progress, TimeLimit};
use crate::report::TraceRow;
use proxel_split::{
    Admm, AdmmSettings, Cancel, Direct, GradientTolerance, IterationLimit, Method, Observer, Outcome,
    ResidualTolerance, Residuals, Status, StepReport, Stop, Verdict, normalized, vector,
};
use std::time::{Duration, Instant};

/// A run that is over.
pub(super) struct Ended {
    pub x: Vec<f64>,
    pub status: Status,
    pub reason: String,
    pub iterations: usize,
    pub inner: usize,
    pub refactorisations: usize,
    pub accepted: usize,
    pub rejected: usize,
    pub energy: f64,
    pub residuals: Residuals,
    pub factor_bytes: u64,
    pub setup: f64,
    pub solve: f64,
}

/// The normalised combined residual without mu at which `auto` leaves the splitting.
const SETTLED: f64 = 3e-5;
/// The residual that is enough after [`PATIENCE`] iterations; after three times as many any is, since it will not fall:
/// constraints may contradict each other.
const ENOUGH: f64 = 1e-4;
/// See [`ENOUGH`].
const PATIENCE: usize = 1000;
/// Steps of the finish, at most.
const FINISH: usize = 60;

/// The splitting that settings ask for.
pub(super) fn splitting(posed: Posed, settings: &ShapeSettings) -> Result<(Box<dyn Method>, Constraints), ShapeError> {
    let Posed { problem, constraints, .. } = posed;
    let name = settings.method.as_str().to_string();
    let parts = AdmmSettings { name, global: Box::new(Direct), reweighting: None, renewed_at: None };
    let admm = Admm::new(problem, parts)?;
    let method = ways::method(admm, settings).map_err(|e| ShapeError(e.to_string()))?;
    Ok((method, constraints))
}

/// Solves.
pub(super) fn run(
    shape: &Shape,
    posed: Posed,
    settings: &ShapeSettings,
    hooks: &mut Hooks<'_>,
    began: Instant,
) -> Result<Ended, ShapeError> {
    let (mut method, constraints) = splitting(posed, settings)?;
    let setup = began.elapsed().as_secs_f64();
    let auto = settings.method == ShapeMethod::Auto;
    let mut handover = Handover { a: shape.mean_edge, mu: settings.mu };
    // Without duals there are no residuals: what vanishes is the gradient.
    let penalized = method.problem().terms.iter().all(|term| !term.has_dual());
    let mut tolerance: Box<dyn Stop> = match penalized {
        true => {
            let size = shape.mean_edge * vector::norm(&method.problem().node_stiffness());
            Box::new(GradientTolerance::against(settings.tol, method.evaluate().gradient_norm, size))
        }
        false => Box::new(ResidualTolerance::new(settings.tol)),
    };
    let mut limit = IterationLimit(settings.max_iters);
    let mut cancel = Cancel(hooks.cancel.clone());
    let mut time = TimeLimit::new(began, settings.time_limit);
    let mut watcher = Watcher { hooks, began, watching: Duration::ZERO, skips: false };
    let free = constraints.is_empty();
    let mut stops: Vec<&mut dyn Stop> = vec![tolerance.as_mut(), &mut cancel, &mut time, &mut limit];
    if auto && !free {
        stops.push(&mut handover);
    }
    let outcome = proxel_split::run(method.as_mut(), &mut stops, &mut watcher);
    let over = matches!(outcome.status, Status::Failed | Status::Cancelled) || outcome.iterations >= settings.max_iters;
    if !auto || free || over {
        let none = Residuals { primal: f64::INFINITY, dual: f64::INFINITY };
        let residuals = if penalized { none } else { method.residuals() };
        let factor_bytes = method.factor_bytes();
        return Ok(ended(outcome, residuals, factor_bytes, setup, began));
    }
    let before = outcome;
    let program = Program::new(method.problem(), constraints, method.x())?;
    watcher.skips = true;
    if program.needs() > settings.memory {
        let (needs, memory) = (program.needs() / 1e9, settings.memory / 1e9);
        drop(program);
        let mut stops: Vec<&mut dyn Stop> = vec![tolerance.as_mut(), &mut cancel, &mut time, &mut limit];
        let mut outcome = since(&before, proxel_split::run(method.as_mut(), &mut stops, &mut watcher));
        outcome.reason +=
            &format!("; without the finish, whose factor would take {needs:.1} GB of {memory:.1} (--memory)");
        let (residuals, factor_bytes) = (method.residuals(), method.factor_bytes());
        return Ok(ended(outcome, residuals, factor_bytes, setup, began));
    }
    let (x, dual) = (method.x().to_vec(), method.residuals().dual);
    let settled = before.reason.clone();
    let problem = method.into_problem();
    let mut finish = Finish::new(program, problem, x, (before.iterations, dual));
    let mut exact = Exact { settled };
    let mut last = IterationLimit(settings.max_iters.min(before.iterations + FINISH));
    let mut stops: Vec<&mut dyn Stop> = vec![&mut exact, &mut cancel, &mut time, &mut last];
    let mut outcome = since(&before, proxel_split::run(&mut finish, &mut stops, &mut watcher));
    let residuals = finish.residuals();
    let factor_bytes = finish.factor_bytes();
    (outcome.x, outcome.energy) = (finish.x().to_vec(), finish.energy());
    if outcome.status == Status::Failed {
        // Constraints that contradict each other are no failure of the run: what it has got to is as good as it gets.
        outcome.status = Status::Stopped;
    }
    Ok(ended(outcome, residuals, factor_bytes, setup, began))
}

/// What has gone on after `before`, counted from the start.
fn since(before: &Outcome, mut outcome: Outcome) -> Outcome {
    outcome.accepted += before.accepted;
    outcome.rejected += before.rejected;
    outcome.inner_iterations += before.inner_iterations;
    outcome.refactorisations += before.refactorisations;
    outcome.iterations = outcome.iterations.max(before.iterations);
    outcome
}

fn ended(outcome: Outcome, residuals: Residuals, factor_bytes: u64, setup: f64, began: Instant) -> Ended {
    Ended {
        x: outcome.x,
        status: outcome.status,
        reason: outcome.reason,
        iterations: outcome.iterations,
        inner: outcome.inner_iterations,
        refactorisations: outcome.refactorisations,
        accepted: outcome.accepted,
        rejected: outcome.rejected,
        energy: outcome.energy.value,
        residuals,
        factor_bytes,
        setup,
        solve: began.elapsed().as_secs_f64() - setup,
    }
}

/// The splitting has done its part.
struct Handover {
    a: f64,
    mu: f64,
}

impl Stop for Handover {
    fn check(&mut self, method: &mut dyn Method, report: &StepReport) -> Option<Verdict> {
        let residual = normalized(report.merit? / self.mu, method.problem().local_dim(), self.a);
        let it = report.iteration;
        let settled = residual <= SETTLED || (residual <= ENOUGH && it >= PATIENCE) || it >= 3 * PATIENCE;
        settled.then(|| Verdict {
            status: Status::Stopped,
            reason: format!("combined residual {residual:.1e} after {} iterations of the splitting", report.iteration),
        })
    }
}

/// Hard sets hold.
struct Exact {
    settled: String, // why the splitting has ended
}

impl Stop for Exact {
    fn check(&mut self, method: &mut dyn Method, _: &StepReport) -> Option<Verdict> {
        let violation = method.residuals().primal;
        (violation <= EXACT).then(|| Verdict {
            status: Status::Converged,
            reason: format!("{}; then constraints were made to hold to {violation:.1e}", self.settled),
        })
    }
}

/// Feeds the hooks.
struct Watcher<'a, 'b> {
    hooks: &'a mut Hooks<'b>,
    began: Instant,
    watching: Duration, // time spent on what only the hooks need
    skips: bool,        // the next state has been seen already
}

impl Observer for Watcher<'_, '_> {
    fn observe(&mut self, method: &mut dyn Method, report: &StepReport) {
        if std::mem::take(&mut self.skips) {
            return;
        }
        let now = Instant::now();
        let seconds = (now - self.began).saturating_sub(self.watching).as_secs_f64();
        if let Some(progress) = self.hooks.progress.as_deref_mut() {
            let energy = method.energy();
            progress(&Progress { iteration: report.iteration, seconds, energy: energy.value, inverted: 0 });
        }
        if let Some(trace) = self.hooks.trace.as_deref_mut() {
            let energy = method.energy();
            let residuals = method.residuals();
            // Where nothing judges a point, what would: the combined residual.
            let combined = || method.squared_residuals().map(|square| square.combined);
            let merit = report.merit.or_else(combined).unwrap_or(f64::INFINITY);
            trace(&TraceRow {
                iteration: report.iteration,
                seconds,
                energy: energy.value,
                gradient_norm: f64::INFINITY,
                position_error: f64::INFINITY,
                primal_residual: residuals.primal,
                dual_residual: residuals.dual,
                merit,
                inner: report.inner,
                refactorised: report.refactorised,
                accepted: report.took_proposal(),
                inverted: 0,
            });
        }
        self.watching += now.elapsed();
    }
}
