//! Polygons whose corners lie in a plane.

use super::{Relation, Row, Set, V3, dot};
use proxel_linalg::svd::eig3_sym;

/// Corners in a common plane, any number of them: of mean-centred corners, those without a component along one
/// direction. The nearest such point leaves out the component along the direction in which they have least, the last
/// left singular vector: Bouaziz et al. 2012. The violation is the largest distance from the best plane.
#[derive(Clone, Copy, Debug, Default)]
pub struct Planar;

/// The plane that fits points best, by the sum of squared distances, through their mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BestPlane {
    /// Its unit normal.
    pub normal: V3,
    /// Two unit vectors along it, that of most extent first.
    pub along: [V3; 2],
}

impl BestPlane {
    /// Of mean-centred points. The eigenvectors of sum v v^T; an error in them of rounding over the gap of its
    /// eigenvalues moves no distance by more than rounding times the extent, since the gap is what points reach.
    pub fn of(v: &[V3]) -> Self {
        let mut m = [0.0; 6];
        // Scaled, so that squares neither vanish nor overflow.
        let size = v.iter().flatten().fold(0.0_f64, |s, c| s.max(c.abs()));
        let inverse = if size > 0.0 && size.is_finite() { 1.0 / size } else { 1.0 };
        for v in v {
            let [x, y, z] = v.map(|c| c * inverse);
            for (m, p) in m.iter_mut().zip([x * x, y * y, z * z, x * y, x * z, y * z]) {
                *m += p;
            }
        }
        let q = eig3_sym(m).q;
        let column = |k: usize| [q[0][k], q[1][k], q[2][k]];
        BestPlane { normal: column(2), along: [column(0), column(1)] }
    }
}

impl Set for Planar {
    fn project(&self, _: usize, v: &mut [V3]) {
        let n = BestPlane::of(v).normal;
        for v in v {
            let height = dot(n, *v);
            *v = [0, 1, 2].map(|d| v[d] - height * n[d]);
        }
    }

    fn violation(&self, _: usize, v: &[V3]) -> f64 {
        let n = BestPlane::of(v).normal;
        v.iter().fold(0.0_f64, |m, v| {
            let height = dot(n, *v).abs();
            if height <= m { m } else { height }
        })
    }

    /// Heights h_i = n . v_i change by n . dv_i - a . (s_i, t_i) where the best plane turns by a and moves: what is
    /// left has no part along 1, s and t, the in-plane coordinates of the corners. With an orthonormal basis b of what
    /// is orthogonal to those: sum_i b_i h_i = 0, k - 3 equations.
    fn linearize(&self, _: usize, v: &[V3], _: f64, row: &mut dyn FnMut(Row<'_>)) {
        if v.len() < 4 {
            return;
        }
        let plane = BestPlane::of(v);
        let ([s, t], n) = (plane.along, plane.normal);
        let spanned =
            [vec![1.0; v.len()], v.iter().map(|v| dot(s, *v)).collect(), v.iter().map(|v| dot(t, *v)).collect()];
        for b in complement(&spanned) {
            let value = v.iter().zip(&b).map(|(v, b)| b * dot(n, *v)).sum();
            let gradient: Vec<V3> = b.iter().map(|b| n.map(|c| b * c)).collect();
            row(Row { value, relation: Relation::Zero, gradient: &gradient });
        }
    }
}

/// An orthonormal basis of what is orthogonal to three vectors of k numbers: the last k - 3 columns of the orthogonal
/// factor of Householder's decomposition.
fn complement(vectors: &[Vec<f64>; 3]) -> Vec<Vec<f64>> {
    let k = vectors[0].len();
    let mut a = vectors.clone();
    let mut mirrors: Vec<Vec<f64>> = Vec::with_capacity(3);
    for j in 0..3 {
        let mut w = vec![0.0; k];
        w[j..].copy_from_slice(&a[j][j..]);
        let length = w.iter().map(|c| c * c).sum::<f64>().sqrt();
        w[j] += if w[j] < 0.0 { -length } else { length };
        let squared: f64 = w.iter().map(|c| c * c).sum();
        if squared > 0.0 {
            a.iter_mut().for_each(|column| mirror(&w, squared, column));
            mirrors.push(w);
        }
    }
    let column = |j: usize| {
        let mut e = vec![0.0; k];
        e[j] = 1.0;
        mirrors.iter().rev().for_each(|w| mirror(w, w.iter().map(|c| c * c).sum(), &mut e));
        e
    };
    (3..k).map(column).collect()
}

/// x <- x - 2 w (w . x) / |w|^2
fn mirror(w: &[f64], squared: f64, x: &mut [f64]) {
    let along = 2.0 * w.iter().zip(&*x).map(|(w, x)| w * x).sum::<f64>() / squared;
    x.iter_mut().zip(w).for_each(|(x, w)| *x -= along * w);
}

#[cfg(test)]
mod tests {
    use super::complement;

    #[test]
    fn the_complement_is_orthonormal_and_orthogonal() {
        let vectors = [vec![1.0; 6], vec![0.3, -1.0, 2.0, 0.1, -0.7, -0.7], vec![1.0, 0.0, 0.5, -2.0, 0.25, 0.25]];
        let basis = complement(&vectors);
        assert_eq!(basis.len(), 3);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for (i, b) in basis.iter().enumerate() {
            assert!(vectors.iter().all(|v| dot(v, b).abs() < 1e-15 * 10.0));
            assert!(
                basis.iter().enumerate().all(|(j, c)| (dot(b, c) - f64::from(u8::from(i == j))).abs() < 1e-15 * 10.0)
            );
        }
    }
}
