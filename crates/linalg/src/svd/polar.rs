//! Polar factors from a decomposition A = U diag(s) V^T.

use super::Svd;
use super::frame::{apply, dot};
use crate::simd::Real;

/// R = U V^T, the proper rotation nearest to A (signed polar decomposition A = R S).
#[inline(always)]
pub fn rotation<T: Real, const N: usize>(svd: &Svd<T, N, N>) -> [[T; N]; N] {
    rotation_thin(svd)
}

/// `U[:, ..COLS]` V^T of a thin matrix: orthonormal columns, the nearest ones to A.
#[inline(always)]
pub fn rotation_thin<T: Real, const ROWS: usize, const COLS: usize>(svd: &Svd<T, ROWS, COLS>) -> [[T; COLS]; ROWS] {
    let mut r = [[T::zero(); COLS]; ROWS];
    for i in 0..ROWS {
        let mut u = [T::zero(); COLS];
        u.copy_from_slice(&svd.u[i][..COLS]);
        r[i] = apply(&svd.v, u);
    }
    r
}

/// sym(A) = V diag(s) V^T as (xx, yy, zz, xy, xz, yz); with signed stretches it is indefinite where A is inverted.
#[inline(always)]
pub fn stretch3<T: Real>(v: &[[T; 3]; 3], s: [T; 3]) -> [T; 6] {
    let vs = scale_columns(v, s);
    [dot(vs[0], v[0]), dot(vs[1], v[1]), dot(vs[2], v[2]), dot(vs[0], v[1]), dot(vs[0], v[2]), dot(vs[1], v[2])]
}

/// sym(A) = V diag(s) V^T of two stretches, as (xx, yy, xy).
#[inline(always)]
pub fn stretch2<T: Real>(v: &[[T; 2]; 2], s: [T; 2]) -> [T; 3] {
    let vs = scale_columns(v, s);
    [dot(vs[0], v[0]), dot(vs[1], v[1]), dot(vs[0], v[1])]
}

/// V diag(s)
#[inline(always)]
fn scale_columns<T: Real, const N: usize>(v: &[[T; N]; N], s: [T; N]) -> [[T; N]; N] {
    let mut vs = *v;
    for r in 0..N {
        for c in 0..N {
            vs[r][c] = v[r][c] * s[c];
        }
    }
    vs
}
