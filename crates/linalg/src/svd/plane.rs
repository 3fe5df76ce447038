//! The signed decomposition of 2x2 matrices in closed form.

use super::Svd;
use super::frame::scale;
use crate::simd::Real;

/// The cosine and sine of an angle, or a multiple of both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turn<T> {
    /// Cosine.
    pub c: T,
    /// Sine.
    pub s: T,
}

/// A vector at half the angle of (x, y), not normalised, its square length, and |(x, y)|.
/// Where |(x, y)| is below 1e-65 the angle counts as 0.
#[inline(always)]
pub(super) fn half_angle<T: Real>(x: T, y: T) -> (Turn<T>, T, T) {
    const SMALLEST: f64 = 1e-130;
    let square = x.mul_add(x, y * y);
    let zero = square.lt(T::splat(SMALLEST));
    let r = square * square.max(T::splat(SMALLEST)).rsqrt();
    // (r + x, y), or for x < 0 the same direction without cancellation, (|y|, +-(r - x)).
    let k = r + x.abs();
    let left = x.lt(T::zero());
    let c = T::select(zero, T::one(), T::select(left, y.abs(), k));
    let s = T::select(zero, T::zero(), T::select(left, k.copysign(y), y));
    (Turn { c, s }, c.mul_add(c, s * s), r)
}

/// M = U(phi) diag(s) V(theta)^T of a matrix with entries from about 1 to 0 in magnitude, as (phi, s, theta);
/// `s[0] >= |s[1]|`.
///
/// With E, H = (a + d)/2, (c - b)/2 and F, G = (a - d)/2, (b + c)/2 the matrix is |(E, H)| times a rotation by
/// phi - theta plus |(F, G)| times a reflection of angle phi + theta, and the stretches are their sum and difference.
#[inline(always)]
pub(super) fn svd2_scaled<T: Real>(m: [[T; 2]; 2]) -> (Turn<T>, [T; 2], Turn<T>) {
    let [[a, b], [c, d]] = m;
    let (rotating, rotating_square, q) = half_angle((a + d) * 0.5, (c - b) * 0.5);
    let (mirroring, mirroring_square, r) = half_angle((a - d) * 0.5, (b + c) * 0.5);
    // Sum and difference of the two half angles have vectors of the same length.
    let unit = (rotating_square * mirroring_square).rsqrt();
    let (cc, ss) = (rotating.c * mirroring.c, rotating.s * mirroring.s);
    let (sc, cs) = (mirroring.s * rotating.c, mirroring.c * rotating.s);
    let phi = Turn { c: (cc - ss) * unit, s: (sc + cs) * unit };
    let theta = Turn { c: (cc + ss) * unit, s: (sc - cs) * unit };
    (phi, [q + r, q - r], theta)
}

/// A = U diag(s) V^T of a 2x2 matrix; `s[0] >= |s[1]|`, and `s[1]` has the sign of det A.
#[inline(always)]
pub fn svd2<T: Real>(a: [[T; 2]; 2]) -> Svd<T, 2, 2> {
    let scaled = scale(a);
    let [[xx, xy], yrow] = scaled.a;
    let (phi, s, theta) = svd2_scaled([[xx + scaled.poison, xy], yrow]);
    Svd {
        u: [[phi.c, -phi.s], [phi.s, phi.c]],
        s: [s[0] * scaled.back, s[1] * scaled.back],
        v: [[theta.c, -theta.s], [theta.s, theta.c]],
    }
}
