//! Fixed corotated elasticity.

use super::products::{cofactors, hessian_with_volume, product, product_without};
use super::{DividedDifferences, Energy, Lame, quadratic};
use proxel_linalg::simd::Real;

/// psi(s) = mu sum (s_i - 1)^2 + lambda/2 (J - 1)^2, J = s_1 .. s_K: mu |F - R|^2 + lambda/2 (det F - 1)^2.
///
/// Stomakhin et al., "Energetically consistent invertible elasticity", 2012. Finite everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedCorotated {
    /// Shear modulus.
    pub mu: f64,
    /// First Lame parameter.
    pub lambda: f64,
}

impl FixedCorotated {
    /// d psi / d J
    #[inline(always)]
    fn volume_derivative<T: Real, const K: usize>(&self, s: &[T; K]) -> T {
        (product(s) - 1.0) * self.lambda
    }
}

impl<const K: usize> Energy<K> for FixedCorotated {
    const NAME: &'static str = "fixed-corotated";

    fn from_lame(lame: &Lame) -> Self {
        FixedCorotated { mu: lame.mu(), lambda: lame.lambda() }
    }

    #[inline(always)]
    fn value<T: Real>(&self, s: [T; K]) -> T {
        let e = product(&s) - 1.0;
        (e * e).mul_add(T::splat(0.5 * self.lambda), quadratic::value(2.0 * self.mu, s))
    }

    #[inline(always)]
    fn gradient<T: Real>(&self, s: [T; K]) -> [T; K] {
        let h1 = self.volume_derivative(&s);
        let mut g = cofactors(&s);
        for i in 0..K {
            g[i] = g[i].mul_add(h1, (s[i] - 1.0) * (2.0 * self.mu));
        }
        g
    }

    #[inline(always)]
    fn hessian<T: Real>(&self, s: [T; K]) -> [[T; K]; K] {
        hessian_with_volume(&s, self.volume_derivative(&s), T::splat(self.lambda), T::splat(2.0 * self.mu))
    }

    /// Those of mu |F - R|^2 -+ d psi / d J times the product of the other stretches.
    #[inline(always)]
    fn divided_differences<T: Real>(&self, s: [T; K]) -> DividedDifferences<T, K> {
        let h1 = self.volume_derivative(&s);
        let shear = quadratic::divided_differences(2.0 * self.mu, s);
        DividedDifferences::from_pairs(|i, j| {
            let other = h1 * product_without(&s, i, j);
            (shear.minus[i][j] - other, shear.plus[i][j] + other)
        })
    }
}
