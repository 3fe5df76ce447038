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
    /// Whether a point was taken: x has moved on.
    pub accepted: bool,
    /// sum g(z), the energy of the local variable; infinite where the method has none.
    pub energy_z: f64,
    /// What a safeguard judged the proposed iterate by; none where there is no safeguard.
    pub merit: Option<f64>,
    /// What an accelerator tried.
    pub trial: Trial,
    /// What the local step did; nothing of it is known of an iteration that is one pass over the nodes.
    pub local: LocalReport,
}

impl StepReport {
    /// Whether the first point that the iteration proposed was taken.
    pub fn took_proposal(&self) -> bool {
        self.accepted && self.trial.rejected == 0
    }
}

/// What an accelerator did in one iteration; nothing where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Trial {
    /// Whether the point that was taken is an accelerated one.
    pub accelerated: bool,
    /// Accelerated points that the safeguard refused before: each has cost what its merit needs.
    pub rejected: usize,
    /// Whether the history was dropped.
    pub reset: bool,
    /// Differences that the accelerated point was made of.
    pub columns: usize,
    /// How many of them were independent to rounding.
    pub rank: usize,
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

/// The residuals of A as squares, |W ..|^2 with the penalty in the weights; [`normalized`] makes those of A(27) of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquaredResiduals {
    /// The forward residual. x-z-u: |W(c(Dx) - z)|^2 of x and the z that it follows, A(22). z-x-u: of the last z and the x
    /// that it follows, A(24): the point that the last iteration began with.
    pub forward: f64,
    /// The combined residual of the last iteration. x-z-u: |W(c(Dx) - z)|^2 + |W(z - z_before)|^2 of its local step, A(11).
    /// z-x-u: |W(c(Dx) - z)|^2 + |W(c(Dx) - c(Dx_before))|^2, A(12).
    pub combined: f64,
}

/// sqrt(r / (N_z a^2)), A(27), of a squared residual r: N_z = [`Problem::local_dim`], a the typical size of the variables,
/// for meshes the mean edge of the body at rest.
pub fn normalized(square: f64, local_dim: usize, a: f64) -> f64 {
    (square / local_dim.max(1) as f64).sqrt() / a
}

/// A point of a splitting: z = p + u and w^2 u, the force of each term, are those of the last local step, x that of the last
/// global one. Where g is known by its prox, w^2 u is a subgradient of g at z, in the x-z-u order without extrapolation to
/// come.
pub struct Splitting<'a> {
    /// The problem, whose terms work things out.
    pub problem: &'a mut Problem,
    /// Positions.
    pub x: &'a [f64],
    /// z - u, one vector a term.
    pub p: &'a [Vec<f64>],
    /// Scaled duals, likewise.
    pub u: &'a [Vec<f64>],
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

    /// sum w^2 |c(Dx) - z|^2 at the end of a step: in the x-z-u order the square of the forward residual A(22), in the z-x-u
    /// order that of the primal residual. [`crate::normalized`] makes the R_f of A(27) of it. None where there is no z.
    fn forward_residual(&mut self) -> Option<f64> {
        None
    }

    /// Both residuals of A after a step, worked out when asked for. None where there is no z, and before the first step.
    fn squared_residuals(&mut self) -> Option<SquaredResiduals> {
        None
    }

    /// The point of the splitting as it is, for certificates and pictures; none for methods that split nothing.
    fn splitting(&mut self) -> Option<Splitting<'_>> {
        None
    }

    /// Begins a problem that differs from the one before in its start x and in what `change` does, which must leave the
    /// normal matrix as it is: targets, loads, right-hand sides, sets that have moved, terms made anew. The next step in time
    /// is one. z = c(Dx); u is kept, or 0. Histories are dropped, and iterations are counted from 0. Where weights or the
    /// stiffness of inertia do change, [`Method::refactor`] is to follow.
    ///
    /// # Errors
    /// A method that cannot, a start that does not fit.
    fn begin(&mut self, x: &[f64], keeps_duals: bool, change: &mut dyn FnMut(&mut Problem)) -> Result<(), SystemError> {
        let _ = (x, keeps_duals, change);
        Err(SystemError::Stalled(format!("{} cannot begin another problem on its matrices", self.name())))
    }

    /// New numbers in the normal matrix, after a [`Method::begin`] whose change it shows in. Its analysis stays.
    ///
    /// # Errors
    /// A method that cannot, a singular system.
    fn refactor(&mut self) -> Result<(), SystemError> {
        Err(SystemError::Stalled(format!("{} cannot take new weights", self.name())))
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
