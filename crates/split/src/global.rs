//! Global steps: how the positions follow the local variables.

use crate::{EnergyReport, Intake, NormalMatrix, PenaltyReport, Precision, Problem, SystemError};

/// The objective of the global step, W(11): f(x) + 1/2 sum w^2 |c(Dx) - p|^2 with p = z - u held fixed.
pub struct Objective<'a> {
    /// The problem, for its terms and f.
    pub problem: &'a mut Problem,
    /// What the coupled values are to match, one vector a term.
    pub p: &'a [Vec<f64>],
    /// Its value where the step begins.
    pub value: f64,
    /// |Delta L| of the local step, W(17).
    pub local_change: f64,
    /// The term whose pull went to [`GlobalStep::intake`], and is not in `grad`.
    pub fed: Option<usize>,
}

impl Objective<'_> {
    /// Value and gradient at x.
    pub fn at(&mut self, x: &[f64], grad: &mut [f64]) -> PenaltyReport {
        self.problem.penalty(x, self.p, grad)
    }
}

/// What a global step did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GlobalReport {
    /// Inner steps taken.
    pub inner: usize,
    /// Solves with the normal matrix.
    pub solves: usize,
    /// Inner steps that had to be shortened or restarted.
    pub shortened: usize,
    /// Energy at the new x, where it is known.
    pub energy: Option<EnergyReport>,
    /// f at the new x, where it comes for next to nothing.
    pub quadratic: Option<f64>,
}

/// What a global step wants to be told of p = z - u.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pull {
    /// The gradient of the [`Objective`] where the step begins, f included: D^T W^2 (Dx - p) + grad f(x) for linear couplings.
    #[default]
    AtPoint,
    /// The gradient of the penalty at x = 0, that is -D^T W^2 p, and nothing of f: all that a step needs which knows f and
    /// sum w^2 D^T D itself, and finds the minimiser without looking at x. For linear couplings.
    AtOrigin,
}

/// Moves x towards the minimum of the [`Objective`].
pub trait GlobalStep: Send {
    /// `grad` holds what [`GlobalStep::pull`] asks for when the step begins, and is scratch after. `normal` is that of
    /// [`NormalMatrix::none`] where [`GlobalStep::precision`] asks for no factor.
    ///
    /// # Errors
    /// A system that cannot be solved.
    fn run(
        &mut self,
        objective: &mut Objective<'_>,
        normal: &mut NormalMatrix,
        x: &mut [f64],
        grad: &mut Vec<f64>,
    ) -> Result<GlobalReport, SystemError>;

    /// The precision that the factor of the normal matrix needs; none where the step has no use for the matrix, which is
    /// then never assembled.
    fn precision(&self) -> Option<Precision> {
        Some(Precision::Double)
    }

    /// What `grad` holds when the step begins.
    fn pull(&self) -> Pull {
        Pull::AtPoint
    }

    /// Takes the pull of a term in the place of `grad`, for the next run, which is told so by [`Objective::fed`]. None where the
    /// nodes of the term are another's too, and where it asks for more than [`Pull::AtOrigin`].
    fn intake(&mut self, term: usize) -> Option<&mut dyn Intake> {
        let _ = term;
        None
    }

    /// What a run costs beside solves with the normal matrix, in nanoseconds of a core: an estimate by which an acceleration
    /// is weighed against plain iterations.
    fn work(&self) -> f64 {
        0.0
    }

    /// Whether it ends at the minimiser for linear couplings, whatever x it starts from.
    fn is_exact(&self) -> bool {
        false
    }

    /// Whether it is x <- x - A^-1 gradient and nothing else, A the normal matrix.
    fn is_solve(&self) -> bool {
        false
    }

    /// The weights have changed: forget what was learnt under the old ones.
    fn reset(&mut self);

    /// Takes the weights of the problem as they are: before the first step, and after they have changed. For a step that has
    /// an operator of its own in place of the normal matrix.
    ///
    /// # Errors
    /// An operator that cannot be inverted.
    fn weigh(&mut self, problem: &Problem) -> Result<(), SystemError> {
        let _ = problem;
        Ok(())
    }
}

/// One solve with the prefactored matrix, x <- x - A^-1 gradient: the exact minimiser where c is the identity, W(5).
#[derive(Clone, Copy, Debug, Default)]
pub struct Direct;

impl GlobalStep for Direct {
    fn run(
        &mut self,
        _objective: &mut Objective<'_>,
        normal: &mut NormalMatrix,
        x: &mut [f64],
        grad: &mut Vec<f64>,
    ) -> Result<GlobalReport, SystemError> {
        normal.solve(grad)?;
        crate::vector::add_scaled(&mut x[..grad.len()], -1.0, grad);
        Ok(GlobalReport { inner: 1, solves: 1, ..GlobalReport::default() })
    }

    fn is_exact(&self) -> bool {
        true
    }

    fn is_solve(&self) -> bool {
        true
    }

    fn reset(&mut self) {}
}
