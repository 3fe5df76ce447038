//! Linear springs.

use super::{DividedDifferences, Energy, Lame, Prox, quadratic};
use proxel_linalg::simd::Real;

/// psi(s) = stiffness/2 (s - 1)^2 of one stretch s = length / rest length. The density is per rest length, so that a spring of
/// rest length l has the force constant stiffness / l.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// Force per unit of relative elongation, such as Young's modulus times the cross-section.
    pub stiffness: f64,
}

impl Energy<1> for Spring {
    const NAME: &'static str = "spring";
    const SEPARABLE: bool = true;

    /// stiffness = Young's modulus: cross-sections of 1.
    fn from_lame(lame: &Lame) -> Self {
        Spring { stiffness: lame.young() }
    }

    #[inline(always)]
    fn value<T: Real>(&self, s: [T; 1]) -> T {
        quadratic::value(self.stiffness, s)
    }

    #[inline(always)]
    fn gradient<T: Real>(&self, s: [T; 1]) -> [T; 1] {
        quadratic::gradient(self.stiffness, s)
    }

    #[inline(always)]
    fn hessian<T: Real>(&self, _: [T; 1]) -> [[T; 1]; 1] {
        quadratic::hessian(self.stiffness)
    }

    #[inline(always)]
    fn divided_differences<T: Real>(&self, s: [T; 1]) -> DividedDifferences<T, 1> {
        quadratic::divided_differences(self.stiffness, s)
    }

    /// In closed form, exact up to rounding for any `v`.
    #[inline(always)]
    fn prox<T: Real>(&self, v: [T; 1], k: T, _: [T; 1]) -> Prox<T, 1> {
        quadratic::prox(self.stiffness, v, k)
    }

    #[inline(always)]
    fn effective_stiffness<T: Real>(&self, _: [T; 1]) -> T {
        T::splat(self.stiffness)
    }
}
