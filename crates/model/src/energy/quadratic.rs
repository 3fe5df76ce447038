//! a/2 sum (s_i - 1)^2, the part that the energies of |F - R| share: with R the closest rotation to F and signed
//! stretches, |F - R|^2 = sum (s_i - 1)^2.

use super::products::sum;
use super::{DividedDifferences, Prox};
use proxel_linalg::simd::Real;

#[inline(always)]
pub(super) fn value<T: Real, const K: usize>(a: f64, s: [T; K]) -> T {
    sum(&s, |x| (x - 1.0) * (x - 1.0)) * (0.5 * a)
}

#[inline(always)]
pub(super) fn gradient<T: Real, const K: usize>(a: f64, mut s: [T; K]) -> [T; K] {
    for i in 0..K {
        s[i] = (s[i] - 1.0) * a;
    }
    s
}

#[inline(always)]
pub(super) fn hessian<T: Real, const K: usize>(a: f64) -> [[T; K]; K] {
    let mut h = [[T::zero(); K]; K];
    for i in 0..K {
        h[i][i] = T::splat(a);
    }
    h
}

/// a, and a (s_i + s_j - 2) / (s_i + s_j): a kink where s_i = -s_j, since R jumps there.
#[inline(always)]
pub(super) fn divided_differences<T: Real, const K: usize>(a: f64, s: [T; K]) -> DividedDifferences<T, K> {
    DividedDifferences::from_pairs(|i, j| {
        let t = s[i] + s[j];
        (T::splat(a), (t - 2.0) * a / t)
    })
}

/// (k v + a) / (k + a)
#[inline(always)]
pub(super) fn prox<T: Real, const K: usize>(a: f64, v: [T; K], k: T) -> Prox<T, K> {
    let inverse = (k + a).recip();
    let (mut s, mut finite) = (v, k.is_finite());
    for i in 0..K {
        s[i] = k.mul_add(v[i], T::splat(a)) * inverse;
        finite = finite & s[i].is_finite();
    }
    Prox { s, converged: finite }
}
