//! Driving a method: stops, observers, and the best point so far.

use crate::{EnergyReport, Evaluation, Method, StepReport, SystemError, vector};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The gradient is below the tolerance and, where it must not be, nothing is inverted.
    Converged,
    /// A limit of iterations or time came first.
    Stopped,
    /// The method could not go on.
    Failed,
    /// The user asked for the end.
    Cancelled,
}

impl Status {
    /// As in reports: converged, stopped, failed, cancelled.
    pub fn as_str(self) -> &'static str {
        match self {
            Status::Converged => "converged",
            Status::Stopped => "stopped",
            Status::Failed => "failed",
            Status::Cancelled => "cancelled",
        }
    }
}

/// What a [`Stop`] says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// How the run ends.
    pub status: Status,
    /// Why, in a sentence.
    pub reason: String,
}

/// A reason to stop, asked after every iteration and, with iteration 0, before the first.
pub trait Stop {
    /// Some verdict to end the run.
    fn check(&mut self, method: &mut dyn Method, report: &StepReport) -> Option<Verdict>;
}

/// Told of every state, the start included (iteration 0).
pub trait Observer {
    /// Looks at the state.
    fn observe(&mut self, method: &mut dyn Method, report: &StepReport);
}

/// Sees nothing.
pub struct NoObserver;

impl Observer for NoObserver {
    fn observe(&mut self, _: &mut dyn Method, _: &StepReport) {}
}

/// Stops at a number of iterations.
pub struct IterationLimit(pub usize);

impl Stop for IterationLimit {
    fn check(&mut self, _: &mut dyn Method, report: &StepReport) -> Option<Verdict> {
        (report.iteration >= self.0).then(|| Verdict {
            status: Status::Stopped,
            reason: format!("{} iterations done (--max-iters)", report.iteration),
        })
    }
}

/// Stops when a flag is set from outside: Ctrl-C, or another thread.
pub struct Cancel(pub Arc<AtomicBool>);

impl Stop for Cancel {
    fn check(&mut self, _: &mut dyn Method, _: &StepReport) -> Option<Verdict> {
        self.0
            .load(Ordering::Relaxed)
            .then(|| Verdict { status: Status::Cancelled, reason: "cancelled by the user".to_string() })
    }
}

/// Converged when |g| <= tol min(|g(x0)|, characteristic gradient) and, where the problem has a barrier, nothing is
/// inverted. The characteristic gradient is [`crate::Problem::characteristic_gradient`].
///
/// Below 1e-15 of the characteristic gradient |g| is rounding, and counts as 0: a start that is already a solution
/// cannot be improved on.
pub struct GradientTolerance {
    tol: f64,
    threshold: f64,
    reference: f64,
    next: usize,
}

/// |g| below this part of the characteristic gradient is rounding.
const ROUNDING: f64 = 1e-15;

/// The gradient is looked at every so many iterations while it is far from the tolerance.
const FAR: usize = 10;

/// What is left of the tolerance for the rounding of positions that are written.
const MARGIN: f64 = 0.99;

impl GradientTolerance {
    /// Takes the measure of the start.
    pub fn new(tol: f64, method: &mut dyn Method) -> Self {
        let start = method.evaluate().gradient_norm;
        let characteristic = method.problem().characteristic_gradient();
        let reference = if start.is_finite() { start.min(characteristic) } else { characteristic };
        Self::against(tol, reference, characteristic)
    }

    /// |g| <= tol reference, for a problem of this characteristic gradient.
    pub fn against(tol: f64, reference: f64, characteristic: f64) -> Self {
        let threshold = (MARGIN * tol * reference).max(ROUNDING * characteristic);
        GradientTolerance { tol, reference, threshold, next: 0 }
    }

    /// min(|g(x0)|, characteristic gradient), what the gradient is measured against.
    pub fn reference(&self) -> f64 {
        self.reference
    }

    /// |g| at which the run has converged.
    pub fn threshold(&self) -> f64 {
        self.threshold
    }
}

impl Stop for GradientTolerance {
    fn check(&mut self, method: &mut dyn Method, report: &StepReport) -> Option<Verdict> {
        if report.iteration < self.next && !method.is_evaluated() {
            return None;
        }
        let Evaluation { energy, gradient_norm } = method.evaluate();
        let far = gradient_norm > 30.0 * self.threshold;
        self.next = report.iteration + if far { FAR } else { 1 };
        let barred = method.problem().barrier && energy.inverted > 0;
        (gradient_norm <= self.threshold && !barred).then(|| Verdict {
            status: Status::Converged,
            reason: format!("gradient {gradient_norm:e} is at most {:e} (tolerance {:e})", self.threshold, self.tol),
        })
    }
}

/// Converged when |g| <= eps |l| |H(I)|_F and, where the problem has a barrier, nothing is inverted: the termination of Zhu,
/// Bridson and Kaufman 2018, section 5, see [`crate::Problem::patch_gradient`].
pub struct PatchGradient {
    eps: f64,
    threshold: f64,
}

impl PatchGradient {
    /// For a problem.
    pub fn new(eps: f64, problem: &crate::Problem) -> Self {
        PatchGradient { eps, threshold: eps * problem.patch_gradient() }
    }
}

impl Stop for PatchGradient {
    fn check(&mut self, method: &mut dyn Method, _: &StepReport) -> Option<Verdict> {
        let Evaluation { energy, gradient_norm } = method.evaluate();
        let barred = method.problem().barrier && energy.inverted > 0;
        (gradient_norm <= self.threshold && !barred).then(|| Verdict {
            status: Status::Converged,
            reason: format!(
                "gradient {gradient_norm:e} is at most {:e}, {:e} of the characteristic gradient of Zhu et al. (--patch-tol)",
                self.threshold, self.eps
            ),
        })
    }
}

/// The end of a run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// How it ended.
    pub status: Status,
    /// Why, in a sentence.
    pub reason: String,
    /// Iterations done.
    pub iterations: usize,
    /// Sum of their inner steps.
    pub inner_iterations: usize,
    /// Factorisations after the first.
    pub refactorisations: usize,
    /// Iterations whose proposed point was taken.
    pub accepted: usize,
    /// Iterations whose proposed point was refused; an accelerated method has gone on from the last image.
    pub rejected: usize,
    /// Elements whose prox missed its tolerance in the last iteration.
    pub missed: u64,
    /// The result: the last point when converged; else the last unless an earlier one had fewer inverted elements or,
    /// at equal count, lower energy.
    pub x: Vec<f64>,
    /// Its objective and how far its elements are deformed.
    pub energy: EnergyReport,
    /// Whether `x` is the last point.
    pub is_last: bool,
    /// The last report.
    pub last: StepReport,
}

/// Hard sets hold where they are violated by no more than this, in units of each set: strains for limits of stretches.
pub const VIOLATION: f64 = 1e-6;

/// The best point so far: of fewer inverted elements, then of lower energy.
struct Best {
    x: Vec<f64>,
    energy: EnergyReport,
    iteration: usize,
}

impl Best {
    /// Fewer inverted elements, or as many and no more energy; a NaN energy is never better. Where hard sets do not hold,
    /// energies cannot be compared: the later point is better unless it has more inverted elements.
    fn is_beaten_by(&self, e: &EnergyReport) -> bool {
        let hold = e.violation <= VIOLATION && self.energy.violation <= VIOLATION;
        if !hold {
            return e.value.is_finite() && e.inverted <= self.energy.inverted;
        }
        e.value.is_finite()
            && (e.inverted < self.energy.inverted
                || (e.inverted == self.energy.inverted
                    && (e.value <= self.energy.value || !self.energy.value.is_finite())))
    }
}

/// Iterates until a stop speaks. Stops are asked in their order, so put convergence first.
pub fn run(method: &mut dyn Method, stops: &mut [&mut dyn Stop], observer: &mut dyn Observer) -> Outcome {
    let mut report = StepReport { accepted: true, energy_z: f64::INFINITY, ..Default::default() };
    let mut best = Best { x: method.x().to_vec(), energy: method.energy(), iteration: 0 };
    let (mut inner, mut refactorisations, mut accepted, mut rejected) = (0, 0, 0, 0);
    let verdict = loop {
        observer.observe(method, &report);
        if let Some(verdict) = stops.iter_mut().find_map(|stop| stop.check(method, &report)) {
            break verdict;
        }
        report = match method.step() {
            Ok(report) => report,
            Err(e) => break failed(&e),
        };
        inner += report.inner;
        refactorisations += usize::from(report.refactorised);
        *(if report.took_proposal() { &mut accepted } else { &mut rejected }) += 1;
        if !vector::is_finite(method.x()) {
            break Verdict {
                status: Status::Failed,
                reason: format!("positions stopped being finite in iteration {}", report.iteration),
            };
        }
        let energy = method.energy();
        if best.is_beaten_by(&energy) {
            best.x.copy_from_slice(method.x());
            best.energy = energy;
            best.iteration = report.iteration;
        }
    };
    let is_last = verdict.status == Status::Converged || best.iteration == report.iteration;
    let (x, energy) = if is_last { (method.x().to_vec(), method.energy()) } else { (best.x, best.energy) };
    Outcome {
        status: verdict.status,
        reason: verdict.reason,
        iterations: report.iteration,
        inner_iterations: inner,
        refactorisations,
        accepted,
        rejected,
        missed: report.local.missed,
        x,
        energy,
        is_last,
        last: report,
    }
}

fn failed(e: &SystemError) -> Verdict {
    Verdict { status: Status::Failed, reason: e.to_string() }
}
