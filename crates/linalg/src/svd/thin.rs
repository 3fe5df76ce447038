//! Thin matrices: 3x2 (a triangle in space) and single columns (a spring).

use super::Svd;
use super::frame::{Scaled, blend, columns, complete, cross, dot, from_columns, normalise, scale};
use super::plane::svd2_scaled;
use crate::simd::Real;

/// A = `U[:, ..2]` diag(s) V^T of a matrix of 3 rows and 2 columns: `s[0] >= s[1] >= 0`, V a proper rotation of the
/// plane, U a proper rotation of space. Its third column is the unit normal, along the cross product of the columns of
/// A where that is not 0.
///
/// |A - U diag(s) V^T| is a few machine epsilons times `s[0]`. The columns (a, b) are taken to triangular form by the
/// frame of a and of the part of b across it, and the 2x2 matrix is decomposed in closed form.
#[inline(always)]
pub fn svd32<T: Real>(a: [[T; 2]; 3]) -> Svd<T, 3, 2> {
    let scaled = scale(a);
    let [mut a0, a1] = columns(scaled.a);
    a0[0] += scaled.poison;
    let (x, length) = normalise(a0);
    let (e, f) = complete(x);
    let (across, height) = normalise([dot(e, a1), dot(f, a1)]);
    let y = blend(across[0], e, across[1], f);
    let n = cross(x, y);
    let (phi, s, theta) = svd2_scaled([[length, dot(x, a1)], [T::zero(), height]]);
    Svd {
        u: from_columns([blend(phi.c, x, phi.s, y), blend(phi.c, y, -phi.s, x), n]),
        // The determinant is length times height, and a negative stretch would be rounding.
        s: [s[0] * scaled.back, s[1].abs() * scaled.back],
        v: [[theta.c, -theta.s], [theta.s, theta.c]],
    }
}

/// A = `U[:, 0]` s of a single column of 3 entries: s is its length, `U[:, 0]` its direction (the first axis where it
/// is 0), and the rest of U completes a proper rotation.
#[inline(always)]
pub fn svd31<T: Real>(a: [[T; 1]; 3]) -> Svd<T, 3, 1> {
    let scaled = scale(a);
    let (n, length) = normalise(with_poison(&scaled));
    let (e, f) = complete(n);
    Svd { u: from_columns([n, e, f]), s: [length * scaled.back], v: [[one_or_nan(length)]] }
}

/// As [`svd31`] of a column of 2 entries.
#[inline(always)]
pub fn svd21<T: Real>(a: [[T; 1]; 2]) -> Svd<T, 2, 1> {
    let scaled = scale(a);
    let ([c, s], length) = normalise(with_poison(&scaled));
    Svd { u: [[c, -s], [s, c]], s: [length * scaled.back], v: [[one_or_nan(length)]] }
}

/// The only column, NaN where the poison is.
#[inline(always)]
fn with_poison<T: Real, const R: usize>(scaled: &Scaled<T, R, 1>) -> [T; R] {
    let [mut column] = columns(scaled.a);
    for k in 0..R {
        column[k] += scaled.poison;
    }
    column
}

/// 1, or NaN where the argument is.
#[inline(always)]
fn one_or_nan<T: Real>(x: T) -> T {
    T::select(x.le(T::splat(f64::MAX)), T::one(), T::splat(f64::NAN))
}
