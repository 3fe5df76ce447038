//! Vectors, frames and the scaling that all decompositions share.
//!
//! Loops here, not `array::map` or `from_fn`: their closures would be compiled without the instruction set of the
//! kernel, and what they call would stay a call.

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
    let mut out = [T::zero(); R];
    for r in 0..R {
        out[r] = dot(a[r], v);
    }
    out
}

/// s v
#[inline(always)]
pub(super) fn times<T: Real, const N: usize>(mut v: [T; N], s: T) -> [T; N] {
    for k in 0..N {
        v[k] = v[k] * s;
    }
    v
}

/// `yes` where the mask holds, else `no`, component by component.
#[inline(always)]
pub(super) fn choose<T: Real, const N: usize>(mask: T::Mask, yes: [T; N], mut no: [T; N]) -> [T; N] {
    for k in 0..N {
        no[k] = T::select(mask, yes[k], no[k]);
    }
    no
}

/// c a + s b
#[inline(always)]
pub(super) fn blend<T: Real, const N: usize>(c: T, mut a: [T; N], s: T, b: [T; N]) -> [T; N] {
    for k in 0..N {
        a[k] = c.mul_add(a[k], s * b[k]);
    }
    a
}

/// The matrix of C columns of R entries.
#[inline(always)]
pub(super) fn from_columns<T: Real, const R: usize, const C: usize>(columns: [[T; R]; C]) -> [[T; C]; R] {
    let mut rows = [[T::zero(); C]; R];
    for r in 0..R {
        for c in 0..C {
            rows[r][c] = columns[c][r];
        }
    }
    rows
}

/// The columns of a matrix.
#[inline(always)]
pub(super) fn columns<T: Real, const R: usize, const C: usize>(rows: [[T; C]; R]) -> [[T; R]; C] {
    from_columns(rows)
}

/// Unit vectors (e, f) such that (e, f, n) is a right-handed orthonormal frame of the unit vector n; so is (n, e, f).
/// Duff, Burgess, Christensen, Hery, Kensler, Liani, Villemin 2017, "Building an orthonormal basis, revisited", JCGT
/// 6(1).
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
    // False for NaN, which therefore stays NaN.
    let zero = square.lt(T::splat(SMALLEST));
    let inverse = square.max(T::splat(SMALLEST)).rsqrt();
    let mut axis = [T::zero(); N];
    axis[0] = T::one();
    let n = choose(zero, axis, times(v, inverse));
    (n, square * inverse)
}

/// A matrix scaled by a power of two so that its largest entry lies in [1, 2).
pub(super) struct Scaled<T, const R: usize, const C: usize> {
    /// The scaled matrix: 0 stays 0, entries above 2^1023 become up to 4, subnormal ones are from 2^-52.
    pub a: [[T; C]; R],
    /// The factor that brings its stretches back.
    pub back: T,
    /// 0, or NaN where an entry is NaN or infinite, for the caller to add where it reaches all results.
    pub poison: T,
}

/// Scales by the largest entry.
#[inline(always)]
pub(super) fn scale<T: Real, const R: usize, const C: usize>(a: [[T; C]; R]) -> Scaled<T, R, C> {
    // Four chains each, for the sake of latency.
    let mut largest = [T::splat(f64::MIN_POSITIVE); 4];
    for r in 0..R {
        for c in 0..C {
            let k = (r * C + c) % 4;
            largest[k] = largest[k].max(a[r][c].abs());
        }
    }
    let largest = largest[0].max(largest[1]).max(largest[2].max(largest[3]));
    // 2^-1023 would be subnormal; the cap leaves entries below 4.
    let exponent = largest.exponent_and_mantissa().0.min(T::splat(1022.0));
    let down = (-exponent).exp2_int();
    let mut scaled = a;
    let mut squares = [T::zero(); 4];
    for r in 0..R {
        for c in 0..C {
            let x = a[r][c] * down;
            let k = (r * C + c) % 4;
            squares[k] = x.mul_add(x, squares[k]);
            scaled[r][c] = x;
        }
    }
    // `max` may pass over NaN, and 2^-exponent of an infinity is unspecified, but the sum of squares
    // is below 16 R C for finite entries only.
    let finite = ((squares[0] + squares[1]) + (squares[2] + squares[3])).le(T::splat((16 * R * C) as f64));
    Scaled { a: scaled, back: exponent.exp2_int(), poison: T::select(finite, T::zero(), T::splat(f64::NAN)) }
}
