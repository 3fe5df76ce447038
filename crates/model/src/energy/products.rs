//! Products of stretches: J = s_1 .. s_K and its derivatives.

use proxel_linalg::simd::Real;

/// J = s_1 .. s_K.
#[inline(always)]
pub(super) fn product<T: Real, const K: usize>(s: &[T; K]) -> T {
    let mut j = s[0];
    for i in 1..K {
        j = j * s[i];
    }
    j
}

/// dJ / ds_i: the products of all other stretches.
#[inline(always)]
pub(super) fn cofactors<T: Real, const K: usize>(s: &[T; K]) -> [T; K] {
    let mut c = [T::one(); K];
    for i in 0..K {
        for n in 0..K {
            if n != i {
                c[i] = c[i] * s[n];
            }
        }
    }
    c
}

/// d^2 J / ds_i ds_j, i != j: the product of the stretches besides these two, which is 1 for K = 2.
#[inline(always)]
pub(super) fn product_without<T: Real, const K: usize>(s: &[T; K], i: usize, j: usize) -> T {
    let mut p = T::one();
    for n in 0..K {
        if n != i && n != j {
            p = p * s[n];
        }
    }
    p
}

/// |s|^2.
#[inline(always)]
pub(super) fn squared_norm<T: Real, const K: usize>(s: &[T; K]) -> T {
    let mut q = s[0] * s[0];
    for i in 1..K {
        q = s[i].mul_add(s[i], q);
    }
    q
}

/// sum f(s_i).
#[inline(always)]
pub(super) fn sum<T: Real, const K: usize>(s: &[T; K], f: impl Fn(T) -> T) -> T {
    let mut q = f(s[0]);
    for i in 1..K {
        q += f(s[i]);
    }
    q
}

/// The Hessian of diagonal/2 |s|^2 + h(J) from h' and h'': h'' c_i c_j + h' d^2 J / ds_i ds_j with c the cofactors.
#[inline(always)]
pub(super) fn hessian_with_volume<T: Real, const K: usize>(s: &[T; K], h1: T, h2: T, diagonal: T) -> [[T; K]; K] {
    let c = cofactors(s);
    let mut h = [[T::zero(); K]; K];
    for i in 0..K {
        h[i][i] = (h2 * c[i]).mul_add(c[i], diagonal);
        for j in i + 1..K {
            h[i][j] = (h2 * c[i]).mul_add(c[j], h1 * product_without(s, i, j));
            h[j][i] = h[i][j];
        }
    }
    h
}
