//! Products of small matrices, by plain loops that the compiler unrolls.

use proxel_linalg::simd::Real;

/// A B^T of matrices given by rows.
#[inline(always)]
pub(super) fn times_transposed<T: Real, const R: usize, const C: usize, const K: usize>(
    a: &[[T; K]; R],
    b: &[[T; K]; C],
) -> [[T; C]; R] {
    let mut out = [[T::zero(); C]; R];
    for r in 0..R {
        for c in 0..C {
            let mut sum = a[r][0] * b[c][0];
            for k in 1..K {
                sum = a[r][k].mul_add(b[c][k], sum);
            }
            out[r][c] = sum;
        }
    }
    out
}

/// A diag(s) B^T
#[inline(always)]
pub(super) fn compose<T: Real, const R: usize, const C: usize, const K: usize>(
    a: &[[T; K]; R],
    s: &[T; K],
    b: &[[T; K]; C],
) -> [[T; C]; R] {
    let mut scaled = *a;
    for row in &mut scaled {
        for k in 0..K {
            row[k] = row[k] * s[k];
        }
    }
    times_transposed(&scaled, b)
}

/// U M V^T
#[inline(always)]
pub(super) fn times_frame<T: Real, const D: usize, const K: usize>(
    u: &[[T; K]; D],
    m: &[[T; K]; K],
    v: &[[T; K]; K],
) -> [[T; K]; D] {
    let mut um = [[T::zero(); K]; D];
    for r in 0..D {
        for c in 0..K {
            let mut sum = u[r][0] * m[0][c];
            for k in 1..K {
                sum = u[r][k].mul_add(m[k][c], sum);
            }
            um[r][c] = sum;
        }
    }
    times_transposed(&um, v)
}

/// V diag(s) V^T, only one triangle computed.
#[inline(always)]
pub(super) fn compose_symmetric<T: Real, const K: usize>(v: &[[T; K]; K], s: &[T; K]) -> [[T; K]; K] {
    let mut scaled = *v;
    for row in &mut scaled {
        for k in 0..K {
            row[k] = row[k] * s[k];
        }
    }
    let mut a = [[T::zero(); K]; K];
    for r in 0..K {
        for c in r..K {
            let mut sum = scaled[r][0] * v[c][0];
            for k in 1..K {
                sum = scaled[r][k].mul_add(v[c][k], sum);
            }
            a[r][c] = sum;
            a[c][r] = sum;
        }
    }
    a
}

/// V^T A V of a symmetric A.
#[inline(always)]
pub(super) fn in_frame<T: Real, const K: usize>(v: &[[T; K]; K], a: &[[T; K]; K]) -> [[T; K]; K] {
    let mut av = [[T::zero(); K]; K];
    for r in 0..K {
        for c in 0..K {
            let mut sum = a[r][0] * v[0][c];
            for k in 1..K {
                sum = a[r][k].mul_add(v[k][c], sum);
            }
            av[r][c] = sum;
        }
    }
    let mut out = [[T::zero(); K]; K];
    for r in 0..K {
        for c in r..K {
            let mut sum = v[0][r] * av[0][c];
            for k in 1..K {
                sum = v[k][r].mul_add(av[k][c], sum);
            }
            out[r][c] = sum;
            out[c][r] = sum;
        }
    }
    out
}

/// a + sign b of symmetric matrices, one triangle computed.
#[inline(always)]
pub(super) fn add_symmetric<T: Real, const K: usize>(a: &[[T; K]; K], b: &[[T; K]; K], sign: f64) -> [[T; K]; K] {
    let mut out = *a;
    for r in 0..K {
        for c in r..K {
            out[r][c] = if sign > 0.0 { a[r][c] + b[r][c] } else { a[r][c] - b[r][c] };
            out[c][r] = out[r][c];
        }
    }
    out
}

/// |A|^2
#[inline(always)]
pub(super) fn norm2<T: Real, const R: usize, const C: usize>(a: &[[T; C]; R]) -> T {
    let mut sum = T::zero();
    for row in a {
        for v in row {
            sum = v.mul_add(*v, sum);
        }
    }
    sum
}

/// |A|^2 of a symmetric A.
#[inline(always)]
pub(super) fn norm2_symmetric<T: Real, const K: usize>(a: &[[T; K]; K]) -> T {
    let (mut diagonal, mut above) = (T::zero(), T::zero());
    for r in 0..K {
        diagonal = a[r][r].mul_add(a[r][r], diagonal);
        for c in r + 1..K {
            above = a[r][c].mul_add(a[r][c], above);
        }
    }
    above * 2.0 + diagonal
}
