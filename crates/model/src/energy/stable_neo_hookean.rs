//! Stable neo-Hookean elasticity.

use super::products::{cofactors, product, product_without, squared_norm};
use super::{DividedDifferences, Energy, Lame};
use proxel_linalg::simd::Real;

/// psi(s) = mu/2 (I - K) - mu/2 log((I + 1) / (K + 1)) - a (J - 1) + lambda/2 (J - 1)^2,
/// I = |s|^2, J = s_1 .. s_K, a = mu K / (K + 1).
///
/// Smith, de Goes and Kim, "Stable neo-Hookean flesh simulation", 2018, equation 14: their lambda/2 (J - alpha)^2 with
/// alpha = 1 + a / lambda, expanded so that lambda = 0 is allowed, less its value at rest. Finite and smooth everywhere,
/// also through inversion; rest is free of energy and stress.
///
/// mu and lambda are those of the formula. [`Energy::from_lame`] takes the Lame parameters of linear elasticity and
/// chooses them so that the Hessians at rest agree: mu = (K + 1)/K mu_L and lambda = lambda_L + mu_L - 2 mu_L / (K (K + 1)),
/// which for K = 3 is 4/3 mu_L and lambda_L + 5/6 mu_L (their section 3.4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StableNeoHookean {
    /// Factor of the distortion, (K + 1)/K times the shear modulus.
    pub mu: f64,
    /// Factor of the change of volume.
    pub lambda: f64,
}

impl StableNeoHookean {
    /// d psi / d J = lambda (J - 1) - a
    #[inline(always)]
    fn volume_derivative<T: Real, const K: usize>(&self, s: &[T; K]) -> T {
        (product(s) - 1.0) * self.lambda - self.mu * K as f64 / (K + 1) as f64
    }
}

impl<const K: usize> Energy<K> for StableNeoHookean {
    const NAME: &'static str = "stable-neo-hookean";

    fn from_lame(lame: &Lame) -> Self {
        let n = K as f64;
        StableNeoHookean {
            mu: lame.mu() * (n + 1.0) / n,
            lambda: lame.lambda() + lame.mu() * (1.0 - 2.0 / (n * (n + 1.0))),
        }
    }

    #[inline(always)]
    fn value<T: Real>(&self, s: [T; K]) -> T {
        let n = K as f64;
        let i = squared_norm(&s);
        let e = product(&s) - 1.0;
        (i - n - ((i + 1.0) * (1.0 / (n + 1.0))).ln()) * (0.5 * self.mu)
            + e * (e * (0.5 * self.lambda) - self.mu * n / (n + 1.0))
    }

    #[inline(always)]
    fn gradient<T: Real>(&self, s: [T; K]) -> [T; K] {
        let m = (-(squared_norm(&s) + 1.0).recip() + 1.0) * self.mu;
        let h1 = self.volume_derivative(&s);
        let mut g = cofactors(&s);
        for i in 0..K {
            g[i] = g[i].mul_add(h1, m * s[i]);
        }
        g
    }

    #[inline(always)]
    fn hessian<T: Real>(&self, s: [T; K]) -> [[T; K]; K] {
        let inverse = (squared_norm(&s) + 1.0).recip();
        let m = (-inverse + 1.0) * self.mu;
        let outer = inverse * inverse * (2.0 * self.mu); // of s s^T
        let h1 = self.volume_derivative(&s);
        let c = cofactors(&s);
        let mut h = [[T::zero(); K]; K];
        for i in 0..K {
            h[i][i] = (c[i] * self.lambda).mul_add(c[i], (outer * s[i]).mul_add(s[i], m));
            for j in i + 1..K {
                let volume = (c[i] * self.lambda).mul_add(c[j], h1 * product_without(&s, i, j));
                h[i][j] = (outer * s[i]).mul_add(s[j], volume);
                h[j][i] = h[i][j];
            }
        }
        h
    }

    /// mu (1 - 1/(I + 1)) -+ d psi / d J times the product of the other stretches.
    #[inline(always)]
    fn divided_differences<T: Real>(&self, s: [T; K]) -> DividedDifferences<T, K> {
        let m = (-(squared_norm(&s) + 1.0).recip() + 1.0) * self.mu;
        let h1 = self.volume_derivative(&s);
        DividedDifferences::from_pairs(|i, j| {
            let other = h1 * product_without(&s, i, j);
            (m - other, m + other)
        })
    }
}
