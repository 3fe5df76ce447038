//! Convergence of problems with hard sets.

use crate::{Method, Residuals, Status, StepReport, Stop, VIOLATION, Verdict};

/// Converged when primal and dual residual, A(27), are both at most `tol`, hard sets hold to [`VIOLATION`] and, where the
/// problem has a barrier, nothing is inverted.
///
/// For problems with hard sets ([`crate::Problem::has_hard_sets`]): at a solution on the border of a set the gradient of
/// the objective is balanced by the set's normal, and says nothing.
pub struct ResidualTolerance {
    tol: f64,
    next: usize,
}

/// Residuals are looked at every so many iterations while they are far from the tolerance.
const FAR: usize = 10;

impl ResidualTolerance {
    /// Relative tolerance of both residuals.
    pub fn new(tol: f64) -> Self {
        ResidualTolerance { tol, next: 1 }
    }
}

impl Stop for ResidualTolerance {
    fn check(&mut self, method: &mut dyn Method, report: &StepReport) -> Option<Verdict> {
        if report.iteration < self.next {
            return None;
        }
        let Residuals { primal, dual } = method.residuals();
        let near = primal <= 30.0 * self.tol && dual <= 30.0 * self.tol;
        self.next = report.iteration + if near { 1 } else { FAR };
        let small = primal <= self.tol && dual <= self.tol;
        if !small {
            return None;
        }
        let energy = method.energy();
        let barred = method.problem().barrier && energy.inverted > 0;
        (energy.violation <= VIOLATION && !barred).then(|| Verdict {
            status: Status::Converged,
            reason: format!(
                "primal residual {primal:e} and dual residual {dual:e} are at most {:e}; hard limits hold to {:e}",
                self.tol, energy.violation
            ),
        })
    }
}
