//! Nearest points and solves in turns.

use super::carrier::{Carrier, Extrapolated, Sense, check_order, of_sense};
use super::{BuildError, Merit};
use crate::{Admm, LocalReport, Order, Problem, vector};

/// x as the fixed point of the iteration of Bouaziz et al. 2012 (ShapeUp), which is the z-x-u iteration of a problem none of
/// whose terms has a dual: z nearest to Dx, then x by a solve. Judged by what both minimise,
///
/// ```text
/// f(x) + sum w^2/2 |Dx - z|^2,   z nearest to Dx
/// ```
///
/// which the local step finds and the plain iteration never raises: Peng et al. 2018. A rejected point costs a local step.
pub struct Alternation(Sense); // of x as it is

impl Alternation {
    fn free<'x>(problem: &Problem, x: &'x [f64]) -> &'x [f64] {
        &x[..problem.n_free * problem.dim]
    }
}

impl Carrier for Alternation {
    const NAME: &'static str = "alternation";
    const ORDER: Order = Order::Zxu;
    const EXTRAPOLATED: Extrapolated = Extrapolated::Positions;
    const REFUSAL: (f64, f64) = (1.0, 0.0);
    const KEEPS_HISTORY: bool = true;

    fn check(admm: &Admm) -> Result<(), BuildError> {
        check_order(admm, Self::NAME, Self::ORDER)?;
        match admm.terms().iter().position(|term| term.has_dual()) {
            Some(term) => Err(BuildError::Dual { term, algorithm: Self::NAME }),
            None => Ok(()),
        }
    }

    fn new(problem: &Problem) -> Self {
        Alternation(Sense::unweighted(problem.n_free * problem.dim))
    }

    of_sense!(0);

    fn reweigh(&mut self, _: &Problem) {}

    fn before(&mut self, problem: &mut Problem, x: &[f64], _: &[Vec<f64>], _: &[Vec<f64>]) {
        self.0.before.copy_from_slice(Self::free(problem, x));
    }

    /// Where rounding hides the fall of the objective, the last residual that is known decides: that of the cycle before.
    fn after_local(&mut self, _: &[Vec<f64>], _: &[Vec<f64>], local: &LocalReport) -> Option<Merit> {
        Some(Merit { value: local.objective, residual: vector::norm(&self.0.residual) })
    }

    fn after_global(
        &mut self,
        problem: &mut Problem,
        x: &[f64],
        _: &[Vec<f64>],
        _: &[Vec<f64>],
        _: &LocalReport,
    ) -> Option<Merit> {
        let Sense { before, residual, .. } = &mut self.0;
        vector::subtract(residual, Self::free(problem, x), before);
        None
    }
}
