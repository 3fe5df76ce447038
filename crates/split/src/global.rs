//! Global steps: how the positions follow the local variables.

use crate::{NormalMatrix, PenaltyReport, Problem, SystemError};

/// The objective of the global step, W(11): f(x) + 1/2 sum w^2 |c(Dx) - p|^2 with p = z - u held fixed.
pub struct Objective<'a> {
    /// The problem, for its terms and f.
    pub problem: &'a mut Problem,
    /// Local variables, one vector a term.
    pub z: &'a [Vec<f64>],
    /// Scaled duals, likewise.
    pub u: &'a [Vec<f64>],
}

impl Objective<'_> {
    /// Value and gradient at x, which may have changed since the last call.
    pub fn moved_to(&mut self, x: &[f64], grad: &mut [f64]) -> PenaltyReport {
        self.problem.moved();
        self.problem.penalty(x, self.z, self.u, grad)
    }

    /// Value and gradient at the x that the terms have seen last.
    pub fn here(&mut self, x: &[f64], grad: &mut [f64]) -> PenaltyReport {
        self.problem.penalty(x, self.z, self.u, grad)
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
    /// The objective at the new x.
    pub penalty: PenaltyReport,
}

/// Moves x towards the minimum of the [`Objective`].
pub trait GlobalStep: Send {
    /// `local_change` is |Delta L| of the local step before it, W(17).
    ///
    /// # Errors
    /// A system that cannot be solved.
    fn run(
        &mut self,
        objective: &mut Objective<'_>,
        normal: &mut NormalMatrix,
        x: &mut [f64],
        local_change: f64,
    ) -> Result<GlobalReport, SystemError>;

    /// The weights have changed: forget what was learnt under the old ones.
    fn reset(&mut self);
}

/// One solve with the prefactored matrix, x <- x - A^-1 gradient: the exact minimiser where c is the identity, W(5).
#[derive(Default)]
pub struct Direct {
    g: Vec<f64>, // gradient, n_free * dim
}

impl Direct {
    /// A direct global step.
    pub fn new() -> Self {
        Direct::default()
    }
}

impl GlobalStep for Direct {
    fn run(&mut self, objective: &mut Objective<'_>, normal: &mut NormalMatrix, x: &mut [f64], _local_change: f64) -> Result<GlobalReport, SystemError> {
        self.g.resize(objective.problem.n_free * objective.problem.dim, 0.0);
        let before = objective.here(x, &mut self.g);
        normal.solve(&mut self.g)?;
        crate::vector::add_scaled(&mut x[..self.g.len()], -1.0, &self.g);
        objective.problem.moved();
        Ok(GlobalReport { inner: 1, solves: 1, shortened: 0, penalty: before })
    }

    fn reset(&mut self) {}
}
