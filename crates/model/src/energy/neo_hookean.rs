//! Neo-Hookean elasticity with a logarithm that is extended through inversion.

use super::products::{cofactors, hessian_with_volume, product, product_without, squared_norm};
use super::{DividedDifferences, Energy, Lame, Prox, newton::better_start, newton_prox};
use proxel_linalg::simd::{Mask, Real};

/// Below this volume ratio the logarithm is replaced by its second-order expansion.
const J0: f64 = 0.1;
const LN_J0: f64 = -std::f64::consts::LN_10;

/// Steps of the scalar equation before a lane is left to [`newton_prox`].
const STEPS: usize = 24;
/// The last step starts from a residual f of this size: Halley's method leaves about its cube.
const LAST_RESIDUAL: f64 = 1e-6;

/// psi(s) = mu/2 (|s|^2 - K) - mu L(J) + lambda/2 L(J)^2, J = s_1 .. s_K, where L(J) = log J for J > J0 = 0.1 and below
/// its expansion log J0 + t - t^2/2, t = J/J0 - 1: finite everywhere, also through inversion.
///
/// Bonet and Wood, "Nonlinear continuum mechanics for finite element analysis", with the extension of the WRAPD
/// authors' implementation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeoHookean {
    /// Shear modulus.
    pub mu: f64,
    /// First Lame parameter.
    pub lambda: f64,
}

impl NeoHookean {
    /// L and L' (L'' is -L'^2 above J0 and -1 / J0^2 below).
    #[inline(always)]
    fn logarithm<T: Real>(j: T) -> (T, T) {
        let above = j.gt(T::splat(J0));
        let t = j * (1.0 / J0) - 1.0;
        let clamped = j.max(T::splat(J0));
        let l = T::select(above, clamped.ln(), t * (t * -0.5 + 1.0) + LN_J0);
        let l1 = T::select(above, clamped.recip(), (-t + 1.0) * (1.0 / J0));
        (l, l1)
    }

    /// h' of the volume term h(J) = lambda/2 L^2 - mu L, and h'' = lambda L'^2 + (lambda L - mu) L''.
    #[inline(always)]
    fn volume_derivatives<T: Real>(&self, j: T) -> (T, T) {
        let (l, l1) = Self::logarithm(j);
        let l2 = -T::select(j.gt(T::splat(J0)), l1 * l1, T::splat(1.0 / (J0 * J0)));
        let outer = l * self.lambda - self.mu;
        (outer * l1, l1 * l1 * self.lambda + outer * l2)
    }
}

impl<const K: usize> Energy<K> for NeoHookean {
    const NAME: &'static str = "neo-hookean";
    const PROX_POSITIVE: bool = true;

    fn from_lame(lame: &Lame) -> Self {
        NeoHookean { mu: lame.mu(), lambda: lame.lambda() }
    }

    #[inline(always)]
    fn value<T: Real>(&self, s: [T; K]) -> T {
        let (l, _) = Self::logarithm(product(&s));
        (squared_norm(&s) - K as f64) * (0.5 * self.mu) + l * (l * (0.5 * self.lambda) - self.mu)
    }

    #[inline(always)]
    fn gradient<T: Real>(&self, s: [T; K]) -> [T; K] {
        let (h1, _) = self.volume_derivatives(product(&s));
        let mut g = cofactors(&s);
        for i in 0..K {
            g[i] = g[i].mul_add(h1, s[i] * self.mu);
        }
        g
    }

    #[inline(always)]
    fn hessian<T: Real>(&self, s: [T; K]) -> [[T; K]; K] {
        let (h1, h2) = self.volume_derivatives(product(&s));
        hessian_with_volume(&s, h1, h2, T::splat(self.mu))
    }

    /// mu -+ h'(J) times the product of the other stretches.
    #[inline(always)]
    fn divided_differences<T: Real>(&self, s: [T; K]) -> DividedDifferences<T, K> {
        let (h1, _) = self.volume_derivatives(product(&s));
        DividedDifferences::from_pairs(|i, j| {
            let other = h1 * product_without(&s, i, j);
            (-other + self.mu, other + self.mu)
        })
    }

    /// Where J >= J0, stationary points satisfy (mu + k) s_i^2 - k v_i s_i + c = 0 with c = lambda log J - mu. Given
    /// l = log J, the larger root s_i(l) falls with l, so f(l) = sum log s_i(l) - l = 0 has at most one solution;
    /// f is also concave, so that Newton's method overshoots at most once and is monotone then. That solution, a strict
    /// local minimum, is the result whenever it exists and has J >= J0, whatever `warm` is, although where `v` is far
    /// stretched a state with one smaller root, a collapsed stretch, may have a lower objective.
    /// Where it has J < J0, [`newton_prox`] descends from it over s >= 0; where there is none (`v` so large that
    /// a stretch does collapse), from the better of `warm` and `v`.
    #[inline(always)]
    fn prox<T: Real>(&self, v: [T; K], k: T, warm: [T; K]) -> Prox<T, K> {
        let never = T::zero().lt(T::zero());
        // With lambda < 0, f need not fall.
        let (root, found) = if self.lambda < 0.0 { (warm, never) } else { self.larger_roots(v, k, warm) };
        let above = found & product(&root).ge(T::splat(J0));
        if above.all() {
            return Prox { s: root, converged: above };
        }
        let mut start = better_start(self, &v, k, &warm);
        for i in 0..K {
            start[i] = T::select(found, root[i], start[i]);
        }
        let rest = newton_prox(self, v, k, start, !above); // start, which is root, in the other lanes
        Prox { s: rest.s, converged: above | rest.converged }
    }
}

impl NeoHookean {
    /// The stationary point of all larger roots under log J without extension, and where it was found.
    #[inline(always)]
    fn larger_roots<T: Real, const K: usize>(&self, v: [T; K], k: T, warm: [T; K]) -> ([T; K], T::Mask) {
        // Divided by mu + k: s^2 - 2 b s + c = 0, c = lambda l - mu.
        let inverse = (k + self.mu).recip();
        let (lambda, mu) = (inverse * self.lambda, inverse * self.mu);
        let half = k * inverse * 0.5;
        let mut b = v;
        let mut b2 = v;
        let mut c_max = T::splat(f64::INFINITY); // beyond it a root is complex or not positive
        for i in 0..K {
            b[i] = half * v[i];
            b2[i] = b[i] * b[i];
            c_max = c_max.min(T::select(b[i].gt(T::zero()), b2[i], T::zero()));
        }
        let l_max = (c_max + mu) / lambda;
        let l = product(&warm).ln();
        let mut l = T::select(l.is_finite() & l.lt(l_max), l, (l_max - 1.0).min(T::zero()));

        let (mut s, mut r) = (b, b);
        let mut done = T::zero().lt(T::zero());
        for _ in 0..STEPS {
            roots(&b, &b2, lambda.mul_add(l, -mu), &mut s, &mut r);
            // f' = -1 - lambda sum g_i, f'' = -lambda^2 sum dg_i/dc with
            // g_i = -d log s_i / dc = 1 / (2 r_i s_i), dg_i / dc = (r_i + s_i) / (4 r_i^3 s_i^2)
            let (mut g, mut g1) = (T::zero(), T::zero());
            for i in 0..K {
                let u = (r[i] * s[i]).fast_recip();
                g += u;
                g1 = (u * u * u).mul_add(s[i] * (r[i] + s[i]), g1);
            }
            let f = product(&s).ln() - l;
            let descent = (lambda * 0.5).mul_add(g, T::one()); // -f'
            let curvature = lambda * lambda * g1 * 0.25; // -f''
            // Halley's method, l - 2 f f' / (2 f'^2 - f f''), with f f'' bounded by f'^2 far from the root.
            let square = descent * descent;
            let bend = (f * curvature * 0.5).max(square * -0.5).min(square);
            let step = f * descent / (square + bend);
            let next = l + step;
            let inside = next.lt(l_max);
            let next = T::select(inside, next, (l_max - l).mul_add(T::splat(0.75), l));
            let last = inside & f.abs().le(T::splat(LAST_RESIDUAL));
            l = T::select(done, l, next);
            done = done | last;
            if done.all() {
                break;
            }
        }
        roots(&b, &b2, lambda.mul_add(l, -mu), &mut s, &mut r);
        (s, done)
    }
}

/// The larger roots s_i of s^2 - 2 b_i s + c = 0, and r_i = sqrt(b_i^2 - c).
#[inline(always)]
fn roots<T: Real, const K: usize>(b: &[T; K], b2: &[T; K], c: T, s: &mut [T; K], r: &mut [T; K]) {
    for i in 0..K {
        r[i] = (b2[i] - c).sqrt();
        s[i] = b[i] + r[i];
        let negative = b[i].lt(T::zero());
        if negative.any() {
            s[i] = T::select(negative, -c / (r[i] - b[i]), s[i]); // b + r would cancel
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_the_reference() {
        for (mu, lambda) in [(1.0, 0.0), (0.0, 1.0), (3_448_275.862, 31_034_482.76)] {
            let e = NeoHookean { mu, lambda };
            let slope = Energy::<3>::slope_stiffness(&e);
            let expected = 2.006_63 * mu + 1.012_18 * lambda;
            assert!((slope / expected - 1.0).abs() < 1e-5, "{slope} {expected}");
            let rest = Energy::<3>::rest_stiffness(&e);
            assert!((rest - (2.0 * mu + 3.0 * lambda)).abs() < 1e-12 * rest, "{rest}");
        }
    }

    #[test]
    fn the_fast_path_finds_what_newton_finds() {
        let e = NeoHookean { mu: 3_448_275.862, lambda: 31_034_482.76 };
        let k = Energy::<3>::slope_stiffness(&e);
        for v in [[1.0, 1.0, 1.0], [2.0, 1.0, 0.3], [0.5, 0.2, -0.4], [1.5, 1.4, 1.3], [-1.0, 0.3, 1.2]] {
            let (s, done) = e.larger_roots(v, k, [1.0; 3]);
            assert!(done, "{v:?}");
            let newton = newton_prox(&e, v, k, [1.0; 3], true);
            assert!(newton.converged, "{v:?}");
            for i in 0..3 {
                assert!((s[i] - newton.s[i]).abs() < 1e-12, "{v:?} {s:?} {:?}", newton.s);
            }
        }
    }
}
