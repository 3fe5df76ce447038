//! The combined residual of ADMM.

use super::{Acceleration, CHUNK, Merit};
use crate::{LocalReport, Problem, vector};
use rayon::prelude::*;

/// (z, u) as the fixed point of the x-z-u iteration and r = |W(c(Dx) - z)|^2 + |W(z - z_before)|^2 as its merit: A(11) with
/// mu = 1 and the weights in W. Since c(Dx) - z is the change of u, r is the square of the fixed-point residual in the
/// metric W, and is known before the global step: a rejected point costs a local step only.
pub struct CombinedResidual {
    weights: Vec<f64>,  // w, an entry for each of z
    residual: Vec<f64>, // W (change of z, change of u)
}

impl Acceleration for CombinedResidual {
    const CARRIES_Z: bool = true;
    const KEEPS_HISTORY: bool = false;

    fn new(problem: &Problem) -> Self {
        let weights = super::packed_weights(problem);
        CombinedResidual { residual: vec![0.0; 2 * weights.len()], weights }
    }

    fn reweighted(&mut self, problem: &Problem) {
        self.weights = super::packed_weights(problem);
    }

    /// residual <- (z, u)
    fn before(&mut self, p: &[Vec<f64>], u: &[Vec<f64>]) {
        let (mut z_to, mut u_to) = self.residual.split_at_mut(self.weights.len());
        for (p, u) in p.iter().zip(u) {
            let (z_head, z_tail) = z_to.split_at_mut(p.len());
            let (u_head, u_tail) = u_to.split_at_mut(p.len());
            let to = z_head.par_iter_mut().zip(u_head);
            to.zip(p.par_iter().zip(u)).with_min_len(CHUNK).for_each(|((z, u_to), (p, u))| {
                *z = p + u;
                *u_to = *u;
            });
            (z_to, u_to) = (z_tail, u_tail);
        }
    }

    /// residual <- W ((z, u) - residual)
    fn after_local(&mut self, p: &[Vec<f64>], u: &[Vec<f64>], _: &LocalReport) -> Option<Merit> {
        let (mut z_to, mut u_to) = self.residual.split_at_mut(self.weights.len());
        let mut weights = self.weights.as_slice();
        for (p, u) in p.iter().zip(u) {
            let (z_head, z_tail) = z_to.split_at_mut(p.len());
            let (u_head, u_tail) = u_to.split_at_mut(p.len());
            let (w_head, w_tail) = weights.split_at(p.len());
            let to = z_head.par_iter_mut().zip(u_head).zip(w_head);
            to.zip(p.par_iter().zip(u)).with_min_len(CHUNK).for_each(|(((z, u_to), w), (p, u))| {
                *z = w * (p + u - *z);
                *u_to = w * (u - *u_to);
            });
            (z_to, u_to, weights) = (z_tail, u_tail, w_tail);
        }
        let value = vector::dot(&self.residual, &self.residual);
        Some(Merit { value, residual: value.sqrt() })
    }

    fn after_global(&mut self, _: &mut Problem, _: &[f64], _: &[Vec<f64>], _: &[Vec<f64>], _: &LocalReport) -> Merit {
        let value = vector::dot(&self.residual, &self.residual);
        Merit { value, residual: value.sqrt() }
    }

    fn residual(&self) -> &[f64] {
        &self.residual
    }
}
