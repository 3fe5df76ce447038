//! Most isometric parameterization, with areas.

use super::{DividedDifferences, Energy, Lame};
use proxel_linalg::simd::Real;

/// psi(s) = scale (|s|^2 / D - 2 + weight (D + 1/D - 2)), D = s_1 s_2, s_i > 0; +inf elsewhere.
///
/// Most isometric parameterizations (Hormann and Greiner 2000): |s|^2 / D = s_1/s_2 + s_2/s_1 measures angles only, so that
/// it fixes no scale; the second part, of Degener et al. 2003 and Fu et al. 2015, measures areas. Not convex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mips {
    /// Factor of the energy.
    pub scale: f64,
    /// How much areas count against angles.
    pub weight: f64,
}

impl Default for Mips {
    /// Angles and areas alike.
    fn default() -> Self {
        Mips { scale: 1.0, weight: 1.0 }
    }
}

impl Mips {
    /// |s|^2, 1/D, and d psi / d D without the scale.
    #[inline(always)]
    fn parts<T: Real>(&self, s: &[T; 2]) -> [T; 3] {
        let q = s[0].mul_add(s[0], s[1] * s[1]);
        let r = (s[0] * s[1]).recip();
        [q, r, (-r * r).mul_add(q + self.weight, T::splat(self.weight))]
    }
}

impl Energy<2> for Mips {
    const NAME: &'static str = "mips";
    const BARRIER: bool = true;

    /// scale = mu/2, weight 1: the stiffness at rest is then 2 mu against shear and against squeezing.
    fn from_lame(lame: &Lame) -> Self {
        Mips { scale: 0.5 * lame.mu(), weight: 1.0 }
    }

    /// (s_1 - s_2)^2 / D and (D - 1)^2 / D, without cancellation.
    #[inline(always)]
    fn value<T: Real>(&self, s: [T; 2]) -> T {
        let d = s[0] * s[1];
        let (shear, area) = (s[0] - s[1], d - 1.0);
        let value = shear.mul_add(shear, area * area * self.weight) * d.recip() * self.scale;
        T::select(s[0].min(s[1]).gt(T::zero()), value, T::splat(f64::INFINITY))
    }

    #[inline(always)]
    fn gradient<T: Real>(&self, s: [T; 2]) -> [T; 2] {
        let [_, r, by_d] = self.parts(&s);
        let of = |a: T, b: T| (a * r * 2.0 + b * by_d) * self.scale;
        [of(s[0], s[1]), of(s[1], s[0])]
    }

    #[inline(always)]
    fn hessian<T: Real>(&self, s: [T; 2]) -> [[T; 2]; 2] {
        let [q, r, by_d] = self.parts(&s);
        let r2 = r * r;
        let curved = r2 * r * (q + self.weight) * 2.0;
        let diagonal = |other: T| (other * other * curved - r * 2.0) * self.scale;
        let off = (by_d - q * r2 * 2.0 + s[0] * s[1] * curved) * self.scale;
        [[diagonal(s[1]), off], [off, diagonal(s[0])]]
    }

    #[inline(always)]
    fn divided_differences<T: Real>(&self, s: [T; 2]) -> DividedDifferences<T, 2> {
        let [_, r, by_d] = self.parts(&s);
        DividedDifferences::from_pairs(|_, _| ((r * 2.0 - by_d) * self.scale, (r * 2.0 + by_d) * self.scale))
    }
}
