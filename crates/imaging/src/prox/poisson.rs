//! Counted light.

use super::{Observed, Pointwise};
use std::ops::Range;

/// g(z) = sum lambda_k (z_k - f_k log z_k) less its least value, z_k >= 0: the divergence of Kullback and Leibler.
///
/// ```text
/// lambda (z - f + f log(f / z))        f > 0: +inf for z <= 0
/// lambda z                             f = 0: a half-line, z >= 0
/// ```
///
/// The negative logarithm of the likelihood of counts f / gain whose mean is z / gain, for lambda = 1 / gain. Convex. Nothing is
/// asked of z where lambda_k is 0.
#[derive(Clone, Debug)]
pub struct Poisson {
    /// f >= 0
    pub observed: Observed,
    /// lambda_k
    pub lambda: Observed,
    /// Their largest.
    pub most: f64,
}

/// z - f + f log(f/z), without what is infinite beyond z >= 0 where f is 0.
fn divergence(z: f64, f: f64) -> f64 {
    if f > 0.0 {
        // f (t - log(1 + t)) with t = z/f - 1, which does not cancel near z = f.
        let t = (z - f) / f;
        if t > -1.0 { f * (t - t.ln_1p()) } else { f64::INFINITY }
    } else {
        z.max(0.0)
    }
}

impl Pointwise for Poisson {
    /// The positive root of w^2 z^2 + (lambda - w^2 v) z - lambda f.
    fn prox(&self, pixels: Range<usize>, v: &mut [f64], weight2: f64) -> f64 {
        let mut value = 0.0;
        for ((v, f), l) in v.iter_mut().zip(self.observed.of(&pixels)).zip(self.lambda.of(&pixels)) {
            if *l > 0.0 {
                let (a, c) = (*v - l / weight2, 4.0 * l * f / weight2);
                let root = (a * a + c).sqrt();
                // The form of the two that does not cancel; 0 where a <= 0 and f = 0.
                *v = if a > 0.0 { 0.5 * (a + root) } else { 0.5 * c / (root - a).max(f64::MIN_POSITIVE) };
                value += l * divergence(*v, *f);
            }
        }
        value
    }

    fn value(&self, pixels: Range<usize>, z: &[f64]) -> f64 {
        let pairs = z.iter().zip(self.observed.of(&pixels)).zip(self.lambda.of(&pixels)).filter(|(_, l)| **l > 0.0);
        pairs.map(|((z, f), l)| l * divergence(*z, *f)).sum()
    }

    /// lambda (1 - f/z); 0 in place of what has no gradient.
    fn gradient(&self, pixels: Range<usize>, z: &mut [f64]) {
        for ((z, f), l) in z.iter_mut().zip(self.observed.of(&pixels)).zip(self.lambda.of(&pixels)) {
            let slope = if *z > 0.0 { 1.0 - f / *z } else { 0.0 };
            *z = l * slope;
        }
    }

    fn violation(&self, pixels: Range<usize>, z: &[f64]) -> f64 {
        let pairs = z.iter().zip(self.lambda.of(&pixels)).filter(|(_, l)| **l > 0.0);
        pairs.map(|(z, _)| (-z).max(0.0)).fold(0.0, f64::max)
    }

    fn is_hard(&self) -> bool {
        true
    }

    fn force(&self) -> f64 {
        self.most
    }
}
