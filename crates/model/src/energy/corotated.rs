//! Corotated energy without a volume term.

use super::{DividedDifferences, Energy, Lame, Prox, quadratic};
use proxel_linalg::simd::Real;

/// psi(s) = bulk/2 sum (s_i - 1)^2 = bulk/2 |F - R|^2 with R the rotation closest to F: the corotational model of the
/// AA-ADMM implementation (Zhang et al. 2019) and of ADMM-elastic (Overby et al. 2017), which has no lambda term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corotated {
    /// The bulk modulus lambda + 2/3 mu.
    pub bulk: f64,
}

impl<const K: usize> Energy<K> for Corotated {
    const NAME: &'static str = "corotated";
    const SEPARABLE: bool = true;
    const QUADRATIC: bool = true;

    fn from_lame(lame: &Lame) -> Self {
        Corotated { bulk: lame.bulk() }
    }

    #[inline(always)]
    fn value<T: Real>(&self, s: [T; K]) -> T {
        quadratic::value(self.bulk, s)
    }

    #[inline(always)]
    fn gradient<T: Real>(&self, s: [T; K]) -> [T; K] {
        quadratic::gradient(self.bulk, s)
    }

    #[inline(always)]
    fn hessian<T: Real>(&self, _: [T; K]) -> [[T; K]; K] {
        quadratic::hessian(self.bulk)
    }

    #[inline(always)]
    fn divided_differences<T: Real>(&self, s: [T; K]) -> DividedDifferences<T, K> {
        quadratic::divided_differences(self.bulk, s)
    }

    /// In closed form, exact up to rounding for any `v`.
    #[inline(always)]
    fn prox<T: Real>(&self, v: [T; K], k: T, _: [T; K]) -> Prox<T, K> {
        quadratic::prox(self.bulk, v, k)
    }

    #[inline(always)]
    fn effective_stiffness<T: Real>(&self, _: [T; K]) -> T {
        T::splat(self.bulk)
    }
}
