//! The nearest point of an intersection of half-spaces, and what each of them contributes.

use super::{Touch, gap};
use crate::constraint::{V3, add, cross, dot, norm};

/// Of planes of which a point bears on several the sines between which are below this, one is enough.
const PARALLEL: f64 = 1e-7;
/// Of three planes whose normals span less than this volume, two are enough.
const FLAT: f64 = 1e-9;
/// How far behind a plane a point may be by rounding, in units of the numbers it comes from.
const ROUNDING: f64 = 1e-15;
/// Farther behind one of them by this part, planes leave no room at all.
const EMPTY: f64 = 1e-9;

/// The projection p of a point y to P = {p : n_i . p >= h_i}, p - y = sum_i l_i n_i with l_i > 0 for at most three
/// planes that p is on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Corner {
    at: [usize; 3], // places of planes
    l: V3,
    n: usize,
}

impl Corner {
    /// Of y among these planes; none where they leave no room. All sets of up to three are looked at, small ones first:
    /// the one whose numbers are not negative, and whose p is in front of all planes, is the only one.
    pub fn nearest(touches: &[Touch], y: V3) -> Option<Corner> {
        let behind = |i: usize| -gap(&touches[i], y);
        let scale = touches.iter().fold(norm(y), |m, t| m.max(t.height.abs()));
        let mut best: Option<(f64, Corner)> = None;
        // Whether it is the one.
        let mut look = |corner: Option<Corner>| -> bool {
            let Some(corner) = corner.filter(|c| c.l[..c.n].iter().all(|l| *l >= 0.0)) else { return false };
            let shift = corner.shift(touches);
            let p = add(y, 1.0, shift);
            let outside = |i: usize| if corner.at[..corner.n].contains(&i) { 0.0 } else { -gap(&touches[i], p) };
            let most = (0..touches.len()).map(outside).fold(0.0, f64::max);
            if best.is_none_or(|(least, _)| most < least) {
                best = Some((most, corner));
            }
            most <= ROUNDING * scale
        };
        let n = touches.len();
        let singles = (0..n).map(|i| Some(Corner { at: [i, 0, 0], l: [behind(i), 0.0, 0.0], n: 1 }));
        let pairs = (0..n).flat_map(|i| (0..i).map(move |j| [j, i]));
        let triples = (0..n).flat_map(|i| (0..i).flat_map(move |j| (0..j).map(move |k| [k, j, i])));
        let found = look(Some(Corner::default()))
            || singles.into_iter().any(&mut look)
            || pairs.map(|at| Corner::on_two(touches, at, at.map(behind))).any(&mut look)
            || triples.map(|at| Corner::on_three(touches, at, at.map(behind))).any(&mut look);
        let (most, corner) = best?;
        (found || most <= EMPTY * scale).then_some(corner)
    }

    /// On two planes that y is `d` behind: G l = d, G the matrix of products of normals.
    fn on_two(touches: &[Touch], [i, j]: [usize; 2], d: [f64; 2]) -> Option<Corner> {
        let (a, b) = (touches[i].normal, touches[j].normal);
        let across = cross(a, b);
        let det = dot(across, across);
        let cosine = dot(a, b);
        let l = [(d[0] - cosine * d[1]) / det, (d[1] - cosine * d[0]) / det, 0.0];
        (det > PARALLEL * PARALLEL).then_some(Corner { at: [i, j, 0], l, n: 2 })
    }

    /// On three planes that y is `d` behind: their common point.
    fn on_three(touches: &[Touch], at: [usize; 3], d: V3) -> Option<Corner> {
        let [a, b, c] = at.map(|i| touches[i].normal);
        let duals = [cross(b, c), cross(c, a), cross(a, b)];
        let det = dot(a, duals[0]);
        let shift = [0, 1, 2].map(|k| (0..3).map(|i| d[i] * duals[i][k]).sum::<f64>() / det);
        (det.abs() > FLAT).then(|| Corner { at, l: duals.map(|dual| dot(shift, dual) / det), n: 3 })
    }

    /// l of a plane.
    pub fn of(&self, plane: usize) -> f64 {
        self.at[..self.n].iter().position(|i| *i == plane).map_or(0.0, |i| self.l[i])
    }

    /// p - y
    pub fn shift(&self, touches: &[Touch]) -> V3 {
        let mut shift = [0.0; 3];
        for (i, l) in self.at[..self.n].iter().zip(self.l) {
            shift = add(shift, l, touches[*i].normal);
        }
        shift
    }

    /// 1 - dp/dy: the projection to the span of the normals of planes that p is held by.
    pub fn block(&self, touches: &[Touch]) -> [V3; 3] {
        let normals = self.at.map(|i| touches.get(i).map_or([0.0; 3], |t| t.normal));
        let identity = |i: usize, j: usize| f64::from(u8::from(i == j));
        let square = |u: V3| [0, 1, 2].map(|i| [0, 1, 2].map(|j| u[i] * u[j]));
        match self.n {
            0 => [[0.0; 3]; 3],
            1 => square(normals[0]),
            2 => {
                let across = cross(normals[0], normals[1]);
                let length = norm(across);
                let edge = square(across.map(|c| c / length));
                [0, 1, 2].map(|i| [0, 1, 2].map(|j| identity(i, j) - edge[i][j]))
            }
            _ => [0, 1, 2].map(|i| [0, 1, 2].map(|j| identity(i, j))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proxel_testkit::random::SplitMix;

    fn plane(normal: V3, height: f64) -> Touch {
        let length = norm(normal);
        Touch { normal: normal.map(|n| n / length), height, ..Touch::default() }
    }

    /// Dykstra's projections one after the other: slow, and nothing else.
    fn dykstra(touches: &[Touch], y: V3) -> V3 {
        let (mut p, mut rest) = (y, vec![[0.0; 3]; touches.len()]);
        for _ in 0..100_000 {
            for (t, rest) in touches.iter().zip(&mut rest) {
                let from = add(p, 1.0, *rest);
                let behind = (-gap(t, from)).max(0.0);
                p = add(from, behind, t.normal);
                *rest = [0, 1, 2].map(|d| from[d] - p[d]);
            }
        }
        p
    }

    #[test]
    fn it_is_the_nearest_point_of_the_intersection() {
        let mut random = SplitMix::new(3);
        for n in 1..=5 {
            for _ in 0..12 {
                // All have the origin in front of them.
                let touches: Vec<Touch> = (0..n)
                    .map(|_| {
                        let [a, b, c, h]: [f64; 4] = random.array(-1.0, 1.0);
                        plane([0.7 * a, 1.0 + 0.3 * b, 0.7 * c], -0.3 * h.abs())
                    })
                    .collect();
                let y: V3 = random.array(-1.5, 0.5);
                let corner = Corner::nearest(&touches, y).expect("there is room");
                let (p, slow) = (add(y, 1.0, corner.shift(&touches)), dykstra(&touches, y));
                assert!(norm([0, 1, 2].map(|d| p[d] - slow[d])) < 1e-7, "{touches:?} {y:?} {p:?} {slow:?}");
                assert!(touches.iter().all(|t| gap(t, p) > -1e-14));
                assert!((0..n).all(|i| corner.of(i) >= 0.0));
                // Its derivative.
                let block = corner.block(&touches);
                for d in 0..3 {
                    let near = |h: f64| {
                        let mut z = y;
                        z[d] += h;
                        Corner::nearest(&touches, z).expect("there is room").shift(&touches)
                    };
                    let (more, less) = (near(1e-7), near(-1e-7));
                    for i in 0..3 {
                        let slope = (less[i] - more[i]) / 2e-7;
                        assert!((slope - block[i][d]).abs() < 1e-6, "{slope} {}", block[i][d]);
                    }
                }
            }
        }
    }

    #[test]
    fn planes_that_leave_no_room_are_told() {
        let apart = [plane([0.0, 1.0, 0.0], 1.0), plane([0.0, -1.0, 0.0], 1.0)];
        assert!(Corner::nearest(&apart, [0.3, 0.2, 0.1]).is_none());
        let (same, y) = (vec![plane([0.0, 1.0, 0.0], 1.0); 3], [0.3, 0.2, 0.1]);
        let corner = Corner::nearest(&same, y).expect("there is room");
        assert!((corner.of(0) - 0.8).abs() < 1e-15 && corner.of(1) == 0.0);
        assert!(Corner::nearest(&[], y).is_some_and(|c| c.shift(&[]) == [0.0; 3]));
    }
}
