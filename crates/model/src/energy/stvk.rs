//! St. Venant-Kirchhoff elasticity.

use super::products::sum;
use super::{DividedDifferences, Energy, Lame};
use proxel_linalg::simd::Real;

/// psi(s) = mu sum e_i^2 + lambda/2 (sum e_i)^2 with the Green strains e_i = (s_i^2 - 1)/2.
///
/// Even in every stretch: it resists neither collapse (psi stays finite, and softens below s = 0.58) nor inversion,
/// whose mirror image is another state of rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StVenantKirchhoff {
    /// Shear modulus.
    pub mu: f64,
    /// First Lame parameter.
    pub lambda: f64,
}

impl StVenantKirchhoff {
    /// lambda sum e_i - mu
    #[inline(always)]
    fn linear<T: Real, const K: usize>(&self, s: &[T; K]) -> T {
        sum(s, |x| (x - 1.0) * (x + 1.0)) * (0.5 * self.lambda) - self.mu
    }
}

impl<const K: usize> Energy<K> for StVenantKirchhoff {
    const NAME: &'static str = "stvk";

    fn from_lame(lame: &Lame) -> Self {
        StVenantKirchhoff { mu: lame.mu(), lambda: lame.lambda() }
    }

    #[inline(always)]
    fn value<T: Real>(&self, s: [T; K]) -> T {
        let trace = sum(&s, |x| (x - 1.0) * (x + 1.0)); // twice that of the strain
        let squares = sum(&s, |x| {
            let e = (x - 1.0) * (x + 1.0);
            e * e
        });
        squares * (0.25 * self.mu) + trace * trace * (0.125 * self.lambda)
    }

    /// With m = mu, less by K |lambda|/2 where lambda is negative, psi >= m |E|^2, so that |E| <= e = sqrt(level / m) and, in the
    /// spectral norm, which is convex, |F|^2 <= 1 + 2 e; in the hull |E| <= max(1/2, e). With s = 2 mu + K |lambda| the second
    /// stress S = 2 mu E + lambda tr(E) I has |S| <= s |E|, and P = F S gives |dP| <= |S| |dF| + s |F|^2 |dF|, |P|^2 <= |F|^2 s^2 |E|^2.
    fn level_bound(&self, level: f64) -> Option<(f64, f64)> {
        let m = self.mu + (0.5 * K as f64 * self.lambda).min(0.0);
        let s = 2.0f64.mul_add(self.mu, K as f64 * self.lambda.abs());
        let e = (level / m).sqrt();
        let size2 = 1.0 + 2.0 * e;
        let bounds = (s * (e.max(0.5) + size2), size2 * s * s / m);
        (m > 0.0 && bounds.0.is_finite() && bounds.1.is_finite()).then_some(bounds)
    }

    /// (mu s_i^2 + lambda sum e - mu) s_i
    #[inline(always)]
    fn gradient<T: Real>(&self, mut s: [T; K]) -> [T; K] {
        let linear = self.linear(&s);
        for i in 0..K {
            s[i] = s[i] * (s[i] * self.mu).mul_add(s[i], linear);
        }
        s
    }

    #[inline(always)]
    fn hessian<T: Real>(&self, s: [T; K]) -> [[T; K]; K] {
        let linear = self.linear(&s);
        let mut h = [[T::zero(); K]; K];
        for i in 0..K {
            h[i][i] = (s[i] * (3.0 * self.mu + self.lambda)).mul_add(s[i], linear);
            for j in i + 1..K {
                h[i][j] = s[i] * s[j] * self.lambda;
                h[j][i] = h[i][j];
            }
        }
        h
    }

    /// mu (s_i^2 +- s_i s_j + s_j^2) + lambda sum e - mu
    #[inline(always)]
    fn divided_differences<T: Real>(&self, s: [T; K]) -> DividedDifferences<T, K> {
        let linear = self.linear(&s);
        DividedDifferences::from_pairs(|i, j| {
            let (squares, mixed) = (s[i].mul_add(s[i], s[j] * s[j]), s[i] * s[j]);
            ((squares + mixed) * self.mu + linear, (squares - mixed) * self.mu + linear)
        })
    }
}
