//! The proximal operator of any energy within a box: a projected Newton method.

use super::newton::{leave_saddle, minus, objective, shift};
use super::products::squared_norm;
use super::symmetric::Ldlt;
use super::{Energy, Prox};
use proxel_linalg::simd::{Mask, Real};

/// Newton steps before a lane is given up.
const STEPS: usize = 60;
/// Halvings of one step before a lane is given up.
const HALVINGS: usize = 40;
/// A last full step of this relative length: the error left is its square.
const LAST_STEP: f64 = 1e-8;

/// s with every component moved into [low, high]; a NaN becomes a bound.
#[inline(always)]
pub(super) fn clamp<T: Real, const K: usize>(s: &[T; K], low: f64, high: f64) -> [T; K] {
    let mut out = *s;
    for i in 0..K {
        out[i] = s[i].max(T::splat(low)).min(T::splat(high));
    }
    out
}

/// Whether all components lie in [low, high].
#[inline(always)]
pub(super) fn inside<T: Real, const K: usize>(s: &[T; K], low: f64, high: f64) -> T::Mask {
    let mut in_all = s[0].ge(T::splat(low)) & s[0].le(T::splat(high));
    for i in 1..K {
        in_all = in_all & s[i].ge(T::splat(low)) & s[i].le(T::splat(high));
    }
    in_all
}

/// Takes the stretches of `pinned` out of the Newton system.
#[inline(always)]
fn take_out<T: Real, const K: usize>(pinned: T::Mask, i: usize, g: &mut [T; K], h: &mut [[T; K]; K]) {
    g[i] = T::select(pinned, T::zero(), g[i]);
    for j in 0..K {
        h[i][j] = T::select(pinned, T::zero(), h[i][j]);
        h[j][i] = T::select(pinned, T::zero(), h[j][i]);
    }
    h[i][i] = T::select(pinned, T::one(), h[i][i]);
}

/// argmin of psi(s) + k/2 |s - v|^2 over [low, high]^K, 0 < low < high, by descent from the better of `warm` and v, both
/// clamped. Where the objective is not convex the result is a local minimum no worse than either.
///
/// Projected Newton (Bertsekas, "Projected Newton methods for optimization problems with simple constraints", 1982):
/// stretches on the border that the gradient pushes outwards leave the system, then those that the step of the others
/// would push there; the step is clamped, and halved until the objective decreases (Armijo). An indefinite Hessian is
/// shifted.
#[inline(always)]
pub(super) fn box_prox<E, T, const K: usize>(
    energy: &E,
    v: [T; K],
    k: T,
    warm: [T; K],
    low: f64,
    high: f64,
) -> Prox<T, K>
where
    E: Energy<K>,
    T: Real,
{
    let (bottom, top) = (T::splat(low), T::splat(high));
    let mut s = clamp(&v, low, high);
    let other = clamp(&warm, low, high);
    let mut phi = objective(energy, &s, &v, k);
    let at_other = objective(energy, &other, &v, k);
    let better = at_other.lt(phi);
    for i in 0..K {
        s[i] = T::select(better, other[i], s[i]);
    }
    phi = T::select(better, at_other, phi);
    // Differences of the objective below this are rounding.
    let noise = k * (squared_norm(&v) + 1.0) * 1e-13;
    let never = T::zero().lt(T::zero());
    let (mut active, mut converged) = (!never, never);

    for _ in 0..STEPS {
        let mut g = energy.gradient(s);
        let mut h = energy.hessian(s);
        for i in 0..K {
            g[i] = k.mul_add(s[i] - v[i], g[i]);
            h[i][i] += k;
        }
        for i in 0..K {
            let pinned = (s[i].le(bottom) & g[i].gt(T::zero())) | (s[i].ge(top) & g[i].lt(T::zero()));
            if pinned.any() {
                take_out(pinned, i, &mut g, &mut h);
            }
        }
        let (mut p, mut definite) = newton_step(&g, &mut h);
        // A stretch on the border whose gradient points inwards may be pushed outwards by the others.
        for _ in 1..K {
            let mut found = never;
            for i in 0..K {
                let outwards = (s[i].le(bottom) & p[i].lt(T::zero())) | (s[i].ge(top) & p[i].gt(T::zero()));
                found = found | outwards;
                if outwards.any() {
                    take_out(outwards, i, &mut g, &mut h);
                }
            }
            if !found.any() {
                break;
            }
            (p, definite) = newton_step(&g, &mut h);
        }

        let mut last = definite;
        for i in 0..K {
            last = last & p[i].abs().le(s[i].abs().max(T::splat(1e-2)) * LAST_STEP);
        }
        let slack = noise + phi.abs() * 1e-13;
        let mut length = T::one();
        let mut trying = active;
        for _ in 0..HALVINGS {
            let mut trial = s;
            for i in 0..K {
                trial[i] = length.mul_add(p[i], s[i]);
            }
            trial = clamp(&trial, low, high);
            let mut decrease = T::zero();
            for i in 0..K {
                decrease = g[i].mul_add(trial[i] - s[i], decrease);
            }
            let value = objective(energy, &trial, &v, k);
            let accept = trying & (value.le(decrease.mul_add(T::splat(1e-4), phi + slack)) | last);
            for i in 0..K {
                s[i] = T::select(accept, trial[i], s[i]);
            }
            phi = T::select(accept, value, phi);
            trying = trying & !accept;
            if !trying.any() {
                break;
            }
            length = T::select(trying, length * 0.5, length);
        }
        converged = converged | (active & last & !trying);
        active = active & !last & !trying;
        if !active.any() {
            break;
        }
    }
    let mut finite = phi.is_finite() & k.is_finite();
    for i in 0..K {
        finite = finite & v[i].is_finite();
    }
    Prox { s, converged: converged & finite }
}

/// -H^-1 g, with H shifted where it is not definite, and whether it was.
#[inline(always)]
fn newton_step<T: Real, const K: usize>(g: &[T; K], h: &mut [[T; K]; K]) -> ([T; K], T::Mask) {
    let mut factor = Ldlt::new(h);
    let definite = factor.definite;
    let mut p = minus(factor.solve(g));
    if !definite.all() {
        let saddle = factor.negative;
        shift(h, definite);
        factor = Ldlt::new(h);
        let shifted = minus(factor.solve(g));
        for i in 0..K {
            p[i] = T::select(definite, p[i], shifted[i]);
        }
        leave_saddle(&mut p, g, &saddle, definite);
    }
    (p, definite)
}
