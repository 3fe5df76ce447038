//! Both variables: A, Algorithms 1 and 2.

use super::carrier::{
    COUPLE, Carrier, Extrapolated, Sense, check_order, check_sets, coupled, departure, of_sense, scaled,
};
use super::{BuildError, Merit};
use crate::{Admm, LocalReport, Order, Problem};

/// A, Algorithm 1: (z, u) as the fixed point of the x-z-u iteration and r = |W(c(Dx) - z)|^2 + |W(z - z_before)|^2 as its
/// merit: A(11) with mu = 1 and the weights in W. Since c(Dx) - z is the change of u, r is the square of the fixed-point
/// residual in the metric W, and is known before the global step: a rejected point costs a local step only. Positions ride
/// along: where the global step is affine in p they are extrapolated exactly.
pub struct CombinedResidual(Sense); // of (z, u)

impl Carrier for CombinedResidual {
    const NAME: &'static str = "algorithm 1";
    const ORDER: Order = Order::Xzu;
    const EXTRAPOLATED: Extrapolated = Extrapolated::All;
    const REFUSAL: (f64, f64) = (1.0, 0.0);
    const KEEPS_HISTORY: bool = false;

    fn check(admm: &Admm) -> Result<(), BuildError> {
        check_order(admm, Self::NAME, Self::ORDER)?;
        check_sets(admm, Self::NAME)
    }

    fn new(problem: &Problem) -> Self {
        CombinedResidual(Sense::new(problem, 2))
    }

    of_sense!(0);

    fn before(&mut self, _: &mut Problem, _: &[f64], p: &[Vec<f64>], u: &[Vec<f64>]) {
        let Sense { weights, before, .. } = &mut self.0;
        let (z, dual) = before.split_at_mut(weights.len());
        scaled(z, weights, p, u, |p, u| p + u);
        scaled(dual, weights, p, u, |_, u| u);
    }

    fn after_local(&mut self, p: &[Vec<f64>], u: &[Vec<f64>], _: &LocalReport) -> Option<Merit> {
        let Sense { weights, before, residual } = &mut self.0;
        let ((z, dual), (z_before, dual_before)) =
            (residual.split_at_mut(weights.len()), before.split_at(weights.len()));
        let square = departure(z, z_before, weights, p, u, |p, u| p + u);
        Some(Merit::of_square(square + departure(dual, dual_before, weights, p, u, |_, u| u)))
    }
}

/// A, Algorithm 2: (x, u) as the fixed point of the z-x-u iteration and r = |W(c(Dx) - z)|^2 + |W(c(Dx) - c(Dx_before))|^2
/// as its merit, A(12). x is sensed by c(Dx), in the metric of the splitting; r is then the square of the fixed-point
/// residual. Hard sets are on z, which is updated first, so that they hold for every z whatever is proposed.
pub struct CombinedResidualZxu {
    sense: Sense, // of (c(Dx), u)
    coupled: Vec<Vec<f64>>,
}

impl CombinedResidualZxu {
    fn couple(&mut self, problem: &mut Problem, x: &[f64]) {
        for (term, coupled) in problem.terms.iter_mut().zip(&mut self.coupled) {
            term.couple(x, coupled);
        }
    }
}

impl Carrier for CombinedResidualZxu {
    const NAME: &'static str = "algorithm 2";
    const ORDER: Order = Order::Zxu;
    const EXTRAPOLATED: Extrapolated = Extrapolated::PositionsAndDual;
    const LATE: bool = true;
    const SENSING: f64 = 2.0 * COUPLE;
    const REFUSAL: (f64, f64) = (1.0 + COUPLE, 1.0);
    const KEEPS_HISTORY: bool = false;

    fn check(admm: &Admm) -> Result<(), BuildError> {
        check_order(admm, Self::NAME, Self::ORDER)
    }

    fn new(problem: &Problem) -> Self {
        CombinedResidualZxu { sense: Sense::new(problem, 2), coupled: coupled(problem) }
    }

    of_sense!(sense);

    fn before(&mut self, problem: &mut Problem, x: &[f64], _: &[Vec<f64>], u: &[Vec<f64>]) {
        self.couple(problem, x);
        let Sense { weights, before, .. } = &mut self.sense;
        let (positions, dual) = before.split_at_mut(weights.len());
        scaled(positions, weights, &self.coupled, u, |c, _| c);
        scaled(dual, weights, &self.coupled, u, |_, u| u);
    }

    fn after_global(
        &mut self,
        problem: &mut Problem,
        x: &[f64],
        _: &[Vec<f64>],
        u: &[Vec<f64>],
        _: &LocalReport,
    ) -> Option<Merit> {
        self.couple(problem, x);
        let Sense { weights, before, residual } = &mut self.sense;
        let ((positions, dual), (positions_before, dual_before)) =
            (residual.split_at_mut(weights.len()), before.split_at(weights.len()));
        let square = departure(positions, positions_before, weights, &self.coupled, u, |c, _| c);
        Some(Merit::of_square(square + departure(dual, dual_before, weights, &self.coupled, u, |_, u| u)))
    }
}
