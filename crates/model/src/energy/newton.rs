//! The proximal operator of any energy: a safeguarded Newton method.

use super::products::squared_norm;
use super::symmetric::{Ldlt, largest_eigenvalue};
use super::{Energy, Prox};
use proxel_linalg::simd::{Mask, Real};

/// Newton steps before a lane is given up.
const STEPS: usize = 80;
/// Halvings of one step before a lane is given up.
const HALVINGS: usize = 40;
/// A last full step of this relative length: the error left is its square, far below rounding of the gradient.
const LAST_STEP: f64 = 1e-8;
/// Stretches below this count as lying on the bound s >= 0 if the gradient pushes them there.
const ON_BOUND: f64 = 1e-8;

/// argmin psi(s) + k/2 |s - v|^2 in the lanes of `todo` by descent from `start`, with the tolerance told at
/// [`Energy::prox`]; the other lanes return `start`, not converged. Where `start` is not admissible it is replaced by rest.
///
/// Newton's method with three safeguards: an indefinite Hessian is shifted until its least eigenvalue has changed sign,
/// and near a saddle a direction of negative curvature is added; a step is halved until the objective decreases
/// (Armijo); with a barrier no step goes further than 0.9 of the way to the border, with a bound it is projected
/// (Bertsekas, "Projected Newton methods for optimization problems with simple constraints", 1982). A lane that has
/// converged does not change any more.
#[inline(always)]
pub fn newton_prox<E, T, const K: usize>(energy: &E, v: [T; K], k: T, start: [T; K], todo: T::Mask) -> Prox<T, K>
where
    E: Energy<K>,
    T: Real,
{
    let mut s = admissible::<E, T, K>(&start);
    let mut phi = objective(energy, &s, &v, k);
    // Differences of the objective below this are rounding.
    let noise = k * (squared_norm(&v) + 1.0) * 1e-13;
    let never = T::zero().lt(T::zero());
    let (mut active, mut converged) = (todo, never);

    for _ in 0..STEPS {
        let mut g = energy.gradient(s);
        let mut h = energy.hessian(s);
        for i in 0..K {
            g[i] = k.mul_add(s[i] - v[i], g[i]);
            h[i][i] += k;
        }
        if E::PROX_POSITIVE && !E::BARRIER {
            pin_to_bound(&s, &mut g, &mut h);
        }
        let mut factor = Ldlt::new(&h);
        let definite = factor.definite;
        let mut p = minus(factor.solve(&g));
        if !(definite | !active).all() {
            let saddle = factor.negative;
            shift(&mut h, definite);
            factor = Ldlt::new(&h);
            let shifted = minus(factor.solve(&g));
            for i in 0..K {
                p[i] = T::select(definite, p[i], shifted[i]);
            }
            leave_saddle(&mut p, &g, &saddle, definite);
        }

        let mut length = T::one();
        let mut last = definite;
        for i in 0..K {
            let scale = if E::BARRIER { s[i] } else { s[i].abs().max(T::splat(1e-2)) };
            last = last & p[i].abs().le(scale * LAST_STEP);
            if E::BARRIER {
                let room = s[i] * 0.9 / -p[i];
                length = T::select(p[i].lt(T::zero()), length.min(room), length);
            }
        }
        let slack = noise + phi.abs() * 1e-13;
        let mut trying = active;
        let sure = (last | !active).all(); // last steps need no objective
        for _ in 0..HALVINGS {
            let mut trial = s;
            let mut decrease = T::zero();
            for i in 0..K {
                trial[i] = length.mul_add(p[i], s[i]);
                if E::PROX_POSITIVE && !E::BARRIER {
                    trial[i] = trial[i].max(T::zero());
                }
                decrease = g[i].mul_add(trial[i] - s[i], decrease);
            }
            let value = if sure { phi } else { objective(energy, &trial, &v, k) };
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
    let finite = phi.is_finite();
    for i in 0..K {
        s[i] = T::select(todo, s[i], start[i]);
    }
    Prox { s, converged: converged & finite }
}

/// psi(s) + k/2 |s - v|^2
#[inline(always)]
pub(super) fn objective<E, T, const K: usize>(energy: &E, s: &[T; K], v: &[T; K], k: T) -> T
where
    E: Energy<K>,
    T: Real,
{
    let mut d = *s;
    for i in 0..K {
        d[i] = s[i] - v[i];
    }
    (k * 0.5).mul_add(squared_norm(&d), energy.value(*s))
}

/// `s` with stretches that are absurd (no finite number, or so large that psi may overflow), or not positive where they
/// must be, replaced by 1.
#[inline(always)]
fn admissible<E, T, const K: usize>(s: &[T; K]) -> [T; K]
where
    E: Energy<K>,
    T: Real,
{
    let mut a = *s;
    for i in 0..K {
        let sane = s[i].abs().le(T::splat(1e30));
        let good = if E::PROX_POSITIVE { s[i].gt(T::zero()) & sane } else { sane };
        a[i] = T::select(good, s[i], T::one());
    }
    a
}

/// The better of `warm` and `v`, both brought into the domain: where [`newton_prox`] had best start.
#[inline(always)]
pub(super) fn better_start<E, T, const K: usize>(energy: &E, v: &[T; K], k: T, warm: &[T; K]) -> [T; K]
where
    E: Energy<K>,
    T: Real,
{
    let mut a = admissible::<E, T, K>(warm);
    let mut b = *v;
    for i in 0..K {
        b[i] = if E::PROX_POSITIVE { v[i].max(T::splat(0.1)) } else { v[i] };
    }
    let (at_a, at_b) = (objective(energy, &a, v, k), objective(energy, &b, v, k));
    let second = at_b.lt(at_a);
    for i in 0..K {
        a[i] = T::select(second, b[i], a[i]);
    }
    a
}

/// Takes the stretches that lie on the bound and are pushed against it out of the Newton system; they step to 0.
#[inline(always)]
fn pin_to_bound<T: Real, const K: usize>(s: &[T; K], g: &mut [T; K], h: &mut [[T; K]; K]) {
    for i in 0..K {
        let pinned = s[i].le(T::splat(ON_BOUND)) & g[i].gt(T::zero());
        if !pinned.any() {
            continue;
        }
        g[i] = T::select(pinned, s[i], g[i]);
        for j in 0..K {
            h[i][j] = T::select(pinned, T::zero(), h[i][j]);
            h[j][i] = T::select(pinned, T::zero(), h[j][i]);
        }
        h[i][i] = T::select(pinned, T::one(), h[i][i]);
    }
}

/// Where not definite: h += t I so that the least eigenvalue becomes its own magnitude, and is not tiny.
#[inline(always)]
pub(super) fn shift<T: Real, const K: usize>(h: &mut [[T; K]; K], definite: T::Mask) {
    let mut negated = *h;
    let mut size = T::zero();
    for i in 0..K {
        for j in 0..K {
            negated[i][j] = -h[i][j];
            size = size.max(h[i][j].abs());
        }
    }
    let least = -largest_eigenvalue(&negated);
    let wanted = least.abs().max(size * 1e-3);
    let t = T::select(definite, T::zero(), wanted - least);
    for i in 0..K {
        h[i][i] += t;
    }
}

/// Near a saddle the gradient does not tell the way down: a step shorter than 1e-3 gets 0.1 of a direction of negative
/// curvature, turned so that it does not climb.
#[inline(always)]
pub(super) fn leave_saddle<T: Real, const K: usize>(p: &mut [T; K], g: &[T; K], negative: &[T; K], definite: T::Mask) {
    let (mut largest, mut norm, mut slope) = (T::zero(), T::zero(), T::zero());
    for i in 0..K {
        largest = largest.max(p[i].abs());
        norm = norm.max(negative[i].abs());
        slope = g[i].mul_add(negative[i], slope);
    }
    let add = !definite & largest.lt(T::splat(1e-3));
    let factor = (T::splat(0.1) / norm).copysign(-slope);
    for i in 0..K {
        p[i] = T::select(add, factor.mul_add(negative[i], p[i]), p[i]);
    }
}

#[inline(always)]
pub(super) fn minus<T: Real, const K: usize>(mut x: [T; K]) -> [T; K] {
    for i in 0..K {
        x[i] = -x[i];
    }
    x
}
