//! Symmetric gradient energy.

use super::products::sum;
use super::{DividedDifferences, Energy, Lame, Prox};
use proxel_linalg::simd::Real;

/// psi(s) = scale sum (s_i^2/2 - ln s_i - 1/2), s_i > 0; +inf elsewhere: |F|^2/2 - ln det F, up to a constant.
///
/// Stein, Li and Solomon, "A splitting scheme for flip-free distortion energies", 2022, who introduce it since it grows more
/// slowly than symmetric Dirichlet near collapse. Separable and convex where finite; its stiffness at rest is 2 scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SymmetricGradient {
    /// Factor of the energy.
    pub scale: f64,
}

impl Default for SymmetricGradient {
    /// sum (s_i^2/2 - ln s_i - 1/2)
    fn default() -> Self {
        SymmetricGradient { scale: 1.0 }
    }
}

impl<const K: usize> Energy<K> for SymmetricGradient {
    const NAME: &'static str = "symmetric-gradient";
    const SEPARABLE: bool = true;
    const BARRIER: bool = true;

    /// scale = mu: the stiffness at rest is then 2 mu, that of a material with lambda = 0.
    fn from_lame(lame: &Lame) -> Self {
        SymmetricGradient { scale: lame.mu() }
    }

    #[inline(always)]
    fn value<T: Real>(&self, s: [T; K]) -> T {
        let mut least = s[0];
        for i in 1..K {
            least = least.min(s[i]);
        }
        let is_inside = least.gt(T::zero());
        let terms = sum(&s, |x| {
            let inside = T::select(x.gt(T::zero()), x, T::one());
            x.mul_add(x, T::splat(-1.0)) * 0.5 - inside.ln()
        });
        T::select(is_inside, terms * self.scale, T::splat(f64::INFINITY))
    }

    #[inline(always)]
    fn gradient<T: Real>(&self, mut s: [T; K]) -> [T; K] {
        for i in 0..K {
            s[i] = (s[i] - s[i].recip()) * self.scale;
        }
        s
    }

    #[inline(always)]
    fn hessian<T: Real>(&self, s: [T; K]) -> [[T; K]; K] {
        let mut h = [[T::zero(); K]; K];
        for i in 0..K {
            let r = s[i].recip();
            h[i][i] = r.mul_add(r, T::one()) * self.scale;
        }
        h
    }

    /// scale (1 +- 1 / (s_i s_j))
    #[inline(always)]
    fn divided_differences<T: Real>(&self, s: [T; K]) -> DividedDifferences<T, K> {
        DividedDifferences::from_pairs(|i, j| {
            let r = (s[i] * s[j]).recip();
            ((r + 1.0) * self.scale, (-r + 1.0) * self.scale)
        })
    }

    /// Each stretch alone solves (scale + k) s^2 - k v s - scale = 0, of which it is the positive root.
    #[inline(always)]
    fn prox<T: Real>(&self, v: [T; K], k: T, _: [T; K]) -> Prox<T, K> {
        let both = k + self.scale;
        let mut s = v;
        let mut converged = T::zero().le(T::zero());
        for i in 0..K {
            let half = k * v[i] * 0.5;
            let root = half.mul_add(half, both * self.scale).sqrt();
            // Two forms of the same root: the sum cancels where v is negative.
            let far = (root - half).recip() * self.scale;
            s[i] = T::select(half.lt(T::zero()), far, (half + root) * both.recip());
            converged = converged & s[i].is_finite() & s[i].gt(T::zero());
        }
        Prox { s, converged }
    }
}
