//! Polar factors from a decomposition A = U diag(s) V^T.

use super::Svd;
use super::frame::dot;
use crate::simd::Real;

/// R = U V^T, the proper rotation nearest to A (signed polar decomposition A = R S).
#[inline(always)]
pub fn rotation<T: Real, const N: usize>(svd: &Svd<T, N, N>) -> [[T; N]; N] {
    svd.u.map(|u| svd.v.map(|v| dot(u, v)))
}

/// U[:, ..COLS] V^T of a thin matrix: orthonormal columns, the nearest ones to A.
#[inline(always)]
pub fn rotation_thin<T: Real, const ROWS: usize, const COLS: usize>(svd: &Svd<T, ROWS, COLS>) -> [[T; COLS]; ROWS] {
    svd.u.map(|u| {
        let u: [T; COLS] = std::array::from_fn(|k| u[k]);
        svd.v.map(|v| dot(u, v))
    })
}

/// sym(A) = V diag(s) V^T as (xx, yy, zz, xy, xz, yz); with signed stretches it is indefinite where A is inverted.
#[inline(always)]
pub fn stretch3<T: Real>(v: &[[T; 3]; 3], s: [T; 3]) -> [T; 6] {
    let vs = v.map(|row| [row[0] * s[0], row[1] * s[1], row[2] * s[2]]);
    [dot(vs[0], v[0]), dot(vs[1], v[1]), dot(vs[2], v[2]), dot(vs[0], v[1]), dot(vs[0], v[2]), dot(vs[1], v[2])]
}

/// sym(A) = V diag(s) V^T of two stretches, as (xx, yy, xy).
#[inline(always)]
pub fn stretch2<T: Real>(v: &[[T; 2]; 2], s: [T; 2]) -> [T; 3] {
    let vs = v.map(|row| [row[0] * s[0], row[1] * s[1]]);
    [dot(vs[0], v[0]), dot(vs[1], v[1]), dot(vs[0], v[1])]
}
