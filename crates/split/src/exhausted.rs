//! Convergence where rounding, not the method, decides how small a gradient can get.

use crate::{Evaluation, Method, Status, StepReport, Stop, Verdict};

/// A minimum to rounding: the true Hessian is positive definite, a full step of Newton's method is foretold to lower the
/// energy by less than its own rounding, and the step no longer lowers the gradient.
///
/// Elements that are needles at rest have stiffnesses 1 / aspect^2 times those of others: rounding of their corners, one
/// part in 10^16, then gives a gradient that no further step can lower, and that can be above a tolerance relative to the
/// start or to well-shaped elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exhausted {
    /// What the quadratic model foretold that the step would gain.
    pub foretold: f64,
    /// What of the energy may be rounding: [`Exhausted::PART`] of it and of the energy of strains of about one
    /// ([`crate::Scale::energy`]).
    pub rounding: f64,
}

impl Exhausted {
    /// Part of an energy that is rounding: a sum of as many terms as meshes have elements keeps 14 of 16 digits.
    pub const PART: f64 = 1e-14;
    /// A step that leaves more than this part of the gradient does not lower it: Newton's leave its square.
    pub const LEFT: f64 = 0.5;
}

/// Converged where the method says that its point is a minimum to rounding and, where the problem has a barrier, nothing is
/// inverted. To be asked after a tolerance of the gradient.
#[derive(Clone, Copy, Debug, Default)]
pub struct RoundingReached;

impl Stop for RoundingReached {
    fn check(&mut self, method: &mut dyn Method, _: &StepReport) -> Option<Verdict> {
        let Exhausted { foretold, rounding } = method.exhausted()?;
        let Evaluation { energy, gradient_norm } = method.evaluate();
        let barred = method.problem().barrier && energy.inverted > 0;
        (!barred).then(|| Verdict {
            status: Status::Converged,
            reason: format!(
                "gradient {gradient_norm:e} is rounding: the Hessian is positive definite, and Newton's step would lower \
                 the energy by {foretold:e}, of which {rounding:e} is rounding"
            ),
        })
    }
}
