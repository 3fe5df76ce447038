//! Points on a line.

use super::complement::complement;
use super::{BestPlane, Relation, Row, Set, V3, dot, norm, scale, sub};

/// Corners on a common line, any number of them. Of mean-centred corners the nearest such ones keep their component along
/// the direction in which they have most, the first left singular vector (Bouaziz et al. 2012). The violation is the
/// largest distance from that line, a length.
#[derive(Clone, Copy, Debug, Default)]
pub struct Line;

impl Set for Line {
    fn project(&self, _: usize, v: &mut [V3]) {
        let along = BestPlane::of(v).along[0];
        v.iter_mut().for_each(|v| *v = scale(dot(along, *v), along));
    }

    fn violation(&self, _: usize, v: &[V3]) -> f64 {
        let along = BestPlane::of(v).along[0];
        super::largest(v.iter().map(|v| norm(sub(*v, scale(dot(along, *v), along)))))
    }

    /// Along each of the two normals n of the best line: heights n . v_i change by n . dv_i - a s_i where the line turns by
    /// a, s_i being coordinates along it, and all alike where it moves. With an orthonormal basis b of what is orthogonal
    /// to 1 and s: sum_i b_i n . v_i = 0, 2 (k - 2) equations.
    fn linearize(&self, _: usize, v: &[V3], _: f64, row: &mut dyn FnMut(Row<'_>)) {
        if v.len() < 3 {
            return;
        }
        let plane = BestPlane::of(v);
        let s = v.iter().map(|v| dot(plane.along[0], *v)).collect();
        for b in complement(&[vec![1.0; v.len()], s]) {
            for n in [plane.along[1], plane.normal] {
                let value = v.iter().zip(&b).map(|(v, b)| b * dot(n, *v)).sum();
                let gradient: Vec<V3> = b.iter().map(|b| scale(*b, n)).collect();
                row(Row { value, relation: Relation::Zero, gradient: &gradient });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constraint::laws;
    use crate::constraint::{MeanCentred, add};

    #[test]
    fn the_laws_hold() {
        for corners in [3, 4, 7] {
            laws::check::<MeanCentred, _>(
                corners,
                |_| Line,
                |near, random| {
                    let axis = match random.below(2) {
                        0 => random.rotation()[0],
                        _ => add(BestPlane::of(near).along[0], 1.0, random.array(-0.1, 0.1)),
                    };
                    let axis = scale(1.0 / norm(axis), axis);
                    near.iter().map(|v| scale(dot(axis, *v), axis)).collect()
                },
            );
        }
    }

    #[test]
    fn bad_corners_give_numbers() {
        for corners in laws::degenerate(5) {
            laws::finite(&Line, &corners);
        }
    }

    #[test]
    fn by_hand() {
        let corners = [[-2.0, 0.0, 0.25], [0.0, 0.0, -0.5], [2.0, 0.0, 0.25]];
        let mut z = corners;
        Line.project(0, &mut z);
        for (z, v) in z.iter().zip(corners) {
            assert!(norm(sub(*z, [v[0], 0.0, 0.0])) < 1e-15);
        }
        assert!((Line.violation(0, &corners) - 0.5).abs() < 1e-15);
    }
}
