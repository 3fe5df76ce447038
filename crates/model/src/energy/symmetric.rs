//! Symmetric matrices of 1, 2 and 3 rows: factorisation with a check of definiteness, the largest eigenvalue.

use proxel_linalg::simd::{Mask, Real};

/// A = L D L^T without exchanges.
pub(super) struct Ldlt<T: Real, const K: usize> {
    /// Strictly lower part of L.
    lower: [[T; K]; K],
    /// 1 / D, of the pivots after their repair.
    inverse: [T; K],
    /// Whether all pivots were safely positive.
    pub(super) definite: T::Mask,
    /// d with d^T A d < 0 where not definite: the eliminated column of the first bad pivot.
    pub(super) negative: [T; K],
}

impl<T: Real, const K: usize> Ldlt<T, K> {
    /// Factors `a`; a pivot below 1e-10 of its diagonal's magnitude counts as bad.
    #[inline(always)]
    pub(super) fn new(a: &[[T; K]; K]) -> Self {
        let always = T::zero().le(T::zero());
        let mut f =
            Ldlt { lower: [[T::zero(); K]; K], inverse: [T::zero(); K], definite: always, negative: [T::zero(); K] };
        let mut d = [T::zero(); K];
        for j in 0..K {
            let mut pivot = a[j][j];
            for n in 0..j {
                pivot -= f.lower[j][n] * f.lower[j][n] * d[n];
            }
            let good = pivot.gt(a[j][j].abs() * 1e-10);
            if !(good | !f.definite).all() {
                let column = f.null_column(j);
                let first = f.definite & !good;
                for i in 0..K {
                    f.negative[i] = T::select(first, column[i], f.negative[i]);
                }
            }
            f.definite = f.definite & good;
            d[j] = pivot;
            f.inverse[j] = pivot.fast_recip();
            for i in j + 1..K {
                let mut l = a[i][j];
                for n in 0..j {
                    l -= f.lower[i][n] * f.lower[j][n] * d[n];
                }
                f.lower[i][j] = l * f.inverse[j];
            }
        }
        f
    }

    /// x with L_j^T x = e_j for the leading part of j + 1 rows: then x^T A x is the pivot j.
    #[inline(always)]
    fn null_column(&self, j: usize) -> [T; K] {
        let mut x = [T::zero(); K];
        x[j] = T::one();
        for i in (0..j).rev() {
            let mut t = T::zero();
            for n in i + 1..=j {
                t -= self.lower[n][i] * x[n];
            }
            x[i] = t;
        }
        x
    }

    /// A^-1 b.
    #[inline(always)]
    pub(super) fn solve(&self, b: &[T; K]) -> [T; K] {
        let mut x = *b;
        for i in 0..K {
            for n in 0..i {
                x[i] -= self.lower[i][n] * x[n];
            }
        }
        for i in (0..K).rev() {
            x[i] = x[i] * self.inverse[i];
            for n in i + 1..K {
                x[i] -= self.lower[n][i] * x[n];
            }
        }
        x
    }
}

/// The largest eigenvalue of a symmetric matrix with K = 1, 2 or 3 rows (of larger ones the bound of Gershgorin).
/// Relative accuracy, in the spectral norm, 1e-14; 1e-8 where for K = 3 the two largest nearly coincide.
///
/// K = 3: m + 2 q cos(t/3) with m = tr A / 3, q^2 = |A - m|^2 / 6 and cos t = det(A - m) / (2 q^3) = r; c = cos(t/6)
/// solves 4 c^3 - 3 c = sqrt((1 + r)/2), well conditioned on its range [cos 30 deg, 1], by three steps of Newton.
#[inline(always)]
pub fn largest_eigenvalue<T: Real, const K: usize>(a: &[[T; K]; K]) -> T {
    match K {
        1 => a[0][0],
        2 => {
            let mean = (a[0][0] + a[1][1]) * 0.5;
            let half = (a[0][0] - a[1][1]) * 0.5;
            mean + half.mul_add(half, a[0][1] * a[0][1]).sqrt()
        }
        3 => {
            let m = (a[0][0] + a[1][1] + a[2][2]) * (1.0 / 3.0);
            let (x, y, z) = (a[0][0] - m, a[1][1] - m, a[2][2] - m);
            let (u, v, w) = (a[1][2], a[0][2], a[0][1]);
            let off = u * u + v * v + w * w;
            let q = ((x * x + y * y + z * z + off * 2.0) * (1.0 / 6.0)).sqrt();
            let inverse = T::select(q.gt(T::zero()), q.recip(), T::zero());
            let (x, y, z) = (x * inverse, y * inverse, z * inverse);
            let (u, v, w) = (u * inverse, v * inverse, w * inverse);
            let det = x * (y * z - u * u) - w * (w * z - u * v) + v * (w * u - y * v);
            let r = (det * 0.5).max(T::splat(-1.0)).min(T::one());
            let t = ((r + 1.0) * 0.5).sqrt();
            let mut c = t.mul_add(t * -0.0267 + 0.1607, T::splat(0.866)); // within 1e-3
            for _ in 0..3 {
                let c2 = c * c;
                c = c - (c * (c2 * 4.0 - 3.0) - t) * (c2 * 12.0 - 3.0).fast_recip();
            }
            m + q * (c * c * 4.0 - 2.0)
        }
        _ => {
            let mut bound = T::splat(f64::NEG_INFINITY);
            for i in 0..K {
                let mut row = a[i][i];
                for j in 0..K {
                    if j != i {
                        row += a[i][j].abs();
                    }
                }
                bound = bound.max(row);
            }
            bound
        }
    }
}
