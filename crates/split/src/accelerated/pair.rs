//! Both variables: A, Algorithms 1 and 2.

use super::carrier::{Carrier, Extrapolated, check_order, check_sets, packed_weights, scaled, subtract};
use super::{BuildError, Merit};
use crate::{Admm, LocalReport, Order, Problem, vector};

/// A, Algorithm 1: (z, u) as the fixed point of the x-z-u iteration and r = |W(c(Dx) - z)|^2 + |W(z - z_before)|^2 as its
/// merit: A(11) with mu = 1 and the weights in W. Since c(Dx) - z is the change of u, r is the square of the fixed-point
/// residual in the metric W, and is known before the global step: a rejected point costs a local step only. Positions ride
/// along: where the global step is affine in p they are extrapolated exactly.
pub struct CombinedResidual {
    weights: Vec<f64>,  // w, an entry for each of z
    sensed: Vec<f64>,   // W (z, u) before
    residual: Vec<f64>, // W (change of z, change of u)
}

impl Carrier for CombinedResidual {
    const NAME: &'static str = "algorithm 1";
    const ORDER: Order = Order::Xzu;
    const EXTRAPOLATED: Extrapolated = Extrapolated::All;
    const KEEPS_HISTORY: bool = false;

    fn check(admm: &Admm) -> Result<(), BuildError> {
        check_order(admm, Self::NAME, Self::ORDER)?;
        check_sets(admm, Self::NAME)
    }

    fn new(problem: &Problem) -> Self {
        let weights = packed_weights(problem);
        let zeros = vec![0.0; 2 * weights.len()];
        CombinedResidual { residual: zeros.clone(), sensed: zeros, weights }
    }

    fn reweighted(&mut self, problem: &Problem) {
        self.weights = packed_weights(problem);
    }

    fn before(&mut self, _: &mut Problem, _: &[f64], p: &[Vec<f64>], u: &[Vec<f64>]) {
        let (z, dual) = self.sensed.split_at_mut(self.weights.len());
        scaled(z, &self.weights, p, u, |p, u| p + u);
        scaled(dual, &self.weights, p, u, |_, u| u);
    }

    fn after_local(&mut self, p: &[Vec<f64>], u: &[Vec<f64>], _: &LocalReport) -> Option<Merit> {
        let (z, dual) = self.residual.split_at_mut(self.weights.len());
        scaled(z, &self.weights, p, u, |p, u| p + u);
        scaled(dual, &self.weights, p, u, |_, u| u);
        subtract(&mut self.residual, &self.sensed);
        Some(Merit::of_square(vector::dot(&self.residual, &self.residual)))
    }

    fn after_global(
        &mut self,
        _: &mut Problem,
        _: &[f64],
        _: &[Vec<f64>],
        _: &[Vec<f64>],
        _: &LocalReport,
    ) -> Option<Merit> {
        None
    }

    fn sensed(&self) -> &[f64] {
        &self.sensed
    }

    fn residual(&self) -> &[f64] {
        &self.residual
    }
}

/// A, Algorithm 2: (x, u) as the fixed point of the z-x-u iteration and r = |W(c(Dx) - z)|^2 + |W(c(Dx) - c(Dx_before))|^2
/// as its merit, A(12). x is sensed by c(Dx), in the metric of the splitting; r is then the square of the fixed-point
/// residual. Hard sets are on z, which is updated first, so that they hold for every z whatever is proposed.
pub struct CombinedResidualZxu {
    weights: Vec<f64>,
    sensed: Vec<f64>,   // W (c(Dx), u) before
    residual: Vec<f64>, // W (change of c(Dx), change of u)
    coupled: Vec<Vec<f64>>,
}

impl CombinedResidualZxu {
    /// W (c(Dx), u)
    fn sense(
        coupled: &mut [Vec<f64>],
        weights: &[f64],
        problem: &mut Problem,
        x: &[f64],
        u: &[Vec<f64>],
        out: &mut [f64],
    ) {
        for (term, coupled) in problem.terms.iter_mut().zip(coupled.iter_mut()) {
            term.couple(x, coupled);
        }
        let (positions, dual) = out.split_at_mut(weights.len());
        scaled(positions, weights, coupled, u, |c, _| c);
        scaled(dual, weights, coupled, u, |_, u| u);
    }
}

impl Carrier for CombinedResidualZxu {
    const NAME: &'static str = "algorithm 2";
    const ORDER: Order = Order::Zxu;
    const EXTRAPOLATED: Extrapolated = Extrapolated::PositionsAndDual;
    const LATE: bool = true;
    const KEEPS_HISTORY: bool = false;

    fn check(admm: &Admm) -> Result<(), BuildError> {
        check_order(admm, Self::NAME, Self::ORDER)
    }

    fn new(problem: &Problem) -> Self {
        let weights = packed_weights(problem);
        let zeros = vec![0.0; 2 * weights.len()];
        let coupled = problem.terms.iter().map(|term| vec![0.0; term.local_len()]).collect();
        CombinedResidualZxu { residual: zeros.clone(), sensed: zeros, weights, coupled }
    }

    fn reweighted(&mut self, problem: &Problem) {
        self.weights = packed_weights(problem);
    }

    fn before(&mut self, problem: &mut Problem, x: &[f64], _: &[Vec<f64>], u: &[Vec<f64>]) {
        Self::sense(&mut self.coupled, &self.weights, problem, x, u, &mut self.sensed);
    }

    fn after_local(&mut self, _: &[Vec<f64>], _: &[Vec<f64>], _: &LocalReport) -> Option<Merit> {
        None
    }

    fn after_global(
        &mut self,
        problem: &mut Problem,
        x: &[f64],
        _: &[Vec<f64>],
        u: &[Vec<f64>],
        _: &LocalReport,
    ) -> Option<Merit> {
        Self::sense(&mut self.coupled, &self.weights, problem, x, u, &mut self.residual);
        subtract(&mut self.residual, &self.sensed);
        Some(Merit::of_square(vector::dot(&self.residual, &self.residual)))
    }

    fn sensed(&self) -> &[f64] {
        &self.sensed
    }

    fn residual(&self) -> &[f64] {
        &self.residual
    }
}
