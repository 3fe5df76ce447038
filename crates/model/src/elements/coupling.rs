//! Couplings: what of the deformation gradient is split off into the local variable.

use super::shape::{Decomposed, Shape, Simplex};
use proxel_linalg::simd::{F8, Isa, Real};

/// The coupling c of the constraint c(Dx) = z, and the prox's frame in it.
pub trait Coupling<const D: usize, const K: usize>: Send + Sync + 'static {
    /// Numbers an element in a local vector.
    const LOCAL: usize;
    /// Numbers an element kept of the decomposition of F.
    const SAVED: usize;
    /// What is known of F where a block is visited.
    type At<T: Real>: Copy;
    /// An element's part of a local vector.
    type Local<T: Real>: Copy;

    /// Visits a block: from F, or from what was saved of it where that is still `fresh`.
    fn arrive<I: Isa>(f: impl FnOnce() -> [[F8<I>; K]; D], saved: &mut [f64], fresh: bool) -> Self::At<F8<I>>;

    /// The decomposition of F.
    fn decomposed<T: Real>(at: &Self::At<T>) -> Decomposed<T, D, K>;

    /// c(F)
    fn couple<T: Real>(at: &Self::At<T>) -> Self::Local<T>;

    /// The gradient of 1/2 |c(F) - p|^2 in F, W(13)-(16).
    fn penalty_gradient<T: Real>(at: &Self::At<T>, p: &Self::Local<T>) -> [[T; K]; D];

    /// z = argmin psi(z) + k/2 |z - v|^2: `prox` maps the stretches of v to those of z, in the frame of v.
    fn prox<T: Real>(v: &Self::Local<T>, prox: impl FnOnce([T; K]) -> [T; K]) -> Self::Local<T>;

    /// The stretches of a local value.
    fn combine<T: Real>(a: &Self::Local<T>, b: &Self::Local<T>, f: impl Fn(T, T) -> T) -> Self::Local<T>;

    /// |a|^2 in the Frobenius norm.
    fn norm2<T: Real>(a: &Self::Local<T>) -> T;

    /// From a block of a local vector.
    fn load<I: Isa>(from: &[f64]) -> Self::Local<F8<I>>;

    /// To a block of a local vector.
    fn store<I: Isa>(a: &Self::Local<F8<I>>, to: &mut [f64]);
}

/// c(F) = F: ADMM-PD and W-ADMM.
pub struct Linear;

/// c(F) = sym(F) = V diag(s) V^T, the stretch of the polar decomposition: R-ADMM and WRAPD, W(8). Symmetric matrices are
/// stored as their diagonal and sqrt 2 times what is above it, so that the norm of the numbers is the norm of the matrix.
pub struct Polar;

/// A B^T of matrices given by rows.
#[inline(always)]
pub(super) fn times_transposed<T: Real, const R: usize, const C: usize, const K: usize>(a: &[[T; K]; R], b: &[[T; K]; C]) -> [[T; C]; R] {
    std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            let mut sum = a[r][0] * b[c][0];
            for k in 1..K {
                sum = a[r][k].mul_add(b[c][k], sum);
            }
            sum
        })
    })
}

/// A diag(s) B^T
#[inline(always)]
pub(super) fn compose<T: Real, const R: usize, const C: usize, const K: usize>(a: &[[T; K]; R], s: &[T; K], b: &[[T; K]; C]) -> [[T; C]; R] {
    let scaled: [[T; K]; R] = std::array::from_fn(|r| std::array::from_fn(|k| a[r][k] * s[k]));
    times_transposed(&scaled, b)
}

/// V diag(s) V^T, only one triangle computed.
#[inline(always)]
fn compose_symmetric<T: Real, const K: usize>(v: &[[T; K]; K], s: &[T; K]) -> [[T; K]; K] {
    let mut a = [[T::zero(); K]; K];
    for r in 0..K {
        for c in r..K {
            let mut sum = v[r][0] * s[0] * v[c][0];
            for k in 1..K {
                sum = (v[r][k] * s[k]).mul_add(v[c][k], sum);
            }
            a[r][c] = sum;
            a[c][r] = sum;
        }
    }
    a
}

/// V^T A V of a symmetric A.
#[inline(always)]
fn in_frame<T: Real, const K: usize>(v: &[[T; K]; K], a: &[[T; K]; K]) -> [[T; K]; K] {
    let mut av = [[T::zero(); K]; K];
    for r in 0..K {
        for c in 0..K {
            let mut sum = a[r][0] * v[0][c];
            for k in 1..K {
                sum = a[r][k].mul_add(v[k][c], sum);
            }
            av[r][c] = sum;
        }
    }
    let mut out = [[T::zero(); K]; K];
    for r in 0..K {
        for c in r..K {
            let mut sum = v[0][r] * av[0][c];
            for k in 1..K {
                sum = v[k][r].mul_add(av[k][c], sum);
            }
            out[r][c] = sum;
            out[c][r] = sum;
        }
    }
    out
}

impl<const D: usize, const K: usize> Coupling<D, K> for Linear
where
    Simplex: Shape<D, K>,
{
    const LOCAL: usize = D * K;
    const SAVED: usize = 0;
    type At<T: Real> = [[T; K]; D];
    type Local<T: Real> = [[T; K]; D];

    #[inline(always)]
    fn arrive<I: Isa>(f: impl FnOnce() -> [[F8<I>; K]; D], _: &mut [f64], _: bool) -> [[F8<I>; K]; D] {
        f()
    }
    #[inline(always)]
    fn decomposed<T: Real>(at: &[[T; K]; D]) -> Decomposed<T, D, K> {
        Simplex::svd(*at)
    }
    #[inline(always)]
    fn couple<T: Real>(at: &[[T; K]; D]) -> [[T; K]; D] {
        *at
    }
    #[inline(always)]
    fn penalty_gradient<T: Real>(at: &[[T; K]; D], p: &[[T; K]; D]) -> [[T; K]; D] {
        <Self as Coupling<D, K>>::combine(at, p, |a, p| a - p)
    }
    #[inline(always)]
    fn prox<T: Real>(v: &[[T; K]; D], prox: impl FnOnce([T; K]) -> [T; K]) -> [[T; K]; D] {
        let d: Decomposed<T, D, K> = Simplex::svd(*v);
        compose(&d.u, &prox(d.s), &d.v)
    }
    #[inline(always)]
    fn combine<T: Real>(a: &[[T; K]; D], b: &[[T; K]; D], f: impl Fn(T, T) -> T) -> [[T; K]; D] {
        std::array::from_fn(|r| std::array::from_fn(|c| f(a[r][c], b[r][c])))
    }
    #[inline(always)]
    fn norm2<T: Real>(a: &[[T; K]; D]) -> T {
        let mut sum = T::zero();
        for r in 0..D {
            for c in 0..K {
                sum = a[r][c].mul_add(a[r][c], sum);
            }
        }
        sum
    }
    #[inline(always)]
    fn load<I: Isa>(from: &[f64]) -> [[F8<I>; K]; D] {
        std::array::from_fn(|r| std::array::from_fn(|c| F8::load_at(from, r * K + c)))
    }
    #[inline(always)]
    fn store<I: Isa>(a: &[[F8<I>; K]; D], to: &mut [f64]) {
        for r in 0..D {
            for c in 0..K {
                a[r][c].store_at(to, r * K + c);
            }
        }
    }
}

/// s_i + s_j below this part of s_1 is taken as this: sym is not differentiable where s_i + s_j = 0.
const LEAST_SUM: f64 = 1e-6;

impl<const D: usize, const K: usize> Coupling<D, K> for Polar
where
    Simplex: Shape<D, K>,
{
    const LOCAL: usize = K * (K + 1) / 2;
    const SAVED: usize = <Simplex as Shape<D, K>>::SAVED;
    type At<T: Real> = Decomposed<T, D, K>;
    type Local<T: Real> = [[T; K]; K];

    #[inline(always)]
    fn arrive<I: Isa>(f: impl FnOnce() -> [[F8<I>; K]; D], saved: &mut [f64], fresh: bool) -> Decomposed<F8<I>, D, K> {
        if fresh {
            return Simplex::load(saved);
        }
        let d = Simplex::svd(f());
        Simplex::save(&d, saved);
        d
    }
    #[inline(always)]
    fn decomposed<T: Real>(at: &Decomposed<T, D, K>) -> Decomposed<T, D, K> {
        *at
    }
    #[inline(always)]
    fn couple<T: Real>(at: &Decomposed<T, D, K>) -> [[T; K]; K] {
        compose_symmetric(&at.v, &at.s)
    }
    /// F - U H V^T with H_ij = 2 s_i/(s_i + s_j) v_i^T P v_j; on the diagonal v_i^T P v_i directly, since
    /// s_i/(s_i + s_i) fails at 0.
    #[inline(always)]
    fn penalty_gradient<T: Real>(at: &Decomposed<T, D, K>, p: &[[T; K]; K]) -> [[T; K]; D] {
        let p = in_frame(&at.v, p);
        let mut m = [[T::zero(); K]; K]; // diag(s) - H
        let floor = (at.s[0].abs() * LEAST_SUM).max(T::splat(f64::MIN_POSITIVE));
        for i in 0..K {
            m[i][i] = at.s[i] - p[i][i];
            for j in i + 1..K {
                let c = (p[i][j] * 2.0) / (at.s[i] + at.s[j]).max(floor);
                m[i][j] = -(c * at.s[i]);
                m[j][i] = -(c * at.s[j]);
            }
        }
        let mut um = [[T::zero(); K]; D];
        for r in 0..D {
            for c in 0..K {
                let mut sum = at.u[r][0] * m[0][c];
                for k in 1..K {
                    sum = at.u[r][k].mul_add(m[k][c], sum);
                }
                um[r][c] = sum;
            }
        }
        times_transposed(&um, &at.v)
    }
    #[inline(always)]
    fn prox<T: Real>(v: &[[T; K]; K], prox: impl FnOnce([T; K]) -> [T; K]) -> [[T; K]; K] {
        let (q, l) = Simplex::eigen(*v);
        compose_symmetric(&q, &prox(l))
    }
    #[inline(always)]
    fn combine<T: Real>(a: &[[T; K]; K], b: &[[T; K]; K], f: impl Fn(T, T) -> T) -> [[T; K]; K] {
        std::array::from_fn(|r| std::array::from_fn(|c| f(a[r][c], b[r][c])))
    }
    #[inline(always)]
    fn norm2<T: Real>(a: &[[T; K]; K]) -> T {
        let (mut diagonal, mut above) = (T::zero(), T::zero());
        for r in 0..K {
            diagonal = a[r][r].mul_add(a[r][r], diagonal);
            for c in r + 1..K {
                above = a[r][c].mul_add(a[r][c], above);
            }
        }
        above * 2.0 + diagonal
    }
    #[inline(always)]
    fn load<I: Isa>(from: &[f64]) -> [[F8<I>; K]; K] {
        let mut a = [[F8::zero(); K]; K];
        let mut at = K;
        for r in 0..K {
            a[r][r] = F8::load_at(from, r);
            for c in r + 1..K {
                a[r][c] = F8::load_at(from, at) * std::f64::consts::FRAC_1_SQRT_2;
                a[c][r] = a[r][c];
                at += 1;
            }
        }
        a
    }
    #[inline(always)]
    fn store<I: Isa>(a: &[[F8<I>; K]; K], to: &mut [f64]) {
        let mut at = K;
        for r in 0..K {
            a[r][r].store_at(to, r);
            for c in r + 1..K {
                (a[r][c] * std::f64::consts::SQRT_2).store_at(to, at);
                at += 1;
            }
        }
    }
}
