//! Vectors, frames and the scaling that all decompositions share.

use crate::simd::Real;

/// a . b
#[inline(always)]
pub(super) fn dot<T: Real, const N: usize>(a: [T; N], b: [T; N]) -> T {
    let mut sum = a[0] * b[0];
    for k in 1..N {
        sum = a[k].mul_add(b[k], sum);
    }
    sum
}

/// a x b
#[inline(always)]
pub(super) fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1].mul_add(b[2], -(a[2] * b[1])), a[2].mul_add(b[0], -(a[0] * b[2])), a[0].mul_add(b[1], -(a[1] * b[0]))]
}

/// A v
#[inline(always)]
pub(super) fn apply<T: Real, const R: usize, const C: usize>(a: &[[T; C]; R], v: [T; C]) -> [T; R] {
    a.map(|row| dot(row, v))
}

/// `yes` where the mask holds, else `no`, component by component.
#[inline(always)]
pub(super) fn choose<T: Real, const N: usize>(mask: T::Mask, yes: [T; N], no: [T; N]) -> [T; N] {
    std::array::from_fn(|k| T::select(mask, yes[k], no[k]))
}

/// c a + s b
#[inline(always)]
pub(super) fn blend<T: Real, const N: usize>(c: T, a: [T; N], s: T, b: [T; N]) -> [T; N] {
    std::array::from_fn(|k| c.mul_add(a[k], s * b[k]))
}

/// The square matrix with these columns.
#[inline(always)]
pub(super) fn from_columns<T: Real, const N: usize>(columns: [[T; N]; N]) -> [[T; N]; N] {
    std::array::from_fn(|row| std::array::from_fn(|column| columns[column][row]))
}

/// Unit vectors (e, f) such that (e, f, n) is a right-handed orthonormal frame of the unit vector n; so is (n, e, f).
/// Duff, Burgess, Christensen, Hery, Kensler, Liani, Villemin 2017, "Building an orthonormal basis, revisited", JCGT 6(1).
#[inline(always)]
pub(super) fn complete<T: Real>(n: [T; 3]) -> ([T; 3], [T; 3]) {
    let [x, y, z] = n;
    let sign = T::one().copysign(z);
    let a = -(sign + z).fast_recip();
    let xa = x * a;
    let b = xa * y;
    ([(sign * x).mul_add(xa, T::one()), sign * b, -(sign * x)], [b, (y * y).mul_add(a, sign), -y])
}

/// (n, |v|) with the unit vector n along v, or along the first axis where |v| is below 1e-100.
/// For vectors that are scaled: no entry above 1e100.
#[inline(always)]
pub(super) fn normalise<T: Real, const N: usize>(v: [T; N]) -> ([T; N], T) {
    const SMALLEST: f64 = 1e-200;
    let square = dot(v, v);
    // `lt` is false for NaN, which therefore stays NaN.
    let zero = square.lt(T::splat(SMALLEST));
    let inverse = square.max(T::splat(SMALLEST)).rsqrt();
    let mut n = v.map(|x| T::select(zero, T::zero(), x * inverse));
    n[0] = T::select(zero, T::one(), n[0]);
    (n, square * inverse)
}

/// A matrix scaled by a power of two so that its largest entry lies in [1, 2).
pub(super) struct Scaled<T: Real, const R: usize, const C: usize> {
    /// The scaled matrix: 0 stays 0, entries above 2^1023 become up to 4.
    pub a: [[T; C]; R],
    /// The factor that brings its stretches back.
    pub back: T,
    /// Whether all entries are 0.
    pub zero: T::Mask,
}

/// Scales by the largest entry; lanes with a NaN or an infinity become NaN.
#[inline(always)]
pub(super) fn scale<T: Real, const R: usize, const C: usize>(a: [[T; C]; R]) -> Scaled<T, R, C> {
    let mut largest = T::splat(f64::MIN_POSITIVE);
    for row in a {
        for x in row {
            largest = largest.max(x.abs());
        }
    }
    // 2^-1023 would be subnormal; the cap leaves entries below 4.
    let exponent = largest.exponent_and_mantissa().0.min(T::splat(1022.0));
    let down = (-exponent).exp2_int();
    let mut sum = T::zero();
    let mut scaled = a;
    for row in &mut scaled {
        for x in row {
            *x = *x * down;
            sum = x.mul_add(*x, sum);
        }
    }
    // `max` may pass over NaN, and 2^-exponent of an infinity is unspecified, but the sum of squares
    // is below 16 R C for finite entries only.
    let finite = sum.le(T::splat((16 * R * C) as f64));
    let poison = T::select(finite, T::zero(), T::splat(f64::NAN));
    for row in &mut scaled {
        for x in row {
            *x += poison;
        }
    }
    Scaled { a: scaled, back: exponent.exp2_int(), zero: sum.le(T::zero()) }
}
