//! Nesterov's momentum.

use super::{Accelerator, Iterate, Proposal};
use crate::vector;

/// Fast ADMM with restart (Goldstein, O'Donoghue, Setzer and Baraniuk 2014, Algorithm 8):
///
/// ```text
/// alpha_next = (1 + sqrt(1 + 4 alpha^2))/2,   q_next = G + (alpha - 1)/alpha_next (G - G_before) + c (G - q)
/// ```
///
/// with c = 0. A point is kept where its combined residual is below eta times the last one; else alpha = 1 and the iteration
/// goes on from the image before. With c = alpha/alpha_next it is the second method of Guler 1992, whose momentum counts
/// what the last point was off, too.
#[derive(Clone, Debug)]
pub struct Momentum {
    eta: f64,
    corrected: bool,
    alpha: f64,
    before: Vec<f64>, // the last image
    primed: bool,
}

impl Momentum {
    /// Of Goldstein et al.; their eta is 0.999.
    pub fn new(eta: f64) -> Self {
        Momentum { eta, corrected: false, alpha: 1.0, before: Vec::new(), primed: false }
    }

    /// With Guler's correction.
    #[must_use]
    pub fn corrected(mut self) -> Self {
        self.corrected = true;
        self
    }
}

impl Accelerator for Momentum {
    fn next(&mut self, at: &Iterate<'_>, out: &mut [f64]) -> Proposal {
        let next = 0.5 * (1.0 + (4.0 * self.alpha).mul_add(self.alpha, 1.0).sqrt());
        let (momentum, correction) = ((self.alpha - 1.0) / next, self.alpha / next);
        self.alpha = next;
        out.copy_from_slice(at.g);
        let mut columns = 0;
        if self.primed && momentum > 0.0 {
            vector::add_scaled(out, momentum, at.g);
            vector::add_scaled(out, -momentum, &self.before);
            columns = 1;
        }
        if self.primed && self.corrected {
            vector::add_scaled(out, correction, at.g);
            vector::add_scaled(out, -correction, at.q);
            columns = 1;
        }
        self.before.clear();
        self.before.extend_from_slice(at.g);
        self.primed = true;
        if !vector::is_finite(out) {
            self.reset();
            out.copy_from_slice(at.g);
            return Proposal::default();
        }
        Proposal { columns, rank: columns }
    }

    fn reset(&mut self) {
        self.alpha = 1.0;
        self.primed = false;
    }

    fn refused(&mut self) {
        self.reset();
    }

    fn required(&self) -> f64 {
        self.eta
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_of_nesterov() {
        let mut momentum = Momentum::new(0.999);
        let mut out = [0.0];
        let mut go = |g: f64, q: f64| {
            let at = Iterate { q: &[q], g: &[g], sensed: &[q], f: &[g - q] };
            momentum.next(&at, &mut out);
            out[0]
        };
        // alpha: 1, 1.618.., 2.193..; the first step has no momentum.
        assert_eq!(go(1.0, 0.0), 1.0);
        let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
        let third = 0.5 * (1.0 + (1.0 + 4.0 * golden * golden).sqrt());
        assert!((go(3.0, 1.0) - (3.0 + (golden - 1.0) / third * 2.0)).abs() < 1e-15);
        momentum.refused();
        let at = Iterate { q: &[3.0], g: &[4.0], sensed: &[3.0], f: &[1.0] };
        assert_eq!(momentum.next(&at, &mut out), Proposal::default());
        assert_eq!(out, [4.0]);
    }
}
