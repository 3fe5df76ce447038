//! Regular polygons.

use super::complement::complement;
use super::{Relation, Row, Set, V3, across, add, largest, norm, scale, sub};
use proxel_linalg::svd::{rotation_thin, svd32};

/// Corners of a regular polygon of any size, in their order around it; it may lie anywhere and either way up.
///
/// Mean-centred corners of one are v_i = c_i a + s_i b, with c_i = sqrt(2/k) cos(2 pi i / k), s_i = sqrt(2/k) sin(2 pi i /
/// k), |a| = |b| and a . b = 0. The vectors c and s are orthonormal, so the nearest ones are found from A = sum c_i v_i and
/// B = sum s_i v_i alone: with [A B] = U diag(s_1, s_2) V^T the nearest [a b] is (s_1 + s_2)/2 U V^T (the shape projection
/// of Bouaziz et al. 2012 in closed form; its best similarity, Umeyama 1991, lies in the plane of A and B). The violation
/// is the farthest way of a corner, a length.
#[derive(Clone, Debug)]
pub struct RegularPolygon {
    turns: Vec<[f64; 2]>,  // (c_i, s_i)
    others: Vec<Vec<f64>>, // an orthonormal basis of what is orthogonal to 1, c and s
}

/// A polygon of less than three corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooFewCorners(pub usize);

impl std::fmt::Display for TooFewCorners {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "a polygon of {} corners has no shape; give it at least 3", self.0)
    }
}

impl std::error::Error for TooFewCorners {}

impl RegularPolygon {
    /// With so many corners.
    ///
    /// # Errors
    /// Less than three.
    pub fn new(corners: usize) -> Result<Self, TooFewCorners> {
        if corners < 3 {
            return Err(TooFewCorners(corners));
        }
        let size = (2.0 / corners as f64).sqrt();
        let turn = |i: usize| {
            let (sin, cos) = (std::f64::consts::TAU * i as f64 / corners as f64).sin_cos();
            [size * cos, size * sin]
        };
        let turns: Vec<[f64; 2]> = (0..corners).map(turn).collect();
        let column = |k: usize| turns.iter().map(|t| t[k]).collect();
        let others = complement(&[vec![1.0; corners], column(0), column(1)]);
        Ok(RegularPolygon { turns, others })
    }

    /// A and B.
    fn waves(&self, v: &[V3]) -> [V3; 2] {
        let mut waves = [[0.0; 3]; 2];
        for (v, turn) in v.iter().zip(&self.turns) {
            waves = [add(waves[0], turn[0], *v), add(waves[1], turn[1], *v)];
        }
        waves
    }

    /// a and b.
    fn nearest(&self, v: &[V3]) -> [V3; 2] {
        let [a, b] = self.waves(v);
        let svd = svd32([0, 1, 2].map(|d| [a[d], b[d]]));
        let (frame, size) = (rotation_thin(&svd), 0.5 * (svd.s[0] + svd.s[1]));
        [0, 1].map(|k| [0, 1, 2].map(|d| size * frame[d][k]))
    }

    fn corner(&self, i: usize, [a, b]: [V3; 2]) -> V3 {
        let [c, s] = self.turns[i];
        add(scale(c, a), s, b)
    }
}

impl Set for RegularPolygon {
    fn project(&self, _: usize, v: &mut [V3]) {
        if v.len() == self.turns.len() {
            let nearest = self.nearest(v);
            v.iter_mut().enumerate().for_each(|(i, v)| *v = self.corner(i, nearest));
        }
    }

    fn violation(&self, _: usize, v: &[V3]) -> f64 {
        if v.len() != self.turns.len() {
            return 0.0;
        }
        let nearest = self.nearest(v);
        largest(v.iter().enumerate().map(|(i, v)| norm(sub(*v, self.corner(i, nearest)))))
    }

    /// What is orthogonal to c and s vanishes, (|A| - |B|)/sqrt 2 = 0 and (|A + B| - |A - B|)/2 = 0: 3 (k - 3) + 2
    /// equations, whose gradients are orthonormal in the set.
    fn linearize(&self, _: usize, v: &[V3], _: f64, row: &mut dyn FnMut(Row<'_>)) {
        if v.len() != self.turns.len() {
            return;
        }
        for b in &self.others {
            let sum = v.iter().zip(b).fold([0.0; 3], |s, (v, b)| add(s, *b, *v));
            for d in 0..3 {
                let axis = [0, 1, 2].map(|c| f64::from(u8::from(c == d)));
                let gradient: Vec<V3> = b.iter().map(|b| scale(*b, axis)).collect();
                row(Row { value: sum[d], relation: Relation::Zero, gradient: &gradient });
            }
        }
        let [a, b] = self.waves(v);
        let (sum, difference) = (add(a, 1.0, b), sub(a, b));
        let length = std::f64::consts::FRAC_1_SQRT_2;
        let pairs = [([a, b], length), ([sum, difference], 0.5)];
        for (k, ([p, q], weight)) in pairs.into_iter().enumerate() {
            let along = [direction(p, q, weight), direction(q, p, -weight)];
            // d/dA and d/dB.
            let by = match k {
                0 => along,
                _ => [add(along[0], 1.0, along[1]), sub(along[0], along[1])],
            };
            let gradient: Vec<V3> = self.turns.iter().map(|[c, s]| add(scale(*c, by[0]), *s, by[1])).collect();
            let value = weight * (norm(p) - norm(q));
            row(Row { value, relation: Relation::Zero, gradient: &gradient });
        }
    }
}

/// size times the unit vector along a; of none one across the other.
fn direction(a: V3, other: V3, size: f64) -> V3 {
    let length = norm(a);
    if length > 0.0 { scale(size / length, a) } else { scale(size, across(other)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constraint::MeanCentred;
    use crate::constraint::laws;

    #[test]
    fn the_laws_hold() {
        for corners in [3, 4, 5, 8] {
            // Turned about an axis by equal angles.
            laws::check::<MeanCentred, _>(
                corners,
                |_| RegularPolygon::new(corners).unwrap(),
                |near, random| {
                    let axis = match random.below(2) {
                        0 => random.rotation()[0],
                        _ => cross(sub(near[1], near[0]), sub(near[2], near[0])),
                    };
                    let axis = scale(1.0 / norm(axis), axis);
                    let out = sub(near[0], scale(dot(near[0], axis), axis));
                    let side = cross(axis, out);
                    let turn = |i: usize| {
                        let (sin, cos) = (std::f64::consts::TAU * i as f64 / corners as f64).sin_cos();
                        add(scale(cos, out), sin, side)
                    };
                    (0..corners).map(turn).collect()
                },
            );
        }
    }

    #[test]
    fn squares_and_equilateral_triangles() {
        let square = RegularPolygon::new(4).unwrap();
        assert!(square.violation(0, &[[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]]) < 1e-15);
        // A quad in the order of a bow is none.
        assert!(square.violation(0, &[[1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [1.0, -1.0, 0.0]]) > 0.5);
        assert_eq!(RegularPolygon::new(2).unwrap_err(), TooFewCorners(2));
    }

    #[test]
    fn bad_corners_give_numbers() {
        for corners in laws::degenerate(6) {
            laws::finite(&RegularPolygon::new(6).unwrap(), &corners);
        }
    }
}
