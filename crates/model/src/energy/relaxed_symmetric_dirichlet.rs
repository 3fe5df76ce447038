//! Symmetric Dirichlet energy, made finite where triangles are turned over.

use super::{DividedDifferences, Energy, Lame};
use proxel_linalg::simd::Real;
use proxel_split::Dial;

/// psi(s) = scale/2 (|s|^2 (1 + chi(D)^-2) - 4) with D = s_1 s_2 and chi(D) = (D + sqrt(D^2 + epsilon^2)) / 2, K = 2.
///
/// Smooth for all s. Where D > 0 it tends to [`super::SymmetricDirichlet`], |s|^2 + |s|^2 / D^2, as epsilon tends to 0;
/// elsewhere it then grows without bound. The regularisation is that of Garanzha et al., "Foldover-free maps in 50 lines of
/// code", 2021, (3). It is no energy of its own: epsilon is turned while it is minimised, and rest is no minimum.
#[derive(Clone, Debug)]
pub struct RelaxedSymmetricDirichlet {
    /// Factor of the energy.
    pub scale: f64,
    /// epsilon
    pub epsilon: Dial,
}

/// 1 + chi^-2 and its first two derivatives by D.
#[inline(always)]
fn barrier<T: Real>(d: T, epsilon: f64) -> [T; 3] {
    let r = d.mul_add(d, T::splat(epsilon * epsilon)).sqrt();
    // (D + r)/2 cancels where D is negative; the two forms have the product epsilon^2/4.
    let far = (r - d).recip() * (0.5 * epsilon * epsilon);
    let chi = T::select(d.lt(T::zero()), far, (d + r) * 0.5);
    let inverse = chi.recip();
    let square = inverse * inverse;
    let by_r = r.recip();
    [square + 1.0, square * by_r * -2.0, square * by_r * by_r * 2.0 * (d * by_r + 2.0)]
}

impl Energy<2> for RelaxedSymmetricDirichlet {
    const NAME: &'static str = "relaxed-symmetric-dirichlet";

    /// scale = mu/2, as [`super::SymmetricDirichlet`]; epsilon = 1.
    fn from_lame(lame: &Lame) -> Self {
        RelaxedSymmetricDirichlet { scale: 0.5 * lame.mu(), epsilon: Dial::new(1.0) }
    }

    #[inline(always)]
    fn value<T: Real>(&self, s: [T; 2]) -> T {
        let [m, _, _] = barrier(s[0] * s[1], self.epsilon.get());
        let q = s[0].mul_add(s[0], s[1] * s[1]);
        (q * m - 4.0) * (0.5 * self.scale)
    }

    #[inline(always)]
    fn gradient<T: Real>(&self, s: [T; 2]) -> [T; 2] {
        let [m, m1, _] = barrier(s[0] * s[1], self.epsilon.get());
        let q = s[0].mul_add(s[0], s[1] * s[1]);
        let of = |a: T, b: T| (a * m * 2.0 + q * m1 * b) * (0.5 * self.scale);
        [of(s[0], s[1]), of(s[1], s[0])]
    }

    #[inline(always)]
    fn hessian<T: Real>(&self, s: [T; 2]) -> [[T; 2]; 2] {
        let d = s[0] * s[1];
        let [m, m1, m2] = barrier(d, self.epsilon.get());
        let q = s[0].mul_add(s[0], s[1] * s[1]);
        let half = 0.5 * self.scale;
        let diagonal = |other: T| (m * 2.0 + d * m1 * 4.0 + q * m2 * other * other) * half;
        let off = q * (m1 * 3.0 + m2 * d) * half;
        [[diagonal(s[1]), off], [off, diagonal(s[0])]]
    }

    #[inline(always)]
    fn divided_differences<T: Real>(&self, s: [T; 2]) -> DividedDifferences<T, 2> {
        let [m, m1, _] = barrier(s[0] * s[1], self.epsilon.get());
        let q = s[0].mul_add(s[0], s[1] * s[1]);
        let half = 0.5 * self.scale;
        DividedDifferences::from_pairs(|_, _| ((m * 2.0 - q * m1) * half, (m * 2.0 + q * m1) * half))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::energy::SymmetricDirichlet;

    const POINTS: [[f64; 2]; 6] = [[1.0, 1.0], [1.7, 0.4], [0.6, 0.05], [1.1, -0.3], [0.9, -0.9], [2.0, 0.0]];

    fn at(epsilon: f64) -> RelaxedSymmetricDirichlet {
        RelaxedSymmetricDirichlet { scale: 1.3, epsilon: Dial::new(epsilon) }
    }

    #[test]
    fn derivatives_match_differences() {
        let h = 1e-5;
        for epsilon in [1.0, 0.2] {
            let e = at(epsilon);
            for s in POINTS {
                let (g, hessian, dd) = (e.gradient(s), e.hessian(s), e.divided_differences(s));
                let size = 1.0 + hessian.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
                for i in 0..2 {
                    let moved = |t: f64| {
                        let mut p = s;
                        p[i] += t;
                        p
                    };
                    let slope = (e.value(moved(h)) - e.value(moved(-h))) / (2.0 * h);
                    assert!((slope - g[i]).abs() < 1e-7 * size * size, "{s:?}: {slope} {}", g[i]);
                    for j in 0..2 {
                        let slope = (e.gradient(moved(h))[j] - e.gradient(moved(-h))[j]) / (2.0 * h);
                        assert!((slope - hessian[i][j]).abs() < 1e-7 * size * size, "{s:?}: {slope}");
                    }
                }
                if s[0] != s[1] {
                    assert!((dd.minus[0][1] - (g[0] - g[1]) / (s[0] - s[1])).abs() < 1e-10 * size);
                }
                if s[0] != -s[1] {
                    assert!((dd.plus[0][1] - (g[0] + g[1]) / (s[0] + s[1])).abs() < 1e-10 * size);
                }
            }
        }
    }

    #[test]
    fn it_tends_to_symmetric_dirichlet() {
        for s in [[1.0, 1.0], [1.7, 0.4], [0.6, 0.5]] {
            let (relaxed, real) = (at(1e-7).value(s), SymmetricDirichlet { scale: 1.3 }.value(s));
            assert!((relaxed - real).abs() < 1e-10, "{relaxed} {real}");
        }
        assert!(at(1e-3).value([1.0, -0.1]) > 1e7);
    }
}
