//! The signed decomposition of 3x3 matrices.

use super::Svd;
use super::eigen::{Apart, apart};
use super::frame::{
    Scaled, apply, blend, choose, columns, complete, cross, dot, from_columns, normalise, scale, times,
};
use super::plane::svd2_scaled;
use crate::simd::Real;

/// A = U diag(s) V^T of a 3x3 matrix, U and V proper rotations, `s[0] >= s[1] >= |s[2]|`, and `s[2]` has the sign of
/// det A.
///
/// |A - U diag(s) V^T| is a few machine epsilons times `s[0]`, and so are the errors of the stretches.
///
/// Let w be the eigenvector of A^T A that stands apart ([`super::eigen`]), and (e, f) complete it. If it belongs to the
/// largest stretch then z = A w / |A w|. If it belongs to the smallest then the other two stretches are at least `s[0]`
/// / sqrt 3, and z is the unit vector along A e x A f. In both cases the rotations (z, p, q) and (w, e, f) take A to
/// s_w next to a 2x2 matrix, up to machine precision.
#[inline(always)]
pub fn svd3<T: Real>(a: [[T; 3]; 3]) -> Svd<T, 3, 3> {
    let Scaled { a, back, poison } = scale(a);
    let [x, y, z] = columns(a);
    let square = [dot(x, x), dot(y, y), dot(z, z), dot(x, y), dot(x, z), dot(y, z)];
    let Apart { along, inverse, largest, .. } = apart(square, poison);
    // A e x A f = cof(A) w. Both candidates for z come from w before it is normalised: the two chains run side by side.
    let cofactors = from_columns([cross(y, z), cross(z, x), cross(x, y)]);
    let image = apply(&a, along);
    let (z, _) = normalise(choose(largest, image, apply(&cofactors, along)));
    let w = times(along, inverse);
    let (e, f) = complete(w);
    let (ae, af) = (apply(&a, e), apply(&a, f));
    let (p, q) = complete(z);
    let (phi, rest, theta) = svd2_scaled([[dot(p, ae), dot(p, af)], [dot(q, ae), dot(q, af)]]);
    let (u_high, u_low) = (blend(phi.c, p, phi.s, q), blend(phi.c, q, -phi.s, p));
    let (v_high, v_low) = (blend(theta.c, e, theta.s, f), blend(theta.c, f, -theta.s, e));

    // The maximum and minimum only undo rounding where stretches are equal.
    let own = dot(z, image) * inverse;
    let first = T::select(largest, own.max(rest[0]), rest[0]);
    let second = T::select(largest, rest[0], rest[1]);
    let third = T::select(largest, rest[1], own);
    let third = third.abs().min(second).copysign(third);
    Svd {
        u: from_columns([choose(largest, z, u_high), choose(largest, u_high, u_low), choose(largest, u_low, z)]),
        s: [first * back, second * back, third * back],
        v: from_columns([choose(largest, w, v_high), choose(largest, v_high, v_low), choose(largest, v_low, w)]),
    }
}
