//! As-rigid-as-possible energy.

use super::{DividedDifferences, Energy, Lame, Prox, quadratic};
use proxel_linalg::simd::Real;

/// psi(s) = scale sum (s_i - 1)^2 = scale |S - I|^2, S the stretch part of F. Its Hessian is 2 scale everywhere.
///
/// Sorkine and Alexa, "As-rigid-as-possible surface modeling", 2007; in this form Liu et al., "A local/global approach to
/// mesh parameterization", 2008.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arap {
    /// Factor of |S - I|^2: 1 for the plain energy; mu makes it fixed-corotated elasticity with lambda = 0.
    pub scale: f64,
}

impl Default for Arap {
    /// |S - I|^2
    fn default() -> Self {
        Arap { scale: 1.0 }
    }
}

impl<const K: usize> Energy<K> for Arap {
    const NAME: &'static str = "arap";
    const SEPARABLE: bool = true;
    const QUADRATIC: bool = true;

    /// scale = mu.
    fn from_lame(lame: &Lame) -> Self {
        Arap { scale: lame.mu() }
    }

    #[inline(always)]
    fn value<T: Real>(&self, s: [T; K]) -> T {
        quadratic::value(2.0 * self.scale, s)
    }

    #[inline(always)]
    fn gradient<T: Real>(&self, s: [T; K]) -> [T; K] {
        quadratic::gradient(2.0 * self.scale, s)
    }

    #[inline(always)]
    fn hessian<T: Real>(&self, _: [T; K]) -> [[T; K]; K] {
        quadratic::hessian(2.0 * self.scale)
    }

    #[inline(always)]
    fn divided_differences<T: Real>(&self, s: [T; K]) -> DividedDifferences<T, K> {
        quadratic::divided_differences(2.0 * self.scale, s)
    }

    /// In closed form, exact up to rounding for any `v`.
    #[inline(always)]
    fn prox<T: Real>(&self, v: [T; K], k: T, _: [T; K]) -> Prox<T, K> {
        quadratic::prox(2.0 * self.scale, v, k)
    }

    #[inline(always)]
    fn effective_stiffness<T: Real>(&self, _: [T; K]) -> T {
        T::splat(2.0 * self.scale)
    }
}
