//! Eigen-decomposition of symmetric 3x3 and 2x2 matrices without iteration.

use super::Eigen;
use super::frame::{apply, blend, choose, complete, dot, from_columns, scale, times};
use super::plane::half_angle;
use crate::simd::Real;

/// The largest root of x^3 - 3 x - 2 h, that is 2 cos(arccos(h) / 3), for 0 <= h <= 1: it goes from sqrt 3 to 2.
///
/// Chebyshev interpolation of degree 17 in t = 2 h - 1; the nearest singularity is h = -1, so that coefficients fall
/// like 5.8^-k and the error is below 2e-16.
#[inline(always)]
fn separated_root<T: Real>(h: T) -> T {
    const C: [f64; 18] = [
        1.879_385_241_571_816_6,
        0.131_643_614_544_899_84,
        -0.012_862_827_975_309_15,
        0.002_213_309_911_654_672_4,
        -0.000_467_290_559_331_669_9,
        0.000_109_828_837_608_172_09,
        -2.758_255_145_620_347_3e-5,
        7.246_576_385_918_553e-6,
        -1.967_100_987_069_871e-6,
        5.473_653_469_032_758e-7,
        -1.552_195_410_495_699_7e-7,
        4.472_329_946_495_406e-8,
        -1.318_755_063_907_810_1e-8,
        3.902_254_945_894_498_5e-9,
        -1.032_046_596_414_098_8e-9,
        3.036_745_079_385_057e-10,
        -1.611_555_014_603_69e-10,
        5.043_690_901_967_186e-11,
    ];
    // Estrin's scheme: six levels instead of a chain of seventeen.
    let t = h * 2.0 - 1.0;
    let mut level = [T::zero(); 9];
    for k in 0..9 {
        level[k] = t.mul_add(T::splat(C[2 * k + 1]), T::splat(C[2 * k]));
    }
    let t2 = t * t;
    for k in 0..4 {
        level[k] = t2.mul_add(level[2 * k + 1], level[2 * k]);
    }
    let t4 = t2 * t2;
    for k in 0..2 {
        level[k] = t4.mul_add(level[2 * k + 1], level[2 * k]);
    }
    let t8 = t4 * t4;
    t8.mul_add(t8.mul_add(level[8], level[1]), level[0])
}

/// What is known of a symmetric matrix S once the eigenvalue that stands apart is found.
pub(super) struct Apart<T: Real> {
    /// A third of the trace.
    pub mean: T,
    /// Size of the deviator: S = mean I + spread B, tr B = 0, tr B^2 = 6 (B = 0 where S is a multiple of I).
    pub spread: T,
    /// B as (xx, yy, zz, xy, xz, yz).
    pub b: [T; 6],
    /// The eigenvalue of B that stands apart, sqrt 3 <= |beta| <= 2.
    pub beta: T,
    /// Its eigenvector, of length at least 2.
    pub along: [T; 3],
    /// 1 / |along|
    pub inverse: T,
    /// Whether it is the largest one (else the smallest).
    pub largest: T::Mask,
}

/// The eigenvalue of S that stands apart, and its eigenvector. Entries of S at most about 100; `poison` is 0 or NaN.
///
/// B has the characteristic polynomial x^3 - 3 x - det B. Its largest root is at least sqrt 3 from the others where
/// det B >= 0, and its smallest one is where det B < 0, so that both the root and its eigenvector are well conditioned.
/// adj(B - beta I) is w w^T times the product of the two gaps, at least 6; its column with the largest diagonal entry
/// gives w (after Eberly 2014, "A robust eigensolver for 3x3 symmetric matrices").
#[inline(always)]
pub(super) fn apart<T: Real>(s: [T; 6], poison: T) -> Apart<T> {
    const SMALLEST: f64 = 1e-120;
    let mean = (s[0] + s[1] + s[2]) * (1.0 / 3.0);
    let d = [s[0] - mean, s[1] - mean, s[2] - mean];
    let off = [s[3], s[4], s[5]];
    let square = dot(off, off).mul_add(T::splat(1.0 / 3.0), dot(d, d) * (1.0 / 6.0));
    let multiple = square.lt(T::splat(SMALLEST));
    let inverse = square.max(T::splat(SMALLEST)).rsqrt();
    let spread = square * inverse;
    let inverse = T::select(multiple, T::zero(), inverse);
    // The determinant before the division by the spread, which takes its time.
    let det = {
        let ([xx, yy, zz], [xy, xz, yz]) = (d, off);
        let x = yy.mul_add(zz, -(yz * yz));
        let y = xy.mul_add(zz, -(yz * xz));
        let z = xy.mul_add(yz, -(yy * xz));
        xx.mul_add(x, xz.mul_add(z, -(xy * y)))
    };
    let largest = det.ge(T::zero());
    let half = (det.abs() * 0.5) * inverse * (inverse * inverse);
    let root = separated_root(half.min(T::one())) + poison;
    let beta = T::select(largest, root, -root);
    let b = times([d[0], d[1], d[2], s[3], s[4], s[5]], inverse);
    let [xx, yy, zz, xy, xz, yz] = b;
    // Adjugate of B - beta I.
    let (x, y, z) = (xx - beta, yy - beta, zz - beta);
    let axx = y.mul_add(z, -(yz * yz));
    let ayy = x.mul_add(z, -(xz * xz));
    let azz = x.mul_add(y, -(xy * xy));
    let axy = xz.mul_add(yz, -(xy * z));
    let axz = xy.mul_add(yz, -(xz * y));
    let ayz = xy.mul_add(xz, -(yz * x));
    let column = choose(axx.ge(ayy), [axx, axy, axz], [axy, ayy, ayz]);
    let column = choose(azz.gt(axx.max(ayy)), [axz, ayz, azz], column);
    let inverse = dot(column, column).rsqrt();
    Apart { mean, spread, b, beta, along: column, inverse, largest }
}

/// The 2x2 matrix that is left of B in an orthonormal basis (e, f) of the complement of w.
struct Rest<T> {
    ee: T,
    ef: T,
    ff: T,
}

impl<T: Real> Rest<T> {
    #[inline(always)]
    fn of(b: &[T; 6], e: [T; 3], f: [T; 3]) -> Self {
        let [xx, yy, zz, xy, xz, yz] = *b;
        let rows = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        let (be, bf) = (apply(&rows, e), apply(&rows, f));
        Rest { ee: dot(e, be), ef: dot(e, bf), ff: dot(f, bf) }
    }
}

/// A = Q diag(lambda) Q^T of the symmetric matrix (xx, yy, zz, xy, xz, yz); Q is a proper rotation, lambda descends.
/// |A - Q diag(lambda) Q^T| is a few machine epsilons times |A|.
#[inline(always)]
pub fn eig3_sym<T: Real>(a: [T; 6]) -> Eigen<T, 3> {
    let scaled = scale([a]);
    let Apart { mean, spread, b, beta, along, inverse, largest } = apart(scaled.a[0], scaled.poison);
    let w = times(along, inverse);
    let (e, f) = complete(w);
    let rest = Rest::of(&b, e, f);
    let (turn, square, radius) = half_angle((rest.ee - rest.ff) * 0.5, rest.ef);
    let unit = square.rsqrt();
    let (c, s) = (turn.c * unit, turn.s * unit);
    let (high, low) = (blend(c, e, s, f), blend(c, f, -s, e));
    let middle = (rest.ee + rest.ff) * 0.5;
    let roots = [middle + radius, middle - radius];
    let roots = choose(largest, [beta, roots[0], roots[1]], [roots[0], roots[1], beta]);
    let q = from_columns([choose(largest, w, high), choose(largest, high, low), choose(largest, low, w)]);
    let lambda = [roots[0].mul_add(spread, mean), roots[1].mul_add(spread, mean), roots[2].mul_add(spread, mean)];
    Eigen { q, lambda: times(lambda, scaled.back) }
}

/// The largest eigenvalue of the symmetric matrix (xx, yy, zz, xy, xz, yz), a few machine epsilons times |A| off.
#[inline(always)]
pub fn max_eigenvalue3<T: Real>(a: [T; 6]) -> T {
    let scaled = scale([a]);
    let Apart { mean, spread, b, beta, along, inverse, largest } = apart(scaled.a[0], scaled.poison);
    let w = times(along, inverse);
    // Where the smallest one stands apart, the characteristic polynomial gives a double largest root to half the digits
    // only, so that it is taken from the 2x2 matrix that is left.
    let (e, f) = complete(w);
    let rest = Rest::of(&b, e, f);
    let half = (rest.ee - rest.ff) * 0.5;
    let radius = half.mul_add(half, rest.ef * rest.ef).sqrt();
    let root = T::select(largest, beta, (rest.ee + rest.ff) * 0.5 + radius);
    root.mul_add(spread, mean) * scaled.back
}

/// A = Q diag(lambda) Q^T of the symmetric matrix (xx, yy, xy); Q is a proper rotation, lambda descends.
#[inline(always)]
pub fn eig2_sym<T: Real>(a: [T; 3]) -> Eigen<T, 2> {
    let scaled = scale([a]);
    let [xx, yy, xy] = scaled.a[0];
    let (turn, square, radius) = half_angle((xx - yy) * 0.5 + scaled.poison, xy);
    let unit = square.rsqrt();
    let (c, s) = (turn.c * unit, turn.s * unit);
    let middle = (xx + yy) * 0.5;
    Eigen { q: [[c, -s], [s, c]], lambda: [(middle + radius) * scaled.back, (middle - radius) * scaled.back] }
}
