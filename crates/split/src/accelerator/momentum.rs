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
/// goes on from the image before. As published, that is the recurrence of (z, u), [`crate::CombinedResidual`]; on
/// [`crate::DouglasRachford`] it is that of v = c(Dx) + u alone, judged by the residual of v.
///
/// With c = alpha/alpha_next ([`Momentum::corrected`]) the recurrence is that of the second method of Guler 1992 for the
/// proximal point algorithm, G being its resolvent: the momentum counts what the last point was off, too.
///
/// Without restart ([`Momentum::without_restart`]) and on the dual alone it is A2DM2 (Kadkhodaie et al. 2015), for
/// strongly convex g:
///
/// ```text
/// x = argmin f(x) + 1/2 |W(Dx - zhat + uhat)|^2,   z = argmin g(z) + 1/2 |W(Dx - z + uhat)|^2,   u = uhat + Dx - z
/// uhat_next = u + (alpha - 1)/alpha_next (u - u_before),   zhat_next = argmin g(z) - <W^2 uhat_next, z>
/// ```
///
/// The last is the z that has uhat for its dual, W^2 uhat = grad g(zhat): where that is affine, z goes by the
/// coefficients of u, so that [`crate::DualAlone`] carries it.
#[derive(Clone, Debug)]
pub struct Momentum {
    eta: Option<f64>, // of the restart, where there is one
    corrected: bool,
    alpha: f64,
    before: Vec<f64>, // the last image
    primed: bool,
}

impl Momentum {
    /// Of Goldstein et al.; their eta is 0.999.
    pub fn new(eta: f64) -> Self {
        Momentum { eta: Some(eta), corrected: false, alpha: 1.0, before: Vec::new(), primed: false }
    }

    /// Every point is kept.
    #[must_use]
    pub fn without_restart(mut self) -> Self {
        self.eta = None;
        self
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
        // Any finite merit is below that.
        self.eta.unwrap_or(f64::INFINITY)
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

    /// The second method of Guler 1992, written out from its estimate sequence: with y the proposals, x their images,
    /// v the minimisers of the estimates, sigma = 1/alpha_next: v += 2 alpha (x - y), y_next = (1 - sigma) x + sigma v.
    #[test]
    fn the_correction_is_that_of_an_estimate_sequence() {
        // A resolvent of a monotone linear operator in the plane: rotation and scaling, so that nothing is aligned.
        let image = |q: [f64; 2]| [0.7 * q[0] - 0.2 * q[1] + 1.0, 0.3 * q[0] + 0.6 * q[1] - 2.0];
        let mut momentum = Momentum::new(0.999).corrected();
        let mut q = [3.0, -1.0];
        let (mut y, mut v, mut alpha) = (q, q, 1.0_f64);
        for k in 0..60 {
            let (g, x) = (image(q), image(y));
            let f = [g[0] - q[0], g[1] - q[1]];
            let mut out = [0.0; 2];
            momentum.next(&Iterate { q: &q, g: &g, sensed: &q, f: &f }, &mut out);
            // The first call has no momentum, and no correction either: the sequence begins at its image.
            if k == 0 {
                (y, v) = (x, x);
            } else {
                v = [0, 1].map(|d| v[d] + 2.0 * alpha * (x[d] - y[d]));
                let sigma = 2.0 / (1.0 + (1.0 + 4.0 * alpha * alpha).sqrt());
                y = [0, 1].map(|d| (1.0 - sigma) * x[d] + sigma * v[d]);
            }
            alpha = 0.5 * (1.0 + (1.0 + 4.0 * alpha * alpha).sqrt());
            q = out;
            assert!((q[0] - y[0]).abs() + (q[1] - y[1]).abs() < 1e-10, "{k}: {q:?} {y:?}");
        }
    }
}
