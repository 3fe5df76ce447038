//! Couplings: what of the deformation gradient is split off into the local variable.

use super::matrix::{add_symmetric, compose, compose_symmetric, in_frame, norm2, norm2_symmetric, times_frame};
use super::shape::{Decomposed, Shape, Simplex};
use proxel_linalg::simd::{F8, Isa, Real};

/// The coupling c of the constraint c(Dx) = z of elements whose deformation gradient F is D x K.
pub trait Coupling<const D: usize, const K: usize>: Send + Sync + 'static {
    /// Numbers an element in a local vector.
    const LOCAL: usize;
    /// Whether a local value is symmetric, so that its frame is one rotation.
    const SYMMETRIC: bool;
    /// Whether the decomposition of F is known wherever an element is visited.
    const DECOMPOSES: bool;
    /// What is known of F where an element is visited.
    type At<T: Real>: Copy;
    /// An element's part of a local vector.
    type Local<T: Real>: Copy;

    /// From F.
    fn visit<T: Real>(f: [[T; K]; D]) -> Self::At<T>;

    /// To a block of scratch with `(D + 1 + K) K` components.
    fn keep<I: Isa>(at: &Self::At<F8<I>>, to: &mut [f64]);

    /// From there.
    fn kept<I: Isa>(from: &[f64]) -> Self::At<F8<I>>;

    /// The decomposition of F.
    fn decomposed<T: Real>(at: &Self::At<T>) -> Decomposed<T, D, K>;

    /// c(F)
    fn couple<T: Real>(at: &Self::At<T>) -> Self::Local<T>;

    /// The gradient of 1/2 |c(F) - p|^2 in F, W(13)-(16).
    fn penalty_gradient<T: Real>(at: &Self::At<T>, p: &Self::Local<T>) -> [[T; K]; D];

    /// The frame in which the prox of v is one of stretches: v = u diag(s) v^T.
    fn frame<T: Real>(v: &Self::Local<T>) -> Decomposed<T, D, K>;

    /// The local value of stretches in a frame.
    fn in_frame<T: Real>(frame: &Decomposed<T, D, K>) -> Self::Local<T>;

    /// a + b
    fn add<T: Real>(a: &Self::Local<T>, b: &Self::Local<T>) -> Self::Local<T>;

    /// a - b
    fn subtract<T: Real>(a: &Self::Local<T>, b: &Self::Local<T>) -> Self::Local<T>;

    /// k a
    fn times<T: Real>(a: &Self::Local<T>, k: f64) -> Self::Local<T>;

    /// |a|^2 in the Frobenius norm.
    fn norm2<T: Real>(a: &Self::Local<T>) -> T;

    /// From a block of a local vector.
    fn load<I: Isa>(from: &[f64]) -> Self::Local<F8<I>>;

    /// To a block of a local vector.
    fn store<I: Isa>(a: &Self::Local<F8<I>>, to: &mut [f64]);
}

/// The rows of a matrix, one component after another from `at` on.
#[inline(always)]
pub(super) fn store_rows<I: Isa, const R: usize, const C: usize>(a: &[[F8<I>; C]; R], to: &mut [f64], at: usize) {
    for r in 0..R {
        for c in 0..C {
            a[r][c].store_at(to, at + r * C + c);
        }
    }
}

/// Back from there.
#[inline(always)]
pub(super) fn load_rows<I: Isa, const R: usize, const C: usize>(from: &[f64], at: usize) -> [[F8<I>; C]; R] {
    let mut a = [[F8::zero(); C]; R];
    for r in 0..R {
        for c in 0..C {
            a[r][c] = F8::load_at(from, at + r * C + c);
        }
    }
    a
}

impl<I: Isa, const D: usize, const K: usize> Decomposed<F8<I>, D, K> {
    /// Stretches, V, U: (1 + K + D) K components.
    #[inline(always)]
    pub(super) fn keep(&self, to: &mut [f64]) {
        store_rows(&[self.s], to, 0);
        store_rows(&self.v, to, K);
        store_rows(&self.u, to, K + K * K);
    }

    /// Back from there.
    #[inline(always)]
    pub(super) fn kept(from: &[f64]) -> Self {
        let [s] = load_rows(from, 0);
        Decomposed { s, v: load_rows(from, K), u: load_rows(from, K + K * K) }
    }
}

/// c(F) = F: ADMM-PD and W-ADMM.
pub struct Linear;

/// c(F) = sym(F) = V diag(s) V^T, the stretch of the polar decomposition: R-ADMM and WRAPD, W(8). Symmetric matrices are
/// stored as their diagonal and sqrt 2 times what is above it, so that the norm of the numbers is the norm of the matrix.
pub struct Polar;

#[inline(always)]
fn entrywise<T: Real, const R: usize, const C: usize>(a: &[[T; C]; R], b: &[[T; C]; R], sign: f64) -> [[T; C]; R] {
    let mut out = *a;
    for r in 0..R {
        for c in 0..C {
            out[r][c] = if sign > 0.0 { a[r][c] + b[r][c] } else { a[r][c] - b[r][c] };
        }
    }
    out
}

impl<const D: usize, const K: usize> Coupling<D, K> for Linear
where
    Simplex: Shape<D, K>,
{
    const LOCAL: usize = D * K;
    const SYMMETRIC: bool = false;
    const DECOMPOSES: bool = false;
    type At<T: Real> = [[T; K]; D];
    type Local<T: Real> = [[T; K]; D];

    #[inline(always)]
    fn visit<T: Real>(f: [[T; K]; D]) -> [[T; K]; D] {
        f
    }
    #[inline(always)]
    fn keep<I: Isa>(at: &[[F8<I>; K]; D], to: &mut [f64]) {
        store_rows(at, to, 0);
    }
    #[inline(always)]
    fn kept<I: Isa>(from: &[f64]) -> [[F8<I>; K]; D] {
        load_rows(from, 0)
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
        entrywise(at, p, -1.0)
    }
    #[inline(always)]
    fn frame<T: Real>(v: &[[T; K]; D]) -> Decomposed<T, D, K> {
        Simplex::svd(*v)
    }
    #[inline(always)]
    fn in_frame<T: Real>(frame: &Decomposed<T, D, K>) -> [[T; K]; D] {
        compose(&frame.u, &frame.s, &frame.v)
    }
    #[inline(always)]
    fn add<T: Real>(a: &[[T; K]; D], b: &[[T; K]; D]) -> [[T; K]; D] {
        entrywise(a, b, 1.0)
    }
    #[inline(always)]
    fn subtract<T: Real>(a: &[[T; K]; D], b: &[[T; K]; D]) -> [[T; K]; D] {
        entrywise(a, b, -1.0)
    }
    #[inline(always)]
    fn times<T: Real>(a: &[[T; K]; D], k: f64) -> [[T; K]; D] {
        a.map(|row| row.map(|v| v * k))
    }
    #[inline(always)]
    fn norm2<T: Real>(a: &[[T; K]; D]) -> T {
        norm2(a)
    }
    #[inline(always)]
    fn load<I: Isa>(from: &[f64]) -> [[F8<I>; K]; D] {
        load_rows(from, 0)
    }
    #[inline(always)]
    fn store<I: Isa>(a: &[[F8<I>; K]; D], to: &mut [f64]) {
        store_rows(a, to, 0);
    }
}

/// s_i + s_j below this part of s_1 is taken as this: sym is not differentiable where s_i + s_j = 0.
const LEAST_SUM: f64 = 1e-6;

impl<const D: usize, const K: usize> Coupling<D, K> for Polar
where
    Simplex: Shape<D, K>,
{
    const LOCAL: usize = K * (K + 1) / 2;
    const SYMMETRIC: bool = true;
    const DECOMPOSES: bool = true;
    type At<T: Real> = Decomposed<T, D, K>;
    type Local<T: Real> = [[T; K]; K];

    #[inline(always)]
    fn visit<T: Real>(f: [[T; K]; D]) -> Decomposed<T, D, K> {
        Simplex::svd(f)
    }
    #[inline(always)]
    fn keep<I: Isa>(at: &Decomposed<F8<I>, D, K>, to: &mut [f64]) {
        at.keep(to);
    }
    #[inline(always)]
    fn kept<I: Isa>(from: &[f64]) -> Decomposed<F8<I>, D, K> {
        Decomposed::kept(from)
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
        times_frame(&at.u, &m, &at.v)
    }
    #[inline(always)]
    fn frame<T: Real>(v: &[[T; K]; K]) -> Decomposed<T, D, K> {
        let (q, s) = Simplex::eigen(*v);
        Decomposed { u: [[T::zero(); K]; D], s, v: q }
    }
    #[inline(always)]
    fn in_frame<T: Real>(frame: &Decomposed<T, D, K>) -> [[T; K]; K] {
        compose_symmetric(&frame.v, &frame.s)
    }
    #[inline(always)]
    fn add<T: Real>(a: &[[T; K]; K], b: &[[T; K]; K]) -> [[T; K]; K] {
        add_symmetric(a, b, 1.0)
    }
    #[inline(always)]
    fn subtract<T: Real>(a: &[[T; K]; K], b: &[[T; K]; K]) -> [[T; K]; K] {
        add_symmetric(a, b, -1.0)
    }
    #[inline(always)]
    fn times<T: Real>(a: &[[T; K]; K], k: f64) -> [[T; K]; K] {
        a.map(|row| row.map(|v| v * k))
    }
    #[inline(always)]
    fn norm2<T: Real>(a: &[[T; K]; K]) -> T {
        norm2_symmetric(a)
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
