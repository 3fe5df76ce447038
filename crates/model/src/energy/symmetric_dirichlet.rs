//! Symmetric Dirichlet energy.

use super::products::sum;
use super::{DividedDifferences, Energy, Lame, Prox};
use proxel_linalg::simd::{Mask, Real};

/// Newton steps before a lane is given up.
const STEPS: usize = 80;
/// A last step of this relative length: the error left is its square.
const LAST_STEP: f64 = 1e-8;

/// psi(s) = scale (1/2 sum (s_i^2 + s_i^-2) - K), s_i > 0; +inf elsewhere.
///
/// Smith and Schaefer, "Bijective parameterization with free boundaries", 2015. Separable and convex where finite, so
/// its prox is unique. With scale 2 and K = 2 it is s_1^2 + s_1^-2 + s_2^2 + s_2^-2 - 4, the form of most codes for
/// parameterisation, with the stiffness 8 at rest; the stiffness at rest is 4 scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SymmetricDirichlet {
    /// Factor of the energy.
    pub scale: f64,
}

impl Default for SymmetricDirichlet {
    /// 1/2 sum (s_i^2 + s_i^-2) - K
    fn default() -> Self {
        SymmetricDirichlet { scale: 1.0 }
    }
}

impl<const K: usize> Energy<K> for SymmetricDirichlet {
    const NAME: &'static str = "symmetric-dirichlet";
    const SEPARABLE: bool = true;
    const BARRIER: bool = true;

    /// scale = mu/2: the stiffness at rest, 4 scale, is then 2 mu, that of a material with lambda = 0.
    fn from_lame(lame: &Lame) -> Self {
        SymmetricDirichlet { scale: 0.5 * lame.mu() }
    }

    /// (s_i - 1/s_i)^2 is s_i^2 + s_i^-2 - 2 without its cancellation.
    #[inline(always)]
    fn value<T: Real>(&self, s: [T; K]) -> T {
        let mut least = s[0];
        for i in 1..K {
            least = least.min(s[i]);
        }
        let squares = sum(&s, |x| {
            let d = x - x.recip();
            d * d
        });
        T::select(least.gt(T::zero()), squares * (0.5 * self.scale), T::splat(f64::INFINITY))
    }

    #[inline(always)]
    fn gradient<T: Real>(&self, mut s: [T; K]) -> [T; K] {
        for i in 0..K {
            let r = s[i].recip();
            s[i] = (s[i] - r * r * r) * self.scale;
        }
        s
    }

    #[inline(always)]
    fn hessian<T: Real>(&self, s: [T; K]) -> [[T; K]; K] {
        let mut h = [[T::zero(); K]; K];
        for i in 0..K {
            let r = s[i].recip();
            let r2 = r * r;
            h[i][i] = (r2 * r2 * 3.0 + 1.0) * self.scale;
        }
        h
    }

    /// scale (1 +- (s_i^2 +- s_i s_j + s_j^2) / (s_i s_j)^3)
    #[inline(always)]
    fn divided_differences<T: Real>(&self, s: [T; K]) -> DividedDifferences<T, K> {
        DividedDifferences::from_pairs(|i, j| {
            let (squares, mixed) = (s[i].mul_add(s[i], s[j] * s[j]), s[i] * s[j]);
            let r = mixed.recip();
            let cubed = r * r * r;
            (((squares + mixed) * cubed + 1.0) * self.scale, (-(squares - mixed) * cubed + 1.0) * self.scale)
        })
    }

    /// Each stretch alone solves s - a - q s^-3 = 0 with a = k v / (scale + k), q = scale / (scale + k): increasing and
    /// concave, so that Newton's method, s <- s (a s^3 + 4 q) / (s^4 + 3 q), lands below the root at its first step and rises to
    /// it. Where that first step would leave the domain, a quarter of s is taken.
    #[inline(always)]
    fn prox<T: Real>(&self, v: [T; K], k: T, warm: [T; K]) -> Prox<T, K> {
        let inverse = (k + self.scale).recip();
        let q = inverse * self.scale;
        let weight = k * inverse;
        let (mut s, mut a) = (warm, v);
        for i in 0..K {
            a[i] = v[i] * weight;
            let usable = warm[i].gt(T::splat(1e-30)) & warm[i].lt(T::splat(1e30));
            s[i] = T::select(usable, warm[i], a[i].max(T::one()));
        }
        let mut done = [T::zero().lt(T::zero()); K];
        let mut converged = done[0];
        for _ in 0..STEPS {
            converged = T::zero().le(T::zero());
            for i in 0..K {
                let s2 = s[i] * s[i];
                let upper = (a[i] * s2).mul_add(s[i], q * 4.0) * s[i];
                let next = (upper * s2.mul_add(s2, q * 3.0).fast_recip()).max(s[i] * 0.25);
                let last = (next - s[i]).abs().le(next * LAST_STEP);
                s[i] = T::select(done[i], s[i], next);
                done[i] = done[i] | last;
                converged = converged & done[i];
            }
            if converged.all() {
                break;
            }
        }
        for i in 0..K {
            converged = converged & s[i].is_finite();
        }
        Prox { s, converged }
    }

    #[inline(always)]
    fn effective_stiffness<T: Real>(&self, s: [T; K]) -> T {
        let mut least = s[0];
        for i in 1..K {
            least = least.min(s[i]);
        }
        let r = least.recip();
        let r2 = r * r;
        (r2 * r2 * 3.0 + 1.0) * self.scale
    }
}
