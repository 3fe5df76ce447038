//! The Hessian of a density in the entries of F, where it has few entries: in the frame of the stretches.

use crate::energy::Energy;
use proxel_linalg::simd::Real;
use proxel_linalg::svd;
use proxel_split::Projection;

/// Numbers of a [`stretch_hessian`] of K stretches.
pub const fn curvatures(k: usize) -> usize {
    k * (k + 1) / 2 + k * (k - 1) + k * (k - 1) / 2 + k
}

/// Of three stretches: the most.
pub const MOST_CURVATURES: usize = curvatures(3);

/// Where psi_ij, i <= j, lies.
pub(super) const fn place_of_entry(k: usize, i: usize, j: usize) -> usize {
    i * k - i * (i + 1) / 2 + j
}

/// Where the coefficient of h_ij^2, i < j, lies; that of h_ji^2 lies K (K - 1) / 2 after it, and that of h_ij h_ji as far
/// after that.
pub(super) const fn place_of_pair(k: usize, i: usize, j: usize) -> usize {
    k * (k + 1) / 2 + i * k - (i + 1) * (i + 2) / 2 + j
}

/// Where psi_i / s_i lies.
pub(super) const fn place_of_normal(k: usize, i: usize) -> usize {
    k * (k + 1) / 2 + k * (k - 1) + k * (k - 1) / 2 + i
}

/// No quotient is larger than this many times the Hessian in the stretches: one that is stems from a kink, where two
/// stretches cancel or an element has no extent, and its curvature is none that a step could use.
pub(super) const KINK: f64 = 1e4;

/// With F = U S V^T and dF = U h V^T, the second derivative of psi is
///
/// ```text
/// sum_ij psi_ij h_ii h_jj + sum_(i<j) [ minus_ij (h_ij + h_ji)^2 / 2 + plus_ij (h_ij - h_ji)^2 / 2 ]
///     + sum_ni (psi_i / s_i) h_ni^2
/// ```
///
/// with minus_ij = (psi_i - psi_j) / (s_i - s_j), plus_ij = (psi_i + psi_j) / (s_i + s_j) and n over the normals of an
/// element of lower dimension (Smith, de Goes and Kim 2019). Projected are the matrix psi_ij by its eigenvalues and the
/// others, which are eigenvalues. What stands in for it has the form
///
/// ```text
/// sum_ij a_ij h_ii h_jj + sum_(i<j) [ b_ij h_ij^2 + b_ji h_ji^2 + 2 c_ij h_ij h_ji ] + sum_ni d_i h_ni^2
/// ```
///
/// Returned are a by rows for i <= j, b_ij for i < j, b_ji for i < j, c and d. The first [`curvatures`] entries are used.
#[inline(always)]
pub(super) fn stretch_hessian<T: Real, E: Energy<K>, const K: usize>(
    energy: &E,
    s: [T; K],
    projection: Projection,
) -> [T; MOST_CURVATURES] {
    match projection {
        Projection::None | Projection::Clamp | Projection::Absolute => projected(energy, s, projection),
        Projection::Reweighted => reweighted(energy, s),
        Projection::Killing => killing(energy, s),
    }
}

/// The largest entry of the Hessian in the stretches.
#[inline(always)]
fn size_of<T: Real, const K: usize>(h: &[[T; K]; K]) -> T {
    let mut size = T::zero();
    for i in 0..K {
        for j in 0..K {
            size = size.max(h[i][j].abs());
        }
    }
    size
}

/// The Hessian itself.
#[inline(always)]
fn projected<T: Real, E: Energy<K>, const K: usize>(
    energy: &E,
    s: [T; K],
    projection: Projection,
) -> [T; MOST_CURVATURES] {
    let mut out = [T::zero(); MOST_CURVATURES];
    let mut h = energy.hessian(s);
    let bound = size_of(&h) * KINK;
    if projection != Projection::None {
        project_matrix(&mut h, projection);
    }
    let quotients = energy.divided_differences(s);
    let gradient = energy.gradient(s);
    let pairs = K * (K - 1) / 2;
    for i in 0..K {
        for j in i..K {
            out[place_of_entry(K, i, j)] = h[i][j];
        }
        for j in i + 1..K {
            let at = place_of_pair(K, i, j);
            let minus = project(quotients.minus[i][j], bound, projection);
            let plus = project(quotients.plus[i][j], bound, projection);
            let same = (minus + plus) * 0.5;
            out[at] = same;
            out[at + pairs] = same;
            out[at + 2 * pairs] = (minus - plus) * 0.5;
        }
        out[place_of_normal(K, i)] = project(gradient[i] / s[i], bound, projection);
    }
    out
}

/// A stretch this close to 1 has its limit, psi_ii, for psi_i / (s_i - 1).
const AT_REST: f64 = 1e-6;

/// sum_ij w_i^2 h_ij^2: a row of h for each direction of U.
#[inline(always)]
fn reweighted<T: Real, E: Energy<K>, const K: usize>(energy: &E, s: [T; K]) -> [T; MOST_CURVATURES] {
    let mut out = [T::zero(); MOST_CURVATURES];
    let h = energy.hessian(s);
    let bound = size_of(&h) * KINK;
    let gradient = energy.gradient(s);
    let pairs = K * (K - 1) / 2;
    let mut w2 = [T::zero(); K];
    for i in 0..K {
        let strain = s[i] - 1.0;
        let near = strain.abs().le(T::splat(AT_REST));
        w2[i] = project(T::select(near, h[i][i], gradient[i] / strain), bound, Projection::Clamp);
    }
    for i in 0..K {
        out[place_of_entry(K, i, i)] = w2[i];
        for j in i + 1..K {
            let at = place_of_pair(K, i, j);
            out[at] = w2[i];
            out[at + pairs] = w2[j];
        }
        out[place_of_normal(K, i)] = project(gradient[i] / s[i], bound, Projection::Clamp);
    }
    out
}

/// k/2 J |G + G^T|^2 / 2 with G = dF F^-1 = U h S^-1 U^T, J = |s_1 .. s_K| and k the stiffness at rest: the integral over the
/// deformed element.
#[inline(always)]
fn killing<T: Real, E: Energy<K>, const K: usize>(energy: &E, s: [T; K]) -> [T; MOST_CURVATURES] {
    let mut out = [T::zero(); MOST_CURVATURES];
    let gradient = energy.gradient(s);
    let pairs = K * (K - 1) / 2;
    let mut scale = T::splat(energy.rest_stiffness());
    for i in 0..K {
        scale = scale * s[i].abs();
    }
    // Of an element that has lost its extent the Killing energy has no finite form.
    let bound = T::splat(energy.rest_stiffness() * KINK);
    for i in 0..K {
        out[place_of_entry(K, i, i)] = project(scale / (s[i] * s[i]), bound, Projection::Clamp);
        for j in i + 1..K {
            let at = place_of_pair(K, i, j);
            out[at] = project(scale * 0.5 / (s[j] * s[j]), bound, Projection::Clamp);
            out[at + pairs] = project(scale * 0.5 / (s[i] * s[i]), bound, Projection::Clamp);
            let other = scale * 0.5 / (s[i] * s[j]);
            out[at + 2 * pairs] = T::select(other.abs().le(bound), other, T::zero());
        }
        out[place_of_normal(K, i)] = project(gradient[i] / s[i], bound, Projection::Clamp);
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
        Projection::Absolute => v.abs(),
        Projection::Clamp | Projection::Reweighted | Projection::Killing => v.max(T::zero()),
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
        l[i] = if projection == Projection::Absolute { l[i].abs() } else { l[i].max(T::zero()) };
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
    use crate::energy::SymmetricDirichlet;

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
                    places.push(place_of_pair(k, i, j) + k * (k - 1));
                }
            }
            places.sort_unstable();
            assert_eq!(places, (0..curvatures(k)).collect::<Vec<_>>(), "{k}");
        }
    }

    const STRETCHES: [[f64; 2]; 4] = [[1.0, 1.0], [1.7, 0.4], [1.2, 1.1], [0.8, 0.3]];

    #[test]
    fn at_rest_all_of_them_are_the_hessian() {
        let energy = SymmetricDirichlet { scale: 2.0 };
        let of = |projection| stretch_hessian::<f64, _, 2>(&energy, [1.0, 1.0], projection);
        let (hessian, killing, reweighted) =
            (of(Projection::None), of(Projection::Killing), of(Projection::Reweighted));
        for c in 0..curvatures(2) {
            assert!((hessian[c] - killing[c]).abs() < 1e-12, "{c}");
        }
        for i in 0..2 {
            assert_eq!(reweighted[place_of_entry(2, i, i)], hessian[place_of_entry(2, i, i)]);
        }
    }

    #[test]
    fn the_proxy_has_the_gradient_of_the_energy() {
        let energy = SymmetricDirichlet { scale: 2.0 };
        for s in STRETCHES {
            let proxy = stretch_hessian::<f64, _, 2>(&energy, s, Projection::Reweighted);
            let g: [f64; 2] = energy.gradient(s);
            for i in 0..2 {
                let gap = proxy[place_of_entry(2, i, i)] * (s[i] - 1.0) - g[i];
                assert!(gap.abs() <= 1e-12 * (1.0 + g[i].abs()), "{s:?}: {gap}");
            }
        }
    }

    #[test]
    fn rotations_cost_no_killing_energy() {
        let energy = SymmetricDirichlet { scale: 2.0 };
        for s in STRETCHES {
            let form = stretch_hessian::<f64, _, 2>(&energy, s, Projection::Killing);
            // dF = omega F has h_ij = omega_ij s_j.
            let (h01, h10) = (s[1], -s[0]);
            let [b01, b10, c] = [0, 1, 2].map(|k| form[place_of_pair(2, 0, 1) + k]);
            let cost = b01 * h01 * h01 + b10 * h10 * h10 + 2.0 * c * h01 * h10;
            assert!(cost.abs() < 1e-12 * b01, "{s:?}: {cost}");
        }
    }
}
