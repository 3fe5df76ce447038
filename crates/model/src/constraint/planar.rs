//! Polygons whose corners lie in a plane.

use super::complement::complement;
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
        let basis = complement(&spanned);
        // Corners on a line leave one more, which no plane of theirs needs.
        let spare = basis.len().saturating_sub(v.len() - 3);
        for b in basis.into_iter().skip(spare) {
            let value = v.iter().zip(&b).map(|(v, b)| b * dot(n, *v)).sum();
            let gradient: Vec<V3> = b.iter().map(|b| n.map(|c| b * c)).collect();
            row(Row { value, relation: Relation::Zero, gradient: &gradient });
        }
    }
}
