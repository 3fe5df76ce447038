//! What every method has in common.

use crate::{EnergyReport, Exhausted, LocalReport, Problem, SystemError};

/// What one iteration did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Number of iterations done, this one included.
    pub iteration: usize,
    /// Inner steps of the global step.
    pub inner: usize,
    /// Whether weights were changed and the system factored anew.
    pub refactorised: bool,
    /// Whether the proposed iterate was taken.
    pub accepted: bool,
    /// sum g(z), the energy of the local variable; infinite where the method has none.
    pub energy_z: f64,
    /// What a safeguard judged the proposed iterate by; none where there is no safeguard.
    pub merit: Option<f64>,
    /// What the local step did.
    pub local: LocalReport,
}

/// Objective and gradient at the current x.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evaluation {
    /// The objective and the deformation of the elements.
    pub energy: EnergyReport,
    /// Norm of the gradient over the free nodes.
    pub gradient_norm: f64,
}

/// How far the constraints of a splitting are from holding, A(27) in the scaled local space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residuals {
    /// |W(c(Dx) - z)| / |W z|; infinite where the method has no z.
    pub primal: f64,
    /// |W(z - z_before)| / |W z|; infinite before the first iteration too.
    pub dual: f64,
}

/// An algorithm in motion. It never stops by itself: [`crate::run`] asks its [`crate::Stop`]s.
pub trait Method: Send {
    /// Its name, as users give it.
    fn name(&self) -> &str;

    /// One iteration.
    ///
    /// # Errors
    /// A system that cannot be factored, or a method that finds no way on; x is then as before.
    fn step(&mut self) -> Result<StepReport, SystemError>;

    /// Positions, `dim` numbers a node.
    fn x(&self) -> &[f64];

    /// The problem that is being solved.
    fn problem(&self) -> &Problem;

    /// Objective at x, without its gradient. Worked out once for an x.
    fn energy(&mut self) -> EnergyReport;

    /// Objective and gradient at x. Worked out once for an x.
    fn evaluate(&mut self) -> Evaluation;

    /// Whether [`Method::evaluate`] costs no more than a step does anyway, so that stops may ask for it at every iteration.
    fn is_evaluated(&self) -> bool {
        false
    }

    /// Whether the point after the last step is a minimum to rounding; none for methods that cannot tell.
    fn exhausted(&self) -> Option<Exhausted> {
        None
    }

    /// Bytes of factors, workspace included.
    fn factor_bytes(&self) -> u64;

    /// Gives the problem back, for another method to go on or for a last look at the energy.
    fn into_problem(self: Box<Self>) -> Problem;

    /// How far the constraints are from holding; worked out when asked for.
    fn residuals(&mut self) -> Residuals {
        Residuals { primal: f64::INFINITY, dual: f64::INFINITY }
    }

    /// The gradient of f(x) + 1/2 sum w^2 |c(Dx) - p|^2 over all nodes, fixed ones included: where z has converged, that of
    /// the objective with the forces w^2 u of hard sets. `None` where the method splits nothing.
    fn forces(&mut self) -> Option<Vec<f64>> {
        None
    }

    /// The part of [`Method::forces`] that stems from one term.
    fn forces_of_term(&mut self, term: usize) -> Option<Vec<f64>> {
        let _ = term;
        None
    }
}
