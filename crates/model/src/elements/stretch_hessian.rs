//! The Hessian of a density in the entries of F, where it has few entries: in the frame of the stretches.

use crate::energy::Energy;
use proxel_linalg::simd::Real;
use proxel_linalg::svd;
use proxel_split::Projection;

/// Numbers of a [`stretch_hessian`] of K stretches.
pub const fn curvatures(k: usize) -> usize {
    k * (k + 1) / 2 + k * (k - 1) + k
}

/// Where psi_ij, i <= j, lies.
pub(super) const fn place_of_entry(k: usize, i: usize, j: usize) -> usize {
    i * k - i * (i + 1) / 2 + j
}

/// Where the quotient (psi_i - psi_j) / (s_i - s_j), i < j, lies; that of the sums lies K (K - 1) / 2 after it.
pub(super) const fn place_of_pair(k: usize, i: usize, j: usize) -> usize {
    k * (k + 1) / 2 + i * k - (i + 1) * (i + 2) / 2 + j
}

/// Where psi_i / s_i lies.
pub(super) const fn place_of_normal(k: usize, i: usize) -> usize {
    k * (k + 1) / 2 + k * (k - 1) + i
}

/// No quotient is larger than this many times the Hessian in the stretches: one that is stems from a kink, where two
/// stretches cancel or an element has no extent, and its curvature is none that a step could use.
const KINK: f64 = 1e4;

/// With F = U S V^T and dF = U h V^T, the second derivative of psi is
///
/// ```text
/// sum_ij psi_ij h_ii h_jj + sum_(i<j) [ minus_ij (h_ij + h_ji)^2 / 2 + plus_ij (h_ij - h_ji)^2 / 2 ]
///     + sum_ni (psi_i / s_i) h_ni^2
/// ```
///
/// with minus_ij = (psi_i - psi_j) / (s_i - s_j), plus_ij = (psi_i + psi_j) / (s_i + s_j) and n over the normals of an
/// element of lower dimension (Smith, de Goes and Kim 2019). Returned are psi_ij by rows for i <= j, minus, plus, and
/// psi_i / s_i, all of them projected: the matrix psi_ij by its eigenvalues, the others are eigenvalues.
/// The first [`curvatures`] entries are used.
#[inline(always)]
pub(super) fn stretch_hessian<T: Real, E: Energy<K>, const K: usize>(
    energy: &E,
    s: [T; K],
    projection: Projection,
) -> [T; 15] {
    let mut out = [T::zero(); 15];
    let mut h = energy.hessian(s);
    let mut size = T::zero();
    for i in 0..K {
        for j in 0..K {
            size = size.max(h[i][j].abs());
        }
    }
    if projection != Projection::None {
        project_matrix(&mut h, projection);
    }
    let quotients = energy.divided_differences(s);
    let gradient = energy.gradient(s);
    let pairs = K * (K - 1) / 2;
    let bound = size * KINK;
    for i in 0..K {
        for j in i..K {
            out[place_of_entry(K, i, j)] = h[i][j];
        }
        for j in i + 1..K {
            let at = place_of_pair(K, i, j);
            out[at] = project(quotients.minus[i][j], bound, projection);
            out[at + pairs] = project(quotients.plus[i][j], bound, projection);
        }
        out[place_of_normal(K, i)] = project(gradient[i] / s[i], bound, projection);
    }
    out
}

/// An eigenvalue, projected and bounded; 0 where it has no value, which is at a kink.
#[inline(always)]
fn project<T: Real>(v: T, bound: T, projection: Projection) -> T {
    let kink = T::select(v.gt(T::zero()), bound, T::select(v.lt(T::zero()), -bound, T::zero()));
    let v = T::select(v.abs().le(bound), v, kink);
    match projection {
        Projection::None => v,
        Projection::Clamp => v.max(T::zero()),
        Projection::Absolute => v.abs(),
    }
}

/// Q diag(l) Q^T with projected l.
#[inline(always)]
fn project_matrix<T: Real, const K: usize>(h: &mut [[T; K]; K], projection: Projection) {
    let mut q = [[T::zero(); K]; K];
    let mut l = [T::zero(); K];
    match K {
        1 => {
            q[0][0] = T::one();
            l[0] = h[0][0];
        }
        2 => {
            let e = svd::eig2_sym([h[0][0], h[1][1], h[0][1]]);
            for i in 0..K {
                l[i] = e.lambda[i];
                for j in 0..K {
                    q[i][j] = e.q[i][j];
                }
            }
        }
        _ => {
            let e = svd::eig3_sym([h[0][0], h[1][1], h[2][2], h[0][1], h[0][2], h[1][2]]);
            for i in 0..K {
                l[i] = e.lambda[i];
                for j in 0..K {
                    q[i][j] = e.q[i][j];
                }
            }
        }
    }
    for i in 0..K {
        l[i] = if projection == Projection::Clamp { l[i].max(T::zero()) } else { l[i].abs() };
    }
    for i in 0..K {
        for j in i..K {
            let mut sum = T::zero();
            for n in 0..K {
                sum = (q[i][n] * l[n]).mul_add(q[j][n], sum);
            }
            h[i][j] = sum;
            h[j][i] = sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_fill_the_array() {
        for k in 1..=3 {
            let mut places = Vec::new();
            for i in 0..k {
                places.extend((i..k).map(|j| place_of_entry(k, i, j)));
                places.push(place_of_normal(k, i));
                for j in i + 1..k {
                    places.push(place_of_pair(k, i, j));
                    places.push(place_of_pair(k, i, j) + k * (k - 1) / 2);
                }
            }
            places.sort_unstable();
            assert_eq!(places, (0..curvatures(k)).collect::<Vec<_>>(), "{k}");
        }
    }
}
