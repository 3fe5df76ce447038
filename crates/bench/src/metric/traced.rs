//! An energy with a quadratic of the trace, so that the prox in the metric is one in the Euclidean norm.

use proxel::linalg::simd::Real;
use proxel::model::energy::{DividedDifferences, Energy, Lame};

/// psi(s) + c/2 (s_1 + s_2 + s_3 - t)^2. With c = (v - d)/3 and t the trace of the point that is projected, its prox with
/// the weight d is that of psi in the metric.
#[derive(Clone, Copy, Debug)]
pub(super) struct Traced<E> {
    pub energy: E,
    pub factor: f64, // c
    pub target: f64, // t
}

impl<E: Energy<3>> Traced<E> {
    #[inline(always)]
    fn excess<T: Real>(&self, s: [T; 3]) -> T {
        s[0] + s[1] + s[2] - self.target
    }
}

impl<E: Energy<3>> Energy<3> for Traced<E> {
    const NAME: &'static str = E::NAME;
    const BARRIER: bool = E::BARRIER;
    const PROX_POSITIVE: bool = E::PROX_POSITIVE;

    fn from_lame(lame: &Lame) -> Self {
        Traced { energy: E::from_lame(lame), factor: 0.0, target: 0.0 }
    }

    #[inline(always)]
    fn value<T: Real>(&self, s: [T; 3]) -> T {
        let excess = self.excess(s);
        self.energy.value(s) + excess * excess * (0.5 * self.factor)
    }

    #[inline(always)]
    fn gradient<T: Real>(&self, s: [T; 3]) -> [T; 3] {
        let add = self.excess(s) * self.factor;
        self.energy.gradient(s).map(|g| g + add)
    }

    #[inline(always)]
    fn hessian<T: Real>(&self, s: [T; 3]) -> [[T; 3]; 3] {
        self.energy.hessian(s).map(|row| row.map(|h| h + self.factor))
    }

    #[inline(always)]
    fn divided_differences<T: Real>(&self, s: [T; 3]) -> DividedDifferences<T, 3> {
        let add = self.excess(s) * (2.0 * self.factor);
        let of = self.energy.divided_differences(s);
        DividedDifferences::from_pairs(|i, j| (of.minus[i][j], of.plus[i][j] + add / (s[i] + s[j])))
    }
}
